"""Ramp crossings extrapolated to rate zero."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.units import from_si, to_si
from finback.validation.extrapolation import extrapolate, ramp_terms

RATES = to_si(np.array([0.01, 0.02, 0.05, 0.1, 0.2]), "deg_s")
FOLD = to_si(14.7252153801, "deg")
# Crossings of alpha 5 deg past the fold at elevator 14.725 deg, in deg beyond it: the published model of the F-8 II
# integrated by Runge-Kutta at 100 Hz on ramps at RATES from 2 deg before the fold.
PUBLISHED = to_si(np.array([0.0813, 0.1316, 0.2474, 0.3967, 0.6322]), "deg")


@given(a=st.floats(-0.7, 0.7), b=st.floats(-3.0, 3.0), c=st.floats(-30.0, 30.0))
def test_the_law_itself_is_found_exactly(a: float, b: float, c: float) -> None:
    elevator = ramp_terms(RATES) @ np.array([a, b, c])
    fit = extrapolate(RATES, elevator)
    rounding = 1e-12  # rad: 15 digits of numbers below 1, times the condition of the fit, about 1e2
    assert fit.coefficients[0] == pytest.approx(a, abs=rounding)
    np.testing.assert_allclose(ramp_terms(RATES) @ fit.coefficients, elevator, atol=rounding)
    way = abs(elevator[0] - fit.coefficients[0])
    # A perfect fit of the law is still no more than an extrapolation; the rest is Student's factor and a longer fit.
    assert fit.uncertainty_rad == pytest.approx(0.1 * way, abs=100 * rounding)


@given(shift=st.floats(-0.5, 0.5), sign=st.sampled_from([-1.0, 1.0]))
def test_the_answer_moves_and_turns_with_the_elevator(shift: float, sign: float) -> None:
    fit, moved = extrapolate(RATES, FOLD + PUBLISHED), extrapolate(RATES, sign * (FOLD + PUBLISHED) + shift)
    assert moved.coefficients[0] == pytest.approx(sign * fit.coefficients[0] + shift, abs=1e-12)
    assert moved.uncertainty_rad == pytest.approx(fit.uncertainty_rad, rel=1e-6)


def test_a_real_passage_is_found_within_the_stated_uncertainty_and_not_by_a_straight_line() -> None:
    fit = extrapolate(RATES, FOLD + PUBLISHED)
    error = from_si(fit.coefficients[0] - FOLD, "deg")
    # 0.008 deg was measured for this definition of the jump; most of it is the next term of the expansion.
    assert abs(error) < 0.008
    assert abs(error) < from_si(fit.uncertainty_rad, "deg") < 0.02
    line = from_si(float(np.polyfit(RATES, PUBLISHED, 1)[1]), "deg")
    assert line > 0.05
    assert line > 10 * abs(error)


@pytest.mark.parametrize("dropped", range(5))
def test_four_rates_suffice(dropped: int) -> None:
    rest = np.arange(5) != dropped
    fit = extrapolate(RATES[rest], FOLD + PUBLISHED[rest])
    assert abs(fit.coefficients[0] - FOLD) < fit.uncertainty_rad < to_si(0.1, "deg")


def test_three_rates_tell_nothing() -> None:
    fit = extrapolate(RATES[:3], FOLD + PUBLISHED[:3])
    assert fit.uncertainty_rad == math.inf
    assert np.isnan(fit.coefficients).all()


def test_noise_widens_the_uncertainty() -> None:
    noise = to_si(0.01, "deg") * np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    quiet, noisy = extrapolate(RATES, FOLD + PUBLISHED), extrapolate(RATES, FOLD + PUBLISHED + noise)
    assert noisy.uncertainty_rad > 2.0 * quiet.uncertainty_rad
    assert abs(noisy.coefficients[0] - FOLD) < noisy.uncertainty_rad
