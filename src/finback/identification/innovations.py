"""An extended Kalman filter over one stretch: its innovations and their covariance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.dynamics.compiled import compiled
from finback.identification.field import Layout, evaluate
from finback.identification.stretch import Stretch


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Innovations:
    """What each sample says beyond what the samples before it said.

    Attributes:
        states: filtered alpha in rad and q in rad/s, shape (n, 2).
        values: measured less predicted, at all samples but the first, shape (n - 1, 2).
        white: inverse Cholesky factors of their covariances, shape (n - 1, 2, 2).
        log_determinant: sum of the logarithms of the determinants of these covariances.
    """

    states: FloatArray
    values: FloatArray
    white: FloatArray
    log_determinant: float


def innovations(
    stretch: Stretch, terms: Layout, coefficients: FloatArray, *, process: FloatArray, noise: FloatArray
) -> Innovations:
    """Filter one stretch, beginning at its first sample.

    Args:
        stretch: the data.
        terms: the form.
        coefficients: in SI, shape (p,).
        process: spectral densities of white noise on dα/dt in rad²/s and on dq/dt in rad²/s³, shape (2,).
        noise: variances of the noise of alpha in rad² and of q in rad²/s², shape (2,).
    """
    states, values, white, log_determinant = _filtered(
        np.require(stretch.measured, np.float64, ["C", "W"]),
        np.require(stretch.inputs, np.float64, ["C", "W"]),
        stretch.held.astype(np.float64),
        stretch.interval_s,
        np.require(coefficients, np.float64, ["C", "W"]),
        terms.owner,
        terms.weight,
        terms.exponents,
        terms.split,
        np.require(process, np.float64, ["C", "W"]),
        np.require(noise, np.float64, ["C", "W"]),
    )
    return Innovations(states=states, values=values, white=white, log_determinant=log_determinant)


@compiled
def _filtered(  # noqa: PLR0913, PLR0917 - one loop, which compiles faster than its parts
    measured: FloatArray,
    inputs: FloatArray,
    held: FloatArray,
    interval: float,
    coefficients: FloatArray,
    owner: IntArray,
    weight: FloatArray,
    exponents: IntArray,
    split: int,
    process: FloatArray,
    noise: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    count, width, size = measured.shape[0], inputs.shape[1], coefficients.size
    states, values = np.empty((count, 2)), np.empty((count - 1, 2))
    white = np.zeros((count - 1, 2, 2))
    point = np.empty(3 + width)
    rates, jacobian = np.empty(2), np.empty((2, 2))
    direct, gain = np.empty((2, size)), np.empty(2)
    k, x, old = np.zeros((4, 2)), measured[0].copy(), np.empty(2)
    # The covariance of the state, symmetric: alpha, alpha with q, q.
    paa, paq, pqq = noise[0], 0.0, noise[1]
    taa, taq, tqa, tqq = 1.0, 0.0, 0.0, 1.0
    states[0] = x
    log_determinant = 0.0
    for i in range(count - 1):
        old[:] = x
        for stage in range(4):
            node = 0.0 if stage == 0 else 1.0 if stage == 3 else 0.5
            for r in range(2):
                point[r] = old[r] + node * interval * k[max(stage - 1, 0), r] if stage > 0 else old[r]
            for j in range(width):
                rise = 0.0 if held[j] > 0.0 else inputs[i + 1, j] - inputs[i, j]
                point[3 + j] = inputs[i, j] + node * rise
            evaluate(point, coefficients, owner, weight, exponents, split, rates, jacobian, direct, gain)
            k[stage, 0], k[stage, 1] = rates[0], rates[1]
            if stage == 1:  # the transition of the step, to second order, from the derivative in its middle
                a, b, c, d = jacobian[0, 0], jacobian[0, 1], jacobian[1, 0], jacobian[1, 1]
                half = 0.5 * interval * interval
                taa = 1.0 + interval * a + half * (a * a + b * c)
                taq = interval * b + half * b * (a + d)
                tqa = interval * c + half * c * (a + d)
                tqq = 1.0 + interval * d + half * (b * c + d * d)
        for r in range(2):
            x[r] = old[r] + interval / 6.0 * (k[0, r] + 2.0 * k[1, r] + 2.0 * k[2, r] + k[3, r])
        one, two = taa * paa + taq * paq, taa * paq + taq * pqq
        three, four = tqa * paa + tqq * paq, tqa * paq + tqq * pqq
        paa = one * taa + two * taq + process[0] * interval
        paq = one * tqa + two * tqq
        pqq = three * tqa + four * tqq + process[1] * interval
        # Cholesky factor of the innovations' covariance, and its inverse.
        first = np.sqrt(paa + noise[0])
        beside = paq / first
        second = np.sqrt(pqq + noise[1] - beside * beside)
        white[i, 0, 0], white[i, 1, 1] = 1.0 / first, 1.0 / second
        white[i, 1, 0] = -beside / (first * second)
        log_determinant += 2.0 * np.log(first * second)
        values[i, 0], values[i, 1] = measured[i + 1, 0] - x[0], measured[i + 1, 1] - x[1]
        # The whitened innovation, and its covariance with the state.
        e = white[i, 0, 0] * values[i, 0]
        f = white[i, 1, 0] * values[i, 0] + white[i, 1, 1] * values[i, 1]
        ea, eq = white[i, 0, 0] * paa, white[i, 0, 0] * paq
        fa = white[i, 1, 0] * paa + white[i, 1, 1] * paq
        fq = white[i, 1, 0] * paq + white[i, 1, 1] * pqq
        x[0] += ea * e + fa * f
        x[1] += eq * e + fq * f
        paa -= ea * ea + fa * fa
        paq -= ea * eq + fa * fq
        pqq -= eq * eq + fq * fq
        states[i + 1, 0], states[i + 1, 1] = x[0], x[1]
    return states, values, white, log_determinant
