"""The parts of the estimator, each against another road to the same number."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import quad
from scipy.optimize import approx_fprime, least_squares

from finback.arrays import FloatArray
from finback.errors import InputError, RefusedError
from finback.identification.bump import bump
from finback.identification.collinearity import solve
from finback.identification.field import field
from finback.identification.model_form import ModelForm
from finback.identification.noise import noise_deviation
from finback.identification.options import IdentificationOptions
from finback.identification.smoothing import smooth
from finback.identification.stretch import Stretch, stretches
from finback.identification.weak_form import WeakForm, weak_form
from finback.identification.whitening import whitening
from finback.records import FlightRecord, Hold, Sweep

FORM = ModelForm.polynomial((3, 3))
OPTIONS = IdentificationOptions(alpha_window_rad=(-0.6, 0.8), half_width_s=0.1, spacing_s=0.03)
NOISE = np.array([0.002, 0.003])
# Gauss-Legendre against adaptive quadrature, both good to rounding.
ROUNDING = 1e-13


@pytest.fixture(scope="module")
def piece(clean: Sweep) -> Stretch:
    """One second of a maneuver."""
    first = clean.records[0]
    short = FlightRecord(
        name="short",
        columns={name: values[40:141] for name, values in first.columns.items()},
        outcome=first.outcome,
        note="",
        condition=first.condition,
        schedule=first.schedule,
        hold=first.hold,
    )
    return stretches(short, OPTIONS, windowed=True)[0]


@pytest.mark.parametrize("hold", list(Hold))
@given(seed=st.integers(0, 2**32 - 1))
def test_the_elevator_integral_is_exact(hold: Hold, seed: int) -> None:
    reach, interval = 10, 0.02
    elevator = np.random.default_rng(seed).standard_normal(2 * reach + 1)
    time = interval * np.arange(-reach, reach + 1)

    def integrand(t: float) -> float:
        before = min(int(np.searchsorted(time, t, side="right")) - 1, 2 * reach - 1)
        held = elevator[before] if hold is Hold.ZOH else np.interp(t, time, elevator)
        return float((1 - (t / time[-1]) ** 2) ** 5 * held)

    pieces = [quad(integrand, a, b, epsabs=1e-15)[0] for a, b in pairwise(time)]
    assert bump(reach, interval, hold).elevator @ elevator == pytest.approx(sum(pieces), abs=ROUNDING)


def test_integration_by_parts_holds_for_smooth_signals() -> None:
    weights = bump(40, 0.01, Hold.FOH)
    time = 0.01 * np.arange(-40, 41)
    signal, rate = np.sin(3 * time + 0.4), 3 * np.cos(3 * time + 0.4)
    assert -weights.slope @ signal == pytest.approx(weights.value @ rate, abs=1e-9)


def test_the_jacobian_is_the_derivative_of_the_rates() -> None:
    form = ModelForm.parse(
        ["1", "alpha^2*q", "elevator*alpha", "beta"], ["q+alpha_dot", "alpha*alpha_dot", "r^2-p^2", "elevator^2", "q^2"]
    )
    coefficients = np.random.default_rng(0).standard_normal(form.size)
    point = np.array([0.3, -0.2, 0.1, 0.2, -0.3, 0.4])  # alpha, q, elevator, beta, p, r

    def at(state: FloatArray, inputs: FloatArray, values: FloatArray) -> FloatArray:
        return field(form, values, state[np.newaxis], inputs[np.newaxis]).rates[0]

    found = field(form, coefficients, point[np.newaxis, :2], point[np.newaxis, 2:])
    first = coefficients @ np.array([1, 0.09 * -0.2, 0.03, 0.2, 0, 0, 0, 0, 0])
    second = coefficients[4:] @ np.array([-0.2 + first, 0.3 * first, 0.16 - 0.09, 0.01, 0.04])
    np.testing.assert_allclose(found.rates[0], [first, second], rtol=1e-14)
    # Forward differences of step 1e-8.
    by_state = approx_fprime(point[:2], lambda state: at(state, point[2:], coefficients), 1e-8)
    by_input = approx_fprime(point[2:], lambda inputs: at(point[:2], inputs, coefficients), 1e-8)
    by_coefficient = approx_fprime(coefficients, lambda values: at(point[:2], point[2:], values), 1e-8)
    np.testing.assert_allclose(found.jacobian[0], by_state, atol=1e-6)
    np.testing.assert_allclose(found.elevator[0], by_input[:, 0], atol=1e-6)
    np.testing.assert_allclose(found.sensitivity[0], by_coefficient, atol=1e-6)
    np.testing.assert_allclose(found.implicit[0], coefficients[4] + 0.3 * coefficients[5], rtol=1e-14)


def _target(weak: WeakForm, measured: FloatArray, coefficients: FloatArray, state: FloatArray) -> FloatArray:
    """Build the weak form anew for other measurements."""
    stretch = Stretch(
        flight="",
        start_s=0.0,
        interval_s=weak.stretch.interval_s,
        measured=measured,
        elevator_rad=weak.stretch.elevator_rad,
        hold=weak.stretch.hold,
    )
    weak = weak_form(stretch, FORM, OPTIONS)
    return weak.target(weak.sides(coefficients, state), state).ravel()


def test_whitening_is_that_of_the_noise_of_the_target(piece: Stretch, exact: FloatArray) -> None:
    weak = weak_form(piece, FORM, OPTIONS)
    state = piece.measured
    still = _target(weak, state, exact, state)
    # The target is linear in the measurements: its derivative by each sample, column by column.
    columns = []
    for index in np.ndindex(*state.shape):
        moved = np.array(state)
        moved[index] += 1.0
        columns.append(NOISE[index[1]] * (_target(weak, moved, exact, state) - still))
    covariance = np.array(columns).T @ np.array(columns)
    sides = weak.sides(exact, state)
    white = whitening([weak, weak], [sides, sides], NOISE)
    both = np.kron(np.eye(2), covariance)  # two stretches are independent
    unit = white(white(both).T)
    np.testing.assert_allclose(unit, np.eye(len(both)), atol=1e-8)  # the covariance has a condition of some 1e6


def test_regressors_and_target_agree_on_the_truth(piece: Stretch, exact: FloatArray) -> None:
    weak = weak_form(piece, FORM, OPTIONS)
    sides = weak.sides(exact, piece.measured)
    off = weak.target(sides, piece.measured) - weak.regressors(sides) @ exact
    # A quadrature with 10 samples a half width, against integrals of up to 10 deg.
    assert np.abs(off).max() < 1e-5


def test_smoothing_minimizes_what_it_says(piece: Stretch, exact: FloatArray) -> None:
    noise = np.array([0.002, 0.004])
    random = np.random.default_rng(3)
    rough = Stretch(
        flight="",
        start_s=0.0,
        interval_s=piece.interval_s,
        measured=piece.measured + noise * random.standard_normal(piece.measured.shape),
        elevator_rad=piece.elevator_rad,
        hold=piece.hold,
    )
    memory = 0.3

    def residuals(flat: FloatArray) -> FloatArray:
        state = flat.reshape(-1, 2)
        rates = field(FORM, exact, state, rough.inputs).rates
        steps = state[1:] - state[:-1] - 0.5 * rough.interval_s * (rates[1:] + rates[:-1])
        trust = memory / rough.interval_s
        return np.concatenate([((rough.measured - state) / noise).ravel(), (trust * steps / noise).ravel()])

    best = least_squares(residuals, rough.measured.ravel(), xtol=1e-14, ftol=1e-14, gtol=1e-14).x.reshape(-1, 2)
    found = smooth(rough, FORM, exact, noise=noise, memory_s=memory, start=rough.measured)
    assert np.abs((found - best) / noise).max() < 1e-3
    assert (np.std(found - piece.measured, axis=0) < 0.4 * noise).all()


@pytest.mark.parametrize("deviation", [1e-6, 0.01, 3.0])
def test_noise_is_measured_under_motion_with_jumps(deviation: float) -> None:
    random = np.random.default_rng(4)
    time = 0.01 * np.arange(3001)
    motion = 50 * deviation * np.sin(4 * time) + 200 * deviation * np.floor(time / 7)
    signals = [motion + deviation * random.standard_normal(time.size) for _ in range(4)]
    # 12,000 samples; the sixth difference tells a deviation to 1.2 % of them, four such are allowed.
    assert noise_deviation(signals) == pytest.approx(deviation, rel=0.05)
    assert noise_deviation([motion]) < 1e-6 * 50 * deviation
    assert noise_deviation([np.zeros(6)]) == 0.0


def test_solving_names_what_is_collinear() -> None:
    random = np.random.default_rng(5)
    columns = random.standard_normal((200, 3)) * [1.0, 1e-6, 1e6]  # scale must not matter
    labels = ("a", "b", "c", "d")
    four = np.column_stack([columns, 3 * columns[:, 0]])
    with pytest.raises(RefusedError, match="tell apart, exactly: a with d\n"):
        solve(four, columns @ [1.0, 1.0, 1.0], labels, judged=True)
    near = np.column_stack([columns, 3 * columns[:, 0] + 1e-3 * random.standard_normal(200)])
    target = near @ [1.0, 1e6, 1e-6, 0.0] + random.standard_normal(200)
    with pytest.raises(RefusedError, match="within the noise: a with d\n"):
        solve(near, target, labels, judged=True)
    assert solve(near, target, labels, judged=False).condition_number > 1e3


def test_solving_is_least_squares_with_its_covariance() -> None:
    random = np.random.default_rng(6)
    regressors, target = random.standard_normal((50, 3)), random.standard_normal(50)
    result = solve(regressors, target, ("a", "b", "c"), judged=False)
    np.testing.assert_allclose(result.coefficients, np.linalg.lstsq(regressors, target, rcond=None)[0], rtol=1e-12)
    np.testing.assert_allclose(result.covariance, np.linalg.inv(regressors.T @ regressors), rtol=1e-10)
    np.testing.assert_allclose(regressors.T @ result.residual, 0.0, atol=1e-12)
    assert result.variance == pytest.approx(float(result.residual @ result.residual) / 47)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"alpha_window_rad": (0.5, 0.5)}, "alpha_window_rad"),
        ({"alpha_window_rad": (float("nan"), 0.5)}, "alpha_window_rad"),
        ({"alpha_order": (0, 3)}, "alpha_order"),
        ({"half_width_s": 0.0}, "half_width_s"),
        ({"spacing_s": 0.5}, "spacing_s"),
        ({"minimum_duration_s": -1.0}, "minimum_duration_s"),
    ],
)
def test_options_without_meaning_are_mistakes(change: dict[str, object], what: str) -> None:
    build: Callable[..., IdentificationOptions] = IdentificationOptions
    with pytest.raises(InputError, match=what):
        build(**{"alpha_window_rad": (-0.5, 0.5), **change})
