"""Filter error: the coefficients under which the innovations of a Kalman filter are most likely.

Output error takes all that the model does not say for noise of the sensors. In turbulence, or with a model that misses
something, the motion itself is disturbed. Here both are estimated: white noise on dα/dt and dq/dt, and white noise on
alpha and q (Jategaonkar 2006, chapter 5; Maine & Iliff 1981, SIAM J. Appl. Math. 41(3)). Gauss-Newton steps for the
coefficients, and scoring steps for the logarithms of the four densities, take turns. The derivative of the innovations
is that for the filter's gains as they are: innovations of the past say nothing of those to come, so what is left out
moves no estimate on average. Where the air is calm the process noise goes to nothing, and the result to that of output
error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.identification.bounded import solve_within
from finback.identification.collinearity import Solution
from finback.identification.correction import corrected
from finback.identification.elimination import Elimination, project
from finback.identification.estimate import Estimate
from finback.identification.field import layout
from finback.identification.innovations import Innovations, innovations
from finback.identification.model_form import ModelForm
from finback.identification.nuisance import Nuisances
from finback.identification.stretch import Stretch

_TURNS: Final = 40
_CONVERGED: Final = 1e-2
"""In standard errors, from one turn to the next."""
_GAIN: Final = 1e-2
"""Twice a log-likelihood: densities that promise less stay."""
_DIFFERENCE: Final = 1e-3
"""Step of the differences, of the logarithm of a density."""
_LONGEST: Final = 3.0
"""Step of the logarithm of a density."""
_LEAST_PROCESS: Final = 1e-12
"""Of the variance that the sensor noise gives a rate over a second: less is no process noise."""
_HALVINGS: Final = 8


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Point:
    """Where the iteration stands.

    Attributes:
        coefficients: shape (p,).
        densities: logarithms of the densities of the process and the variances of the sensors, shape (4,).
        extras: biases and delay of each stretch, shape (stretches, 4).
    """

    coefficients: FloatArray
    densities: FloatArray
    extras: FloatArray


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Problem:
    """What is fitted.

    Attributes:
        used: the data.
        form: the model's form.
        nuisances: what is estimated for each stretch.
    """

    used: tuple[Stretch, ...]
    form: ModelForm
    nuisances: Nuisances

    def filtered(self, point: _Point, *, derived: bool = False) -> tuple[Innovations, ...]:
        """Filter all stretches."""
        values = np.exp(point.densities)
        with np.errstate(all="ignore"):  # a filter that diverges is infinitely unlikely
            return tuple(
                innovations(
                    corrected(piece, extras),
                    layout(self.form),
                    point.coefficients,
                    process=values[:2],
                    noise=values[2:],
                    derived=derived,
                )
                for piece, extras in zip(self.used, point.extras, strict=True)
            )

    def cost(self, point: _Point) -> float:
        """Return twice the negative logarithm of the likelihood, but for a constant; inf where the filter diverged."""
        total = sum(
            float((_whitened(item, item.values) ** 2).sum()) + item.log_determinant for item in self.filtered(point)
        )
        deviations = self.nuisances.deviations
        known = (deviations > 0.0) & np.isfinite(deviations)
        total += float(((point.extras[:, known] / deviations[known]) ** 2).sum())
        return total if np.isfinite(total) else np.inf

    def eliminated(self, point: _Point) -> tuple[tuple[Innovations, ...], tuple[Elimination, ...]]:
        """Return the innovations, and their linearization with the extras of each stretch eliminated."""
        found = self.filtered(point, derived=True)
        size = self.form.size
        parts = []
        for item, extras, piece in zip(found, point.extras, self.used, strict=True):
            columns = np.concatenate([item.sensitivity[:, :, size:], item.sensitivity[:, :, :size]], axis=2)
            rows = _whitened(item, np.concatenate([columns, item.values[:, :, np.newaxis]], axis=2))
            parts.append(project(rows.reshape(-1, size + 5), extras, self.nuisances, piece.flight))
        return found, tuple(parts)

    def solve(self, parts: Sequence[Elimination], point: _Point, *, judged: bool) -> Solution:
        """Solve for the coefficients that the linearized innovations ask for."""
        rows = np.concatenate([part.rows for part in parts])
        target = np.concatenate([part.rest for part in parts]) + rows @ point.coefficients
        every = np.arange(self.form.size)
        return solve_within(rows, target, self.form, point.coefficients, every, judged=judged)


def filter_error(
    used: Sequence[Stretch],
    form: ModelForm,
    start: Estimate,
    *,
    noise: FloatArray,
    least_noise: FloatArray,
    nuisances: Nuisances,
) -> Estimate:
    """Fit all stretches together.

    Args:
        used: the data.
        form: the model's form.
        start: the estimate of the weak form.
        noise: standard deviations of alpha in rad and q in rad/s measured on the records, shape (2,), both > 0.
        least_noise: the least of them that is believed, shape (2,).
        nuisances: biases and a delay that are estimated for each stretch.

    Returns:
        The estimate; its residuals are whitened innovations, its states filtered.

    Raises:
        RefusedError: the data cannot determine every coefficient.
    """
    problem = _Problem(used=tuple(used), form=form, nuisances=nuisances)
    floor = np.log(np.concatenate([_LEAST_PROCESS * noise**2, least_noise**2]))
    point = _Point(
        coefficients=start.coefficients,
        # Half of the noise's variance over a second as a first guess of the process.
        densities=np.maximum(np.log(np.concatenate([0.5 * noise**2, noise**2])), floor),
        extras=np.array(start.extras),
    )
    converged, turn = False, 0
    while not converged and turn < _TURNS:
        turn += 1
        before = point
        point, promised = _more_likely_densities(problem, point, floor)
        _, parts = problem.eliminated(point)
        solution = problem.solve(parts, point, judged=False)
        point = _stepped(problem, point, solution, parts)
        moved = np.abs(point.coefficients - before.coefficients)
        small = (moved <= _CONVERGED * np.sqrt(np.diag(solution.covariance))).all()
        converged = bool(small) and promised <= _GAIN
    return _result(problem, point, turn, converged=converged)


def _result(problem: _Problem, point: _Point, turns: int, *, converged: bool) -> Estimate:
    found, parts = problem.eliminated(point)
    solution = problem.solve(parts, point, judged=True)
    residuals = tuple(_whitened(item, item.values) for item in found)
    squares = sum(float((item**2).sum()) for item in residuals)
    unknown = problem.form.free.size + len(parts) * int((problem.nuisances.deviations > 0.0).sum())
    return Estimate(
        coefficients=point.coefficients,
        covariance=solution.covariance,
        variance=squares / max(sum(item.size for item in residuals) - unknown, 1),
        residuals=residuals,
        states=tuple(item.states for item in found),
        condition_number=solution.condition_number,
        iterations=turns,
        converged=converged,
        noise=frozen_array(np.exp(0.5 * point.densities[2:])),
        influence=tuple(
            part.rows[: item.size].reshape(-1, 2, problem.form.size)
            for part, item in zip(parts, residuals, strict=True)
        ),
        extras=frozen_array(point.extras),
        extra_errors=frozen_array(np.stack([part.local_errors(solution.covariance) for part in parts])),
        process=frozen_array(np.exp(point.densities[:2])),
    )


def _whitened(found: Innovations, values: FloatArray) -> FloatArray:
    """Return the values (n - 1, 2, …) in units in which the innovations are white with variance 1."""
    white = found.white
    result = np.empty(values.shape)
    beside = values.ndim - 2
    first, second = values[:, 0], values[:, 1]
    shape = (-1, *[1] * beside)
    result[:, 0] = white[:, 0, 0].reshape(shape) * first
    result[:, 1] = white[:, 1, 0].reshape(shape) * first + white[:, 1, 1].reshape(shape) * second
    return result


def _more_likely_densities(problem: _Problem, point: _Point, floor: FloatArray) -> tuple[_Point, float]:
    """Take a scoring step of the logarithms of the densities; also return what it promised."""
    here = problem.filtered(point)
    gradient, information = np.zeros(4), np.zeros((4, 4))
    inverse = [np.linalg.inv(item.white) for item in here]
    changes: list[list[tuple[FloatArray, FloatArray]]] = [[] for _ in here]
    for step in _DIFFERENCE * np.eye(4):
        index = int(np.argmax(step))
        ahead = problem.filtered(replace(point, densities=point.densities + step))
        behind = problem.filtered(replace(point, densities=point.densities - step))
        for mine, one, two, item, back in zip(changes, ahead, behind, here, inverse, strict=True):
            gradient[index] += (_cost(one) - _cost(two)) / (2.0 * _DIFFERENCE)
            turned = (one.white - two.white) / (2.0 * _DIFFERENCE) @ back
            mine.append((-turned - turned.transpose(0, 2, 1), _whitened(item, one.values - two.values)))
    for mine in changes:
        for i, (spread, value) in enumerate(mine):
            for j, (other_spread, other_value) in enumerate(mine):
                # tr(S⁻¹ dS S⁻¹ dS) + 2 dνᵀ S⁻¹ dν: the expectation of the second derivative.
                information[i, j] += float((spread * other_spread).sum())
                information[i, j] += float((value * other_value).sum()) / (2.0 * _DIFFERENCE**2)
    free = (point.densities > floor) | (gradient < 0.0)
    step = np.zeros(4)
    damped = information[np.ix_(free, free)]
    step[free] = -np.linalg.solve(damped + 1e-6 * np.trace(damped) * np.eye(len(damped)), gradient[free])
    step = np.maximum(point.densities + np.clip(step, -_LONGEST, _LONGEST), floor) - point.densities
    promised = float(-0.5 * gradient @ step)
    return _shortened(problem, point, replace(point, densities=point.densities + step)), promised


def _cost(item: Innovations) -> float:
    return float((_whitened(item, item.values) ** 2).sum()) + item.log_determinant


def _stepped(problem: _Problem, point: _Point, solution: Solution, parts: Sequence[Elimination]) -> _Point:
    """Move coefficients and extras as far as the innovations get more likely."""
    change = solution.coefficients - point.coefficients
    local = np.stack([part.local(change) for part in parts])
    after = replace(point, coefficients=solution.coefficients, extras=point.extras + local)
    return _shortened(problem, point, after)


def _shortened(problem: _Problem, before: _Point, after: _Point) -> _Point:
    """Halve a step until the innovations are more likely; stay if none makes them so."""
    least, share = problem.cost(before), 1.0
    for _ in range(_HALVINGS):
        tried = replace(
            before,
            coefficients=before.coefficients + share * (after.coefficients - before.coefficients),
            densities=before.densities + share * (after.densities - before.densities),
            extras=before.extras + share * (after.extras - before.extras),
        )
        if problem.cost(tried) <= least + _GAIN:
            return tried
        share *= 0.5
    return before
