"""From a sweep to a polynomial model with covariance, domain and diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.model import PolynomialModel
from finback.errors import RefusedError
from finback.identification.between_samples import said_of_chords
from finback.identification.collinearity import APART
from finback.identification.coloring import coloring
from finback.identification.correction import corrected
from finback.identification.diagnostics import Diagnostics, covariance_widening, diagnostics, warnings
from finback.identification.estimate import Estimate
from finback.identification.estimators import estimated
from finback.identification.flight_constants import (
    FlightConstants,
    flight_constants,
    said_of_constants,
    with_constants,
    without_columns,
)
from finback.identification.gate import judge
from finback.identification.noise import Noise, measured_noise
from finback.identification.nuisance import FlightNuisances, flight_nuisances
from finback.identification.options import IdentificationOptions
from finback.identification.rough_air import in_rough_air
from finback.identification.selection.options import SelectionOptions
from finback.identification.selection.select import Selection, select
from finback.identification.stretch import Stretch, beyond_half_turn, stretches
from finback.identification.suspicions.check import channels_beside
from finback.identification.suspicions.despite import suspicions_of_fit, with_what_is_seen
from finback.identification.suspicions.finding import Suspicion
from finback.identification.suspicions.lift import lift_hysteresis
from finback.records import Sweep

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
        suspicions: whether the residuals show turbulence, hysteresis or a late input, and the lift itself hysteresis.
        nuisances: biases and delay of each stretch, if the options ask for any.
        selection: how the terms were found, if the options ask for it; or empty.
        constants: by how much the constants of each flight differ from the model's, if the options ask for it.
        cramer_rao_errors: one standard error per coefficient as most published tables state it, the plain Cramér-Rao
            bound: neither widened nor corrected for the color of the residuals, shape (n,), in SI.
    """

    model: PolynomialModel
    options: IdentificationOptions
    alpha_noise_rad: float
    q_noise_rad_s: float
    segments: tuple[Segment, ...]
    unused: tuple[str, ...]
    diagnostics: Diagnostics
    warnings: tuple[str, ...]
    suspicions: tuple[Suspicion, ...] = ()
    nuisances: tuple[FlightNuisances, ...] = ()
    selection: tuple[Selection, ...] = ()
    constants: tuple[FlightConstants, ...] = ()
    cramer_rao_errors: FloatArray = field(default_factory=lambda: frozen_array(np.empty(0)))

    @property
    def standard_errors(self) -> FloatArray:
        """One standard error per coefficient, those of dα/dt first, shape (n,), in SI."""
        return frozen_array(np.sqrt(np.diag(self.model.covariance)))


def identify(sweep: Sweep, options: IdentificationOptions) -> Identification:
    """Fit the coefficients of dα/dt and dq/dt to all flights of a sweep together.

    Only time, alpha, q, the elevator and its hold are used. Each flight counts up to its first exit from the alpha
    window; a flight with missing samples is used in pieces. Noise of alpha and q is taken as white and is measured on
    the records themselves; the elevator is taken as known. Where the residuals are larger than this noise explains,
    the covariance is widened by their ratio, and a warning says so. Where they are not white, it is corrected for
    their color (Morelli & Klein 1997), and a warning says so. Where the air was not calm, it also holds how far the
    estimate is from that of filter error, and a warning says so. A channel with less noise than 1e-3 of itself is
    fitted as if it had that much, and a warning says so: no polynomial describes an aircraft better than that.

    The covariance is about noise and about what flew: for a simulator, its tables. Where these are chords of a smooth
    curve, it says nothing about the curve between their points (for the F-8 II see ``SOURCE.md``, section 4).

    If alpha stays beyond ±180 deg in some record, it is no angle in radians: no window is applied, every sample is
    fitted, and a warning says so. Stray samples beyond ±180 deg are left out, and a warning counts them.

    If the options ask for a selection, the terms are found first, and flights that are kept out of it, to be
    predicted, are kept out of the fit as well.

    Args:
        sweep: the flights.
        options: model form, window, test functions.

    Raises:
        InputError: a record is not uniform in time, or sampled too coarsely for the test functions.
        RefusedError: no flight can be used, or the data cannot determine every coefficient; the reason is named, and
            rough air or a lagging flow if they show.
    """
    try:
        return _identified(sweep, options)
    except RefusedError as refusal:
        raise with_what_is_seen(refusal, sweep, options) from None


def _identified(sweep: Sweep, options: IdentificationOptions) -> Identification:
    """Fit; a refusal says nothing of the air yet."""
    for asked in options.selection:
        return _selected(sweep, options, asked)
    beyond = {record.name: beyond_half_turn(record["alpha_rad"]) for record in sweep.records}
    windowed = not any(lasting for _, lasting in beyond.values())
    form = options.model_form
    found = {
        record.name: stretches(record, options, windowed=windowed, further=form.inputs[1:]) for record in sweep.records
    }
    used = [stretch for pieces in found.values() for stretch in pieces]
    reason = f"no {_needed_s(options):g} s without a gap inside the alpha window, up to its first exit"
    if not used:
        raise RefusedError(
            f"none of the {len(found)} flights of '{sweep.study}' can be used: {reason}",
            hint="widen alpha_window_deg, lower half_width_s or minimum_duration_s, or fly longer",
        )
    noise = measured_noise(used)
    used, fitted, apart = with_constants(used, options)
    form = fitted.model_form
    fit = _estimated(used, fitted, noise)
    seen = [corrected(piece, values) for piece, values in zip(used, fit.extras, strict=True)]
    doubts = suspicions_of_fit(
        seen,
        fitted,
        fit,
        noise=noise.assumed,
        beside=[channels_beside(sweep[piece.flight], piece) for piece in used],
    )
    lift = lift_hysteresis(sweep.records)
    color = coloring(fit.covariance, fit.influence, fit.residuals, widening=covariance_widening(fit))
    larger = covariance_widening(fit) > 1.0
    air = in_rough_air(fit, color, doubts, used=used, options=fitted, noise=noise, larger=larger)
    color = replace(color, covariance=air.covariance)
    samples = sum(len(record) for record in sweep.records)
    domain = _domain(used, fit, options, windowed=windowed)
    model = form.model(fit.coefficients, color.covariance, domain)
    bound = without_columns(form.model(fit.coefficients, fit.covariance, domain), apart)
    return Identification(
        model=without_columns(model, apart),
        options=options,
        alpha_noise_rad=float(noise.found[0]),
        q_noise_rad_s=float(noise.found[1]),
        segments=tuple(
            Segment(flight=piece.flight, start_s=piece.start_s, end_s=piece.end_s, samples=len(piece)) for piece in used
        ),
        unused=tuple(f"{name}: {reason}" for name, pieces in found.items() if not pieces),
        diagnostics=diagnostics(fit, color, noise.assumed, used_fraction=sum(len(piece) for piece in used) / samples),
        warnings=(
            *_angle_warnings(beyond, windowed=windowed),
            *said_of_constants(apart, asked=options.constants_per_flight),
            *noise.warnings(),
            *warnings(fit, form, noise.assumed, color),
            *said_of_chords(seen, fitted, coefficients=fit.coefficients, states=fit.states, noise=noise.assumed),
            *(doubt.statement for doubt in (*doubts, *lift) if doubt.raised),
            *air.statements,
        ),
        suspicions=(*doubts, *lift),
        nuisances=tuple(
            flight_nuisances(piece.flight, piece.start_s, values, errors)
            for piece, values, errors in zip(used, fit.extras, fit.extra_errors, strict=True)
            if options.nuisances.deviations.any()
        ),
        constants=flight_constants(model, apart),
        cramer_rao_errors=frozen_array(np.sqrt(np.diag(bound.covariance))),
    )


def _selected(sweep: Sweep, options: IdentificationOptions, asked: SelectionOptions) -> Identification:
    """Find the form, then fit it to the flights that it was found from."""
    found = select(sweep, options, asked)
    rest = replace(sweep, records=tuple(record for record in sweep.records if record.name not in asked.prediction))
    fitted = _identified(rest, replace(options, form=(found.form,), selection=()))
    return replace(
        fitted,
        model=replace(fitted.model, covariance=frozen_array(fitted.model.covariance + found.spread)),
        options=options,
        unused=(*fitted.unused, *(f"{name}: kept out, to be predicted" for name in asked.prediction)),
        warnings=(*found.warnings, *fitted.warnings),
        selection=(found,),
    )


def _estimated(used: list[Stretch], options: IdentificationOptions, noise: Noise) -> Estimate:
    """Estimate; where the data know coefficients only together, say what they know."""
    form = options.model_form
    if form.implicit:
        judge(used, form, options, noise.assumed).refuse()
    try:
        return estimated(used, options, noise)
    except RefusedError as refusal:
        if not refusal.message.startswith(APART):
            raise
        try:
            judge(used, form, options, noise.assumed).refuse()
        except RefusedError as more:
            raise RefusedError(f"{refusal.message}; {more.message}", hint=refusal.hint) from None
        raise


def _angle_warnings(beyond: Mapping[str, tuple[int, bool]], *, windowed: bool) -> tuple[str, ...]:
    """Say what samples of alpha beyond ±180 deg mean, and in which flights they are."""
    if not windowed:
        lasting = [name for name, (_, more) in beyond.items() if more]
        return (f"{_NO_ANGLE} (in {len(lasting)} of {len(beyond)} flights, first in '{lasting[0]}')",)
    stray = [f"{count} in '{name}'" for name, (count, _) in beyond.items() if count]
    return (f"stray samples of alpha beyond ±180 deg were left out: {', '.join(stray)}",) if stray else ()


def _needed_s(options: IdentificationOptions) -> float:
    """Return the shortest stretch that is used, in s."""
    return max(options.minimum_duration_s, 2 * options.half_width_s)


def _domain(used: list[Stretch], fit: Estimate, options: IdentificationOptions, *, windowed: bool) -> FloatArray:
    """Return the box of alpha, q and inputs that the data cover, shape (v, 2); alpha within the window."""
    states = np.concatenate(fit.states)
    columns = np.column_stack([states, np.concatenate([piece.inputs for piece in used])])
    box = np.stack([columns.min(axis=0), columns.max(axis=0)], axis=1)
    if windowed:
        box[0] = np.clip(box[0], *options.alpha_window_rad)
    return frozen_array(box)
