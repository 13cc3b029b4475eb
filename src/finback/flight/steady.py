"""Steady flight in every fidelity: branches of equilibria of the simulator's own right-hand side over the elevator.

Followed by pseudo-arclength continuation through folds, on the suspended simulator. On the rig alpha and q rest; in
``symmetric`` airspeed, alpha, q and pitch angle; in ``free`` also sideslip, roll and yaw rate and roll angle, which
includes steady turns. Altitude, and in ``free`` heading (north) and latitude (0), are held where they are: a
climbing or turning equilibrium is one of that air, that gravity and that heading, on which the turning Earth depends
by some 1e-4 of the weight.
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
from finback.errors import InputError, RefusedError
from finback.flight.airborne import Airborne
from finback.flight.linear_model import LinearModel, linear_model
from finback.flight.power import FixedThrust
from finback.flight.rig import Rig
from finback.flight.state import STATE_NAMES, FlightState
from finback.units import from_si, to_si

RESIDUAL: Final = 1e-10
"""Of every rate, in SI: what a point of a branch leaves at most."""

STEP_RAD: Final = to_si(0.2, "deg")
"""Of alpha, about, between two points."""

_SYMMETRIC: Final = ("airspeed_m_s", "alpha_rad", "q_rad_s", "theta_rad")
_ELEVATOR_SIZE: Final = 4.0  # as much less than alpha does the elevator count in the length of a step
_SIZES: Final = {"airspeed_m_s": 200.0, "q_rad_s": 4.0}  # of the thrust the weight, of the others 1
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
_ROUNDS: Final = 30  # of the search for a start
_GRAVITY_M_S2: Final = 9.8  # good enough for a start
_POLISHINGS: Final = 4
_SMALLEST: Final = 1e-6  # of the largest step
_POINTS_PER_STEP: Final = 20


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class HeldThrust:
    """Steady flight with a fixed thrust; the flight path climbs or sinks as it will.

    Attributes:
        thrust_n: along body x, through the center of gravity.
    """

    thrust_n: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FreeThrust:
    """Steady flight on a path of given climb, with whatever thrust that takes.

    Attributes:
        climb_rad: angle of the flight path to the horizon, up > 0, inside ±π/2.
    """

    climb_rad: float = 0.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class OnRig:
    """The rig: airspeed, density and g/V held, no thrust."""


Family = OnRig | HeldThrust | FreeThrust
"""What is held and what is free along a branch."""


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


@final
@dataclass(frozen=True, slots=True)
class _Problem:
    """Unknowns of a family, and how they make a state, a thrust and the rates that shall vanish."""

    names: tuple[str, ...]
    unknowns: tuple[str, ...]
    rates: Callable[[FloatArray, float, float], FloatArray]
    sizes: FloatArray
    state_of: Callable[[FloatArray], FloatArray]
    thrust_of: Callable[[FloatArray], float]

    def field(self, unknowns: FloatArray, elevator_rad: float) -> FloatArray:
        """Return the rates."""
        return self.rates(self.state_of(unknowns), elevator_rad, self.thrust_of(unknowns))


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

    Args:
        vehicle: the aircraft; its flight control is out of the way on the rig and with direct drive only.
        family: ``OnRig`` for a rig; ``HeldThrust`` or ``FreeThrust`` in the air.
        alpha_rad: where it begins; the elevator, and all else, that holds it is looked for.
        alpha_limits_rad: the branch ends there.
        elevator_limits_rad: the same for the elevator.
        step_rad: about the largest change of alpha between two points.

    Raises:
        InputError: the family does not fit the vehicle, or limits are out of order.
        RefusedError: no steady flight is found at that alpha, or a point of the branch cannot be solved.
    """
    problem = _problem(vehicle, family)
    most = _MOST_THRUST * problem.sizes[-1]
    reach = {**_REACH, "alpha_rad": alpha_limits_rad, "thrust_n": (-most, most)}
    box = BlackBox(
        field=problem.field,
        state_box=np.array([reach[name] for name in problem.unknowns]),
        parameter_range=np.array(elevator_limits_rad),
        state_scale=problem.sizes,
        parameter_scale=np.array([_ELEVATOR_SIZE]),
    )
    steps = ContinuationOptions(
        largest_step=step_rad,
        smallest_step=_SMALLEST * step_rad,
        most_points=math.ceil(_POINTS_PER_STEP * (alpha_limits_rad[1] - alpha_limits_rad[0]) / step_rad),
    )
    guess, elevator = _guess(vehicle, family, problem, alpha_rad, elevator_limits_rad)
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
    problem = _problem(vehicle, OnRig() if isinstance(vehicle, Rig) else HeldThrust(thrust_n=thrust_n))
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


def _problem(vehicle: Rig | Airborne, family: Family) -> _Problem:
    if isinstance(vehicle, Rig) != isinstance(family, OnRig):
        raise InputError(f"steady flight of {vehicle.provenance['fidelity']} is not of the family {family}")
    if isinstance(vehicle, Rig):
        names = ("alpha_rad", "q_rad_s")
        field = vehicle.derivatives

        def of_rig(x: FloatArray, elevator: float, _: float) -> FloatArray:
            return np.array(field(float(x[0]), float(x[1]), elevator))

        return _Problem(names, names, of_rig, np.array([1.0, _SIZES["q_rad_s"]]), lambda x: x, lambda _: 0.0)
    return _airborne_problem(vehicle, family)


def _airborne_problem(vehicle: Airborne, family: Family) -> _Problem:
    names = _SYMMETRIC if vehicle.symmetric else STATE_NAMES
    places = [STATE_NAMES.index(name) for name in names]
    altitude = vehicle.condition.altitude_m

    def rates(x: FloatArray, elevator: float, thrust: float) -> FloatArray:
        state = FlightState(altitude_m=altitude, **dict(zip(names, x.tolist(), strict=True)))
        found = vehicle.rates(state, elevator, FixedThrust(thrust_n=thrust))
        return np.array([found[place] for place in places])

    sizes = np.array([_SIZES.get(name, 1.0) for name in names])
    if isinstance(family, HeldThrust):
        thrust = family.thrust_n
        return _Problem(names, names, rates, sizes, lambda x: x, lambda _: thrust)
    if not isinstance(family, FreeThrust) or not abs(family.climb_rad) < math.pi / 2:
        raise InputError(f"no steady flight climbs like {family}", hint="the climb angle must lie inside ±90 deg")
    climb, last = family.climb_rad, names.index("theta_rad")

    def state_of(unknowns: FloatArray) -> FloatArray:
        x = unknowns.copy()
        x[last] = _pitch_of(dict(zip(names, unknowns.tolist(), strict=True)), climb)
        return x

    # In place of the pitch angle, which the path gives, stands the thrust.
    unknowns = tuple("thrust_n" if name == "theta_rad" else name for name in names)
    sizes[last] = _GRAVITY_M_S2 * vehicle.mass_kg
    return _Problem(names, unknowns, rates, sizes, state_of, lambda unknowns: float(unknowns[last]))


def _pitch_of(state: dict[str, float], climb_rad: float) -> float:
    """Return the pitch angle on a path of given climb (Stevens, Lewis & Johnson, 3rd ed. 2016, Eq. 3.6-3)."""
    alpha, beta, phi = state["alpha_rad"], state.get("beta_rad", 0.0), state.get("phi_rad", 0.0)
    forward = math.cos(alpha) * math.cos(beta)
    down = math.sin(phi) * math.sin(beta) + math.cos(phi) * math.sin(alpha) * math.cos(beta)
    rise = math.sin(climb_rad)
    root = math.sqrt(max(forward * forward - rise * rise + down * down, 0.0))
    return math.atan2(forward * down + rise * root, forward * forward - rise * rise)


def _guess(
    vehicle: Rig | Airborne,
    family: Family,
    problem: _Problem,
    alpha_rad: float,
    elevator_limits_rad: tuple[float, float],
) -> tuple[FloatArray, float]:
    """Return unknowns and elevator near a steady flight: moments balanced by the elevator, weight by airspeed."""
    low, high = elevator_limits_rad
    elevator = min(max(0.0, low), high)
    if isinstance(vehicle, Rig):
        return np.array([alpha_rad, 0.0]), elevator
    state = dict.fromkeys(problem.names, 0.0)
    state |= {"airspeed_m_s": vehicle.condition.airspeed_m_s, "alpha_rad": alpha_rad}
    thrust, climb = (family.thrust_n, 0.0) if isinstance(family, HeldThrust) else (0.0, _climb(family))
    place = {name: index for index, name in enumerate(problem.names)}
    for _ in range(_ROUNDS):
        state["theta_rad"] = alpha_rad + climb
        x = np.array([state[name] for name in problem.names])
        rates = problem.rates(x, elevator, thrust)
        tilted = problem.rates(x, elevator + 0.01, thrust)
        effect = (tilted - rates)[place["q_rad_s"]] / 0.01
        speed = state["airspeed_m_s"]
        lift = _GRAVITY_M_S2 * math.cos(climb) - speed * rates[place["alpha_rad"]]  # and thrust, per mass
        along = rates[place["airspeed_m_s"]] + _GRAVITY_M_S2 * math.sin(climb)
        if effect:
            elevator = min(max(elevator - rates[place["q_rad_s"]] / effect, low), high)
        if lift > 0.0:
            ratio = math.sqrt(_GRAVITY_M_S2 * math.cos(climb) / lift)
            state["airspeed_m_s"] = speed * min(max(ratio, 0.5), 2.0)
        if isinstance(family, HeldThrust):
            climb += 0.5 * (math.asin(min(max(along / _GRAVITY_M_S2, -0.98), 0.98)) - climb)
        else:
            thrust -= rates[place["airspeed_m_s"]] * vehicle.mass_kg / math.cos(alpha_rad)
    state["thrust_n"] = thrust
    return np.array([state[name] for name in problem.unknowns]), elevator


def _climb(family: Family) -> float:
    return family.climb_rad if isinstance(family, FreeThrust) else 0.0


def _result(problem: _Problem, family: Family, branch: EquilibriumBranch) -> SteadyBranch:
    unknowns, elevators = branch.state.copy(), branch.parameter.copy()
    residuals = np.empty(len(elevators))
    for index in range(len(elevators)):
        unknowns[index], elevators[index], residuals[index] = _polished(
            problem, unknowns[index], float(elevators[index])
        )
    states = np.array([problem.state_of(row) for row in unknowns])
    thrusts = np.array([problem.thrust_of(row) for row in unknowns])
    if problem.unknowns == problem.names:
        eigenvalues = branch.eigenvalues_real + 1j * branch.eigenvalues_imag
    else:  # the branch knows the derivatives by thrust, not those by the pitch angle
        eigenvalues = np.array(
            [
                np.linalg.eigvals(_state_matrix(problem, *point))
                for point in zip(states, elevators.tolist(), thrusts.tolist(), strict=True)
            ]
        )
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
        beginning=branch.beginning,
        beginning_note=_named(branch.beginning_note, problem),
        end=branch.end,
        end_note=_named(branch.end_note, problem),
    )


def _named(note: str, problem: _Problem) -> str:
    """Return why a branch ends, with the name of the unknown that reached its limit."""
    for index, name in enumerate((*problem.unknowns, "elevator_rad")):
        note = note.replace(f"unknown {index} reached", f"{name} reached")
    return note


def _state_matrix(problem: _Problem, state: FloatArray, elevator_rad: float, thrust_n: float) -> FloatArray:
    model = linear_model(
        lambda x, _: problem.rates(x, elevator_rad, thrust_n),
        state_names=problem.names,
        input_names=(),
        state=state,
        inputs=np.zeros(0),
    )
    return model.A


def _polished(problem: _Problem, unknowns: FloatArray, elevator_rad: float) -> tuple[FloatArray, float, float]:
    """Return a point moved by the shortest way to where no rate exceeds ``RESIDUAL``, and the largest rate left.

    Raises:
        RefusedError: Newton's method does not reach it.
    """
    residual = problem.field(unknowns, elevator_rad)
    for _ in range(_POLISHINGS):
        if np.abs(residual).max() <= RESIDUAL:
            break
        sizes = np.append(problem.sizes, _ELEVATOR_SIZE)
        both = np.append(unknowns, elevator_rad)
        columns = []
        for index, size in enumerate(sizes):
            step = np.zeros(len(both))
            step[index] = 1e-6 * size
            up, down = both + step, both - step
            change = problem.field(up[:-1], float(up[-1])) - problem.field(down[:-1], float(down[-1]))
            columns.append(change / (2e-6))
        both = both - sizes * np.linalg.lstsq(np.column_stack(columns), residual, rcond=None)[0]
        unknowns, elevator_rad = both[:-1], float(both[-1])
        residual = problem.field(unknowns, elevator_rad)
    left = float(np.abs(residual).max())
    if not left <= RESIDUAL:
        raise RefusedError(
            f"a steady flight at elevator {from_si(elevator_rad, 'deg'):.6g} deg leaves rates of {left:.1e} in SI,"
            f" more than {RESIDUAL:g}"
        )
    return unknowns, elevator_rad, left
