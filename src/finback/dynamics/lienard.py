"""The reduced equation of motion in Liénard form: one second-order equation for alpha."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError

NORMAL_95: Final = 1.959963984540054
"""Half-width of the central 95 % of a normal distribution, in standard deviations."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """A polynomial whose coefficients depend on uncertain parameters θ.

    Attributes:
        polynomial: the curve.
        sensitivity: derivative of its coefficients by θ, shape (terms, p), in SI.
    """

    polynomial: Polynomial
    sensitivity: FloatArray

    def __post_init__(self) -> None:
        """Freeze and check the sensitivity."""
        object.__setattr__(self, "sensitivity", frozen_array(self.sensitivity))
        terms = self.polynomial.coefficients.size
        if self.sensitivity.ndim != 2 or self.sensitivity.shape[0] != terms:
            raise InputError(f"{terms} terms need as many rows of sensitivity, got shape {self.sensitivity.shape}")

    def __call__(self, *values: ArrayLike) -> FloatArray:
        """Evaluate at one value (or broadcastable array) per variable."""
        return self.polynomial(*values)

    def gradient(self, *values: ArrayLike) -> FloatArray:
        """Return the derivative of the value by θ, shape (..., p)."""
        return self.polynomial.term_values(*values) @ self.sensitivity

    def moved(self, change: FloatArray) -> Curve:
        """Return the curve of other parameters, θ + change (p,), to first order."""
        coefficients = frozen_array(self.polynomial.coefficients + self.sensitivity @ change)
        return Curve(polynomial=replace(self.polynomial, coefficients=coefficients), sensitivity=self.sensitivity)

    def derivative(self, variable: str) -> Curve:
        """Return the partial derivative by a variable, with its own sensitivity."""
        column = self.polynomial.variables.index(variable)
        exponents = self.polynomial.powers[:, column]
        keep = exponents > 0
        return Curve(
            polynomial=self.polynomial.derivative(variable),
            sensitivity=frozen_array(self.sensitivity[keep] * exponents[keep, np.newaxis]),
        )

    @property
    def ascending(self) -> FloatArray:
        """The coefficients of a curve in one variable by rising power, gaps filled with 0; shape (degree + 1,)."""
        if len(self.polynomial.variables) != 1:
            raise InputError(f"a curve in {', '.join(self.polynomial.variables)} has no single row of coefficients")
        exponents = self.polynomial.powers[:, 0]
        row = np.zeros(int(exponents.max(initial=0)) + 1)
        row[exponents] = self.polynomial.coefficients
        return frozen_array(row)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LienardSystem:
    """x'' = f(x) x' + g(x) + c₁ δ + c₂ δ', where x is alpha and δ the elevator (Shi & Fan 2013, Eq. 10-12, 36).

    An equilibrium is a zero of g(x) + c₁ δ; there the Jacobian in (x, x') has trace f(x) and determinant −g'(x).
    Note that x' is dα/dt, not q; ``pitch_rate`` leads back to the (alpha, q) plane.

    Attributes:
        damping: f in 1/s, a curve in ``alpha_rad``.
        force: g with its constant, rad/s², a curve in ``alpha_rad``.
        elevator_gain: c₁ in 1/s².
        elevator_gain_sensitivity: derivative of c₁ by θ, shape (p,).
        elevator_rate_gain: c₂ in 1/s; a step of the elevator by D makes x' jump by c₂ D while q is continuous.
        elevator_rate_gain_sensitivity: derivative of c₂ by θ, shape (p,).
        pitch_rate: q where dα/dt = 0, rad/s, a curve in (``alpha_rad``, ``elevator_rad``).
        pitch_rate_gain: derivative of q by dα/dt at a held angle and elevator, a pure number near 1.
        covariance: of θ, shape (p, p); zero for a system that is exact by definition.
        domain: low and high of alpha and of the elevator, in rad, where data supported the model; shape (2, 2).
    """

    damping: Curve
    force: Curve
    elevator_gain: float
    elevator_gain_sensitivity: FloatArray
    elevator_rate_gain: float
    elevator_rate_gain_sensitivity: FloatArray
    pitch_rate: Curve
    pitch_rate_gain: float
    covariance: FloatArray
    domain: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays and check that all parts know the same θ."""
        for name in ("elevator_gain_sensitivity", "elevator_rate_gain_sensitivity", "covariance", "domain"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        for curve in (self.damping, self.force):
            if curve.polynomial.variables != ("alpha_rad",):
                raise InputError(f"damping and force are curves in alpha_rad, got {curve.polynomial.variables}")
        if self.pitch_rate.polynomial.variables != ("alpha_rad", "elevator_rad"):
            raise InputError(
                f"the pitch rate is a curve in alpha_rad and elevator_rad, got {self.pitch_rate.polynomial.variables}"
            )
        size = self.elevator_gain_sensitivity.size
        widths = {curve.sensitivity.shape[1] for curve in (self.damping, self.force, self.pitch_rate)}
        widths |= {self.elevator_gain_sensitivity.size, self.elevator_rate_gain_sensitivity.size}
        if self.covariance.shape != (size, size) or widths != {size}:
            raise InputError(
                f"sensitivities by {sorted(widths)} parameters do not fit a covariance of shape {self.covariance.shape}"
            )
        if self.domain.shape != (2, 2):
            raise InputError(f"the domain has shape {self.domain.shape}, expected (2, 2): alpha, elevator")

    def holding_elevator(self, alpha_rad: ArrayLike) -> FloatArray:
        """Return the elevator that holds an angle in equilibrium: δ = −g(alpha)/c₁, exact, for c₁ ≠ 0."""
        return -self.force(alpha_rad) / self.elevator_gain

    def holding_elevator_gradient(self, alpha_rad: float) -> FloatArray:
        """Return the derivative by θ of the elevator that holds this angle, shape (p,)."""
        elevator = self.holding_elevator(alpha_rad)
        return -(self.force.gradient(alpha_rad) + self.elevator_gain_sensitivity * elevator) / self.elevator_gain

    def pitch_rate_at(self, alpha_rad: ArrayLike, alpha_dot_rad_s: ArrayLike, elevator_rad: ArrayLike) -> FloatArray:
        """Return q in rad/s for a state (alpha, dα/dt), which is not dα/dt."""
        return self.pitch_rate(alpha_rad, elevator_rad) + self.pitch_rate_gain * np.asarray(alpha_dot_rad_s)

    def supports(self, alpha_rad: ArrayLike) -> NDArray[np.bool_]:
        """Tell where an angle lies inside the alpha range of the data.

        The elevator enters linearly, so it is the shape in alpha that must not be extrapolated.
        """
        alpha = np.asarray(alpha_rad, dtype=np.float64)
        inside: NDArray[np.bool_] = (self.domain[0, 0] <= alpha) & (alpha <= self.domain[0, 1])
        return inside

    def moved(self, change: FloatArray) -> LienardSystem:
        """Return the system of other parameters, θ + change (p,), to first order."""
        return replace(
            self,
            damping=self.damping.moved(change),
            force=self.force.moved(change),
            elevator_gain=self.elevator_gain + float(self.elevator_gain_sensitivity @ change),
            elevator_rate_gain=self.elevator_rate_gain + float(self.elevator_rate_gain_sensitivity @ change),
            pitch_rate=self.pitch_rate.moved(change),
        )

    def root_shift(self, gradient: FloatArray, slope: float) -> FloatArray:
        """Return the derivative by θ of a root of a curve, −gradient/slope, shape (p,).

        It is nan, not known, where the slope is zero: there the root moves as a square root.
        """
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            return np.where(slope == 0.0, np.nan, -gradient / slope)

    def interval(self, value: float, gradient: FloatArray) -> FloatArray:
        """Return the 95 % interval of a value with this derivative by θ (delta method), shape (2,).

        It is linear in θ: exact for small uncertainty, too narrow or too wide where the value bends within it.
        A derivative that is not finite gives an infinite interval.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            variance = float(gradient @ self.covariance @ gradient)
        if not np.isfinite(variance):
            return frozen_array([-np.inf, np.inf])
        half = NORMAL_95 * max(0.0, variance) ** 0.5  # rounding can leave a variance of -1e-30 where it should be 0
        return frozen_array([value - half, value + half])
