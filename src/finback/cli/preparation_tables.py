"""What was done to recorded flights, on stdout."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import Any

from rich.markup import escape

from finback.cli import terminal
from finback.cli.numbers import display_unit, measured, shown, written
from finback.dynamics.lienard import NORMAL_95
from finback.identification.compatibility.check import Compatibility
from finback.identification.compatibility.judgement import InstrumentError, Knowledge
from finback.identification.preparation import Preparation
from finback.pipeline.prepare import Prepared


def show(found: Prepared) -> None:
    """Print, flight by flight, what was changed and what was found, and the faults of the instruments as tables.

    What holds for all flights is said once, after them.
    """
    console = terminal.open_console()
    shared = [_common([item.statements for item in found.preparations]),
              _common([item.findings for item in found.preparations])]  # fmt: skip
    checks = [item.compatibility for item in found.preparations]
    same = len(checks) > 1 and all(check == checks[0] for check in checks)
    for record, item in zip(found.sweep.records, found.preparations, strict=True):
        terminal.print_line(console, f"{record.name}: {len(record)} rows, {record.duration_s:.6g} s")
        _print_lines(
            [line for line in item.statements if line not in shared[0]],
            [line for line in item.findings if line not in shared[1]],
        )
        if not item.statements:
            terminal.print_line(console, "  changed  nothing")
        if item.compatibility and not same:
            _show_errors(item.compatibility[0])
    if any(shared):
        terminal.print_line(console, f"all {len(checks)} flights")
        _print_lines(*shared)
    if same and checks[0]:  # flights that were checked together share it
        _show_errors(checks[0][0])
    terminal.print_line(console, f"identify finback identify {shlex.quote(str(found.folder))}")
    terminal.print_line(console, f"run      {found.folder}")


def _common(lines: Sequence[tuple[str, ...]]) -> list[str]:
    """Return what is said of every one of several flights, in order."""
    if len(lines) < 2:
        return []
    return [line for line in lines[0] if all(line in others for others in lines[1:])]


def _print_lines(changed: Sequence[str], seen: Sequence[str]) -> None:
    console = terminal.open_console()
    for line in changed:
        terminal.print_line(console, f"  changed  {line}")
    for line in seen:
        terminal.print_line(console, f"  found    {line}")


def _show_errors(found: Compatibility) -> None:
    console = terminal.open_console()
    table = terminal.new_table("instrument", "unit", "fault ± 95 %", "")
    for error in found.errors:
        if error.knowledge is Knowledge.DETERMINED:
            table.add_row(error.name, *_cells(error), "[bold]significant[/]" if error.significant else "")
        else:
            table.add_row(error.name, "", "–", escape(error.knowledge.value), style="dim")
    terminal.print_table(console, table)


def _cells(error: InstrumentError) -> tuple[str, str]:
    half = NORMAL_95 * error.standard_error
    value = measured(shown(error.value, error.unit), shown(half, error.unit))
    return written(display_unit(error.unit)), value


def document(found: Prepared) -> dict[str, Any]:
    """Return everything as JSON in SI."""
    return {
        "schema": "finback/preparation/1",
        "run": str(found.folder),
        "flights": [
            _flight(record.name, item) for record, item in zip(found.sweep.records, found.preparations, strict=True)
        ],
    }


def _flight(name: str, item: Preparation) -> dict[str, Any]:
    return {
        "name": name,
        "rows": len(item.record),
        "changed": list(item.statements),
        "found": list(item.findings),
        "instruments": [
            {
                "name": error.name,
                "unit": error.unit,
                "knowledge": error.knowledge.value,
                **({"value": error.value, "standard_error": error.standard_error} if error.known else {}),
                "significant": error.significant,
            }
            for check in item.compatibility
            for error in check.errors
        ],
        "together": [
            {
                "names": list(sum_.names),
                "weights": list(sum_.weights),
                "unit": sum_.unit,
                "value": sum_.value,
                "standard_error": sum_.standard_error,
                "significant": sum_.significant,
            }
            for check in item.compatibility
            for sum_ in check.combinations
        ],
        "correlated": [
            {"names": [one, other], "correlation": correlation}
            for check in item.compatibility
            for one, other, correlation in check.correlated
        ],
    }
