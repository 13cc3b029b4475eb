"""Under which weights the equations of motion are averaged: bumps in time, or waves within a band of frequencies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from finback.arrays import FloatArray, IntArray
from finback.identification.bump import bump
from finback.identification.coefficient.options import CoefficientMethod, CoefficientOptions
from finback.identification.coefficient.track import Track
from finback.identification.frequency import transforms
from finback.identification.stretch import half_width_samples

_FEWEST: Final = 5
"""Sample intervals of a half width: at 10 Hz with fewer, moments came out wrong by 0.5 %, now by 0.03 %."""


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

    def sections(self, longest: int) -> list[tuple[slice, slice, TestFunctions]]:
        """Cut into pieces of at most so many samples: which of the K, which samples, and the functions over these."""
        last = 2 * (self.value.size // 2)
        count = max(1, math.ceil((self.samples - 1) / longest))
        edges = np.linspace(0, self.starts.size, count + 1).round().astype(np.int64).tolist()
        found: list[tuple[slice, slice, TestFunctions]] = []
        for one, two in pairwise(edges):
            if two > one:
                first, end = int(self.starts[one]), int(self.starts[two - 1]) + last + 1
                cut = replace(self, starts=self.starts[one:two] - first, samples=end - first)
                found.append((slice(one, two), slice(first, end), cut))
        return found

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

    def sections(self, longest: int) -> list[tuple[slice, slice, TestFunctions]]:
        """Return the pieces that lie under one taper each, as ``Bumps`` does; these are short, ``longest`` or not."""
        del longest
        moving = self.value != 0.0
        firsts, ends = moving.argmax(axis=1), self.value.shape[1] - moving[:, ::-1].argmax(axis=1)
        # A sine begins a sample after its cosine: pieces are told apart where one begins after all others have ended.
        new = np.flatnonzero(firsts[1:] >= np.maximum.accumulate(ends)[:-1] - 1) + 1
        edges = [0, *new.tolist(), len(firsts)] if firsts.size else []
        found: list[tuple[slice, slice, TestFunctions]] = []
        for one, two in pairwise(edges):
            seen = slice(int(firsts[one:two].min()), int(ends[one:two].max()))
            cut = Waves(value=self.value[one:two, seen], slope=self.slope[one:two, seen])
            found.append((slice(one, two), seen, cut))
        return found


TestFunctions = Bumps | Waves


def least_half_width_s(used: Sequence[Track]) -> float:
    """Return how far bumps over these stretches reach at least, in s."""
    return _FEWEST * max(track.interval_s for track in used)


def functions_of(track: Track, options: CoefficientOptions) -> TestFunctions:
    """Lay test functions over a stretch; a bump reaches over five sample intervals at least."""
    if options.method is CoefficientMethod.FREQUENCY:
        found = transforms(track, options.band_1_s)
        # Noise of a transform grows with the root of the duration.
        size = math.sqrt(len(track) * track.interval_s)
        empty = np.empty((0, len(track)))
        return Waves(
            value=np.concatenate([empty, *(one.value / size for one in found)]),
            slope=np.concatenate([empty, *(-one.slope / size for one in found)]),
        )
    reach = max(half_width_samples(options.half_width_s, track.interval_s), _FEWEST)
    weights = bump(reach, track.interval_s, track.hold)
    stride = max(1, round(options.spacing_s / track.interval_s))
    area = float(weights.value.sum())
    return Bumps(
        starts=np.arange(0, len(track) - 2 * reach, stride, dtype=np.int64),
        value=weights.value / area,
        slope=-weights.slope / area,
        samples=len(track),
    )
