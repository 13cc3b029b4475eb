"""Equation error: least squares on the equations of motion, weighted by test functions.

Where accelerometers are, the forces are theirs; elsewhere they come from dV/dt and dα/dt, as the moment does from
dq/dt, in weak form: -∫ w' x dt = ∫ w dx/dt dt, so no signal is differentiated (Klein & Morelli 2006, chapter 5). The
regressors hold the noise of the measured states, which biases the result a little; residuals of neighboring test
functions hang together, which the errors allow for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import RefusedError
from finback.identification.bounded import solve_within
from finback.identification.coefficient.averages import TestFunctions, functions_of
from finback.identification.coefficient.doubts import roundings
from finback.identification.coefficient.form import ALPHA_RATE
from finback.identification.coefficient.motion import RATES, Motion, layout, motion
from finback.identification.coefficient.options import CoefficientOptions
from finback.identification.coefficient.track import STATES, Track
from finback.identification.collinearity import Solution
from finback.identification.estimate import Estimate
from finback.identification.noise import noise_deviation

_FEWEST_PASSES: Final = 4
"""Of weighing the three equations by their residuals: after the second, few move by 1e-3 of an error."""
_MOST_PASSES: Final = 30
"""Then the estimate is said not to have converged."""
_CONVERGED: Final = 1e-3
"""Of the last change, in standard errors."""


def equation_error(
    used: Sequence[Track], options: CoefficientOptions, least_noise: FloatArray
) -> tuple[Estimate, FloatArray]:
    """Fit all stretches together.

    Args:
        used: the data.
        options: form, airframe and test functions.
        least_noise: of the outputs, in SI; those of V, α and q are believed of rates over a half width.

    Returns:
        The estimate, its residuals those of the equations along, across and in pitch, each in units of its own root
        mean square; and the covariance that the noise of the outputs gives, shape (p, p).

    Raises:
        InputError: the samples are too coarse for the test functions.
        RefusedError: the data cannot determine every number.
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
    solution = solve_within(scaled, (target / weight).ravel(), form, numbers, every, judged=True)
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
    return found, _noise_covariance(used, pieces, options, solution, weight)


def _stacked(
    used: Sequence[Track], options: CoefficientOptions, numbers: FloatArray
) -> tuple[list[_Equations], FloatArray, FloatArray]:
    """Return the equations of all stretches, their regressors (K, 3, p) and targets (K, 3)."""
    pieces = [_equations(track, options, numbers) for track in used]
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


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Equations:
    """The weak equations of one stretch, along, across and in pitch: weighted means under K test functions.

    Attributes:
        rows: regressors, shape (K, 3, p).
        target: what they must explain, shape (K, 3).
        functions: the test functions.
        places: of each equation, the place of its rate or force among the rates.
        left: of each equation, the output whose noise is in its target; -1 if it is not measured.
    """

    rows: FloatArray
    target: FloatArray
    functions: TestFunctions
    places: tuple[int, int, int]
    left: tuple[int, int, int]


def _equations(track: Track, options: CoefficientOptions, numbers: FloatArray) -> _Equations:
    functions = functions_of(track, options)
    at_samples, through = _sides(track, options, numbers)
    rows, targets, places, lefts = [], [], [], []
    for force, state in (("ax_m_s2", 0), ("az_m_s2", 1), ("", 3)):
        if force in track.outputs:
            place, output = ("ax_m_s2", "az_m_s2").index(force) + RATES - 2, track.outputs.index(force)
            row, known = functions.mean(at_samples[0][:, place]), functions.mean(at_samples[1][:, place])
            left = functions.mean(track.measured[:, output])
        else:
            place, output = state, track.outputs.index(STATES[state]) if STATES[state] in track.outputs else -1
            row, known = (
                _through(functions, middle[:, place], jump[:, place], track.interval_s)
                for middle, jump in zip(through[:2], through[2:], strict=True)
            )
            left = functions.rate(track.states[:, state])
        rows.append(row)
        targets.append(left - known)
        places.append(place)
        lefts.append(output)
    return _Equations(
        rows=np.stack(rows, axis=1),
        target=np.stack(targets, axis=1),
        functions=functions,
        places=(places[0], places[1], places[2]),
        left=(lefts[0], lefts[1], lefts[2]),
    )


def _through(functions: TestFunctions, middle: FloatArray, jump: FloatArray, interval_s: float) -> FloatArray:
    """Average what jumps at samples; the trapezoidal rule misses interval²/12 of every jump of a slope.

    A test function's slope comes multiplied by the interval.
    """
    whole = functions.mean(middle)
    return whole - interval_s / 12.0 * functions.rate(jump) if jump.any() else whole


def _sides(
    track: Track, options: CoefficientOptions, numbers: FloatArray
) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Return how rates depend on the numbers (n, 6, p) and what is known of them (n, 6), at the measured states.

    First at the samples, after what jumps there. Then as integrals see them: the mean of both sides of a jump, the same
    for what is known, and both jumps. An input that goes straight has corners at samples; a second difference of it
    stands for what the trapezoidal rule misses at these.
    """
    terms = layout(options.form, options.airframe, options.reference_speed_m_s)

    def at(inputs: FloatArray) -> Motion:
        found = motion(terms, numbers, track.states, inputs, track.density_kg_m3, track.thrust_n, track.gravity_m_s2)
        return replace(found, rates=found.rates - found.direct @ numbers)

    corners = np.zeros_like(track.inputs)
    corners[1:-1] = np.diff(track.inputs, n=2, axis=0) / 12.0
    corners[:, track.held] = 0.0
    here, after, before = at(track.inputs), at(track.inputs + corners), at(track.inputs_before + corners)
    return (here.direct, here.rates), (
        0.5 * (after.direct + before.direct),
        0.5 * (after.rates + before.rates),
        after.direct - before.direct,
        after.rates - before.rates,
    )


def _noise_covariance(
    used: Sequence[Track], pieces: Sequence[_Equations], options: CoefficientOptions, fit: Solution, weight: FloatArray
) -> FloatArray:
    """Return the covariance that white noise of the outputs gives the numbers, to first order, shape (p, p).

    The noise is that which the records themselves show; it is in the targets, and in the states that the regressors are
    taken at.
    """
    outputs = used[0].outputs
    deviations = [
        max(noise_deviation([track.measured[:, k] for track in used]), level.deviation)
        for k, level in enumerate(roundings(used))
    ]
    terms = layout(options.form, options.airframe, options.reference_speed_m_s)
    middle = np.zeros((options.form.size, options.form.size))
    for track, piece in zip(used, pieces, strict=True):
        slopes = motion(
            terms,
            fit.coefficients,
            track.states,
            track.inputs,
            track.density_kg_m3,
            track.thrust_n,
            track.gravity_m_s2,
        ).jacobian
        gain = np.zeros((len(outputs), len(track), options.form.size))
        for equation, (place, left) in enumerate(zip(piece.places, piece.left, strict=True)):
            scaled = piece.rows[:, equation] / weight[equation] ** 2
            spread = piece.functions.spread(scaled)
            if left >= 0:
                direct = place >= RATES - 2
                gain[left] += spread if direct else piece.functions.spread_rate(scaled)
            for k, name in enumerate(outputs):
                if name in STATES:
                    gain[k] -= slopes[:, place, STATES.index(name), np.newaxis] * spread
        for k, deviation in enumerate(deviations):
            middle += deviation**2 * gain[k].T @ gain[k]
    covariance: FloatArray = fit.covariance @ middle @ fit.covariance
    return covariance
