"""How the density of the air changes with altitude in the standard atmosphere (ICAO Doc 7488, 1993)."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray

_RADIUS_M: Final = 6_356_766.0
"""Of the Earth, for geopotential altitude."""
_SURFACE_K: Final = 288.15
_LAPSE_K_M: Final = 0.0065
_TROPOPAUSE_M: Final = 11_000.0
_EXPONENT: Final = 5.255_879_7
"""g₀ / (R L), of pressure by temperature in the troposphere."""


def density_ratio(altitude_m: ArrayLike, reference_m: float) -> FloatArray:
    """Return the density at geometric altitudes (any shape), divided by that at the reference altitude.

    Troposphere and the isothermal layer above it; from 20 km the error is 0.6 % at 21 km, growing to 2 % at 22 km.
    """
    result: FloatArray = _density(np.asarray(altitude_m, dtype=np.float64)) / _density(np.asarray(reference_m))
    return result


def _density(altitude_m: FloatArray) -> FloatArray:
    height = altitude_m * _RADIUS_M / (_RADIUS_M + altitude_m)
    below = (1.0 - _LAPSE_K_M * np.minimum(height, _TROPOPAUSE_M) / _SURFACE_K) ** (_EXPONENT - 1.0)
    cold = _SURFACE_K - _LAPSE_K_M * _TROPOPAUSE_M
    scale = cold / (_LAPSE_K_M * _EXPONENT)  # R T / g, the height over which density falls by e
    above: FloatArray = np.exp(-np.maximum(height - _TROPOPAUSE_M, 0.0) / scale)
    return below * above
