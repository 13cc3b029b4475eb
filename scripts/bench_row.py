"""What a benchmark of flights measured: a line, and whether a limit holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

_WIDTH: Final = 64  # characters of a row's name


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of the result: what was measured, and whether a limit holds."""

    what: str
    value: float
    unit: str
    limit: str = ""
    holds: bool = True


def show(rows: list[Row]) -> list[Row]:
    """Print what was measured, and return it."""
    for row in rows:
        verdict = "" if not row.limit else f"  {row.limit}: {'holds' if row.holds else 'MISSED'}"
        print(f"{row.what:<{_WIDTH}}  {row.value:9.3f} {row.unit}{verdict}", flush=True)
    return rows
