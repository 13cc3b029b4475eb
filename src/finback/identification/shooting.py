"""The solution of a model from a state, under sampled inputs, with its derivative by everything that is estimated.

Columns of the derivative: alpha and q at the start, the coefficients, the elevator's bias, the elevator's delay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.dynamics.compiled import compiled
from finback.identification.field import Layout, evaluate

OWN: Final = 2
"""Columns of the start."""
AFTER: Final = 2
"""Columns after the coefficients: the elevator's bias, its delay."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """A solution at n + 1 samples.

    Attributes:
        states: alpha in rad and q in rad/s, shape (n + 1, 2).
        sensitivity: their derivative, shape (n + 1, 2, p + 4).
    """

    states: FloatArray
    sensitivity: FloatArray


def shoot(  # noqa: PLR0913 - a state, a stretch of inputs and a model make a solution
    terms: Layout,
    coefficients: FloatArray,
    start: FloatArray,
    inputs: FloatArray,
    *,
    held: FloatArray,
    samples: tuple[int, int],
    interval_s: float,
    delay_s: float,
    substeps: int,
) -> Solution:
    """Integrate from the first sample of a range to its last by the classical fourth-order Runge-Kutta method.

    Args:
        terms: the form.
        coefficients: in SI, shape (p,).
        start: alpha and q at the first sample, shape (2,).
        inputs: at all samples of the stretch, in SI, shape (N, inputs); the elevator first, without its bias.
        held: 1 for an input that is held from each sample to the next, 0 for one that goes straight, shape (inputs,).
        samples: first and last sample of the range.
        interval_s: time between samples, in s.
        delay_s: how much later than recorded the elevator acts, in s; before the first sample it stands still.
        substeps: equal steps in a sample interval (each again split where a delayed elevator has a corner).
    """
    states, sensitivity = _shoot(
        np.require(start, np.float64, ["C", "W"]),
        np.require(inputs, np.float64, ["C", "W"]),
        np.require(held, np.float64, ["C", "W"]),
        samples[0],
        samples[1],
        interval_s,
        delay_s,
        substeps,
        np.require(coefficients, np.float64, ["C", "W"]),
        terms.owner,
        terms.weight,
        terms.exponents,
        terms.split,
    )
    return Solution(states=states, sensitivity=sensitivity)


@compiled
def _shoot(  # noqa: PLR0913, PLR0917, C901, PLR0912, PLR0915 - one loop, which compiles faster than its parts
    start: FloatArray,
    inputs: FloatArray,
    held: FloatArray,
    first: int,
    last: int,
    interval: float,
    delay: float,
    substeps: int,
    coefficients: FloatArray,
    owner: IntArray,
    weight: FloatArray,
    exponents: IntArray,
    split: int,
) -> tuple[FloatArray, FloatArray]:
    size, count, width = coefficients.size, inputs.shape[0], inputs.shape[1]
    columns = size + 4
    states = np.empty((last - first + 1, 2))
    results = np.zeros((last - first + 1, 2, columns))
    point = np.empty(3 + width)
    rates, jacobian = np.empty(2), np.empty((2, 2))
    direct, gain = np.empty((2, size)), np.empty(2)
    x, s = start.copy(), np.zeros((2, columns))
    s[0, 0] = 1.0
    s[1, 1] = 1.0
    kx, ks = np.empty((4, 2)), np.empty((4, 2, columns))
    states[0] = x
    results[0] = s
    whole = math.floor(delay / interval)
    share = delay / interval - whole  # of an interval, after which a delayed elevator has its corner
    for i in range(first, last):
        for half in range(2):
            begin, end = (0.0, share) if half == 0 else (share, 1.0)
            if half == 0 and share == 0.0:
                continue
            left = min(max(i - whole - (1 - half), 0), count - 1)
            right = min(max(i - whole - (1 - half) + 1, 0), count - 1)
            if half == 1 and held[0] > 0.0 and (share > 0.0 or i > first):
                # A later jump keeps the rates before it for longer.
                older = min(max(i - whole - 1, 0), count - 1)
                if inputs[older, 0] != inputs[left, 0]:
                    for side in range(2):
                        point[0], point[1] = x[0], x[1]
                        point[3] = inputs[older, 0] if side == 0 else inputs[left, 0]
                        for k in range(1, width):
                            straight = inputs[i, k] + share * (inputs[i + 1, k] - inputs[i, k])
                            point[3 + k] = inputs[i, k] if held[k] > 0.0 else straight
                        evaluate(point, coefficients, owner, weight, exponents, split, rates, jacobian, direct, gain)
                        sign = 1.0 if side == 0 else -1.0
                        s[0, columns - 1] += sign * rates[0]
                        s[1, columns - 1] += sign * rates[1]
            rise = 0.0 if held[0] > 0.0 else inputs[right, 0] - inputs[left, 0]
            # Of the way from the elevator's left sample to its right one.
            base = inputs[left, 0] + (0.0 if half == 1 else rise * (1.0 - share))
            h = interval * (end - begin) / substeps
            for step in range(substeps):
                for stage in range(4):
                    node = 0.0 if stage == 0 else 1.0 if stage == 3 else 0.5
                    weighted = 0.0 if stage == 0 else node * h
                    previous = max(stage - 1, 0)
                    point[0] = x[0] + weighted * kx[previous, 0] if stage > 0 else x[0]
                    point[1] = x[1] + weighted * kx[previous, 1] if stage > 0 else x[1]
                    passed = (step + node) / substeps * (end - begin)  # in intervals, since ``begin``
                    point[3] = base + rise * passed
                    for k in range(1, width):
                        straight = inputs[i, k] + (begin + passed) * (inputs[i + 1, k] - inputs[i, k])
                        point[3 + k] = inputs[i, k] if held[k] > 0.0 else straight
                    evaluate(point, coefficients, owner, weight, exponents, split, rates, jacobian, direct, gain)
                    kx[stage, 0], kx[stage, 1] = rates[0], rates[1]
                    a, b, c, d = jacobian[0, 0], jacobian[0, 1], jacobian[1, 0], jacobian[1, 1]
                    for j in range(columns):
                        top, bottom = s[0, j], s[1, j]
                        if stage > 0:
                            top += weighted * ks[previous, 0, j]
                            bottom += weighted * ks[previous, 1, j]
                        ks[stage, 0, j] = a * top + b * bottom
                        ks[stage, 1, j] = c * top + d * bottom
                    for j in range(size):
                        ks[stage, 0, 2 + j] += direct[0, j]
                        ks[stage, 1, 2 + j] += direct[1, j]
                    ks[stage, 0, columns - 2] -= gain[0]
                    ks[stage, 1, columns - 2] -= gain[1]
                    ks[stage, 0, columns - 1] -= gain[0] * rise / interval
                    ks[stage, 1, columns - 1] -= gain[1] * rise / interval
                for r in range(2):
                    x[r] += h / 6.0 * (kx[0, r] + 2.0 * kx[1, r] + 2.0 * kx[2, r] + kx[3, r])
                    for j in range(columns):
                        s[r, j] += h / 6.0 * (ks[0, r, j] + 2.0 * ks[1, r, j] + 2.0 * ks[2, r, j] + ks[3, r, j])
        states[i - first + 1] = x
        results[i - first + 1] = s
    return states, results
