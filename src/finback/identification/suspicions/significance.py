"""How much signals explain of residuals of any color, and whether chance explains as much."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.special import fdtrc

from finback.arrays import FloatArray

_ROWS_OF_MEMORY: Final = 1.5
"""Degrees of freedom of Newey and West's covariance, in lengths of its triangular window."""
_COLLINEAR: Final = 1e-6  # of the largest: a smaller singular value is rounding


def explained(values: FloatArray, columns: FloatArray, *, spent: int, memory: int) -> tuple[float, float]:
    """Return the probability that chance explains as much as the columns do, and the share they explain.

    A Wald test whose covariance allows for residuals of any color and size (Newey & West 1987, Econometrica 55, 703),
    so that one fault does not raise the alarm of another.

    Args:
        values: the residuals, shape (n,).
        columns: signals, free of all that has been fitted to the residuals, shape (n, k).
        spent: how many unknowns have been fitted.
        memory: rows over which residuals may be correlated.
    """
    basis = orthonormal(columns)
    if not basis.shape[1] or not values.any():
        return 1.0, 0.0
    weights = basis.T @ values
    left = values - basis @ weights
    moments = basis * left[:, np.newaxis]
    spread = moments.T @ moments
    for lag in range(1, min(memory, values.size - 1) + 1):
        product = moments[lag:].T @ moments[:-lag]
        spread += (1.0 - lag / (memory + 1)) * (product + product.T)
    # Never less than white residuals of this size have: a short record's own estimate may be.
    count = basis.shape[1]
    free = max(left.size - spent - count, 1)
    variance = float(left @ left) / free
    found, vectors = np.linalg.eigh(spread * (left.size / free))
    turned = vectors.T @ weights
    wald = float(np.sum(turned**2 / np.maximum(found, variance)))
    # The covariance is an estimate, too: as good as so many independent rows make it (Kiefer & Vogelsang 2005).
    rows = max(_ROWS_OF_MEMORY * left.size / (memory + 1) - count, 1.0)
    return float(fdtrc(count, rows, wald / count)), float(weights @ weights / (values @ values))


def orthonormal(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of columns that may depend on each other, shape (n, rank)."""
    if not columns.shape[1]:
        return columns
    basis, singular, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(basis[:, singular > _COLLINEAR * singular[0]])
