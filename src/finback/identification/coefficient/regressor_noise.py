"""What noise in the regressors does to equation error on average.

With X the regressors at the states as measured and e what noise makes of the equations, E[Xᵀ e] is not zero: both hold
the same noise. To second order it follows from the noise's covariance: the slope of X by a state, times the covariance
of what moves that state with e; and X times the mean of e, which curved equations have (Fuller 1987, Measurement Error
Models). A gust moves the aircraft too, so that alpha answers to it later; the linearized motion says how.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.linalg import expm, toeplitz

from finback.arrays import FloatArray
from finback.identification.coefficient.motion import Motion, layout, motion
from finback.identification.coefficient.options import CoefficientOptions
from finback.identification.coefficient.sandwich import MEMORIES_S, correlation
from finback.identification.coefficient.sections import GUSTS, Section
from finback.identification.coefficient.track import STATES, Track
from finback.identification.coefficient.weak_equations import EQUATIONS
from finback.identification.estimate import Estimate

_STEPS: Final = (1e-3, 1e-3, 0.0, 1e-3)
"""For differences by V (as a share of it), α and q; θ is in no regressor."""
_BLOCK: Final = 500
"""Samples at a time, so that matrices of long records stay small."""
_ANSWER_S: Final = 3.0
"""For how long the answer to a gust is followed."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RegressorNoise:
    """What noise in the regressors does.

    Attributes:
        bias: by how much the numbers are off on average, shape (p,).
        unreliable: share of what each regressor has by itself, beside all others, that is noise, shape (p,); 0 where a
            number is known.
    """

    bias: FloatArray
    unreliable: FloatArray


def regressor_noise(
    used: Sequence[Track],
    parts: Sequence[Section],
    options: CoefficientOptions,
    fit: Estimate,
    variances: FloatArray,
    white: FloatArray,
) -> RegressorNoise:
    """Return what it does to second order.

    With C the covariance and N the mean of what noise adds to the products of regressors, the part of regressor j that
    no other explains has a square of 1 / C_jj, of which (C N C)_jj / C_jj² is noise (Fuller 1987, section 2.2).

    Args:
        used: the stretches.
        parts: their equations.
        options: form and airframe.
        fit: the estimate; its covariance is that of residuals that are white.
        variances: of each source with each memory, shape (sources, memories).
        white: noise that the records themselves show, in SI, shape (outputs,): without a maneuver, residuals do not
            show that of a regressor.
    """
    numbers, covariance = fit.coefficients, fit.covariance
    score, noise = np.zeros(numbers.size), np.zeros((numbers.size, numbers.size))
    for part in parts:
        slopes, curved = _derivatives(used[part.stretch], part, options, numbers)
        score += _from_slopes(part, slopes, variances) - _from_curvature(part, curved, variances)
        noise += _added(part, slopes, variances, white)
    alone = np.diag(covariance)
    share = np.einsum("ij,jk,ki->i", covariance, noise, covariance) / np.where(alone > 0.0, alone, 1.0)
    return RegressorNoise(bias=covariance @ score, unreliable=share)


def _derivatives(
    track: Track, part: Section, options: CoefficientOptions, numbers: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return slopes of the regressors (4, n, 3, p), and half the curvature of right sides (4, n, 3), by each state."""
    terms = layout(options.form, options.airframe_of(track.flight), options.reference_speed_m_s)
    states, inputs = track.states[part.samples], track.inputs[part.samples]
    air = track.density_kg_m3[part.samples], track.thrust_n[part.samples]
    places = np.array(part.places)

    def at(moved: FloatArray) -> Motion:
        return motion(terms, numbers, moved, inputs, *air, track.gravity_m_s2)

    slopes = np.zeros((len(STATES), len(states), EQUATIONS, numbers.size))
    curved = np.zeros((len(STATES), len(states), EQUATIONS))
    for index, step in enumerate(_STEPS):
        if step == 0.0:
            continue
        width = step * (float(states[:, 0].mean()) if index == 0 else 1.0)
        move = np.zeros(len(STATES))
        move[index] = width
        up, down = at(states + move), at(states - move)
        slopes[index] = ((up.direct - down.direct) / (2.0 * width))[:, places]
        curved[index] = ((up.jacobian - down.jacobian)[:, places, index]) / (4.0 * width)
    return slopes, curved


def _from_curvature(part: Section, curved: FloatArray, variances: FloatArray) -> FloatArray:
    """Return what the mean of right sides gives to the scores: half their curvature times the noise's variance."""
    total = np.zeros(part.rows.shape[2])
    for source, name in enumerate(part.outputs):
        if name in STATES:
            mean = part.functions.mean(curved[STATES.index(name)]) * float(variances[source].sum())
            total += np.einsum("ke,kep->p", mean / part.weight, part.rows)
    return total


def _added(part: Section, slopes: FloatArray, variances: FloatArray, white: FloatArray) -> FloatArray:
    """Return what noise of the sensors adds to products of regressors, shape (p, p); a gust moves these in truth."""
    count, size = len(part.slopes), part.rows.shape[2]
    lag = np.linspace(0.0, (count - 1) * part.interval_s, count)
    value = part.functions.mean(np.eye(count))
    means = value.T @ value
    found = np.zeros((size, size))
    for source, name in enumerate(part.outputs):
        if name not in STATES:
            continue
        own = variances[source].copy()
        own[0] += max(0.0, float(white[source] ** 2 - own.sum()))
        together = means * toeplitz(own @ np.stack([correlation(lag, memory) for memory in MEMORIES_S]))
        for equation in range(EQUATIONS):
            slope = slopes[STATES.index(name), :, equation] / part.weight[equation]
            found += slope.T @ (together @ slope)
    return found


def _from_slopes(part: Section, slopes: FloatArray, variances: FloatArray) -> FloatArray:
    """Return what regressors give to the scores that move with the noise of the equations."""
    count = len(part.slopes)
    lag = np.linspace(0.0, (count - 1) * part.interval_s, count)
    answers = _answers(part, count)
    total = np.zeros(part.rows.shape[2])
    moved: list[tuple[int, int, FloatArray, FloatArray]] = []
    for source in np.flatnonzero(variances.any(axis=1)).tolist():
        own = variances[source] @ np.stack([correlation(lag, memory) for memory in MEMORIES_S])
        gust = source - len(part.outputs)
        if gust < 0 and part.outputs[source] in STATES:
            moved.append((source, STATES.index(part.outputs[source]), own, own))
        elif 0 <= gust < GUSTS and part.rated(gust):
            moved += [(source, state, *_crossed(own, answers[gust, :, state])) for state in (0, 1, 3)]
    one = np.eye(count)
    value, rate = part.functions.mean(one), part.functions.rate(one)
    for first in range(0, count, _BLOCK):
        rows = slice(first, min(first + _BLOCK, count))
        means, rates = value[:, rows].T @ value, value[:, rows].T @ rate
        for source, state, later, earlier in moved:
            together = toeplitz(later, earlier)[rows]
            for equation in range(EQUATIONS):
                share = _share(part, source, equation, together * means, together * rates)
                total += share @ slopes[state, rows, equation]
    return total


def _share(part: Section, source: int, equation: int, means: FloatArray, rates: FloatArray) -> FloatArray:
    """Return the covariance of a state at each sample with what its source makes of an equation over it."""
    found = np.zeros(len(means))
    if source in part.direct(equation):
        found += means.sum(axis=1)
    if source in part.rated(equation):
        found += rates.sum(axis=1)
    for other, slope in part.through(equation):
        if other == source:
            found -= means @ slope
    scaled: FloatArray = found / part.weight[equation] ** 2
    return scaled


def _answers(part: Section, count: int) -> FloatArray:
    """Return V, α, θ and q after a step of each gust, by the mean linearized motion, shape (2, steps, 4)."""
    once = expm(part.slopes.mean(axis=0)[: len(STATES)] * part.interval_s)
    states = [np.eye(len(STATES))[:GUSTS]]
    for _ in range(min(round(_ANSWER_S / part.interval_s), count - 1)):
        states.append(states[-1] @ once.T)
    return np.stack(states, axis=1)


def _crossed(own: FloatArray, answer: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the covariance of a state with a gust, the state later by each lag, then the gust."""
    both = np.concatenate([own[:0:-1], own])
    found = np.convolve(np.diff(both, prepend=both[0]), answer)[: both.size]
    return found[own.size - 1 :], found[own.size - 1 :: -1]
