"""All subsets that differ from a chosen one by up to two columns removed and up to two added."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from math import comb
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.identification.selection.regression import Regression

_PRODUCTS: Final = 1_000_000
"""Of pairs of columns that are held in memory at once."""
_NEW: Final = 1e-10
"""Squares of lengths, of columns of length 1, below which nothing new is left of a column."""
_APART: Final = 1e-6
"""Squares of sines between columns below which they are the same."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbor:
    """A subset near a chosen one.

    Attributes:
        chosen: columns of the chosen subset.
        removed: places of those among them that it lacks.
        added: columns that it has beside them.
        cost: by how much the sum of squares, with the prices of what is added and dropped, is above that of the
            chosen subset.
    """

    chosen: IntArray
    removed: IntArray
    added: IntArray
    cost: float

    @property
    def columns(self) -> IntArray:
        """Columns of this subset, rising."""
        columns: IntArray = np.sort(np.append(np.delete(self.chosen, self.removed), self.added))
        return columns


def neighbors(
    regression: Regression, chosen: IntArray, *, added: FloatArray, dropped: FloatArray, within: float, reach: int
) -> Iterator[Neighbor]:
    """Go through the neighbors whose cost is at most ``within``.

    Args:
        regression: whitened equations.
        chosen: the subset.
        added: what each column costs if it is added, shape (p,).
        dropped: what each column refunds if it is removed, shape (p,).
        within: the highest cost.
        reach: how many columns are removed at most, and added at most: 1 or 2.
    """
    free = np.setdiff1d(np.arange(added.size), chosen)
    prices = added[free]
    parts = _Parts.of(regression, chosen, free)
    for places in _removals(chosen.size, reach, at_once=max(1, _PRODUCTS // max(1, free.size**2))):
        rises, products, along = parts.without(places)
        base = rises - dropped[chosen[places]].sum(axis=1)
        if places.shape[1]:
            for at in np.flatnonzero(base <= within).tolist():
                yield Neighbor(chosen=chosen, removed=places[at], added=free[:0], cost=float(base[at]))
        costs = base[:, np.newaxis] - _gains_of_singles(products, along) + prices
        for at, i in np.argwhere(costs <= within).tolist():
            yield Neighbor(chosen=chosen, removed=places[at], added=free[[i]], cost=float(costs[at, i]))
        if reach == 1:
            continue
        costs = base[:, np.newaxis, np.newaxis] - _gains_of_pairs(products, along) + prices[:, np.newaxis] + prices
        for at, i, j in np.argwhere(np.triu(costs <= within, 1)).tolist():
            yield Neighbor(chosen=chosen, removed=places[at], added=free[[i, j]], cost=float(costs[at, i, j]))


def _removals(size: int, reach: int, *, at_once: int) -> Iterator[IntArray]:
    """Return the places of none, one and two columns, shape (n, 0…2), n up to ``at_once``: at least one stays."""
    for count in range(max(0, min(reach, size - 1)) + 1):
        every = np.array(list(combinations(range(size), count)), dtype=np.int64).reshape(comb(size, count), count)
        for first in range(0, len(every), at_once):
            yield every[first : first + at_once]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Parts:
    """The other columns as seen from a subset.

    Attributes:
        duals: of each column of the subset, the vector that only it sees, shape (k, m): what is lost without it.
        target: shape (m,).
        others: the other columns, shape (m, f).
        products: of what the subset does not explain of them, shape (f, f).
        along: their products with what the subset does not explain of the target, shape (f,).
    """

    duals: FloatArray
    target: FloatArray
    others: FloatArray
    products: FloatArray
    along: FloatArray

    @classmethod
    def of(cls, regression: Regression, chosen: IntArray, free: IntArray) -> _Parts:
        q, r = np.linalg.qr(regression.factor[:, chosen])
        others = regression.factor[:, free]
        beyond = others - q @ (q.T @ others)
        residual = regression.target - q @ (q.T @ regression.target)
        return cls(
            duals=np.linalg.solve(r, q.T),
            target=regression.target,
            others=others,
            products=beyond.T @ beyond,
            along=beyond.T @ residual,
        )

    def without(self, places: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Take sets of columns out.

        Args:
            places: of the columns that are removed, shape (n, 0…2).

        Returns:
            By how much the sum of squares rises, shape (n,); then the products of what is left of the other columns,
            shape (n, f, f), and these with what is left of the target, shape (n, f).
        """
        lost = self.duals[places]  # (n, d, m)
        for k in range(places.shape[1]):  # made orthonormal
            for before in range(k):
                lost[:, k] -= (lost[:, k] * lost[:, before]).sum(axis=1, keepdims=True) * lost[:, before]
            lost[:, k] /= np.sqrt((lost[:, k] ** 2).sum(axis=1, keepdims=True))
        parts, own = lost @ self.others, lost @ self.target
        products = self.products + parts.transpose(0, 2, 1) @ parts
        along = self.along + (parts.transpose(0, 2, 1) @ own[:, :, np.newaxis])[:, :, 0]
        return (own**2).sum(axis=1), products, along


def _gains_of_singles(products: FloatArray, along: FloatArray) -> FloatArray:
    """Return by how much each other column lowers the sum of squares, shape (n, f).

    Columns that the rest explains to 1e-5 of their length gain nothing.
    """
    squares = np.diagonal(products, axis1=1, axis2=2)
    new = squares > _NEW
    gains: FloatArray = np.where(new, along**2 / np.where(new, squares, 1.0), 0.0)
    return gains


def _gains_of_pairs(products: FloatArray, along: FloatArray) -> FloatArray:
    """Return by how much each pair of other columns lowers the sum of squares, shape (n, f, f).

    Pairs that explain each other to 1e-3, and those with a column that is not new, gain nothing.
    """
    lengths = np.sqrt(np.diagonal(products, axis1=1, axis2=2))
    new = lengths**2 > _NEW
    lengths = np.where(new, lengths, 1.0)
    along = np.where(new, along / lengths, 0.0)
    cosines = products / lengths[:, :, np.newaxis] / lengths[:, np.newaxis]
    apart = 1.0 - cosines**2
    able = (apart > _APART) & new[:, :, np.newaxis] & new[:, np.newaxis]
    one, two = along[:, :, np.newaxis], along[:, np.newaxis]
    gains: FloatArray = np.where(able, one**2 + two**2 - 2.0 * cosines * one * two, 0.0) / np.where(able, apart, 1.0)
    return gains
