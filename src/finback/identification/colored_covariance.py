"""Cramér–Rao bounds for residuals that are not white."""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve

from finback.arrays import FloatArray


def colored_covariance(sensitivities: FloatArray, residuals: FloatArray) -> FloatArray:
    """Return the covariance of least-squares parameters, colored residuals allowed for.

    With sensitivities S (of outputs in units of their noise) and residuals v of the same, M = Σ SᵢᵀSᵢ, the covariance
    is M⁻¹ [Σᵢ Σⱼ Sᵢᵀ R(i − j) Sⱼ] M⁻¹, where R is the autocorrelation of the residuals. Its estimate is cut at a fifth
    of the record and tapered to zero there (Bartlett's window), so the middle stays positive semidefinite.
    Source: Morelli & Klein 1997, J. Aircraft 34 (2), Eq. 17–20.

    Args:
        sensitivities: shape (n, outputs, parameters).
        residuals: shape (n, outputs).

    Returns:
        Shape (parameters, parameters).
    """
    rows, _, size = sensitivities.shape
    information = np.einsum("nop,noq->pq", sensitivities, sensitivities)
    inverse = np.linalg.pinv(information, hermitian=True)
    reach = max(1, rows // 5)
    taper = 1.0 - np.arange(reach) / reach
    middle = np.zeros((size, size))
    for output in range(residuals.shape[1]):
        value = residuals[:, output] - residuals[:, output].mean()
        spectrum = fftconvolve(value, value[::-1])[rows - 1 : rows - 1 + reach]
        correlation = spectrum / rows * taper
        kernel = np.concatenate([correlation[:0:-1], correlation])
        one = sensitivities[:, output, :]
        smeared = fftconvolve(one, kernel[:, np.newaxis], axes=0)[reach - 1 : reach - 1 + rows]
        middle += one.T @ smeared
    return np.asarray(inverse @ middle @ inverse)
