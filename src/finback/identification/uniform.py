"""Records on one uniform time base: unequal and missing samples interpolated, longer gaps left as gaps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, IntArray
from finback.channels import SURFACES
from finback.errors import InputError, RefusedError
from finback.identification.clock import ROUNDED, Clock, Evidence, clock_of, evidence_of, moved_to_ticks, steps_of
from finback.identification.compatibility.wording import with_error
from finback.records import FlightRecord, Hold

_GAP: Final = 3.0  # intervals
_HOLE: Final = 1.5  # intervals from which a sample is missing
_BESIDE: Final = 0.35  # of an interval after a sample, from which a row is one that is missing
_STEP: Final = 6.0  # usual changes of a held input, of which one more than this is a step
_ALIKE: Final = 1e-6  # of an interval: times that differ by less are the grid's own
_EDGE: Final = 0.9  # of an interval by which a first stamp may be late and a last one early
_TOUCHED: Final = 0.02  # of an interval in which a step cannot have come


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Base:
    """When the samples of a record were taken.

    Attributes:
        record: the record, its motion as it was at ``time_s``.
        time_s: instants of its motion, in s, shape (n,).
        inputs_s: instants of its inputs, in s, shape (n,).
        slack_s: how far beside a row of a grid a sample is still its own.
        start_s: first row of a grid.
        interval_s: of the record's own grid.
        steps_before: why held inputs are taken to have stepped before the samples that show it; empty if they are not.
        said: what was done.
    """

    record: FlightRecord
    time_s: FloatArray
    inputs_s: FloatArray
    slack_s: float
    start_s: float
    interval_s: float
    steps_before: str = ""
    said: tuple[str, ...] = ()


def uniform(
    record: FlightRecord,
    *,
    interval_s: float = 0.0,
    longest_gap_s: float = 0.0,
    evidence: tuple[Evidence, ...] = (),
) -> tuple[FlightRecord, tuple[str, ...]]:
    """Return the record on a uniform grid of times, and what was done, a sentence for each column that changed.

    Each column is interpolated between its own finite samples, so columns of different rates may stand in one table
    with NaN between: straight lines for motion and for inputs that move so. A held input has, in each row, the mean of
    what was held until the next, so that its integral stays. Between samples further apart than ``longest_gap_s`` the
    column stays missing (NaN), as it does before its first and after its last sample; so does a held one where samples
    are missing and a step stands between: nobody knows when it came. Interpolated noise is smaller and colored; what is
    interpolated is counted for that reason.

    Time stamps that tremble about a uniform clock are either the true instants of the samples or only noise: the record
    is asked (``clock.evidence_of``). Samples taken at the ticks of the clock are put on its rows unchanged; samples
    taken at their stamps are moved to the rows along their local slope; where it cannot be told, the likelier of both.
    Stepped a held input before the samples that show it, rather than at them, its rows there are missing.

    Args:
        record: any flight.
        interval_s: between two rows; 0 for the median of the record's own.
        longest_gap_s: longest stretch without a sample that is interpolated; 0 for three intervals, of the column's own
            samples where these are further apart.
        evidence: what flights of the same logger say of its stamps together; the record alone if left out.

    Raises:
        InputError: an interval is negative.
        RefusedError: the record has fewer than two samples.
    """
    if interval_s < 0.0 or longest_gap_s < 0.0:
        raise InputError(f"intervals must be > 0, got {interval_s} s and {longest_gap_s} s")
    if len(record) < 2:
        raise RefusedError(f"flight '{record.name}' has {len(record)} samples: nothing can be interpolated")
    base = _base(record, interval_s, evidence)
    step = interval_s or base.interval_s
    rows = int(np.floor((base.time_s[-1] - base.start_s + base.slack_s) / step)) + 1
    grid = np.asarray(base.start_s + step * np.arange(rows), dtype=np.float64)
    columns: dict[str, FloatArray] = {}
    said: list[str] = []
    for name, values in base.record.columns.items():
        if name == "time_s":
            continue
        held, surface = record.hold is Hold.ZOH and name in SURFACES, name in SURFACES
        time = base.inputs_s if surface else base.time_s
        longest = longest_gap_s or _GAP * max(step, _own_interval(time, values))
        edge = base.slack_s if time is base.time_s else _EDGE * step  # a first stamp may be late, a last one early
        found = _on_grid(time, values, grid, longest=longest, within=(base.slack_s, edge), held=held)
        columns[name] = found
        lost = _taken_out(base, name, grid, found) if held and base.steps_before else 0
        made, missing = _counted(base.time_s, values, grid, found, slack=base.slack_s)
        if made or missing:
            said.append(
                f"{name}: {made} of {rows} rows interpolated"
                + (f", {missing} left missing (gaps longer than {longest:.3g} s)" if missing > lost else "")
                + (f", {lost} left missing at its steps: {base.steps_before}" if lost else "")
            )
    if said or base.said:
        said.insert(0, "".join([f"put on a grid of {step:.6g} s", *base.said]))
    return record_on(record, grid, columns), tuple(said)


def _base(record: FlightRecord, interval_s: float, evidence: tuple[Evidence, ...]) -> _Base:
    """Say when the samples were taken, and which grid is the record's own."""
    time = record["time_s"]
    step, stray = _own_grid(time)
    exact = _Base(
        record=record,
        time_s=time,
        inputs_s=time,
        slack_s=_ALIKE * (interval_s or step),
        start_s=float(time[0]),
        interval_s=step,
    )
    if stray <= _ALIKE * step:
        return exact
    if stray <= ROUNDED * step and not interval_s:
        return replace(exact, slack_s=ROUNDED * step, said=(f", its time stamps moved by up to {stray:.2g} s",))
    for clock in clock_of(time, interval_s=interval_s):
        return _by_clock(exact, clock, evidence or (evidence_of([record], interval_s=interval_s),))
    return exact


def _by_clock(exact: _Base, clock: Clock, evidence: tuple[Evidence, ...]) -> _Base:
    """Ask the record when its samples were taken, if stamps stray by more than rounding."""
    farthest = float(np.abs(clock.beside).max())
    ticks = clock.ticks_s
    base = replace(
        exact,
        time_s=ticks,
        inputs_s=ticks,
        slack_s=_ALIKE * clock.interval_s,
        start_s=clock.start_s,
        interval_s=clock.interval_s,
        said=(f", its time stamps moved by up to {farthest * clock.interval_s:.2g} s",),
    )
    if not clock.trembles:
        return base
    (found,) = evidence
    lead = with_error(found.lead, 2.0 * found.lead_error, "1")
    before = f"the motion turns {lead} of an interval before their samples"
    stepped = found.steps_before and (found.at_stamps or not found.sure)
    base = replace(base, steps_before=before if stepped else "", said=(_said_of_stamps(clock, found),))
    if not found.at_stamps:
        return base
    stamps = exact.time_s
    moved = {
        name: moved_to_ticks(values, stamps, clock)
        for name, values in exact.record.columns.items()
        if name != "time_s" and name not in SURFACES
    }
    return replace(base, record=exact.record.with_columns(**moved), inputs_s=stamps)


def _said_of_stamps(clock: Clock, found: Evidence) -> str:
    tremble = f"; its time stamps tremble by {100.0 * clock.tremble:.2g} % of that (rms)"
    measured = f"{with_error(found.slope, 2.0 * found.slope_error, '1')}, 1 for instants, 0 for noise"
    likely = "are" if found.sure else "are hardly to be told, but likelier to be"
    if not np.isfinite(found.slope_error):
        return f"{tremble}: nothing tells whether they are instants of samples or noise; samples left as they are"
    if found.at_stamps:
        return f"{tremble} and {likely} instants of samples ({measured}): moved along their slope"
    return f"{tremble} and {likely} noise ({measured}): samples left as they are"


def _own_grid(time: FloatArray) -> tuple[float, float]:
    """Return the interval of a record's own grid, and how far beside it its farthest sample is.

    The median alone will not do: times that were written with three digits, or that are 1e6 rows long, drift from it.
    """
    rough = float(np.median(np.diff(time)))
    rows = np.concatenate([[0.0], np.cumsum(np.round(np.diff(time) / rough))])
    step = float(time[-1] - time[0]) / max(rows[-1], 1.0)
    return step, float(np.abs(time - time[0] - step * rows).max())


def _own_interval(time: FloatArray, values: FloatArray) -> float:
    """Return the usual time between finite samples of a column; 0 if it has fewer than two."""
    at = time[np.isfinite(values)]
    return float(np.median(np.diff(at))) if at.size > 1 else 0.0


def record_on(record: FlightRecord, time_s: FloatArray, columns: dict[str, FloatArray]) -> FlightRecord:
    """Return the record with another time base and all its columns replaced."""
    return FlightRecord(
        name=record.name,
        columns={"time_s": time_s, **columns},
        outcome=record.outcome,
        note=record.note,
        condition=record.condition,
        schedule=record.schedule,
        hold=record.hold,
        provenance=record.provenance,
    )


def _on_grid(
    time: FloatArray, values: FloatArray, grid: FloatArray, *, longest: float, within: tuple[float, float], held: bool
) -> FloatArray:
    """Return a column at the grid's times, NaN where it is missing.

    Within two times a sample is a row's own, and a row beyond the first or last sample still theirs.
    """
    slack, edge = within
    known = np.isfinite(values)
    if not known.any():
        return np.full(grid.size, np.nan)
    at, sample = time[known], values[known]
    after = np.clip(np.searchsorted(at, grid - slack), 0, at.size - 1)
    before = np.clip(np.searchsorted(at, grid + slack, side="right") - 1, 0, at.size - 1)
    own = np.abs(at[after] - grid) <= slack
    unknown = np.zeros(grid.size, dtype=bool)
    if held:
        holding = np.where(own, after, before)
        found = _held_means(at, sample, grid, holding, slack)
        unknown = ~own & _steps_in_holes(at, sample, grid, holding)
    else:
        found = np.where(own, sample[after], np.interp(grid, at, sample))
    outside = (grid < at[0] - edge) | (grid > at[-1] + edge)
    found[unknown | ~own & (outside | (at[after] - at[before] > longest + slack))] = np.nan
    return found


def _counted(
    time: FloatArray, values: FloatArray, grid: FloatArray, found: FloatArray, *, slack: float
) -> tuple[int, int]:
    """Return how many rows of a column were interpolated, and how many are missing."""
    at = time[np.isfinite(values)]
    if not at.size:
        return 0, grid.size
    after = np.clip(np.searchsorted(at, grid - slack), 0, at.size - 1)
    own = np.abs(at[after] - grid) <= slack
    missing = np.isnan(found)
    return int((~own & ~missing).sum()), int(missing.sum())


def _held_means(at: FloatArray, sample: FloatArray, grid: FloatArray, holding: IntArray, slack: float) -> FloatArray:
    """Return the mean, from each row to the next, of what is held; ``holding`` is the sample that holds at each row."""
    found = sample[holding].copy()
    if grid.size < 2:
        return found
    step = float(grid[-1] - grid[0]) / (grid.size - 1)
    row = np.clip(np.searchsorted(grid, at[1:], side="right") - 1, 0, grid.size - 1)
    rest = np.minimum(1.0 - (at[1:] - grid[row]) / step, 1.0)
    inside = (np.arange(1, at.size) > holding[row]) & (rest * step > slack)
    np.add.at(found, row[inside], (np.diff(sample) * rest)[inside])
    return found


def _steps_in_holes(at: FloatArray, sample: FloatArray, grid: FloatArray, before: IntArray) -> NDArray[np.bool_]:
    """Tell which rows stand where samples are missing and the held value steps meanwhile."""
    if at.size < 2:
        return np.zeros(grid.size, dtype=bool)
    usual = float(np.median(np.diff(at)))
    changes = np.abs(np.diff(sample))
    hole = (np.diff(at) > _HOLE * usual) & (changes > _STEP * np.median(changes))
    inside = grid - at[before] > _BESIDE * usual
    return np.asarray(np.append(hole, False)[before] & inside)


def _taken_out(base: _Base, name: str, grid: FloatArray, found: FloatArray) -> int:
    """Take out the rows of a held input at its steps; return how many."""
    time, before = base.record["time_s"], np.isfinite(found)
    interval = float(grid[-1] - grid[0]) / max(grid.size - 1, 1)
    for old, new in zip(*steps_of(base.record, name), strict=True):
        first = int(np.floor((time[old] - grid[0]) / interval + _TOUCHED))
        last = int(np.ceil((time[new] - grid[0]) / interval - _TOUCHED)) - 1
        # A row that is missing takes the intervals before and after it out.
        found[max(first + 1, 0) : max(last, first + 1) + 1] = np.nan
    return int((before & np.isnan(found)).sum())
