"""The subset with the smallest predicted squared error: built up, thinned and exchanged until no move lowers it."""

from __future__ import annotations

from typing import Final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.identification.selection.neighbors import neighbors
from finback.identification.selection.regression import Regression

_MOST_MOVES: Final = 1000
"""Never reached: every move lowers the criterion, so none comes back, and a model of 40 terms takes some tens."""
_LEAST_GAIN: Final = 1e-9
"""A move that lowers the criterion by less is rounding."""
_NONE: Final = np.array([], dtype=np.int64)


def best_subset(regression: Regression, *, prices: FloatArray, start: IntArray) -> IntArray:
    """Minimize the sum of squares plus the prices of the columns that are used.

    From ``start``, from nothing and from a thinned set of all columns: each time the best single addition, removal
    or exchange, until none lowers the criterion. The best of the three ends counts. It is a local search in a space of
    2^p subsets; ``exchanged`` goes on with exchanges of two.

    Args:
        regression: whitened equations.
        prices: of each column, in units of the noise variance, shape (p,).
        start: where one search begins.
    """
    ends = [improved(regression, prices, begin) for begin in (start, _NONE, thinned(regression, prices))]
    return min(ends, key=lambda chosen: regression.misfit(chosen) + float(prices[chosen].sum()))


def exchanged(regression: Regression, *, prices: FloatArray, chosen: IntArray) -> IntArray:
    """Improve a subset by exchanges of up to two columns for up to two others, until none lowers the criterion."""
    return improved(regression, prices, chosen, reach=2)


def improved(regression: Regression, prices: FloatArray, start: IntArray, *, reach: int = 1) -> IntArray:
    """Follow the best move from ``start``, until none lowers the criterion.

    Args:
        regression: whitened equations.
        prices: of each column, shape (p,).
        start: where the search begins.
        reach: how many columns a move removes at most, and adds at most: 1 or 2.
    """
    chosen = np.sort(start)
    for _ in range(_MOST_MOVES):
        near = neighbors(regression, chosen, added=prices, dropped=prices, within=-_LEAST_GAIN, reach=reach)
        best = min(near, key=lambda move: move.cost, default=None)
        if best is None:
            break
        chosen = best.columns
    return chosen


def thinned(regression: Regression, prices: FloatArray) -> IntArray:
    """Remove from all columns, one by one, the one that is missed least, while it is missed less than its price."""
    chosen = np.flatnonzero(regression.scale > 0)
    while chosen.size > 1:
        weak = np.abs(np.diag(np.linalg.qr(regression.factor[:, chosen])[1])) < 1e-10
        if weak.any():
            chosen = np.delete(chosen, int(np.flatnonzero(weak)[-1]))
            continue
        losses = regression.losses(chosen) - prices[chosen]
        least = int(np.argmin(losses))
        if losses[least] >= 0:
            break
        chosen = np.delete(chosen, least)
    return chosen
