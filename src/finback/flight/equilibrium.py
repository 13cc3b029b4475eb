"""Equilibria of a planar field (alpha, q, elevator) -> (alpha_dot, q_dot), given only as a function.

All equilibria at one elevator, the whole curve elevator(alpha) of them, and the curve's folds. The field may be
piecewise smooth, as tabulated aerodynamics are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError, RefusedError
from finback.units import from_si

Field = Callable[[float, float, float], tuple[float, float]]
"""(alpha in rad, q in rad/s, elevator in rad) -> (alpha_dot in rad/s, q_dot in rad/s²)."""

ALPHA_STEP_RAD: Final = 0.005  # 0.29 deg: a few table cells; pairs of roots inside one step are found by minimization
_ALPHA_XTOL: Final = 1e-14  # rad; a root of a piecewise linear function is found to rounding
_BALANCED: Final = 1e-14  # rad/s: rounding of alpha_dot
_GOLDEN: Final = (math.sqrt(5.0) - 1.0) / 2.0
_FOLD_XTOL: Final = 1e-11  # rad, well below the 1e-9 that is promised
_SLOPE_STEP: Final = 1e-5  # rad: of central differences of elevator(alpha), whose rounding is about 1e-15
_JACOBIAN_STEP: Final = 1e-6  # rad and rad/s: inside a cell of a table, far above rounding
_KINK: Final = 1e-13  # rad of elevator: by this much a corner beats the smooth optimum beside it


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedEquilibrium:
    """A state in which the simulator stays.

    Attributes:
        elevator_rad: the elevator.
        alpha_rad: angle of attack.
        q_rad_s: pitch rate; on the rig not 0, it balances the turning of the flight path.
        stable: whether both eigenvalues of the linearized field have negative real parts.
        residual: larger of |alpha_dot| in rad/s and |q_dot| in rad/s².
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    stable: bool
    residual: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class EquilibriumCurve:
    """The elevator that holds each alpha, with the pitch rate there.

    Attributes:
        alpha_rad: shape (n,), increasing; alphas that no elevator inside the limits holds are left out.
        elevator_rad: shape (n,).
        q_rad_s: shape (n,).
        stable: shape (n,), bool.
    """

    alpha_rad: FloatArray
    elevator_rad: FloatArray
    q_rad_s: FloatArray
    stable: NDArray[np.bool_]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("alpha_rad", "elevator_rad", "q_rad_s"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        stable = np.array(self.stable, dtype=np.bool_)
        stable.setflags(write=False)
        object.__setattr__(self, "stable", stable)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedFold:
    """A fold of the equilibrium curve: an extremum of elevator(alpha), where two equilibria meet.

    Attributes:
        elevator_rad: the elevator at which they meet.
        alpha_rad: angle of attack there.
        q_rad_s: pitch rate there.
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float


def equilibria(
    field: Field,
    *,
    elevator_rad: float,
    alpha_limits_rad: tuple[float, float],
    alpha_step_rad: float = ALPHA_STEP_RAD,
) -> tuple[SimulatedEquilibrium, ...]:
    """Return all equilibria at an elevator, ordered by alpha.

    At each alpha of a grid, q is solved from alpha_dot = 0; then sign changes of q_dot are bracketed and solved, and
    every minimum of |q_dot| between two is searched for a pair of roots closer together than the grid.

    Args:
        field: the simulator's right-hand side.
        elevator_rad: the elevator.
        alpha_limits_rad: where to look.
        alpha_step_rad: the grid's step.

    Raises:
        RefusedError: alpha_dot = 0 cannot be solved for q.
    """
    grid = _grid(alpha_limits_rad, alpha_step_rad)

    def unbalance(alpha: float) -> float:
        return _balance(field, alpha, elevator_rad)[1]

    def negated(alpha: float) -> float:
        return -unbalance(alpha)

    values = [unbalance(alpha) for alpha in grid]
    roots = [alpha for alpha, value in zip(grid, values, strict=True) if value == 0.0]
    brackets = [index for index in range(len(grid) - 1) if _opposite(values[index], values[index + 1])]
    roots += [_root(unbalance, grid[index], grid[index + 1]) for index in brackets]
    for index in range(1, len(grid) - 1):
        before, here, after = values[index - 1 : index + 2]
        sign = math.copysign(1.0, here)
        if here != 0 and sign * before >= abs(here) <= sign * after:
            low, high = grid[index - 1], grid[index + 1]
            lowest = _minimum(unbalance if sign > 0 else negated, low, high)
            if sign * unbalance(lowest) < 0:
                roots += [_root(unbalance, low, lowest), _root(unbalance, lowest, high)]
    return tuple(_equilibrium(field, alpha, elevator_rad) for alpha in sorted(roots))


def trim(field: Field, *, elevator_rad: float, alpha_limits_rad: tuple[float, float]) -> SimulatedEquilibrium:
    """Return the stable equilibrium of smallest |alpha| at an elevator.

    Raises:
        RefusedError: there is none inside the limits.
    """
    found = equilibria(field, elevator_rad=elevator_rad, alpha_limits_rad=alpha_limits_rad)
    stable = [equilibrium for equilibrium in found if equilibrium.stable]
    if not stable:
        low, high = (from_si(limit, "deg") for limit in alpha_limits_rad)
        raise RefusedError(
            f"no stable equilibrium at elevator {from_si(elevator_rad, 'deg'):.4g} deg with alpha in"
            f" {low:.4g}…{high:.4g} deg ({len(found)} unstable)",
            hint="choose an elevator between the folds, or release the aircraft from a state",
        )
    return min(stable, key=lambda equilibrium: abs(equilibrium.alpha_rad))


def equilibrium_curve(
    field: Field, alpha_rad: ArrayLike, *, elevator_limits_rad: tuple[float, float]
) -> EquilibriumCurve:
    """Return the equilibrium curve elevator(alpha).

    Args:
        field: the simulator's right-hand side; the elevator's effect on q_dot must not change sign.
        alpha_rad: where, shape (n,), increasing.
        elevator_limits_rad: alphas that need an elevator outside are left out.
    """
    points = []
    for alpha in np.asarray(alpha_rad, dtype=np.float64).tolist():
        elevator = _holding_elevator(field, alpha, elevator_limits_rad)
        if math.isfinite(elevator):
            point = _equilibrium(field, alpha, elevator)
            points.append((alpha, elevator, point.q_rad_s, point.stable))
    columns = list(zip(*points, strict=True)) or [(), (), (), ()]
    return EquilibriumCurve(
        alpha_rad=frozen_array(columns[0]),
        elevator_rad=frozen_array(columns[1]),
        q_rad_s=frozen_array(columns[2]),
        stable=np.array(columns[3], dtype=np.bool_),
    )


def curve_folds(
    field: Field, curve: EquilibriumCurve, *, elevator_limits_rad: tuple[float, float]
) -> tuple[SimulatedFold, ...]:
    """Return the folds of an equilibrium curve, ordered by alpha: the extrema of elevator(alpha) inside it.

    Each is refined on the field itself, to 1e-9 rad in alpha where the curve is smooth and to the corner where a
    table has one. Extrema closer together than the curve's points are seen as one; gaps of the curve are not crossed.
    """
    alpha, elevator = curve.alpha_rad, curve.elevator_rad
    if alpha.size < 3:
        return ()
    widest = 1.5 * float(np.median(np.diff(alpha)))
    folds: list[SimulatedFold] = []
    for index in range(1, alpha.size - 1):
        before, here, after = elevator[index - 1 : index + 2]
        whole = max(alpha[index] - alpha[index - 1], alpha[index + 1] - alpha[index]) <= widest
        if whole and (here - before) * (after - here) <= 0 and before != here:
            sign = -1.0 if here > before else 1.0
            low, high = float(alpha[index - 1]), float(alpha[index + 1])
            folds += _refined_fold(field, low, high, sign=sign, limits_rad=elevator_limits_rad)
    return tuple(folds)


def _refined_fold(
    field: Field, low: float, high: float, *, sign: float, limits_rad: tuple[float, float]
) -> tuple[SimulatedFold, ...]:
    """Return the extremum between two alphas, or nothing if its elevator lies outside the limits."""

    def height(alpha: float) -> float:
        return sign * _holding_elevator(field, alpha, limits_rad)

    def slope(alpha: float) -> float:
        return height(alpha + _SLOPE_STEP) - height(alpha - _SLOPE_STEP)

    alpha = _minimum(height, low, high)
    # Comparing heights finds a smooth optimum only to the root of rounding; there the slope's zero is the better one.
    near = 10 * _SLOPE_STEP
    if slope(alpha - near) < 0 < slope(alpha + near):
        smooth = _root(slope, alpha - near, alpha + near)
        if height(smooth) <= height(alpha) + _KINK:
            alpha = smooth
    elevator = sign * height(alpha)
    if not math.isfinite(elevator):
        return ()
    return (SimulatedFold(elevator_rad=elevator, alpha_rad=alpha, q_rad_s=_balance(field, alpha, elevator)[0]),)


def _grid(alpha_limits_rad: tuple[float, float], step_rad: float) -> list[float]:
    low, high = alpha_limits_rad
    if not (math.isfinite(low) and math.isfinite(high) and low < high and step_rad > 0):
        shown = [from_si(angle, "deg") for angle in (low, high, step_rad)]
        raise InputError("no grid of alpha from {:.6g} to {:.6g} deg in steps of {:.6g} deg".format(*shown))
    grid: list[float] = np.linspace(low, high, max(3, math.ceil((high - low) / step_rad) + 1)).tolist()
    return grid


def _balance(field: Field, alpha: float, elevator: float) -> tuple[float, float]:
    """Return the q at which alpha_dot = 0, and q_dot there."""
    q, (alpha_dot, q_dot) = 0.0, field(alpha, 0.0, elevator)
    slope = 1.0  # of alpha_dot in q: 1 but for the small lift due to pitch rate
    for _ in range(50):
        if abs(alpha_dot) <= _BALANCED:
            return q, q_dot
        following = q - alpha_dot / slope
        if following == q:
            return q, q_dot
        value, q_dot = field(alpha, following, elevator)
        slope = (value - alpha_dot) / (following - q) or slope
        q, alpha_dot = following, value
    raise RefusedError(
        f"alpha_dot = 0 has no solution for q at alpha {from_si(alpha, 'deg'):.4g} deg: "
        f"{from_si(alpha_dot, 'deg_s'):.3g} deg/s is left"
    )


def _holding_elevator(field: Field, alpha: float, limits_rad: tuple[float, float]) -> float:
    """Return the elevator of the equilibrium at an alpha; NaN if it lies outside the limits."""

    def unbalance(elevator: float) -> float:
        return _balance(field, alpha, elevator)[1]

    low, high = unbalance(limits_rad[0]), unbalance(limits_rad[1])
    if low == 0.0 or high == 0.0:
        return limits_rad[0] if low == 0.0 else limits_rad[1]
    return _root(unbalance, *limits_rad) if _opposite(low, high) else math.nan


def _equilibrium(field: Field, alpha: float, elevator: float) -> SimulatedEquilibrium:
    q, _ = _balance(field, alpha, elevator)
    h = _JACOBIAN_STEP
    by_alpha = np.subtract(field(alpha + h, q, elevator), field(alpha - h, q, elevator)) / (2 * h)
    by_q = np.subtract(field(alpha, q + h, elevator), field(alpha, q - h, elevator)) / (2 * h)
    trace, determinant = by_alpha[0] + by_q[1], by_alpha[0] * by_q[1] - by_q[0] * by_alpha[1]
    return SimulatedEquilibrium(
        elevator_rad=elevator,
        alpha_rad=alpha,
        q_rad_s=q,
        stable=bool(trace < 0 < determinant),
        residual=max(abs(part) for part in field(alpha, q, elevator)),
    )


def _opposite(one: float, other: float) -> bool:
    return one < 0 < other or other < 0 < one  # their product could underflow to 0


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    return float(brentq(function, low, high, xtol=_ALPHA_XTOL, rtol=4 * np.finfo(float).eps))


def _minimum(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the minimum of a unimodal function by golden section, which does not mind corners."""
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_left, at_right = function(left), function(right)
    while high - low > _FOLD_XTOL:
        if at_left <= at_right:
            high, right, at_right = right, left, at_left
            left = high - _GOLDEN * (high - low)
            at_left = function(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + _GOLDEN * (high - low)
            at_right = function(right)
    return 0.5 * (low + high)
