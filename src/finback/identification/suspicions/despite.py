"""Checks that do not wait for the fit that was asked for: what method fits, and whether it is refused, is all one.

Output error follows gusts with its states and biases, transforms leave them outside their band: so the residuals that
are judged are always those of the weak form. And where a fit is refused, those of a straight form are judged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from finback.arrays import FloatArray
from finback.errors import InputError, RefusedError
from finback.identification.estimate import Estimate, estimate
from finback.identification.method import Method
from finback.identification.model_form import ModelForm
from finback.identification.noise import measured_noise
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch, beyond_half_turn, stretches
from finback.identification.suspicions.check import channels_beside, suspicions
from finback.identification.suspicions.finding import Suspect, Suspicion
from finback.identification.suspicions.lift import lift_hysteresis
from finback.identification.weak_form import weak_form
from finback.records import Sweep

_STRAIGHT: Final = (
    ModelForm.polynomial((1, 1)),
    ModelForm.parse(("1", "q", "alpha"), ("1", "q", "alpha")),
)
"""What a refused fit leaves to be judged with: linear, at last without an elevator that hardly moves. Curves over alpha
are allowed for by the checks themselves."""


def suspicions_of_fit(
    seen: Sequence[Stretch],
    options: IdentificationOptions,
    fit: Estimate,
    *,
    noise: FloatArray,
    beside: Sequence[Mapping[str, FloatArray]],
) -> tuple[Suspicion, ...]:
    """Check the residuals of the weak form, with the form of a fit.

    Args:
        seen: the data of the fit, without the biases and the delays that it found.
        options: of the fit.
        fit: by any method; itself judged if it is of the weak form, or if the weak form is refused.
        noise: standard deviations of alpha in rad and q in rad/s as the records show them, shape (2,).
        beside: airspeed and pitch angle of each stretch, as far as they are known.
    """
    judged = fit
    if options.method is not Method.WEAK_FORM:
        try:
            judged = _weak(seen, options, noise)
        except RefusedError:
            judged = fit
    return suspicions(seen, options, coefficients=judged.coefficients, states=judged.states, noise=noise, beside=beside)


def with_what_is_seen(refusal: RefusedError, sweep: Sweep, options: IdentificationOptions) -> RefusedError:
    """Return a refusal that also says whether the air was rough, and whether the lift shows hysteresis.

    Args:
        refusal: of a fit.
        sweep: the flights that it was to be fitted to.
        options: of the fit.
    """
    said = [found.statement for found in (*_air(sweep, options), *lift_hysteresis(sweep.records)) if found.raised]
    if not said:
        return refusal
    hint = "; ".join(filter(None, (refusal.hint, "rough air and a lagging flow hide what the controls do")))
    return RefusedError("; ".join((refusal.message, *said)), hint=hint)


def _air(sweep: Sweep, options: IdentificationOptions) -> tuple[Suspicion, ...]:
    """Return the check for turbulence with a straight form, or nothing if no such form can be fitted."""
    windowed = not any(beyond_half_turn(record["alpha_rad"])[1] for record in sweep.records)
    try:
        used = [piece for record in sweep.records for piece in stretches(record, options, windowed=windowed)]
    except InputError:
        return ()
    if not used:
        return ()
    noise = measured_noise(used).assumed
    beside = [channels_beside(sweep[piece.flight], piece) for piece in used]
    for form in _STRAIGHT:
        plain = replace(options, form=(form,), selection=())
        try:
            fit = _weak(used, plain, noise)
        except RefusedError:
            continue
        found = suspicions(used, plain, coefficients=fit.coefficients, states=fit.states, noise=noise, beside=beside)
        return tuple(one for one in found if one.suspect is Suspect.TURBULENCE)
    return ()


def _weak(used: Sequence[Stretch], options: IdentificationOptions, noise: FloatArray) -> Estimate:
    form = options.model_form
    forms = [weak_form(piece, form, options) for piece in used]
    return estimate(forms, form, noise, half_width_s=options.half_width_s)
