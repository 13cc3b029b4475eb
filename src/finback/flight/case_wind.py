"""A steady wind that changes with altitude."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError
from finback.units import from_si


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class WindProfile:
    """Where the air moves to at each altitude: straight lines between the points, held below and above them.

    Attributes:
        altitude_m: above the reference ellipsoid, increasing, shape (n,).
        north_m_s: shape (n,).
        east_m_s: shape (n,).
    """

    altitude_m: FloatArray
    north_m_s: FloatArray
    east_m_s: FloatArray

    def __post_init__(self) -> None:
        """Freeze and check the points."""
        for name in ("altitude_m", "north_m_s", "east_m_s"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
            values = getattr(self, name)
            if values.ndim != 1 or not values.size or values.shape != self.altitude_m.shape:
                raise InputError(f"wind profile: '{name}' has shape {values.shape}, altitude {self.altitude_m.shape}")
            if not np.isfinite(values).all():
                raise InputError(f"wind profile: '{name}' holds only finite numbers")
        if (np.diff(self.altitude_m) <= 0.0).any():
            raise InputError("wind profile: altitudes must increase")

    def native(self) -> Callable[[float], tuple[float, float]]:
        """Return what gives north and east in ft/s at an altitude in ft; plain numbers, fast in a loop."""
        heights = from_si(self.altitude_m, "ft").tolist()
        rows = from_si(np.column_stack([self.north_m_s, self.east_m_s]), "ft_s").tolist()
        last = len(heights) - 1

        def at(altitude_ft: float) -> tuple[float, float]:
            above = bisect_right(heights, altitude_ft)
            if not 0 < above <= last:
                north, east = rows[min(above, last)]
                return north, east
            low = above - 1
            share = (altitude_ft - heights[low]) / (heights[above] - heights[low])
            north, east = (one + share * (two - one) for one, two in zip(rows[low], rows[above], strict=True))
            return north, east

        return at
