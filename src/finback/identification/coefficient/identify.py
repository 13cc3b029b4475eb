"""From flights to a model in coefficient form, with covariance and what a reader of it must know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.lienard import NORMAL_95
from finback.errors import InputError, RefusedError
from finback.identification.coefficient.averages import least_half_width_s
from finback.identification.coefficient.doubts import beyond_noise, rounded_outputs, roundings
from finback.identification.coefficient.equation_error import equation_error
from finback.identification.coefficient.filter_error import filter_error, late_directions
from finback.identification.coefficient.late import late_elevator, of_fitted
from finback.identification.coefficient.model import CoefficientModel
from finback.identification.coefficient.noise_effects import noise_effects
from finback.identification.coefficient.options import CoefficientMethod, CoefficientOptions
from finback.identification.coefficient.output_error import fitted_stretches, output_error
from finback.identification.coefficient.plausible import check_channels, check_motion
from finback.identification.coefficient.thrust import mean_thrust_n, unsteady_thrust
from finback.identification.coefficient.track import OUTPUTS, Track, common_outputs, tracks
from finback.identification.coefficient.turbulence import process_noise, turbulence
from finback.identification.coefficient.weak_equations import Equations
from finback.identification.coloring import Coloring, coloring
from finback.identification.estimate import Estimate
from finback.identification.suspicions.lift import lift_hysteresis
from finback.records import Sweep
from finback.units import from_si, to_si

_RESOLUTION: Final = 1e-3
"""Share of a channel's standard deviation below which not noise but the model's form limits what a fit can know."""
_ROUNDING: Final = 1e-9
_LEVEL_RAD: Final = to_si(10.0, "deg")
"""Bank that takes 1.5 % off the normal part of gravity, as much as a usual scale error of an accelerometer."""
_HALF_WIDTH_S: Final = next(one.default for one in fields(CoefficientOptions) if one.name == "half_width_s")
"""Nobody asked for it."""
_STILL: Final = 1e-50
"""Stands for the noise of a channel that does not move, so that nothing divides by zero."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TrackBiases:
    """What was estimated of one stretch beside its start; 0 where it was not.

    Attributes:
        flight: the record's name.
        start_s: time of the stretch's first sample, in s.
        end_s: time of its last sample, in s.
        samples: how many it has.
        names: what the biases are called.
        values: in SI, shape (outputs + 2,).
        errors: their standard errors.
    """

    flight: str
    start_s: float
    end_s: float
    samples: int
    names: tuple[str, ...]
    values: FloatArray
    errors: FloatArray


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CoefficientIdentification:
    """A fitted model in coefficient form and what it rests on.

    Attributes:
        model: numbers, covariance, domain; the thrust of its airframe is the mean of the flights.
        options: what was asked for.
        residual_names: what the residuals are of: outputs, or for equation error the three equations.
        residual_rms: root mean square of each, in SI.
        whiteness: probability that white residuals are as correlated as these (Ljung and Box 1978), of each.
        coloring: how much larger the color of the residuals makes standard errors (median); 1 if they are white.
        condition_number: of the whitened regressors with columns scaled to length 1.
        iterations: of the estimate.
        converged: whether the last one moved nothing by more than 1e-3 standard errors.
        stretches: what was used of each flight, with biases and delay.
        unused: flights of which nothing was used.
        warnings: what a reader of the numbers must know; empty if nothing.
        process: spectral densities of the process noise on dV/dt in m²/s³, dα/dt in rad²/s and dq/dt in rad²/s³, shape
            (3,), by filter error; 0 otherwise.
        cramer_rao_errors: one standard error per number as most published tables state it, for white noise: neither
            widened nor corrected, shape (p,); empty in files of older versions.
    """

    model: CoefficientModel
    options: CoefficientOptions
    residual_names: tuple[str, ...]
    residual_rms: FloatArray
    whiteness: tuple[float, ...]
    coloring: float
    condition_number: float
    iterations: int
    converged: bool
    stretches: tuple[TrackBiases, ...]
    unused: tuple[str, ...]
    warnings: tuple[str, ...]
    process: FloatArray = field(default_factory=lambda: frozen_array(np.zeros(3)))
    cramer_rao_errors: FloatArray = field(default_factory=lambda: frozen_array(np.empty(0)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Judged:
    """An estimate with the covariance that can be believed.

    Attributes:
        fit: the estimate.
        color: what its residuals say.
        covariance: of the numbers, shape (p, p).
        bound: their plain Cramér-Rao errors, shape (p,).
        doubts: what a reader must know of it.
    """

    fit: Estimate
    color: Coloring
    covariance: FloatArray
    bound: FloatArray
    doubts: tuple[str, ...]


def identify_coefficients(sweep: Sweep, options: CoefficientOptions) -> CoefficientIdentification:
    """Fit the numbers of CX, CZ (or CD, CL) and Cm to all flights of a sweep together.

    Airspeed, and with it dynamic pressure, move as they did. Used are time, airspeed, alpha, q, the elevator and its
    hold, the pitch angle, accelerations and further inputs where the records hold them, density or altitude, thrust.
    Standard errors are Cramér-Rao bounds, corrected where residuals are not white (Morelli & Klein 1997).

    Args:
        sweep: the flights.
        options: form, airframe, method.

    Raises:
        InputError: a record lacks a column, is not uniform in time or sampled too coarsely.
        RefusedError: no flight can be used, or the data cannot determine every number; the reason is named.
    """
    outputs = tuple(name for name in OUTPUTS if name in options.outputs) or common_outputs(sweep.records)
    expected = options.biases.of(outputs)
    _check_flights(sweep, options)
    _check(options, biased=bool(expected.deviations.any()))
    shortest = max(options.minimum_duration_s, 2.0 * options.half_width_s)
    found = {
        record.name: tracks(
            record, options.airframe_of(record.name), outputs=outputs, inputs=options.form.inputs, shortest_s=shortest
        )
        for record in sweep.records
    }
    used = [track for pieces in found.values() for track in pieces]
    reason = f"no {shortest:g} s without a gap in which every channel has a number"
    if not used:
        raise RefusedError(f"none of the {len(found)} flights of '{sweep.study}' can be used: {reason}")
    check_channels(sweep.records, used)
    wider = _wider(options, used)
    options = replace(options, half_width_s=max(options.half_width_s, least_half_width_s(used)))
    least = _least_noise(used)
    judged = _judged(used, options, least)
    fit, color, covariance = judged.fit, judged.color, judged.covariance
    model = CoefficientModel(
        form=options.form,
        airframe=replace(options.airframe, thrust_n=mean_thrust_n(used)),
        reference_speed_m_s=options.reference_speed_m_s,
        numbers=fit.coefficients,
        covariance=covariance,
        domain=_domain(used, options),
    )
    return CoefficientIdentification(
        model=model,
        options=options,
        residual_names=outputs if options.method.of_likelihood else ("along", "across", "pitch"),
        residual_rms=fit.noise,
        whiteness=color.probability,
        coloring=color.factor,
        condition_number=fit.condition_number,
        iterations=fit.iterations,
        converged=fit.converged,
        cramer_rao_errors=judged.bound,
        process=fit.process if options.method is CoefficientMethod.FILTER_ERROR else frozen_array(np.zeros(3)),
        stretches=tuple(
            TrackBiases(
                flight=track.flight,
                start_s=track.start_s,
                end_s=track.end_s,
                samples=len(track),
                names=expected.names,
                values=frozen_array(values),
                errors=frozen_array(errors),
            )
            for track, values, errors in zip(used, fit.extras, fit.extra_errors, strict=True)
        ),
        unused=tuple(f"{name}: {reason}" for name, pieces in found.items() if not pieces),
        warnings=(
            *_banked(sweep),
            *unsteady_thrust(model, used),
            *rounded_outputs(used),
            *wider,
            *judged.doubts,
            *(finding.statement for finding in lift_hysteresis(sweep.records) if finding.raised),
            *_warnings(fit, color, covariance, options),
        ),
    )


def _check_flights(sweep: Sweep, options: CoefficientOptions) -> None:
    """Raise InputError where an airframe is that of a flight that is not there."""
    there = [record.name for record in sweep.records]
    lost = [one.flight for one in options.flights if one.flight not in there]
    if lost:
        raise InputError(f"there is no flight {', '.join(lost)}", hint=f"flights are {', '.join(there)}")


def _check(options: CoefficientOptions, *, biased: bool) -> None:
    """Raise InputError where a method is asked for what it does not do."""
    if biased and not options.method.of_likelihood:
        raise InputError(
            "biases are estimated by output error and filter error only",
            hint="choose method output-error or filter-error, or no biases",
        )
    if options.noise_correlated and options.method is CoefficientMethod.FILTER_ERROR:
        raise InputError(
            "filter error takes the noise of the outputs for independent", hint="leave noise_correlated out"
        )


def _judged(used: Sequence[Track], options: CoefficientOptions, least: FloatArray) -> _Judged:
    """Fit, and judge what of the errors can be believed."""
    if not options.method.of_likelihood:
        return _of_equations(used, options, *equation_error(used, options, least))
    check_motion(used)
    begun, _ = equation_error(used, options, least)
    estimator = output_error if options.method is CoefficientMethod.OUTPUT_ERROR else filter_error
    fit = estimator(used, options, begun, least)
    color = coloring(fit.covariance, fit.influence, fit.residuals, widening=max(1.0, fit.variance))
    if options.method is CoefficientMethod.FILTER_ERROR:
        late = _late(used, options, fit, least)
        doubts = (*late, *process_noise(used, options, fit, least))
        return _Judged(fit=fit, color=color, covariance=color.covariance, bound=_plain(fit), doubts=doubts)
    doubts = beyond_noise(used, fit.noise, least)
    covariance = color.covariance
    # Below the least noise that is believed, residuals are what the form and the integration leave.
    if (fit.noise > least * (1.0 + _ROUNDING)).any():
        stretches = fitted_stretches(used, options, begun, fit)
        late = late_elevator(used, options, fit, of_fitted(fit, stretches), coloring=color.factor)
        found = turbulence(used, options, begun, fit, least, stretches=stretches)
        doubts = (*found.unjudged, *doubts)
        for air in found.turbulence:
            covariance = _no_less(covariance, air.widened(fit.coefficients))
            doubts = (*air.statements(fit.coefficients), *doubts)
            # Gusts feign a late elevator in the residuals of output error: asked are those that allow for them.
            late = _late(used, options, air.found, least)
        doubts = (*late, *doubts)
    return _Judged(fit=fit, color=color, covariance=covariance, bound=_plain(fit), doubts=doubts)


def _late(used: Sequence[Track], options: CoefficientOptions, fit: Estimate, least: FloatArray) -> tuple[str, ...]:
    """Say how late the elevator is, by an estimate of filter error."""
    color = coloring(fit.covariance, fit.influence, fit.residuals, widening=max(1.0, fit.variance))
    return late_elevator(used, options, fit, late_directions(used, options, fit, least), coloring=color.factor)


def _plain(fit: Estimate) -> FloatArray:
    """Return the errors that white noise makes by itself, shape (p,)."""
    return frozen_array(np.sqrt(np.diag(fit.covariance)))


def _of_equations(
    used: Sequence[Track], options: CoefficientOptions, fit: Estimate, pieces: Sequence[Equations]
) -> _Judged:
    """Judge an estimate by the equations of motion."""
    color = coloring(fit.covariance, fit.influence, fit.residuals, widening=max(1.0, fit.variance))
    noise = noise_effects(used, options, fit, pieces)
    return _Judged(fit=noise.fit, color=color, covariance=noise.covariance, bound=_plain(fit), doubts=noise.doubts)


def _wider(options: CoefficientOptions, used: Sequence[Track]) -> tuple[str, ...]:
    """Say that test functions reach further than was asked for."""
    asked, least = options.half_width_s, least_half_width_s(used)
    if options.method is not CoefficientMethod.EQUATION_ERROR or asked >= least or asked == _HALF_WIDTH_S:
        return ()
    return (f"half_width_s is {least:.3g}, not {asked:.3g}: test functions reach over five sample intervals at least",)


def _banked(sweep: Sweep) -> tuple[str, ...]:
    """Name the flights that are not flown with wings level, as the equations take them to be."""
    banked = {record.name: float(np.nanmax(np.abs(record.or_zero("phi_rad")))) for record in sweep.records}
    far = {name: bank for name, bank in banked.items() if bank > _LEVEL_RAD}
    if not far:
        return ()
    worst = max(far, key=far.__getitem__)
    most = f"'{worst}' up to {from_si(far[worst], 'deg'):.0f} deg"
    return (f"the equations take wings for level: {len(far)} of {len(banked)} flights bank, {most}",)


def _least_noise(used: Sequence[Track]) -> FloatArray:
    """Return the least noise of each output that is believed, in SI, shape (outputs,)."""
    spread = np.concatenate([track.measured - track.measured.mean(axis=0) for track in used])
    least: FloatArray = np.maximum(_RESOLUTION * np.sqrt((spread**2).mean(axis=0)), _STILL)
    return np.maximum(least, [level.deviation for level in roundings(used)])


def _domain(used: Sequence[Track], options: CoefficientOptions) -> FloatArray:
    """Return the box of the variables that the data cover, shape (v, 2)."""
    columns = []
    for track in used:
        speed, alpha, _, q = track.states.T
        half = 0.5 * options.airframe.chord_m * q
        reference = options.reference_speed_m_s
        rate = 0.5 * options.airframe.chord_m * np.gradient(alpha, track.interval_s) / speed
        moving = [alpha, half / speed, half / reference, speed / reference, rate]
        columns.append(np.column_stack([*moving, track.inputs]))
    every = np.concatenate(columns)
    return np.stack([every.min(axis=0), every.max(axis=0)], axis=1)


def _no_less(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the first covariance, every standard error raised to that of the second where it is smaller."""
    one, two = np.sqrt(np.diag(first)), np.sqrt(np.maximum(np.diag(second), 0.0))
    lift = np.maximum(1.0, two / np.where(one > 0.0, one, 1.0))
    raised: FloatArray = np.where(np.outer(one, one) > 0.0, first * np.outer(lift, lift), second)
    return raised


def _warnings(fit: Estimate, color: Coloring, covariance: FloatArray, options: CoefficientOptions) -> tuple[str, ...]:
    found = []
    if color.colored and options.method.of_likelihood:
        found.append(
            "residuals are not white (Ljung and Box, 20 lags): the model or its noise is not what the fit takes it "
            f"for; standard errors are corrected for this, by a factor of {color.factor:.3g} (median)"
        )
    if not fit.converged:
        found.append(f"the estimate still moved after {fit.iterations} iterations: do not trust its last digits")
    errors = np.sqrt(np.diag(covariance))
    weak = (np.abs(fit.coefficients) < NORMAL_95 * errors) & (errors > 0)
    if weak.any():
        found.append(f"not told from zero (95 %): {', '.join(np.array(options.form.labels())[weak].tolist())}")
    low, high = options.form.bounds.T
    stuck = np.isfinite(fit.coefficients) & ((fit.coefficients <= low) | (fit.coefficients >= high))
    if stuck.any():
        found.append(f"at their bound: {', '.join(np.array(options.form.labels())[stuck].tolist())}")
    return tuple(found)
