"""Generalized least squares on the weak form, with the noise covariance of the estimate itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field as dataclass_field
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.errors import RefusedError
from finback.identification.bounded import solve_within
from finback.identification.collinearity import Solution
from finback.identification.disturbance import BEYOND_NOISE, Disturbance, disturbance, memory
from finback.identification.elimination import Elimination, project
from finback.identification.model_form import ModelForm
from finback.identification.nuisance import NAMES, Nuisances
from finback.identification.smoothing import smooth
from finback.identification.weak_form import WeakForm
from finback.identification.whitening import whitening

_MOST_ITERATIONS: Final = 12
_CONVERGED: Final = 1e-3
"""In standard errors: far below anything that an interval can show."""


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
        noise: standard deviations of alpha in rad and q in rad/s that whitened, shape (2,).
        influence: of each stretch, how the coefficients move the whitened residuals, other unknowns taken out, shape
            (K, 2, p); a step of the coefficients is covariance · Σ influenceᵀ residual.
        extras: biases of alpha, q and the elevator, and its delay, of each stretch, in SI, shape (stretches, 4); 0
            where none was estimated.
        extra_errors: their standard errors.
        process: spectral densities of noise on dα/dt in rad²/s and dq/dt in rad²/s³, shape (2,); 0 for methods that
            know none.
    """

    coefficients: FloatArray
    covariance: FloatArray
    variance: float
    residuals: tuple[FloatArray, ...]
    states: tuple[FloatArray, ...]
    condition_number: float
    iterations: int
    converged: bool
    noise: FloatArray
    influence: tuple[FloatArray, ...]
    extras: FloatArray
    extra_errors: FloatArray
    process: FloatArray = dataclass_field(default_factory=lambda: frozen_array(np.zeros(2)))


def estimate(
    forms: Sequence[WeakForm],
    form: ModelForm,
    noise: FloatArray,
    *,
    half_width_s: float,
    nuisances: Nuisances | None = None,
) -> Estimate:
    """Fit both equations of all stretches together.

    Each pass smooths the states with the last model, takes the regressors at the smoothed states, linearizes the
    measured left and right sides about them, and solves by generalized least squares with the covariance that the
    noise then has. At convergence the estimate is close to that of maximum likelihood under the weak constraints, but
    not equal to it: the smoother trusts the model for a finite time only.

    Residuals more than twice as large as the sensors' noise are no noise of the sensors: they are then taken for white
    noise on dα/dt and dq/dt as well, of the densities that the residuals have. Residuals and covariance are given in
    units of the sensors' noise all the same.

    Args:
        forms: the weak equations of every stretch.
        form: the model's form.
        noise: standard deviations of alpha in rad and q in rad/s, shape (2,), both > 0.
        half_width_s: half width of the test functions in s.
        nuisances: biases and a delay that are estimated for each stretch; none if left out.

    Raises:
        RefusedError: the data cannot determine every coefficient.
    """
    equations = 2 * sum(weak.starts.size for weak in forms)
    if equations < 2 * form.free.size:
        raise RefusedError(
            f"{equations} weak equations are too few for {form.free.size} coefficients",
            hint="fly longer or more maneuvers, or lower the orders of alpha",
        )
    problem = _Problem(recorded=tuple(forms), form=form, noise=noise, nuisances=nuisances or Nuisances())
    try:
        return _iterated(problem, half_width_s, disturbable=True)
    except RefusedError:
        # Noise on the rates hides slow motions, which a fit to the sensors' noise alone may still tell apart.
        return _iterated(problem, half_width_s, disturbable=False)


def _iterated(problem: _Problem, half_width_s: float, *, disturbable: bool) -> Estimate:
    """Iterate; ``disturbable`` says whether residuals beyond the sensors' noise are taken for noise on the rates."""
    forms: Sequence[WeakForm] = problem.recorded
    form, noise = problem.form, problem.noise
    states = [weak.stretch.measured for weak in forms]
    coefficients = _ordinary(forms, form, states)
    extras = np.zeros((len(forms), len(NAMES)))
    rates, disturbed = Disturbance(), False
    for iteration in range(1, _MOST_ITERATIONS + 1):
        found = problem.weighted(forms, coefficients, states, extras, rates, judged=disturbed or not disturbable)
        # Where biases and a delay are unknown, the first residuals hold them.
        able = disturbable and not disturbed and (iteration > 1 or not problem.unknown)
        if able and found.solution.variance > BEYOND_NOISE:
            disturbed, rates = True, disturbance(forms, coefficients, states, noise)
            found = problem.weighted(forms, coefficients, states, extras, rates, judged=True)
        forms, extras, solution = found.forms, found.extras, found.solution
        moved = np.abs(solution.coefficients - coefficients)
        coefficients = solution.coefficients
        deviations = np.sqrt(max(1.0, solution.variance) * np.diag(solution.covariance))
        converged = iteration > 1 and bool((moved <= _CONVERGED * deviations).all())
        if converged:
            break
        if disturbed:
            rates = disturbance(forms, coefficients, states, noise)
        memory_s = memory(forms[0], noise, rates, half_width_s=half_width_s, variance=solution.variance)
        states = [
            smooth(weak.stretch, form, coefficients, noise=noise, memory_s=memory_s, start=state)
            for weak, state in zip(forms, states, strict=True)
        ]
    # In units of the sensors' noise again: residuals are as large as they are, and so are the coefficients' errors.
    ends, size = np.cumsum([weak.starts.size for weak in forms])[:-1], np.sqrt(found.rates.excess)
    return Estimate(
        coefficients=coefficients,
        covariance=solution.covariance / size**2,
        variance=solution.variance * size**2,
        residuals=tuple(np.split(size * found.residual.reshape(-1, 2), ends)),
        states=tuple(states),
        condition_number=solution.condition_number,
        iterations=iteration,
        converged=converged,
        noise=frozen_array(noise),
        influence=tuple(np.split(size * found.rows.reshape(-1, 2, form.size), ends)),
        extras=frozen_array(extras),
        extra_errors=frozen_array(found.extra_errors),
    )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Pass:
    """What one weighted solution found.

    Attributes:
        forms: the equations without the biases and delay that were found.
        solution: the coefficients.
        rows: whitened regressors, other unknowns taken out, shape (n, p).
        residual: whitened, shape (n,).
        extras: biases and delay of each stretch, shape (stretches, 4).
        extra_errors: their standard errors.
        rates: the noise on the rates that was allowed for.
    """

    forms: Sequence[WeakForm]
    solution: Solution
    rows: FloatArray
    residual: FloatArray
    extras: FloatArray
    extra_errors: FloatArray
    rates: Disturbance


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Problem:
    """What is fitted.

    Attributes:
        recorded: the weak equations of every stretch, as recorded.
        form: the model's form.
        noise: standard deviations of alpha in rad and q in rad/s, shape (2,).
        nuisances: biases and a delay that are estimated for each stretch.
    """

    recorded: tuple[WeakForm, ...]
    form: ModelForm
    noise: FloatArray
    nuisances: Nuisances

    @property
    def unknown(self) -> bool:
        """Whether biases or delays are estimated."""
        return bool(self.nuisances.deviations.any())

    def weighted(
        self,
        forms: Sequence[WeakForm],
        coefficients: FloatArray,
        states: Sequence[FloatArray],
        extras: FloatArray,
        rates: Disturbance,
        *,
        judged: bool,
    ) -> _Pass:
        """Solve with the covariance at ``coefficients`` and ``states``; biases and delays are eliminated.

        Args:
            forms: the weak equations without the present biases and delays.
            coefficients: where the form is linearized, shape (p,).
            states: likewise, shape (n, 2) each.
            extras: the present biases and delays, shape (stretches, 4).
            rates: the noise on the rates.
            judged: refuse what noise leaves undetermined, even where the residuals are beyond the sensors' noise.
        """
        form, densities = self.form, rates.densities
        rows, ends = _rows(forms, form, coefficients, states, self.noise, densities, extras=self.unknown)
        parts: list[Elimination] = []
        if self.unknown:
            parts = [
                project(mine, values, self.nuisances, weak.stretch.flight)
                for mine, values, weak in zip(np.split(rows, ends), extras, forms, strict=True)
            ]
            free = np.concatenate([np.column_stack([part.rows, part.rest]) for part in parts])
        else:
            free = rows
        every = np.arange(form.size)
        solution = solve_within(free[:, :-1], free[:, -1], form, coefficients, every, judged=judged)
        if not judged and solution.variance <= BEYOND_NOISE:
            solution = solve_within(free[:, :-1], free[:, -1], form, coefficients, every, judged=True)
        if not parts:
            return _Pass(
                forms=forms, solution=solution, rows=free[:, :-1], residual=solution.residual, extras=extras,
                extra_errors=extras, rates=rates,
            )  # fmt: skip
        extras = extras + np.stack([part.local(solution.coefficients) for part in parts])
        forms = [weak.corrected(values) for weak, values in zip(self.recorded, extras, strict=True)]
        ordered, residual = _in_order(parts, solution, forms)
        return _Pass(
            forms=forms, solution=solution, rows=ordered, residual=residual, extras=extras,
            extra_errors=np.stack([part.local_errors(solution.covariance) for part in parts]), rates=rates,
        )  # fmt: skip


def _ordinary(forms: Sequence[WeakForm], form: ModelForm, states: Sequence[FloatArray]) -> FloatArray:
    """Return the first estimate: every equation alike, regressors at the measured states."""
    every, split = np.arange(form.size), form.sizes[0]
    coefficients = form.known
    # Where dq/dt holds dα/dt, dα/dt must be known first.
    for columns in (every[:split], every[split:]) if form.implicit else (every,):
        sides = [weak.sides(coefficients, state) for weak, state in zip(forms, states, strict=True)]
        rows = [weak.regressors(side).reshape(-1, form.size) for weak, side in zip(forms, sides, strict=True)]
        target = np.concatenate([weak.left.ravel() for weak in forms])
        solution = solve_within(np.concatenate(rows), target, form, coefficients, columns, judged=False)
        coefficients = solution.coefficients
    return coefficients


def solve_parts(parts: Sequence[Elimination], form: ModelForm, coefficients: FloatArray) -> Solution:
    """Solve for the coefficients with the unknowns of all stretches eliminated."""
    stacked, target = np.concatenate([part.rows for part in parts]), np.concatenate([part.rest for part in parts])
    return solve_within(stacked, target, form, coefficients, np.arange(form.size), judged=True)


def _in_order(
    parts: Sequence[Elimination], solution: Solution, forms: Sequence[WeakForm]
) -> tuple[FloatArray, FloatArray]:
    """Return rows and residuals of the equations, without those of what is known of the extras beforehand."""
    counts = [2 * weak.starts.size for weak in forms]
    rows = [part.rows[:count] for part, count in zip(parts, counts, strict=True)]
    left = [
        part.rest[:count] - mine @ solution.coefficients for part, mine, count in zip(parts, rows, counts, strict=True)
    ]
    return np.concatenate(rows), np.concatenate(left)


def _rows(  # noqa: PLR0913 - where the equations are linearized, and their noise
    forms: Sequence[WeakForm],
    form: ModelForm,
    coefficients: FloatArray,
    states: Sequence[FloatArray],
    noise: FloatArray,
    densities: FloatArray,
    *,
    extras: bool,
) -> tuple[FloatArray, IntArray]:
    """Return the whitened columns of extras if asked for, regressors and target, and where the stretches end."""
    sides = [weak.sides(coefficients, state) for weak, state in zip(forms, states, strict=True)]
    white = whitening(forms, sides, noise, process=densities)
    regressors = np.concatenate(
        [weak.regressors(side).reshape(-1, form.size) for weak, side in zip(forms, sides, strict=True)]
    )
    target = np.concatenate(
        [weak.target(side, state).ravel() for weak, side, state in zip(forms, sides, states, strict=True)]
    )
    columns = [regressors, target]
    if extras:
        own = [weak.extras(side).reshape(-1, len(NAMES)) for weak, side in zip(forms, sides, strict=True)]
        columns.insert(0, np.concatenate(own))
    return white(np.column_stack(columns)), np.cumsum([2 * weak.starts.size for weak in forms])[:-1]
