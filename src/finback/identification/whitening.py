"""The noise covariance of all weak equations, banded, and its Cholesky factor that makes them independent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.linalg import LinAlgError, cholesky_banded, solve_banded

from finback.arrays import FloatArray, frozen_array
from finback.errors import RefusedError
from finback.identification.weak_form import Sides, WeakForm

NO_PROCESS: Final = frozen_array(np.zeros(2))
"""Densities of noise on the rates where there is none."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Whitening:
    """Lower banded Cholesky factor of the covariance, with rows ordered (dα/dt, dq/dt) per test function.

    Attributes:
        factor: diagonals of the factor, shape (band + 1, n), the main one first.
    """

    factor: FloatArray

    def __call__(self, rows: FloatArray) -> FloatArray:
        """Return ``rows`` (n, …) in units in which their noise is white with variance 1."""
        result: FloatArray = solve_banded((self.factor.shape[0] - 1, 0), self.factor, rows, check_finite=False)
        return result


def whitening(
    forms: Sequence[WeakForm], sides: Sequence[Sides], noise: FloatArray, *, process: FloatArray = NO_PROCESS
) -> Whitening:
    """Return the whitening of the targets of all ``forms`` for white noise on alpha and q.

    Args:
        forms: the weak equations of every stretch; different stretches are independent.
        sides: of every stretch, the model at the smoothed states.
        noise: standard deviations of alpha in rad and q in rad/s, shape (2,).
        process: spectral densities of white noise on dα/dt in rad²/s and on dq/dt in rad²/s³, shape (2,).

    Raises:
        RefusedError: the covariance is singular in double precision.
    """
    band = 2 * max((2 * form.bump.reach) // form.stride for form in forms) + 1
    blocks = [
        _covariance(_rows(form, form.noise_rows(side, noise), process), form.stride, band)
        for form, side in zip(forms, sides, strict=True)
    ]
    try:
        factor = cholesky_banded(np.concatenate(blocks, axis=1), lower=True, overwrite_ab=True, check_finite=False)
    except LinAlgError:
        raise RefusedError(
            "the noise covariance of the weak equations is singular: test functions overlap too much",
            hint="raise spacing_s (a quarter of half_width_s is enough)",
        ) from None
    return Whitening(factor=factor)


def _rows(form: WeakForm, sensors: FloatArray, process: FloatArray) -> FloatArray:
    """Add to the rows of the sensors' noise those of white noise on both rates, shape (K, 2, 2 or 4, width)."""
    if not process.any():
        return sensors
    rates = np.zeros_like(sensors)
    for equation, density in enumerate(process.tolist()):
        rates[:, equation, equation] = form.bump.value * np.sqrt(density / form.stretch.interval_s)
    return np.concatenate([sensors, rates], axis=2)


def _covariance(rows: FloatArray, stride: int, band: int) -> FloatArray:
    """Return the lower diagonals, shape (band + 1, 2 K), of rows · rowsᵀ for rows (K, 2, 2, width).

    Test functions k and k + d share the samples that are ``d * stride`` from the start of the earlier one.
    """
    count, width = rows.shape[0], rows.shape[-1]
    result = np.zeros((band + 1, 2 * count))
    for lag in range(min((width - 1) // stride, count - 1) + 1):
        shift = lag * stride
        earlier = rows[: count - lag, :, :, shift:].reshape(count - lag, 2, -1)
        later = rows[lag:, :, :, : width - shift].reshape(count - lag, 2, -1)
        products = later @ earlier.transpose(0, 2, 1)
        for i in range(2):  # equation of the later test function, a row of the covariance
            for j in range(2):  # equation of the earlier one, a column
                diagonal = 2 * lag + i - j
                if diagonal >= 0:
                    result[diagonal, j : 2 * (count - lag) : 2] = products[:, i, j]
    return result
