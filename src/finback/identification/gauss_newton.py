"""Maximum likelihood by Gauss-Newton steps, for any model whose prediction can be linearized stretch by stretch.

The noise of the outputs is white; its covariance is estimated from the residuals at each step (Maine & Iliff 1985, NASA
RP 1138; Jategaonkar 2006, chapter 4). Unknowns that belong to one stretch alone (its starts, biases, a delay) are
eliminated stretch by stretch, so that the cost is linear in the flights.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import RefusedError
from finback.identification.bounded import Coefficients, solve_within
from finback.identification.chain import Guess, Linearization, moved
from finback.identification.collinearity import Solution
from finback.identification.elimination import Elimination, Expected, eliminate, influence
from finback.identification.estimate import Estimate

_MOST_ITERATIONS: Final = 30
_CONVERGED: Final = 1e-3
"""Of a step in standard errors, and of a jump at a node in standard deviations of the noise."""
_HALVINGS: Final = 10
_SLACK: Final = 0.01
"""A step may raise the merit (twice a log-likelihood) by this, which is nothing beside 1, a standard error."""
_DESCENT: Final = 0.5
"""Of what a step lowers the jumps, how much of it the merit must fall by to first order (Nocedal and Wright 2006,
eq. 18.36, where it is rho)."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """What is fitted.

    Attributes:
        flights: name of each stretch's flight.
        predictions: of each stretch, its linearization at coefficients (p,) and a guess.
        form: names, bounds and which of the coefficients are known.
        expected: what is known beforehand of the extras of every stretch.
        least_noise: least standard deviations of the outputs that are believed, in SI, shape (outputs,).
        correlated: whether noise of different outputs may be correlated; else its covariance is diagonal.
        judged: also refuse coefficients that noise, and not only rounding, leaves undetermined.
        begun_by: what gave the first estimate, as it is named where that is of no use.
    """

    flights: tuple[str, ...]
    predictions: tuple[Callable[[FloatArray, Guess], Linearization], ...]
    form: Coefficients
    expected: Expected
    least_noise: FloatArray
    correlated: bool
    judged: bool
    begun_by: str


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Point:
    """Where the iteration stands: coefficients and guesses, and the linearization there."""

    coefficients: FloatArray
    guesses: tuple[Guess, ...]
    found: tuple[Linearization, ...]


def fitted(problem: Problem, coefficients: FloatArray, guesses: Sequence[Guess]) -> Estimate:
    """Fit all stretches together.

    Args:
        problem: what is fitted.
        coefficients: where the iteration begins, in SI, shape (p,).
        guesses: the same for each stretch.

    Returns:
        The estimate; its residuals are measured less predicted, whitened by the noise found.

    Raises:
        RefusedError: the data cannot determine every coefficient, or the first estimate is of no use.
    """
    point = _at(problem, coefficients, tuple(guesses))
    if not _finite(point):
        raise RefusedError(
            f"the model of {problem.begun_by} leaves the range of double precision within a second",
            hint="fly more maneuvers, or ask for fewer terms: the data say too little for a first estimate",
        )
    converged, iteration, weight = False, 0, 0.0
    while not converged and iteration < _MOST_ITERATIONS:
        iteration += 1
        white = _whitening(problem, point)
        reduced = _reduced(problem, point, white)
        solution = _solve(problem, reduced, point, judged=False)
        change = solution.coefficients - point.coefficients
        step = tuple(item.local(change) for item in reduced)
        weight = max(weight, _jump_weight(point, change, step, white))
        share, point = _line_search(problem, point, change, step, _Merit(white=white, jump_weight=weight))
        jumps = max(float(np.abs(item.jumps @ white.T).max(initial=0.0)) for item in point.found)
        small = (np.abs(change) <= _CONVERGED * np.sqrt(np.diag(solution.covariance))).all()
        converged = share == 1.0 and bool(small) and jumps <= _CONVERGED
        if share == 0.0:
            break
    return _result(problem, point, iteration, converged=converged)


def _at(problem: Problem, coefficients: FloatArray, guesses: tuple[Guess, ...]) -> _Point:
    with np.errstate(over="ignore", invalid="ignore"):  # a step too long makes inf and nan: the line search shortens it
        found = tuple(
            predicted(coefficients, guess) for predicted, guess in zip(problem.predictions, guesses, strict=True)
        )
    return _Point(coefficients=coefficients, guesses=guesses, found=found)


def _finite(point: _Point) -> bool:
    return all(np.isfinite(item.derivative).all() and np.isfinite(item.residual).all() for item in point.found)


def _whitening(problem: Problem, point: _Point) -> FloatArray:
    """Return the inverse Cholesky factor of the noise covariance, estimated from the residuals: (outputs, outputs).

    The residuals are those of the pieces as they are: with the jumps closed, an unstable model would be far off. What
    is estimated takes its freedom from all outputs alike: without that, the noise and the standard errors of short
    records come out too small.
    """
    residuals = np.concatenate([item.open_residual for item in point.found])
    noise = residuals.T @ residuals / max(len(residuals) - _unknown(problem, point) / residuals.shape[1], 1.0)
    found = np.sqrt(np.diag(noise))
    raised = np.maximum(found, problem.least_noise)
    # A channel that is given more noise than it has keeps no correlation.
    believed = found >= problem.least_noise
    paired = np.outer(believed, believed) & problem.correlated
    correlation = np.where(paired, noise / np.where(paired, np.outer(found, found), 1.0), 0.0)
    np.fill_diagonal(correlation, 1.0)
    factor = np.linalg.cholesky(np.outer(raised, raised) * correlation)
    inverse: FloatArray = np.linalg.inv(factor)
    return inverse


def _unknown(problem: Problem, point: _Point) -> int:
    """Count everything that is estimated: coefficients, and starts and extras of every stretch."""
    left_out = int((problem.expected.deviations == 0.0).sum())
    own = sum(int(item.derivative.shape[2]) - problem.form.size - left_out for item in point.found)
    return int(problem.form.free.size) + own


def _reduced(problem: Problem, point: _Point, white: FloatArray) -> tuple[Elimination, ...]:
    return tuple(
        eliminate(found, guess.extras, white, problem.expected, problem.form.size, flight)
        for found, guess, flight in zip(point.found, point.guesses, problem.flights, strict=True)
    )


def _solve(problem: Problem, reduced: Sequence[Elimination], point: _Point, *, judged: bool) -> Solution:
    """Solve for the coefficients that the linearized residuals of all stretches ask for."""
    coefficients, equations = point.coefficients, sum(item.residual.size for item in point.found)
    rows = np.concatenate([item.rows for item in reduced])
    target = np.concatenate([item.rest for item in reduced]) + rows @ coefficients
    every = np.arange(problem.form.size)
    # What no coefficient explains stands in one row of each stretch; it is the residual of all its equations.
    folded = max(equations - target.size, 0)
    return solve_within(rows, target, problem.form, coefficients, every, judged=judged, folded=folded)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Merit:
    """How a merit is taken.

    Attributes:
        white: what makes the noise of the outputs white with variance 1, shape (outputs, outputs).
        jump_weight: of the sum of the jumps' sizes, in 1 / (a standard deviation of the noise).
    """

    white: FloatArray
    jump_weight: float

    def of(self, problem: Problem, point: _Point) -> float:
        """Return what a step must lower, in units of the noise: squares of residuals, of extras and of jumps at nodes.

        A jump counts as if every sample of its piece missed by it. As squares forget small jumps, which the estimate
        could profit from, their sizes count too (an exact penalty).
        """
        total = 0.0
        deviations = problem.expected.deviations
        known = (deviations > 0.0) & np.isfinite(deviations)
        for found, guess in zip(point.found, point.guesses, strict=True):
            squares, sizes = _jumps(found, guess, self.white)
            total += float(((found.open_residual @ self.white.T) ** 2).sum()) + squares + self.jump_weight * sizes
            total += float(((guess.extras[known] / deviations[known]) ** 2).sum())
        return total if np.isfinite(total) else np.inf


def _jumps(found: Linearization, guess: Guess, white: FloatArray) -> tuple[float, float]:
    """Return the squares of the jumps, as many times as a piece has samples, and the sum of their sizes."""
    jumps = found.jumps @ white.T
    return len(found.residual) / len(guess.nodes) * float((jumps**2).sum()), float(np.abs(jumps).sum())


def _jump_weight(point: _Point, change: FloatArray, step: Sequence[FloatArray], white: FloatArray) -> float:
    """Return which weight of the jumps' sizes lets the merit fall along a step (Nocedal and Wright 2006, eq. 18.36).

    A full step closes the jumps to first order, which may raise the squares of residuals.
    """
    raised, sizes = 0.0, 0.0
    for found, guess, local in zip(point.found, point.guesses, step, strict=True):
        left = found.residual - found.derivative @ np.concatenate([local, change])
        squares, size = _jumps(found, guess, white)
        raised += float(((left @ white.T) ** 2).sum() - ((found.open_residual @ white.T) ** 2).sum()) - squares
        sizes += size
    return max(raised, 0.0) / (_DESCENT * sizes) if sizes > 0.0 else 0.0


def _line_search(
    problem: Problem, point: _Point, change: FloatArray, step: tuple[FloatArray, ...], merit: _Merit
) -> tuple[float, _Point]:
    """Halve a step until it lowers the merit; return the share taken (0: none) and where it leads.

    A full step is also tried with the jumps closed that its own curvature opens (second-order correction): else good
    steps near the solution would be cut for them (Maratos 1978).
    """
    most = merit.of(problem, point) + _SLACK
    share = 1.0
    for _ in range(_HALVINGS):
        guesses = tuple(
            moved(guess, found, local, change, share)
            for guess, found, local in zip(point.guesses, point.found, step, strict=True)
        )
        tried = _at(problem, point.coefficients + share * change, guesses)
        if _finite(tried) and merit.of(problem, tried) <= most:
            return share, tried
        if share == 1.0 and _finite(tried):
            tried = _at(problem, tried.coefficients, tuple(map(_closed, tried.guesses, tried.found, step)))
            if _finite(tried) and merit.of(problem, tried) <= most:
                return share, tried
        share *= 0.5
    return 0.0, point


def _closed(guess: Guess, found: Linearization, local: FloatArray) -> Guess:
    """Close the jumps to first order, with every unknown as it is."""
    none = np.zeros(found.derivative.shape[2])
    return moved(guess, found, none[: local.size], none[local.size :], 1.0)


def _result(problem: Problem, point: _Point, iterations: int, *, converged: bool) -> Estimate:
    white = _whitening(problem, point)
    reduced = _reduced(problem, point, white)
    solution = _solve(problem, reduced, point, judged=problem.judged)
    residuals = tuple(item.residual @ white.T for item in point.found)
    count = sum(rows.size for rows in residuals)
    squares = sum(float((rows**2).sum()) for rows in residuals)
    factor = np.linalg.inv(white)
    extras = problem.expected.deviations.size
    return Estimate(
        coefficients=point.coefficients,
        covariance=solution.covariance,
        variance=squares / max(count - _unknown(problem, point), 1),
        residuals=residuals,
        states=tuple(item.states for item in point.found),
        condition_number=solution.condition_number,
        iterations=iterations,
        converged=converged,
        noise=frozen_array(np.sqrt((factor**2).sum(axis=1))),
        influence=tuple(influence(found, white, item) for found, item in zip(point.found, reduced, strict=True)),
        extras=frozen_array([guess.extras for guess in point.guesses]),
        extra_errors=frozen_array(
            [item.local_errors(solution.covariance)[item.wanted.size - extras :] for item in reduced]
        ),
    )
