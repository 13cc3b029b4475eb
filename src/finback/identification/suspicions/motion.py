"""The motion beside what a model with everything that a calm flight may hold explains, at a coarser sampling rate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.ndimage import uniform_filter1d

from finback.arrays import FloatArray
from finback.identification.suspicions.residuals import Residuals, own_columns, stacked
from finback.identification.suspicions.signals import Signals, attached_signals
from finback.identification.weak_form import Sides, WeakForm
from finback.identification.whitening import Whitening

_BLOCK_S: Final = 0.04  # samples are averaged over this time: gusts that an aircraft answers are slower
_ACTIVITY_S: Final = 2.0  # over which the size of a motion is taken
_SEEN: Final = 0.03  # of the usual length of a signal's column for its size, that it must have
_MOST: Final = 3.0
"""How often a signal's part may be the length of what is to be explained: other signals then cancel it."""
_STEP: Final = 1e-5  # of alpha in rad and q in rad/s, for derivatives of signals that are straight or nearly so


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Small motions d about a path: d(k+1) = transition d(k) + drive; what is measured is d and noise.

    Attributes:
        measured: alpha in rad and q in rad/s less the path, means over blocks, shape (n, 2).
        drive: of each block to the next, shape (n, 2).
        transition: likewise, shape (n, 2, 2).
        activity: mean square of each rate about the block, over its mean in all data, shape (n, 2).
        fresh: whether a stretch begins, shape (n,).
        interval_s: time between blocks.
        variance: of the mean of a block's sensor noise, shape (2,).
    """

    measured: FloatArray
    drive: FloatArray
    transition: FloatArray
    activity: FloatArray
    fresh: NDArray[np.bool_]
    interval_s: float
    variance: FloatArray


def motion(found: Residuals, white: Whitening) -> Motion:
    """Fit the model and what a calm flight may hold by generalized least squares, and return what moves beside it.

    Args:
        found: the residuals of the fit.
        white: what makes the noise white that is believed in here.
    """
    signals = attached_signals(found.forms, found.states, found.beside)
    change, weights = _fitted(found, signals, white)
    slopes = _slopes(found, signals, weights)
    coefficients = found.coefficients + change
    parts = [
        _stretch(weak, weak.sides(coefficients, state), state, own @ weights.T, slope)
        for weak, state, own, slope in zip(found.forms, found.states, signals, slopes, strict=True)
    ]
    measured, drive, transition, squares, fresh = (np.concatenate(part) for part in zip(*parts, strict=True))
    samples = _samples(found.forms[0])
    return Motion(
        measured=measured,
        drive=drive,
        transition=transition,
        activity=squares / squares.mean(axis=0),
        fresh=fresh.astype(np.bool_),
        interval_s=samples * found.forms[0].stretch.interval_s,
        variance=found.noise**2 / samples,
    )


def _fitted(found: Residuals, signals: Signals, white: Whitening) -> tuple[FloatArray, FloatArray]:
    """Return the change of the coefficients, shape (p,), and the signals' weights in each equation, (2, signals)."""
    own, rest = own_columns(found.forms, found.sides, found.states, found.coefficients)
    whole = white(np.column_stack([own, stacked(found.forms, signals), rest]))
    columns, target = whole[:, :-1], whole[:, -1]
    size, length = own.shape[1], np.linalg.norm(columns, axis=0)
    # A signal that hardly moves within the equations, only at the ends of a stretch, would get any weight.
    moves = np.sqrt(np.mean(np.concatenate(signals) ** 2, axis=0))
    seen = length[size:].reshape(2, -1) / np.maximum(moves, np.finfo(np.float64).tiny)
    kept = np.append(length[:size] > 0.0, (seen > _SEEN * np.median(seen, axis=1)[:, np.newaxis]).ravel())
    scaled = columns[:, kept] / length[kept]
    # No signal moves the equations by more than some times all that there is to explain.
    least = 1.0 / (_MOST * max(1.0, float(np.linalg.norm(target))))
    factor = cho_factor(scaled.T @ scaled + least**2 * np.eye(scaled.shape[1]), check_finite=False)
    solution = np.zeros(columns.shape[1])
    solution[kept] = cho_solve(factor, scaled.T @ target, check_finite=False) / length[kept]
    return solution[:size], solution[size:].reshape(2, -1)


def _slopes(found: Residuals, signals: Signals, weights: FloatArray) -> list[FloatArray]:
    """Return the derivative of the weighted signals by alpha and q of each stretch, shape (n, 2, 2)."""
    slopes = [np.empty((len(state), 2, 2)) for state in found.states]
    for variable, step in enumerate(_STEP * np.eye(2)):
        moved = attached_signals(found.forms, [state + step for state in found.states], found.beside, found.states)
        for slope, one, other in zip(slopes, signals, moved, strict=True):
            slope[:, :, variable] = (other - one) @ weights.T / _STEP
    return slopes


def _stretch(
    weak: WeakForm, sides: Sides, path: FloatArray, added: FloatArray, slope: FloatArray
) -> tuple[FloatArray, ...]:
    """Return the blocks of one stretch: measured, drive, transition, squares of the rates, fresh."""
    interval, samples = weak.stretch.interval_s, _samples(weak)
    mean, half_jump = sides.mean.rates + added, 0.5 * sides.jump.rates
    # How far the path is from a solution, from its start to each sample, by the trapezoidal rule.
    rise = 0.5 * interval * (mean[:-1] + half_jump[:-1] + mean[1:] - half_jump[1:])
    astray = np.concatenate([np.zeros((1, 2)), np.cumsum(np.diff(path, axis=0) - rise, axis=0)])
    measured = _blocks(weak.stretch.measured - path, samples)
    drive = -np.diff(_blocks(astray, samples), axis=0, append=np.zeros((1, 2)))
    jacobian = _blocks(sides.mean.jacobian + slope, samples)
    between = 0.5 * (jacobian + np.concatenate([jacobian[1:], jacobian[-1:]]))
    step = samples * interval
    transition = np.eye(2) + step * between + 0.5 * step**2 * between @ between
    around = max(1, round(_ACTIVITY_S / step))
    squares = uniform_filter1d(_blocks(mean, samples) ** 2, around, axis=0, mode="nearest")
    fresh = np.zeros(len(measured))
    fresh[0] = 1.0
    return measured, drive, transition, squares, fresh


def _samples(weak: WeakForm) -> int:
    return max(1, round(_BLOCK_S / weak.stretch.interval_s))


def _blocks(values: FloatArray, samples: int) -> FloatArray:
    """Return means over whole blocks of samples."""
    count = len(values) // samples
    means: FloatArray = values[: count * samples].reshape(count, samples, *values.shape[1:]).mean(axis=1)
    return means
