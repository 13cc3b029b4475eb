"""How numbers of a campaign vary, as a study says it.

Wherever a maneuver takes a number, a campaign takes a number, a list (a grid), or a table that says how to draw it:
``{ uniform = [low, high] }``, ``{ normal = [mean, deviation], limits = [low, high] }``, ``{ choice = [...] }``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from pydantic import ValidationError

from finback.errors import FinbackError, InputError
from finback.flight.campaign.spread import Choice, Fixed, Grid, Normal, Spread, Uniform, extremes
from finback.study.faults import explain, nearest, show
from finback.study.reading import Reader
from finback.study.tables import Table
from finback.units import si_name, to_si, unit_of

_DRAWN: Final = ("uniform", "normal", "choice")


def read_spreads(reader: Reader, table: Mapping[str, object], place: str) -> dict[str, Spread]:
    """Return how the numbers of a table vary, in the units of the file; those with faults are missing."""
    found = {key: _spread(reader, value, f"{place}.{key}") for key, value in table.items()}
    return {key: spread for key, spread in found.items() if spread is not None}


def in_range(
    reader: Reader, spreads: Mapping[str, Spread], form: type[Table], place: str, *, faulty: tuple[str, ...]
) -> bool:
    """Return whether all that may be flown is of the form of its table; every number that is not is told.

    Args:
        reader: of the whole file.
        spreads: in the units of the file.
        form: of the table, where each number is a list.
        place: of the table.
        faulty: keys that are there, but whose faults were told.
    """
    try:
        form.model_validate({key: list(extremes(spread)) for key, spread in spreads.items()})
    except ValidationError as error:
        faults: list[dict[str, Any]] = [dict(fault) for fault in error.errors()]
        told = [fault for fault in faults if fault["type"] != "missing" or fault["loc"][0] not in faulty]
        for fault in told:
            key = str(fault["loc"][0])
            reader.fault(f"{place}.{key}", _explained(fault, [*form.model_fields], spreads.get(key)))
        return not told
    return True


def way_out(spread: Spread) -> str:
    """Return the end of a message about a number out of range, where there is a general way out."""
    if isinstance(spread, Normal) and not (math.isfinite(spread.low) and math.isfinite(spread.high)):
        return "; cut it with limits = [low, high]"
    return ""


def name_in_si(key: str) -> str:
    """Return the key with its unit in SI; a ratio has none."""
    try:
        return si_name(key)
    except FinbackError:
        return key


def spread_in_si(spread: Spread, key: str) -> Spread:
    """Return a spread of the file in SI; every unit of the file is a factor, so that all its numbers scale alike."""
    try:
        unit = unit_of(key)
    except FinbackError:
        return spread
    match spread:
        case Fixed(value=value):
            return Fixed(value=to_si(value, unit))
        case Grid(values=values):
            return Grid(values=tuple(to_si(value, unit) for value in values))
        case Choice(values=values):
            return Choice(values=tuple(to_si(value, unit) for value in values))
        case Uniform(low=low, high=high):
            return Uniform(low=to_si(low, unit), high=to_si(high, unit))
        case Normal(mean=mean, standard_deviation=deviation, low=low, high=high):
            return Normal(
                mean=to_si(mean, unit),
                standard_deviation=to_si(deviation, unit),
                low=to_si(low, unit),
                high=to_si(high, unit),
            )


def _explained(fault: Mapping[str, Any], keys: list[str], spread: Spread | None) -> str:
    rule = explain(fault, keys)
    if spread is None or isinstance(spread, Fixed | Grid) or not isinstance(fault["input"], float):
        return rule
    return f"{rule.rpartition(', got ')[0]}, may be drawn as {fault['input']:.6g}{way_out(spread)}"


def _spread(reader: Reader, value: object, place: str) -> Spread | None:
    if isinstance(value, dict):
        kinds = [key for key in value if key in _DRAWN]
        unknown = [key for key in value if key not in (*_DRAWN, "limits")]
        if unknown:
            reader.fault(f"{place}.{unknown[0]}", f"unknown key{nearest(unknown[0], [*_DRAWN, 'limits'])}")
            return None
        if len(kinds) != 1 or ("limits" in value and kinds != ["normal"]):
            reader.fault(place, "must have one of: uniform, normal (with limits, if any), choice")
            return None
        numbers = _numbers(reader, value[kinds[0]], f"{place}.{kinds[0]}")
        limits = _numbers(reader, value.get("limits", []), f"{place}.limits")
        if numbers is None or limits is None:
            return None
        return reader.make(place, partial(_drawn, kinds[0], numbers, limits))
    numbers = _numbers(reader, value if isinstance(value, list) else [value], place)
    if numbers is None:
        return None
    return reader.make(place, lambda: Grid(values=numbers) if isinstance(value, list) else Fixed(value=numbers[0]))


def _numbers(reader: Reader, value: object, place: str) -> tuple[float, ...] | None:
    if not isinstance(value, list):
        reader.fault(place, f"must be a list of numbers, got {show(value)}")
        return None
    for item in value:
        if isinstance(item, bool) or not isinstance(item, (int, float)):
            reader.fault(place, f"must be a number, got {show(item)}")
            return None
    return tuple(float(item) for item in value)


def _drawn(kind: str, numbers: tuple[float, ...], limits: tuple[float, ...]) -> Spread:
    """Build what is drawn, in the units of the file.

    Raises:
        InputError: the numbers are not as many as it needs, or out of order.
    """
    if kind == "choice":
        return Choice(values=numbers)
    pair = "[low, high]" if kind == "uniform" else "[mean, standard deviation]"
    if len(numbers) != 2 or len(limits) not in (0, 2):
        raise InputError(f"{kind}: needs {pair}, and limits, if any, [low, high]")
    if kind == "uniform":
        return Uniform(low=numbers[0], high=numbers[1])
    cut = {"low": limits[0], "high": limits[1]} if limits else {}
    return Normal(mean=numbers[0], standard_deviation=numbers[1], **cut)
