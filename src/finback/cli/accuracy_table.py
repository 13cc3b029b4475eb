"""How well the step resolves a study, as a table on stdout."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape

from finback.cli.terminal import new_table, print_line, print_table
from finback.flight.accuracy import FlightAccuracy, SweepAccuracy
from finback.flight.reference import Reference


def print_accuracy(console: Console, found: Sequence[SweepAccuracy]) -> None:
    """Print the error of every flight that was flown again, by both roads, and what must be said of them."""
    flights = [(accuracy, flight) for accuracy in found for flight in accuracy.flights]
    if flights:
        several = len(found) > 1
        table = new_table(
            "flown again", "error of alpha [rad]: half step", "DOP853", "1e-9 rad grows", "step is", "passes corners of"
        )
        for accuracy, flight in flights:
            name = f"{accuracy.fidelity} {flight.flight}" if several else flight.flight
            table.add_row(escape(name), *_cells(flight))
        print_table(console, table)
    for accuracy in found:
        print_line(console, f"step     {accuracy.step_s:.6g} s, {accuracy.fidelity}; flown again: {accuracy.sample}")
        for remark in accuracy.remarks:
            print_line(console, f"step     {remark}")


def _cells(flight: FlightAccuracy) -> tuple[str, ...]:
    beside, corners = "none", "unknown"
    if isinstance(flight.reference, Reference):
        beside = f"{flight.reference.alpha_error_rad:.1e}"
        corners = ", ".join(f"{name} {count}x" for name, count in flight.reference.corners.items()) or "no table"
    judged = "sensitive" if flight.sensitive else "enough" if flight.resolved else "too long"
    return f"{flight.alpha_error_rad:.1e}", beside, f"{flight.growth:.1e}x", judged, escape(corners)
