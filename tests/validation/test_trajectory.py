"""Theil's coefficient, predictions of hold-out flights, and hold-out flights that are none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from finback.arrays import FloatArray
from finback.dynamics.model import PolynomialModel
from finback.dynamics.trajectory import free_run
from finback.errors import InputError
from finback.flight.plan import FlightPlan
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.units import to_si
from finback.validation.trajectory import MINIMUM_COMPARED_S, Theil, predict, refuse_seen, rms, theil

ROUNDING = 1e-9
"""Relative; sums of a few hundred products of numbers of order one, and their differences."""

CONDITION = Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)
TIME = 0.01 * np.arange(401)
histories = arrays(np.float64, 40, elements=st.floats(min_value=-100.0, max_value=100.0, width=32))


def flight(columns: FloatArray, schedule: Schedule, name: str = "doublet") -> FlightRecord:
    time = TIME[: len(columns)]
    elevator = schedule.value(time)
    return FlightRecord(
        name=name,
        columns={"time_s": time, "alpha_rad": columns[:, 0], "q_rad_s": columns[:, 1], "elevator_rad": elevator},
        outcome=Outcome.COMPLETED,
        note="",
        condition=CONDITION,
        schedule=schedule,
        hold=Hold.FOH,
    )


def doublet(at_rad: float = -0.1, size_rad: float = 0.05) -> Schedule:
    knots = [0.0, 0.5, 0.55, 1.5, 1.6, 2.5, 2.55]
    return Schedule(time_s=np.array(knots), elevator_rad=at_rad + size_rad * np.array([0, 0, 1, 1, -1, -1, 0]))


def flown(model: PolynomialModel, schedule: Schedule | None = None, alpha_rad: float = 0.05) -> FlightRecord:
    """A flight of the model itself."""
    schedule = schedule or doublet()
    run = free_run(model, time_s=TIME, elevator_rad=schedule.value(TIME), hold="foh", alpha_rad=alpha_rad, q_rad_s=0.02)
    return flight(run, schedule)


def test_a_perfect_prediction_has_no_inequality() -> None:
    wave = np.sin(TIME)
    assert theil(wave, wave) == Theil(coefficient=0.0, bias=0.0, variance=0.0, covariance=0.0)


@pytest.mark.parametrize("unit", [1.0, 1e-200, 1e200])
def test_three_pure_errors(unit: float) -> None:
    wave, other = unit * np.sin(2.0 * np.pi * TIME[:400]), unit * np.cos(2.0 * np.pi * TIME[:400])
    offset, amplitude, phase = theil(wave, wave + 0.1 * unit), theil(wave, 1.5 * wave), theil(wave, other)
    for found, expected in ((offset, (1, 0, 0)), (amplitude, (0, 1, 0)), (phase, (0, 0, 1))):
        assert (found.bias, found.variance, found.covariance) == pytest.approx(expected, abs=ROUNDING)
    assert amplitude.coefficient == pytest.approx(0.5 / 2.5, rel=ROUNDING)
    assert phase.coefficient == pytest.approx(math.sqrt(2.0) / 2.0, rel=ROUNDING)


def test_a_prediction_of_the_opposite_sign_is_the_worst() -> None:
    assert theil(np.sin(TIME), -np.sin(TIME)).coefficient == pytest.approx(1.0, rel=ROUNDING)


def test_an_infinite_prediction_is_the_worst_and_has_no_split() -> None:
    found = theil([1.0, 2.0], [1.0, math.inf])
    assert found.coefficient == 1.0
    assert math.isnan(found.bias)


def test_histories_of_different_length_are_refused() -> None:
    with pytest.raises(InputError, match="equal length"):
        theil([1.0, 2.0], [1.0])


@given(histories, histories)
def test_the_coefficient_lies_between_0_and_1_and_the_shares_sum_to_1(one: FloatArray, other: FloatArray) -> None:
    found = theil(one, other)
    assert 0.0 <= found.coefficient <= 1.0 + ROUNDING
    assert found.coefficient == pytest.approx(theil(other, one).coefficient, rel=ROUNDING)
    shares = (found.bias, found.variance, found.covariance)
    assert sum(shares) == pytest.approx(float(not np.array_equal(one, other)), abs=ROUNDING)
    assert min(shares) >= 0.0


@given(histories, histories, st.floats(min_value=1e-10, max_value=1.0))
def test_the_shares_sum_to_1_however_small_the_error(one: FloatArray, other: FloatArray, size: float) -> None:
    predicted = one + size * other
    found = theil(one, predicted)
    shares = (found.bias, found.variance, found.covariance)
    assert sum(shares) == pytest.approx(float(not np.array_equal(one, predicted)), abs=ROUNDING)
    assert min(shares) >= 0.0


@pytest.mark.parametrize("size", [1e-2, 1e-6, 1e-8, 1e-10])
def test_a_slightly_wrong_amplitude_is_a_wrong_amplitude(size: float) -> None:
    wave = np.sin(2.0 * np.pi * TIME[:400])
    found = theil(wave, wave * (1.0 + size))
    # The product itself is rounded to 1e-16 of values near 1: to 1e-16 / size of the difference.
    assert found.variance == pytest.approx(1.0, abs=1e-12 + 1e-16 / size)


def test_root_mean_square_of_the_huge_and_the_infinite() -> None:
    assert rms(np.array([3.0, -4.0])) == pytest.approx(math.sqrt(12.5), rel=ROUNDING)
    assert rms(np.array([1e300, 1e300])) == pytest.approx(1e300, rel=ROUNDING)
    assert rms(np.array([0.0, math.nan])) == math.inf
    assert rms(np.zeros(3)) == 0.0


def test_the_model_predicts_its_own_flight(fitted_model: PolynomialModel) -> None:
    found = predict(fitted_model, flown(fitted_model), seed=1)
    # Two codes for one Runge-Kutta scheme, one for numbers and one for arrays.
    assert found.alpha_rmse_rad < 1e-12
    assert found.q_peak_error_rad_s < 1e-12
    assert found.in_domain
    assert found.compared == len(TIME)
    # Coefficients good to 0.1 % know a motion of 0.2 rad to a little better than 0.1 % of it, and not for nothing.
    assert 1e-5 < found.alpha_rmse_u95_rad < 1e-3
    assert found.alpha_rmse_u95_rad == predict(fitted_model, flown(fitted_model), seed=1).alpha_rmse_u95_rad
    assert found.alpha_rmse_u95_rad != predict(fitted_model, flown(fitted_model), seed=2).alpha_rmse_u95_rad


def test_the_errors_are_those_of_a_known_difference(fitted_model: PolynomialModel) -> None:
    record = flown(fitted_model)
    moved = record.with_columns(
        alpha_rad=record["alpha_rad"] + 0.01 * (TIME > 2.0), q_rad_s=record["q_rad_s"] - 0.02 * (TIME > 3.0)
    )
    found = predict(fitted_model, moved, seed=1)
    assert found.alpha_peak_error_rad == pytest.approx(0.01, rel=1e-6)
    assert found.alpha_rmse_rad == pytest.approx(0.01 * math.sqrt(200 / 401), rel=1e-6)
    assert found.q_rmse_rad_s == pytest.approx(0.02 * math.sqrt(100 / 401), rel=1e-6)


def test_the_output_of_an_actuator_is_taken_as_straight_between_samples(fitted_model: PolynomialModel) -> None:
    record = flown(fitted_model)
    moved = predict(fitted_model, replace(record, hold=Hold.ACTUATOR), seed=1)
    np.testing.assert_array_equal(moved.predicted, predict(fitted_model, record, seed=1).predicted)


def test_without_covariance_a_prediction_has_no_uncertainty(fitted_model: PolynomialModel) -> None:
    exact = replace(fitted_model, covariance=np.zeros_like(fitted_model.covariance))
    found = predict(exact, flown(fitted_model), seed=1)
    assert (found.alpha_rmse_u95_rad, found.q_theil_u95) == (0.0, 0.0)


def test_the_uncertainty_follows_the_covariance(fitted_model: PolynomialModel) -> None:
    small = predict(fitted_model, flown(fitted_model), seed=1)
    large = predict(replace(fitted_model, covariance=9.0 * fitted_model.covariance), flown(fitted_model), seed=1)
    # The same draws three times as far away: linear up to second order in 0.3 %.
    assert large.q_rmse_u95_rad_s == pytest.approx(3.0 * small.q_rmse_u95_rad_s, rel=0.05)


def test_correlated_coefficients_are_drawn_correlated(fitted_model: PolynomialModel) -> None:
    """One unknown factor on dα/dt and dq/dt alike: a covariance of rank one."""
    errors = 1e-3 * fitted_model.coefficients
    together = replace(fitted_model, covariance=np.outer(errors, errors))
    record = flown(fitted_model)
    shifted = fitted_model.with_coefficients(1.00196 * fitted_model.coefficients)
    expected = predict(shifted, record, seed=1).alpha_rmse_rad
    # The 0.95 quantile of |N(0, 1)| is 1.96; 512 independent draws would tell it to 4 %.
    assert predict(together, record, seed=1).alpha_rmse_u95_rad == pytest.approx(expected, rel=0.08)


@pytest.mark.parametrize("order_seed", [0, 1, 2])
def test_the_order_of_the_terms_changes_no_number(fitted_model: PolynomialModel, order_seed: int) -> None:
    """Nothing but the sums of rates is rounded otherwise."""
    random = np.random.default_rng(order_seed)
    sizes = (fitted_model.alpha_dot.coefficients.size, fitted_model.q_dot.coefficients.size)
    orders = [random.permutation(size) for size in sizes]
    halves = [
        replace(half, powers=half.powers[order], coefficients=half.coefficients[order])
        for half, order in zip((fitted_model.alpha_dot, fitted_model.q_dot), orders, strict=True)
    ]
    places = np.concatenate([orders[0], sizes[0] + orders[1]])
    covariance = fitted_model.covariance[np.ix_(places, places)]
    other = PolynomialModel(alpha_dot=halves[0], q_dot=halves[1], covariance=covariance)
    record = flown(fitted_model)
    one, two = (predict(model, record, seed=1) for model in (fitted_model, other))
    for name in ("alpha_rmse_u95_rad", "q_rmse_u95_rad_s", "alpha_theil_u95", "q_theil_u95"):
        assert getattr(two, name) == pytest.approx(getattr(one, name), rel=1e-8)


def test_a_prediction_that_blows_up_is_infinitely_wrong(fitted_model: PolynomialModel) -> None:
    wild = fitted_model.with_coefficients(1e6 * fitted_model.coefficients)
    found = predict(wild, flown(fitted_model), seed=1)
    assert found.alpha_rmse_rad == math.inf
    assert found.q_peak_error_rad_s == math.inf
    assert found.alpha_theil.coefficient == 1.0
    assert not math.isnan(found.alpha_rmse_u95_rad)


def test_draws_that_blow_up_make_the_uncertainty_infinite(fitted_model: PolynomialModel) -> None:
    vague = replace(fitted_model, covariance=1e8 * fitted_model.covariance)
    found = predict(vague, flown(fitted_model), seed=1)
    assert found.alpha_rmse_rad < 1e-12
    assert found.alpha_rmse_u95_rad == math.inf


def test_the_comparison_ends_where_the_flight_leaves_the_domain(fitted_model: PolynomialModel) -> None:
    record = flown(fitted_model)
    late = record.with_columns(alpha_rad=np.where(TIME > 3.0, 0.9, record["alpha_rad"]))
    found = predict(fitted_model, late, seed=1)
    assert found.in_domain
    assert found.compared_s == pytest.approx(3.0)
    assert found.alpha_rmse_rad < 1e-12
    early = record.with_columns(alpha_rad=np.where(TIME > 0.5 * MINIMUM_COMPARED_S, 0.9, record["alpha_rad"]))
    found = predict(fitted_model, early, seed=1)
    assert not found.in_domain
    assert found.compared == len(TIME)


def plan(schedule: Schedule, *, alpha_rad: float = 0.05, duration_s: float = 4.0) -> FlightPlan:
    return FlightPlan(
        name="holdout-doublet",
        kind="doublet",
        alpha_rad=alpha_rad,
        q_rad_s=0.02,
        schedule=schedule,
        hold=Hold.FOH,
        duration_s=duration_s,
        sample_interval_s=0.01,
        alpha_limits_rad=(-0.57, 0.8),
    )


NOISE_RAD = to_si(0.1, "deg")


@pytest.mark.parametrize("duration_s", [1.0, 4.0, 9.0])
def test_a_flight_of_the_sweep_is_no_holdout(fitted_model: PolynomialModel, duration_s: float) -> None:
    noisy = flown(fitted_model, alpha_rad=0.05 + NOISE_RAD)
    sweep = Sweep(study="test", records=(noisy,))
    with pytest.raises(InputError, match=r"'holdout-doublet' is 'doublet' of the sweep") as caught:
        refuse_seen([plan(doublet(), duration_s=duration_s)], sweep, alpha_slack_rad=6 * NOISE_RAD, q_slack_rad_s=0.01)
    assert "validation.holdout" in caught.value.hint


@pytest.mark.parametrize(
    "other",
    [
        plan(doublet(at_rad=-0.11)),  # from another trim
        plan(doublet(size_rad=-0.05)),  # the other way round
        plan(doublet(size_rad=0.0500001)),
        plan(doublet(), alpha_rad=0.15),  # from another state
    ],
)
def test_another_flight_is_a_holdout(fitted_model: PolynomialModel, other: FlightPlan) -> None:
    sweep = Sweep(study="test", records=(flown(fitted_model),))
    refuse_seen([other], sweep, alpha_slack_rad=6 * NOISE_RAD, q_slack_rad_s=0.01)
