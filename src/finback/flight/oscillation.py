"""Maneuvers that oscillate about a trim: frequency sweeps and multisines.

All values SI: rad, s, 1/s. Elevator > 0 is trailing edge down (nose down).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import ClassVar, Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError
from finback.flight.multisine import Multisine, band_harmonics, flat_multisine
from finback.records import Schedule
from finback.units import from_si

FEWEST_SAMPLES: Final = 8
"""Of the shortest period: straight lines between samples then cut off 8 % of its peaks at most."""
_LARGEST_COUNT: Final = 10_000_000
_ROUNDING: Final = 1e-9  # of decimal numbers turned into counts and rad


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LinearSweep:
    """From trim at an elevator: a sine whose frequency changes steadily in time, then back.

    It ends where it crosses zero last, so that the elevator does not jump.

    Attributes:
        elevator_rad: the elevator of the trim.
        amplitude_rad: of the sine, either sign.
        from_1_s: frequency at the start, in cycles per second, > 0.
        to_1_s: frequency at the end, above or below.
        sweep_s: how long it lasts.
        lead_s: time before it.
        duration_s: time of the whole flight.
    """

    kind: ClassVar[str] = "linear-sweep"
    elevator_rad: float
    amplitude_rad: float
    from_1_s: float
    to_1_s: float
    sweep_s: float
    lead_s: float
    duration_s: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)

    @property
    def highest_1_s(self) -> float:
        """The highest frequency."""
        return max(self.from_1_s, self.to_1_s)

    def cycles(self, time_s: FloatArray) -> FloatArray:
        """Return the cycles since the start of the sweep."""
        return time_s * (self.from_1_s + (self.to_1_s - self.from_1_s) * time_s / (2 * self.sweep_s))

    def wave(self, time_s: FloatArray) -> FloatArray:
        """Return the elevator over the amplitude, about the trim, at times since the start of the sweep."""
        return _sine(self.cycles(time_s), float(self.cycles(np.array(self.sweep_s))))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LogSweep:
    """From trim at an elevator: a sine that stays as many cycles in each octave, then back.

    It ends where it crosses zero last, so that the elevator does not jump.

    Attributes:
        elevator_rad: the elevator of the trim.
        amplitude_rad: of the sine, either sign.
        from_1_s: frequency at the start, in cycles per second, > 0.
        to_1_s: frequency at the end, above or below.
        sweep_s: how long it lasts.
        lead_s: time before it.
        duration_s: time of the whole flight.
    """

    kind: ClassVar[str] = "log-sweep"
    elevator_rad: float
    amplitude_rad: float
    from_1_s: float
    to_1_s: float
    sweep_s: float
    lead_s: float
    duration_s: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)

    @property
    def highest_1_s(self) -> float:
        """The highest frequency."""
        return max(self.from_1_s, self.to_1_s)

    def cycles(self, time_s: FloatArray) -> FloatArray:
        """Return the cycles since the start of the sweep."""
        octaves = math.log(self.to_1_s / self.from_1_s)
        if abs(octaves) < _ROUNDING:
            return self.from_1_s * time_s
        return self.from_1_s * self.sweep_s / octaves * np.expm1(octaves * time_s / self.sweep_s)

    def wave(self, time_s: FloatArray) -> FloatArray:
        """Return the elevator over the amplitude, about the trim, at times since the start of the sweep."""
        return _sine(self.cycles(time_s), float(self.cycles(np.array(self.sweep_s))))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MultisineInput:
    """From trim at an elevator: whole periods of a multisine with even power over a band and a low peak, then back.

    Attributes:
        elevator_rad: the elevator of the trim.
        amplitude_rad: the peak of the sum, either sign.
        lowest_1_s: lower end of the band, in cycles per second; no harmonic is below 1/period.
        highest_1_s: upper end of the band.
        period_s: the common period of the harmonics.
        lead_s: time before it.
        duration_s: time of the whole flight; as many whole periods as it holds are flown.
    """

    kind: ClassVar[str] = "multisine"
    elevator_rad: float
    amplitude_rad: float
    lowest_1_s: float
    highest_1_s: float
    period_s: float
    lead_s: float
    duration_s: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)
        if not band_harmonics(period_s=self.period_s, lowest_hz=self.lowest_1_s, highest_hz=self.highest_1_s):
            raise InputError(
                f"multisine: a period of {self.period_s:g} s has no harmonic between {self.lowest_1_s:g} and "
                f"{self.highest_1_s:g} Hz",
                hint="lengthen period_s or widen the band",
            )

    @property
    def sweep_s(self) -> float:
        """How long it lasts: whole periods."""
        return math.floor((self.duration_s - self.lead_s) / self.period_s + _ROUNDING) * self.period_s

    def signal(self) -> Multisine:
        """Return the sum of harmonics, with a peak of 1."""
        harmonics = band_harmonics(period_s=self.period_s, lowest_hz=self.lowest_1_s, highest_hz=self.highest_1_s)
        return flat_multisine(harmonics, period_s=self.period_s)

    def wave(self, time_s: FloatArray) -> FloatArray:
        """Return the elevator over the amplitude, about the trim, at times since its start."""
        return self.signal()(time_s)


Oscillation = LinearSweep | LogSweep | MultisineInput
"""Any of them."""


def oscillation_schedule(
    maneuver: Oscillation, *, rate_limit_rad_s: float, limits_rad: tuple[float, float], grid_s: float
) -> Schedule:
    """Return the elevator's schedule of an oscillation: straight lines from sample to sample.

    Args:
        maneuver: what to fly.
        rate_limit_rad_s: fastest elevator movement, > 0.
        limits_rad: lower and upper elevator.
        grid_s: the sample interval, > 0.

    Raises:
        InputError: the elevator leaves its limits or would have to be faster than it can, the samples are too coarse
            for the highest frequency, or the maneuver does not fit into its duration.
    """
    if maneuver.highest_1_s * grid_s * FEWEST_SAMPLES > 1 + _ROUNDING:
        raise InputError(
            f"{maneuver.kind}: {maneuver.highest_1_s:g} Hz has less than {FEWEST_SAMPLES} samples of {grid_s:g} s in a "
            "period",
            hint="lower the highest frequency or sample faster",
        )
    if maneuver.sweep_s <= 0 or maneuver.lead_s + maneuver.sweep_s > maneuver.duration_s * (1 + _ROUNDING):
        raise InputError(
            f"{maneuver.kind}: it does not fit into the flight of {maneuver.duration_s:.6g} s",
            hint="choose a longer duration_s",
        )
    first, count = round(maneuver.lead_s / grid_s), math.floor(maneuver.sweep_s / grid_s + _ROUNDING)
    if count > _LARGEST_COUNT:
        raise InputError(f"{maneuver.kind}: it has more than {_LARGEST_COUNT} samples", hint="choose a shorter time")
    wave = maneuver.wave(frozen_array(np.arange(count + 1) * grid_s))
    wave[0] = wave[-1] = 0.0  # what the grid leaves of the last crossing is less than one sample's change
    elevator = maneuver.elevator_rad + maneuver.amplitude_rad * wave
    _check_reach(maneuver, elevator, limits_rad)
    fastest = float(np.abs(np.diff(elevator)).max(initial=0.0)) / grid_s
    if fastest > rate_limit_rad_s * (1 + _ROUNDING):
        raise InputError(
            f"{maneuver.kind}: the elevator would have to move at {from_si(fastest, 'deg_s'):.6g} deg/s, faster than "
            f"its {from_si(rate_limit_rad_s, 'deg_s'):.6g} deg/s",
            hint="choose a smaller amplitude_deg or a lower highest frequency",
        )
    times = (first + np.arange(count + 1)) * grid_s
    if first:
        times, elevator = np.insert(times, 0, 0.0), np.insert(elevator, 0, maneuver.elevator_rad)
    return Schedule(time_s=frozen_array(times), elevator_rad=frozen_array(elevator))


def _check_reach(maneuver: Oscillation, elevator_rad: FloatArray, limits_rad: tuple[float, float]) -> None:
    low, high = float(elevator_rad.min()), float(elevator_rad.max())
    if low < limits_rad[0] - _ROUNDING or high > limits_rad[1] + _ROUNDING:
        raise InputError(
            f"{maneuver.kind}: the elevator would reach {from_si(low, 'deg'):.6g}…{from_si(high, 'deg'):.6g} deg, "
            f"outside its limits {from_si(limits_rad[0], 'deg'):.6g}…{from_si(limits_rad[1], 'deg'):.6g} deg"
        )


def _sine(cycles: FloatArray, last: float) -> FloatArray:
    """Return sin(2π cycles) up to the last half cycle that is complete at ``last``, and 0 from there."""
    end = math.floor(2 * last + _ROUNDING) / 2
    wave: FloatArray = np.where(cycles <= end, np.sin(2 * math.pi * cycles), 0.0)
    return wave


def _check(maneuver: Oscillation) -> None:
    for part in fields(maneuver):
        value = getattr(maneuver, part.name)
        signed = part.name in {"elevator_rad", "amplitude_rad"}
        may_be_zero = signed or part.name in {"lead_s", "lowest_1_s"}
        if not math.isfinite(value) or (not signed and value < 0) or (not may_be_zero and value == 0):
            raise InputError(
                f"{maneuver.kind}: {part.name} must be a finite number, and no time or frequency < 0: {value}"
            )
