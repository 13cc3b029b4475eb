"""Errors of equation error where noise has a color of its own: how large each noise is, and what it does to the fit.

Every source of noise is taken for a sum of white noise and of noises that forget exponentially, within 0.2 to 2 s. How
large each is follows from the residuals' transforms by maximum likelihood (Whittle 1953); what the fit takes out of
residuals is put back, as restricted maximum likelihood does (Patterson & Thompson 1971). With R the covariance of a
noise, H its gain to the whitened equations, X their regressors and C = (XᵀX)⁻¹, the covariance of the numbers is

    C [Σ Xᵀ H R Hᵀ X] C.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.fft import next_fast_len, rfft

from finback.arrays import FloatArray
from finback.identification.coefficient.sections import Section
from finback.identification.coefficient.weak_equations import EQUATIONS

MEMORIES_S: Final = (0.0, 0.2, 0.63, 2.0)
"""Time constants: white, then half a decade apart; sums of these are close to any between."""
_PASSES: Final = 60
"""Of the likelihood's maximization; the errors of the numbers then stand to 1 %."""
_LEAST: Final = 1e-8
"""Of the mean square of residuals: what every transform has at least, so that nothing divides by zero."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sources:
    """What was found of the noises.

    Attributes:
        variances: of each source with each memory, in the source's unit squared, shape (sources, memories).
        covariance: of the numbers, shape (p, p).
        white: the same if there were but the white noise that was guessed, shape (p, p).
    """

    variances: FloatArray
    covariance: FloatArray
    white: FloatArray


def correlation(lag_s: FloatArray, memory_s: float) -> FloatArray:
    """Return the correlation of a noise with itself at a lag."""
    lag = np.abs(lag_s)
    return np.exp(-lag / memory_s) if memory_s > 0.0 else np.where(lag == 0.0, 1.0, 0.0)


def found_sources(
    parts: Sequence[Section],
    covariance: FloatArray,
    *,
    half_width_s: float,
    begun: FloatArray,
    least: FloatArray,
) -> Sources:
    """Estimate the noises, and the covariance they give.

    Args:
        parts: the equations.
        covariance: of the numbers for whitened residuals that are white, shape (p, p).
        half_width_s: of bumps.
        begun: a first guess of the white noise of the outputs, shape (outputs,).
        least: what rounding makes of it at least, shape (outputs,).
    """
    transforms = [part.lines(half_width_s) for part in parts]
    each = [_effects(part, lines, len(covariance)) for part, lines in zip(parts, transforms, strict=True)]
    residuals = np.concatenate([lines @ part.residual for part, lines in zip(parts, transforms, strict=True)])
    rows = np.concatenate([np.tensordot(x, part.rows, axes=1) for part, x in zip(parts, transforms, strict=True)])
    middles = np.sum([one.middle for one in each], axis=0)
    expected = np.concatenate([one.expected for one in each], axis=2)
    # What the fit takes out of the residuals: they are those before it less X C times the scores.
    taken = rows @ covariance
    mixed = np.einsum("jep,smjfp->smjef", taken, np.concatenate([one.crossed for one in each], axis=2), optimize=True)
    expected += np.einsum("jep,smpq,jfq->smjef", taken, middles, taken, optimize=True) - mixed - mixed.swapaxes(-1, -2)
    floor, start = np.zeros(middles.shape[:2]), np.zeros(middles.shape[:2])
    floor[: least.size, 0], start[: begun.size, 0] = least**2, begun**2
    variances = floor + _likeliest(residuals, expected, floor, start)
    return Sources(
        variances=variances,
        covariance=_around(covariance, np.tensordot(variances, middles)),
        white=_around(covariance, np.tensordot(start, middles)),
    )


def _around(covariance: FloatArray, middle: FloatArray) -> FloatArray:
    """Return C M C, symmetric to the last digit."""
    found = covariance @ middle @ covariance
    symmetric: FloatArray = 0.5 * (found + found.T)
    return symmetric


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Effects:
    """What each source, with each memory and variance 1, does to m transforms and to the scores of p numbers.

    Attributes:
        expected: covariance of the transforms of the three equations, shape (sources, memories, m, 3, 3).
        crossed: of these with the scores, shape (sources, memories, m, 3, p).
        middle: of the scores, shape (sources, memories, p, p).
    """

    expected: FloatArray
    crossed: FloatArray
    middle: FloatArray


def _effects(part: Section, lines: FloatArray, size: int) -> _Effects:
    count, m = len(part.slopes), len(lines)
    columns = np.concatenate([np.repeat(lines.T[:, np.newaxis], EQUATIONS, axis=1), part.rows], axis=2)
    gains = part.gains(columns)
    length = next_fast_len(2 * count, real=True)
    lag = np.minimum(np.arange(length), length - np.arange(length)) * part.interval_s
    sides = np.full(length // 2 + 1, 2.0)
    sides[0] = 1.0
    if length % 2 == 0:
        sides[-1] = 1.0
    spectra = np.stack([rfft(correlation(lag, memory)).real * sides / length for memory in MEMORIES_S])
    shape = (part.sources, len(MEMORIES_S))
    expected, crossed = np.zeros((*shape, m, EQUATIONS, EQUATIONS)), np.zeros((*shape, m, EQUATIONS, size))
    middle = np.zeros((*shape, size, size))
    for source, gain in enumerate(gains):
        if not gain.any():
            continue
        every = np.concatenate([gain[:, :, :m].reshape(count, -1), gain[:, :, m:].sum(axis=1)], axis=1)
        there = rfft(every, length, axis=0)
        ahead = there[:, : EQUATIONS * m].reshape(-1, EQUATIONS, m)
        for one in range(EQUATIONS):
            for two in range(one, EQUATIONS):
                products = (ahead[:, one].conj() * ahead[:, two]).real
                expected[source, :, :, one, two] = expected[source, :, :, two, one] = spectra @ products
        # Real and imaginary parts stand one below the other: products of them are sums over frequencies.
        both = np.concatenate([there.real, there.imag])
        own, score = both[:, : EQUATIONS * m], both[:, EQUATIONS * m :]
        for k, spectrum in enumerate(spectra):
            heavy = np.concatenate([spectrum, spectrum])[:, np.newaxis] * score
            middle[source, k] = score.T @ heavy
            crossed[source, k] = (own.T @ heavy).reshape(EQUATIONS, m, size).transpose(1, 0, 2)
    return _Effects(expected=expected, crossed=crossed, middle=middle)


def _likeliest(lines: FloatArray, expected: FloatArray, floor: FloatArray, start: FloatArray) -> FloatArray:
    """Return the variances, beyond a floor, under which the transforms are most likely.

    Each pass multiplies a variance by the root of what the transforms say of it over what they should; the likelihood
    never falls by it (Zhou, Hu, Zhou & Lange 2019, MM algorithms for variance components models).
    """
    count = len(lines)
    flat = expected.reshape(floor.size, -1)
    fixed = (floor.ravel() @ flat).reshape(count, EQUATIONS, EQUATIONS)
    fixed += _LEAST * float((lines**2).mean()) * np.eye(EQUATIONS)
    power = np.einsum("cjee->c", flat.reshape(floor.size, count, EQUATIONS, EQUATIONS))
    known, guessed = power > 0.0, start.ravel()
    share = float((lines**2).sum()) / floor.size / np.where(known, power, 1.0)
    variances = np.where(known, np.where(guessed > 0.0, guessed, share), 0.0)
    for _ in range(_PASSES):
        inverse = np.linalg.inv(fixed + (variances @ flat).reshape(count, EQUATIONS, EQUATIONS))
        whitened = np.einsum("jef,jf->je", inverse, lines)
        seen = flat @ (whitened[:, :, np.newaxis] * whitened[:, np.newaxis]).ravel()
        due = flat @ inverse.ravel()
        variances = variances * np.where(known, np.sqrt(np.maximum(seen, 0.0) / np.where(due > 0.0, due, 1.0)), 0.0)
    return variances.reshape(floor.shape)
