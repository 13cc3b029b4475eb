"""Maps of a reference trajectory: which column is which channel, in which unit, within what tolerance (TOML)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from finback.channels import CIRCULAR
from finback.errors import InputError
from finback.study.checked import read_checked
from finback.study.faults import explain
from finback.study.layout import LayoutTable
from finback.units import si_unit, to_si, unit_named, unit_of
from finback.validation.compare import PURE, Bound, ChannelMap, MappedChannel, Measure, Resampling

_SCHEMA: Final = 1

NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Name = Annotated[str, Field(min_length=1)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


def _known_unit(unit: str) -> str:
    """Return the suffix of a unit that may be written in other ways."""
    try:
        return unit_named(unit)
    except InputError as error:
        raise ValueError(f"{error.message}; {error.hint}") from None


class _TimeTable(_Table):
    reference: Name = "time_s"
    unit: str = "s"
    offset_s: Finite = 0.0
    window_s: Annotated[list[Finite], Field(min_length=2, max_length=2)] | None = None

    @field_validator("unit")
    @classmethod
    def _of_time(cls, unit: str) -> str:
        known = _known_unit(unit)
        if si_unit(known) != "s":
            raise ValueError("must be a unit of time")
        return known

    @field_validator("window_s")
    @classmethod
    def _in_order(cls, window: list[float] | None) -> list[float] | None:
        if window is not None and window[0] >= window[1]:
            raise ValueError("the first time must come first and be smaller")
        return window


class _ToleranceTable(_Table):
    worst: NotNegative | None = None
    relative: NotNegative | None = None
    rmse: NotNegative | None = None
    theil: NotNegative | None = None
    source: Name

    @model_validator(mode="after")
    def _something(self) -> _ToleranceTable:
        if self.worst is self.relative is self.rmse is self.theil is None:
            raise ValueError("bounds nothing; give 'worst' or 'rmse' (in the channel's unit), 'relative' or 'theil'")
        return self


class _ChannelTable(_Table):
    name: Name
    reference: Name
    unit: str
    factor: Finite = 1.0
    offset: Finite = 0.0
    angular: bool | None = None
    resampling: str = Resampling.CUBIC.value
    tolerance: _ToleranceTable | None = None

    @field_validator("name")
    @classmethod
    def _named_with_unit(cls, name: str) -> str:
        try:
            unit = unit_of(name)
        except InputError as error:
            raise ValueError(f"{error.message}; {error.hint}") from None
        if si_unit(unit) != unit:
            raise ValueError(f"is ours, and ours are in SI: it ends in '{si_unit(unit)}', not in '{unit}'")
        return name

    @field_validator("unit")
    @classmethod
    def _unit(cls, unit: str) -> str:
        return _known_unit(unit)

    @field_validator("resampling")
    @classmethod
    def _resampling(cls, word: str) -> str:
        if word not in set(Resampling):
            raise ValueError(f"must be one of: {', '.join(Resampling)}")
        return word

    @field_validator("factor")
    @classmethod
    def _not_zero(cls, factor: float) -> float:
        if factor == 0.0:
            raise ValueError("must not be 0")
        return factor

    @model_validator(mode="after")
    def _one_dimension(self) -> _ChannelTable:
        if si_unit(self.unit) != unit_of(self.name):
            raise ValueError(f"'{self.unit}' does not measure what '{self.name}' is in")
        if self.angular and self.tolerance is not None and self.tolerance.relative is not None:
            raise ValueError("an angle that comes round has no size for a difference to be relative to")
        if self.angular and si_unit(self.unit) != "rad":
            raise ValueError(f"'{self.unit}' is no unit of an angle, and only angles are angular")
        return self


class _MapTable(LayoutTable):
    schema_: Annotated[int, Field(alias="schema")]
    flight: str = ""
    time: _TimeTable = _TimeTable()
    channel: Annotated[list[_ChannelTable], Field(min_length=1)]

    @field_validator("schema_")
    @classmethod
    def _version(cls, version: int) -> int:
        if version != _SCHEMA:
            raise ValueError(f"must be {_SCHEMA}")
        return version


def read_channel_map(path: Path) -> ChannelMap:
    """Read a map of a reference trajectory (docs/compare.md).

    Raises:
        FaultyFileError: with every fault of the file.
    """
    tables: dict[str, type[BaseModel]] = {"time": _TimeTable, "channel": _ChannelTable, "tolerance": _ToleranceTable}
    read = read_checked(path, _MapTable, tables, _said)
    return ChannelMap(
        flight=read.flight,
        time=read.time.reference,
        time_unit=read.time.unit,
        time_offset_s=read.time.offset_s,
        layout=read.text_format,
        window_s=(-math.inf, math.inf)
        if read.time.window_s is None
        else (read.time.window_s[0], read.time.window_s[1]),
        channels=tuple(_channel(channel) for channel in read.channel),
    )


def _said(fault: Mapping[str, Any], keys: list[str]) -> str:
    said = explain(fault, keys)
    if isinstance(fault.get("input"), dict):  # of a rule over a whole table: repeating the table says nothing
        return said.partition(", got {")[0]
    return said


def _channel(table: _ChannelTable) -> MappedChannel:
    said = table.tolerance
    bounds = []
    if said is not None:
        for measure, value in (
            (Measure.WORST, said.worst),
            (Measure.RELATIVE, said.relative),
            (Measure.RMSE, said.rmse),
            (Measure.THEIL, said.theil),
        ):
            if value is not None:
                inside = value if measure in PURE else to_si(value, table.unit)
                bounds.append(Bound(measure=measure, value=inside, source=said.source))
    return MappedChannel(
        name=table.name,
        reference=table.reference,
        unit=table.unit,
        factor=table.factor,
        offset=table.offset,
        angular=table.name in CIRCULAR if table.angular is None else table.angular,
        resampling=Resampling(table.resampling),
        bounds=tuple(bounds),
    )
