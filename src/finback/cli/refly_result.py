"""What a flight flown again looks like on standard output."""

from __future__ import annotations

import sys

from finback.cli.terminal import open_console, print_line
from finback.pipeline import Reflown
from finback.store.codec import to_json


def show_document(found: Reflown) -> None:
    """Print the comparison as JSON."""
    document = {
        "schema": "finback/refly-summary/1",
        "flight": found.record.name,
        "outcome": found.record.outcome.value,
        "stored_outcome": found.outcome,
        "note": found.record.note,
        "same": found.same,
        "compared": list(found.compared),
        "differing": list(found.differing),
        "versions": list(found.versions),
    }
    sys.stdout.write(to_json(document))


def show_lines(found: Reflown) -> None:
    """Print how the flight ended now and then, and whether what is stored of it came back bit by bit."""
    console = open_console()
    ended = found.record.outcome.value
    print_line(console, f"flight   {found.record.name}: {ended}, {found.record.note}")
    print_line(console, f"then     {found.outcome}")
    word = "the same bits" if not found.differing else f"not the same: {', '.join(found.differing)}"
    print_line(console, f"stored   {', '.join(found.compared)}: {word}")
    for version in found.versions:
        print_line(console, f"version  {version}")
