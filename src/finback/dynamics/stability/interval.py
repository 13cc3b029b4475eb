"""Interval arithmetic with outward rounding, on arrays: what it encloses is enclosed, whatever rounding does.

Every sum and product of doubles is rounded to the nearest; the neighbor of the result on either side therefore
encloses the exact one (Moore, Kearfott & Cloud, Introduction to Interval Analysis, 2009, section 1.3).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray

_MOST_BOXES: Final = 20_000
_THIN: Final = 1e-6  # of the widest side: a box so thin is not cut across there before it is as thin elsewhere


@final
@dataclass(frozen=True, slots=True, eq=False)
class Interval:
    """Intervals, one for each element of two arrays of one shape (or broadcastable).

    Attributes:
        low: lower ends.
        high: upper ends.
    """

    low: FloatArray
    high: FloatArray

    @classmethod
    def around(cls, value: Fraction | float) -> Interval:
        """Return the narrowest interval of doubles around an exact number."""
        near = float(value)
        if Fraction(near) == value:
            return cls(np.array(near), np.array(near))
        return cls(np.nextafter(near, -np.inf), np.nextafter(near, np.inf))

    def __add__(self, other: Interval) -> Interval:
        return Interval(np.nextafter(self.low + other.low, -np.inf), np.nextafter(self.high + other.high, np.inf))

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __sub__(self, other: Interval) -> Interval:
        return self + -other

    def __mul__(self, other: Interval) -> Interval:
        products = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        low = np.minimum(np.minimum(products[0], products[1]), np.minimum(products[2], products[3]))
        high = np.maximum(np.maximum(products[0], products[1]), np.maximum(products[2], products[3]))
        return Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def evaluate(coefficients: Sequence[Interval], x: Interval) -> Interval:
    """Return Σ c_k x^k, by Horner's rule."""
    total = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        total = total * x + coefficient
    return total


def homogeneous(coefficients: Sequence[Interval], x: Interval, w: Interval) -> Interval:
    """Return Σ c_k x^k w^(n − k): w^n times the polynomial at x/w, also where w is 0 and x/w infinite."""
    total, power = coefficients[-1], w
    for coefficient in reversed(coefficients[:-1]):
        total = total * x + coefficient * power
        power = power * w
    return total


@final
@dataclass(slots=True)
class Effort:
    """How many boxes may still be spent on all claims together: what a whole analysis may take is bounded.

    Attributes:
        left: boxes; claims are not decided once it is used up.
    """

    left: int


def everywhere(claim: Callable[[Interval], tuple[np.ndarray, np.ndarray]], start: FloatArray, effort: Effort) -> int:
    """Decide whether a claim holds in the whole of some boxes, by bisection.

    Args:
        claim: given boxes as an interval with arrays of shape (dimensions, n), tells for each box whether the claim
            holds in all of it, and whether it is known to fail somewhere in it.
        start: the boxes to begin with, shape (n, dimensions, 2): low and high.
        effort: what may be spent; what it takes is taken off.

    Returns:
        the number of boxes it took; 0 if the claim fails somewhere, or was not decided within the boxes allowed.
    """
    boxes = start
    widths = (start[:, :, 1] - start[:, :, 0]).max(axis=0)
    widths = np.maximum(widths, max(_THIN * float(widths.max()), np.finfo(float).tiny))
    count = 0
    while len(boxes):
        count += len(boxes)
        effort.left -= len(boxes)
        if effort.left < 0 or count > _MOST_BOXES:
            return 0
        # A claim about a constant answers once for all boxes.
        holds, fails = np.broadcast_arrays(*claim(Interval(boxes[:, :, 0].T, boxes[:, :, 1].T)), boxes[:, 0, 0])[:2]
        if fails.any():
            return 0
        boxes = boxes[~holds]
        widest = ((boxes[:, :, 1] - boxes[:, :, 0]) / widths).argmax(axis=1)
        rows = np.arange(len(boxes))
        middle = boxes[rows, widest].mean(axis=1)
        left, right = boxes.copy(), boxes.copy()
        left[rows, widest, 1] = middle
        right[rows, widest, 0] = middle
        boxes = np.concatenate([left, right])
    return count
