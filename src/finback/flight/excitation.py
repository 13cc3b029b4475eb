"""Maneuvers: what the elevator does, each kind its own class, and the schedule that comes of it.

All values SI: rad, rad/s, s. Elevator > 0 is trailing edge down (nose down).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import ClassVar, Final, final

from finback.errors import InputError
from finback.records import Schedule


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


Maneuver = Step | Doublet | ThreeTwoOneOne | Ramp | Hold | Release
"""Any maneuver."""

_POSITIVE: Final = ("unit_s", "duration_s", "rate_rad_s")
_NOT_NEGATIVE: Final = ("lead_s",)


def _check(maneuver: Maneuver) -> None:
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
            unit of time, or the maneuver does not fit into its duration.
    """
    raise NotImplementedError
