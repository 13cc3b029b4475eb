"""A record from any table whose columns name their units."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Final

import numpy as np
import pandas as pd

from finback.arrays import FloatArray
from finback.channels import CHANNELS
from finback.errors import InputError
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule
from finback.units import quantity_of, si_name, to_si, unit_of

_LOST: Final = 0.01  # of the rows of a table that may be left out because their time does not go on


def record_from_frame(
    frame: pd.DataFrame,
    *,
    name: str,
    condition: Condition,
    hold: Hold,
    columns: Mapping[str, str] | None = None,
    factors: Mapping[str, float] | None = None,
) -> FlightRecord:
    """Make a record of a table: one row a sample, a column of time, an elevator.

    Args:
        frame: numbers; a missing one is NaN.
        name: of the flight.
        condition: the reference flight: airspeed, density, gravity, altitude.
        hold: how the elevator moved between samples; ask whoever made the data, it decides what an input step means.
        columns: the table's name -> ours with the table's unit (``{"AoA": "alpha_deg"}``); only these are taken.
            Without it every column must be named so itself.
        factors: our quantity -> number by which it is multiplied (``{"elevator": -1.0}`` for another sign).

    Raises:
        InputError: a name has no unit, is no channel, is given twice or is not in the table (all such are named);
            there is no ``time`` or no ``elevator``; time does not increase.
    """
    names = dict(columns) if columns is not None else {str(column): str(column) for column in frame.columns}
    signs = dict(factors or {})
    faults: list[str] = []
    taken: dict[str, FloatArray] = {}
    for theirs, ours in names.items():
        fault = _fault(frame, theirs, ours, taken)
        if fault:
            faults.append(fault)
            continue
        unit = unit_of(ours)
        channel = si_name(ours)
        if frame.columns.tolist().count(theirs) > 1:
            faults.append(f"'{theirs}' stands in the table more than once")
            continue
        if not (
            pd.api.types.is_numeric_dtype(frame[theirs])
            or pd.api.types.is_object_dtype(frame[theirs])
            or pd.api.types.is_string_dtype(frame[theirs])
        ):
            faults.append(f"'{theirs}' holds {frame[theirs].dtype}, not numbers in {unit}")
            continue
        values = pd.to_numeric(frame[theirs], errors="coerce").to_numpy(dtype=np.float64)
        lost = int((np.isnan(values) & frame[theirs].notna().to_numpy()).sum())
        if lost:
            faults.append(f"'{theirs}': {lost} cells are no numbers")
        taken[channel] = to_si(values, unit) * signs.pop(quantity_of(ours), 1.0)
    faults += [f"factors name '{quantity}', which is no column" for quantity in signs]
    faults += [f"there is no '{needed}'" for needed in ("time_s", "elevator_rad") if needed not in taken and not faults]
    if faults:
        raise InputError(
            f"flight '{name}': {'; '.join(faults)}",
            hint="a column needs a channel's name with its unit, as 'alpha_deg': rename it, or map it to one",
        )
    if not np.isfinite(taken["time_s"]).all():
        raise InputError(f"flight '{name}': {int((~np.isfinite(taken['time_s'])).sum())} rows have no time")
    _check_time(name, taken["time_s"])
    known = np.isfinite(taken["elevator_rad"])
    if not known.any():
        raise InputError(f"flight '{name}': the elevator has no number at all")
    return FlightRecord(
        name=name,
        columns=taken,
        outcome=Outcome.COMPLETED,
        note="made of a table",
        condition=condition,
        schedule=Schedule(time_s=taken["time_s"][known], elevator_rad=taken["elevator_rad"][known]),
        hold=hold,
        provenance={"made_of": "a table"},
    )


def _check_time(name: str, time_s: FloatArray) -> None:
    """Name the first row whose time does not go on.

    Raises:
        InputError: there is one.
    """
    still = np.flatnonzero(np.diff(time_s) <= 0.0)
    if still.size:
        row = int(still[0]) + 1
        raise InputError(
            f"flight '{name}': time does not increase at {still.size} of {time_s.size} rows; the first is row {row} "
            f"(counted from 0), {time_s[row]:.9g} s after {time_s[row - 1]:.9g} s",
            hint="rows that a logger wrote twice can be left out: finback.formats.frame.increasing",
        )


def increasing(frame: pd.DataFrame, time: str) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return the rows whose time is later than that of all rows before, and what was left out, a sentence or none.

    Args:
        frame: any table.
        time: its column of time, numbers in any unit.

    Raises:
        InputError: there is no such column, or more than one row in a hundred would go: then the clock itself jumped,
            and nobody knows what the times mean.
    """
    if time not in frame.columns:
        raise InputError(f"the table has no column '{time}'", hint=f"it has: {', '.join(map(str, frame.columns))}")
    values = pd.to_numeric(frame[time], errors="coerce").to_numpy(dtype=np.float64)
    known = np.isfinite(values)
    before = np.maximum.accumulate(np.where(known, values, -np.inf))
    later = known & np.concatenate([[True], values[1:] > before[:-1]])[: values.size]
    lost = int((~later).sum())
    if not lost:
        return frame, ()
    row = int(np.flatnonzero(~later)[0])
    if lost > _LOST * values.size:
        raise InputError(
            f"time does not increase at {lost} of {values.size} rows, the first is row {row} (counted from 0)",
            hint="a clock that was set back, or several flights in one table: cut it there",
        )
    return frame[later], (f"{lost} of {values.size} rows left out, whose time does not go on, the first at row {row}",)


def _fault(frame: pd.DataFrame, theirs: str, ours: str, taken: Mapping[str, object]) -> str:
    """Return what is wrong with one column, or nothing."""
    if theirs not in frame.columns:
        near = get_close_matches(theirs, [str(column) for column in frame.columns], n=1)
        return f"the table has no column '{theirs}'{f' (did you mean {near[0]!r}?)' if near else ''}"
    try:
        channel = si_name(ours)
    except InputError as error:
        return error.message
    if channel not in CHANNELS:
        near = get_close_matches(channel, CHANNELS, n=1)
        return f"'{ours}' is no channel{f' (did you mean {near[0]!r}?)' if near else ''}"
    return f"'{channel}' is given twice" if channel in taken else ""
