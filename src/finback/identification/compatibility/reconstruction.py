"""The faults that make all pieces of flight agree best, by maximum likelihood with what is usual as prior knowledge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.identification.coloring import corrected_covariance
from finback.identification.compatibility.air import averaged, gusts
from finback.identification.compatibility.fault import Fault, Kind
from finback.identification.compatibility.flight_path import Disturbance
from finback.identification.compatibility.piece import START, Piece
from finback.identification.compatibility.problem import Guess, Problem, Rows

_STEPS: Final = 40
_CONVERGED: Final = 0.1  # standard errors
_NOISE_CHANGE: Final = 4.0  # of a variance in one step
_NEAR: Final = 0.5  # standard errors: close enough to ask anew how the air moves
_LINEAR: Final = 2.0  # standard errors in which the motion is linear: close enough to ask it first
_AT_LAST: Final = 8  # steps, after which it is asked anyway: gusts taken for noise lead nowhere
_STEADY: Final = 1.05  # of a variance from step to step
_GUST_STEPS: Final = 4  # how often the air's motion is estimated anew


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Reconstruction:
    """Faults of instruments with their covariance.

    Attributes:
        faults: what was estimated.
        values: in SI, shape (faults,).
        covariance: prior knowledge and colored residuals allowed for, shape (faults, faults).
        pieces: what was used.
        residuals: of each piece, measured less implied, NaN where nothing was compared, shape (n, outputs).
        disturbance: the noises of outputs, and the gusts, that were found; process noise is that of the first piece.
        converged: whether the step that is left is below two standard errors, to whose square it is added; mostly it
            is below a twentieth.
    """

    faults: tuple[Fault, ...]
    values: FloatArray
    covariance: FloatArray
    pieces: tuple[Piece, ...]
    residuals: tuple[FloatArray, ...]
    disturbance: Disturbance
    converged: bool


def reconstruct(pieces: Sequence[Piece], faults: tuple[Fault, ...], sizes: FloatArray) -> Reconstruction:
    """Estimate faults that all pieces share, and a start of each.

    Steps of Gauss and Newton on the innovations of a Kalman filter whose process noise is the noise of the inputs, as
    measured on them, and whose measurement noise is estimated: the filter form of flight-path reconstruction (Klein &
    Morelli 2006, section 10.3; Jategaonkar 2015, chapter 10). Each fault is held by its usual size. Where the
    likelihood asks for them, gusts of first order are part of the model.

    Args:
        pieces: all with the same outputs.
        faults: what to estimate.
        sizes: their usual sizes, > 0, shape (faults,).
    """
    problem = Problem(pieces, faults, sizes)
    at = Guess(values=np.zeros(len(faults)), starts=tuple(np.zeros(START) for _ in pieces))
    least = np.mean([piece.output_noise() for piece in pieces], axis=0)
    noises = Disturbance(process=pieces[0].process, noise=least)
    seen = problem.implied(at)
    asked_of_air, converged, length = 0, False, np.inf
    for count in range(_STEPS):
        rows = problem.rows(at, seen, noises)
        step, covariance = problem.step(rows, at.values)
        length = float((np.abs(step) / np.sqrt(np.diag(covariance))).max())
        before = at
        at, seen = problem.moved(at, seen, rows, step, noises, near=length < _LINEAR)
        # No part of the step helps: the slopes, which leave out the noise of the inputs, tell the minimum no closer.
        there = length < _CONVERGED or (at is before and length < _NEAR)
        noise = _renewed(noises.noise, least, rows)
        steady = bool((np.maximum(noise / noises.noise, noises.noise / noise) < _STEADY).all())
        noises = replace(noises, noise=noise)
        enough = length < _NEAR if asked_of_air else length < _LINEAR or count > _AT_LAST
        if problem.feels_gusts and asked_of_air < _GUST_STEPS and enough:
            asked_of_air += 1
            if noises.moves or problem.flow_is_colored(rows):
                noises = gusts(problem, at, seen, noises, least)
        elif steady and there:
            converged = True
            break
    rows = problem.rows(at, seen, noises)
    left, bound = problem.step(rows, at.values)
    converged |= float((np.abs(left) / np.sqrt(np.diag(bound))).max()) < _LINEAR
    color = corrected_covariance(bound, [item.influence for item in rows], [item.residual for item in rows])
    covariance = _bounded_below(bound, color + bound @ problem.held @ bound)
    if noises.moves:
        covariance = _bounded_below(covariance, averaged(problem, at, seen, noises))
    covariance = _bounded_below(covariance, _on_time(problem, at, noises)) + np.outer(left, left)
    return Reconstruction(
        faults=faults,
        values=at.values,
        covariance=covariance,
        pieces=tuple(pieces),
        residuals=problem.compared(at, seen),
        disturbance=noises,
        converged=converged,
    )


def _on_time(problem: Problem, at: Guess, noises: Disturbance) -> FloatArray:
    """Return the covariance for white innovations that the same flights would give without any delay.

    Two delays that can stand for each other make a valley with a flat bottom: what is known of them looks best where
    the estimate is farthest off, at its walls.
    """
    delays = np.array([fault.kind is Kind.DELAY for fault in problem.faults])
    there = replace(at, values=np.where(delays, 0.0, at.values))
    return problem.step(problem.rows(there, problem.implied(there), noises), there.values)[1]


def _renewed(noise: FloatArray, least: FloatArray, rows: Sequence[Rows]) -> FloatArray:
    """Return variances of the outputs' noise by which their innovations are as large as they should be."""
    count = np.sum([item.counts for item in rows], axis=0)
    squares = np.sum([item.squares for item in rows], axis=0)
    ratio = np.where(count > 0, squares / np.maximum(count, 1.0), 1.0)
    return np.asarray(np.maximum(noise * np.clip(ratio, 1.0 / _NOISE_CHANGE, _NOISE_CHANGE), least))


def _bounded_below(bound: FloatArray, found: FloatArray) -> FloatArray:
    """Return a covariance with no variance, of whatever combination, below that of the bound.

    Along the eigenvectors of one by the other each variance is taken from whichever says more.
    """
    root = np.linalg.cholesky(bound)
    inverse = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(0.5 * inverse @ (found + found.T) @ inverse.T)
    shape = root @ vectors
    return np.asarray((shape * np.maximum(values, 1.0)) @ shape.T)
