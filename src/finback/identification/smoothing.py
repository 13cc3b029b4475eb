"""States smoothed with a model that is allowed to be a little wrong."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.linalg import solveh_banded

from finback.arrays import FloatArray
from finback.identification.field import Field, field
from finback.identification.model_form import ModelForm
from finback.identification.stretch import Stretch

_PASSES: Final = 2
"""Gauss-Newton passes: the second one changes a state by less than 1e-3 of its noise."""


def smooth(
    stretch: Stretch,
    form: ModelForm,
    coefficients: FloatArray,
    *,
    noise: FloatArray,
    memory_s: float,
    start: FloatArray,
) -> FloatArray:
    """Return (alpha, q) at every sample, shape (n, 2): near the samples, and near a solution of the model.

    It minimizes the sum of |measured - x|² and (memory / interval)² |x₊ - x - interval · mean rate|², both in units
    of the noise: a Kalman smoother whose process noise lets it forget after ``memory_s``, so that a model with small
    faults does not bend the states.

    Args:
        stretch: the data.
        form: the model's form.
        coefficients: of the model, in SI.
        noise: standard deviations of alpha in rad and q in rad/s, shape (2,); only their ratio matters.
        memory_s: how long the model is trusted, in s; it averages noise with weights exp(-|t| / memory) / (2 memory),
            so noise shrinks to about sqrt(interval / (4 memory)).
        start: states to linearize about, shape (n, 2).
    """
    state, weight = start, (memory_s / stretch.interval_s) ** 2
    for _ in range(_PASSES):
        first, last = _ends(stretch, form, coefficients, state)
        # By the trapezoidal rule; its error, interval³/12 times the third derivative, moves the point of linearization
        # by far less than noise.
        rise = 0.5 * stretch.interval_s * (first.rates + last.rates)
        residual = (state[1:] - state[:-1] - rise) / noise
        half = 0.5 * stretch.interval_s
        # Everything in units of the noise: a derivative by x of a residual scales with noise[j] / noise[i].
        before = (-np.eye(2) - half * first.jacobian) * noise / noise[:, np.newaxis]
        after = (np.eye(2) - half * last.jacobian) * noise / noise[:, np.newaxis]
        diagonal = np.broadcast_to(np.eye(2), (len(state), 2, 2)).copy()
        diagonal[:-1] += weight * before.transpose(0, 2, 1) @ before
        diagonal[1:] += weight * after.transpose(0, 2, 1) @ after
        beside = weight * before.transpose(0, 2, 1) @ after
        right = (stretch.measured - state) / noise
        right[:-1] -= weight * np.einsum("nij,ni->nj", before, residual)
        right[1:] -= weight * np.einsum("nij,ni->nj", after, residual)
        state = state + noise * _solve(diagonal, beside, right)
    return state


def _ends(stretch: Stretch, form: ModelForm, coefficients: FloatArray, state: FloatArray) -> tuple[Field, Field]:
    """Evaluate the form at both ends of each interval between samples."""
    first = field(form, coefficients, state[:-1], stretch.inputs[:-1])
    last = field(form, coefficients, state[1:], stretch.inputs_before[1:])
    return first, last


def _solve(diagonal: FloatArray, beside: FloatArray, right: FloatArray) -> FloatArray:
    """Solve a symmetric block tridiagonal system of 2 x 2 blocks (n, 2, 2), (n - 1, 2, 2) for ``right`` (n, 2)."""
    bands = np.zeros((4, right.size))  # lower diagonals: bands[d, column] = matrix[column + d, column]
    bands[0, 0::2], bands[0, 1::2] = diagonal[:, 0, 0], diagonal[:, 1, 1]
    bands[1, 0::2] = diagonal[:, 1, 0]
    bands[1, 1:-1:2] = beside[:, 1, 0]
    bands[2, 0:-2:2], bands[2, 1:-2:2] = beside[:, 0, 0], beside[:, 1, 1]
    bands[3, 0:-2:2] = beside[:, 0, 1]
    solution: FloatArray = solveh_banded(bands, right.ravel(), lower=True, overwrite_ab=True, check_finite=False)
    return solution.reshape(right.shape)
