"""The reduced model of longitudinal motion: polynomials for the rates of alpha and q."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError
from finback.units import si_unit, unit_of

STATE: Final = ("alpha_rad", "q_rad_s")
INPUT: Final = "elevator_rad"
VARIABLES: Final = (*STATE, INPUT)
"""The first variables of both polynomials of a model, in this order; further inputs follow."""

_ROUNDING: Final = 1e-9
"""What rounding may leave of asymmetry, and of a negative eigenvalue, in a covariance scaled to a unit diagonal. A
product of factors in double precision leaves about n times 1e-16, an edited or cut file far more."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PolynomialModel:
    """dα/dt and dq/dt as polynomials in (alpha, q, elevator), in SI (Shi & Fan 2013, Eq. 4 and 5).

    They may have further inputs, such as ``canard_rad``, ``beta_rad``, ``p_rad_s``: everything that moves the aircraft
    in pitch without being moved by it. ``held`` gives them constant values; what is analyzed or integrated is a model
    without further inputs.

    Eq. (5) also has a term in dα/dt. Where Eq. (4) holds, that term is a combination of the others, so the model
    keeps the explicit form, with dα/dt substituted; ``finback.dynamics.reduction`` gives the paper's form back.

    Attributes:
        alpha_dot: dα/dt in rad/s, over ``VARIABLES`` and the further inputs.
        q_dot: dq/dt in rad/s², over the same variables.
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
            names = polynomial.variables
            further_in_si = all(si_unit(unit_of(name)) == unit_of(name) for name in names[len(VARIABLES) :])
            if names[: len(VARIABLES)] != VARIABLES or not further_in_si or polynomial.value_unit != unit:
                raise InputError(
                    f"a model needs polynomials in {VARIABLES} and further inputs in SI, with values in rad_s and "
                    f"rad_s2, got {polynomial.variables} in {polynomial.value_unit}",
                    hint="convert with Polynomial.to_si()",
                )
        if self.alpha_dot.variables != self.q_dot.variables:
            raise InputError(
                f"both polynomials of a model have the same variables, got {self.alpha_dot.variables} and "
                f"{self.q_dot.variables}"
            )
        size = self.alpha_dot.coefficients.size + self.q_dot.coefficients.size
        if self.covariance.shape != (size, size):
            raise InputError(f"the covariance has shape {self.covariance.shape}, expected ({size}, {size})")
        check_covariance(self.covariance)

    @property
    def coefficients(self) -> FloatArray:
        """All coefficients, those of ``alpha_dot`` first, shape (n,)."""
        return np.concatenate([self.alpha_dot.coefficients, self.q_dot.coefficients])

    @property
    def inputs(self) -> tuple[str, ...]:
        """The inputs beside the elevator; empty for a model that can be analyzed as it is."""
        return self.alpha_dot.variables[len(VARIABLES) :]

    def held(self, **inputs: float) -> PolynomialModel:
        """Return the model with these further inputs at constant values, in SI: ``held(beta_rad=0.1)``.

        The covariance is carried through exactly: each new coefficient is a linear combination of old ones.

        Raises:
            InputError: a name is no further input of the model, or a value is not finite.
        """
        unknown = [name for name in inputs if name not in self.inputs]
        if unknown:
            raise InputError(
                f"the model has no further input {', '.join(unknown)}",
                hint=f"it has {', '.join(self.inputs) or 'none beside the elevator'}",
            )
        alpha_dot, q_dot, covariance = substituted(self.alpha_dot, self.q_dot, self.covariance, inputs)
        return PolynomialModel(alpha_dot=alpha_dot, q_dot=q_dot, covariance=covariance)

    def refuse_inputs(self, purpose: str) -> None:
        """Raise InputError if there are further inputs: for this purpose they need values."""
        if self.inputs:
            values = ", ".join(f"{name}=…" for name in self.inputs)
            raise InputError(
                f"{purpose}: the model has further inputs ({', '.join(self.inputs)})",
                hint=f"give them constant values: model.held({values})",
            )

    def with_coefficients(self, coefficients: FloatArray) -> PolynomialModel:
        """Return the same model with other coefficients, in the order of ``coefficients``."""
        split = self.alpha_dot.coefficients.size
        return replace(
            self,
            alpha_dot=replace(self.alpha_dot, coefficients=frozen_array(coefficients[:split])),
            q_dot=replace(self.q_dot, coefficients=frozen_array(coefficients[split:])),
        )


def substituted(
    first: Polynomial, second: Polynomial, covariance: FloatArray, values: Mapping[str, float]
) -> tuple[Polynomial, Polynomial, FloatArray]:
    """Hold some variables of two polynomials at constant values, and carry the covariance of their coefficients.

    Args:
        first: a polynomial.
        second: another one over the same variables.
        covariance: of all coefficients, those of ``first`` first, shape (n, n).
        values: variable -> value, in the variable's own unit.

    Returns:
        Both polynomials in the variables that remain, and the covariance of their coefficients.
    """
    from scipy.linalg import block_diag  # noqa: PLC0415 - a quarter of a second, not for all who read a study

    one, of_first = first.substitution(values)
    two, of_second = second.substitution(values)
    carry = block_diag(of_first, of_second)
    return one, two, frozen_array(carry @ covariance @ carry.T)


def check_covariance(covariance: FloatArray) -> None:
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
