"""Maneuvers become straight lines with corners on the samples."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.errors import InputError
from finback.flight.excitation import Doublet, Hold, Maneuver, Ramp, Release, Step, ThreeTwoOneOne, schedule
from finback.records import Schedule

LIMITS = (-0.7, 0.35)
RATE = 1.05
GRID = 0.01
ON_GRID = 1e-9  # s: rounding of counts times the grid


def made(maneuver: Maneuver) -> Schedule:
    return schedule(maneuver, rate_limit_rad_s=RATE, limits_rad=LIMITS, grid_s=GRID)


small = st.floats(-0.1, 0.1)
trims = st.floats(-0.5, 0.2)
leads = st.floats(0.0, 1.0)
maneuvers = st.one_of(
    st.builds(Step, elevator_rad=trims, amplitude_rad=small, lead_s=leads, duration_s=st.just(20.0)),
    st.builds(
        Doublet,
        elevator_rad=trims,
        amplitude_rad=small,
        unit_s=st.floats(0.3, 1.5),
        lead_s=leads,
        duration_s=st.just(20.0),
    ),
    st.builds(
        ThreeTwoOneOne,
        elevator_rad=trims,
        amplitude_rad=small,
        unit_s=st.floats(0.3, 1.5),
        lead_s=leads,
        duration_s=st.just(20.0),
    ),
    st.builds(
        Ramp,
        elevator_rad=trims,
        to_elevator_rad=st.floats(-0.7, 0.35),
        rate_rad_s=st.floats(0.1, RATE),
        lead_s=leads,
        duration_s=st.just(20.0),
    ),
    st.builds(Hold, elevator_rad=trims, duration_s=st.just(20.0)),
)


@given(maneuvers)
@settings(deadline=None)
def test_every_schedule_is_lines_within_rate_and_limits_whose_corners_are_samples(maneuver: Maneuver) -> None:
    flown = made(maneuver)
    counts = flown.time_s / GRID
    np.testing.assert_allclose(counts, np.round(counts), atol=ON_GRID / GRID)
    assert (np.diff(flown.time_s) > 0).all(), "a movement takes time"
    rates = np.abs(np.diff(flown.elevator_rad) / np.diff(flown.time_s)) if flown.time_s.size > 1 else np.zeros(1)
    assert rates.max() <= RATE * (1 + 1e-6)
    assert flown.elevator_rad[0] == maneuver.elevator_rad
    # Straight lines between samples are the schedule itself, so hold "foh" says the truth.
    samples = np.arange(0, 2001) * GRID
    between = samples[:-1] + 0.37 * GRID
    np.testing.assert_allclose(np.interp(between, samples, flown.value(samples)), flown.value(between), atol=1e-12)


@given(st.floats(-0.1, 0.1), st.floats(0.4, 1.0))
@settings(deadline=None)
def test_a_doublet_and_a_3211_return_and_alternate(amplitude: float, unit: float) -> None:
    middle = np.array([0.5, 1.5, 2.5])
    double = made(Doublet(elevator_rad=-0.1, amplitude_rad=amplitude, unit_s=unit, lead_s=0.2, duration_s=9.0))
    late = 0.2 + (middle + 0.45) * unit
    np.testing.assert_allclose(double.value(late), -0.1 + amplitude * np.array([1, -1, 0]), atol=1e-12)
    four = made(ThreeTwoOneOne(elevator_rad=-0.1, amplitude_rad=amplitude, unit_s=unit, lead_s=0.2, duration_s=9.0))
    ends = 0.2 + (np.array([3, 5, 6, 7, 8]) - 0.05) * unit
    np.testing.assert_allclose(four.value(ends), -0.1 + amplitude * np.array([1, -1, 1, -1, 0]), atol=1e-12)


def test_a_step_ends_on_the_first_sample_that_the_rate_allows() -> None:
    flown = made(Step(elevator_rad=0.0, amplitude_rad=-0.1, lead_s=0.5, duration_s=5.0))
    np.testing.assert_allclose(flown.time_s, [0.0, 0.5, 0.5 + math.ceil(0.1 / RATE / GRID) * GRID])
    np.testing.assert_allclose(flown.elevator_rad, [0.0, 0.0, -0.1])


def test_a_ramp_runs_at_its_own_rate_and_is_held_at_its_end() -> None:
    flown = made(Ramp(elevator_rad=-0.2, to_elevator_rad=-0.3, rate_rad_s=0.01, lead_s=1.0, duration_s=15.0))
    assert flown.value(6.0) == pytest.approx(-0.25)
    assert flown.value(14.0) == -0.3


def test_a_release_holds_the_elevator() -> None:
    flown = made(Release(elevator_rad=0.1, alpha_rad=0.3, q_rad_s=-1.0, duration_s=5.0))
    assert (flown.value(np.linspace(0, 5, 11)) == 0.1).all()


@pytest.mark.parametrize(
    ("maneuver", "words"),
    [
        (Step(elevator_rad=0.3, amplitude_rad=0.1, lead_s=0.5, duration_s=5.0), "outside its limits"),
        (Hold(elevator_rad=-0.8, duration_s=5.0), "outside its limits"),
        (Ramp(elevator_rad=0, to_elevator_rad=0.1, rate_rad_s=2.0, lead_s=0, duration_s=5), "faster"),
        (Doublet(elevator_rad=0, amplitude_rad=0.3, unit_s=0.2, lead_s=0, duration_s=5), "not over"),
        (ThreeTwoOneOne(elevator_rad=0, amplitude_rad=0.1, unit_s=1, lead_s=0, duration_s=6), "after the flight"),
        (Step(elevator_rad=0.0, amplitude_rad=0.1, lead_s=1e308, duration_s=5.0), "more samples than can be counted"),
        (Doublet(elevator_rad=0, amplitude_rad=0.1, unit_s=1e308, lead_s=0, duration_s=5), "than can be counted"),
        (Ramp(elevator_rad=0, to_elevator_rad=0.1, rate_rad_s=1e-308, lead_s=0, duration_s=5), "than can be counted"),
        (Ramp(elevator_rad=0, to_elevator_rad=0.1, rate_rad_s=5e-324, lead_s=0, duration_s=5), "than can be counted"),
    ],
)
def test_a_maneuver_that_cannot_be_flown_is_an_error_that_says_why(maneuver: Maneuver, words: str) -> None:
    with pytest.raises(InputError, match=words):
        made(maneuver)


def test_numbers_that_make_no_maneuver_are_refused_where_they_are_given() -> None:
    with pytest.raises(InputError, match="duration_s"):
        Hold(elevator_rad=0.0, duration_s=0.0)
    with pytest.raises(InputError, match="elevator_rad"):
        Hold(elevator_rad=math.nan, duration_s=1.0)
    with pytest.raises(InputError, match="lead_s"):
        Step(elevator_rad=0.0, amplitude_rad=0.1, lead_s=-1.0, duration_s=1.0)
