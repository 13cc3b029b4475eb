"""An extended Kalman filter over one stretch: its innovations and their covariance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.dynamics.compiled import compiled
from finback.identification.correction import elevator_by_delay
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
        sensitivity: derivative of the predictions by the coefficients, the biases of alpha, q and the elevator, and its
            delay, for the filter's gains as they are, shape (n - 1, 2, p + 4); of no rows unless asked for.
    """

    states: FloatArray
    values: FloatArray
    white: FloatArray
    log_determinant: float
    sensitivity: FloatArray


def innovations(
    stretch: Stretch,
    terms: Layout,
    coefficients: FloatArray,
    *,
    process: FloatArray,
    noise: FloatArray,
    derived: bool = False,
) -> Innovations:
    """Filter one stretch, beginning at its first sample.

    Args:
        stretch: the data, biases and delay taken off.
        terms: the form.
        coefficients: in SI, shape (p,).
        process: spectral densities of white noise on dα/dt in rad²/s and on dq/dt in rad²/s³, shape (2,).
        noise: variances of the noise of alpha in rad² and of q in rad²/s², shape (2,).
        derived: whether the sensitivity is computed.
    """
    states, values, white, log_determinant, sensitivity = _filtered(
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
        elevator_by_delay(stretch) if derived else np.empty(0),
    )
    return Innovations(
        states=states, values=values, white=white, log_determinant=log_determinant, sensitivity=sensitivity
    )


@compiled
def _filtered(  # noqa: PLR0913, PLR0917, C901, PLR0912, PLR0915 - one loop, which compiles faster than its parts
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
    late: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, float, FloatArray]:
    count, width, size = measured.shape[0], inputs.shape[1], coefficients.size
    derived = late.size > 0
    sensitivity = np.zeros((count - 1 if derived else 0, 2, size + 4))
    s = np.zeros((2, size + 4))
    s[0, size], s[1, size + 1] = -1.0, -1.0  # the first state is measured, less the biases
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
                if derived:  # by the midpoint rule
                    moved = late[i] if held[0] > 0.0 else 0.5 * (late[i] + late[i + 1])
                    for j in range(size + 4):
                        top = taa * s[0, j] + taq * s[1, j]
                        bottom = tqa * s[0, j] + tqq * s[1, j]
                        one, two = 0.0, 0.0
                        if j < size:
                            one, two = direct[0, j], direct[1, j]
                        elif j == size + 2:
                            one, two = -gain[0], -gain[1]
                        elif j == size + 3:
                            one, two = gain[0] * moved, gain[1] * moved
                        s[0, j] = top + interval * one + half * (a * one + b * two)
                        s[1, j] = bottom + interval * two + half * (c * one + d * two)
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
        if derived:
            for j in range(size + 4):
                one, two = s[0, j], s[1, j]
                if j == size:
                    one += 1.0
                elif j == size + 1:
                    two += 1.0
                sensitivity[i, 0, j], sensitivity[i, 1, j] = one, two
                # The innovation falls as the prediction rises.
                e1 = -white[i, 0, 0] * one
                f1 = -white[i, 1, 0] * one - white[i, 1, 1] * two
                s[0, j] += ea * e1 + fa * f1
                s[1, j] += eq * e1 + fq * f1
        x[0] += ea * e + fa * f
        x[1] += eq * e + fq * f
        paa -= ea * ea + fa * fa
        paq -= ea * eq + fa * fq
        pqq -= eq * eq + fq * fq
        states[i + 1, 0], states[i + 1, 1] = x[0], x[1]
    return states, values, white, log_determinant, sensitivity
