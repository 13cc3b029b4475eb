"""Output error: the coefficients under which the measured alpha and q are most likely, for white noise on both.

Maximum likelihood with the noise covariance estimated (Maine & Iliff 1985, NASA RP 1138; Jategaonkar 2006, chapter 4):
Gauss-Newton steps on all stretches together, from the estimate of the weak form. Each stretch has its own start and,
if asked, biases and a delay; they are eliminated stretch by stretch, so that the cost is linear in the flights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import RefusedError
from finback.identification.bounded import solve_within
from finback.identification.collinearity import Solution
from finback.identification.elimination import Elimination, eliminate, influence
from finback.identification.estimate import Estimate
from finback.identification.maneuver import EXTRAS, Guess, Linearization, Maneuver, linearize, maneuver, moved
from finback.identification.model_form import ModelForm
from finback.identification.nuisance import Nuisances
from finback.identification.stretch import Stretch

_MOST_ITERATIONS: Final = 30
_CONVERGED: Final = 1e-3
"""Of a step in standard errors, and of a jump at a node in standard deviations of the noise."""
_HALVINGS: Final = 10
_SLACK: Final = 0.01
"""A step may raise the merit (twice a log-likelihood) by this: closing a jump at a node can cost as much."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Point:
    """Where the iteration stands: coefficients and guesses, and the linearization there."""

    coefficients: FloatArray
    guesses: tuple[Guess, ...]
    found: tuple[Linearization, ...]


def output_error(
    stretches: Sequence[Stretch],
    form: ModelForm,
    start: Estimate,
    *,
    least_noise: FloatArray,
    nuisances: Nuisances,
) -> Estimate:
    """Fit all stretches together.

    Args:
        stretches: the data.
        form: the model's form.
        start: the estimate of the weak form: coefficients and smoothed states.
        least_noise: the least standard deviations of alpha in rad and q in rad/s that are believed, shape (2,).
        nuisances: what is estimated for each stretch beside its start.

    Returns:
        The estimate; its residuals are measured less predicted, whitened by the noise found.

    Raises:
        RefusedError: the data cannot determine every coefficient, or the first estimate is of no use.
    """
    begun = [
        maneuver(*pair)
        for pair in ((s, form, start.coefficients, x) for s, x in zip(stretches, start.states, strict=True))
    ]
    maneuvers = tuple(item[0] for item in begun)
    point = _at(maneuvers, form, start.coefficients, tuple(item[1] for item in begun))
    if not _finite(point):
        raise RefusedError(
            "the model of the weak form leaves the range of double precision within a second",
            hint="fly more maneuvers, or ask for fewer terms: the data say too little for a first estimate",
        )
    converged, iteration = False, 0
    while not converged and iteration < _MOST_ITERATIONS:
        iteration += 1
        white = _whitening(point, least_noise)
        reduced = _reduced(maneuvers, point, white, nuisances)
        solution = _solve(reduced, form, point.coefficients, judged=False)
        change = solution.coefficients - point.coefficients
        step = tuple(item.local(change) for item in reduced)
        share, point = _line_search(maneuvers, form, point, change, step, white, nuisances)
        jumps = max(float(np.abs(item.jumps @ white.T).max(initial=0.0)) for item in point.found)
        small = (np.abs(change) <= _CONVERGED * np.sqrt(np.diag(solution.covariance))).all()
        converged = share == 1.0 and bool(small) and jumps <= _CONVERGED
        if share == 0.0:
            break
    return _result(maneuvers, form, point, least_noise, nuisances, iteration, converged=converged)


def _at(
    maneuvers: tuple[Maneuver, ...], form: ModelForm, coefficients: FloatArray, guesses: tuple[Guess, ...]
) -> _Point:
    with np.errstate(over="ignore", invalid="ignore"):  # a step too long makes inf and nan: the line search shortens it
        found = tuple(linearize(one, form, coefficients, guess) for one, guess in zip(maneuvers, guesses, strict=True))
    return _Point(coefficients=coefficients, guesses=guesses, found=found)


def _finite(point: _Point) -> bool:
    return all(np.isfinite(item.derivative).all() and np.isfinite(item.residual).all() for item in point.found)


def _whitening(point: _Point, least_noise: FloatArray) -> FloatArray:
    """Return the inverse Cholesky factor of the noise covariance, estimated from the residuals, shape (2, 2).

    The residuals are those of the pieces as they are: with the jumps closed, an unstable model would be far off.
    """
    residuals = np.concatenate([item.measured_less_states for item in point.found])
    noise = residuals.T @ residuals / len(residuals)
    found = np.sqrt(np.diag(noise))
    raised = np.maximum(found, least_noise)
    # A channel that is given more noise than it has keeps no correlation.
    correlation = noise[0, 1] / (found[0] * found[1]) if (found >= least_noise).all() else 0.0
    factor = np.linalg.cholesky(np.outer(raised, raised) * np.array([[1.0, correlation], [correlation, 1.0]]))
    inverse: FloatArray = np.linalg.inv(factor)
    return inverse


def _reduced(
    maneuvers: tuple[Maneuver, ...], point: _Point, white: FloatArray, nuisances: Nuisances
) -> tuple[Elimination, ...]:
    return tuple(
        eliminate(one, found, guess.extras, white, nuisances)
        for one, found, guess in zip(maneuvers, point.found, point.guesses, strict=True)
    )


def _solve(reduced: Sequence[Elimination], form: ModelForm, coefficients: FloatArray, *, judged: bool) -> Solution:
    """Solve for the coefficients that the linearized residuals of all stretches ask for."""
    rows = np.concatenate([item.rows for item in reduced])
    target = np.concatenate([item.rest for item in reduced]) + rows @ coefficients
    return solve_within(rows, target, form, coefficients, np.arange(form.size), judged=judged)


def _merit(point: _Point, white: FloatArray, nuisances: Nuisances) -> float:
    """Return what a step must lower: squares of residuals, of jumps at nodes and of extras, in units of the noise.

    A jump counts as if every sample of its piece missed by it.
    """
    total = 0.0
    deviations = nuisances.deviations
    known = (deviations > 0.0) & np.isfinite(deviations)
    for found, guess in zip(point.found, point.guesses, strict=True):
        missed = found.measured_less_states @ white.T
        jumps = found.jumps @ white.T
        total += float((missed**2).sum()) + len(missed) / len(guess.nodes) * float((jumps**2).sum())
        total += float(((guess.extras[known] / deviations[known]) ** 2).sum())
    return total if np.isfinite(total) else np.inf


def _line_search(  # noqa: PLR0913, PLR0917 - a point, a step in three parts and the weights of the merit
    maneuvers: tuple[Maneuver, ...],
    form: ModelForm,
    point: _Point,
    change: FloatArray,
    step: tuple[FloatArray, ...],
    white: FloatArray,
    nuisances: Nuisances,
) -> tuple[float, _Point]:
    """Halve a step until it lowers the merit; return the share taken (0: none) and where it leads."""
    before = _merit(point, white, nuisances)
    share = 1.0
    for _ in range(_HALVINGS):
        guesses = tuple(
            moved(guess, found, local, change, share)
            for guess, found, local in zip(point.guesses, point.found, step, strict=True)
        )
        tried = _at(maneuvers, form, point.coefficients + share * change, guesses)
        if _finite(tried) and _merit(tried, white, nuisances) <= before + _SLACK:
            return share, tried
        share *= 0.5
    return 0.0, point


def _result(  # noqa: PLR0913 - where the iteration ended, and what it was asked
    maneuvers: tuple[Maneuver, ...],
    form: ModelForm,
    point: _Point,
    least_noise: FloatArray,
    nuisances: Nuisances,
    iterations: int,
    *,
    converged: bool,
) -> Estimate:
    white = _whitening(point, least_noise)
    reduced = _reduced(maneuvers, point, white, nuisances)
    # The weak form has judged what the data determine, but for biases.
    solution = _solve(reduced, form, point.coefficients, judged=bool(nuisances.deviations.any()))
    residuals = tuple(item.residual @ white.T for item in point.found)
    count = sum(rows.size for rows in residuals)
    unknown = form.free.size + sum(int(item.wanted.sum()) for item in reduced)
    squares = sum(float((rows**2).sum()) for rows in residuals)
    factor = np.linalg.inv(white)
    return Estimate(
        coefficients=point.coefficients,
        covariance=solution.covariance,
        variance=squares / max(count - unknown, 1),
        residuals=residuals,
        states=tuple(item.states for item in point.found),
        condition_number=solution.condition_number,
        iterations=iterations,
        converged=converged,
        noise=frozen_array(np.sqrt((factor**2).sum(axis=1))),
        influence=tuple(
            influence(one, found, white, item) for one, found, item in zip(maneuvers, point.found, reduced, strict=True)
        ),
        extras=frozen_array([guess.extras for guess in point.guesses]),
        extra_errors=frozen_array([item.local_errors(solution.covariance)[-EXTRAS:] for item in reduced]),
    )
