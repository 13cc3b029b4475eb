"""Recording at every step: rows of numbers, read and kept as fast as Python can."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import call
from struct import Struct
from typing import final

import numpy as np

from finback.arrays import FloatArray
from finback.units import si_factor


@final
class Recorder:
    """Rows of what some functions return, kept as float64 and converted to SI once, at the end.

    A row is added by ``keep(pack(*map(call, columns)))``, with these three in local names: no more may stand between
    two steps, where reading 30 properties and keeping them takes less than half the time of the step
    (``scripts/bench-flight``).

    Args:
        columns: read a column each, in its own unit.
        units: of the columns, suffixes of ``finback.units``.

    Attributes:
        columns: what reads them.
        pack: makes bytes of a row.
        keep: adds them.
    """

    def __init__(self, columns: Sequence[Callable[[], float]], units: Sequence[str]) -> None:
        if len(columns) != len(units):
            raise ValueError(f"{len(columns)} columns with {len(units)} units")
        self._factors = np.array([si_factor(unit) for unit in units])
        self._rows = bytearray()
        self.columns = tuple(columns)
        self.pack: Callable[..., bytes] = Struct(f"{len(columns)}d").pack
        self.keep: Callable[[bytes], None] = self._rows.extend

    def take(self) -> None:
        """Add a row."""
        self.keep(self.pack(*map(call, self.columns)))

    def __len__(self) -> int:
        return len(self._rows) // (8 * self._factors.size)

    def table(self) -> FloatArray:
        """Return the rows so far, shape (rows, columns), in SI."""
        rows = np.frombuffer(bytes(self._rows), dtype=np.float64).reshape(-1, self._factors.size)
        table: FloatArray = rows * self._factors
        return table
