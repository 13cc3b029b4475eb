"""Filter error: the filter against an independent one, and flights in disturbed air."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from finback.arrays import FloatArray
from finback.identification.field import layout
from finback.identification.identify import identify
from finback.identification.innovations import innovations
from finback.identification.method import Method
from finback.identification.model_form import ModelForm
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch
from finback.records import FlightRecord, Hold, Sweep

FORM = ModelForm.polynomial((1, 1))
TRUTH = np.array([0.01, 0.98, -0.4, -0.04, 0.02, -0.9, -8.0, -4.7])  # 1, q, alpha, elevator in each equation
MATRIX = np.array([[-0.4, 0.98], [-8.0, -0.9]])
INPUT = np.array([-0.04, -4.7])
NOISE = np.array([0.002, 0.002])  # rad, rad/s
PROCESS = np.array([1e-5, 1e-3])  # rad²/s, rad²/s³
INTERVAL_S, SAMPLES = 0.01, 1001


def _disturbed(seed: int, process: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fly the linear model through white noise on its rates, exactly: measured, states, elevator."""
    random = np.random.default_rng(seed)
    step = expm(INTERVAL_S * np.block([[MATRIX, np.eye(2)], [np.zeros((2, 4))]]))
    transition, drive = step[:2, :2], step[:2, 2:]
    elevator = 0.05 * np.sign(np.sin(2 * np.pi * (0.25 + 0.1 * seed) * INTERVAL_S * np.arange(SAMPLES) + 0.1))
    states = np.zeros((SAMPLES, 2))
    for i in range(SAMPLES - 1):
        push = np.array([TRUTH[0], TRUTH[4]]) + INPUT * elevator[i]
        gust = np.sqrt(process * INTERVAL_S) * random.standard_normal(2)
        states[i + 1] = transition @ states[i] + drive @ push + gust
    return states + NOISE * random.standard_normal(states.shape), states, elevator


def test_the_filter_is_that_of_kalman() -> None:
    measured, _, elevator = _disturbed(1, PROCESS)
    stretch = Stretch(
        flight="", start_s=0.0, interval_s=INTERVAL_S, measured=measured, elevator_rad=elevator, hold=Hold.ZOH
    )
    found = innovations(stretch, layout(FORM), TRUTH, process=PROCESS, noise=NOISE**2)
    step = expm(INTERVAL_S * np.block([[MATRIX, np.eye(2)], [np.zeros((2, 4))]]))
    state, covariance, total = measured[0], np.diag(NOISE**2), 0.0
    for i in range(SAMPLES - 1):
        push = np.array([TRUTH[0], TRUTH[4]]) + INPUT * elevator[i]
        state = step[:2, :2] @ state + step[:2, 2:] @ push
        covariance = step[:2, :2] @ covariance @ step[:2, :2].T + INTERVAL_S * np.diag(PROCESS)
        whole = covariance + np.diag(NOISE**2)
        gain = covariance @ np.linalg.inv(whole)
        innovation = measured[i + 1] - state
        # The transition is expanded to second order: 0.01 s at 3 rad/s leaves 5e-6 of a covariance.
        np.testing.assert_allclose(found.values[i], innovation, atol=1e-7)
        np.testing.assert_allclose(np.linalg.inv(found.white[i].T @ found.white[i]), whole, rtol=1e-4, atol=1e-10)
        state, covariance = state + gain @ innovation, (np.eye(2) - gain) @ covariance
        total += float(np.log(np.linalg.det(whole)))
    assert found.log_determinant == pytest.approx(total, rel=1e-5)


@pytest.fixture(scope="module")
def asked(options: IdentificationOptions) -> IdentificationOptions:
    return replace(options, form=(FORM,), method=Method.FILTER_ERROR)


def _sweep(make: Callable[..., FlightRecord], process: FloatArray) -> Sweep:
    flights = [_disturbed(seed, process) for seed in (1, 2)]
    return Sweep(
        study="",
        records=tuple(
            make(f"flight-{i}", measured, elevator, hold=Hold.ZOH) for i, (measured, _, elevator) in enumerate(flights)
        ),
    )


def test_in_disturbed_air_the_errors_are_those_it_states(
    make_record: Callable[..., FlightRecord], asked: IdentificationOptions
) -> None:
    sweep = _sweep(make_record, PROCESS)
    result = identify(sweep, asked)
    z = (result.model.coefficients - TRUTH) / result.standard_errors
    assert np.abs(z).max() < 4.0  # 8 normal numbers: once in 2000
    # A density is known to some 10 % from 2000 samples; sampled noise counts fully.
    np.testing.assert_allclose(result.diagnostics.process, PROCESS, rtol=0.4)
    assert min(result.diagnostics.whiteness) > 1e-3
    # Output error takes gusts for sensor noise: its residuals are colored, and it says so.
    blind = identify(sweep, replace(asked, method=Method.OUTPUT_ERROR))
    assert blind.diagnostics.coloring > 2.0
    assert any("not white" in warning for warning in blind.warnings)


def test_in_calm_air_there_is_no_process_noise(
    make_record: Callable[..., FlightRecord], asked: IdentificationOptions
) -> None:
    sweep = _sweep(make_record, np.zeros(2))
    result, other = identify(sweep, asked), identify(sweep, replace(asked, method=Method.OUTPUT_ERROR))
    assert (np.array(result.diagnostics.process) < 0.02 * PROCESS).all()
    apart = np.abs(result.model.coefficients - other.model.coefficients) / other.standard_errors
    assert apart.max() < 1.0
    np.testing.assert_allclose(result.standard_errors, other.standard_errors, rtol=0.5)
