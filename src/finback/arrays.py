"""The array types every value holds: float64, read-only."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def frozen_array(values: ArrayLike) -> FloatArray:
    """Return ``values`` as a read-only float64 array that nobody else holds."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
