"""How the terms of a model were found, for a person and for a program."""

from __future__ import annotations

from typing import Any

from finback.cli import terminal
from finback.cli.numbers import plain
from finback.identification.gate import HALF
from finback.identification.identify import Identification
from finback.store.codec import to_tree


def show_selection(identification: Identification) -> None:
    """Print the orthogonal functions in their order, chosen ones first, with the errors predicted after each."""
    for selection in identification.selection:
        console = terminal.open_console()
        frequency = {
            label: item.frequency
            for label, item in zip(selection.options.library.labels(), selection.candidates, strict=True)
        }
        chosen = set(selection.form.labels())
        table = terminal.new_table("term", "predicted error", "PRESS", "kept-out flights", "chosen in resamples")
        for step in selection.path:
            table.add_row(
                step.term if step.term in chosen else f"({step.term})",
                plain(step.predicted_squared_error),
                plain(step.press),
                plain(step.prediction) if selection.options.prediction else "",
                f"{frequency[step.term]:.0%}" if selection.options.bootstraps else "",
            )
        terminal.print_table(console, table)
        sizes, orders = selection.form.sizes, selection.orders
        terminal.print_line(
            console,
            f"selected {sizes[0]} + {sizes[1]} of {selection.options.library.size} terms; highest powers of alpha "
            f"{orders[0]} and {orders[1]}; errors in noise variances; terms in parentheses are not in the model",
        )
        judged = selection.collinearity
        tied = [
            label for label, share in zip(judged.labels, judged.proportions[0].tolist(), strict=True) if share > HALF
        ]
        terminal.print_line(
            console,
            f"largest condition index {plain(float(judged.condition_indices[0]))}, which takes more than half of the "
            f"variance of: {', '.join(tied) or 'none'}",
        )


def of_selection(identification: Identification) -> dict[str, Any]:
    """Return the selection for ``--json``; nothing if there was none."""
    found = [to_tree(selection) for selection in identification.selection]
    return {"selection": found} if found else {}
