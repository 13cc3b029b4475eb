"""Where tabulated aerodynamics have corners: the breakpoints of their tables, and how often a motion passes them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.flight.xml_text import name_of

_ROW: Final = "row"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TableAxis:
    """A property that tables are looked up by.

    Attributes:
        name: of the property.
        breakpoints: of all its tables, in JSBSim's unit, increasing, shape (n,); between two of them every table is
            smooth in it, at them it has a corner or at most none.
    """

    name: str
    breakpoints: FloatArray

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "breakpoints", frozen_array(self.breakpoints))

    def passed(self, values: FloatArray) -> int:
        """Return how many breakpoints lie between successive values, shape (n,)."""
        cells = np.searchsorted(self.breakpoints, values)
        return int(np.abs(np.diff(cells)).sum())


def table_axes(element: ET.Element) -> tuple[TableAxis, ...]:
    """Return what the tables below an element are looked up by, by name.

    A table that JSBSim could not read is no business of this function; it gives no breakpoints.
    """
    found: dict[str, set[float]] = {}
    for table in element.iter("table"):
        axes = {part.get("lookup", _ROW): name_of(part) for part in table.findall("independentVar")}
        for lookup, points in _breakpoints(table, dimensions=len(axes)).items():
            if lookup in axes:
                found.setdefault(axes[lookup], set()).update(points)
    return tuple(
        TableAxis(name=name, breakpoints=np.array(sorted(points))) for name, points in sorted(found.items()) if points
    )


def _breakpoints(table: ET.Element, *, dimensions: int) -> dict[str, list[float]]:
    """Return the breakpoints of a table by the word of their independent variable: row, column, table."""
    found: dict[str, list[float]] = {}
    for data in table.findall("tableData"):
        rows = [numbers for line in (data.text or "").splitlines() if (numbers := _numbers(line.split()))]
        if dimensions > 1 and rows:
            found.setdefault("column", []).extend(rows[0])
            rows = rows[1:]
        found.setdefault(_ROW, []).extend(row[0] for row in rows)
        if "breakPoint" in data.attrib:
            found.setdefault("table", []).extend(_numbers([data.attrib["breakPoint"]]))
    return found


def _numbers(words: Iterable[str]) -> list[float]:
    try:
        return [float(word) for word in words]
    except ValueError:
        return []
