"""The uniform clock behind time stamps that tremble, and whether the samples were taken at the stamps or at its ticks.

A sample of a motion x taken at the true instant of a stamp that is δ beside its tick is x(tick) + δ·dx/dt; one taken at
the tick, its stamp only written late or early, is x(tick). The data tell: what is left of the samples about a local
smooth, regressed on δ·dx/dt, has slope 1 or 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.ndimage import correlate1d, uniform_filter1d
from scipy.special import ndtr

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.records import FlightRecord, Hold

_FEWEST: Final = 20  # stamps, of which a clock can be told
_PHASE_SAMPLES: Final = 41  # over which the phase of a clock is averaged
_TREMBLE: Final = 0.25  # of an interval, root mean square: beyond it no clock is seen
_FARTHEST: Final = 0.9  # of an interval that a single stamp may be beside its tick
_FILLED: Final = 0.5  # of the ticks have a sample

_LOCAL: Final = 9
"""Samples of the local parabola: its slope has σ²/60 of the samples' noise per interval."""
_SLOPE_NOISE: Final = 1.0 / 60.0
_RELIABLE: Final = 0.3
"""Least share of motion, not noise, in the squares of the slopes from which something is said."""
_OUTLYING: Final = 5.0  # robust deviations: corners of the motion and outliers say nothing
_NORMAL_MAD: Final = 1.4826
_HALF: Final = 0.5
"""Between the slopes of the two kinds; of an error beyond it nothing is taken."""
_SURE: Final = 2.0  # standard errors
_LEAST: Final = 1e-6  # error of anything
_NEAR: Final = 2.5  # usual distances of samples, within which a sample's slope is taken
_REACH: Final = 2  # samples to each side
_JUDGES: Final = ("q_rad_s", "alpha_rad")

_BESIDE_S: Final = 0.4
"""To each side of a step, over which a cubic takes the pitch rate's way: it then misses less than 0.01 deg/s beside
pulses of 3 deg."""
_CUBIC: Final = 4
_STEP: Final = 6.0  # usual changes of a held input, of which one more than this is a step
_ODDS: Final = -4.5
"""Logarithm of how much likelier steps between samples must be than steps at samples, to be taken for it: rows that are
left out without need make intervals wider, steps in the wrong place make them wrong."""
ROUNDED: Final = 0.02
"""Of an interval: if no time stamp is farther from a grid, it is the stamps that are rounded, and nothing is judged. At
100 Hz and 100 deg/s that is 0.02 deg."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Clock:
    """A uniform clock.

    Attributes:
        rows: tick of each stamp, rising, the first 0, shape (n,).
        start_s: time of tick 0, in s.
        interval_s: between ticks, in s.
        beside: how far each stamp is after its tick, in intervals, shape (n,).
    """

    rows: IntArray
    start_s: float
    interval_s: float
    beside: FloatArray

    @property
    def ticks_s(self) -> FloatArray:
        """The tick of each stamp, in s, shape (n,)."""
        return np.asarray(self.start_s + self.interval_s * self.rows, dtype=np.float64)

    @property
    def trembles(self) -> bool:
        """Whether stamps are farther from their ticks than rounding may put them."""
        return float(np.abs(self.beside).max()) > ROUNDED

    @property
    def tremble(self) -> float:
        """Root mean square of how far stamps are beside their ticks, in intervals."""
        return float(np.sqrt(np.mean(self.beside**2)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What flights of one logger say of its stamps.

    Attributes:
        slope: 1 if samples were taken at their stamps, 0 if at the ticks of the clock.
        slope_error: its standard error, in which noise of the slopes is counted; inf if nothing can be told.
        lead: by how many intervals the motion turns before the elevator is recorded with a new value.
        lead_error: its standard error; inf if nothing can be told.
        odds: logarithm of how much likelier it is that the elevator stepped at any times between samples, all alike,
            than at the samples that show it.
    """

    slope: float = 0.0
    slope_error: float = float("inf")
    lead: float = 0.0
    lead_error: float = float("inf")
    odds: float = 0.0

    @property
    def at_stamps(self) -> bool:
        """Whether the samples are more likely to be of the stamps than of the ticks."""
        return self.slope > _HALF and self.slope_error < _HALF

    @property
    def sure(self) -> bool:
        """Whether the other is ruled out."""
        return abs(self.slope - _HALF) > _SURE * self.slope_error

    @property
    def steps_before(self) -> bool:
        """Whether a held elevator stepped at any time since the sample before, rather than at the sample."""
        return self.odds > _ODDS and self.lead_error < _HALF


def clock_of(time_s: FloatArray, *, interval_s: float = 0.0) -> tuple[Clock, ...]:
    """Return the uniform clock about which stamps tremble, or nothing where none is seen.

    Args:
        time_s: rising, shape (n,).
        interval_s: of the clock, if that is known; it is used where the stamps do not contradict it.
    """
    if time_s.size < _FEWEST:
        return ()
    apart = np.diff(time_s)
    usual = float(np.median(apart))
    step = float(np.mean(apart[np.abs(apart - usual) < _HALF * usual]))  # not the median: lost rows would move it
    turns = (time_s - time_s[0]) / step
    phase = uniform_filter1d(np.exp(2j * np.pi * turns), _PHASE_SAMPLES, mode="nearest")
    rows = _apart(np.round(turns - np.unwrap(np.angle(phase)) / (2.0 * np.pi)))
    if (np.diff(rows) < 1.0).any():
        return ()
    rows -= rows[0]
    start, step = np.polynomial.polynomial.polyfit(rows, time_s, 1)
    if interval_s and abs(interval_s / step - 1.0) * rows[-1] < 2.0 * _TREMBLE:
        step = interval_s
        start = float(np.mean(time_s - step * rows))
    beside = (time_s - start) / step - rows
    found = Clock(rows=rows.astype(np.int64), start_s=float(start), interval_s=float(step), beside=frozen_array(beside))
    seen = found.tremble <= _TREMBLE and float(np.abs(beside).max()) <= _FARTHEST
    return (found,) if seen and time_s.size >= _FILLED * (rows[-1] + 1.0) else ()


def _apart(rows: FloatArray) -> FloatArray:
    """Move one of two stamps on the same tick to the empty tick beside it."""
    rows = rows.copy()
    for k in (np.flatnonzero(np.diff(rows) < 1.0) + 1).tolist():
        if k + 1 == rows.size or rows[k + 1] > rows[k] + 1.0:
            rows[k] += 1.0
        elif k == 1 or rows[k - 2] < rows[k - 1] - 1.0:
            rows[k - 1] -= 1.0
    return rows


def evidence_of(records: Sequence[FlightRecord], *, interval_s: float = 0.0) -> Evidence:
    """Ask flights of one logger together when their samples were taken, by alpha, pitch rate and the held elevator."""
    slopes: list[tuple[float, float]] = []
    leads: list[tuple[float, float]] = []
    for record in records:
        for clock in clock_of(record["time_s"], interval_s=interval_s):
            if not clock.trembles:
                continue
            slopes += [_slope(record[name], clock) for name in _JUDGES if name in record.columns]
            leads += _leads(record)
    slope, slope_error = _pooled(slopes)
    lead, lead_error = _pooled(leads)
    odds = sum(_odds(value, error) for value, error in leads)
    return Evidence(slope=slope, slope_error=slope_error, lead=lead, lead_error=lead_error, odds=odds)


def _odds(lead: float, error: float) -> float:
    """Return the logarithm of the likelihood of a lead of anything between 0 and 1, beside that of 0."""
    between = ndtr((1.0 - lead) / error) - ndtr(-lead / error)
    exactly = np.exp(-0.5 * (lead / error) ** 2) / (error * np.sqrt(2.0 * np.pi))
    least = np.finfo(float).tiny
    return float(np.log(max(between, least)) - np.log(max(exactly, least)))


def _pooled(found: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the mean of values with errors, the more certain ones counting more, and its error."""
    weight = sum(error**-2 for _, error in found)
    if weight == 0.0:
        return 0.0, float("inf")
    return sum(value * error**-2 for value, error in found) / weight, float(weight**-0.5)


def _slope(values: FloatArray, clock: Clock) -> tuple[float, float]:
    """Return the slope of what is left of a column about a local smooth on δ·dx/dt, and its error; inf if nothing."""
    nothing = (0.0, float("inf"))
    rows = int(clock.rows[-1]) + 1
    column, beside = np.full(rows, np.nan), np.zeros(rows)
    column[clock.rows], beside[clock.rows] = values, clock.beside
    mean, slope_of = np.linalg.pinv(np.vander(np.arange(_LOCAL) - _LOCAL // 2, 3, increasing=True))[:2]
    rates = correlate1d(column, slope_of, mode="constant", cval=np.nan)
    there = np.isfinite(rates)
    if there.sum() < _FEWEST:
        return nothing
    ticks = np.arange(rows)
    rates = np.interp(ticks, ticks[there], rates[there])
    left = column - correlate1d(column, mean, mode="constant", cval=np.nan)
    expected = beside * rates - correlate1d(beside * rates, mean, mode="nearest")
    there = np.isfinite(left)
    there[there] &= np.abs(left[there]) <= _OUTLYING * _NORMAL_MAD * np.median(np.abs(left[there]))
    expected = np.where(there, expected, 0.0)
    power = float(expected @ expected)
    if there.sum() < _FEWEST or power == 0.0:
        return nothing
    slope = float(expected[there] @ left[there]) / power
    noise = float(np.mean((left[there] - slope * expected[there]) ** 2)) / (1.0 - mean[_LOCAL // 2])
    felt = expected - correlate1d(expected, mean, mode="nearest")
    reliable = 1.0 - _SLOPE_NOISE * noise / float(np.mean(rates[there] ** 2))
    if reliable < _RELIABLE:  # the slopes are mostly noise
        return nothing
    return slope / reliable, max(float(np.sqrt(noise * (felt @ felt))) / power / reliable, _LEAST)


def moved_to_ticks(values: FloatArray, time_s: FloatArray, clock: Clock) -> FloatArray:
    """Return samples taken at their stamps as they were at the ticks, each along the slope about it, shape (n,).

    Each sample keeps its own noise, so that it stays white and as large as it was; interpolation between two would make
    it smaller and colored. The slope of five samples adds 4 % at a fifth of an interval.
    """
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2:
        return values
    at, sample = time_s[known], values[known]
    usual = float(np.median(np.diff(at)))
    moves = clock.interval_s * clock.beside[known]
    count, times, sums, products, squares = (np.zeros(known.size) for _ in range(5))
    for offset in range(-_REACH, _REACH + 1):
        other = np.clip(np.arange(known.size) + offset, 0, known.size - 1)
        away, rise = at[other] - at, sample[other] - sample
        near = (np.abs(away) <= _NEAR * usual) & ((other - np.arange(known.size)) == offset)
        count += near
        times += near * away
        sums += near * rise
        products += near * away * rise
        squares += near * away * away
    spread = squares - times**2 / count
    slope = np.divide(products - times * sums / count, spread, out=np.zeros(known.size), where=spread > 0.0)
    found = values.copy()
    found[known] = sample - slope * moves
    return found


def steps_of(record: FlightRecord, name: str) -> tuple[IntArray, IntArray]:
    """Return between which samples a held input steps: the last with the old value, the first with the new."""
    known = np.flatnonzero(np.isfinite(record[name]))
    changes = np.abs(np.diff(record[name][known]))
    stepped = np.flatnonzero(changes > _STEP * (np.median(changes) if changes.size else 0.0))
    return known[stepped], known[stepped + 1]


def _leads(record: FlightRecord) -> list[tuple[float, float]]:
    """Return by how many intervals the pitch rate turns before the elevator is recorded with a new value, and errors.

    A step that comes at its sample gives 0; one that comes at any time since the sample before, one half on the mean.
    In a cubic to each side of a step, which begins or ends there, a corner that comes earlier is a jump.
    """
    if record.hold is not Hold.ZOH or not {"elevator_rad", "q_rad_s"} <= set(record.columns):
        return []
    known = np.isfinite(record["q_rad_s"])
    time, rate = record["time_s"][known], record["q_rad_s"][known]
    if time.size < _FEWEST:
        return []
    usual = float(np.median(np.diff(time)))
    steps = record["time_s"][steps_of(record, "elevator_rad")[1]]
    found = []
    for at, before, after in zip(steps, [-np.inf, *steps[:-1]], [*steps[1:], np.inf], strict=True):
        near = (time >= max(before, at - _BESIDE_S)) & (time < min(after, at + _BESIDE_S))
        late = time[near] >= at
        if min(late.sum(), (~late).sum()) > 2 * _CUBIC:
            found += [(jump / turn / usual, max(error / abs(turn) / usual, _LEAST))
                      for jump, turn, error in _corner(time[near] - at, rate[near])]  # fmt: skip
    return found


def _corner(time: FloatArray, values: FloatArray) -> Sequence[tuple[float, float, float]]:
    """Fit a cubic before time 0 and one after; return jump and turn of slope between them, and the jump's error."""
    scale = float(np.abs(time).max())
    powers = (time[:, np.newaxis] / scale) ** np.arange(_CUBIC)
    after = (time > -1e-9 * scale)[:, np.newaxis]
    rows = np.hstack([powers, np.where(after, powers, 0.0)])
    solution, _, rank, _ = np.linalg.lstsq(rows, values, rcond=None)
    if rank < rows.shape[1]:
        return ()
    left = values - rows @ solution
    noise = float(left @ left) / (time.size - rows.shape[1])
    error = np.sqrt(noise * np.linalg.inv(rows.T @ rows)[_CUBIC, _CUBIC])
    turn = float(solution[_CUBIC + 1]) / scale
    return ((float(solution[_CUBIC]), turn, float(error)),) if turn else ()
