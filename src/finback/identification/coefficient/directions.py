"""What would move the records and was not estimated: score tests of a late elevator and of a disturbed motion.

A score test asks the residuals of a fit for what the model has not got, without fitting it (Rao 1948). Whatever the
unknowns of the fit could do is taken out first, so that chance is what it is said to be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.special import chdtrc

from finback.arrays import FloatArray


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Directions:
    """How K things of one stretch would move its m whitened residuals, with what of it the fit would follow.

    Attributes:
        own: squares and products, the stretch's own unknowns taken out, shape (K, K).
        shared: products with the influence of the numbers, shape (K, p).
        found: products with the residuals, shape (K,).
    """

    own: FloatArray
    shared: FloatArray
    found: FloatArray


def directions(columns: FloatArray, unknown: FloatArray, influence: FloatArray, residual: FloatArray) -> Directions:
    """Take out what the stretch's own unknowns can do.

    Args:
        columns: derivative of the whitened prediction by what was not estimated, shape (m, K).
        unknown: that by the stretch's own unknowns, shape (m, k).
        influence: that by the numbers, the stretch's own unknowns taken out, shape (m, p).
        residual: whitened, shape (m,).
    """
    basis = np.linalg.qr(unknown).Q
    left = columns - basis @ (basis.T @ columns)
    return Directions(own=left.T @ left, shared=left.T @ influence, found=left.T @ residual)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """The score of K things, of all stretches.

    Attributes:
        score: shape (K,).
        information: its covariance, shape (K, K).
    """

    score: FloatArray
    information: FloatArray

    @property
    def of_noise(self) -> float:
        """The probability that residuals without it ask as much for K independent kicks of one variance.

        The sum of squares is distributed as Σ λ χ², λ the eigenvalues of the information: matched here by its first
        three moments (Hall 1983, Buckley and Eagleson 1988).
        """
        square = self.information @ self.information
        first, second = float(np.trace(self.information)), float(np.trace(square))
        third = float((square * self.information).sum())
        if not third > 0.0:
            return 1.0
        freedom = second**3 / third**2
        apart = (float(self.score @ self.score) - first) / np.sqrt(2.0 * second)
        return float(chdtrc(freedom, max(freedom + apart * np.sqrt(2.0 * freedom), 0.0)))


def score_of(stretches: Sequence[Directions], covariance: FloatArray) -> Score:
    """Put stretches together; their numbers are common, with a covariance (p, p) for residuals of variance 1."""
    shared = np.concatenate([one.shared for one in stretches])
    information = -shared @ covariance @ shared.T
    ends = np.cumsum([0, *(one.found.size for one in stretches)])
    for one, begin, end in zip(stretches, ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        information[begin:end, begin:end] += one.own
    return Score(score=np.concatenate([one.found for one in stretches]), information=information)
