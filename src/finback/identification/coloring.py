"""Errors of an estimate whose residuals are not white (Morelli & Klein 1997, J. Aircraft 34(4), pp. 463-471).

The Cramér-Rao bound takes residuals for white. Those of a model that misses something are not, and then its errors
are larger. Residuals of a fit hold nothing of what its own regressors can do, so for regressors nearly constant over a
record the corrected errors stay some 25 % too small (measured). With the influence X of the coefficients on the
whitened residuals e, and C the bound, the covariance is

    C [ΣᵢΣⱼ Xᵢᵀ ρ(j - i) Xⱼ] C,   ρ(k) the autocovariance of e at lag k, found from the residuals themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import chdtrc

from finback.arrays import FloatArray

_LAGS: Final = 20
"""Lags of the portmanteau test of Ljung and Box (1978)."""
SIGNIFICANT: Final = 1e-3
"""Probability below which residuals are not taken for white."""
_REACH: Final = 0.2
"""Autocovariances count up to this share of a stretch (Klein & Morelli 2006, section 5.3): beyond, they are noise."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Coloring:
    """What the color of residuals does to a covariance.

    Attributes:
        covariance: corrected, shape (p, p); that which was given, widened, if the residuals are white.
        probability: that white residuals are as correlated as these, of each equation or output; each is judged
            against 1e-3.
        colored: whether any is below.
        factor: median ratio of corrected to given standard errors; 1 if the residuals are white.
    """

    covariance: FloatArray
    probability: tuple[float, ...]
    colored: bool
    factor: float


def coloring(
    covariance: FloatArray, influence: Sequence[FloatArray], residuals: Sequence[FloatArray], *, widening: float = 1.0
) -> Coloring:
    """Judge residuals, and correct the covariance of the coefficients if they are not white.

    No standard error is made smaller than that of white residuals of the same size.

    Args:
        covariance: of the coefficients, for residuals that are white with variance 1, shape (p, p).
        influence: of each stretch, shape (K, outputs, p).
        residuals: of each stretch, whitened, shape (K, outputs).
        widening: the mean square of the residuals if it says that noise does not explain them, else 1.
    """
    probability = tuple(whiteness([e[:, k] for e in residuals]) for k in range(residuals[0].shape[1]))
    if min(probability) >= SIGNIFICANT:
        return Coloring(covariance=widening * covariance, probability=probability, colored=False, factor=1.0)
    corrected = corrected_covariance(covariance, influence, residuals)
    given = np.sqrt(widening * np.diag(covariance))
    found = np.sqrt(np.maximum(np.diag(corrected), 0.0))
    # Cut off, an estimated autocovariance need not be positive definite: never less than the bound, and no correlation
    # beyond it.
    values, vectors = np.linalg.eigh(_scaled(corrected, given))
    raised = vectors * np.maximum(values, 0.0) @ vectors.T
    lift = np.maximum(1.0, np.sqrt(np.diag(raised))) / np.sqrt(np.maximum(np.diag(raised), np.finfo(np.float64).tiny))
    final_covariance = raised * np.outer(lift, lift) * np.outer(given, given)
    free = given > 0.0
    ratio = np.maximum(found[free] / given[free], 1.0)
    return Coloring(covariance=final_covariance, probability=probability, colored=True, factor=float(np.median(ratio)))


def corrected_covariance(
    covariance: FloatArray, influence: Sequence[FloatArray], residuals: Sequence[FloatArray]
) -> FloatArray:
    """Return the covariance that residuals of their own color give, shape (p, p).

    Args:
        covariance: for white residuals of variance 1, shape (p, p).
        influence: of each stretch, shape (n, outputs, p).
        residuals: of each stretch, whitened, shape (n, outputs).
    """
    autocovariance = _autocovariance(residuals)
    middle = sum((_weighted_square(rows, autocovariance) for rows in influence), np.zeros_like(covariance))
    corrected: FloatArray = covariance @ middle @ covariance
    return corrected


def whiteness(pieces: Sequence[FloatArray]) -> float:
    """Return the probability that white noise is as correlated, over 20 lags (Ljung & Box 1978, Biometrika 65, 297).

    Args:
        pieces: of one series, each without a gap; products reach over no gap. Too short ones say nothing: 1.
    """
    total = sum(float(piece @ piece) for piece in pieces)
    count = sum(piece.size for piece in pieces)
    if count <= 2 * _LAGS or total == 0.0:
        return 1.0
    statistic = 0.0
    for lag in range(1, _LAGS + 1):
        pairs = sum(max(piece.size - lag, 0) for piece in pieces)
        if pairs:
            product = sum(float(piece[lag:] @ piece[:-lag]) for piece in pieces)
            # The mean product of ``pairs`` products has variance (total / count)² / pairs.
            statistic += (product * count / total) ** 2 / pairs
    return float(chdtrc(_LAGS, statistic))


def _scaled(matrix: FloatArray, lengths: FloatArray) -> FloatArray:
    safe = np.where(lengths > 0.0, lengths, 1.0)
    scaled: FloatArray = 0.5 * (matrix + matrix.T) / np.outer(safe, safe)
    return scaled


def _autocovariance(residuals: Sequence[FloatArray]) -> FloatArray:
    """Return ρ(k) for k = 0 … L, shape (L + 1, outputs, outputs): [k, i, j] is the mean of eᵢ(t) eⱼ(t + k)."""
    reach = max(int(_REACH * max(len(e) for e in residuals)), 1)
    outputs = residuals[0].shape[1]
    total = np.zeros((reach + 1, outputs, outputs))
    count = sum(len(e) for e in residuals)
    for e in residuals:
        length = next_fast_len(2 * len(e))
        spectrum = rfft(e, length, axis=0)
        product = irfft(spectrum.conj()[:, :, np.newaxis] * spectrum[:, np.newaxis, :], length, axis=0)
        lags = min(reach + 1, len(e))
        total[:lags] += product[:lags]
    return total / count


def _weighted_square(rows: FloatArray, autocovariance: FloatArray) -> FloatArray:
    """Return ΣᵢΣⱼ Xᵢᵀ ρ(j - i) Xⱼ for X of shape (K, outputs, p)."""
    lags = min(len(autocovariance), len(rows))
    length = next_fast_len(len(rows) + lags)
    kernel = np.zeros((length, *autocovariance.shape[1:]))
    # (filtered)ᵢ = Σₖ ρ(k) Xᵢ₊ₖ over both signs of k, with ρ(-k) = ρ(k)ᵀ: a correlation.
    kernel[:lags] = autocovariance[:lags]
    kernel[length - lags + 1 :] = autocovariance[1:lags][::-1].transpose(0, 2, 1)
    spectrum = rfft(rows, length, axis=0)
    filtered = irfft(rfft(kernel, axis=0).conj() @ spectrum, length, axis=0)[: len(rows)]
    flat: FloatArray = rows.reshape(-1, rows.shape[2]).T @ filtered.reshape(-1, rows.shape[2])
    return flat
