"""Taylor coefficients of a planar field at a point, with bounds on their rounding."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from functools import cache
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.dynamics.planar.system import PlanarFlow

UNIT_ROUNDOFF: Final = sys.float_info.epsilon / 2.0


@final
@dataclass(frozen=True, slots=True)
class Expansion:
    """Taylor coefficients of both polynomials at a point, and bounds on their rounding."""

    first: FloatArray
    second: FloatArray
    first_error: FloatArray
    second_error: FloatArray

    @property
    def value(self) -> FloatArray:
        """Both values, shape (2,)."""
        return np.array([self.first[0, 0], self.second[0, 0]])

    @property
    def error(self) -> FloatArray:
        """Bounds on the rounding of both values, shape (2,)."""
        return np.array([self.first_error[0, 0], self.second_error[0, 0]])

    @property
    def jacobian(self) -> FloatArray:
        """First derivatives, row i for polynomial i, shape (2, 2)."""
        return np.array([[self.first[1, 0], self.first[0, 1]], [self.second[1, 0], self.second[0, 1]]])

    def reach(self, radius: FloatArray) -> FloatArray:
        """Bound the difference between the value at the center, as evaluated, and any in a box: shape (2,)."""
        return np.abs(self.jacobian) @ radius + self.rest(radius)

    def noise(self, radius: FloatArray) -> FloatArray:
        """Bound the rounding of a value anywhere in a box: shape (2,)."""
        x, y = (r ** np.arange(n) for r, n in zip(radius, self.first.shape, strict=True))
        return np.array([x @ self.first_error @ y, x @ self.second_error @ y])

    def rest(self, radius: FloatArray) -> FloatArray:
        """Bound the terms of second and higher order, and the rounding of all, within a box: shape (2,)."""
        x, y = (r ** np.arange(n) for r, n in zip(radius, self.first.shape, strict=True))
        total = []
        for table, error in ((self.first, self.first_error), (self.second, self.second_error)):
            size = np.abs(table) + error
            size[0, 0], size[1, 0], size[0, 1] = error[0, 0], error[1, 0], error[0, 1]
            total.append(x @ size @ y)
        return np.array(total)

    def bend(self, radius: FloatArray) -> FloatArray:
        """Bound the change of the Jacobian, and its rounding, within a box: shape (2, 2)."""
        m, n = self.first.shape
        x, y = (r ** np.arange(k) for r, k in zip(radius, (m, n), strict=True))
        dx, dy = np.arange(1, m) * x[: m - 1], np.arange(1, n) * y[: n - 1]
        rows = []
        for table, error in ((self.first, self.first_error), (self.second, self.second_error)):
            size = np.abs(table) + error
            size[1, 0], size[0, 1] = error[1, 0], error[0, 1]
            rows.append([dx @ size[1:] @ y, x @ size[:, 1:] @ dy])
        return np.array(rows)


def expansion(flow: PlanarFlow, x: float, y: float) -> Expansion:
    """Return the Taylor coefficients of both polynomials of a flow at a point; tables of at least 2 × 2."""
    given = flow.first.shape
    m, n = (max(2, k) for k in given)
    left, right = _shift(x, m), _shift(y, n).T
    tables = np.zeros((2, 2, m, n))
    tables[0, :, : given[0], : given[1]] = flow.first, flow.second
    tables[1, :, : given[0], : given[1]] = flow.first_sizes, flow.second_sizes
    first, second = left @ tables[0] @ right
    # Powers, binomials, two products of length m and n, and the rounded coefficients themselves.
    steps = 2 * (m + n + 4) * UNIT_ROUNDOFF
    first_error, second_error = np.abs(left) @ tables[1] @ (steps * np.abs(right))
    return Expansion(first, second, first_error, second_error)


def along_principal_axes(here: Expansion, flow: PlanarFlow) -> tuple[FloatArray, PlanarFlow]:
    """Return the right singular vectors of the Jacobian, as columns, and the field in coordinates along them.

    Its rates are components along the left singular vectors, so that its Jacobian at 0 is diagonal.
    """
    left, _, right = np.linalg.svd(here.jacobian)
    # A bound on rounding, undone: what the coefficients were summed from.
    steps = 2 * (sum(here.first.shape) + 4) * UNIT_ROUNDOFF
    values = [_rotated(table, right.T) for table in (here.first, here.second)]
    sizes = [_rotated(error / steps, np.abs(right.T)) for error in (here.first_error, here.second_error)]
    first, second = (left[0, k] * values[0] + left[1, k] * values[1] for k in (0, 1))
    first_sizes, second_sizes = (abs(left[0, k]) * sizes[0] + abs(left[1, k]) * sizes[1] for k in (0, 1))
    return right.T, PlanarFlow(
        first=first, second=second, first_sizes=first_sizes, second_sizes=second_sizes, scale=flow.scale
    )


def second_derivatives(here: Expansion) -> FloatArray:
    """Return H[i, j, k], the second derivative of rate i by coordinates j and k."""
    result = np.zeros((2, 2, 2))
    for i, table in enumerate((here.first, here.second)):
        m, n = table.shape
        result[i, 0, 0] = 2.0 * table[2, 0] if m > 2 else 0.0
        result[i, 1, 1] = 2.0 * table[0, 2] if n > 2 else 0.0
        result[i, 0, 1] = result[i, 1, 0] = table[1, 1]
    return result


def inverse_of(matrix: FloatArray) -> FloatArray | None:
    """Return the inverse of a 2 × 2 matrix, or None where it has none in double precision."""
    (p, q), (r, s) = matrix.tolist()
    determinant = p * s - q * r
    if determinant == 0.0 or not np.isfinite(determinant):
        return None
    with np.errstate(over="ignore"):
        result = np.array([[s, -q], [-r, p]]) / determinant
    return result if np.isfinite(result).all() else None


def _rotated(table: FloatArray, axes: FloatArray) -> FloatArray:
    """Return the coefficients of p(A u) for a table of p and a matrix A, shape (d + 1, d + 1) with d the degree."""
    m, n = table.shape
    degree = m + n - 2
    result = np.zeros((degree + 1, degree + 1))
    xs, ys = [np.ones(1)], [np.ones(1)]  # powers of x and y: by rising power of the second coordinate
    for powers, size, row in ((xs, m, axes[0]), (ys, n, axes[1])):
        for _ in range(size - 1):
            powers.append(np.convolve(powers[-1], row))
    for i, j in np.argwhere(table).tolist():
        product = table[i, j] * np.convolve(xs[i], ys[j])
        for k, value in enumerate(product.tolist()):
            result[i + j - k, k] += value
    return result


@cache
def _binomials(size: int) -> tuple[FloatArray, IntArray]:
    """Return C(k, i) at row i and column k, and the power k − i (0 below the diagonal, where C is 0)."""
    binomials = [[float(math.comb(k, i)) for k in range(size)] for i in range(size)]
    powers = np.maximum(0, np.arange(size)[None, :] - np.arange(size)[:, None])
    return np.array(binomials), powers


def _shift(center: float, size: int) -> FloatArray:
    """Return the matrix that takes coefficients by rising power to Taylor coefficients at ``center``."""
    binomials, powers = _binomials(size)
    return np.array(binomials * (center ** np.arange(size))[powers])
