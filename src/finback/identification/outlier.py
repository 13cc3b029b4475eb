"""Samples that no motion can explain: found by a running median, taken out, and counted."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from finback.arrays import FloatArray
from finback.errors import InputError
from finback.records import FlightRecord

_NORMAL_MAD: Final = 1.4826  # standard deviations of a normal distribution in one median absolute deviation
_WINDOW: Final = 41  # samples over which the usual distance from what is expected is taken
_GAP: Final = 3.0  # usual distances of present samples
_JUMP: Final = 0.5  # of an outlier's distance: a corner is left by a sixth of it at each sample
_BLOCK: Final = 200  # samples
_LEAST_BLOCK: Final = 10  # samples, below which those beside a gap are not judged
_CHOSEN: Final = 12  # samples beside a gap, through triples of which parabolas go
_NEAR: Final = 3.0  # robust deviations of samples that a parabola goes through
_DIGITS: Final = 3.0  # smallest changes of a column that are never an outlier: its last digit
_ROUNDING: Final = 1e-12  # of the largest value: smaller changes are no digit of the instrument
_UNTOUCHED: Final = ("time_s",)
_JUMPING: Final = ("elevator", "canard", "aileron", "rudder")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class OutlierOptions:
    """What counts as an outlier (after Hampel's identifier; Pearson 2002, IEEE Trans. Control Syst. Technol. 10, 55).

    Attributes:
        half_width: runs of up to so many outliers are found; three times as many samples beside an end or a gap are
            judged by a parabola.
        threshold: robust standard deviations from what the neighbors say beyond which a sample is one. A normal noise
            passes 6 once in 5e8 samples.
        least: changes smaller than this share of a column's own spread are none (a quantized signal is mostly still,
            and its robust deviation 0).
    """

    half_width: int = 4
    threshold: float = 6.0
    least: float = 0.02

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.half_width < 1 or not self.threshold > 0.0 or not self.least >= 0.0:
            raise InputError(f"no outlier can be told by {self}")


def without_outliers(
    record: FlightRecord, options: OutlierOptions, *, names: tuple[str, ...] = ()
) -> tuple[FlightRecord, tuple[str, ...]]:
    """Return the record with outliers as missing samples (NaN), and what was taken out, a sentence for each column.

    Args:
        record: any flight.
        options: what counts.
        names: columns to judge; empty for all but time and what is held (a held elevator jumps by right).
    """
    judged = names or tuple(name for name in record.columns if name not in _UNTOUCHED and not name.startswith(_JUMPING))
    cleaned: dict[str, FloatArray] = {}
    said = []
    for name in judged:
        wrong = outliers(record[name], options, time_s=record["time_s"])
        if wrong.any():
            cleaned[name] = np.where(wrong, np.nan, record[name])
            first = float(record["time_s"][np.argmax(wrong)])
            said.append(
                f"{name}: {int(wrong.sum())} outliers of {wrong.size} samples left out, the first at {first:.6g} s"
            )
    return record.with_columns(**cleaned), tuple(said)


def outliers(values: FloatArray, options: OutlierOptions, *, time_s: FloatArray | None = None) -> NDArray[np.bool_]:
    """Return which samples of a column are outliers, shape (n,); missing ones are none.

    An outlier leaves its neighbors by a jump and comes back by one. A corner, where a control that is stepped sets the
    rate of a rate anew, is as far from what both sides say, but it is reached sample by sample, and is none.

    Args:
        values: of the column, shape (n,).
        options: what counts.
        time_s: of the samples, where rows may be missing, shape (n,); samples at equal distance if left out.
    """
    known = np.isfinite(values)
    found = np.zeros(values.size, dtype=bool)
    present = values[known]
    if present.size <= _WINDOW:
        return found
    places = np.arange(values.size, dtype=np.float64) if time_s is None else time_s
    first = _judged(present, present, places[known], options)
    if first.any():
        # Neighbors of an outlier had it among those they are judged by.
        rows = np.arange(present.size)
        filled = np.interp(rows, rows[~first], present[~first])
        first = _judged(present, filled, places[known], options)
    found[known] = first
    return found


def _judged(present: FloatArray, by: FloatArray, places: FloatArray, options: OutlierOptions) -> NDArray[np.bool_]:
    """Judge samples that are there by what the same column says with other values in some places, shape (present,)."""
    pairs = 3 * options.half_width
    beside = present - _expected(by, pairs)
    for segment in _segments(places):
        _judge_ends(beside, present, places, segment, pairs)
    away = np.abs(beside)
    usual = np.maximum(median_filter(away, size=_WINDOW, mode="mirror"), _around(away))
    local = _NORMAL_MAD * usual
    changes = np.abs(np.diff(present))
    spread = _NORMAL_MAD * float(np.median(np.abs(present - np.median(present))))
    real = changes[changes > _ROUNDING * np.abs(present).max()]
    digit = float(real.min()) if real.size else 0.0
    far = away > np.maximum(options.threshold * local, max(options.least * spread, _DIGITS * digit))
    return far & _jumped(beside, options.half_width)


def _jumped(beside: FloatArray, run: int) -> NDArray[np.bool_]:
    """Tell which samples lie between a jump to their side and one back, each of half their distance, within ``run``."""
    side = np.sign(beside)
    steps = np.diff(np.pad(beside, 1))  # before the first sample and after the last, nothing is beside
    least = _JUMP * np.abs(beside)
    away, back = np.zeros(beside.size), np.zeros(beside.size)
    for sign in (1.0, -1.0):
        # Window k holds the jumps into samples k - run + 1 ... k.
        out, home = (
            np.lib.stride_tricks.sliding_window_view(np.pad(turn * steps, run - 1), run).max(axis=1)
            for turn in (sign, -sign)
        )
        mine = side == sign
        away[mine], back[mine] = out[: beside.size][mine], home[run : run + beside.size][mine]
    return np.asarray((away >= least) & (back >= least))


def _segments(places: FloatArray) -> list[tuple[int, int]]:
    """Return first and after-last of the present samples between gaps."""
    steps = np.diff(places)
    gaps = np.flatnonzero(steps > _GAP * np.median(steps)) + 1
    return list(pairwise([0, *gaps.tolist(), places.size]))


def _judge_ends(
    beside: FloatArray, present: FloatArray, places: FloatArray, segment: tuple[int, int], pairs: int
) -> None:
    """Put in ``beside`` how far samples within ``pairs`` of an end or a gap are from a parabola through most of them.

    Neighbors at equal distance are there on one side only. Of segments with few samples nothing is said.
    """
    first, last = segment
    width = min(2 * pairs, last - first)
    for begin, judged in ((first, slice(0, pairs)), (last - width, slice(max(width - pairs, 0), width))):
        block = slice(begin, begin + width)
        if width < _LEAST_BLOCK:
            beside[block] = 0.0
        else:
            beside[block][judged] = _from_most(places[block], present[block])[judged]


def _from_most(places: FloatArray, values: FloatArray) -> FloatArray:
    """Return how far values are from the parabola of least median (Rousseeuw 1984, JASA 79, 871), fitted again to most.

    Half of the samples may be anything.
    """
    at = (places - places[0]) / (places[-1] - places[0])
    powers = np.vander(at, 3)
    chosen = np.array(list(combinations(range(0, at.size, max(1, at.size // _CHOSEN)), 3)))
    curves = np.linalg.solve(powers[chosen], values[chosen][..., np.newaxis])[..., 0]
    left = np.abs(values - curves @ powers.T)
    medians = np.median(left, axis=1)
    best = int(medians.argmin())
    near = left[best] <= _NEAR * _NORMAL_MAD * medians[best]
    curve = np.linalg.lstsq(powers[near], values[near], rcond=None)[0]
    return np.asarray(values - powers @ curve)


def _around(away: FloatArray) -> FloatArray:
    """Return the median over some hundred samples around each: that of 41 alone is at times far too small by chance."""
    ends = np.unique(np.linspace(0, away.size, max(2, round(away.size / _BLOCK) + 1)).astype(np.int64))
    medians = [float(np.median(away[first:last])) for first, last in pairwise(ends.tolist())]
    return np.interp(np.arange(away.size), 0.5 * (ends[1:] + ends[:-1]), medians)


def _expected(values: FloatArray, pairs: int) -> FloatArray:
    """Return the median of the means of neighbors at equal distance: right on straight lines, blind to few outliers."""
    padded = np.pad(values, pairs, mode="reflect", reflect_type="odd")
    middle = np.arange(values.size) + pairs
    means = [0.5 * (padded[middle - k] + padded[middle + k]) for k in range(1, pairs + 1)]
    return np.asarray(np.median(means, axis=0), dtype=np.float64)
