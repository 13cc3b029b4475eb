"""Maneuvers: what the elevator does, each kind its own class, and the schedule that comes of it.

All values SI: rad, rad/s, s. Elevator > 0 is trailing edge down (nose down).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import ClassVar, Final, final

from finback.arrays import frozen_array
from finback.errors import InputError
from finback.flight.oscillation import LinearSweep, LogSweep, MultisineInput, oscillation_schedule
from finback.records import Schedule
from finback.units import from_si


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """From trim at an elevator: after a lead, to another elevator, which is held.

    Attributes:
        elevator_rad: the elevator of the trim.
        amplitude_rad: the change, either sign.
        lead_s: time before it.
        duration_s: time of the whole flight.
    """

    kind: ClassVar[str] = "step"
    elevator_rad: float
    amplitude_rad: float
    lead_s: float
    duration_s: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Doublet:
    """From trim at an elevator: one unit of time at plus, one at minus the amplitude, then back.

    Attributes:
        elevator_rad: the elevator of the trim.
        amplitude_rad: the first change, either sign.
        unit_s: length of one pulse, from one movement's start to the next one's.
        lead_s: time before the first movement.
        duration_s: time of the whole flight.
    """

    kind: ClassVar[str] = "doublet"
    elevator_rad: float
    amplitude_rad: float
    unit_s: float
    lead_s: float
    duration_s: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ThreeTwoOneOne:
    """From trim at an elevator: pulses of 3, 2, 1, 1 units of time, of alternating sign, then back.

    Attributes:
        elevator_rad: the elevator of the trim.
        amplitude_rad: the first change, either sign.
        unit_s: the unit of time.
        lead_s: time before the first movement.
        duration_s: time of the whole flight.
    """

    kind: ClassVar[str] = "three-two-one-one"
    elevator_rad: float
    amplitude_rad: float
    unit_s: float
    lead_s: float
    duration_s: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Ramp:
    """From trim at an elevator: after a lead, a straight movement to another elevator, which is held.

    Attributes:
        elevator_rad: the elevator of the trim.
        to_elevator_rad: where the ramp ends, above or below.
        rate_rad_s: the ramp's speed, > 0.
        lead_s: time before it.
        duration_s: time of the whole flight.
    """

    kind: ClassVar[str] = "ramp"
    elevator_rad: float
    to_elevator_rad: float
    rate_rad_s: float
    lead_s: float
    duration_s: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Hold:
    """From trim at an elevator, which is held.

    Attributes:
        elevator_rad: the elevator.
        duration_s: time of the whole flight.
    """

    kind: ClassVar[str] = "hold"
    elevator_rad: float
    duration_s: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Release:
    """A free release from any state, the elevator held.

    Attributes:
        elevator_rad: the elevator.
        alpha_rad: angle of attack at the release.
        q_rad_s: pitch rate at the release.
        duration_s: time of the whole flight.
    """

    kind: ClassVar[str] = "release"
    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    duration_s: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)


Movement = Step | Doublet | ThreeTwoOneOne | Ramp | Hold | Release
"""A maneuver of few straight movements."""
Maneuver = Movement | LinearSweep | LogSweep | MultisineInput
"""Any maneuver."""

_POSITIVE: Final = ("unit_s", "duration_s", "rate_rad_s")
_NOT_NEGATIVE: Final = ("lead_s",)
_DOUBLET: Final = (1, 1)  # pulse lengths in units of time
_THREE_TWO_ONE_ONE: Final = (3, 2, 1, 1)
_ROUNDING: Final = 1e-9  # of decimal numbers turned into counts, rad and s
_LARGEST_COUNT: Final = 2.0**53  # above, a float64 does not tell one sample from the next


def _check(maneuver: Movement) -> None:
    for part in fields(maneuver):
        value = getattr(maneuver, part.name)
        if not math.isfinite(value):
            raise InputError(f"{maneuver.kind}: {part.name} is not a finite number: {value}")
        if (part.name in _POSITIVE and value <= 0) or (part.name in _NOT_NEGATIVE and value < 0):
            raise InputError(f"{maneuver.kind}: {part.name} must be positive, got {value}")


def schedule(
    maneuver: Maneuver, *, rate_limit_rad_s: float, limits_rad: tuple[float, float], grid_s: float
) -> Schedule:
    """Return the elevator's schedule of a maneuver: straight lines with all corners on the sample grid.

    Every movement runs at the rate limit or slower (a ramp: at its own rate): its end is rounded up to the grid,
    other times to the nearest point of it. So the samples, joined by straight lines (hold ``foh``), are the elevator.

    Args:
        maneuver: what to fly.
        rate_limit_rad_s: fastest elevator movement, > 0.
        limits_rad: lower and upper elevator.
        grid_s: the sample interval, > 0.

    Raises:
        InputError: the elevator leaves its limits, a ramp is faster than the limit, a movement does not fit into its
            unit of time, the maneuver does not fit into its duration, or it lasts more samples than can be counted.
    """
    if not (math.isfinite(rate_limit_rad_s) and rate_limit_rad_s > 0 and math.isfinite(grid_s) and grid_s > 0):
        raise InputError(f"a schedule needs a positive rate limit and grid, got {rate_limit_rad_s} and {grid_s}")
    if isinstance(maneuver, LinearSweep | LogSweep | MultisineInput):
        return oscillation_schedule(maneuver, rate_limit_rad_s=rate_limit_rad_s, limits_rad=limits_rad, grid_s=grid_s)
    rate = rate_limit_rad_s
    if isinstance(maneuver, Ramp):
        if maneuver.rate_rad_s > rate_limit_rad_s * (1 + _ROUNDING):
            raise InputError(
                f"ramp: {from_si(maneuver.rate_rad_s, 'deg_s'):.6g} deg/s is faster than the elevator's"
                f" {from_si(rate_limit_rad_s, 'deg_s'):.6g} deg/s"
            )
        rate = maneuver.rate_rad_s
    knots = [(0, maneuver.elevator_rad)]
    for start_s, target in _movements(maneuver):
        held, elevator = knots[-1]
        start = round(_countable(maneuver, start_s, grid_s))
        if start < held:
            raise InputError(
                f"{maneuver.kind}: the movement before {start_s:.6g} s is not over by then,"
                f" at {from_si(rate, 'deg_s'):.6g} deg/s",
                hint="choose a smaller amplitude_deg or a longer unit_s",
            )
        if target == elevator:
            continue
        if start > held:
            knots.append((start, elevator))
        length = _countable(maneuver, abs(target - elevator), rate * grid_s)
        knots.append((start + max(1, math.ceil(length - _ROUNDING)), target))
    _check_fit(maneuver, knots, limits_rad=limits_rad, grid_s=grid_s)
    return Schedule(
        time_s=frozen_array([count * grid_s for count, _ in knots]),
        elevator_rad=frozen_array([elevator for _, elevator in knots]),
    )


def _countable(maneuver: Movement, whole: float, part: float) -> float:
    """Return how many parts make the whole, or raise InputError if nobody could count them."""
    count = whole / part if part > 0 else math.inf
    if not count <= _LARGEST_COUNT:
        raise InputError(
            f"{maneuver.kind}: a movement starts after, or takes, more samples than can be counted",
            hint="choose shorter times, or a faster movement",
        )
    return count


def _movements(maneuver: Movement) -> list[tuple[float, float]]:
    """Return when each movement starts, in s, and the elevator it goes to, in rad."""
    match maneuver:
        case Step(elevator_rad=elevator, amplitude_rad=amplitude, lead_s=lead):
            return [(lead, elevator + amplitude)]
        case Ramp(to_elevator_rad=target, lead_s=lead):
            return [(lead, target)]
        case Doublet(unit_s=unit, lead_s=lead):
            return _pulses(maneuver, _DOUBLET, unit_s=unit, lead_s=lead)
        case ThreeTwoOneOne(unit_s=unit, lead_s=lead):
            return _pulses(maneuver, _THREE_TWO_ONE_ONE, unit_s=unit, lead_s=lead)
        case Hold() | Release():
            return []


def _pulses(
    maneuver: Doublet | ThreeTwoOneOne, lengths: tuple[int, ...], *, unit_s: float, lead_s: float
) -> list[tuple[float, float]]:
    movements, start, sign = [], 0, 1.0
    for length in lengths:
        movements.append((lead_s + start * unit_s, maneuver.elevator_rad + sign * maneuver.amplitude_rad))
        start, sign = start + length, -sign
    return [*movements, (lead_s + start * unit_s, maneuver.elevator_rad)]


def _check_fit(
    maneuver: Movement, knots: list[tuple[int, float]], *, limits_rad: tuple[float, float], grid_s: float
) -> None:
    low, high = limits_rad
    for _, elevator in knots:
        if not low - _ROUNDING <= elevator <= high + _ROUNDING:
            raise InputError(
                f"{maneuver.kind}: the elevator would go to {from_si(elevator, 'deg'):.6g} deg, outside its limits"
                f" {from_si(low, 'deg'):.6g}…{from_si(high, 'deg'):.6g} deg"
            )
    end = knots[-1][0] * grid_s
    if end > maneuver.duration_s * (1 + _ROUNDING):
        raise InputError(
            f"{maneuver.kind}: its last movement ends at {end:.6g} s, after the flight of {maneuver.duration_s:.6g} s",
            hint="choose a longer duration_s",
        )
