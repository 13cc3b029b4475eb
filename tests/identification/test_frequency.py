"""Equation error in the frequency domain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from finback.arrays import FloatArray
from finback.errors import InputError, RefusedError
from finback.identification.field import field
from finback.identification.frequency import transforms
from finback.identification.identify import identify
from finback.identification.method import Method
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import stretches
from finback.records import FlightRecord, Hold, Sweep
from finback.units import to_si

Noisy = Callable[..., Sweep]
RARE = 1e-3
# Short flights cut off by the window, with corners of the elevator anywhere: the smallest coefficient is the worst.
CLEAN_ERROR = 2e-3


@pytest.fixture(scope="module")
def spectral(options: IdentificationOptions) -> IdentificationOptions:
    return replace(options, method=Method.FREQUENCY)


def test_the_derivative_needs_no_derivative(clean: Sweep, options: IdentificationOptions, exact: FloatArray) -> None:
    (piece,) = stretches(clean.records[-1], options, windowed=True)
    (test,) = transforms(piece, (0.1, 2.0))
    rates = field(options.model_form, exact, piece.measured, piece.inputs).rates
    off = -test.slope @ piece.measured - test.value @ rates
    # The trapezoidal rule at corners of the elevator: interval²/12 of the slope's jumps of up to 5 rad/s³.
    assert np.abs(off).max() < 1e-4 * np.abs(test.slope @ piece.measured).max()


@pytest.mark.parametrize("hold", [Hold.FOH, Hold.ZOH])
def test_clean_flights_give_the_truth(
    flights: Callable[..., tuple[FlightRecord, ...]], spectral: IdentificationOptions, exact: FloatArray, hold: Hold
) -> None:
    result = identify(Sweep(study="", records=flights(hold=hold)), spectral)
    np.testing.assert_allclose(result.model.coefficients, exact, rtol=CLEAN_ERROR)


def test_the_estimate_has_the_errors_it_states(
    clean: Sweep, noisy: Noisy, spectral: IdentificationOptions, exact: FloatArray
) -> None:
    results = [identify(noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=seed), spectral) for seed in range(12)]
    z = np.array([(result.model.coefficients - exact) / result.standard_errors for result in results])
    correlation = results[0].model.covariance / np.outer(results[0].standard_errors, results[0].standard_errors)
    squares = np.einsum("si,ij,sj->s", z, np.linalg.inv(correlation), z).sum()
    assert chi2.ppf(RARE / 2, z.size) < squares < chi2.isf(RARE / 2, z.size)


def test_what_lies_above_the_band_does_not_count(clean: Sweep, noisy: Noisy, spectral: IdentificationOptions) -> None:
    """A vibration of 12 Hz in q, as of structure, thirty times the noise."""
    # The window of a short flight is too short to tell it from 2 Hz.
    long = replace(clean, records=tuple(record for record in clean.records if record.duration_s > 4.0))
    quiet = noisy(long, alpha_deg=0.1, q_deg_s=0.1, seed=1)
    shaken = tuple(
        record.with_columns(
            q_rad_s=record["q_rad_s"] + to_si(3.0, "deg_s") * np.sin(2 * np.pi * 12.0 * record["time_s"])
        )
        for record in quiet.records
    )
    loud = Sweep(study="", records=shaken)
    still, shaking = identify(quiet, spectral), identify(loud, spectral)
    moved = np.abs(shaking.model.coefficients - still.model.coefficients) / still.standard_errors
    assert moved.max() < 1.0


def test_a_band_without_frequencies_is_refused(clean: Sweep, noisy: Noisy, spectral: IdentificationOptions) -> None:
    sweep = noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=1)
    with pytest.raises(RefusedError, match="too few"):
        identify(sweep, replace(spectral, band_1_s=(0.5, 0.51)))
    with pytest.raises(InputError, match="band_hz"):
        identify(sweep, replace(spectral, band_1_s=(2.0, 0.5)))
