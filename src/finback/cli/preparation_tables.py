"""What was done to recorded flights, on stdout."""

from __future__ import annotations

import shlex
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
    """Print, flight by flight, what was changed and what was found, and the faults of the instruments as tables."""
    console = terminal.open_console()
    checked: tuple[Compatibility, ...] = ()
    for record, item in zip(found.sweep.records, found.preparations, strict=True):
        terminal.print_line(console, f"{record.name}: {len(record)} rows, {record.duration_s:.6g} s")
        for line in item.statements:
            terminal.print_line(console, f"  changed  {line}")
        for line in item.findings:
            terminal.print_line(console, f"  found    {line}")
        if not item.statements:
            terminal.print_line(console, "  changed  nothing")
        if item.compatibility and item.compatibility != checked:  # flights that were checked together share it
            checked = item.compatibility
            _show_errors(checked[0])
    terminal.print_line(console, f"identify finback identify {shlex.quote(str(found.folder))}")
    terminal.print_line(console, f"run      {found.folder}")


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
            }
            for check in item.compatibility
            for sum_ in check.combinations
        ],
    }
