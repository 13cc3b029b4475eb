"""Columns as their instruments sampled them: angles without jumps of a turn, values written again left out."""

from __future__ import annotations

from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.channels import SURFACES
from finback.records import FlightRecord, Hold

_TURNING: Final = ("phi_rad", "psi_rad")
_FEWEST: Final = 20  # changes of a column, below which nothing is said about its rate
_REGULAR: Final = 0.95  # of the changes stand on one comb
_SLOWER: Final = 1.5  # intervals of the grid from which an instrument is slower than it
_MOVING: Final = 0.5  # of the rows of its comb show a change: what is mostly still says nothing about its rate


def without_turns(record: FlightRecord) -> tuple[FlightRecord, tuple[str, ...]]:
    """Return the record with roll angle and heading continuous, and what was done, a sentence for each.

    Between 180 deg and -180 deg there is no motion; interpolation across that jump would make one.
    """
    columns: dict[str, FloatArray] = {}
    said = []
    for name in _TURNING:
        if name not in record.columns:
            continue
        values = record[name].copy()
        known = np.isfinite(values)
        values[known] = np.unwrap(values[known])
        jumps = int((np.abs(np.diff(values[known]) - np.diff(record[name][known])) > np.pi).sum())
        if jumps:
            columns[name] = values
            said.append(f"{name}: {jumps} jumps of a full turn taken out")
    return record.with_columns(**columns), tuple(said)


def without_repeats(record: FlightRecord) -> tuple[FlightRecord, tuple[str, ...]]:
    """Return the record with repeated values of slower instruments as missing samples, and what was done.

    A logger writes the last value of a slow channel again until a new one comes. Such a column changes at every m-th
    row only, or at multiples of that; a rounded one changes at any. A surface that is held is left alone.
    """
    columns: dict[str, FloatArray] = {}
    said = []
    for name, values in record.columns.items():
        if name == "time_s" or (record.hold is Hold.ZOH and name in SURFACES):
            continue
        repeat, first = _comb(values)
        if repeat > 1:
            fresh = np.zeros(values.size, dtype=bool)
            fresh[first::repeat] = True
            columns[name] = np.where(fresh, values, np.nan)
            said.append(f"{name}: one new value in {repeat} rows; the repeats left out")
    return record.with_columns(**columns), tuple(said)


def as_sampled(gridded: FlightRecord, before: FlightRecord) -> FlightRecord:
    """Return a record on a uniform grid without what was interpolated between samples of slower instruments.

    Interpolated, their noise would look smaller than it is, and as if it came more often. A column whose samples are as
    dense as the grid is left alone.

    Args:
        gridded: the record on the grid.
        before: the same flight, as sampled, without repeats.
    """
    grid, time = gridded["time_s"], before["time_s"]
    step = float(grid[-1] - grid[0]) / max(grid.size - 1, 1)
    columns: dict[str, FloatArray] = {}
    for name, values in before.columns.items():
        own = time[np.isfinite(values)]
        if name == "time_s" or own.size < 2 or float(np.median(np.diff(own))) < _SLOWER * step:
            continue
        fresh = np.zeros(grid.size, dtype=bool)
        fresh[np.clip(np.round((own - grid[0]) / step).astype(np.int64), 0, grid.size - 1)] = True
        columns[name] = np.where(fresh, gridded[name], np.nan)
    return gridded.with_columns(**columns)


def _comb(values: FloatArray) -> tuple[int, int]:
    """Return of which period and first row a column's changes are; (1, 0) if they are of none."""
    known = np.flatnonzero(np.isfinite(values))
    changes = known[1:][np.diff(values[known]) != 0.0]
    if changes.size < _FEWEST:
        return 1, 0
    period = int(np.bincount(np.diff(changes)).argmax())
    if period < 2 or changes.size < _MOVING * known.size / period:
        return 1, 0
    phase = int(np.bincount(changes % period).argmax())
    return (period, phase) if np.mean(changes % period == phase) >= _REGULAR else (1, 0)
