"""Output error: its derivatives, its optimum, its errors, and what it does where the weak form cannot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from finback.arrays import FloatArray
from finback.dynamics.model import PolynomialModel
from finback.dynamics.trajectory import free_run
from finback.errors import RefusedError
from finback.identification.estimators import estimated
from finback.identification.field import layout
from finback.identification.identify import identify
from finback.identification.maneuver import EXTRAS, Guess, Maneuver, linearize, maneuver
from finback.identification.method import Method
from finback.identification.model_form import ModelForm
from finback.identification.noise import measured_noise
from finback.identification.nuisance import Nuisances
from finback.identification.options import IdentificationOptions
from finback.identification.shooting import Solution, shoot
from finback.identification.stretch import Stretch, stretches
from finback.records import FlightRecord, Hold, Sweep
from finback.units import to_si

Noisy = Callable[..., Sweep]
FORM = ModelForm.polynomial((3, 3))

# Runge and Kutta's rule with one step of 0.01 s at 3 rad/s against four steps: measured 3e-9 rad.
RULE = 1e-8
# Central differences of step 1e-6 in double precision; a delay at a sample has one side only: of step 1e-6, measured
# 4e-5.
SLOPE = 1e-5
ONE_SIDED = 1e-4
RARE = 1e-3


@pytest.fixture(scope="module")
def oe(options: IdentificationOptions) -> IdentificationOptions:
    return replace(options, method=Method.OUTPUT_ERROR)


def _elevator() -> FloatArray:
    steps = np.random.default_rng(0).normal(scale=0.03, size=9)
    return np.repeat(steps, 50)[:401]


def _shoot(coefficients: FloatArray, start: FloatArray, *, held: float, bias: float, delay: float) -> Solution:
    return shoot(
        layout(FORM),
        coefficients,
        start,
        (_elevator() - bias)[:, np.newaxis],
        held=np.array([held]),
        samples=(0, 400),
        interval_s=0.01,
        delay_s=delay,
        substeps=1,
    )


@pytest.mark.parametrize("hold", [Hold.ZOH, Hold.FOH])
def test_shooting_is_the_free_run(truth: PolynomialModel, exact: FloatArray, hold: Hold) -> None:
    found = _shoot(exact, np.array([0.1, 0.02]), held=float(hold is Hold.ZOH), bias=0.0, delay=0.0)
    expected = free_run(
        truth, time_s=0.01 * np.arange(401), elevator_rad=_elevator(), hold=hold.value, alpha_rad=0.1, q_rad_s=0.02
    )
    np.testing.assert_allclose(found.states, expected, atol=RULE)


@pytest.mark.parametrize("held", [0.0, 1.0])
@pytest.mark.parametrize("delay", [0.0, 0.013, -0.0234])
def test_the_sensitivities_are_derivatives(exact: FloatArray, held: float, delay: float) -> None:
    start, step = np.array([0.1, 0.02]), 1e-6
    unknowns = np.concatenate([start, exact, [0.0, delay]])

    def states(values: FloatArray) -> FloatArray:
        return _shoot(values[2:14], values[:2], held=held, bias=values[14], delay=values[15]).states

    found = _shoot(exact, start, held=held, bias=0.0, delay=delay).sensitivity
    for column, row in enumerate(np.eye(unknowns.size)):
        one_sided = column == 15 and delay == 0.0
        low = unknowns if one_sided else unknowns - step * row
        slope = (states(unknowns + step * row) - states(low)) / (step if one_sided else 2 * step)
        off = np.abs(found[:, :, column] - slope).max() / np.abs(slope).max()
        assert off < (ONE_SIDED if one_sided else SLOPE), column


def _begun(clean: Sweep, options: IdentificationOptions, exact: FloatArray) -> tuple[Stretch, Maneuver, Guess]:
    (piece,) = stretches(clean.records[-1], options, windowed=True)
    one, guess = maneuver(piece, FORM, exact, piece.measured)
    return piece, one, guess


def test_jumps_at_nodes_are_closed_to_first_order(
    clean: Sweep, options: IdentificationOptions, exact: FloatArray
) -> None:
    _, one, guess = _begun(clean, options, exact)
    assert len(guess.nodes) > 3
    wrong = replace(guess, nodes=guess.nodes + 1e-4 * np.random.default_rng(1).standard_normal(guess.nodes.shape))
    right, off = linearize(one, FORM, exact, guess), linearize(one, FORM, exact, wrong)
    assert np.abs(right.residual).max() < RULE
    moved_start = off.derivative[:, :, :2] @ (guess.nodes[0] - wrong.nodes[0])
    # What is left is of second order in jumps of 1e-4 rad, times the model's curvature.
    assert np.abs(off.residual - moved_start).max() < 1e-5
    assert np.abs(off.open_residual).max() > 1e-4


def test_clean_flights_give_the_truth(clean: Sweep, oe: IdentificationOptions, exact: FloatArray) -> None:
    result = identify(clean, oe)
    np.testing.assert_allclose(result.model.coefficients, exact, rtol=1e-6)  # the rule's 1e-8 rad
    assert result.options.method is Method.OUTPUT_ERROR


def test_the_estimate_has_the_errors_it_states(
    clean: Sweep, noisy: Noisy, oe: IdentificationOptions, exact: FloatArray
) -> None:
    results = [identify(noisy(clean, alpha_deg=0.3, q_deg_s=0.5, seed=seed), oe) for seed in range(12)]
    z = np.array([(result.model.coefficients - exact) / result.standard_errors for result in results])
    correlation = results[0].model.covariance / np.outer(results[0].standard_errors, results[0].standard_errors)
    squares = np.einsum("si,ij,sj->s", z, np.linalg.inv(correlation), z).sum()
    assert chi2.ppf(RARE / 2, z.size) < squares < chi2.isf(RARE / 2, z.size)
    noise = np.mean([(result.alpha_noise_rad, result.q_noise_rad_s) for result in results], axis=0)
    np.testing.assert_allclose(noise, to_si(np.array([0.3, 0.5]), "deg"), rtol=0.03)


def test_it_is_no_worse_than_the_weak_form(
    clean: Sweep, noisy: Noisy, options: IdentificationOptions, oe: IdentificationOptions
) -> None:
    sweep = noisy(clean, alpha_deg=0.3, q_deg_s=0.5, seed=2)
    # Its bound is the least there is; both find their noise to 2 %.
    assert (identify(sweep, oe).standard_errors < 1.05 * identify(sweep, options).standard_errors).all()


def _shifted(sweep: Sweep, biases: FloatArray, delay_samples: int) -> Sweep:
    """Add biases (flights, 3) of alpha, q and elevator; the recorded elevator is early by some samples."""
    records = []
    for record, (alpha, q, elevator) in zip(sweep.records, biases, strict=True):
        early = np.append(record["elevator_rad"][delay_samples:], [record["elevator_rad"][-1]] * delay_samples)
        records.append(
            record.with_columns(
                alpha_rad=record["alpha_rad"] + alpha, q_rad_s=record["q_rad_s"] + q, elevator_rad=early + elevator
            )
        )
    return replace(sweep, records=tuple(records))


@pytest.mark.parametrize("method", list(Method))
def test_biases_and_a_delay_of_each_flight_are_found(
    clean: Sweep, noisy: Noisy, options: IdentificationOptions, exact: FloatArray, method: Method
) -> None:
    oe = replace(options, method=method)
    size = to_si(0.5, "deg")
    biases = size * np.random.default_rng(3).standard_normal((len(clean.records), 3))
    sweep = _shifted(noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=5), biases, 2)
    nuisances = Nuisances(alpha_bias_rad=size, q_bias_rad_s=size, elevator_bias_rad=size, elevator_delay_s=0.05)
    blind, seeing = identify(sweep, oe), identify(sweep, replace(oe, nuisances=nuisances))
    off = np.abs(seeing.model.coefficients - exact) / seeing.standard_errors
    assert (off < 5.0).all()
    # A negative control: without them the fit is far off, in the same units.
    missed = np.abs(blind.model.coefficients - exact) / seeing.standard_errors
    assert missed.max() > 4 * off.max()
    assert blind.diagnostics.coloring > 1.0
    delays = np.array([flight.elevator_delay_s for flight in seeing.nuisances])
    errors = np.array([flight.elevator_delay_error_s for flight in seeing.nuisances])
    moving = errors < 0.01  # a release has no elevator to be delayed
    assert moving.sum() >= 3
    assert (np.abs(delays - 0.02)[moving] < 5 * errors[moving]).all()


def test_biases_that_no_data_can_tell_are_refused(clean: Sweep, noisy: Noisy, oe: IdentificationOptions) -> None:
    free = replace(oe, nuisances=Nuisances(alpha_bias_rad=np.inf, q_bias_rad_s=np.inf, elevator_bias_rad=np.inf))
    with pytest.raises(RefusedError):
        identify(noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=5), free)


def test_an_unstable_flight_is_fitted_whole(
    make_record: Callable[..., FlightRecord], oe: IdentificationOptions, truth: PolynomialModel
) -> None:
    """An airframe of negative stiffness, flown by feedback: its errors grow e-fold in less than a second, for 12 s."""
    changed = truth.coefficients.copy()
    column = 6 + [tuple(row) for row in truth.q_dot.powers.tolist()].index((1, 0, 0))
    changed[column] = 3.0
    model = truth.with_coefficients(changed)
    state, elevator = _flown_by_feedback(model, 1201)
    random = np.random.default_rng(8)
    noise = to_si(0.1, "deg") * random.standard_normal(state.shape)
    record = make_record("unstable", state + noise, elevator, hold=Hold.ZOH)
    form = ModelForm.polynomial((1, 1))
    result = identify(Sweep(study="", records=(record,)), replace(oe, form=(form,)))
    slope = result.model.q_dot.coefficient(alpha_rad=1)
    assert slope == pytest.approx(3.0, abs=5 * result.standard_errors[6])  # 5 deviations, some 0.15
    assert result.standard_errors[6] < 0.04
    assert result.diagnostics.iterations < 30


def _flown_by_feedback(model: PolynomialModel, count: int) -> tuple[FloatArray, FloatArray]:
    """Hold alpha near a square wave of 1 deg by q̇-like feedback on alpha and q."""
    state, elevator = np.zeros((count, 2)), np.zeros(count)
    state[0] = 0.0, 0.0
    for i in range(count - 1):
        wanted = to_si(1.0, "deg") * (1.0 if (i // 150) % 2 else -1.0)
        elevator[i] = 4.0 * (state[i, 0] - wanted) + 1.0 * state[i, 1]
        state[i + 1] = free_run(
            model,
            time_s=[0.0, 0.01],
            elevator_rad=[elevator[i]] * 2,
            hold="zoh",
            alpha_rad=state[i, 0],
            q_rad_s=state[i, 1],
        )[1]
    elevator[-1] = elevator[-2]
    return state, elevator


def test_columns_of_extras_stand_where_they_are_said_to(
    clean: Sweep, options: IdentificationOptions, exact: FloatArray
) -> None:
    piece, one, guess = _begun(clean, options, exact)
    step = 1e-6
    base = linearize(one, FORM, exact, guess)
    for extra in range(EXTRAS):
        moved = replace(guess, extras=step * np.eye(EXTRAS)[extra])
        slope = (base.residual - linearize(one, FORM, exact, moved).residual) / step
        column = base.derivative[:, :, one.local - EXTRAS + extra]
        # One-sided, and the jumps that a bias of the elevator opens are closed to first order.
        assert np.abs(column - slope).max() < 1e-3 * max(np.abs(column).max(), 1.0), extra
    assert len(piece) == len(base.states)


def test_the_noise_of_short_records_is_not_taken_for_less(
    truth: PolynomialModel, oe: IdentificationOptions, make_record: Callable[..., FlightRecord]
) -> None:
    """24 unknowns take 6.5 % of the freedom of 372 numbers: else the variance would come out at 0.935."""
    seeds, time = 40, 0.04 * np.arange(31)
    asked = replace(oe, half_width_s=0.4, spacing_s=0.1)
    steps = 4.0 * np.where(time < 0.4, 1.0, np.where(time < 0.8, -1.0, 0.0))
    flown = []
    for alpha, elevator in ((-10.0, 8.0), (0.0, 0.0), (8.0, -14.0), (16.0, -27.0), (12.0, -20.0), (-5.0, 3.0)):
        held = to_si(elevator + steps, "deg")
        start = {"alpha_rad": to_si(alpha + 2.0, "deg"), "q_rad_s": to_si(-4.0, "deg_s")}
        state = free_run(truth, time_s=time, elevator_rad=held, hold="zoh", **start)
        flown.append((f"trim {alpha}", state, held))
    random, noise, ratios = np.random.default_rng(0), to_si(0.1, "deg"), []
    for _ in range(seeds):
        records = [
            make_record(name, state + noise * random.standard_normal(state.shape), held, hold=Hold.ZOH, interval_s=0.04)
            for name, state, held in flown
        ]
        used = [piece for record in records for piece in stretches(record, asked, windowed=True)]
        ratios.append((estimated(used, asked, measured_noise(used)).noise / noise) ** 2)
    count = seeds * (2 * len(flown) * time.size - 24)
    assert count * np.mean(ratios) == pytest.approx(count, abs=4 * np.sqrt(2 * count))


# A slow, damped aircraft at 50 Hz, in the order of FORM_50: with noise of 0.1 deg the nodes begin 0.12 standard
# deviations apart, and closing them costs some tenths of the log-likelihood.
FORM_50 = ModelForm.parse(["1", "alpha", "q", "alpha^2", "elevator"], ["1", "alpha", "q", "alpha^3", "elevator"])
SLOW = np.array([0.05, -1.1, 0.98, 0.8, -0.1, -0.1, -5.0, -1.4, -12.0, -5.0])
# Trims: elevator, alpha, q in rad and rad/s.
TRIMS_50 = ((-0.02, 0.01132, -0.04046), (-0.12, 0.08965, 0.03080), (-0.22, 0.16441, 0.08901))


def _slow_flights(seed: int, make_record: Callable[..., FlightRecord]) -> Sweep:
    random = np.random.default_rng(seed)
    model = FORM_50.model(SLOW, np.zeros((10, 10)), np.array([[-1.0, 1.0]] * 3))
    time = 0.02 * np.arange(751)
    steps = np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])
    moved = to_si(3.0, "deg") * steps[np.searchsorted(1.0 + 0.6 * np.cumsum([0, 3, 2, 1, 1]), time + 1e-9)]
    records = []
    for trim, alpha, q in TRIMS_50:
        state = free_run(model, time_s=time, elevator_rad=trim + moved, hold="zoh", alpha_rad=alpha, q_rad_s=q)
        state = state + to_si(0.1, "deg") * random.standard_normal(state.shape)
        records.append(make_record(f"trim {trim}", state, trim + moved, hold=Hold.ZOH, interval_s=0.02))
    return Sweep(study="slow", records=tuple(records))


@pytest.mark.parametrize("seed", [1, 16, 24])
def test_closing_jumps_at_nodes_does_not_stop_the_estimate(seed: int, make_record: Callable[..., FlightRecord]) -> None:
    options = IdentificationOptions(alpha_window_rad=(-1.0, 1.0), form=(FORM_50,), method=Method.OUTPUT_ERROR)
    used = [
        piece
        for record in _slow_flights(seed, make_record).records
        for piece in stretches(record, options, windowed=True)
    ]
    found = estimated(used, options, measured_noise(used))
    assert found.converged
    assert found.iterations <= 10
