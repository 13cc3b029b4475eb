"""A planar polynomial field as a short list of products, for kernels that know no model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.dynamics.planar.system import PlanarFlow


@final
@dataclass(frozen=True, slots=True, eq=False)
class PlanarField:
    """x' = P(x, y), y' = Q(x, y), evaluated by as few products as its monomials need.

    Factors are numbered: 0 is x, 1 is y, 2 + k is product k. Each monomial is made once, for both polynomials and
    for their divergence.

    Attributes:
        factors: the two factors of each product, shape (m, 2); both come before it.
        weights: rows P, Q and the divergence, shape (3, m + 3); column 0 is the constant, column 1 + k belongs to
            factor k.
        flow: the field as tables.
    """

    factors: IntArray
    weights: FloatArray
    flow: PlanarFlow

    @classmethod
    def of(cls, flow: PlanarFlow) -> PlanarField:
        """Return the field of a flow."""
        present = np.argwhere((flow.first != 0.0) | (flow.second != 0.0)).tolist()
        factors, columns = _products(tuple((i, j) for i, j in present))
        weights = np.zeros((3, len(factors) + 3))
        for i, j in present:
            weights[0, columns[i, j]] = flow.first[i, j]
            weights[1, columns[i, j]] = flow.second[i, j]
            if i:
                weights[2, columns[i - 1, j]] += i * flow.first[i, j]
            if j:
                weights[2, columns[i, j - 1]] += j * flow.second[i, j]
        return cls(factors, weights, flow)

    def velocity(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (x', y') for arrays of one shape."""
        values = self._factor_values(x, y)
        rates = np.tensordot(self.weights[:2, 1:], values, 1)
        return rates[0] + self.weights[0, 0], rates[1] + self.weights[1, 0]

    def divergence(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return ∂P/∂x + ∂Q/∂y for arrays of one shape."""
        return np.asarray(np.tensordot(self.weights[2, 1:], self._factor_values(x, y), 1) + self.weights[2, 0])

    def sizes(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the terms of x' and of y', summed in absolute value, for arrays of one shape: shape (2, ...)."""
        weights = np.abs(self.weights[:2])
        total = np.tensordot(weights[:, 1:], np.abs(self._factor_values(x, y)), 1)
        return np.asarray(total + weights[:, :1].reshape(2, *(1,) * np.ndim(x)))

    def jacobian(self, x: float, y: float) -> FloatArray:
        """Return the derivative of (P, Q) by (x, y), shape (2, 2)."""
        rows, columns = self.flow.first.shape
        xs, ys = x ** np.arange(rows), y ** np.arange(columns)
        dx = np.arange(rows) * np.concatenate([[0.0], xs[:-1]])
        dy = np.arange(columns) * np.concatenate([[0.0], ys[:-1]])
        return np.array([[dx @ table @ ys, xs @ table @ dy] for table in (self.flow.first, self.flow.second)])

    def _factor_values(self, x: FloatArray, y: FloatArray) -> FloatArray:
        values = np.empty((len(self.factors) + 2, *np.shape(x)))
        values[0], values[1] = x, y
        for k, (one, two) in enumerate(self.factors.tolist()):
            values[k + 2] = values[one] * values[two]
        return values


def shifted_table(table: FloatArray, x: float, y: float) -> FloatArray:
    """Return the coefficients of p(x + u, y + v) in u and v (repeated synthetic division, by rows and by columns)."""
    result = np.array(table, dtype=np.float64)
    for axis, by in ((0, x), (1, y)):
        rows = result if axis == 0 else result.T  # a view: both write to ``result``
        for start in range(len(rows) - 1):
            for k in range(len(rows) - 2, start - 1, -1):
                rows[k] += by * rows[k + 1]
    return result


def along_line(table: FloatArray, point: tuple[float, float], direction: tuple[float, float]) -> FloatArray:
    """Return the coefficients by rising power of r of p(point + r direction), shape (m + n − 1,)."""
    local = shifted_table(table, *point)
    row = np.zeros(sum(local.shape) - 1)
    for (i, j), value in np.ndenumerate(local):
        row[i + j] += value * direction[0] ** i * direction[1] ** j
    return row


@lru_cache(maxsize=256)
def _products(powers: tuple[tuple[int, int], ...]) -> tuple[IntArray, dict[tuple[int, int], int]]:
    """Return the factors of every monomial needed, and the column of the weights that belongs to each."""
    needed = set(powers)
    needed |= {(i - 1, j) for i, j in powers if i} | {(i, j - 1) for i, j in powers if j}
    pending = list(needed)
    while pending:
        i, j = pending.pop()
        if i + j > 1 and (rest := _without_one(i, j)) not in needed:
            needed.add(rest)
            pending.append(rest)
    columns = {(0, 0): 0, (1, 0): 1, (0, 1): 2}
    factors: list[tuple[int, int]] = []
    for i, j in sorted((power for power in needed if sum(power) > 1), key=lambda power: (sum(power), power)):
        rest = _without_one(i, j)
        factors.append((columns[rest] - 1, 0 if rest == (i - 1, j) else 1))
        columns[i, j] = len(columns)
    return np.array(factors, dtype=np.int64).reshape(-1, 2), columns


def _without_one(i: int, j: int) -> tuple[int, int]:
    return (i - 1, j) if i and (i >= j or not j) else (i, j - 1)
