"""Schedules of a case in a file (TOML): what is moved, when, and how it is held."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from finback.errors import FaultyFileError, InputError
from finback.flight.case_drive import Drive, named_drive
from finback.records import Hold
from finback.study.checked import read_checked

_SCHEMA: Final = 1

Finite = Annotated[float, Field(allow_inf_nan=False)]


class _ScheduleTable(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    name: Annotated[str, Field(min_length=1)]
    hold: Annotated[str, Field(pattern="^(foh|zoh)$")] = Hold.FOH.value
    time_s: Annotated[list[Finite], Field(min_length=1)]
    value: Annotated[list[Finite], Field(min_length=1)]


class _SchedulesTable(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    schema_: Annotated[int, Field(alias="schema", ge=_SCHEMA, le=_SCHEMA)]
    schedule: Annotated[list[_ScheduleTable], Field(min_length=1)]


def read_schedules(path: Path) -> tuple[Drive, ...]:
    """Read the schedules of a case (docs/fly.md).

    Raises:
        FaultyFileError: with every fault of the file.
    """
    read = read_checked(path, _SchedulesTable, {"schedule": _ScheduleTable})
    faults: list[str] = []
    drives: list[Drive] = []
    for number, one in enumerate(read.schedule):
        try:
            drives.append(named_drive(one.name, np.array(one.time_s), np.array(one.value), Hold(one.hold)))
        except InputError as error:
            faults.append(f"schedule[{number}]: {error.message}{f'; {error.hint}' if error.hint else ''}")
    if faults:
        raise FaultyFileError(str(path), tuple(faults))
    return tuple(drives)
