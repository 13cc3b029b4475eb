"""Generalized least squares on the weak form, with the noise covariance of the estimate itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import RefusedError
from finback.identification.collinearity import Solution, solve
from finback.identification.form import Form
from finback.identification.smoothing import smooth
from finback.identification.weak_form import WeakForm
from finback.identification.whitening import whitening

_MOST_ITERATIONS: Final = 12
_CONVERGED: Final = 1e-3
"""In standard errors: far below anything that an interval can show."""
_MEMORY: Final = 2.5
"""How long the smoother trusts the model, in half widths; between 1.25 and 5 no error changes by 1 %."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """The coefficients that explain the weak equations best.

    Attributes:
        coefficients: shape (p,), in SI.
        covariance: shape (p, p), for noise of the standard deviations that were given.
        variance: mean square of all whitened residuals, freedom counted.
        residuals: whitened residuals of each stretch, shape (K, 2), columns (dα/dt, dq/dt).
        states: smoothed (alpha, q) of each stretch, shape (n, 2).
        condition_number: of the whitened regressors with columns scaled to length 1.
        iterations: passes that were made.
        converged: whether the last pass moved every coefficient by less than 1e-3 standard errors.
    """

    coefficients: FloatArray
    covariance: FloatArray
    variance: float
    residuals: tuple[FloatArray, ...]
    states: tuple[FloatArray, ...]
    condition_number: float
    iterations: int
    converged: bool


def estimate(forms: Sequence[WeakForm], form: Form, noise: FloatArray, *, half_width_s: float) -> Estimate:
    """Fit both equations of all stretches together.

    Each pass smooths the states with the last model, takes the regressors at the smoothed states, linearizes the
    measured left and right sides about them, and solves by generalized least squares with the covariance that the
    noise then has. At convergence the estimate is close to that of maximum likelihood under the weak constraints, but
    not equal to it: the smoother trusts the model for a finite time only.

    Args:
        forms: the weak equations of every stretch.
        form: the model's form.
        noise: standard deviations of alpha in rad and q in rad/s, shape (2,), both > 0.
        half_width_s: half width of the test functions in s.

    Raises:
        RefusedError: the data cannot determine every coefficient.
    """
    equations = 2 * sum(weak.starts.size for weak in forms)
    if equations < 2 * form.size:
        raise RefusedError(
            f"{equations} weak equations are too few for {form.size} coefficients",
            hint="fly longer or more maneuvers, or lower alpha_order",
        )
    states = [weak.stretch.measured for weak in forms]
    coefficients = _ordinary(forms, form, states)
    for iteration in range(1, _MOST_ITERATIONS + 1):
        solution = _weighted(forms, form, coefficients, states, noise)
        moved = np.abs(solution.coefficients - coefficients)
        coefficients = solution.coefficients
        deviations = np.sqrt(max(1.0, solution.variance) * np.diag(solution.covariance))
        converged = iteration > 1 and bool((moved <= _CONVERGED * deviations).all())
        if converged:
            break
        # A model that misses by s deviations of the noise is trusted s times shorter, so it cannot bend the states.
        memory = _MEMORY * half_width_s / np.sqrt(max(1.0, solution.variance))
        states = [
            smooth(weak.stretch, form, coefficients, noise=noise, memory_s=memory, start=state)
            for weak, state in zip(forms, states, strict=True)
        ]
    ends = np.cumsum([weak.starts.size for weak in forms])[:-1]
    return Estimate(
        coefficients=coefficients,
        covariance=solution.covariance,
        variance=solution.variance,
        residuals=tuple(np.split(solution.residual.reshape(-1, 2), ends)),
        states=tuple(states),
        condition_number=solution.condition_number,
        iterations=iteration,
        converged=converged,
    )


def _ordinary(forms: Sequence[WeakForm], form: Form, states: Sequence[FloatArray]) -> FloatArray:
    """Return the first estimate: every equation alike, regressors at the measured states."""
    regressors = _stack([weak.regressors(state) for weak, state in zip(forms, states, strict=True)], form)
    target = np.concatenate([weak.left.ravel() for weak in forms])
    return solve(regressors, target, form.labels(), judged=False).coefficients


def _weighted(
    forms: Sequence[WeakForm], form: Form, coefficients: FloatArray, states: Sequence[FloatArray], noise: FloatArray
) -> Solution:
    """Solve with the covariance at ``coefficients`` and ``states``."""
    white = whitening(forms, coefficients, states, noise)
    regressors = _stack([weak.regressors(state) for weak, state in zip(forms, states, strict=True)], form)
    target = np.concatenate(
        [weak.target(coefficients, state).ravel() for weak, state in zip(forms, states, strict=True)]
    )
    rows = white(np.column_stack([regressors, target]))
    return solve(rows[:, :-1], rows[:, -1], form.labels(), judged=True)


def _stack(regressors: Sequence[FloatArray], form: Form) -> FloatArray:
    """Lay the equations of all stretches under each other, (dα/dt, dq/dt) per test function."""
    return np.concatenate([rows.reshape(-1, form.size) for rows in regressors])
