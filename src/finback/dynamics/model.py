"""The reduced model of longitudinal motion: polynomials for the rates of alpha and q."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError

STATE: Final = ("alpha_rad", "q_rad_s")
INPUT: Final = "elevator_rad"
VARIABLES: Final = (*STATE, INPUT)
"""Variables of both polynomials of an explicit model, in this order."""

_ROUNDING: Final = 1e-9
"""What rounding may leave of asymmetry, and of a negative eigenvalue, in a covariance scaled to a unit diagonal. A
product of factors in double precision leaves about n times 1e-16, an edited or cut file far more."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PolynomialModel:
    """dα/dt and dq/dt as polynomials in (alpha, q, elevator), in SI (Shi & Fan 2013, Eq. 4 and 5).

    Eq. (5) also has a term in dα/dt. Where Eq. (4) holds, that term is a combination of the others, so the model
    keeps the explicit form, with dα/dt substituted; ``finback.dynamics.reduction`` gives the paper's form back.

    Attributes:
        alpha_dot: dα/dt in rad/s, over ``VARIABLES``.
        q_dot: dq/dt in rad/s², over ``VARIABLES``.
        covariance: of all coefficients, those of ``alpha_dot`` first, shape (n, n) in SI, symmetric and positive
            semidefinite (to 1e-9 of the standard deviations); zero for a model that is exact by definition.
    """

    alpha_dot: Polynomial
    q_dot: Polynomial
    covariance: FloatArray

    def __post_init__(self) -> None:
        """Freeze and check the covariance; check variables, units and shapes."""
        object.__setattr__(self, "covariance", frozen_array(self.covariance))
        for polynomial, unit in ((self.alpha_dot, "rad_s"), (self.q_dot, "rad_s2")):
            if polynomial.variables != VARIABLES or polynomial.value_unit != unit:
                raise InputError(
                    f"a model needs polynomials in {VARIABLES} with values in rad_s and rad_s2, "
                    f"got {polynomial.variables} in {polynomial.value_unit}",
                    hint="convert with Polynomial.to_si()",
                )
        size = self.alpha_dot.coefficients.size + self.q_dot.coefficients.size
        if self.covariance.shape != (size, size):
            raise InputError(f"the covariance has shape {self.covariance.shape}, expected ({size}, {size})")
        _check_covariance(self.covariance)

    @property
    def coefficients(self) -> FloatArray:
        """All coefficients, those of ``alpha_dot`` first, shape (n,)."""
        return np.concatenate([self.alpha_dot.coefficients, self.q_dot.coefficients])

    def with_coefficients(self, coefficients: FloatArray) -> PolynomialModel:
        """Return the same model with other coefficients, in the order of ``coefficients``."""
        split = self.alpha_dot.coefficients.size
        return replace(
            self,
            alpha_dot=replace(self.alpha_dot, coefficients=frozen_array(coefficients[:split])),
            q_dot=replace(self.q_dot, coefficients=frozen_array(coefficients[split:])),
        )


def _check_covariance(covariance: FloatArray) -> None:
    """Raise InputError unless random numbers can have this covariance, rounding aside."""
    if not np.isfinite(covariance).all():
        raise InputError("the covariance holds numbers that are not finite")
    variances = np.diag(covariance)
    if (variances < 0.0).any():
        raise InputError(f"the covariance has a negative variance: {variances.min():.6g}")
    exact = variances == 0.0
    if covariance[exact].any() or covariance[:, exact].any():
        raise InputError("the covariance ties a coefficient without variance to another one")
    deviations = np.sqrt(variances[~exact])
    if not deviations.size:
        return
    with np.errstate(over="ignore"):  # inf is refused below
        correlation = covariance[np.ix_(~exact, ~exact)] / deviations[:, None] / deviations
    if not (np.abs(correlation) <= 1.0 + _ROUNDING).all():
        raise InputError("the covariance of two coefficients exceeds their standard deviations")
    if (np.abs(correlation - correlation.T) > _ROUNDING).any():
        raise InputError("the covariance is not symmetric")
    least = float(np.linalg.eigvalsh(correlation)[0])
    if least < -_ROUNDING:
        raise InputError(f"the covariance is not positive semidefinite: scaled, it has the eigenvalue {least:.6g}")
