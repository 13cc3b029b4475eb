"""Filter error: the coefficients under which the innovations of a Kalman filter are most likely.

Output error takes all that the model does not say for noise of the sensors. In turbulence, or with a model that misses
something, the motion itself is disturbed. Here both are estimated: white noise on dα/dt and dq/dt, and white noise on
alpha and q (Jategaonkar 2006, chapter 5; Maine & Iliff 1981, SIAM J. Appl. Math. 41(3)). Steps for the coefficients
(Gauss-Newton on the innovations, their derivative by differences) and for the four densities (simplex on the
likelihood) take turns. Where the air is calm the process noise goes to nothing, and the result to that of output error.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.optimize import minimize

from finback.arrays import FloatArray, frozen_array
from finback.identification.bounded import solve_within
from finback.identification.collinearity import Solution
from finback.identification.estimate import Estimate
from finback.identification.field import layout
from finback.identification.innovations import Innovations, innovations
from finback.identification.model_form import ModelForm
from finback.identification.nuisance import NAMES
from finback.identification.stretch import Stretch

_TURNS: Final = 12
_STEPS: Final = 3
"""Gauss-Newton steps in a turn."""
_CONVERGED: Final = 1e-2
"""In standard errors, from one turn to the next."""
_DIFFERENCE: Final = 1e-3
"""Step of the differences, in standard errors of the weak form: far above rounding, far below any curvature."""
_LEAST_PROCESS: Final = 1e-12
"""Of the variance that the sensor noise gives a rate over a second: less is no process noise."""
_HALVINGS: Final = 8


def filter_error(
    used: Sequence[Stretch], form: ModelForm, start: Estimate, *, noise: FloatArray, least_noise: FloatArray
) -> Estimate:
    """Fit all stretches together.

    Args:
        used: the data.
        form: the model's form.
        start: the estimate of the weak form.
        noise: standard deviations of alpha in rad and q in rad/s measured on the records, shape (2,), both > 0.
        least_noise: the least of them that is believed, shape (2,).

    Returns:
        The estimate; its residuals are whitened innovations, its states filtered.

    Raises:
        RefusedError: the data cannot determine every coefficient.
    """
    coefficients = start.coefficients
    scale = np.sqrt(np.diag(start.covariance))
    # Half of the noise's variance over a second as a first guess of the process.
    densities = np.log(np.concatenate([0.5 * noise**2, noise**2]))
    floor = np.log(np.concatenate([_LEAST_PROCESS * noise**2, least_noise**2]))
    converged, turn = False, 0
    while not converged and turn < _TURNS:
        turn += 1
        densities = _densities(used, form, coefficients, densities, floor)
        before = coefficients
        for _ in range(_STEPS):
            found = _filter_all(used, form, coefficients, densities)
            rows = _derivatives(used, form, coefficients, densities, found, scale)
            solution = _solve(rows, found, form, coefficients, judged=False)
            coefficients = _shortened(used, form, densities, coefficients, solution.coefficients)
        errors = np.sqrt(np.diag(solution.covariance))
        converged = bool((np.abs(coefficients - before) <= _CONVERGED * errors).all())
    found = _filter_all(used, form, coefficients, densities)
    rows = _derivatives(used, form, coefficients, densities, found, scale)
    solution = _solve(rows, found, form, coefficients, judged=True)
    residuals = tuple(_whitened(item, item.values) for item in found)
    squares = sum(float((item**2).sum()) for item in residuals)
    return Estimate(
        coefficients=coefficients,
        covariance=solution.covariance,
        variance=squares / max(sum(item.size for item in residuals) - form.free.size, 1),
        residuals=residuals,
        states=tuple(item.states for item in found),
        condition_number=solution.condition_number,
        iterations=turn,
        converged=converged,
        noise=frozen_array(np.exp(0.5 * densities[2:])),
        influence=rows,
        extras=frozen_array(np.zeros((len(used), len(NAMES)))),
        extra_errors=frozen_array(np.zeros((len(used), len(NAMES)))),
        process=frozen_array(np.exp(densities[:2])),
    )


def _filter_all(
    used: Sequence[Stretch], form: ModelForm, coefficients: FloatArray, densities: FloatArray
) -> tuple[Innovations, ...]:
    values = np.exp(densities)
    return tuple(innovations(piece, layout(form), coefficients, process=values[:2], noise=values[2:]) for piece in used)


def _whitened(found: Innovations, values: FloatArray) -> FloatArray:
    """Return the values (n - 1, 2, …) in units in which the innovations are white with variance 1."""
    white: FloatArray = np.einsum("nij,nj...->ni...", found.white, values)
    return white


def _likelihood(found: Sequence[Innovations]) -> float:
    """Return twice the negative logarithm of the likelihood, but for a constant; inf where the filter diverged."""
    total = sum(float((_whitened(item, item.values) ** 2).sum()) + item.log_determinant for item in found)
    return total if np.isfinite(total) else np.inf


def _densities(
    used: Sequence[Stretch], form: ModelForm, coefficients: FloatArray, densities: FloatArray, floor: FloatArray
) -> FloatArray:
    """Return the logarithms of process and sensor noise that are most likely, at these coefficients."""

    def cost(values: FloatArray) -> float:
        with np.errstate(all="ignore"):  # a filter that diverges is infinitely unlikely
            return _likelihood(_filter_all(used, form, coefficients, np.maximum(values, floor)))

    corners = np.vstack([densities, densities + np.eye(densities.size)])
    found = minimize(
        cost,
        densities,
        method="Nelder-Mead",
        options={"xatol": 0.1, "fatol": 0.1, "maxiter": 200, "initial_simplex": corners},
    )
    return np.maximum(np.asarray(found.x, dtype=np.float64), floor)


def _derivatives(
    used: Sequence[Stretch],
    form: ModelForm,
    coefficients: FloatArray,
    densities: FloatArray,
    found: Sequence[Innovations],
    scale: FloatArray,
) -> tuple[FloatArray, ...]:
    """Return how the coefficients move the predictions, whitened, of each stretch, shape (n - 1, 2, p)."""
    columns = [np.zeros((*item.values.shape, form.size)) for item in found]
    for index in form.free.tolist():
        step = _DIFFERENCE * scale[index] * np.eye(form.size)[index]
        ahead = _filter_all(used, form, coefficients + step, densities)
        behind = _filter_all(used, form, coefficients - step, densities)
        for column, one, two in zip(columns, ahead, behind, strict=True):
            column[:, :, index] = (two.values - one.values) / (2.0 * step[index])
    return tuple(_whitened(item, column) for item, column in zip(found, columns, strict=True))


def _solve(
    rows: Sequence[FloatArray], found: Sequence[Innovations], form: ModelForm, coefficients: FloatArray, *, judged: bool
) -> Solution:
    flat = np.concatenate([item.reshape(-1, form.size) for item in rows])
    residual = np.concatenate([_whitened(item, item.values).ravel() for item in found])
    target = residual + flat @ coefficients
    return solve_within(flat, target, form, coefficients, np.arange(form.size), judged=judged)


def _shortened(
    used: Sequence[Stretch], form: ModelForm, densities: FloatArray, before: FloatArray, after: FloatArray
) -> FloatArray:
    """Halve a step until the innovations are more likely; stay if none makes them so."""
    with np.errstate(all="ignore"):  # a filter that diverges is infinitely unlikely
        least, share = _likelihood(_filter_all(used, form, before, densities)), 1.0
        for _ in range(_HALVINGS):
            tried = before + share * (after - before)
            if _likelihood(_filter_all(used, form, tried, densities)) <= least:
                return tried
            share *= 0.5
    return before
