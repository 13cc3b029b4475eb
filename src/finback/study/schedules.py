"""Schedules of a case in a file (TOML): what is moved, when, and how it is held."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Annotated, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from finback.arrays import frozen_array
from finback.errors import FaultyFileError, InputError
from finback.flight.case_drive import Drive, named_drive
from finback.flight.multisine import orthogonal_multisines
from finback.records import Hold
from finback.study.checked import read_checked

_SCHEMA: Final = 1
_POINTS: Final = 32
"""Of the shortest period: straight lines between them cut off half a per cent of its peaks at most."""
_MOST_POINTS: Final = 1_000_000

Finite = Annotated[float, Field(allow_inf_nan=False)]


class _ScheduleTable(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    name: Annotated[str, Field(min_length=1)]
    hold: Annotated[str, Field(pattern="^(foh|zoh)$")] = Hold.FOH.value
    time_s: Annotated[list[Finite], Field(min_length=1)]
    value: Annotated[list[Finite], Field(min_length=1)]


class _MultisineTable(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    names: Annotated[list[Annotated[str, Field(min_length=1)]], Field(min_length=1)]
    around: Annotated[list[Finite], Field(min_length=1)]
    amplitude: Annotated[list[Finite], Field(min_length=1)]
    lowest_hz: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    highest_hz: Annotated[float, Field(gt=0.0, le=1e3)]
    period_s: Annotated[float, Field(gt=0.0, le=14_400.0)]
    periods: Annotated[int, Field(ge=1, le=1000)] = 1
    lead_s: Annotated[float, Field(ge=0.0, le=14_400.0)] = 0.0


class _SchedulesTable(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    schema_: Annotated[int, Field(alias="schema", ge=_SCHEMA, le=_SCHEMA)]
    schedule: list[_ScheduleTable] = []
    multisine: list[_MultisineTable] = []


def read_schedules(path: Path) -> tuple[Drive, ...]:
    """Read the schedules of a case (docs/fly.md).

    Raises:
        FaultyFileError: with every fault of the file.
    """
    read = read_checked(path, _SchedulesTable, {"schedule": _ScheduleTable, "multisine": _MultisineTable})
    faults: list[str] = []
    drives: list[Drive] = []
    makers = [(f"schedule[{number}]", partial(_points, schedule)) for number, schedule in enumerate(read.schedule)] + [
        (f"multisine[{number}]", partial(_multisines, table)) for number, table in enumerate(read.multisine)
    ]
    for place, make in makers:
        try:
            drives += make()
        except InputError as error:
            faults.append(f"{place}: {error.message}{f'; {error.hint}' if error.hint else ''}")
    if not makers:
        faults.append("schedule: missing; add a table [[schedule]] or [[multisine]]")
    if faults:
        raise FaultyFileError(str(path), tuple(faults))
    return tuple(drives)


def _points(table: _ScheduleTable) -> list[Drive]:
    return [named_drive(table.name, np.array(table.time_s), np.array(table.value), Hold(table.hold))]


def _multisines(table: _MultisineTable) -> list[Drive]:
    """Return whole periods of orthogonal multisines, one for each name, about a value each."""
    count = len(table.names)
    if not count == len(table.around) == len(table.amplitude) or len(set(table.names)) != count:
        raise InputError(
            f"{count} names, {len(table.around)} values around which and {len(table.amplitude)} amplitudes",
            hint="give one of each for every name, and no name twice",
        )
    signals = orthogonal_multisines(
        count, period_s=table.period_s, lowest_hz=table.lowest_hz, highest_hz=table.highest_hz
    )
    points = math.ceil(_POINTS * table.highest_hz * table.period_s)
    if points * table.periods > _MOST_POINTS:
        raise InputError(f"it has more than {_MOST_POINTS} points", hint="choose fewer periods or a lower highest_hz")
    time = frozen_array(np.arange(points * table.periods + 1) * (table.period_s / points))
    return [
        named_drive(name, frozen_array(table.lead_s + time), frozen_array(around + amplitude * signal(time)), Hold.FOH)
        for name, around, amplitude, signal in zip(table.names, table.around, table.amplitude, signals, strict=True)
    ]
