"""A number that carries its derivative by the parameters of a model, so that errors propagate to first order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray


@final
@dataclass(frozen=True, slots=True, eq=False)
class Dual:
    """A value and its derivative by θ (forward-mode differentiation).

    Attributes:
        value: the number.
        gradient: its derivative, shape (p,).
    """

    value: float
    gradient: FloatArray

    def __add__(self, other: Dual) -> Dual:
        return Dual(self.value + other.value, self.gradient + other.gradient)

    def __sub__(self, other: Dual) -> Dual:
        return Dual(self.value - other.value, self.gradient - other.gradient)

    def __mul__(self, other: Dual) -> Dual:
        return Dual(self.value * other.value, self.gradient * other.value + other.gradient * self.value)

    def __truediv__(self, other: Dual) -> Dual:
        value = self.value / other.value
        return Dual(value, (self.gradient - other.gradient * value) / other.value)

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.gradient)

    def times(self, factor: float) -> Dual:
        """Return the product with an exact number."""
        return Dual(self.value * factor, self.gradient * factor)

    def standard_error(self, covariance: FloatArray) -> float:
        """Return the standard deviation for this covariance of θ, shape (p, p)."""
        # Rounding can leave a variance of -1e-30 where it should be 0.
        return float(np.sqrt(max(0.0, float(self.gradient @ covariance @ self.gradient))))
