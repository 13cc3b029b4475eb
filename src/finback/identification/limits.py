"""What is known of the numbers of a form beforehand: some are fixed, some lie within bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.errors import InputError


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Fixed and bounded numbers, by their places.

    Attributes:
        size: how many numbers there are, p.
        fixed: place and value of each that is known, in SI.
        bounded: place, lowest and highest value of each that is fitted within bounds, in SI; a bound may be infinite.

    Raises:
        InputError: a place is named twice, a value is not finite, or bounds are empty.
    """

    size: int
    fixed: tuple[tuple[int, float], ...]
    bounded: tuple[tuple[int, float, float], ...]

    def __post_init__(self) -> None:
        """Check that what is fixed or bounded is so once, and can be."""
        named = [place for place, _ in self.fixed] + [place for place, _, _ in self.bounded]
        if len(set(named)) < len(named):
            raise InputError("a coefficient is fixed or bounded twice")
        if any(not np.isfinite(value) for _, value in self.fixed):
            raise InputError("a fixed coefficient needs a finite value")
        if any(not low < high for _, low, high in self.bounded):
            raise InputError("the bounds of a coefficient are (low, high) with low < high")

    @property
    def free(self) -> IntArray:
        """Places of the numbers that are fitted, bounded ones included."""
        known = {place for place, _ in self.fixed}
        return np.array([place for place in range(self.size) if place not in known], dtype=np.int64)

    @property
    def known(self) -> FloatArray:
        """The values of fixed numbers, 0 elsewhere, shape (p,)."""
        values = np.zeros(self.size)
        for place, value in self.fixed:
            values[place] = value
        return values

    @property
    def bounds(self) -> FloatArray:
        """Low and high of every number, infinite where nothing is said, shape (p, 2)."""
        limits = np.tile([-np.inf, np.inf], (self.size, 1))
        for place, low, high in self.bounded:
            limits[place] = low, high
        return limits
