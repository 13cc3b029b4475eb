"""Under which weights the equations of motion are averaged: bumps in time, or waves within a band of frequencies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from finback.arrays import FloatArray, IntArray
from finback.errors import InputError
from finback.identification.bump import bump
from finback.identification.coefficient.options import CoefficientMethod, CoefficientOptions
from finback.identification.coefficient.track import Track
from finback.identification.frequency import transforms
from finback.identification.stretch import half_width_samples

_FEWEST: Final = 3
"""Sample intervals of a half width."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Bumps:
    """K bumps along a stretch of n samples, each of weight 1.

    Attributes:
        starts: first sample of each, shape (K,).
        value: weights of a mean, shape (2 m + 1,).
        slope: those of the mean of a rate, for the quantity itself, shape (2 m + 1,).
        samples: n.
    """

    starts: IntArray
    value: FloatArray
    slope: FloatArray
    samples: int

    def mean(self, signal: FloatArray) -> FloatArray:
        """Return the mean of a signal (n, …) under each, shape (K, …)."""
        return self._windows(signal, self.value)

    def rate(self, signal: FloatArray) -> FloatArray:
        """Return the mean of a signal's rate under each, shape (K, …)."""
        return self._windows(signal, self.slope)

    def spread(self, rows: FloatArray) -> FloatArray:
        """Return the transposed of ``mean``: of rows (K, p), shape (n, p)."""
        return self._back(rows, self.value)

    def spread_rate(self, rows: FloatArray) -> FloatArray:
        """Return the transposed of ``rate``, shape (n, p)."""
        return self._back(rows, self.slope)

    def _windows(self, signal: FloatArray, weight: FloatArray) -> FloatArray:
        found: FloatArray = sliding_window_view(signal, weight.size, axis=0)[self.starts] @ weight
        return found

    def _back(self, rows: FloatArray, weight: FloatArray) -> FloatArray:
        found = np.zeros((self.samples, rows.shape[1]))
        for offset, share in enumerate(weight.tolist()):
            found[self.starts + offset] += share * rows
        return found


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Waves:
    """K tapered waves over a stretch of n samples.

    Attributes:
        value: weights of a transform, shape (K, n).
        slope: those of the transform of a rate, for the quantity itself, shape (K, n).
    """

    value: FloatArray
    slope: FloatArray

    def mean(self, signal: FloatArray) -> FloatArray:
        """Return the transforms of a signal (n, …), shape (K, …)."""
        return np.tensordot(self.value, signal, axes=1)

    def rate(self, signal: FloatArray) -> FloatArray:
        """Return the transforms of a signal's rate, shape (K, …)."""
        return np.tensordot(self.slope, signal, axes=1)

    def spread(self, rows: FloatArray) -> FloatArray:
        """Return the transposed of ``mean``: of rows (K, p), shape (n, p)."""
        found: FloatArray = self.value.T @ rows
        return found

    def spread_rate(self, rows: FloatArray) -> FloatArray:
        """Return the transposed of ``rate``, shape (n, p)."""
        found: FloatArray = self.slope.T @ rows
        return found


TestFunctions = Bumps | Waves


def functions_of(track: Track, options: CoefficientOptions) -> TestFunctions:
    """Lay test functions over a stretch.

    Raises:
        InputError: the samples are too coarse for them.
    """
    if options.method is CoefficientMethod.FREQUENCY:
        found = transforms(track, options.band_1_s)
        # Noise of a transform grows with the root of the duration.
        size = math.sqrt(len(track) * track.interval_s)
        empty = np.empty((0, len(track)))
        return Waves(
            value=np.concatenate([empty, *(one.value / size for one in found)]),
            slope=np.concatenate([empty, *(-one.slope / size for one in found)]),
        )
    reach = half_width_samples(options.half_width_s, track.interval_s)
    if reach < _FEWEST:
        raise InputError(
            f"flight '{track.flight}': half_width_s {options.half_width_s:g} s spans {reach} sample intervals of "
            f"{track.interval_s:.6g} s, expected at least {_FEWEST}",
            hint=f"raise half_width_s to {_FEWEST * track.interval_s:.3g} s or sample faster",
        )
    weights = bump(reach, track.interval_s, track.hold)
    stride = max(1, round(options.spacing_s / track.interval_s))
    area = float(weights.value.sum())
    return Bumps(
        starts=np.arange(0, len(track) - 2 * reach, stride, dtype=np.int64),
        value=weights.value / area,
        slope=-weights.slope / area,
        samples=len(track),
    )
