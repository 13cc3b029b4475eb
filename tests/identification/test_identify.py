"""Models recovered from flights of a known polynomial: to rounding without noise, to the stated errors with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import binom, chi2, norm

from finback.arrays import FloatArray
from finback.dynamics.fold import folds
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import reduce
from finback.errors import InputError, RefusedError
from finback.identification.identify import Identification, identify
from finback.identification.options import IdentificationOptions
from finback.records import FlightRecord, Hold, Sweep
from finback.units import SI_FACTORS, from_si, to_si

Flights = Callable[..., tuple[FlightRecord, ...]]
Noisy = Callable[..., Sweep]

# Quadrature with 20 samples a half width: measured 2e-7.
CLEAN_ERROR = 1e-6
# The largest of 12 normal errors is beyond 5 deviations once in 145,000 fits.
FAR = 5.0
# A statistic over seeds fails an honest fit once in 1000.
RARE = 1e-3
SEEDS = 30


@pytest.mark.parametrize("hold", [Hold.ZOH, Hold.FOH])  # test_stretch.py: an actuator
def test_noise_free_flights_give_the_truth_under_each_hold(
    flights: Flights, options: IdentificationOptions, exact: FloatArray, hold: Hold
) -> None:
    result = identify(Sweep(study="", records=flights(hold=hold)), options)
    np.testing.assert_allclose(result.model.coefficients, exact, rtol=CLEAN_ERROR)
    assert [warning.split()[0] for warning in result.warnings if "of noise, less than" in warning] == ["alpha", "q"]


def test_the_hold_of_the_elevator_matters(flights: Flights, options: IdentificationOptions, exact: FloatArray) -> None:
    blind = tuple(replace(flight, hold=Hold.FOH) for flight in flights(hold=Hold.ZOH))
    result = identify(Sweep(study="", records=blind), options)
    assert np.abs(result.model.coefficients / exact - 1).max() > 1e3 * CLEAN_ERROR


def test_noisy_flights_give_the_truth_within_the_stated_errors(
    clean: Sweep, noisy: Noisy, options: IdentificationOptions, exact: FloatArray
) -> None:
    result = identify(noisy(clean, alpha_deg=0.1, q_deg_s=0.15, seed=1), options)
    assert (np.abs(result.model.coefficients - exact) < FAR * result.standard_errors).all()
    assert result.warnings == ()
    assert result.unused == ()
    # 4,000 samples tell a deviation to 2 %.
    assert from_si(result.alpha_noise_rad, "deg") == pytest.approx(0.1, rel=0.08)
    assert from_si(result.q_noise_rad_s, "deg_s") == pytest.approx(0.15, rel=0.08)
    # 700 equations tell a mean square to 5 % and a correlation to 0.04.
    assert result.diagnostics.chi_square == pytest.approx((1.0, 1.0), abs=0.25)
    assert result.diagnostics.lag1_correlation == pytest.approx((0.0, 0.0), abs=0.2)
    assert 0.95 < result.diagnostics.used_fraction <= 1.0
    assert sum(segment.samples for segment in result.segments) <= sum(map(len, clean.records))


@pytest.fixture(scope="module", params=[0.02, pytest.param(0.3, marks=pytest.mark.slow)], ids=["0.02 deg", "0.3 deg"])
def many(
    request: pytest.FixtureRequest, clean: Sweep, noisy: Noisy, options: IdentificationOptions
) -> tuple[Identification, ...]:
    """One identification for each of many noise seeds."""
    size = float(request.param)
    seeds = range(1000, 1000 + SEEDS)
    return tuple(identify(noisy(clean, alpha_deg=size, q_deg_s=size, seed=seed), options) for seed in seeds)


def test_the_covariance_is_that_of_the_errors(many: tuple[Identification, ...], exact: FloatArray) -> None:
    distances = []
    for result in many:
        off = result.model.coefficients - exact
        # In units of the standard errors, so that the inverse is not ruled by the units of the coefficients.
        correlation = result.model.covariance / np.outer(result.standard_errors, result.standard_errors)
        scaled = off / result.standard_errors
        distances.append(scaled @ np.linalg.solve(correlation, scaled))
    low, high = chi2.ppf([RARE / 2, 1 - RARE / 2], exact.size * SEEDS)
    assert low < sum(distances) < high


def test_no_coefficient_is_biased(many: tuple[Identification, ...], exact: FloatArray) -> None:
    scaled = np.array([(result.model.coefficients - exact) / result.standard_errors for result in many])
    limit = norm.isf(RARE / 2 / exact.size) / np.sqrt(SEEDS)
    assert np.abs(scaled.mean(axis=0)).max() < limit


def test_the_intervals_of_the_folds_cover_them(many: tuple[Identification, ...], truth: PolynomialModel) -> None:
    right = np.array([fold.elevator_rad for fold in folds(reduce(truth))])
    assert right.size == 2
    hits = 0
    for result in many:
        found = folds(reduce(result.model))
        assert all(fold.in_domain for fold in found)
        intervals = np.array([fold.elevator_interval_rad for fold in found])
        hits += int(((intervals[:, 0] <= right) & (right <= intervals[:, 1])).sum())
    low, high = binom.ppf([RARE / 2, 1 - RARE / 2], 2 * SEEDS, 0.95)
    assert low <= hits <= high


@pytest.mark.parametrize(
    ("noise", "named"),
    [
        ((0.0, 0.1), ["alpha"]),
        ((0.1, 0.0), ["q"]),
        pytest.param((0.001, 0.1), ["alpha"], marks=pytest.mark.slow),
        ((0.0, 0.0), ["alpha", "q"]),
    ],
)
def test_a_channel_without_noise_does_not_make_the_intervals_false(
    noise: tuple[float, float],
    named: list[str],
    flights: Flights,
    noisy: Noisy,
    options: IdentificationOptions,
    truth: PolynomialModel,
) -> None:
    """What flies is a table of 0.1 deg; its chords lie above a curve f by step²/12 · f'' in the mean."""
    tabulated = PolynomialModel(
        alpha_dot=_chords(truth.alpha_dot), q_dot=_chords(truth.q_dot), covariance=truth.covariance
    )
    sweep = Sweep(study="", records=flights(tabulated))
    right = np.array([fold.elevator_rad for fold in folds(reduce(truth))])
    for seed in range(5):
        result = identify(noisy(sweep, alpha_deg=noise[0], q_deg_s=noise[1], seed=seed), options)
        assert [warning.split()[0] for warning in result.warnings if "of noise, less than" in warning] == named
        intervals = np.array([fold.elevator_interval_rad for fold in folds(reduce(result.model))])
        assert (intervals[:, 0] <= right).all()
        assert (right <= intervals[:, 1]).all()


def _chords(polynomial: Polynomial) -> Polynomial:
    terms = dict(zip(map(tuple, polynomial.powers.tolist()), polynomial.coefficients.tolist(), strict=True))
    raised = dict(terms)
    for (alpha, *others), coefficient in terms.items():
        if alpha >= 2:
            raised[alpha - 2, *others] += to_si(0.1, "deg") ** 2 / 12 * alpha * (alpha - 1) * coefficient
    return Polynomial.build(raised, variables=polynomial.variables, value_unit=polynomial.value_unit)


def test_other_orders_are_recovered(flights: Flights, options: IdentificationOptions, truth: PolynomialModel) -> None:
    terms = dict(zip(map(tuple, truth.q_dot.powers.tolist()), truth.q_dot.coefficients.tolist(), strict=True))
    quintic = Polynomial.build({**terms, (4, 0, 0): 6.0, (5, 0, 0): -12.0}, variables=VARIABLES, value_unit="rad_s2")
    size = truth.alpha_dot.coefficients.size + quintic.coefficients.size
    model = PolynomialModel(alpha_dot=truth.alpha_dot, q_dot=quintic, covariance=np.zeros((size, size)))
    records = flights(model)
    result = identify(Sweep(study="", records=records), replace(options, alpha_order=(3, 5)))
    for powers, coefficient in zip(quintic.powers.tolist(), quintic.coefficients, strict=True):
        found = result.model.q_dot.coefficient(**dict(zip(VARIABLES, powers, strict=True)))
        assert found == pytest.approx(coefficient, rel=10 * CLEAN_ERROR)  # more terms, less data each
    assert result.model.alpha_dot.labels() == ("1", "q", "alpha", "alpha^2", "alpha^3", "elevator")
    low = identify(Sweep(study="", records=records), replace(options, alpha_order=(3, 3)))
    assert any("form does not hold" in warning for warning in low.warnings)


@settings(max_examples=8, deadline=None)
@given(order=st.permutations(range(8)), shift=st.floats(0.0, 1e4))
def test_order_and_clock_do_not_matter(
    clean: Sweep, noisy: Noisy, options: IdentificationOptions, order: list[int], shift: float
) -> None:
    sweep = noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=2)
    moved = [record.with_columns(time_s=record["time_s"] + shift) for record in sweep.records]
    result = identify(sweep, options)
    other = identify(Sweep(study="", records=tuple(moved[i] for i in order)), options)
    # A clock of 1e4 s resolves an interval of 0.01 s to 2e-10 of it.
    np.testing.assert_allclose(other.model.coefficients, result.model.coefficients, rtol=1e-7)
    np.testing.assert_allclose(other.model.covariance, result.model.covariance, rtol=1e-5, atol=1e-16)


def test_a_record_with_a_gap_is_used_in_pieces(clean: Sweep, noisy: Noisy, options: IdentificationOptions) -> None:
    sweep = noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=3)
    whole = identify(sweep, options)
    first = sweep.records[0]
    alpha = np.array(first["alpha_rad"])
    alpha[400:403] = np.nan
    result = identify(Sweep(study="", records=(first.with_columns(alpha_rad=alpha), *sweep.records[1:])), options)
    pieces = [segment for segment in result.segments if segment.flight == first.name]
    assert [(piece.start_s, round(piece.end_s, 9)) for piece in pieces] == [(0.0, 3.99), (4.03, 8.0)]
    assert (np.abs(result.model.coefficients - whole.model.coefficients) < whole.standard_errors).all()
    rows = np.flatnonzero(np.isfinite(alpha))
    short = replace(first, columns={name: values[rows] for name, values in first.columns.items()})
    dropped = identify(Sweep(study="", records=(short, *sweep.records[1:])), options)
    np.testing.assert_array_equal(dropped.model.coefficients, result.model.coefficients)


def test_the_domain_is_the_box_of_the_data_within_the_window(clean: Sweep, options: IdentificationOptions) -> None:
    low, high = to_si(-28.0, "deg"), to_si(40.0, "deg")
    result = identify(clean, replace(options, alpha_window_rad=(low, high)))
    for polynomial in (result.model.alpha_dot, result.model.q_dot):
        alpha, q, elevator = polynomial.domain
        # The deepest release starts at -25 deg; a departure ends at the last sample before the edge: at 150 deg/s,
        # within 1.5 deg.
        assert alpha[0] == pytest.approx(to_si(-25.0, "deg"), abs=to_si(0.5, "deg"))
        assert high - to_si(1.5, "deg") < alpha[1] <= high
        assert q[0] < 0.0 < q[1]
        np.testing.assert_allclose(elevator, to_si(np.array([-35.0, 10.0]), "deg"))
    assert result.diagnostics.used_fraction < identify(clean, options).diagnostics.used_fraction


def test_degrees_taken_for_radians_are_fitted_with_a_loud_warning(
    clean: Sweep, options: IdentificationOptions, exact: FloatArray
) -> None:
    degrees = tuple(
        record.with_columns(**{name: from_si(record[name], "deg") for name in ("alpha_rad", "q_rad_s", "elevator_rad")})
        for record in clean.records
    )
    result = identify(Sweep(study="", records=degrees), options)
    assert "±180 deg" in result.warnings[0]
    assert "degrees" in result.warnings[0]
    # What the numbers say: the same model with its coefficients in degrees.
    turn = SI_FACTORS["deg"][1]
    factors = np.array([1.0 / turn, 1.0, 1.0, turn, turn**2, 1.0] * 2)
    np.testing.assert_allclose(result.model.coefficients, exact * factors, rtol=CLEAN_ERROR)
    assert result.model.alpha_dot.domain[0, 1] > np.pi


def test_a_stray_sample_beyond_half_a_turn_is_left_out_and_named(
    clean: Sweep, noisy: Noisy, options: IdentificationOptions
) -> None:
    sweep = noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=4)
    first, *others = sweep.records
    alpha = first["alpha_rad"].copy()
    alpha[len(alpha) // 2] = 4.0
    spoiled = identify(Sweep(study="", records=(first.with_columns(alpha_rad=alpha), *others)), options)
    assert any(f"1 in '{first.name}'" in warning for warning in spoiled.warnings)
    whole = identify(sweep, options)
    assert spoiled.model.alpha_dot.domain[0, 1] == pytest.approx(whole.model.alpha_dot.domain[0, 1], rel=0.01)
    shift = np.abs(spoiled.model.coefficients - whole.model.coefficients) / whole.standard_errors
    assert shift.max() < 1.0  # what little the lost samples say


def test_a_flipped_elevator_just_gives_the_other_sign(
    clean: Sweep, noisy: Noisy, options: IdentificationOptions
) -> None:
    sweep = noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=4)
    flipped = tuple(record.with_columns(elevator_rad=-record["elevator_rad"]) for record in sweep.records)
    signs = np.array([1.0, 1.0, 1.0, 1.0, 1.0, -1.0] * 2)
    result = identify(Sweep(study="", records=flipped), options)
    np.testing.assert_allclose(
        result.model.coefficients, signs * identify(sweep, options).model.coefficients, rtol=1e-9
    )


def test_residuals_beyond_the_noise_widen_the_errors(
    clean: Sweep, noisy: Noisy, options: IdentificationOptions
) -> None:
    sweep = noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=5)
    honest = identify(sweep, options)
    # A disturbance that no term of the model holds, of 2 deg/s at 1 Hz.
    shaken = tuple(
        record.with_columns(q_rad_s=record["q_rad_s"] + to_si(2.0, "deg_s") * np.sin(2 * np.pi * record["time_s"]))
        for record in sweep.records
    )
    result = identify(Sweep(study="", records=shaken), options)
    assert any("widened" in warning for warning in result.warnings)
    assert (result.standard_errors > 1.5 * honest.standard_errors).all()
    assert max(result.diagnostics.chi_square) > 2.0
    assert max(result.diagnostics.lag1_correlation) > 0.2


def test_uneven_samples_are_a_mistake_of_the_user(clean: Sweep, options: IdentificationOptions) -> None:
    first = clean.records[0]
    time = np.array(first["time_s"])
    time[1::2] += 0.002
    with pytest.raises(InputError, match=r"'multistep-0'.*not uniform in time") as caught:
        identify(Sweep(study="", records=(first.with_columns(time_s=time),)), options)
    assert "resample" in caught.value.hint
    with pytest.raises(InputError, match=r"half_width_s 0\.05 s spans 5 sample intervals"):
        identify(clean, replace(options, half_width_s=0.05, spacing_s=0.01))


def test_a_window_without_data_is_refused(clean: Sweep, options: IdentificationOptions) -> None:
    with pytest.raises(RefusedError, match="none of the 8 flights of 'clean' can be used"):
        identify(clean, replace(options, alpha_window_rad=(1.0, 2.0)))
    with pytest.raises(RefusedError, match="none of the 0 flights"):
        identify(Sweep(study="clean", records=()), options)


def test_flights_without_use_are_named(clean: Sweep, options: IdentificationOptions) -> None:
    result = identify(clean, replace(options, minimum_duration_s=7.0))
    assert {line.split(":")[0] for line in result.unused} == {f"release-{i}" for i in range(5)}
    assert all("7 s" in line for line in result.unused)


def test_too_few_equations_are_refused(
    clean: Sweep, options: IdentificationOptions, make_record: Callable[..., FlightRecord]
) -> None:
    first = clean.records[0]
    state = np.column_stack([first["alpha_rad"], first["q_rad_s"]])[:101]
    short = make_record("short", state, first["elevator_rad"][:101])
    coarse = replace(options, half_width_s=0.4, spacing_s=0.4)
    with pytest.raises(RefusedError, match="2 weak equations are too few for 12 coefficients"):
        identify(Sweep(study="", records=(short,)), coarse)


def test_an_elevator_that_never_moves_is_named(clean: Sweep, noisy: Noisy, options: IdentificationOptions) -> None:
    sweep = noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=6)
    held = tuple(record for record in sweep.records if record.name in {"release-2", "release-3"})
    with pytest.raises(RefusedError, match="1 in dalpha/dt with elevator in dalpha/dt") as caught:
        identify(Sweep(study="", records=held), options)
    assert "exactly" in caught.value.message
    assert "elevator" in caught.value.hint
    zero = tuple(record.with_columns(elevator_rad=np.zeros(len(record))) for record in held)
    with pytest.raises(RefusedError, match="nothing about: elevator in dalpha/dt, elevator in dq/dt"):
        identify(Sweep(study="", records=zero), options)


def test_alpha_that_hardly_moves_is_refused(
    noisy: Noisy, options: IdentificationOptions, make_record: Callable[..., FlightRecord]
) -> None:
    still = np.tile(to_si(np.array([5.0, 0.0]), "deg"), (2001, 1))
    elevator = to_si(1e-3 * np.sin(np.arange(2001) * 0.03), "deg")
    sweep = Sweep(study="", records=(make_record("still", still, elevator),))
    with pytest.raises(RefusedError, match=r"within the noise: .*alpha\^3"):
        identify(noisy(sweep, alpha_deg=0.1, q_deg_s=0.1, seed=7), options)
