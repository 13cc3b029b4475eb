"""An extended Kalman filter over one stretch of flight by coefficients: its innovations and how they move.

States are V, α, θ and q, with white noise on dV/dt, dα/dt and dq/dt: dθ/dt = q holds whatever the air does. A gust that
moves alpha is felt by the accelerometers as it is seen by the vane, because specific forces are functions of the state.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.dynamics.compiled import compiled
from finback.identification.coefficient.motion import Layout, evaluate
from finback.identification.coefficient.shooting import AFTER, OWN, advance, delayed
from finback.identification.coefficient.track import STATES, Track

RATE_OF = {"q_dot_rad_s2": 3, "ax_m_s2": 4, "az_m_s2": 5}
"""Outputs that are no states -> their place among the rates."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Noises:
    """What disturbs a flight and its record.

    Attributes:
        process: spectral densities of white noise on dV/dt in m²/s³, dα/dt in rad²/s and dq/dt in rad²/s³, shape (3,).
        sensors: variances of the outputs' noise, in SI, shape (outputs,).
        start: variances of the states at the first sample, as far as they are no outputs, in SI, shape (4,).
    """

    process: FloatArray
    sensors: FloatArray
    start: FloatArray


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Innovations:
    """What each sample says beyond what the samples before it said, output by output.

    Attributes:
        states: filtered V, α, θ and q, in SI, shape (n, 4).
        values: measured less predicted from all that came before, outputs of the same sample included, at all samples
            but the first, shape (n - 1, outputs).
        variances: of them; they are independent, shape (n - 1, outputs).
        derivative: of the whitened predictions by the numbers, the biases of the outputs and of the elevator and its
            delay, for the filter's gains as they are, shape (n - 1, outputs, p + outputs + 2); of no rows unless asked.
        scores: derivative of the logarithms of the variances, and of the whitened innovations, by the logarithms of the
            densities (3) and of the sensors' variances, for the Jacobians as they are, shape (2, n - 1, outputs, 3 +
            outputs); of no rows unless asked.
    """

    states: FloatArray
    values: FloatArray
    variances: FloatArray
    derivative: FloatArray
    scores: FloatArray

    @property
    def whitened(self) -> FloatArray:
        """The innovations in units of their standard deviations, shape (n - 1, outputs)."""
        with np.errstate(all="ignore"):  # of a filter that diverges; its cost says so
            whitened: FloatArray = self.values / np.sqrt(self.variances)
        return whitened

    @property
    def cost(self) -> float:
        """Twice the negative logarithm of their likelihood, but for a constant; infinite if a variance is not > 0."""
        if not (self.variances > 0.0).all():
            return float(np.inf)
        with np.errstate(all="ignore"):
            return float((self.values**2 / self.variances + np.log(self.variances)).sum())


def innovations(  # noqa: PLR0913 - a stretch, a model, and what disturbs both
    track: Track,
    terms: Layout,
    numbers: FloatArray,
    extras: FloatArray,
    noises: Noises,
    *,
    substeps: int,
    derived: bool = False,
    scored: bool = False,
) -> Innovations:
    """Filter one stretch, beginning at its first sample.

    Args:
        track: the data.
        terms: form and airframe.
        numbers: of the coefficients, in SI, shape (p,).
        extras: biases of the outputs, that of the elevator, its delay, in SI, shape (outputs + 2,).
        noises: of the air and the sensors.
        substeps: Runge-Kutta steps in a sample interval.
        derived: whether the derivative is computed.
        scored: whether the scores are.
    """
    outputs = len(track.outputs)
    inputs = np.array(track.inputs)
    inputs[:, 0] -= extras[-2]
    acting, slope = delayed(track, float(extras[-2]), float(extras[-1]))
    states, values, variances, derivative, scores = _filtered(
        np.require(track.measured - extras[:outputs], np.float64, ["C", "W"]),
        np.array([STATES.index(name) if name in STATES else OWN + RATE_OF[name] for name in track.outputs]),
        start_of(track, extras),
        inputs,
        acting,
        slope,
        np.column_stack([track.density_kg_m3, track.thrust_n]),
        track.held.astype(np.float64),
        track.interval_s,
        float(extras[-1]),
        substeps,
        track.gravity_m_s2,
        np.require(numbers, np.float64, ["C", "W"]),
        terms.owner,
        terms.weight,
        terms.exponents,
        terms.ends,
        terms.frame,
        terms.body,
        noises.process,
        noises.sensors,
        noises.start,
        derived,
        scored,
    )
    if derived:  # as numbers, biases of the outputs, of the elevator, delay
        after = OWN + numbers.size
        order = [*range(OWN, after), *range(after + AFTER, after + AFTER + outputs), after, after + 1]
        derivative = derivative[:, :, order]
    return Innovations(states=states, values=values, variances=variances, derivative=derivative, scores=scores)


def start_of(track: Track, extras: FloatArray) -> FloatArray:
    """Return V, α, θ and q at the first sample, as measured less their biases, shape (4,)."""
    start = np.array(track.states[0])
    for k, name in enumerate(track.outputs):
        if name in STATES:
            start[STATES.index(name)] -= extras[k]
    return start


@compiled
def _filtered(  # noqa: PLR0913, PLR0917, C901, PLR0912, PLR0915 - one loop, which compiles faster than its parts
    measured: FloatArray,
    kinds: IntArray,
    start: FloatArray,
    inputs: FloatArray,
    acting: FloatArray,
    slope: FloatArray,
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
    process: FloatArray,
    sensors: FloatArray,
    first: FloatArray,
    derived: bool,  # noqa: FBT001 - a kernel takes its values one by one
    scored: bool,  # noqa: FBT001 - a kernel takes its values one by one
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    count, outputs, size, width = measured.shape[0], measured.shape[1], numbers.size, inputs.shape[1]
    columns = OWN + size + AFTER + outputs if derived else OWN
    bias = OWN + size + AFTER  # the first column of an output's bias
    states, values, variances = np.empty((count, 4)), np.empty((count - 1, outputs)), np.empty((count - 1, outputs))
    derivative = np.zeros((count - 1 if derived else 0, outputs, columns))
    point, basis = np.empty(5 + width), np.empty(size)
    rates, jacobian, direct, gain = np.empty(6), np.empty((6, 4)), np.empty((6, size)), np.empty(6)
    x, s, h = start.copy(), np.zeros((4, columns)), np.empty(4)
    p, half, carried = np.zeros((4, 4)), np.zeros(4), np.empty((4, 4))
    before, gains = np.empty(4), np.empty(4)
    half[0], half[1], half[3] = 0.5 * interval * process[0], 0.5 * interval * process[1], 0.5 * interval * process[2]
    densities = 3 + outputs if scored else 0
    scores = np.zeros((2, count - 1 if scored else 0, outputs, densities))
    dx, dp, dg, dc = np.zeros((densities, 4)), np.zeros((densities, 4, 4)), np.empty(4), np.empty((4, 4))
    for r in range(4):
        p[r, r] = first[r]
    for k in range(outputs):
        if kinds[k] < OWN:
            p[kinds[k], kinds[k]] = sensors[k]
            if scored:
                dp[3 + k, kinds[k], kinds[k]] = sensors[k]
            if derived:
                s[kinds[k], bias + k] = -1.0
    states[0] = x
    for i in range(count - 1):
        for r in range(4):
            for j in range(4):
                s[r, j] = 1.0 if r == j else 0.0
        advance(
            i, True, x, s, inputs, air, held, interval, delay, substeps, gravity, numbers, owner, weight, exponents,
            ends, frame, body,
        )  # fmt: skip
        # White noise over an interval, by the trapezoidal rule.
        for r in range(4):
            p[r, r] += half[r]
        for r in range(4):
            for j in range(4):
                carried[r, j] = s[r, 0] * p[0, j] + s[r, 1] * p[1, j] + s[r, 2] * p[2, j] + s[r, 3] * p[3, j]
        for r in range(4):
            for j in range(4):
                p[r, j] = (
                    carried[r, 0] * s[j, 0]
                    + carried[r, 1] * s[j, 1]
                    + carried[r, 2] * s[j, 2]
                    + carried[r, 3] * s[j, 3]
                )
            p[r, r] += half[r]
        for d in range(densities):
            noisy = d if d < 2 else 3  # the state that this density disturbs
            if d < 3:
                dp[d, noisy, noisy] += half[noisy]
            for r in range(4):
                dg[r] = s[r, 0] * dx[d, 0] + s[r, 1] * dx[d, 1] + s[r, 2] * dx[d, 2] + s[r, 3] * dx[d, 3]
                for j in range(4):
                    dc[r, j] = (
                        s[r, 0] * dp[d, 0, j] + s[r, 1] * dp[d, 1, j] + s[r, 2] * dp[d, 2, j] + s[r, 3] * dp[d, 3, j]
                    )
            for r in range(4):
                dx[d, r] = dg[r]
                for j in range(4):
                    dp[d, r, j] = dc[r, 0] * s[j, 0] + dc[r, 1] * s[j, 1] + dc[r, 2] * s[j, 2] + dc[r, 3] * s[j, 3]
            if d < 3:
                dp[d, noisy, noisy] += half[noisy]
        before[:] = x
        evaluate(
            before, acting[i + 1], air[i + 1, 0], air[i + 1, 1], gravity, numbers, owner, weight, exponents, ends,
            frame, body, point, basis, rates, jacobian, direct, gain,
        )  # fmt: skip
        # Their noise is independent, so outputs are taken one after the other.
        for k in range(outputs):
            kind = kinds[k]
            predicted = before[kind] if kind < OWN else rates[kind - OWN]
            for r in range(4):
                h[r] = jacobian[kind - OWN, r] if kind >= OWN else 1.0 if r == kind else 0.0
                predicted += h[r] * (x[r] - before[r])
            variance = sensors[k]
            for r in range(4):
                gains[r] = p[r, 0] * h[0] + p[r, 1] * h[1] + p[r, 2] * h[2] + p[r, 3] * h[3]
            for r in range(4):
                variance += h[r] * gains[r]
            value = measured[i + 1, k] - predicted
            values[i, k], variances[i, k] = value, variance
            scale = 1.0 / np.sqrt(variance)
            for j in range(OWN, columns):
                moved = h[0] * s[0, j] + h[1] * s[1, j] + h[2] * s[2, j] + h[3] * s[3, j]
                if j < OWN + size:
                    moved += direct[kind - OWN, j - OWN] if kind >= OWN else 0.0
                elif j < bias and kind >= OWN:
                    moved -= gain[kind - OWN] * (1.0 if j == OWN + size else slope[i + 1])
                elif j == bias + k:
                    moved += 1.0
                derivative[i, k, j] = scale * moved
                # The innovation falls as the prediction rises.
                for r in range(4):
                    s[r, j] -= gains[r] / variance * moved
            for d in range(densities):
                spread = sensors[k] if d == 3 + k else 0.0
                moved = 0.0
                for r in range(4):
                    dg[r] = dp[d, r, 0] * h[0] + dp[d, r, 1] * h[1] + dp[d, r, 2] * h[2] + dp[d, r, 3] * h[3]
                for r in range(4):
                    spread += h[r] * dg[r]
                    moved -= h[r] * dx[d, r]
                spread /= variance
                scores[0, i, k, d], scores[1, i, k, d] = spread, scale * moved
                for r in range(4):
                    share = gains[r] / variance
                    dx[d, r] += (dg[r] / variance - share * spread) * value + share * moved
                    for j in range(4):
                        dp[d, r, j] -= (dg[r] * gains[j] + gains[r] * dg[j]) / variance - share * gains[j] * spread
            for r in range(4):
                x[r] += gains[r] / variance * value
            for r in range(4):
                for j in range(4):
                    p[r, j] -= gains[r] * gains[j] / variance
        states[i + 1] = x
    return states, values, variances, derivative, scores
