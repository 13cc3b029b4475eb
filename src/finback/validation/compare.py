"""Any trajectory against a reference: another simulator's, or a flight's, channel by channel.

The two need not have been sampled alike. They are compared at the times of the reference that both cover; ours is
interpolated to them where it has no sample there. What a difference may be is said by whoever maps the reference.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from enum import StrEnum
from types import MappingProxyType
from typing import Final, final

import numpy as np
from scipy.interpolate import make_interp_spline

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError, RefusedError
from finback.formats.text_table import TextFormat
from finback.units import SI_FACTORS, si_factor, si_unit, to_si
from finback.validation.metric import Judgement, Metric, verdict
from finback.validation.trajectory import Theil, rms, theil

_SAME_TIME: Final = 1e-6
"""Of the sample interval: times nearer than this are one time, written with fewer digits."""
_CUBIC_POINTS: Final = 4
_UNLIKE, _ALIKE = 0.1, 0.02  # of ours: differences this large are looked into; what makes them this small is told
_LINE: Final = 100  # characters
_FEWEST: Final = 2  # samples: one alone has no history


@final
class Resampling(StrEnum):
    """How a channel of ours is read between its samples."""

    CUBIC = "cubic"
    """cubic spline, for smooth motion: error of the order of the fourth power of the interval"""
    LINEAR = "linear"
    """straight lines, for signals with corners"""
    PREVIOUS = "previous"
    """held from each sample to the next, for signals with jumps"""


@final
class Measure(StrEnum):
    """What of a difference a tolerance bounds."""

    WORST = "worst"
    RELATIVE = "relative"
    """the worst difference over the largest size of the reference"""
    RMSE = "rmse"
    THEIL = "theil"


PURE: Final = (Measure.RELATIVE, Measure.THEIL)
"""Measures that are pure numbers."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Bound:
    """A tolerance of one measure.

    Attributes:
        measure: what is bounded.
        value: the largest that agrees, in the SI unit of the channel (``PURE``: a pure number); 0 for the same bits.
        source: rule, standard or requirement that the value comes from.
    """

    measure: Measure
    value: float
    source: str


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MappedChannel:
    """One quantity of ours and what the reference calls it.

    Attributes:
        name: our name, with its SI unit.
        reference: the column of the reference.
        unit: the column's unit.
        factor: by which the column is multiplied first, such as -1 for another sign.
        offset: added after that, in ``unit``.
        angular: the difference is taken around the circle (angles that wrap at ±180° or at 360°).
        resampling: how ours is read between its samples.
        bounds: what the differences may be; none to report them only.
    """

    name: str
    reference: str
    unit: str
    factor: float = 1.0
    offset: float = 0.0
    angular: bool = False
    resampling: Resampling = Resampling.CUBIC
    bounds: tuple[Bound, ...] = ()


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelMap:
    """How a reference is to be read.

    Attributes:
        flight: name of our flight; empty where there is one only.
        time: the reference's column of time.
        time_unit: its unit.
        time_offset_s: added to the reference's time.
        layout: how the file is written.
        window_s: first and last time of the reference that is compared.
        channels: what is compared, one or more.
    """

    flight: str
    time: str
    time_unit: str
    time_offset_s: float
    layout: TextFormat
    window_s: tuple[float, float]
    channels: tuple[MappedChannel, ...]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """Columns over time, whoever made them.

    Attributes:
        name: of the flight or the file.
        time_s: increasing, shape (n,).
        columns: name -> values, shape (n,).
    """

    name: str
    time_s: FloatArray
    columns: Mapping[str, FloatArray]

    def __post_init__(self) -> None:
        """Freeze the columns and check the times."""
        object.__setattr__(self, "time_s", frozen_array(self.time_s))
        object.__setattr__(
            self, "columns", MappingProxyType({name: frozen_array(values) for name, values in self.columns.items()})
        )
        bad = np.flatnonzero(~np.isfinite(self.time_s))
        if bad.size:
            raise InputError(f"{self.name}: time is no number in row {bad[0] + 1}")
        back = np.flatnonzero(np.diff(self.time_s) <= 0.0)
        if back.size:
            row = int(back[0])
            raise InputError(
                f"{self.name}: time does not increase from row {row + 1} ({self.time_s[row]:.9g} s) "
                f"to row {row + 2} ({self.time_s[row + 1]:.9g} s)"
            )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelComparison:
    """One channel of both.

    Attributes:
        name: our name of the channel.
        reference: the reference's.
        unit: SI unit of all values here.
        map_unit: the unit of the map, in which people read them.
        time_s: times compared, shape (n,), as the reference has them (its offset added).
        ours: our values at them, shape (n,).
        theirs: the reference's, shape (n,).
        difference: ours − theirs, for angles in (−π, π], shape (n,).
        interpolated: at how many of the times ours has no sample of its own.
        missing: rows of the reference in the common time that hold no number.
        worst: the largest size of the difference.
        worst_time_s: when.
        rmse: root mean square of the difference.
        theil: Theil's inequality coefficient and its split.
        metrics: one for each bound.
        suspicion: what would make them alike, if they are not and something simple would, or how many values of ours
            are no numbers; else empty.
    """

    name: str
    reference: str
    unit: str
    map_unit: str
    time_s: FloatArray
    ours: FloatArray
    theirs: FloatArray
    difference: FloatArray
    interpolated: int
    missing: int
    worst: float
    worst_time_s: float
    rmse: float
    theil: Theil
    metrics: tuple[Metric, ...]
    suspicion: str = ""

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("time_s", "ours", "theirs", "difference"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectoryComparison:
    """A trajectory beside its reference.

    Attributes:
        name: our flight.
        reference: what it was compared with.
        start_s: first time that both cover.
        end_s: last time that both cover.
        channels: in the order of the map.
        uncovered_s: time of the reference that ours does not cover.
    """

    name: str
    reference: str
    start_s: float
    end_s: float
    channels: tuple[ChannelComparison, ...]
    uncovered_s: float

    @property
    def metrics(self) -> tuple[Metric, ...]:
        """All metrics of all channels; empty if the map bounds nothing."""
        return tuple(metric for channel in self.channels for metric in channel.metrics)

    @property
    def verdict(self) -> Judgement:
        """Whether all bounds hold; inconclusive where the map has none, or where what holds was not covered."""
        found = verdict(self.metrics)
        partly = any(not metric.counted for metric in self.metrics)
        return Judgement.INCONCLUSIVE if partly and found is Judgement.AGREES else found


def compare(
    ours: Trajectory,
    reference: Trajectory,
    channels: Sequence[MappedChannel],
    *,
    window_s: tuple[float, float] = (-math.inf, math.inf),
) -> TrajectoryComparison:
    """Compare channel by channel at the times of the reference that both cover.

    A flight that covers less than the reference (or than ``window_s`` of it) proves nothing of the rest: its metrics
    are not counted and the verdict is inconclusive at best. Rows of the reference without a number are left out and
    counted; a channel that lacks more than half of its rows is not counted either; a channel of ours that is not finite
    there is infinitely wrong, and no tolerance holds.

    Args:
        ours: in SI, with the names that the channels have.
        reference: in its own units and names.
        channels: what to compare.
        window_s: first and last time of the reference that is asked for.

    Raises:
        InputError: a channel or a column is missing (all of them are named).
        RefusedError: the two have no two times in common.
    """
    check_names((ours.name, ours.columns), (reference.name, reference.columns), channels)
    asked = (reference.time_s >= window_s[0]) & (reference.time_s <= window_s[1])
    start, end = float(ours.time_s[0]), float(ours.time_s[-1])
    interval = float(np.median(np.diff(reference.time_s))) if reference.time_s.size > 1 else 0.0
    slack = _SAME_TIME * interval
    common = asked & (reference.time_s >= start - slack) & (reference.time_s <= end + slack)
    if int(common.sum()) < _FEWEST:
        raise RefusedError(
            f"'{ours.name}' lasts from {ours.time_s[0]:.6g} to {ours.time_s[-1]:.6g} s, '{reference.name}' from "
            f"{reference.time_s[0]:.6g} to {reference.time_s[-1]:.6g} s: nothing in common to compare",
            hint="time.offset_s of the map shifts the reference",
        )
    whole = int(common.sum()) == int(asked.sum())
    return TrajectoryComparison(
        name=ours.name,
        reference=reference.name,
        start_s=float(reference.time_s[common][0]),
        end_s=float(reference.time_s[common][-1]),
        channels=tuple(_channel(ours, reference, common, channel, slack, whole=whole) for channel in channels),
        uncovered_s=float(np.ptp(reference.time_s[asked]) - np.ptp(reference.time_s[common])),
    )


def check_names(
    ours: tuple[str, Collection[str]], reference: tuple[str, Collection[str]], channels: Sequence[MappedChannel]
) -> None:
    """Raise InputError with every channel and column that is not there, and what may have been meant.

    Args:
        ours: name of our trajectory, and of its columns.
        reference: the same of the other one.
        channels: what is to be compared.
    """
    wanted = ((ours, [channel.name for channel in channels]), (reference, [channel.reference for channel in channels]))
    missing = [
        f"'{trajectory}' has no '{name}'{_but(get_close_matches(name, columns, n=2, cutoff=0.5))}"
        for (trajectory, columns), names in wanted
        for name in dict.fromkeys(names)
        if name not in columns
    ]
    if missing:
        raise InputError(
            f"the map names what is not there: {'; '.join(missing)}",
            hint="\n  ".join(listed(f"'{name}' has: ", columns) for name, columns in (ours, reference)),
        )


def listed(said: str, names: Collection[str]) -> str:
    """Return names after what is said of them, in lines that a terminal holds."""
    return textwrap.fill(
        said + ", ".join(names), _LINE, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
    )


def _but(near: Sequence[str]) -> str:
    return f" (but {', '.join(near)})" if near else ""


def _channel(
    ours: Trajectory, reference: Trajectory, common: np.ndarray, channel: MappedChannel, slack: float, *, whole: bool
) -> ChannelComparison:
    raw = reference.columns[channel.reference][common]
    known = np.isfinite(raw)
    if int(known.sum()) < _FEWEST:
        raise RefusedError(
            f"column '{channel.reference}' of '{reference.name}' has {int(known.sum())} numbers in the common time"
        )
    time = reference.time_s[common][known]
    theirs = converted = to_si(channel.factor * raw[known] + channel.offset, channel.unit)
    values = ours.columns[channel.name]
    here, sampled = _at(ours.time_s, _unwrapped(values) if channel.angular else values, time, channel, slack)
    difference = here - theirs
    if channel.angular:
        difference = np.pi - np.mod(np.pi - difference, 2.0 * np.pi)
        theirs = here - difference
    size = np.where(np.isfinite(difference), np.abs(difference), math.inf)
    at = int(size.argmax())
    largest = float(np.abs(theirs).max())
    found = {Measure.WORST: float(size[at]), Measure.RMSE: rms(difference)}
    found[Measure.RELATIVE] = found[Measure.WORST] / largest if largest else math.inf if found[Measure.WORST] else 0.0
    inequality = theil(here, theirs)
    found[Measure.THEIL] = inequality.coefficient
    unit = si_unit(channel.unit)
    why_not = "" if whole else "the flight does not cover the reference"
    if 2 * int(known.sum()) < known.size:
        why_not = f"{int((~known).sum())} of {known.size} rows of the reference hold no number"
    return ChannelComparison(
        name=channel.name,
        reference=channel.reference,
        unit=unit,
        map_unit=channel.unit,
        time_s=time,
        ours=here,
        theirs=theirs,
        difference=difference,
        interpolated=int((~sampled).sum()),
        missing=int((~known).sum()),
        worst=found[Measure.WORST],
        worst_time_s=float(time[at]),
        rmse=found[Measure.RMSE],
        theil=inequality,
        metrics=tuple(_metric(channel, bound, found[bound.measure], unit, why_not) for bound in channel.bounds),
        suspicion=_holes(here, time)
        or _suspicion(here, _unwrapped(converted) if channel.angular else converted, channel.unit),
    )


def _unwrapped(angles: FloatArray) -> FloatArray:
    """Return angles without their jumps by whole turns; what is not finite stays, and spoils no other."""
    found = np.array(angles)
    finite = np.isfinite(found)
    found[finite] = np.unwrap(found[finite])
    return found


def _holes(ours: FloatArray, time_s: FloatArray) -> str:
    """Return how much of ours is no number, and from when on, if any of it is."""
    lost = np.flatnonzero(~np.isfinite(ours))
    if not lost.size:
        return ""
    return f"{lost.size} of our {ours.size} values there are no finite numbers (NaN), from {time_s[lost[0]]:.6g} s on"


def _suspicion(ours: FloatArray, theirs: FloatArray, unit: str) -> str:
    """Return which other unit or sign of the reference would make both alike, if one would and they are not."""
    scale = rms(ours)
    if not (math.isfinite(scale) and scale > 0.0) or rms(ours - theirs) < _UNLIKE * scale or not theirs.any():
        return ""
    kindred = {other: factor / si_factor(unit) for other, (si, factor) in SI_FACTORS.items() if si == si_unit(unit)}
    for sign, said in ((1.0, ""), (-1.0, "with the other sign")):
        for other, ratio in kindred.items():
            if rms(ours - sign * ratio * theirs) < _ALIKE * scale and (sign < 0.0 or ratio != 1.0):
                named = f"in '{other}'" if ratio != 1.0 else ""
                return f"the reference would agree to {_ALIKE:.0%} {' and '.join(x for x in (named, said) if x)}"
    return ""


def _metric(channel: MappedChannel, bound: Bound, value: float, unit: str, why_not: str) -> Metric:
    return Metric(
        name=f"{channel.name}: {bound.measure.value}",
        unit="1" if bound.measure in PURE else unit,
        simulated=0.0,
        predicted=value,
        uncertainty=0.0,
        tolerance=max(bound.value, math.ulp(0.0)),  # a metric's is positive: the smallest number allows no difference
        source=bound.source,
        # Beyond its tolerance a difference disagrees however little was covered; within, it says nothing of the rest.
        counted=not why_not or not value <= bound.value,
        note=why_not,
    )


def _at(
    time_s: FloatArray, values: FloatArray, wanted_s: FloatArray, channel: MappedChannel, slack: float
) -> tuple[FloatArray, np.ndarray]:
    """Return the values at other times, and at which of them there is a sample."""
    nearest = np.clip(np.searchsorted(time_s, wanted_s), 1, max(1, time_s.size - 1))
    nearest = np.where(
        np.abs(time_s[nearest - 1] - wanted_s) <= np.abs(time_s[np.minimum(nearest, time_s.size - 1)] - wanted_s),
        nearest - 1,
        np.minimum(nearest, time_s.size - 1),
    )
    sampled = np.abs(time_s[nearest] - wanted_s) <= slack
    found = values[nearest].astype(np.float64)
    rest = ~sampled
    if rest.any():
        found[rest] = _between(time_s, values, wanted_s[rest], channel.resampling)
    return found, sampled


def _between(time_s: FloatArray, values: FloatArray, wanted_s: FloatArray, resampling: Resampling) -> FloatArray:
    finite = np.isfinite(values)
    if resampling is Resampling.PREVIOUS:
        return values[np.clip(np.searchsorted(time_s, wanted_s, side="right") - 1, 0, None)]
    if resampling is Resampling.LINEAR or time_s.size < _CUBIC_POINTS or not finite.all():
        return np.interp(wanted_s, time_s, values)
    return np.asarray(make_interp_spline(time_s, values, k=3)(wanted_s), dtype=np.float64)
