"""Flight by coefficients from a state, under sampled inputs, with its derivative by everything that is estimated.

Columns of the derivative: V, α, θ and q at the start, the numbers of the coefficients, the elevator's bias, its delay.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.dynamics.compiled import compiled
from finback.identification.coefficient.motion import Layout, evaluate
from finback.identification.coefficient.track import Track

OWN: Final = 4
"""Columns of the start."""
AFTER: Final = 2
"""Columns after the numbers: the elevator's bias, its delay."""


def shoot(  # noqa: PLR0913 - a state, a stretch of inputs and a model make a solution
    terms: Layout,
    numbers: FloatArray,
    start: FloatArray,
    track: Track,
    *,
    samples: tuple[int, int],
    bias_rad: float,
    delay_s: float,
    substeps: int,
) -> tuple[FloatArray, FloatArray]:
    """Integrate from one sample of a stretch to another by the classical fourth-order Runge-Kutta method.

    Args:
        terms: form and airframe.
        numbers: of the coefficients, in SI, shape (p,).
        start: V, α, θ and q at the first sample, shape (4,).
        track: the inputs, air and thrust.
        samples: first and last sample.
        bias_rad: what the elevator reads too much, in rad.
        delay_s: how much later than recorded the elevator acts, in s; before the first sample it stands still.
        substeps: equal steps in a sample interval (each again split where a delayed elevator has a corner).

    Returns:
        States, shape (n + 1, 4), and their derivative, shape (n + 1, 4, 4 + p + 2).
    """
    inputs = np.array(track.inputs)
    inputs[:, 0] -= bias_rad
    return _shoot(
        np.require(start, np.float64, ["C", "W"]),
        inputs,
        np.column_stack([track.density_kg_m3, track.thrust_n]),
        track.held.astype(np.float64),
        samples[0],
        samples[1],
        track.interval_s,
        delay_s,
        substeps,
        track.gravity_m_s2,
        np.require(numbers, np.float64, ["C", "W"]),
        terms.owner,
        terms.weight,
        terms.exponents,
        terms.ends,
        terms.frame,
        terms.body,
    )


def delayed(track: Track, bias: float, delay: float) -> tuple[FloatArray, FloatArray]:
    """Return the inputs as they act at the samples, shape (n, inputs), and the rate of the elevator, shape (n,)."""
    inputs = np.array(track.inputs)
    elevator = inputs[:, 0] - bias
    late = np.arange(len(track)) - delay / track.interval_s
    last = len(track) - 1
    if track.held[0]:
        before = np.clip(np.floor(late + 1e-9).astype(np.int64), 0, last)
        inputs[:, 0] = elevator[before]
        return inputs, np.zeros(len(track))
    inputs[:, 0] = np.interp(late, np.arange(len(track)), elevator)
    left = np.clip(np.floor(late).astype(np.int64), 0, last)
    rise = elevator[np.minimum(left + 1, last)] - elevator[left]
    return inputs, np.where((late >= 0.0) & (late < last), rise, 0.0) / track.interval_s


@compiled
def advance(  # noqa: PLR0913, PLR0915, PLR0917, C901, PLR0912 - one loop, which compiles faster than its parts
    i: int,
    jumps: bool,  # noqa: FBT001 - a kernel takes its values one by one
    x: FloatArray,
    s: FloatArray,
    inputs: FloatArray,
    air: FloatArray,
    held: FloatArray,
    interval: float,
    delay: float,
    substeps: int,
    gravity: float,
    numbers: FloatArray,
    owner: IntArray,
    weight: FloatArray,
    exponents: IntArray,
    ends: IntArray,
    frame: FloatArray,
    body: bool,  # noqa: FBT001 - a kernel takes its values one by one
) -> None:
    """Take a state ``x`` (4,) and its derivatives ``s`` (4, columns) from sample i to the next.

    Columns of ``s``: four that only the motion carries on; then, unless there are none, the numbers, the elevator's
    bias and its delay; then others that only the motion carries on. ``jumps``: whether an elevator that jumps at sample
    i does so after ``x``.
    """
    size, columns, count, width = numbers.size, s.shape[1], inputs.shape[0], inputs.shape[1]
    derived = columns > OWN
    late = OWN + size + 1
    point, basis, now = np.empty(5 + width), np.empty(size), np.empty(width)
    rates, jacobian = np.empty(6), np.empty((6, 4))
    direct, gain, at = np.empty((6, size)), np.empty(6), np.empty(4)
    kx, ks = np.empty((4, 4)), np.empty((4, 4, columns))
    whole = math.floor(delay / interval)
    share = delay / interval - whole  # of an interval, after which a delayed elevator has its corner
    for half in range(2):
        begin, end = (0.0, share) if half == 0 else (share, 1.0)
        if half == 0 and share == 0.0:
            continue
        left = min(max(i - whole - (1 - half), 0), count - 1)
        right = min(max(i - whole - (1 - half) + 1, 0), count - 1)
        rise = 0.0 if held[0] > 0.0 else inputs[right, 0] - inputs[left, 0]
        # Of the way from the elevator's left sample to its right one.
        base = inputs[left, 0] + (0.0 if half == 1 else rise * (1.0 - share))
        if half == 1 and held[0] > 0.0 and derived and (share > 0.0 or jumps):
            # A later jump keeps the rates before it for longer.
            older = min(max(i - whole - 1, 0), count - 1)
            if inputs[older, 0] != inputs[left, 0]:
                density = air[i, 0] + share * (air[i + 1, 0] - air[i, 0])
                thrust = air[i, 1] + share * (air[i + 1, 1] - air[i, 1])
                for k in range(1, width):
                    straight = inputs[i, k] + share * (inputs[i + 1, k] - inputs[i, k])
                    now[k] = inputs[i, k] if held[k] > 0.0 else straight
                for side in range(2):
                    now[0] = inputs[older, 0] if side == 0 else inputs[left, 0]
                    evaluate(
                        x, now, density, thrust, gravity, numbers, owner, weight, exponents, ends, frame, body,
                        point, basis, rates, jacobian, direct, gain,
                    )  # fmt: skip
                    sign = 1.0 if side == 0 else -1.0
                    for r in range(4):
                        s[r, late] += sign * rates[r]
        h = interval * (end - begin) / substeps
        for step in range(substeps):
            for stage in range(4):
                node = 0.0 if stage == 0 else 1.0 if stage == 3 else 0.5
                ahead = node * h
                previous = max(stage - 1, 0)
                for r in range(4):
                    at[r] = x[r] if stage == 0 else x[r] + ahead * kx[previous, r]
                passed = (step + node) / substeps * (end - begin)  # in intervals, since ``begin``
                where = begin + passed
                now[0] = base + rise * passed
                for k in range(1, width):
                    straight = inputs[i, k] + where * (inputs[i + 1, k] - inputs[i, k])
                    now[k] = inputs[i, k] if held[k] > 0.0 else straight
                density = air[i, 0] + where * (air[i + 1, 0] - air[i, 0])
                thrust = air[i, 1] + where * (air[i + 1, 1] - air[i, 1])
                evaluate(
                    at, now, density, thrust, gravity, numbers, owner, weight, exponents, ends, frame, body,
                    point, basis, rates, jacobian, direct, gain,
                )  # fmt: skip
                for r in range(4):
                    kx[stage, r] = rates[r]
                for j in range(columns):
                    one, two, three, four = s[0, j], s[1, j], s[2, j], s[3, j]
                    if stage > 0:
                        one += ahead * ks[previous, 0, j]
                        two += ahead * ks[previous, 1, j]
                        three += ahead * ks[previous, 2, j]
                        four += ahead * ks[previous, 3, j]
                    for r in range(4):
                        ks[stage, r, j] = (
                            jacobian[r, 0] * one + jacobian[r, 1] * two + jacobian[r, 2] * three + jacobian[r, 3] * four
                        )
                for r in range(4 if derived else 0):
                    for j in range(size):
                        ks[stage, r, OWN + j] += direct[r, j]
                    ks[stage, r, late - 1] -= gain[r]
                    ks[stage, r, late] -= gain[r] * rise / interval
            for r in range(4):
                x[r] += h / 6.0 * (kx[0, r] + 2.0 * kx[1, r] + 2.0 * kx[2, r] + kx[3, r])
                for j in range(columns):
                    s[r, j] += h / 6.0 * (ks[0, r, j] + 2.0 * ks[1, r, j] + 2.0 * ks[2, r, j] + ks[3, r, j])


@compiled
def _shoot(  # noqa: PLR0913, PLR0917 - a kernel takes its arrays one by one
    start: FloatArray,
    inputs: FloatArray,
    air: FloatArray,
    held: FloatArray,
    first: int,
    last: int,
    interval: float,
    delay: float,
    substeps: int,
    gravity: float,
    numbers: FloatArray,
    owner: IntArray,
    weight: FloatArray,
    exponents: IntArray,
    ends: IntArray,
    frame: FloatArray,
    body: bool,  # noqa: FBT001 - a kernel takes its values one by one
) -> tuple[FloatArray, FloatArray]:
    columns = OWN + numbers.size + AFTER
    states = np.empty((last - first + 1, 4))
    results = np.zeros((last - first + 1, 4, columns))
    x, s = start.copy(), np.zeros((4, columns))
    for r in range(4):
        s[r, r] = 1.0
    states[0] = x
    results[0] = s
    for i in range(first, last):
        advance(
            i, i > first, x, s, inputs, air, held, interval, delay, substeps, gravity, numbers, owner, weight,
            exponents, ends, frame, body,
        )  # fmt: skip
        states[i - first + 1] = x
        results[i - first + 1] = s
    return states, results
