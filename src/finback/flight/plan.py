"""What a flight is asked to do: the options that all flights of a sweep share, and the plan of one flight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

from finback.errors import InputError
from finback.flight.air import CALM, Air
from finback.flight.loading import AS_LOADED, Loading
from finback.flight.power import ENGINES_OFF, Power, power_told
from finback.flight.start import LEVEL, Start
from finback.records import Hold, Schedule
from finback.units import from_si

FIDELITIES: Final = ("rig", "symmetric", "free")
"""What moves: alpha and q; everything in the plane of symmetry; everything."""

_GRID_TOLERANCE: Final = 1e-6  # of a step: what rounding of decimal times may leave, far below any real misfit


@final
class Drive(StrEnum):
    """What moves the surfaces."""

    OWN = "own"
    """the aircraft's flight control where it is kept, which is in ``free``; elsewhere they are driven directly"""
    DIRECT = "direct"
    """their positions are given; the flight control is dropped"""


def whole_steps(duration_s: float, step_s: float, *, what: str) -> int:
    """Return how many steps ``duration_s`` holds.

    Raises:
        InputError: it is no whole number of steps; ``what`` names it in the message.
    """
    steps = duration_s / step_s
    if not math.isfinite(steps) or abs(steps - round(steps)) > _GRID_TOLERANCE:
        raise InputError(
            f"{what} of {duration_s:.9g} s is no whole number of steps of {step_s:.9g} s",
            hint="choose a multiple of the step",
        )
    return round(steps)


def check_alpha_limits(alpha_limits_rad: tuple[float, float]) -> None:
    """Raise InputError unless the limits are in order and inside ±π (beyond, alpha would wrap around unseen)."""
    low, high = alpha_limits_rad
    if not -math.pi < low < high < math.pi:
        raise InputError(f"alpha limits {_degrees(low, high)} must increase and lie inside −180…180 deg")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOptions:
    """How every flight of a sweep is flown.

    Attributes:
        fidelity: what moves; one of ``FIDELITIES``.
        step_s: integration step, > 0.
        sample_interval_s: time between two rows of a record; a whole multiple of the step, so rows are never
            interpolated.
        alpha_limits_rad: lower and upper alpha; a flight that leaves them has departed.
        elevator_limits_rad: lower and upper elevator, trailing edge down > 0.
        elevator_rate_rad_s: fastest elevator movement, > 0.
        drive: what moves the surfaces; of use with ``free`` only.
        power: thrust of flights that do not say otherwise.
        properties: JSBSim properties that every flight begins with, and their values, such as a mode of the flight
            control; not on the rig.
        air: of the same; each flight has gusts of its own, which follow from the seed and the flight's number.
    """

    fidelity: str = "rig"
    step_s: float = 1 / 400
    sample_interval_s: float = 1 / 100
    alpha_limits_rad: tuple[float, float]
    elevator_limits_rad: tuple[float, float]
    elevator_rate_rad_s: float
    drive: Drive = Drive.OWN
    power: Power = ENGINES_OFF
    properties: tuple[tuple[str, float], ...] = ()
    air: Air = CALM

    def __post_init__(self) -> None:
        """Check what later stages rely on."""
        if self.fidelity not in FIDELITIES:
            raise InputError(f"unknown fidelity '{self.fidelity}'", hint=f"known: {', '.join(FIDELITIES)}")
        for name, value in self.properties:
            if not math.isfinite(value):
                raise InputError(f"property '{name}' must begin with a finite number, got {value}")
        if not (math.isfinite(self.step_s) and self.step_s > 0):
            raise InputError(f"the step must be a positive time, got {self.step_s} s")
        if whole_steps(self.sample_interval_s, self.step_s, what="the sample interval") < 1:
            raise InputError(f"the sample interval must be positive, got {self.sample_interval_s} s")
        check_alpha_limits(self.alpha_limits_rad)
        low, high = self.elevator_limits_rad
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InputError(f"elevator limits {_degrees(low, high)} must increase")
        if not (math.isfinite(self.elevator_rate_rad_s) and self.elevator_rate_rad_s > 0):
            rate = from_si(self.elevator_rate_rad_s, "deg_s")
            raise InputError(f"the elevator's rate limit must be positive, got {rate:.6g} deg/s")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPlan:
    """One flight, ready to be flown.

    Attributes:
        name: unique within a sweep.
        kind: the maneuver's kind, such as ``doublet``.
        alpha_rad: angle of attack at the start.
        q_rad_s: pitch rate at the start.
        schedule: the elevator from the start, in rad.
        hold: how the elevator moves between two samples (``foh`` for straight lines with corners on the samples,
            ``zoh`` for jumps on the samples).
        duration_s: how long to fly; rounded down to whole sample intervals.
        sample_interval_s: time between two rows; a whole multiple of the simulator's step.
        alpha_limits_rad: the flight departs, and its record ends, when alpha leaves them.
        start: the rest of the initial state, as far as the fidelity has it.
        power: thrust.
        loading: mass, center of gravity, inertia.
        air: calm or turbulent.
    """

    name: str
    kind: str
    alpha_rad: float
    q_rad_s: float
    schedule: Schedule
    hold: Hold
    duration_s: float
    sample_interval_s: float
    alpha_limits_rad: tuple[float, float]
    start: Start = LEVEL
    power: Power = ENGINES_OFF
    loading: Loading = AS_LOADED
    air: Air = CALM

    def __post_init__(self) -> None:
        """Check that the flight can begin."""
        numbers = (self.alpha_rad, self.q_rad_s, self.duration_s, self.sample_interval_s)
        if not all(math.isfinite(number) for number in numbers):
            raise InputError(f"flight '{self.name}': a plan holds only finite numbers, got {numbers}")
        if self.sample_interval_s <= 0 or self.duration_s < self.sample_interval_s:
            raise InputError(
                f"flight '{self.name}': a duration of {self.duration_s:.6g} s is shorter than one sample interval"
                f" of {self.sample_interval_s:.6g} s"
            )
        check_alpha_limits(self.alpha_limits_rad)
        low, high = self.alpha_limits_rad
        if not low < self.alpha_rad < high:
            raise InputError(
                f"flight '{self.name}' starts at alpha {from_si(self.alpha_rad, 'deg'):.6g} deg, outside its limits"
                f" {_degrees(low, high)}"
            )


def told(plan: FlightPlan) -> dict[str, str]:
    """Return what a record's provenance says of its plan; what is as in every other flight is left out."""
    facts = {"kind": plan.kind, "sample_interval_s": repr(float(plan.sample_interval_s))}
    for name, usual in (("start", LEVEL), ("loading", AS_LOADED), ("air", CALM)):
        if (given := getattr(plan, name)) != usual:
            facts[name] = str(given)
    return {**facts, **power_told(plan.power)}


def _degrees(low_rad: float, high_rad: float) -> str:
    return f"{from_si(low_rad, 'deg'):.6g}…{from_si(high_rad, 'deg'):.6g} deg"
