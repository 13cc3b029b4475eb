"""Standard output for people: lines that can be copied, tables that become lists where there is no room."""

from __future__ import annotations

import sys
from typing import Final, NoReturn, final

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

_WIDTH: Final = 140  # where stdout is no terminal
_NARROW: Final = 60  # below this a table is a list
_SENTENCE: Final = 20  # characters: longer cells may be broken between their words
_BETWEEN: Final = 3  # characters from one column to the next


@final
class _Output(Console):
    """Standard output; if nobody reads it, ``exits`` decides the exit code, not rich (its 1 is a verdict here)."""

    def on_broken_pipe(self) -> NoReturn:
        raise  # noqa: PLE0704 - rich calls this while it handles the BrokenPipeError


def open_console() -> Console:
    """Return the console of standard output."""
    return _Output(file=sys.stdout, highlight=False, width=None if sys.stdout.isatty() else _WIDTH)


def print_line(console: Console, text: str) -> None:
    """Print a line as it is: never wrapped, so that paths and commands can be copied."""
    console.print(text, markup=False, soft_wrap=True)


def print_table(console: Console, table: Table) -> None:
    """Print a table; on a terminal too narrow for its columns, row by row: a title, then a line for each cell."""
    if console.width >= max(_NARROW, _least_width(table)):
        console.print(table)
        return
    names = [column.header for column in table.columns]
    console.print(f"\n{names[0]}", style="bold")
    for title, *cells in zip(*(column.cells for column in table.columns), strict=True):
        console.print(title)
        for name, cell in zip(names[1:], cells, strict=True):
            if cell:
                console.print(f"  {name}  {cell}", soft_wrap=True)
    console.print()


def _least_width(table: Table) -> int:
    """Return the width at which no word of a head is cut, and no cell but a sentence goes over two lines."""
    widths = []
    for column in table.columns:
        parts = [len(word) for word in Text.from_markup(str(column.header)).plain.split()]
        for cell in column.cells:
            text = Text.from_markup(str(cell)).plain
            parts += [len(text)] if len(text) <= _SENTENCE else [len(word) for word in text.split()]
        widths.append(max(parts, default=0))
    return sum(widths) + _BETWEEN * len(widths)


def new_table(*columns: str) -> Table:
    """Return an empty table with these columns."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in columns:
        table.add_column(escape(name), overflow="fold")
    return table
