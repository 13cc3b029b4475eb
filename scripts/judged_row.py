"""Rows of a table of requirements, and the place of such a table in a document."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One requirement, kept where ``low <= measured <= high``."""

    what: str
    measured: float
    low: float
    high: float

    @property
    def kept(self) -> bool:
        """Tell whether the requirement is kept; a number that is none keeps nothing."""
        return self.low <= self.measured <= self.high

    @property
    def required(self) -> str:
        """Say what is required."""
        if math.isinf(self.low):
            return f"≤ {self.high:g}"
        return f"≥ {self.low:g}" if math.isinf(self.high) else f"{self.low:g} to {self.high:g}"


def most(what: str, measured: float, limit: float) -> Row:
    """Return a requirement with a largest value."""
    return Row(what=what, measured=measured, low=-math.inf, high=limit)


def least(what: str, measured: float, limit: float) -> Row:
    """Return a requirement with a least value."""
    return Row(what=what, measured=measured, low=limit, high=math.inf)


def between(what: str, measured: float, limits: tuple[float, float]) -> Row:
    """Return a requirement with both."""
    return Row(what=what, measured=measured, low=limits[0], high=limits[1])


def table(rows: Sequence[Row]) -> str:
    """Write the rows as a table in Markdown."""
    cells = [("", "required", "measured", "")]
    cells += [(row.what, row.required, f"{row.measured:#.3g}", "kept" if row.kept else "**missed**") for row in rows]
    widths = [max(len(line[k]) for line in cells) for k in range(4)]
    lines = [f"| {' | '.join(cell.ljust(width) for cell, width in zip(line, widths, strict=True))} |" for line in cells]
    return "\n".join([lines[0], "|---|--:|--:|---|", *lines[1:]])


def page(document: Path, name: str, text: str) -> None:
    """Put text between the two marks ``<!-- NAME -->`` and ``<!-- end of NAME -->`` of a document."""
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    before = document.read_text(encoding="utf-8")
    marked = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", flags=re.DOTALL)
    if len(marked.findall(before)) != 1:
        raise SystemExit(f"{document} has no place marked {begin} and {end}")
    document.write_text(marked.sub(lambda _: f"{begin}\n{text.strip()}\n{end}", before), encoding="utf-8")
