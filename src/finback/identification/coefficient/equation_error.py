"""Equation error: least squares on the equations of motion, weighted by test functions.

Where accelerometers are, the forces are theirs; elsewhere they come from dV/dt and dα/dt, as the moment does from
dq/dt, in weak form: -∫ w' x dt = ∫ w dx/dt dt, so no signal is differentiated (Klein & Morelli 2006, chapter 5). The
regressors hold the noise of the measured states, and residuals of neighboring test functions hang together: what both
do to the numbers and their errors is found afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import RefusedError
from finback.identification.bounded import solve_within
from finback.identification.coefficient.form import ALPHA_RATE
from finback.identification.coefficient.options import CoefficientOptions
from finback.identification.coefficient.track import STATES, Track
from finback.identification.coefficient.weak_equations import Equations, equations
from finback.identification.estimate import Estimate

_FEWEST_PASSES: Final = 4
"""Of weighing the three equations by their residuals: after the second, few move by 1e-3 of an error."""
_MOST_PASSES: Final = 30
"""Then the estimate is said not to have converged."""
_CONVERGED: Final = 1e-3
"""Of the last change, in standard errors."""


def equation_error(
    used: Sequence[Track], options: CoefficientOptions, least_noise: FloatArray
) -> tuple[Estimate, list[Equations]]:
    """Fit all stretches together.

    Args:
        used: the data.
        options: form, airframe and test functions.
        least_noise: of the outputs, in SI; those of V, α and q are believed of rates over a half width.

    Returns:
        The estimate, its residuals those of the equations along, across and in pitch, each in units of its own root
        mean square, its covariance that of such residuals if they were white; and the equations of every stretch.

    Raises:
        RefusedError: the data hold nothing of a number, or cannot tell some apart but for rounding.
    """
    form = options.form
    numbers = form.known
    pieces, rows, target = _stacked(used, options, numbers)
    if target.size < form.free.size:
        raise RefusedError(
            f"{target.size} weak equations are too few for {form.free.size} numbers", hint="fly more, or ask for less"
        )
    least = _least(used, options, least_noise, np.abs(target).max(axis=0))
    weight = np.abs(target).max(axis=0) + least
    every = np.arange(form.size)
    late = any(ALPHA_RATE in term.variables for term in form.pitching)
    converged, step, missed = False, 0, target
    while step < _FEWEST_PASSES or (not converged and step < _MOST_PASSES):
        if step and late:  # dα/dt in Cm is that of the numbers found so far
            pieces, rows, target = _stacked(used, options, numbers)
        if step:
            weight = np.maximum(np.sqrt((missed**2).mean(axis=0)), least)
        scaled = (rows / weight[:, np.newaxis]).reshape(-1, form.size)
        solution = solve_within(scaled, (target / weight).ravel(), form, numbers, every, judged=False)
        change = np.abs(solution.coefficients - numbers)
        numbers, missed = solution.coefficients, target - rows @ solution.coefficients
        converged = bool((change <= _CONVERGED * np.sqrt(np.diag(solution.covariance))).all())
        step += 1
    # As a first estimate for others it is judged here; else by the noise that is found afterwards.
    judged = options.method.of_likelihood
    solution = solve_within(scaled, (target / weight).ravel(), form, numbers, every, judged=judged)
    ends = np.cumsum([len(piece.target) for piece in pieces])[:-1]
    extras = np.zeros((len(used), len(used[0].outputs) + 2))
    found = Estimate(
        coefficients=solution.coefficients,
        covariance=solution.covariance,
        variance=solution.variance,
        residuals=tuple(np.split(missed / weight, ends)),
        states=tuple(track.states for track in used),
        condition_number=solution.condition_number,
        iterations=step,
        converged=converged,
        noise=frozen_array(weight),
        influence=tuple(np.split(rows / weight[:, np.newaxis], ends)),
        extras=frozen_array(extras),
        extra_errors=frozen_array(extras),
    )
    return found, pieces


def _stacked(
    used: Sequence[Track], options: CoefficientOptions, numbers: FloatArray
) -> tuple[list[Equations], FloatArray, FloatArray]:
    """Return the equations of all stretches, their regressors (K, 3, p) and targets (K, 3)."""
    pieces = [equations(track, options, numbers) for track in used]
    return pieces, np.concatenate([piece.rows for piece in pieces]), np.concatenate([piece.target for piece in pieces])


def _least(used: Sequence[Track], options: CoefficientOptions, least_noise: FloatArray, size: FloatArray) -> FloatArray:
    """Return the least residual of each equation that is believed, in m/s², m/s² (or rad/s) and rad/s²."""
    outputs = used[0].outputs
    least = []
    for force, state, largest in zip(("ax_m_s2", "az_m_s2", ""), (STATES[0], STATES[1], STATES[3]), size, strict=True):
        if force in outputs:
            least.append(least_noise[outputs.index(force)])
        elif state in outputs:
            least.append(least_noise[outputs.index(state)] / options.half_width_s)
        else:
            least.append(np.finfo(np.float64).eps * largest)
    return np.maximum(least, np.finfo(np.float64).tiny)
