"""Where the trace of an equilibrium vanishes as the elevator moves: Hopf points, neutral saddles, or both at once.

All are zeros of f, a polynomial in the angle, and the elevator that holds the angle follows: nothing is stepped over.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.linearity import intervals, moving
from finback.dynamics.roots import RealRoot, real_roots, sign_across

_ROUNDINGS: Final = 32  # operations on each term of the first coefficient, with room


class Criticality(StrEnum):
    """Which cycles are born at a Hopf point."""

    SUPERCRITICAL = "supercritical"
    """stable ones, on the side where the equilibrium is unstable"""
    SUBCRITICAL = "subcritical"
    """unstable ones, on the side where the equilibrium is stable"""
    DEGENERATE = "degenerate"
    """the first Lyapunov coefficient is zero within rounding: the higher ones decide"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Hopf:
    """A pair of eigenvalues crosses the imaginary axis.

    Attributes:
        elevator_rad: elevator there.
        alpha_rad: angle.
        q_rad_s: pitch rate.
        frequency_rad_s: ω, the eigenvalues are ± iω; the period of the cycles born is 2π/ω.
        lyapunov_1_s: first Lyapunov coefficient a, where r' = a r³ for the amplitude r of alpha (Guckenheimer &
            Holmes 1983, Eq. 3.4.11): exactly (f'' ω² + f' g'') / (16 ω²), in 1/s per rad².
        criticality: its sign, or that it cannot be told.
        crossing_speed_1_s: change of the eigenvalues' real part per rad of elevator, with its sign: f' c₁ / (2 ω²).
        elevator_interval_rad: 95 % interval by the delta method, shape (2,); infinite where not determined
            (``linearity``).
        alpha_interval_rad: the same for the angle.
        lyapunov_interval_1_s: the same for the first Lyapunov coefficient.
        bracket_rad: two angles between which f changes its sign beyond rounding, shape (2,).
        residual: f(alpha) in 1/s, as evaluated.
        in_domain: whether the angle lies where data supported the model.
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    frequency_rad_s: float
    lyapunov_1_s: float
    criticality: Criticality
    crossing_speed_1_s: float
    elevator_interval_rad: FloatArray
    alpha_interval_rad: FloatArray
    lyapunov_interval_1_s: FloatArray
    bracket_rad: FloatArray
    residual: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_interval_rad", "alpha_interval_rad", "lyapunov_interval_1_s", "bracket_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class NeutralSaddle:
    """A saddle whose eigenvalues are opposite: no bifurcation of equilibria; loops through it change stability.

    Attributes:
        elevator_rad: elevator there.
        alpha_rad: angle.
        q_rad_s: pitch rate.
        eigenvalue_1_s: the positive of the two eigenvalues.
        elevator_interval_rad: 95 % interval by the delta method, shape (2,); infinite where not determined
            (``linearity``).
        alpha_interval_rad: the same for the angle.
        bracket_rad: two angles between which f changes its sign beyond rounding, shape (2,).
        residual: f(alpha) in 1/s, as evaluated.
        in_domain: whether the angle lies where data supported the model.
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    eigenvalue_1_s: float
    elevator_interval_rad: FloatArray
    alpha_interval_rad: FloatArray
    bracket_rad: FloatArray
    residual: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_interval_rad", "alpha_interval_rad", "bracket_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BogdanovTakens:
    """Trace and determinant vanish together within rounding: both eigenvalues are zero.

    It needs two parameters; with the elevator alone it is a coincidence, and a small change of the model turns it
    into a Hopf point or a neutral saddle beside a fold.

    Attributes:
        elevator_rad: elevator there.
        alpha_rad: angle.
        q_rad_s: pitch rate.
        force_curvature_1_s2: a = g''/2, per rad: with u = alpha − alpha₀ the system is u'' = a u² + b u u' + ….
        damping_slope_1_s: b = f', per rad.
        elevator_interval_rad: 95 % interval by the delta method, of the zero of the trace, shape (2,).
        alpha_interval_rad: the same for the angle.
        bracket_rad: two angles between which f changes its sign beyond rounding, shape (2,).
        residual: f(alpha) in 1/s, as evaluated.
        determinant_1_s2: determinant of the Jacobian, as evaluated.
        in_domain: whether the angle lies where data supported the model.
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    force_curvature_1_s2: float
    damping_slope_1_s: float
    elevator_interval_rad: FloatArray
    alpha_interval_rad: FloatArray
    bracket_rad: FloatArray
    residual: float
    determinant_1_s2: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_interval_rad", "alpha_interval_rad", "bracket_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what is not finite has an infinite interval
def hopf_points(system: LienardSystem) -> tuple[Hopf, ...]:
    """Return all Hopf points, at whatever elevator, by rising angle.

    None where the elevator has no effect, and none where the damping is zero everywhere (a conservative system).
    """
    return tuple(_hopf(system, root) for root, sign in _zeros(system) if sign > 0)


@np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what is not finite has an infinite interval
def neutral_saddles(system: LienardSystem) -> tuple[NeutralSaddle, ...]:
    """Return all saddles at which the trace changes its sign, by rising angle; none where there are no Hopf points."""
    return tuple(_neutral_saddle(system, root) for root, sign in _zeros(system) if sign < 0)


@np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what is not finite has an infinite interval
def bogdanov_takens_points(system: LienardSystem) -> tuple[BogdanovTakens, ...]:
    """Return the equilibria where the trace changes its sign and the determinant has none, by rising angle."""
    return tuple(_bogdanov_takens(system, root) for root, sign in _zeros(system) if sign == 0)


def _zeros(system: LienardSystem) -> Iterator[tuple[RealRoot, int]]:
    """Yield the sign changes of the trace with the sign of the determinant there."""
    damping = system.damping.ascending
    if system.elevator_gain == 0.0 or not damping.any():
        return
    slope = system.force.derivative("alpha_rad").ascending.tolist()
    for root in real_roots(damping.tolist()):
        if root.crossing:
            yield root, -sign_across(slope, root.bracket)


@final
@dataclass(frozen=True, slots=True)
class _Place:
    """What all three have in common."""

    elevator: float
    q: float
    alpha_gradient: FloatArray
    elevator_interval: FloatArray
    alpha_interval: FloatArray


def _place(system: LienardSystem, root: RealRoot) -> _Place:
    alpha = root.value
    elevator = float(system.holding_elevator(alpha))
    slope = float(system.damping.derivative("alpha_rad")(alpha)) if root.resolved else 0.0
    force_slope = float(system.force.derivative("alpha_rad")(alpha))
    alpha_gradient = system.root_shift(system.damping.gradient(alpha), slope)
    elevator_gradient = system.holding_elevator_gradient(alpha) - force_slope / system.elevator_gain * alpha_gradient
    stated = intervals(
        system,
        np.array([elevator, alpha]),
        np.stack([elevator_gradient, alpha_gradient]),
        moving(system, lambda moved: _again(moved, alpha, slope)),
    )
    return _Place(
        elevator=elevator,
        q=float(system.pitch_rate(alpha, elevator)),
        alpha_gradient=alpha_gradient,
        elevator_interval=stated[0],
        alpha_interval=stated[1],
    )


def _again(system: LienardSystem, near_rad: float, slope: float) -> FloatArray:
    """Return elevator and alpha of the zero of the trace nearest to an angle that crosses the same way, or nan."""
    damping, across = system.damping.ascending, system.damping.derivative("alpha_rad")
    if system.elevator_gain == 0.0 or not damping.any():
        return np.full(2, np.nan)
    found = [root.value for root in real_roots(damping.tolist()) if root.crossing and root.resolved]
    alike = [alpha for alpha in found if float(across(alpha)) * slope > 0.0]
    if not alike:
        return np.full(2, np.nan)
    alpha = min(alike, key=lambda angle: abs(angle - near_rad))
    return np.array([float(system.holding_elevator(alpha)), alpha])


def _hopf(system: LienardSystem, root: RealRoot) -> Hopf:
    alpha, place = root.value, _place(system, root)
    damping_slope = system.damping.derivative("alpha_rad")
    force_slope = system.force.derivative("alpha_rad")
    square = -float(force_slope(alpha))
    lyapunov, gradient, sign = _lyapunov(system, root, place.alpha_gradient)
    known = np.isfinite(place.alpha_interval).all()
    return Hopf(
        elevator_rad=place.elevator,
        alpha_rad=alpha,
        q_rad_s=place.q,
        frequency_rad_s=math.sqrt(square),
        lyapunov_1_s=lyapunov,
        criticality=(Criticality.SUPERCRITICAL, Criticality.DEGENERATE, Criticality.SUBCRITICAL)[sign + 1],
        crossing_speed_1_s=0.5 * float(damping_slope(alpha)) * system.elevator_gain / square,
        elevator_interval_rad=place.elevator_interval,
        alpha_interval_rad=place.alpha_interval,
        lyapunov_interval_1_s=system.interval(lyapunov, gradient if known else np.full(gradient.size, np.nan)),
        bracket_rad=frozen_array(root.bracket),
        residual=float(system.damping(alpha)),
        in_domain=bool(system.supports(alpha)),
    )


def _lyapunov(system: LienardSystem, root: RealRoot, alpha_gradient: FloatArray) -> tuple[float, FloatArray, int]:
    """Return the first Lyapunov coefficient, its derivative by θ, and its sign, 0 where rounding hides it."""
    alpha = root.value
    f1 = system.damping.derivative("alpha_rad")
    g1 = system.force.derivative("alpha_rad")
    f2, g2 = f1.derivative("alpha_rad"), g1.derivative("alpha_rad")
    f3, g3 = f2.derivative("alpha_rad"), g2.derivative("alpha_rad")
    curves = (f1, f2, f3, g1, g2, g3)
    df, ddf, dddf, dg, ddg, dddg = (float(curve(alpha)) for curve in curves)
    value = (ddf - df * ddg / dg) / 16.0
    by_alpha = (dddf - (ddf * ddg + df * dddg) / dg + df * ddg * ddg / (dg * dg)) / 16.0
    by_theta = (
        f2.gradient(alpha)
        - (ddg * f1.gradient(alpha) + df * g2.gradient(alpha)) / dg
        + (df * ddg / (dg * dg)) * g1.gradient(alpha)
    ) / 16.0
    sizes = [float(np.abs(c.polynomial.term_values(alpha)) @ np.abs(c.polynomial.coefficients)) for c in curves]
    rounding = sizes[1] + (sizes[0] * abs(ddg) + abs(df) * sizes[4]) / abs(dg) + abs(df * ddg) * sizes[3] / (dg * dg)
    spread = abs(by_alpha) * max(abs(end - alpha) for end in root.bracket)
    clear = abs(value) > _ROUNDINGS * sys.float_info.epsilon * rounding / 16.0 + spread
    return value, by_theta + by_alpha * alpha_gradient, int(np.sign(value)) if clear else 0


def _neutral_saddle(system: LienardSystem, root: RealRoot) -> NeutralSaddle:
    alpha, place = root.value, _place(system, root)
    return NeutralSaddle(
        elevator_rad=place.elevator,
        alpha_rad=alpha,
        q_rad_s=place.q,
        eigenvalue_1_s=math.sqrt(float(system.force.derivative("alpha_rad")(alpha))),
        elevator_interval_rad=place.elevator_interval,
        alpha_interval_rad=place.alpha_interval,
        bracket_rad=frozen_array(root.bracket),
        residual=float(system.damping(alpha)),
        in_domain=bool(system.supports(alpha)),
    )


def _bogdanov_takens(system: LienardSystem, root: RealRoot) -> BogdanovTakens:
    alpha, place = root.value, _place(system, root)
    force_slope = system.force.derivative("alpha_rad")
    return BogdanovTakens(
        elevator_rad=place.elevator,
        alpha_rad=alpha,
        q_rad_s=place.q,
        force_curvature_1_s2=0.5 * float(force_slope.derivative("alpha_rad")(alpha)),
        damping_slope_1_s=float(system.damping.derivative("alpha_rad")(alpha)),
        elevator_interval_rad=place.elevator_interval,
        alpha_interval_rad=place.alpha_interval,
        bracket_rad=frozen_array(root.bracket),
        residual=float(system.damping(alpha)),
        determinant_1_s2=-float(force_slope(alpha)),
        in_domain=bool(system.supports(alpha)),
    )
