"""Steady flight in every fidelity: branches of equilibria of the simulator's own right-hand side over the elevator.

Followed by pseudo-arclength continuation through folds, on the suspended simulator. On the rig alpha and q rest; in
``symmetric`` airspeed, alpha, q and pitch angle; in ``free`` also sideslip, roll and yaw rate and roll angle, which
includes steady turns. Altitude, and in ``free`` heading (north) and latitude (0), are held where they are: a
climbing or turning equilibrium is one of that air, that gravity and that heading, on which the turning Earth depends
by some 1e-4 of the weight.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.branch import EquilibriumBranch, equilibrium_branch, equilibrium_holding
from finback.dynamics.continuation.field import BlackBox
from finback.dynamics.continuation.path import ContinuationOptions, Ending
from finback.errors import RefusedError
from finback.flight.airborne import Airborne
from finback.flight.linear_model import LinearModel, linear_model
from finback.flight.rig import Rig
from finback.flight.steady_problem import (
    ELEVATOR_SIZE,
    Family,
    HeldThrust,
    OnRig,
    SteadyProblem,
    first_guess,
    steady_problem,
)
from finback.units import from_si, to_si

RESIDUAL: Final = 1e-10
"""Of every rate, in SI: what a point of a branch leaves at most."""

STEP_RAD: Final = to_si(0.2, "deg")
"""Of alpha, about, between two points."""

_REACH: Final = {
    "airspeed_m_s": (5.0, 1500.0),
    "beta_rad": (-1.5, 1.5),
    "p_rad_s": (-20.0, 20.0),
    "q_rad_s": (-20.0, 20.0),
    "r_rad_s": (-20.0, 20.0),
    "phi_rad": (-3.0, 3.0),
    "theta_rad": (-1.55, 1.55),
}
_MOST_THRUST: Final = 10.0  # weights: far beyond any engine
_POLISHINGS: Final = 4
_SECANTS: Final = 30
_SMALLEST: Final = 1e-6  # of the largest step
_POINTS_PER_STEP: Final = 20

_Point = tuple[FloatArray, float, float]  # unknowns, elevator, largest rate left


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SteadyFold:
    """A fold of a branch: two steady flights meet.

    Attributes:
        elevator_rad: where.
        alpha_rad: angle of attack there.
        corner: at a corner of a table; the elevator turns without being flat.
    """

    elevator_rad: float
    alpha_rad: float
    corner: bool


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SteadyBranch:
    """A branch of n steady flights, in its own order; folds and Hopf points are among them.

    Attributes:
        family: what was held.
        state_names: names of the d states, with SI units.
        elevator_rad: shape (n,).
        state: shape (n, d).
        thrust_n: shape (n,).
        eigenvalues_real: of the linearized simulator, thrust and elevator held, shape (n, d), 1/s.
        eigenvalues_imag: imaginary parts.
        stable: all real parts are negative, shape (n,).
        residual: largest rate left, in SI, shape (n,).
        folds: in the order of the branch.
        beginning: why it ends at its first point.
        beginning_note: the same in words.
        end: why it ends at its last point.
        end_note: the same in words.
    """

    family: Family
    state_names: tuple[str, ...]
    elevator_rad: FloatArray
    state: FloatArray
    thrust_n: FloatArray
    eigenvalues_real: FloatArray
    eigenvalues_imag: FloatArray
    stable: NDArray[np.bool_]
    residual: FloatArray
    folds: tuple[SteadyFold, ...]
    beginning: Ending
    beginning_note: str
    end: Ending
    end_note: str

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_rad", "state", "thrust_n", "eigenvalues_real", "eigenvalues_imag", "residual"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        stable = np.array(self.stable, dtype=np.bool_)
        stable.setflags(write=False)
        object.__setattr__(self, "stable", stable)

    def __getitem__(self, name: str) -> FloatArray:
        """Return a state along the branch, shape (n,)."""
        return frozen_array(self.state[:, self.state_names.index(name)])


def steady_branch(
    vehicle: Rig | Airborne,
    family: Family,
    *,
    alpha_rad: float,
    alpha_limits_rad: tuple[float, float],
    elevator_limits_rad: tuple[float, float],
    step_rad: float = STEP_RAD,
) -> SteadyBranch:
    """Return the branch of steady flights through the one at an angle of attack, followed both ways.

    A point that leaves more than ``RESIDUAL`` is left out, and the notes say so.

    Args:
        vehicle: the aircraft; its flight control is out of the way on the rig and with direct drive only.
        family: ``OnRig`` for a rig; ``HeldThrust`` or ``FreeThrust`` in the air.
        alpha_rad: where it begins; the elevator, and all else, that holds it is looked for.
        alpha_limits_rad: the branch ends there.
        elevator_limits_rad: the same for the elevator.
        step_rad: about the largest change of alpha between two points.

    Raises:
        InputError: the family does not fit the vehicle, or limits are out of order.
        RefusedError: no steady flight is found at that alpha, or no point of the branch can be solved.
    """
    problem = steady_problem(vehicle, family)
    most = _MOST_THRUST * problem.sizes[-1]
    reach = {**_REACH, "alpha_rad": alpha_limits_rad, "thrust_n": (-most, most)}
    box = BlackBox(
        field=problem.field,
        state_box=np.array([reach[name] for name in problem.unknowns]),
        parameter_range=np.array(elevator_limits_rad),
        state_scale=problem.sizes,
        parameter_scale=np.array([ELEVATOR_SIZE]),
    )
    steps = ContinuationOptions(
        largest_step=step_rad,
        smallest_step=_SMALLEST * step_rad,
        most_points=math.ceil(_POINTS_PER_STEP * (alpha_limits_rad[1] - alpha_limits_rad[0]) / step_rad),
    )
    guess, elevator = first_guess(vehicle, family, problem, alpha_rad, elevator_limits_rad)
    held = problem.unknowns.index("alpha_rad")
    found = equilibrium_holding(box, state=guess, parameter=elevator, held=held)
    if found is None:
        raise RefusedError(
            f"no steady flight is found at alpha {from_si(alpha_rad, 'deg'):.4g} deg ({family})",
            hint="begin at another alpha",
        )
    branch = equilibrium_branch(box, state=found[0], parameter=found[1], options=steps)
    return _result(problem, family, branch)


def linearized(
    vehicle: Rig | Airborne, *, state: FloatArray, elevator_rad: float, thrust_n: float = 0.0
) -> LinearModel:
    """Return the linear model of a vehicle at any state; inputs are the elevator and, in the air, the thrust.

    Args:
        vehicle: the aircraft.
        state: (alpha, q) on the rig; airspeed, alpha, q and pitch angle in ``symmetric``; ``STATE_NAMES`` in ``free``.
        elevator_rad: the elevator.
        thrust_n: along body x; 0 on the rig.

    Raises:
        InputError: shapes do not fit, or a number is not finite.
    """
    problem = steady_problem(vehicle, OnRig() if isinstance(vehicle, Rig) else HeldThrust(thrust_n=thrust_n))
    if isinstance(vehicle, Rig):
        return linear_model(
            lambda x, u: problem.rates(x, float(u[0]), 0.0),
            state_names=problem.names,
            input_names=("elevator_rad",),
            state=state,
            inputs=[elevator_rad],
        )
    return linear_model(
        lambda x, u: problem.rates(x, float(u[0]), float(u[1])),
        state_names=problem.names,
        input_names=("elevator_rad", "thrust_n"),
        state=state,
        inputs=[elevator_rad, thrust_n],
    )


def _result(problem: SteadyProblem, family: Family, branch: EquilibriumBranch) -> SteadyBranch:
    found = [
        _polished(problem, x, elevator) for x, elevator in zip(branch.state, branch.parameter.tolist(), strict=True)
    ]
    kept = [index for index, point in enumerate(found) if point[2] <= RESIDUAL]
    if not kept:
        raise RefusedError(f"no point of the branch leaves rates below {RESIDUAL:g} in SI: {_left(found)}")
    unknowns = np.array([found[index][0] for index in kept])
    elevators, residuals = (np.array([found[index][place] for index in kept]) for place in (1, 2))
    states = np.array([problem.state_of(row) for row in unknowns])
    thrusts = np.array([problem.thrust_of(row) for row in unknowns])
    if problem.unknowns == problem.names:
        eigenvalues = (branch.eigenvalues_real + 1j * branch.eigenvalues_imag)[kept]
    else:  # the branch knows the derivatives by thrust, not those by the pitch angle
        eigenvalues = np.array(
            [
                np.linalg.eigvals(_state_matrix(problem, *point))
                for point in zip(states, elevators.tolist(), thrusts.tolist(), strict=True)
            ]
        )
    beginning, beginning_note = branch.beginning, _named(branch.beginning_note, problem)
    end, end_note = branch.end, _named(branch.end_note, problem)
    if before := found[: kept[0]]:
        beginning, beginning_note = Ending.STEP_TOO_SMALL, _left(before)
    if after := found[kept[-1] + 1 :]:
        end, end_note = Ending.STEP_TOO_SMALL, _left(after)
    if between := [point for point in found[kept[0] : kept[-1]] if not point[2] <= RESIDUAL]:
        end_note += f"; left out on the way: {_left(between)}"
    return SteadyBranch(
        family=family,
        state_names=problem.names,
        elevator_rad=elevators,
        state=states,
        thrust_n=thrusts,
        eigenvalues_real=eigenvalues.real,
        eigenvalues_imag=eigenvalues.imag,
        stable=np.asarray((eigenvalues.real < 0.0).all(axis=1)),
        residual=residuals,
        folds=tuple(
            SteadyFold(
                elevator_rad=point.parameter,
                alpha_rad=float(point.state[problem.unknowns.index("alpha_rad")]),
                corner=point.corner,
            )
            for point in branch.limit_points
        ),
        beginning=beginning,
        beginning_note=beginning_note,
        end=end,
        end_note=end_note,
    )


def _left(points: Sequence[_Point]) -> str:
    """Say of points that are not in a branch why."""
    _, elevator, most = max(points, key=lambda point: point[2])
    many = "1 point leaves" if len(points) == 1 else f"{len(points)} points leave"
    return f"{many} rates up to {most:.1e} in SI, at elevator {from_si(elevator, 'deg'):.6g} deg"


def _named(note: str, problem: SteadyProblem) -> str:
    """Return why a branch ends, with the name of the unknown that reached its limit."""
    for index, name in enumerate((*problem.unknowns, "elevator_rad")):
        note = note.replace(f"unknown {index} reached", f"{name} reached")
    return note


def _state_matrix(problem: SteadyProblem, state: FloatArray, elevator_rad: float, thrust_n: float) -> FloatArray:
    model = linear_model(
        lambda x, _: problem.rates(x, elevator_rad, thrust_n),
        state_names=problem.names,
        input_names=(),
        state=state,
        inputs=np.zeros(0),
    )
    return model.A


def _polished(problem: SteadyProblem, unknowns: FloatArray, elevator_rad: float) -> _Point:
    """Return a point moved by the shortest way to where no rate exceeds ``RESIDUAL``, and the largest rate left.

    At a corner of a table differences are those of neither side, and Newton's method creeps; then secants learn the
    slopes of the side that they are on (Broyden 1965). Where that is not enough either, more is left.
    """
    sizes = np.append(problem.sizes, ELEVATOR_SIZE)
    both = np.append(unknowns, elevator_rad)
    best, residual = both, problem.field(unknowns, elevator_rad)
    least = float(np.abs(residual).max())
    slopes = np.empty((len(residual), len(both)))
    for polishing in range(_POLISHINGS + _SECANTS):
        if least <= RESIDUAL:
            break
        if polishing < _POLISHINGS:
            slopes = _slopes(problem, both, sizes)
        change = np.linalg.lstsq(slopes, residual, rcond=None)[0]
        both = both - sizes * change
        residual = problem.field(both[:-1], float(both[-1]))
        left = float(np.abs(residual).max())
        if not math.isfinite(left):
            break
        slopes -= np.outer(residual, change / max(float(change @ change), np.finfo(np.float64).tiny))
        if left < least:
            best, least = both, left
    return best[:-1], float(best[-1]), least


def _slopes(problem: SteadyProblem, both: FloatArray, sizes: FloatArray) -> FloatArray:
    """Return the derivatives of the rates by the unknowns and the elevator, each in units of its size."""
    columns = []
    for index, size in enumerate(sizes):
        step = np.zeros(len(both))
        step[index] = 1e-6 * size
        up, down = both + step, both - step
        change = problem.field(up[:-1], float(up[-1])) - problem.field(down[:-1], float(down[-1]))
        columns.append(change / (2e-6))
    return np.column_stack(columns)
