"""A Parquet file written as its rows come, in row groups that memory and readers bear.

Numbers are split by their bytes and compressed, nothing is looked up in dictionaries: numbers that vary have no equals,
and so there is a limit to what the file may take (``largest_file_bytes``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, final

import pyarrow as pa
import pyarrow.parquet as pq

GROUP_CELLS: Final = 1 << 19
"""A row group ends with the table that fills it so far: 4 MB of numbers."""

# Measured: 8 bytes a number, a bit whether it is there, three bits for its place in a list, 80 bytes for a page of up
# to 20000 rows or 1 MB, 310 for a column of a row group and in the footer together. zstd adds 1/256 to noise at most.
_CELL: Final = 9.0
_COLUMN: Final = 1024  # in the schema
_COLUMN_OF_GROUP: Final = 1024
_FILE: Final = 4096
_STATISTICS: Final = 4  # copies of a text, the smallest and the largest, in the footer and before a page


@final
class RowGroups:
    """Takes tables of one schema; the file is begun with the first one that has rows.

    Args:
        path: where it is written.
        shown: the name that errors give it.
    """

    def __init__(self, path: Path, *, shown: Path) -> None:
        self._path = path
        self._shown = shown
        self._writer: tuple[pq.ParquetWriter, ...] = ()
        self._waiting: list[pa.Table] = []
        self._cells = 0

    def add(self, table: pa.Table) -> None:
        """Add rows.

        Raises:
            OSError: they cannot be written.
        """
        if not table.num_rows:
            return
        self._waiting.append(table)
        self._cells += sum(_cells(column) for column in table.columns)
        if self._cells >= GROUP_CELLS:
            self._flush()

    def finish(self, facts: Mapping[str, str]) -> bool:
        """Complete the file, with facts beside its numbers; return whether there is one.

        Raises:
            OSError: it cannot be written.
        """
        self._flush()
        with self._naming():
            for writer in self._writer:
                writer.add_key_value_metadata(facts)
                writer.close()
        return bool(self._writer)

    def abandon(self) -> None:
        """Let go of the file."""
        for writer in self._writer:
            with suppress(OSError):  # it would complete a file that nobody wants, on a disk that may be full
                writer.close()

    def _flush(self) -> None:
        if not self._waiting:
            return
        table = pa.concat_tables(self._waiting).combine_chunks()
        self._waiting, self._cells = [], 0
        with self._naming():
            if not self._writer:
                self._writer = (_writer(self._path, table.schema),)
            self._writer[0].write_table(table, row_group_size=table.num_rows)

    @contextmanager
    def _naming(self) -> Iterator[None]:
        """Tell which file an error is about: a full disk does not say."""
        try:
            yield
        except OSError as error:
            if error.errno is not None and error.filename in {None, str(self._path)}:
                error.filename, error.filename2 = str(self._shown), None
            raise


def largest_file_bytes(*, rows: int, numbers: float, texts: tuple[int, ...], columns: int) -> float:
    """Return what a file may take at most, whatever its numbers are.

    Args:
        rows: how many, at most.
        numbers: how many of a row, those in lists included, at most.
        texts: the largest size of each text of a row, in bytes.
        columns: how many.
    """
    groups = 1 + rows * (numbers + len(texts)) / GROUP_CELLS
    of_group = columns * _COLUMN_OF_GROUP + _STATISTICS * sum(texts)
    of_row = _CELL * (numbers + len(texts)) + sum(texts) * 257 / 256
    return _FILE + columns * _COLUMN + groups * of_group + rows * of_row


def _cells(column: pa.ChunkedArray) -> int:
    """Return how many values a column has; those in lists count."""
    if pa.types.is_list(column.type):
        return sum(len(chunk.values) for chunk in column.chunks)
    return len(column)


def _writer(path: Path, schema: pa.Schema) -> pq.ParquetWriter:
    numbers = [_leaf(field) for field in schema if pa.types.is_floating(_value_type(field.type))]
    return pq.ParquetWriter(path, schema, compression="zstd", use_dictionary=False, use_byte_stream_split=numbers)


def _value_type(kind: pa.DataType) -> pa.DataType:
    return kind.value_type if pa.types.is_list(kind) else kind


def _leaf(field: pa.Field) -> str:
    """Return how Parquet calls a column's values."""
    return f"{field.name}.list.element" if pa.types.is_list(field.type) else str(field.name)
