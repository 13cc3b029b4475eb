"""Input design: units that suit a mode, bounds that Monte-Carlo scatter confirms, choices that nothing beats."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.signal import lsim
from scipy.stats import chi2

from finback.arrays import FloatArray
from finback.dynamics.model import PolynomialModel
from finback.dynamics.trajectory import free_run
from finback.errors import InputError, RefusedError
from finback.flight.pulse import DOUBLET, THREE_TWO_ONE_ONE, energy_share, matched_unit
from finback.identification.design.choice import bound, d_optimal
from finback.identification.design.information import Information, PlannedFlight, form_of, information
from finback.identification.field import layout
from finback.identification.shooting import shoot
from finback.units import to_si

NOISE = (to_si(0.1, "deg"), to_si(0.1, "deg_s"))
RULE_OF_THUMB = 0.25  # the rules neglect damping and are printed with two digits
INTERVAL_S = 0.02


# multisteps


@pytest.mark.parametrize(("pulses", "rule"), [(THREE_TWO_ONE_ONE, 2.1), (DOUBLET, 2.3)])
@pytest.mark.parametrize("damping", [0.0, 0.1, 0.3, 0.5])
def test_the_unit_is_near_the_rule_of_thumb(pulses: tuple[int, ...], rule: float, damping: float) -> None:
    unit = matched_unit(frequency_rad_s=3.0, damping_ratio=damping, pulses=pulses)
    assert unit * 3.0 == pytest.approx(rule, rel=RULE_OF_THUMB)


@given(st.floats(0.3, 20.0), st.floats(0.0, 0.7))
@settings(deadline=None, max_examples=20)
def test_no_other_unit_moves_the_mode_more_and_faster_modes_want_shorter_units(
    frequency: float, damping: float
) -> None:
    unit = matched_unit(frequency_rad_s=frequency, damping_ratio=damping)
    best = energy_share(unit * frequency, damping_ratio=damping, pulses=THREE_TWO_ONE_ONE)
    others = [
        energy_share(x, damping_ratio=damping, pulses=THREE_TWO_ONE_ONE) for x in np.linspace(0.1, 5.0, 777).tolist()
    ]
    assert best >= max(others) * (1 - 1e-9)
    assert matched_unit(frequency_rad_s=2 * frequency, damping_ratio=damping) == pytest.approx(unit / 2)


def test_the_energy_is_that_of_a_simulated_mode() -> None:
    damping, unit = 0.2, 2.0
    time = np.arange(0.0, 80.0, 2e-3)
    edges = unit * np.cumsum((0, *THREE_TWO_ONE_ONE))
    levels = np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])
    wave = levels[np.searchsorted(edges, time + 1e-9, side="right")]
    rate = lsim(([1.0, 0.0], [1.0, 2 * damping, 1.0]), wave, time, interp=False)[1]
    energy = float(np.sum(rate**2) / np.sum(wave**2))
    own = 1 / (4 * damping)  # of the impulse response, which energy_share leaves out
    assert energy == pytest.approx(own * energy_share(unit, damping_ratio=damping, pulses=THREE_TWO_ONE_ONE), rel=2e-3)


def test_a_mode_that_does_not_oscillate_is_refused() -> None:
    with pytest.raises(InputError, match="mode"):
        matched_unit(frequency_rad_s=1.0, damping_ratio=1.0)
    with pytest.raises(InputError, match="pulses"):
        matched_unit(frequency_rad_s=1.0, damping_ratio=0.1, pulses=())


# bounds


def planned(
    name: str, alpha_deg: float, q_deg_s: float, elevator_deg: float, amplitude_deg: float, *, hold: str = "zoh"
) -> PlannedFlight:
    """A 3-2-1-1 near an equilibrium."""
    time = INTERVAL_S * np.arange(401)
    edges = 0.5 + 0.7 * np.cumsum((0, *THREE_TWO_ONE_ONE))
    levels = np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])
    wave = levels[np.searchsorted(edges, time + 1e-9, side="right")]
    return PlannedFlight(
        name=name,
        elevator_rad=to_si(elevator_deg + amplitude_deg * wave, "deg"),
        hold=hold,
        interval_s=INTERVAL_S,
        alpha_rad=to_si(alpha_deg, "deg"),
        q_rad_s=to_si(q_deg_s, "deg_s"),
    )


# alpha, q, elevator near equilibrium in deg and deg/s, amplitude in deg
FLIGHTS = ((2.0, 0.7, -3.2, 3.0), (9.0, 3.6, -17.5, 3.0), (16.0, 5.0, -28.5, 1.5))


@pytest.fixture(scope="module")
def told(truth: PolynomialModel) -> tuple[Information, ...]:
    return tuple(information(truth, planned(f"{i}", *flight), noise=NOISE) for i, flight in enumerate(FLIGHTS))


def test_the_predicted_flight_is_the_model_s_own(truth: PolynomialModel, told: tuple[Information, ...]) -> None:
    flight = told[1].flight
    time = INTERVAL_S * np.arange(flight.elevator_rad.size)
    states = free_run(
        truth,
        time_s=time,
        elevator_rad=flight.elevator_rad,
        hold=flight.hold,
        alpha_rad=flight.alpha_rad,
        q_rad_s=flight.q_rad_s,
    )
    np.testing.assert_allclose(told[1].states, states, atol=1e-12)


def test_the_scatter_of_maximum_likelihood_is_the_bound(truth: PolynomialModel, told: tuple[Information, ...]) -> None:
    predicted = bound(told)
    random, runs = np.random.default_rng(1), 40
    errors = np.array([fitted(truth, told, random) - truth.coefficients for _ in range(runs)])
    squares = np.einsum("ij,jk,ik->i", errors, np.linalg.inv(predicted), errors)
    # The sum of all squares has runs · 12 degrees of freedom; both ends with a chance of 1 in 1000.
    low, high = chi2.ppf([1e-3, 1 - 1e-3], runs * 12)
    assert low < squares.sum() < high
    ratio = errors.std(axis=0) / np.sqrt(np.diag(predicted))
    assert (ratio > 0.6).all()  # a standard deviation of 40 numbers is known to 11 %
    assert (ratio < 1.45).all()


def fitted(truth: PolynomialModel, told: tuple[Information, ...], random: np.random.Generator) -> FloatArray:
    """Maximum likelihood from noisy samples: three steps of Gauss and Newton from a model that is 2 % wrong."""
    form = form_of(truth)
    data = [item.states + random.normal(size=item.states.shape) * NOISE for item in told]
    guess = truth.coefficients * (1 + 0.02 * random.normal(size=truth.coefficients.size))
    starts = [np.array([item.flight.alpha_rad, item.flight.q_rad_s]) for item in told]
    size = guess.size
    for _ in range(3):
        matrix, right = np.zeros((size + 6, size + 6)), np.zeros(size + 6)
        for k, (item, measured) in enumerate(zip(told, data, strict=True)):
            solution = shoot(
                layout(form),
                guess,
                starts[k],
                item.flight.elevator_rad[:, np.newaxis],
                held=np.array([1.0]),
                samples=(0, len(measured) - 1),
                interval_s=INTERVAL_S,
                delay_s=0.0,
                substeps=2,
            )
            rows = np.zeros((*measured.shape, size + 6))
            rows[:, :, :size] = solution.sensitivity[:, :, 2 : 2 + size]
            rows[:, :, size + 2 * k : size + 2 * k + 2] = solution.sensitivity[:, :, :2]
            rows /= np.array(NOISE)[:, np.newaxis]
            matrix += np.einsum("nij,nik->jk", rows, rows)
            right += np.einsum("nij,ni->j", rows, (measured - solution.states) / NOISE)
        step = np.linalg.solve(matrix, right)
        guess = guess + step[:size]
        starts = [start + step[size + 2 * k : size + 2 * k + 2] for k, start in enumerate(starts)]
    return guess


def test_more_flights_tell_more_and_more_noise_less(truth: PolynomialModel, told: tuple[Information, ...]) -> None:
    errors = np.diag(bound(told))
    assert (np.diag(bound((*told, told[0]))) < errors).all()
    louder = information(truth, told[0].flight, noise=(2 * NOISE[0], 2 * NOISE[1]))
    np.testing.assert_allclose(4 * louder.matrix, told[0].matrix, rtol=1e-9)


def test_what_no_flight_tells_is_refused(truth: PolynomialModel) -> None:
    still = PlannedFlight(
        name="still", elevator_rad=np.zeros(100), hold="foh", interval_s=0.02, alpha_rad=0.0, q_rad_s=0.0
    )
    with pytest.raises(RefusedError, match="undetermined"):
        bound((information(truth, still, noise=NOISE),))
    wild = planned("wild", 40.0, 200.0, -40.0, 3.0)
    with pytest.raises(RefusedError, match="every bound"):
        information(truth, wild, noise=NOISE)
    with pytest.raises(InputError, match="noise"):
        information(truth, still, noise=(0.0, 1.0))


# choices


def random_candidates(seed: int, count: int = 8, size: int = 4) -> list[Information]:
    random = np.random.default_rng(seed)
    flight = PlannedFlight(name="0", elevator_rad=np.zeros(2), hold="foh", interval_s=1.0, alpha_rad=0.0, q_rad_s=0.0)
    found = []
    for i in range(count):
        rows = random.normal(size=(random.integers(1, 4), size)) * 10.0 ** random.uniform(-2, 2, size)
        named = PlannedFlight(**{name: getattr(flight, name) for name in flight.__slots__} | {"name": str(i)})
        found.append(Information(flight=named, states=np.zeros((2, 2)), matrix=rows.T @ rows))
    return found


@given(st.integers(0, 10_000))
@settings(deadline=None, max_examples=20)
def test_a_choice_is_nearly_as_good_as_trying_every_one(seed: int) -> None:
    candidates = random_candidates(seed)
    found = d_optimal(candidates, count=4)
    volume = -float(np.linalg.slogdet(found.covariance)[1])
    every = max(
        float(np.linalg.slogdet(np.sum([candidates[i].matrix for i in subset], axis=0))[1])
        for subset in combinations(range(8), 4)
    )
    assert volume == pytest.approx(every, abs=0.3)  # exchanges of one for one may end a little below the best
    assert 0.0 < found.efficiency <= 1.0 + 1e-9
    assert len(set(found.names)) == 4


def test_the_efficiency_of_the_best_mixture_is_one() -> None:
    flights = random_candidates(1, count=4, size=4)
    unit = np.eye(4)
    single = [
        Information(flight=item.flight, states=np.zeros((2, 2)), matrix=np.outer(unit[i], unit[i]))
        for i, item in enumerate(flights)
    ]
    assert d_optimal(single, count=4).efficiency == pytest.approx(1.0, abs=1e-5)
    twice = d_optimal(single, count=5, repeated=2)
    assert twice.efficiency == pytest.approx((2 / 5) ** 0.25 * (1 / 5) ** 0.75 * 4, rel=1e-4)


def test_the_chosen_flights_of_an_aircraft_beat_as_many_of_one_trim(truth: PolynomialModel) -> None:
    candidates = [
        information(truth, planned(f"{alpha:g}/{amplitude:g}", alpha, q, elevator, amplitude), noise=NOISE)
        for alpha, q, elevator, _ in FLIGHTS
        for amplitude in (1.0, 1.5, 2.0)
    ]
    found = d_optimal(candidates, count=3)
    assert {name.split("/")[0] for name in found.names} >= {"2", "16"}
    same_trim = bound([item for item in candidates if item.flight.name.startswith("9/")])
    assert (found.standard_errors < np.sqrt(np.diag(same_trim))).mean() > 0.8
    with pytest.raises(InputError, match="cannot be chosen"):
        d_optimal(candidates, count=10)
