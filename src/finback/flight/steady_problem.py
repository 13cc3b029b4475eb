"""Families of steady flight as equations: unknowns, the rates that shall vanish, and a start near a solution."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import InputError
from finback.flight.airborne import Airborne
from finback.flight.power import FixedThrust
from finback.flight.rig import Rig
from finback.flight.state import STATE_NAMES, FlightState

_SYMMETRIC: Final = ("airspeed_m_s", "alpha_rad", "q_rad_s", "theta_rad")
ELEVATOR_SIZE: Final = 4.0
"""As much less than alpha does the elevator count in the length of a step."""

_SIZES: Final = {"airspeed_m_s": 200.0, "q_rad_s": 4.0}  # of the thrust the weight, of the others 1
_ROUNDS: Final = 30  # of the search for a start
_GRAVITY_M_S2: Final = 9.8  # good enough for a start


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
@dataclass(frozen=True, slots=True)
class SteadyProblem:
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


def steady_problem(vehicle: Rig | Airborne, family: Family) -> SteadyProblem:
    """Return what a family means for a vehicle.

    Raises:
        InputError: the family does not fit the vehicle.
    """
    if isinstance(vehicle, Rig) != isinstance(family, OnRig):
        raise InputError(f"steady flight of {vehicle.provenance['fidelity']} is not of the family {family}")
    if isinstance(vehicle, Rig):
        names = ("alpha_rad", "q_rad_s")
        field = vehicle.derivatives

        def of_rig(x: FloatArray, elevator: float, _: float) -> FloatArray:
            return np.array(field(float(x[0]), float(x[1]), elevator))

        return SteadyProblem(names, names, of_rig, np.array([1.0, _SIZES["q_rad_s"]]), lambda x: x, lambda _: 0.0)
    return _airborne_problem(vehicle, family)


def _airborne_problem(vehicle: Airborne, family: Family) -> SteadyProblem:
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
        return SteadyProblem(names, names, rates, sizes, lambda x: x, lambda _: thrust)
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
    return SteadyProblem(names, unknowns, rates, sizes, state_of, lambda unknowns: float(unknowns[last]))


def _pitch_of(state: dict[str, float], climb_rad: float) -> float:
    """Return the pitch angle on a path of given climb (Stevens, Lewis & Johnson, 3rd ed. 2016, Eq. 3.6-3)."""
    alpha, beta, phi = state["alpha_rad"], state.get("beta_rad", 0.0), state.get("phi_rad", 0.0)
    forward = math.cos(alpha) * math.cos(beta)
    down = math.sin(phi) * math.sin(beta) + math.cos(phi) * math.sin(alpha) * math.cos(beta)
    rise = math.sin(climb_rad)
    root = math.sqrt(max(forward * forward - rise * rise + down * down, 0.0))
    return math.atan2(forward * down + rise * root, forward * forward - rise * rise)


def first_guess(
    vehicle: Rig | Airborne,
    family: Family,
    problem: SteadyProblem,
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
