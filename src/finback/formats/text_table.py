"""Columns of numbers in a text file: CSV, or anything with a header line and one separator."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from types import MappingProxyType
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError

_LINE_END: Final = re.compile(r"\r\n|\n|\r")  # nothing else ends a line for pandas either
_SEPARATORS: Final = (",", ";", "\t")
_SHOWN: Final = 40  # characters of a cell that a message repeats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """The columns of a text file, as it names them and in its own units.

    Attributes:
        path: the file.
        header_line: number of the line with the names, from 1; rows follow it.
        cells: name -> the text of every row, in the order of the file.
    """

    path: Path
    header_line: int
    cells: Mapping[str, tuple[str, ...]]

    def __post_init__(self) -> None:
        """Freeze the columns."""
        object.__setattr__(self, "cells", MappingProxyType(dict(self.cells)))

    def numbers(self, name: str) -> FloatArray:
        """Return a column as float64, shape (n,); an empty cell, ``nan`` or ``NA`` is NaN.

        Raises:
            InputError: there is no such column, or one of its cells is no number (line and text are named).
        """
        if name not in self.cells:
            near = get_close_matches(name, self.cells, n=3, cutoff=0.5)
            known = f"did you mean {' or '.join(near)}?" if near else f"it has: {', '.join(self.cells)}"
            raise InputError(f"{self.path} has no column '{name}'", hint=known)
        import pandas as pd  # noqa: PLC0415 - half a second, which whoever reads no table need not pay

        cells = pd.Series(self.cells[name], dtype=object).str.strip()
        blank = cells.str.lower().isin(("", "nan", "na", "n/a"))
        values = pd.to_numeric(cells.mask(blank), errors="coerce")
        wrong = np.flatnonzero(values.isna().to_numpy() & ~blank.to_numpy())
        if wrong.size:
            row = int(wrong[0])
            raise InputError(
                f"{self.path}, line {self.header_line + 1 + row}, column '{name}': "
                f"'{self.cells[name][row][:_SHOWN]}' is no number"
            )
        return frozen_array(values.to_numpy(dtype=np.float64))


def read_text_table(path: Path, *, separator: str = "", skip_lines: int = 0) -> TextTable:
    """Read a file of columns.

    Args:
        path: UTF-8 text (a byte-order mark is allowed).
        separator: what stands between two cells; empty for the one of comma, semicolon and tab that the line of names
            has most of.
        skip_lines: lines before the line of names.

    Raises:
        InputError: the file is missing, is no text, has no rows, names a column twice, or a row has too many cells.
    """
    text = _text(path)
    lines = _LINE_END.split(text)[skip_lines:]
    if not lines or not lines[0].strip():
        raise InputError(f"{path}: line {skip_lines + 1} has no names of columns", hint="skip_lines may be wrong")
    import pandas as pd  # noqa: PLC0415 - as above

    between = separator or max(_SEPARATORS, key=lines[0].count)
    try:
        names = [name.strip() for name in next(csv.reader([lines[0]], delimiter=between))]
    except csv.Error as error:
        raise InputError(f"{path}: line {skip_lines + 1} cannot be read as names of columns: {error}") from None
    twice = sorted({name for name in names if name and names.count(name) > 1})
    if twice:
        raise InputError(f"{path} names a column twice: {', '.join(twice)}")
    try:
        frame = pd.read_csv(
            io.StringIO(text),
            sep=between,
            skiprows=skip_lines,
            header=None,
            dtype=str,
            keep_default_na=False,
            skip_blank_lines=False,
            on_bad_lines="error",
        ).fillna("")
    except pd.errors.ParserError as error:
        raise InputError(f"{path}: {str(error).removeprefix('Error tokenizing data. C error: ')}") from None
    frame = frame.iloc[1:]  # the first row is the names: it also says how many cells a row may have
    used = (frame != "").any(axis=1).to_numpy()
    if not used.any():
        raise InputError(f"{path} has names of columns and no row")
    frame = frame.iloc[: int(np.flatnonzero(used)[-1]) + 1]
    return TextTable(
        path=path,
        header_line=skip_lines + 1,
        cells={name: tuple(frame[k].tolist()) for k, name in enumerate(names) if name},
    )


def _text(path: Path) -> str:
    try:
        return path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        near = get_close_matches(path.name, [other.name for other in path.parent.glob("*")], n=1)
        hint = f"did you mean {path.parent / near[0]}?" if near else ""
        raise InputError(f"{path} is not there", hint=hint) from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is no UTF-8 text (byte {error.start})") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
