"""The subset with the smallest predicted squared error: built up, thinned and exchanged until no move lowers it."""

from __future__ import annotations

from typing import Final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.identification.selection.regression import Regression

_MOST_MOVES: Final = 1000
_LEAST_GAIN: Final = 1e-9
"""A move that lowers the criterion by less is rounding."""


def best_subset(regression: Regression, *, prices: FloatArray, always: IntArray, start: IntArray) -> IntArray:
    """Minimize the sum of squares plus the prices of the columns that are used.

    From ``start``, from ``always`` and from a thinned set of all columns: each time the best single addition, removal
    or exchange, until none lowers the criterion. The best of the three ends counts. It is a local search in a space of
    2^p subsets; what it cannot see are exchanges of two for two.

    Args:
        regression: whitened equations.
        prices: of each column, in units of the noise variance, shape (p,).
        always: columns that are not removed.
        start: where one search begins.
    """
    ends = [
        _improved(regression, prices, always, begin)
        for begin in (np.union1d(start, always), always, _thinned(regression, prices, always))
    ]
    return min(ends, key=lambda chosen: regression.misfit(chosen) + float(prices[chosen].sum()))


def _improved(regression: Regression, prices: FloatArray, always: IntArray, start: IntArray) -> IntArray:
    chosen = np.array(start, dtype=np.int64)
    for _ in range(_MOST_MOVES):
        gains, misfit = regression.gains(chosen)
        best, change = chosen, -_LEAST_GAIN
        costs = prices - gains
        costs[chosen] = np.inf
        add = int(np.argmin(costs))
        if costs[add] < change:
            best, change = np.append(chosen, add), float(costs[add])
        for place in np.flatnonzero(~np.isin(chosen, always)):
            rest = np.delete(chosen, place)
            rest_gains, rest_misfit = regression.gains(rest)
            lost = rest_misfit - misfit - float(prices[chosen[place]])
            if lost < change:
                best, change = rest, lost
            costs = prices - rest_gains
            costs[chosen] = np.inf
            other = int(np.argmin(costs))
            if lost + costs[other] < change:
                best, change = np.append(rest, other), lost + float(costs[other])
        if best is chosen:
            break
        chosen = best
    return np.sort(chosen)


def _thinned(regression: Regression, prices: FloatArray, always: IntArray) -> IntArray:
    """Remove from all columns, one by one, the one that is missed least, while it is missed less than its price."""
    chosen = np.arange(regression.scale.size)
    chosen = chosen[regression.scale > 0]
    while chosen.size > max(1, always.size):
        factor = regression.factor[:, chosen]
        q, r = np.linalg.qr(factor)
        weak = np.abs(np.diag(r)) < 1e-10
        if weak.any():
            chosen = np.delete(chosen, int(np.flatnonzero(weak)[-1]))
            continue
        inverse = np.linalg.solve(r, np.eye(chosen.size))
        squares = (inverse @ (q.T @ regression.target)) ** 2 / (inverse**2).sum(axis=1)
        squares -= prices[chosen]
        squares[np.isin(chosen, always)] = np.inf
        least = int(np.argmin(squares))
        if squares[least] >= 0:
            break
        chosen = np.delete(chosen, least)
    return np.sort(chosen)
