"""The stretches of a record that an estimator can use: uniform in time, without gaps, inside the alpha window."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from finback.arrays import FloatArray, frozen_array
from finback.channels import SURFACES
from finback.errors import InputError
from finback.identification.options import IdentificationOptions
from finback.records import FlightRecord, Hold

_USED: Final = ("time_s", "alpha_rad", "q_rad_s", "elevator_rad")
_GAP: Final = 1.5
"""A step longer than this many sample intervals is a gap."""
_JITTER: Final = 0.05
"""Sample times may stray this share of an interval: at 100 Hz and 100 deg/s that is 0.05 deg, half a usual noise."""
_MEDIAN_TIME_S: Final = 0.08
"""Alpha is judged against the window by its running median over this time, so that noise does not cut a record."""

_STRAY: Final = 5
"""Samples of the running median that tells stray samples beyond ±180 deg from a column in another unit."""

_FEWEST: Final = 8
"""Half widths of fewer sample intervals are refused: noise-free coefficients are then right to 3e-5, at 5 to 5e-4."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """Uniform samples without a gap, all used.

    Attributes:
        flight: the record's name.
        start_s: time of the first sample, in s.
        interval_s: time between samples, in s.
        measured: alpha in rad and q in rad/s as recorded, shape (n, 2).
        elevator_rad: the elevator at the samples, shape (n,); of an actuator that through which straight lines have the
            integrals of its own path.
        hold: how the control surfaces moved between samples.
        further_names: names of the further inputs, with unit.
        further: the further inputs at the samples, in SI, shape (n, names).
    """

    flight: str
    start_s: float
    interval_s: float
    measured: FloatArray
    elevator_rad: FloatArray
    hold: Hold
    further_names: tuple[str, ...] = ()
    further: FloatArray = field(default_factory=lambda: frozen_array(np.empty((0, 0))))

    def __len__(self) -> int:
        return int(self.elevator_rad.size)

    @property
    def end_s(self) -> float:
        """Time of the last sample, in s."""
        return self.start_s + (len(self) - 1) * self.interval_s

    @property
    def inputs(self) -> FloatArray:
        """The elevator and the further inputs, in SI, shape (n, inputs)."""
        elevator = self.elevator_rad[:, np.newaxis]
        return np.hstack([elevator, self.further]) if self.further_names else elevator

    @property
    def held(self) -> NDArray[np.bool_]:
        """Whether each input is held from each sample to the next, shape (inputs,)."""
        names = ("elevator_rad", *self.further_names)
        return np.array([self.hold is Hold.ZOH and name in SURFACES for name in names])

    @property
    def inputs_before(self) -> FloatArray:
        """The inputs just before each sample: where one is held, its value at the sample before."""
        inputs = self.inputs
        before = np.vstack([inputs[:1], inputs[:-1]])
        return np.where(self.held, before, inputs)


def stretches(
    record: FlightRecord, options: IdentificationOptions, *, windowed: bool, further: tuple[str, ...] = ()
) -> tuple[Stretch, ...]:
    """Return the usable stretches of a record; none if all is outside the window or too short.

    Samples with a value that is not finite count as missing; a record is split where samples are missing. With
    ``windowed``, so do samples of alpha beyond ±180 deg, and the record is used up to the first time that the running
    median of alpha is outside the window: one that comes back is not used again, because what it met outside may not
    be the same aircraft any more.

    Raises:
        InputError: the samples are not uniform in time, or too coarse for the test functions.
    """
    columns = np.column_stack([record[name] for name in (*_USED, *further)])
    columns = columns[np.isfinite(columns).all(axis=1)]
    if windowed:
        columns = columns[np.abs(columns[:, 1]) <= math.pi]
    if len(columns) < 2:
        return ()
    typical = float(np.median(np.diff(columns[:, 0])))
    found = []
    for run in split_at_gaps(columns):
        end = _first_exit(run[:, 1], typical, options.alpha_window_rad) if windowed else len(run)
        stretch = _stretch(record, run[:end], options, further)
        if stretch is not None:
            found.append(stretch)
        if end < len(run):
            break
    return tuple(found)


def beyond_half_turn(alpha_rad: FloatArray) -> tuple[int, bool]:
    """Count the samples of alpha beyond ±180 deg, and tell whether they are more than stray ones.

    They are if the running median of five samples is beyond as well: then the column is no angle in radians.
    """
    alpha = alpha_rad[np.isfinite(alpha_rad)]
    beyond = int((np.abs(alpha) > math.pi).sum())
    lasting = bool(beyond) and float(np.abs(median_filter(alpha, size=_STRAY, mode="nearest")).max()) > math.pi
    return beyond, lasting


def half_width_samples(half_width_s: float, interval_s: float) -> int:
    """Return the half width of the test functions as a number of sample intervals."""
    return round(half_width_s / interval_s)


def least_half_width_s(record: FlightRecord) -> float:
    """Return the least half width of test functions that the samples of a record bear, in s; 0 if it has none."""
    steps = np.diff(record["time_s"])
    # A thousandth more, so that rounding of the stamps does not take one interval away.
    return 1.001 * _FEWEST * float(np.median(steps)) if steps.size else 0.0


def split_at_gaps(rows: FloatArray) -> tuple[FloatArray, ...]:
    """Split rows, whose first column is time, where a step is longer than 1.5 sample intervals (the median step)."""
    if len(rows) < 2:
        return (rows,)
    steps = np.diff(rows[:, 0])
    return tuple(np.split(rows, np.flatnonzero(steps > _GAP * float(np.median(steps))) + 1))


def uniform_interval(flight: str, time_s: FloatArray) -> float:
    """Return the time between samples, in s.

    Raises:
        InputError: the samples are not uniform in time.
    """
    interval = float(time_s[-1] - time_s[0]) / (time_s.size - 1)
    stray = float(np.abs(time_s - np.linspace(time_s[0], time_s[-1], time_s.size)).max())
    if stray > _JITTER * interval:
        raise InputError(
            f"flight '{flight}': the samples from {time_s[0]:g} s to {time_s[-1]:g} s are not uniform in time "
            f"(up to {stray:.3g} s beside a grid of {interval:.6g} s)",
            hint="resample alpha, q and elevator to one uniform time base, or leave the missing samples out",
        )
    return interval


def _first_exit(alpha_rad: FloatArray, interval_s: float, window_rad: tuple[float, float]) -> int:
    """Return the index of the first sample whose running median is outside, or the number of samples."""
    width = 2 * round(0.5 * _MEDIAN_TIME_S / interval_s) + 1
    smooth = median_filter(alpha_rad, size=max(width, 3), mode="nearest")
    outside = np.flatnonzero((smooth < window_rad[0]) | (smooth > window_rad[1]))
    return int(outside[0]) if outside.size else int(alpha_rad.size)


def _stretch(
    record: FlightRecord, run: FloatArray, options: IdentificationOptions, further: tuple[str, ...]
) -> Stretch | None:
    """Make a stretch of rows (time, alpha, q, elevator, further inputs), or nothing if they are too few."""
    if len(run) < 2:
        return None
    time = run[:, 0]
    duration = float(time[-1] - time[0])
    interval = uniform_interval(record.name, time)
    reach = half_width_samples(options.half_width_s, interval)
    if reach < _FEWEST:
        raise InputError(
            f"flight '{record.name}': half_width_s {options.half_width_s:g} s spans {reach} sample intervals of "
            f"{interval:.6g} s, expected at least {_FEWEST}",
            hint=f"raise half_width_s to {_FEWEST * interval:.3g} s or sample faster",
        )
    # One interval of slack, so that a record of just the minimum is not lost to rounding.
    if duration + 0.5 * interval < options.minimum_duration_s or len(run) < 2 * reach + 1:
        return None
    if record.hold is Hold.ACTUATOR:
        surfaces = [3, *(4 + place for place, name in enumerate(further) if name in SURFACES)]
        run = run.copy()
        run[:, surfaces] += chord_shift(run[:, surfaces])
    return Stretch(
        flight=record.name,
        start_s=float(time[0]),
        interval_s=interval,
        measured=frozen_array(run[:, 1:3]),
        elevator_rad=frozen_array(run[:, 3]),
        hold=record.hold,
        further_names=further,
        further=frozen_array(run[:, 4:]),
    )


def chord_shift(samples: FloatArray) -> FloatArray:
    """Return what makes straight lines through samples (n, ...) have the integrals of a smooth curve through them.

    Chords of a curve lie on its hollow side, by interval²/12 of its second derivative in the mean. An actuator that
    lags by 0.1 s and is sampled every 0.05 s is missed by 1 % of what it moves, and always on the same side.
    """
    shift = np.zeros_like(samples)
    shift[1:-1] = -np.diff(samples, 2, axis=0) / 12.0
    return shift
