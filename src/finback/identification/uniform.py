"""Records on one uniform time base: unequal and missing samples interpolated, longer gaps left as gaps."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, IntArray
from finback.channels import SURFACES
from finback.errors import InputError, RefusedError
from finback.records import FlightRecord, Hold

_ROUNDED: Final = 0.02
"""Of an interval: if no time stamp is farther from a grid, it is the stamps that are rounded. At 100 Hz and 100 deg/s
that is 0.02 deg; interpolation would color and lessen the noise of every sample instead."""
_GAP: Final = 3.0  # intervals
_BESIDE: Final = 0.35
"""Of an interval: a held sample that stands so little after a row of a grid of the same interval is that row's own.
Taken for the next one's, a step of the elevator would come a whole interval late."""
_HOLE: Final = 1.5  # intervals from which a sample is missing
_STEP: Final = 6.0  # usual changes of a held input, of which one more than this is a step
_ALIKE: Final = 1e-6  # of an interval: times that differ by less are the grid's own


def uniform(
    record: FlightRecord, *, interval_s: float = 0.0, longest_gap_s: float = 0.0
) -> tuple[FlightRecord, tuple[str, ...]]:
    """Return the record on a uniform grid of times, and what was done, a sentence for each column that changed.

    Each column is interpolated between its own finite samples, so columns of different rates may stand in one table
    with NaN between: straight lines for motion and for inputs that move so, the value before for held ones. Between
    samples further apart than ``longest_gap_s`` the column stays missing (NaN), as it does before its first and after
    its last sample; so does a held one where samples are missing and a step stands between: nobody knows when it came.
    Interpolated noise is smaller and colored; what is interpolated is counted for that reason.

    Args:
        record: any flight.
        interval_s: between two rows; 0 for the median of the record's own.
        longest_gap_s: longest stretch without a sample that is interpolated; 0 for three intervals, of the column's own
            samples where these are further apart.

    Raises:
        InputError: an interval is negative.
        RefusedError: the record has fewer than two samples.
    """
    if interval_s < 0.0 or longest_gap_s < 0.0:
        raise InputError(f"intervals must be > 0, got {interval_s} s and {longest_gap_s} s")
    time = record["time_s"]
    if time.size < 2:
        raise RefusedError(f"flight '{record.name}' has {time.size} samples: nothing can be interpolated")
    step, slack, moved = (interval_s, _ALIKE * interval_s, 0.0) if interval_s else _own_grid(time)
    rows = int(np.floor((time[-1] - time[0] + slack) / step)) + 1
    grid = time[0] + step * np.arange(rows)
    columns: dict[str, FloatArray] = {}
    said = []
    for name, values in record.columns.items():
        if name == "time_s":
            continue
        held = record.hold is Hold.ZOH and name in SURFACES
        longest = longest_gap_s or _GAP * max(step, _own_interval(time, values))
        columns[name], made, missing = _on_grid(time, values, grid, longest=longest, slack=slack, held=held)
        if made or missing:
            said.append(
                f"{name}: {made} of {rows} rows interpolated"
                + (f", {missing} left missing (gaps longer than {longest:.3g} s)" if missing else "")
            )
    if said or moved:
        times = f", its time stamps moved by up to {moved:.2g} s" if moved else ""
        said.insert(0, f"put on a grid of {step:.6g} s{times}")
    return record_on(record, grid, columns), tuple(said)


def _own_grid(time: FloatArray) -> tuple[float, float, float]:
    """Return the interval of a record's own grid, how far beside it a sample is still its own, and the farthest such.

    The median alone will not do: times that were written with three digits, or that are 1e6 rows long, drift from it.
    """
    rough = float(np.median(np.diff(time)))
    rows = np.concatenate([[0.0], np.cumsum(np.round(np.diff(time) / rough))])
    step = float(time[-1] - time[0]) / max(rows[-1], 1.0)
    stray = float(np.abs(time - time[0] - step * rows).max())
    if stray <= _ALIKE * step:
        return step, _ALIKE * step, 0.0
    return (step, _ROUNDED * step, stray) if stray <= _ROUNDED * step else (step, _ALIKE * step, 0.0)


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
    time: FloatArray, values: FloatArray, grid: FloatArray, *, longest: float, slack: float, held: bool
) -> tuple[FloatArray, int, int]:
    """Return a column at the grid's times, how many of them were interpolated, and how many are missing."""
    known = np.isfinite(values)
    if not known.any():
        return np.full(grid.size, np.nan), 0, grid.size
    at, sample = time[known], values[known]
    after = np.clip(np.searchsorted(at, grid - slack), 0, at.size - 1)
    before = np.clip(np.searchsorted(at, grid + slack, side="right") - 1, 0, at.size - 1)
    own = np.abs(at[after] - grid) <= slack
    unknown = np.zeros(grid.size, dtype=bool)
    if held:
        holding = np.where(own, after, _held_row(at, grid, before))
        found = sample[holding]
        unknown = ~own & _steps_in_holes(at, sample, grid, holding)
    else:
        found = np.interp(grid, at, sample)
    found = np.where(own, sample[after], found)
    outside = (grid < at[0] - slack) | (grid > at[-1] + slack)
    missing = unknown | ~own & (outside | (at[after] - at[before] > longest + slack))
    found[missing] = np.nan
    return found, int((~own & ~missing).sum()), int(missing.sum())


def _held_row(at: FloatArray, grid: FloatArray, before: IntArray) -> IntArray:
    """Return which sample holds at each row of the grid: that before, or one that stands just after the row."""
    usual = float(np.median(np.diff(at))) if at.size > 1 else 0.0
    if grid.size < 2 or grid[1] - grid[0] < (1.0 - _BESIDE) * usual:
        return before
    after = np.minimum(before + 1, at.size - 1)
    return np.where((at[after] > grid) & (at[after] - grid <= _BESIDE * usual), after, before)


def _steps_in_holes(at: FloatArray, sample: FloatArray, grid: FloatArray, before: IntArray) -> NDArray[np.bool_]:
    """Tell which rows stand where samples are missing and the held value steps meanwhile."""
    if at.size < 2:
        return np.zeros(grid.size, dtype=bool)
    usual = float(np.median(np.diff(at)))
    changes = np.abs(np.diff(sample))
    hole = (np.diff(at) > _HOLE * usual) & (changes > _STEP * np.median(changes))
    inside = grid - at[before] > _BESIDE * usual
    return np.asarray(np.append(hole, False)[before] & inside)
