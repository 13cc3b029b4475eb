"""Tables of recorded flights, text or Parquet, with their own names, as DataFrames of numbers."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from finback.channels import CHANNELS
from finback.errors import InputError
from finback.formats.text_table import TextFormat, read_text_table
from finback.units import quantity_of, si_name

if TYPE_CHECKING:
    import pandas as pd


def read_flight_table(path: Path, layout: TextFormat, names: Collection[str]) -> pd.DataFrame:
    """Read columns of a table.

    Args:
        path: ``.parquet``, or text of any other name.
        layout: how the text is written.
        names: the columns that are taken, as the table names them; empty: those that are named as our channels are,
            in any unit.

    Raises:
        InputError: the file cannot be read, or a cell that is taken is no number; a column that is not there is left
            for the reader of the table to miss.
    """
    import pandas as pd  # noqa: PLC0415 - half a second that verbs without tables do not need

    if path.suffix == ".parquet":
        there = _parquet(path)
        return pd.DataFrame({name: there[name] for name in there if _taken(name, names)})
    table = read_text_table(path, layout)
    return pd.DataFrame({name: table.numbers(name) for name in table.cells if _taken(name, names)})


def missing_columns(path: Path, layout: TextFormat, names: Collection[str]) -> tuple[str, ...]:
    """Return which names a table does not have, each with what may have been meant.

    Args:
        path: as for ``read_flight_table``.
        layout: how the text is written.
        names: as the table should name its columns.

    Raises:
        InputError: the file cannot be read.
    """
    there = _names(path, layout)
    faults = []
    for name in names:
        if name not in there:
            near = get_close_matches(name, there, n=1)
            faults.append(f"the table has no column '{name}'{f' (did you mean {near[0]!r}?)' if near else ''}")
    return tuple(faults)


def check_columns(
    path: Path, layout: TextFormat, columns: Mapping[str, str], *, needed: Collection[str], place: str
) -> None:
    """Check that a table has what is taken of it, and that this is all that is needed.

    Args:
        path: as for ``read_flight_table``.
        layout: how the text is written.
        columns: the table's name -> ours with the table's unit; empty: names that are ours already.
        needed: channels that must be there.
        place: where ``columns`` stands, for the message.

    Raises:
        InputError: a column is not there, or lacks a unit; all are named, with what to write.
    """
    there = _names(path, layout)
    faults = list(missing_columns(path, layout, columns))
    ours = columns.values() if columns else [name for name in there if _taken(name, ())]
    given = set()
    for name in ours:
        try:
            given.add(si_name(name))
        except InputError as error:
            faults.append(error.message)
    if not columns:
        bare = {quantity_of(channel): channel for channel in CHANNELS}
        faults += [f"column '{name}' names no unit, such as {bare[name]}" for name in there if name in bare]
    faults += [f"nothing gives {channel}" for channel in needed if channel not in given]
    if not faults:
        return
    wanted = next((channel for channel in needed if channel not in given), "thrust_n")
    raise InputError(
        f"{path}: {'; '.join(faults)}",
        hint=f'the table has {", ".join(there) or "no column of numbers"}; write "its name" = "{wanted}" (any unit) '
        f"into {place}, a line for each column",
    )


def _names(path: Path, layout: TextFormat) -> list[str]:
    return list(_parquet(path) if path.suffix == ".parquet" else read_text_table(path, layout).cells)


def _parquet(path: Path) -> dict[str, np.ndarray]:
    try:
        table = pq.read_table(path)
    except FileNotFoundError:
        raise InputError(f"{path} is not there") from None
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path} is no Parquet file: {error}") from None
    return {
        name: table.column(name).cast(pa.float64()).to_numpy()
        for name in table.column_names
        if pa.types.is_floating(table.schema.field(name).type) or pa.types.is_integer(table.schema.field(name).type)
    }


def _taken(name: str, names: Collection[str]) -> bool:
    if names:
        return name in names
    try:
        return si_name(name) in CHANNELS
    except InputError:
        return False
