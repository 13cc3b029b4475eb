"""The form of the model that is fitted: each rate a sum of 1, q, alpha … alpha^n and the elevator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """Eq. (4) and the explicit form of Eq. (5) of Shi & Fan (2013), at given orders.

    Coefficients stand in the order 1, q, alpha, alpha² …, elevator; those of dα/dt first.

    Attributes:
        alpha_order: highest power of alpha in dα/dt and in dq/dt.
    """

    alpha_order: tuple[int, int]

    @property
    def sizes(self) -> tuple[int, int]:
        """Number of coefficients of dα/dt and of dq/dt."""
        return self.alpha_order[0] + 3, self.alpha_order[1] + 3

    @property
    def size(self) -> int:
        """Number of all coefficients."""
        return sum(self.sizes)

    def split(self, coefficients: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the coefficients of dα/dt and of dq/dt."""
        return coefficients[: self.sizes[0]], coefficients[self.sizes[0] :]

    def powers(self, equation: int) -> tuple[tuple[int, int, int], ...]:
        """Return the exponents of (alpha, q, elevator) of each term of one equation (0: dα/dt, 1: dq/dt)."""
        alpha = tuple((k, 0, 0) for k in range(1, self.alpha_order[equation] + 1))
        return ((0, 0, 0), (0, 1, 0), *alpha, (0, 0, 1))

    def labels(self) -> tuple[str, ...]:
        """Return a readable name for each coefficient, such as ``alpha^2 in dq/dt``."""
        names = []
        for equation, rate in enumerate(("dalpha/dt", "dq/dt")):
            alpha = ("alpha", *(f"alpha^{k}" for k in range(2, self.alpha_order[equation] + 1)))
            names += [f"{term} in {rate}" for term in ("1", "q", *alpha, "elevator")]
        return tuple(names)

    def rates(self, coefficients: FloatArray, state: FloatArray, elevator_rad: FloatArray) -> FloatArray:
        """Return (dα/dt, dq/dt), shape (n, 2), at ``state`` (alpha, q), shape (n, 2), and elevator, shape (n,)."""
        alpha, q = state[:, 0], state[:, 1]
        columns = [
            c[0] + c[1] * q + alpha * np.polynomial.polynomial.polyval(alpha, c[2:-1]) + c[-1] * elevator_rad
            for c in self.split(coefficients)
        ]
        return np.stack(columns, axis=1)

    def jacobian(self, coefficients: FloatArray, state: FloatArray) -> FloatArray:
        """Return the derivative of the rates by (alpha, q), shape (n, 2, 2): [:, rate, variable]."""
        result = np.empty((len(state), 2, 2))
        for equation, c in enumerate(self.split(coefficients)):
            slope = c[2:-1] * np.arange(1, c.size - 2)
            result[:, equation, 0] = np.polynomial.polynomial.polyval(state[:, 0], slope)
            result[:, equation, 1] = c[1]
        return result

    def model(self, coefficients: FloatArray, covariance: FloatArray, domain: ArrayLike) -> PolynomialModel:
        """Return the model with these coefficients; ``domain`` is the box of (alpha, q, elevator), shape (3, 2)."""
        polynomials = [
            Polynomial.build(
                dict(zip(self.powers(equation), values.tolist(), strict=True)),
                variables=VARIABLES,
                value_unit=unit,
                domain=domain,
            )
            for equation, (values, unit) in enumerate(zip(self.split(coefficients), ("rad_s", "rad_s2"), strict=True))
        ]
        return PolynomialModel(alpha_dot=polynomials[0], q_dot=polynomials[1], covariance=covariance)
