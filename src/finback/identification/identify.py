"""From a sweep to a polynomial model with covariance, domain and diagnostics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.model import PolynomialModel
from finback.errors import RefusedError
from finback.identification.estimate import Estimate, estimate
from finback.identification.form import Form
from finback.identification.noise import noise_deviation
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch, stretches
from finback.identification.weak_form import weak_form
from finback.records import Sweep

_NO_NOISE: Final = 1e-6
"""Of a signal's own size: integrals from samples are no better, so less noise than this is taken as this much."""
_STILL: Final = 1e-50
"""In rad and rad/s: stands for the noise of a signal that is zero throughout, so that nothing divides by zero."""
_SIGNIFICANT: Final = 5.0
"""Standard deviations by which the mean square residual must pass 1 before the covariance is widened."""
_INTERVAL_95: Final = 1.96
"""Standard errors to either side of a 95 % interval."""
_NO_ANGLE: Final = (
    "alpha leaves ±180 deg, so it is no angle in radians: the alpha window was not applied and every sample was "
    "fitted; look for degrees taken for radians"
)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A stretch of a flight that was used.

    Attributes:
        flight: the record's name.
        start_s: time of its first sample, in s.
        end_s: time of its last sample, in s.
        samples: how many samples it has.
    """

    flight: str
    start_s: float
    end_s: float
    samples: int


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnostics:
    """How well the data supported the fit. Pairs are for (dα/dt, dq/dt).

    Attributes:
        equations: number of weak equations of each kind.
        condition_number: of the whitened regressor with columns scaled to length 1; far above 30, some
            coefficients are known together much better than each alone (their covariance says how).
        chi_square: mean square of the whitened residuals; 1 if model and noise explain the data.
        lag1_correlation: correlation of neighboring whitened residuals; 0 if model and noise explain the data.
        used_fraction: share of all samples that was used.
        iterations: of the estimate with its own noise covariance.
    """

    equations: int
    condition_number: float
    chi_square: tuple[float, float]
    lag1_correlation: tuple[float, float]
    used_fraction: float
    iterations: int


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """An identified model and what it rests on.

    Attributes:
        model: the polynomials with covariance; the domain of each variable is the box of the data used, for alpha
            its intersection with the window.
        options: what was asked for.
        alpha_noise_rad: standard deviation of the noise of alpha, estimated from the records, in rad.
        q_noise_rad_s: the same for q, in rad/s.
        segments: what was used of each flight.
        unused: flights of which nothing was used, each with its reason.
        diagnostics: how well the data supported the fit.
        warnings: what a reader of the model must know; empty if nothing.
    """

    model: PolynomialModel
    options: IdentificationOptions
    alpha_noise_rad: float
    q_noise_rad_s: float
    segments: tuple[Segment, ...]
    unused: tuple[str, ...]
    diagnostics: Diagnostics
    warnings: tuple[str, ...]

    @property
    def standard_errors(self) -> FloatArray:
        """One standard error per coefficient, those of dα/dt first, shape (n,), in SI."""
        return frozen_array(np.sqrt(np.diag(self.model.covariance)))


def identify(sweep: Sweep, options: IdentificationOptions) -> Identification:
    """Fit the coefficients of dα/dt and dq/dt to all flights of a sweep together.

    Only time, alpha, q, the elevator and its hold are used. Each flight counts up to its first exit from the alpha
    window; a flight with missing samples is used in pieces. Noise of alpha and q is taken as white and is measured on
    the records themselves; the elevator is taken as known. Where the residuals are larger than this noise explains,
    the covariance is widened by their ratio, and a warning says so.

    If alpha leaves ±180 deg in some record, it is no angle in radians: no window is applied, every sample is fitted,
    and a warning says so.

    Args:
        sweep: the flights.
        options: model form, window, test functions.

    Raises:
        InputError: a record is not uniform in time, or sampled too coarsely for the test functions.
        RefusedError: no flight can be used, or the data cannot determine every coefficient; the reason is named.
    """
    windowed = not any(_beyond_half_turn(record["alpha_rad"]) for record in sweep.records)
    found = {record.name: stretches(record, options, windowed=windowed) for record in sweep.records}
    used = [stretch for pieces in found.values() for stretch in pieces]
    reason = f"no {_needed_s(options):g} s without a gap inside the alpha window, up to its first exit"
    if not used:
        raise RefusedError(
            f"none of the {len(found)} flights of '{sweep.study}' can be used: {reason}",
            hint="widen alpha_window_rad, lower half_width_s or minimum_duration_s, or fly longer",
        )
    form = Form(alpha_order=options.alpha_order)
    noise, floor = _noise(used)
    fit = estimate(
        [weak_form(stretch, form, options) for stretch in used],
        form,
        np.maximum(noise, floor),
        half_width_s=options.half_width_s,
    )
    quality = _quality(fit, noisy=bool((noise > floor).any()))
    return Identification(
        model=form.model(
            fit.coefficients, fit.covariance * quality.widening, _domain(used, fit, options, windowed=windowed)
        ),
        options=options,
        alpha_noise_rad=float(noise[0]),
        q_noise_rad_s=float(noise[1]),
        segments=tuple(
            Segment(flight=piece.flight, start_s=piece.start_s, end_s=piece.end_s, samples=len(piece)) for piece in used
        ),
        unused=tuple(f"{name}: {reason}" for name, pieces in found.items() if not pieces),
        diagnostics=Diagnostics(
            equations=sum(len(rows) for rows in fit.residuals),
            condition_number=fit.condition_number,
            chi_square=quality.chi_square,
            lag1_correlation=quality.lag1_correlation,
            used_fraction=sum(len(piece) for piece in used) / sum(len(record) for record in sweep.records),
            iterations=fit.iterations,
        ),
        warnings=(
            *(() if windowed else (_NO_ANGLE,)),
            *quality.warnings,
            *_weak_coefficients(fit, form, quality.widening),
        ),
    )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Quality:
    """What the whitened residuals say."""

    chi_square: tuple[float, float]
    lag1_correlation: tuple[float, float]
    widening: float
    warnings: tuple[str, ...]


def _beyond_half_turn(alpha_rad: FloatArray) -> bool:
    return bool(np.abs(alpha_rad[np.isfinite(alpha_rad)]).max(initial=0.0) > math.pi)


def _needed_s(options: IdentificationOptions) -> float:
    """Return the shortest stretch that is used, in s."""
    return max(options.minimum_duration_s, 2 * options.half_width_s)


def _noise(used: list[Stretch]) -> tuple[FloatArray, FloatArray]:
    """Return the noise of alpha and q, and what counts as none, shape (2,) each."""
    noise = np.array([noise_deviation([piece.measured[:, i] for piece in used]) for i in range(2)])
    size = np.sqrt(np.mean(np.concatenate([piece.measured for piece in used]) ** 2, axis=0))
    return noise, np.maximum(_NO_NOISE * size, _STILL)


def _quality(fit: Estimate, *, noisy: bool) -> _Quality:
    """Judge the whitened residuals: their size and the correlation of neighbors."""
    rows = np.concatenate(fit.residuals)
    squares = np.mean(rows**2, axis=0) / (1 - fit.coefficients.size / rows.size)
    pairs = sum((piece[1:] * piece[:-1]).sum(axis=0) for piece in fit.residuals)
    lag1 = pairs / np.maximum((rows**2).sum(axis=0), np.finfo(np.float64).tiny)
    warnings = []
    widening = 1.0
    if not noisy:
        warnings.append(
            f"the records carry no measurable noise: standard errors are those of noise of {_NO_NOISE:g} of the signals"
        )
    if fit.variance > 1 + _SIGNIFICANT * math.sqrt(2 / rows.size):
        widening = fit.variance
        warnings.append(
            f"residuals are {math.sqrt(widening):.3g} times larger than the noise of the records explains: the model's "
            "form does not hold everywhere; standard errors are widened by this factor"
        )
    if not fit.converged:
        warnings.append(f"the estimate still moved after {fit.iterations} iterations: do not trust its last digits")
    return _Quality(
        chi_square=(float(squares[0]), float(squares[1])),
        lag1_correlation=(float(lag1[0]), float(lag1[1])),
        widening=widening,
        warnings=tuple(warnings),
    )


def _weak_coefficients(fit: Estimate, form: Form, widening: float) -> tuple[str, ...]:
    """Name the coefficients whose 95 % interval holds zero."""
    deviations = np.sqrt(widening * np.diag(fit.covariance))
    weak = np.abs(fit.coefficients) < _INTERVAL_95 * deviations
    if not weak.any():
        return ()
    return (f"not told from zero (95 %): {', '.join(np.array(form.labels())[weak].tolist())}",)


def _domain(used: list[Stretch], fit: Estimate, options: IdentificationOptions, *, windowed: bool) -> FloatArray:
    """Return the box of (alpha, q, elevator) that the data cover, shape (3, 2); alpha within the window."""
    states = np.concatenate(fit.states)
    elevator = np.concatenate([piece.elevator_rad for piece in used])
    columns = np.column_stack([states, elevator])
    box = np.stack([columns.min(axis=0), columns.max(axis=0)], axis=1)
    if windowed:
        box[0] = np.clip(box[0], *options.alpha_window_rad)
    return frozen_array(box)
