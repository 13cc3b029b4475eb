"""Equilibria of the simulator in the plane of alpha and q, by continuation of its right-hand side.

All equilibria at one elevator, the whole curve of them over the elevator, and the curve's folds. The field may be
piecewise smooth, as tabulated aerodynamics are. The mathematics is that of ``finback.dynamics.continuation.branch``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.branch import EquilibriumBranch, equilibrium_branch, equilibrium_holding
from finback.dynamics.continuation.field import BlackBox
from finback.dynamics.continuation.path import ContinuationOptions, Ending
from finback.dynamics.continuation.release import released_curve
from finback.errors import InputError, RefusedError
from finback.units import from_si, to_si

Field = Callable[[float, float, float], tuple[float, float]]
"""(alpha in rad, q in rad/s, elevator in rad) -> (alpha_dot in rad/s, q_dot in rad/s²)."""

ALPHA_STEP_RAD: Final = 0.01  # 0.6 deg: a few table cells; a pair of equilibria inside one step is found
CURVE_STEP_RAD: Final = to_si(0.1, "deg")
"""Of alpha, between two points of the curve: about a cell of a fine table."""

_LARGEST_Q_RAD_S: Final = 20.0  # no equilibrium turns faster
_SIZES: Final = (1.0, 4.0)  # of alpha and q: a difference of 6e-6 of them lies inside a cell of any table
_ELEVATOR_SIZE: Final = 4.0  # as much less than alpha does the elevator count in the length of a step
_SEEDS: Final = 33  # alphas from which the curve is looked for where it has not been followed
_POINTS_PER_STEP: Final = 50  # of the largest step over alpha: a curve may be steep, and steps small
_SMALLEST: Final = 1e-6  # of the largest step
_JACOBIAN_STEP: Final = 1e-6  # rad and rad/s: inside a cell of a table, far above rounding


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
    """The equilibria inside limits of alpha and elevator, by rising alpha; the folds are among the points.

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
    """A fold of the equilibrium curve, where two equilibria meet: smooth, or at the corner of a table.

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

    The curve alpha_dot = 0 is followed from the lowest alpha to the highest; the zeros of q_dot on it are equilibria.

    Args:
        field: the simulator's right-hand side.
        elevator_rad: the elevator.
        alpha_limits_rad: where to look.
        alpha_step_rad: the largest step along the curve; a pair of equilibria inside one is found, two pairs are not.

    Raises:
        RefusedError: alpha_dot = 0 cannot be solved for q at every alpha.
    """
    low, high = _checked(alpha_limits_rad, alpha_step_rad)
    box = _box(field, alpha_limits_rad, (elevator_rad - 1.0, elevator_rad + 1.0))
    steps = _steps(high - low, alpha_step_rad)
    curve = released_curve(box, parameter=elevator_rad, state=(low, 0.0), along=0, released=1, options=steps)
    last = float(curve.state[-1, 0])
    if curve.end is not Ending.STATE_LIMIT or abs(last - high) > alpha_step_rad * 1e-6:
        raise RefusedError(
            f"alpha_dot = 0 has no solution for q beyond alpha {from_si(last, 'deg'):.4g} deg: {curve.end_note}"
        )
    found = [_polished(field, float(alpha), float(q), elevator_rad) for alpha, q in curve.equilibria]
    return tuple(sorted(found, key=lambda point: point.alpha_rad))


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
    field: Field,
    *,
    alpha_limits_rad: tuple[float, float],
    elevator_limits_rad: tuple[float, float],
    step_rad: float = CURVE_STEP_RAD,
) -> tuple[EquilibriumCurve, tuple[SimulatedFold, ...]]:
    """Return the equilibrium curve and its folds, ordered by alpha.

    It is followed from an equilibrium at each alpha of a coarse grid that no earlier branch has passed. Each alpha must
    be held by one elevator only, as it is where the elevator's effect on q_dot keeps its sign.

    Args:
        field: the simulator's right-hand side.
        alpha_limits_rad: where to look.
        elevator_limits_rad: equilibria that need an elevator outside are left out.
        step_rad: about the largest change of alpha between two points; two folds nearer together may be missed.

    Raises:
        RefusedError: the field cannot be evaluated inside the limits.
    """
    low, high = _checked(alpha_limits_rad, step_rad)
    box = _box(field, alpha_limits_rad, elevator_limits_rad)
    steps = _steps(high - low, step_rad)
    branches: list[EquilibriumBranch] = []
    middle = 0.5 * (elevator_limits_rad[0] + elevator_limits_rad[1])
    for alpha in np.linspace(low, high, _SEEDS).tolist():
        if any(branch.state[:, 0].min() <= alpha <= branch.state[:, 0].max() for branch in branches):
            continue
        held = equilibrium_holding(box, state=(alpha, 0.0), parameter=middle, held=0)
        if held is not None and elevator_limits_rad[0] <= held[1] <= elevator_limits_rad[1]:
            branches.append(equilibrium_branch(box, state=held[0], parameter=held[1], options=steps))
    return _joined(branches), _folds(branches)


def _checked(alpha_limits_rad: tuple[float, float], step_rad: float) -> tuple[float, float]:
    low, high = alpha_limits_rad
    if not (math.isfinite(low) and math.isfinite(high) and low < high and step_rad > 0.0):
        shown = [from_si(angle, "deg") for angle in (low, high, step_rad)]
        raise InputError("no curve over alpha from {:.6g} to {:.6g} deg in steps of {:.6g} deg".format(*shown))
    return low, high


def _box(field: Field, alpha_limits_rad: tuple[float, float], elevator_limits_rad: tuple[float, float]) -> BlackBox:
    """Return the field as continuation knows it: state (alpha, q), parameter elevator."""

    def rates(state: FloatArray, elevator: float) -> tuple[float, float]:
        return field(float(state[0]), float(state[1]), elevator)

    return BlackBox(
        field=rates,
        state_box=np.array([alpha_limits_rad, (-_LARGEST_Q_RAD_S, _LARGEST_Q_RAD_S)]),
        parameter_range=np.array(elevator_limits_rad),
        state_scale=np.array(_SIZES),
        parameter_scale=np.array([_ELEVATOR_SIZE]),
    )


def _steps(span_rad: float, step_rad: float) -> ContinuationOptions:
    most = math.ceil(_POINTS_PER_STEP * span_rad / step_rad) + _POINTS_PER_STEP
    return ContinuationOptions(largest_step=step_rad, smallest_step=_SMALLEST * step_rad, most_points=most)


def _joined(branches: list[EquilibriumBranch]) -> EquilibriumCurve:
    """Return the points of all branches by rising alpha."""
    nothing = np.zeros(0)
    columns = (
        np.concatenate([nothing, *(branch.state[:, 0] for branch in branches)]),
        np.concatenate([nothing, *(branch.parameter for branch in branches)]),
        np.concatenate([nothing, *(branch.state[:, 1] for branch in branches)]),
        np.concatenate([nothing, *(branch.stable for branch in branches)]),
    )
    order = np.argsort(columns[0], kind="stable")
    alpha, elevator, q, stable = (column[order] for column in columns)
    kept = np.append(True, np.diff(alpha) > 0.0)[: alpha.size]
    return EquilibriumCurve(
        alpha_rad=alpha[kept], elevator_rad=elevator[kept], q_rad_s=q[kept], stable=stable[kept].astype(np.bool_)
    )


def _folds(branches: list[EquilibriumBranch]) -> tuple[SimulatedFold, ...]:
    found = [
        SimulatedFold(elevator_rad=point.parameter, alpha_rad=float(point.state[0]), q_rad_s=float(point.state[1]))
        for branch in branches
        for point in branch.limit_points
    ]
    return tuple(sorted(found, key=lambda fold: fold.alpha_rad))


def _jacobian(field: Field, alpha: float, q: float, elevator: float) -> FloatArray:
    """Return the derivatives of (alpha_dot, q_dot) by (alpha, q), shape (2, 2)."""
    h = _JACOBIAN_STEP
    by_alpha = np.subtract(field(alpha + h, q, elevator), field(alpha - h, q, elevator)) / (2 * h)
    by_q = np.subtract(field(alpha, q + h, elevator), field(alpha, q - h, elevator)) / (2 * h)
    return np.column_stack((by_alpha, by_q))


def _polished(field: Field, alpha: float, q: float, elevator: float) -> SimulatedEquilibrium:
    """Return an equilibrium, better by a Newton step if there is a better one."""
    rates = np.array(field(alpha, q, elevator))
    matrix = _jacobian(field, alpha, q, elevator)
    determinant = float(np.linalg.det(matrix))
    if determinant != 0.0:
        better = np.array([alpha, q]) - np.linalg.solve(matrix, rates)
        left = np.array(field(float(better[0]), float(better[1]), elevator))
        if np.abs(left).max() < np.abs(rates).max():
            alpha, q, rates = float(better[0]), float(better[1]), left
    return SimulatedEquilibrium(
        elevator_rad=elevator,
        alpha_rad=alpha,
        q_rad_s=q,
        stable=bool(np.trace(matrix) < 0.0 < determinant),
        residual=float(np.abs(rates).max()),
    )
