"""Which samples can be drawn: a flight that diverged ends in numbers for which no picture has room."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from finback.records import FlightRecord

LARGEST: Final = 1e9
"""Larger magnitudes, in SI, are not drawn: single precision and every axis end long before."""


def drawable(record: FlightRecord, *columns: str) -> NDArray[np.bool_]:
    """Tell in which rows these columns (those that the record has) are finite and not absurd, shape (n,)."""
    good = np.ones(len(record), dtype=np.bool_)
    for name in columns:
        if name in record.columns:
            good &= np.abs(record[name]) <= LARGEST
    return good
