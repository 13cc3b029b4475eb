"""The time axes of a recording: ``sim_time`` in whole nanoseconds and ``step``, the row of the record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from finback.errors import InputError
from finback.records import FlightRecord

TIMELINE: Final = "sim_time"
ROW: Final = "step"
_LONGEST_S: Final = 9.0e9  # int64 nanoseconds end at 292 years


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Clock:
    """When each row of a record was.

    Attributes:
        nanoseconds: time of each row, timedelta64[ns], shape (n,).
    """

    nanoseconds: NDArray[np.timedelta64]

    @classmethod
    def of(cls, record: FlightRecord) -> Clock:
        """Return the clock of a record, rounded to nanoseconds (the viewer's own conversion truncates).

        Raises:
            InputError: the record is empty, or a time is not finite.
        """
        time = record["time_s"]
        if not len(record):
            raise InputError(f"flight '{record.name}' has no samples: there is nothing to record")
        if not (np.abs(time) < _LONGEST_S).all():
            wrong = time[~(np.abs(time) < _LONGEST_S)][0]
            raise InputError(f"flight '{record.name}': 'time_s' holds {wrong}, which is no time in s")
        return cls(nanoseconds=np.round(time * 1e9).astype(np.int64).astype("timedelta64[ns]"))

    def columns(self, keep: NDArray[np.bool_]) -> list[rr.TimeColumn]:
        """Return the time axes of the rows where ``keep`` (n,) holds."""
        rows = np.flatnonzero(keep)
        return [rr.TimeColumn(TIMELINE, duration=self.nanoseconds[rows]), rr.TimeColumn(ROW, sequence=rows)]

    def arrow(self) -> dict[str, Any]:
        """Return the time axes of all rows as arrow arrays."""
        rows = np.arange(self.nanoseconds.size)
        return {TIMELINE: pa.array(self.nanoseconds, pa.duration("ns")), ROW: pa.array(rows, pa.int64())}
