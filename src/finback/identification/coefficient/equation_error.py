"""Equation error: least squares on the equations of motion, weighted by test functions.

Where accelerometers are, the forces are theirs; elsewhere they come from dV/dt and dα/dt, as the moment does from
dq/dt, in weak form: -∫ w' x dt = ∫ w dx/dt dt, so no signal is differentiated (Klein & Morelli 2006, chapter 5). The
regressors hold the noise of the measured states, which biases the result a little; residuals of neighboring test
functions hang together, which the errors allow for.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError, RefusedError
from finback.identification.bounded import solve_within
from finback.identification.bump import bump
from finback.identification.coefficient.motion import RATES, layout, motion
from finback.identification.coefficient.options import CoefficientOptions
from finback.identification.coefficient.track import STATES, Track
from finback.identification.estimate import Estimate
from finback.identification.stretch import half_width_samples

_PASSES: Final = 4
"""Of weighing the three equations by their residuals: after the second, no number moves by 1e-3 of its error."""
_FEWEST: Final = 3
"""Sample intervals of a half width."""


def equation_error(used: Sequence[Track], options: CoefficientOptions, least_noise: FloatArray) -> Estimate:
    """Fit all stretches together.

    Args:
        used: the data.
        options: form, airframe and test functions.
        least_noise: of the outputs, in SI; those of V, α and q are believed of rates over a half width.

    Returns:
        The estimate; its residuals are those of the equations along, across and in pitch, each in units of its own
        root mean square.

    Raises:
        InputError: the samples are too coarse for the test functions.
        RefusedError: the data cannot determine every number.
    """
    form = options.form
    pieces = [_equations(track, options) for track in used]
    rows = np.concatenate([piece[0] for piece in pieces])
    target = np.concatenate([piece[1] for piece in pieces])
    if target.size < form.free.size:
        raise RefusedError(
            f"{target.size} weak equations are too few for {form.free.size} numbers", hint="fly more, or ask for less"
        )
    least = _least(used, options, least_noise, np.abs(target).max(axis=0))
    numbers, weight = form.known, np.abs(target).max(axis=0) + least
    every = np.arange(form.size)
    for step in range(_PASSES):
        scaled = (rows / weight[:, np.newaxis]).reshape(-1, form.size)
        last = step + 1 == _PASSES
        solution = solve_within(scaled, (target / weight).ravel(), form, numbers, every, judged=last)
        missed = target - rows @ solution.coefficients
        if not last:
            weight = np.maximum(np.sqrt((missed**2).mean(axis=0)), least)
    ends = np.cumsum([len(piece[1]) for piece in pieces])[:-1]
    extras = np.zeros((len(used), len(used[0].outputs) + 2))
    return Estimate(
        coefficients=solution.coefficients,
        covariance=solution.covariance,
        variance=solution.variance,
        residuals=tuple(np.split(missed / weight, ends)),
        states=tuple(track.states for track in used),
        condition_number=solution.condition_number,
        iterations=_PASSES,
        converged=True,
        noise=frozen_array(weight),
        influence=tuple(np.split(rows / weight[:, np.newaxis], ends)),
        extras=frozen_array(extras),
        extra_errors=frozen_array(extras),
    )


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


def _equations(track: Track, options: CoefficientOptions) -> tuple[FloatArray, FloatArray]:
    """Return regressors (K, 3, p) and targets (K, 3) of one stretch: along, across, pitch."""
    reach = half_width_samples(options.half_width_s, track.interval_s)
    if reach < _FEWEST:
        raise InputError(
            f"flight '{track.flight}': half_width_s {options.half_width_s:g} s spans {reach} sample intervals of "
            f"{track.interval_s:.6g} s, expected at least {_FEWEST}",
            hint=f"raise half_width_s to {_FEWEST * track.interval_s:.3g} s or sample faster",
        )
    weights = bump(reach, track.interval_s, track.hold)
    starts = np.arange(0, len(track) - 2 * reach, max(1, round(options.spacing_s / track.interval_s)))
    known, direct = _sides(track, options)

    def integral(signal: FloatArray, weight: FloatArray) -> FloatArray:
        windows = sliding_window_view(signal, weight.size, axis=0)[starts]
        found: FloatArray = windows @ weight
        return found

    area = float(weights.value.sum())
    rows, targets = [], []
    for force, state, rate in (("ax_m_s2", 0, 0), ("az_m_s2", 1, 1), ("", 3, 3)):
        if force in track.outputs:
            place = RATES - 2 + ("ax_m_s2", "az_m_s2").index(force)
            at = 0  # a measured force is that after a jump
            left = integral(track.column(force), weights.value)
        else:
            place, at = rate, 1  # an integral over a jump sees the mean of both sides
            left = -integral(track.states[:, state], weights.slope)
        rows.append(integral(direct[at][:, place], weights.value) / area)
        targets.append((left - integral(known[at][:, place], weights.value)) / area)
    return np.stack(rows, axis=1), np.stack(targets, axis=1)


def _sides(track: Track, options: CoefficientOptions) -> tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]]:
    """Return what is known of the rates (n, 6), and their derivative by the numbers (n, 6, p), at the measured states.

    Each after what jumps at a sample, and as the mean of both sides.
    """
    terms = layout(options.form, options.airframe, options.reference_speed_m_s)
    zero = np.zeros(options.form.size)
    sides = [
        motion(terms, zero, track.states, inputs, track.density_kg_m3, track.thrust_n, track.gravity_m_s2)
        for inputs in ((track.inputs, track.inputs_before) if track.held.any() else (track.inputs,))
    ]
    rates = (sides[0].rates, 0.5 * (sides[0].rates + sides[-1].rates))
    return rates, (sides[0].direct, 0.5 * (sides[0].direct + sides[-1].direct))
