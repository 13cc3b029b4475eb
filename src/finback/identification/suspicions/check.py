"""All checks of the residuals of a fitted model.

Every one asks what is left when the model, and all that a calm flight in attached flow may hold beside it (biases,
curves that the form has not, coefficients that change slowly with airspeed, density and thrust) has explained what it
can. So a model that is only too simple raises no alarm here; its residuals are told by the diagnostics.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter1d

from finback.arrays import FloatArray
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch
from finback.identification.suspicions.finding import Suspect, Suspicion, unjudged
from finback.identification.suspicions.residuals import residuals
from finback.identification.suspicions.signals import BESIDE, SPEED, attached_signals
from finback.identification.suspicions.turbulence import turbulence
from finback.identification.suspicions.unsteady import hysteresis_and_input
from finback.records import FlightRecord

_SPEED_S: Final = 0.4
"""Standard deviation of the kernel that smooths the airspeed: it changes slowly, and noise would hide what it does."""


def suspicions(
    used: Sequence[Stretch],
    options: IdentificationOptions,
    *,
    coefficients: FloatArray,
    states: Sequence[FloatArray],
    noise: FloatArray,
    beside: Sequence[Mapping[str, FloatArray]] = (),
) -> tuple[Suspicion, ...]:
    """Check the residuals of a fitted model for turbulence, hysteresis, and what the input still explains.

    Args:
        used: the data of the fit.
        options: of the fit: form and test functions.
        coefficients: of the fitted model, in SI, shape (p,).
        states: smoothed (alpha, q) of each stretch, shape (n, 2).
        noise: standard deviations of alpha in rad and q in rad/s as the records show them, shape (2,).
        beside: airspeed and pitch angle of each stretch, as far as they are known (``beside``); none if left out.
    """
    known = [
        _calmed(channels, piece.interval_s) for piece, channels in zip(used, beside or [{}] * len(used), strict=True)
    ]
    found = residuals(used, options, coefficients=coefficients, states=states, noise=noise, beside=known)
    least = found.without(found.columns(attached_signals(found.forms, found.states, found.beside)))
    air = turbulence(found, least)
    if air.raised:
        # Gusts move alpha and the elevator answers nothing: what is left of a signal says nothing of the aircraft.
        said = "the air was not calm: it would hide and feign this"
        return (air, *(unjudged(suspect, said) for suspect in (Suspect.HYSTERESIS, Suspect.INPUT)))
    return (air, *hysteresis_and_input(found, least))


def _calmed(channels: Mapping[str, FloatArray], interval_s: float) -> Mapping[str, FloatArray]:
    """Return channels with the airspeed as it changes, without the noise of its sensor."""
    if SPEED not in channels:
        return channels
    return {**channels, SPEED: gaussian_filter1d(channels[SPEED], _SPEED_S / interval_s, mode="nearest")}


def channels_beside(record: FlightRecord, stretch: Stretch) -> Mapping[str, FloatArray]:
    """Return what of airspeed and pitch angle a record has, at the samples of one of its stretches, shape (n,) each.

    Missing samples are straight between their neighbors; a channel that has none at all is left out.
    """
    time = stretch.start_s + stretch.interval_s * np.arange(len(stretch))
    found = {}
    for name in BESIDE:
        if name in record.columns:
            there = np.isfinite(record[name])
            if there.any():
                found[name] = np.interp(time, record["time_s"][there], record[name][there])
    return found
