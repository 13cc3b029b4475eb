"""Columns of numbers in a text file: CSV, or anything with a header line and one separator."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

_LINE_END: Final = re.compile(r"\r\n|\n|\r")  # nothing else ends a line for pandas either
_SEPARATORS: Final = (",", ";", "\t")
_MARKS: Final = {codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
_BLANKS: Final = r"\s+"
_NUMBER: Final = re.compile(r"\d")
_SHOWN: Final = 40  # characters of a cell that a message repeats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """The columns of a text file, as it names them and in its own units.

    Attributes:
        path: the file.
        header_line: number of the line with the names, from 1; rows follow it.
        cells: name -> the text of every row, in the order of the file.
        decimal: between whole and broken part of a number.
        thousands: between groups of three digits; empty if nothing is.
        skip_rows: rows after that line which hold no numbers, such as one of units.
    """

    path: Path
    header_line: int
    cells: Mapping[str, tuple[str, ...]]
    decimal: str = "."
    thousands: str = ""
    skip_rows: int = 0

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
        values = pd.to_numeric(self._plain(cells).mask(blank), errors="coerce")
        wrong = np.flatnonzero(values.isna().to_numpy() & ~blank.to_numpy())
        if wrong.size:
            row = int(wrong[0])
            raise InputError(
                f"{self.path}, line {self.header_line + 1 + self.skip_rows + row}, column '{name}': "
                f"'{self.cells[name][row][:_SHOWN]}' is no number",
                hint=self._advice(name, row),
            )
        return frozen_array(values.to_numpy(dtype=np.float64))

    def _plain(self, cells: pd.Series[str]) -> pd.Series[str]:
        """Return cells as Python writes numbers; what breaks the rules for groups and exponents stays as it is."""
        if self.thousands:
            group, point = re.escape(self.thousands), re.escape(self.decimal)
            grouped = cells.str.fullmatch(rf"[+-]?\d{{1,3}}({group}\d{{3}})+({point}\d*)?")
            cells = cells.mask(grouped, cells.str.replace(self.thousands, "", regex=False))
        if self.decimal != ".":
            cells = cells.str.replace(".", "?", regex=False).str.replace(self.decimal, ".", regex=False)
        return cells.str.replace(r"(?<=[\d.])[dD](?=[+-]?\d+$)", "e", regex=True)  # as Fortran writes exponents

    def _advice(self, name: str, row: int) -> str:
        cell = self.cells[name][row].strip()
        if self.decimal == "." and re.fullmatch(r"[+-]?\d+,\d+([eE][+-]?\d+)?", cell):
            return "a number with a decimal comma? decimal = ',' in a map"
        if not self.thousands and re.fullmatch(r"[+-]?\d{1,3}(([,.' ])\d{3})(\2\d{3})*(\D\d*)?", cell):
            return f'digits in groups? thousands = "{re.sub(r"[+-]|[0-9]", "", cell)[0]}" in a map'
        if row == 0 and not self.skip_rows and not any(_NUMBER.search(column[0]) for column in self.cells.values()):
            return "a row of units below the names? skip_rows = 1 in a map"
        return ""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TextFormat:
    """How a file of columns is written.

    Attributes:
        separator: what stands between two cells; empty for the one of comma, semicolon and tab that the line of names
            has most of, or blanks if it has none of them; a blank stands for any number of blanks.
        skip_lines: lines before the line of names.
        skip_rows: rows after it that hold no numbers, such as one of units.
        decimal: between whole and broken part of a number: a point or a comma.
        thousands: between groups of three digits; empty if nothing is.
        encoding: as Python calls it; empty for UTF-8, or what a byte-order mark says.
    """

    separator: str = ""
    skip_lines: int = 0
    skip_rows: int = 0
    decimal: str = "."
    thousands: str = ""
    encoding: str = ""


PLAIN: Final = TextFormat()
"""As most programs write tables."""


def read_text_table(path: Path, layout: TextFormat = PLAIN) -> TextTable:
    """Read a file of columns.

    A line that repeats the names, or the rows after them that hold no numbers, counts as a blank one.

    Args:
        path: text (a byte-order mark is allowed).
        layout: how it is written.

    Raises:
        InputError: the file is missing, is no text, has no rows, names a column twice, or a row has too many cells.
    """
    text = _text(path, layout.encoding)
    skip_lines = layout.skip_lines
    lines = _LINE_END.split(text)[skip_lines:]
    if not lines or not lines[0].strip():
        raise InputError(f"{path}: line {skip_lines + 1} has no names of columns", hint="skip_lines may be wrong")
    import pandas as pd  # noqa: PLC0415 - as above

    between = _separator(lines, layout.separator)
    if between == _BLANKS:
        names = lines[0].split()
        text = "\n".join([*_LINE_END.split(text)[:skip_lines], *(line.strip() for line in lines)])
    else:
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
    # The first row, the names, also says how many cells a row may have.
    head, frame = frame.iloc[: 1 + layout.skip_rows], frame.iloc[1 + layout.skip_rows :].copy()
    for _, again in head.iterrows():  # a logger that was started anew writes them again
        alike = frame[frame[0] == again[0]]
        frame.loc[alike.index[(alike == again).all(axis=1)]] = ""  # lines still count
    used = (frame != "").any(axis=1).to_numpy()
    if not used.any():
        raise InputError(f"{path} has names of columns and no row")
    frame = frame.iloc[: int(np.flatnonzero(used)[-1]) + 1]
    return TextTable(
        path=path,
        header_line=skip_lines + 1,
        cells={name: tuple(frame[k].tolist()) for k, name in enumerate(names) if name},
        decimal=layout.decimal,
        thousands=layout.thousands,
        skip_rows=layout.skip_rows,
    )


def _separator(lines: list[str], asked: str) -> str:
    """Return what stands between two cells, given the line of names and those after it."""
    if asked:
        return _BLANKS if asked == " " else asked
    names, first = lines[0], next((line for line in lines[1:] if line.strip()), "")
    found = max(_SEPARATORS, key=names.count)
    return _BLANKS if found not in names and 1 < len(names.split()) == len(first.split()) else found


def _text(path: Path, encoding: str) -> str:
    try:
        content = path.read_bytes()
        marked = next((name for mark, name in _MARKS.items() if content.startswith(mark)), "utf-8-sig")
        return content.decode(encoding or marked)
    except LookupError:
        raise InputError(f"{path}: no encoding is called '{encoding}'", hint="as in 'latin-1' or 'cp1252'") from None
    except FileNotFoundError:
        near = get_close_matches(path.name, [other.name for other in path.parent.glob("*")], n=1)
        hint = f"did you mean {path.parent / near[0]}?" if near else ""
        raise InputError(f"{path} is not there", hint=hint) from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is no {error.encoding.upper()} text (byte {error.start})", hint='encoding = "latin-1" in a map?'
        ) from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
