"""Terms that are found: the published ones and no others, and searches that agree with trying everything."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError, RefusedError
from finback.identification.identify import identify
from finback.identification.model_form import ModelForm
from finback.identification.options import IdentificationOptions
from finback.identification.selection.equations import Equations
from finback.identification.selection.library import library, polynomial_terms
from finback.identification.selection.options import SelectionOptions
from finback.identification.selection.path import orthogonal_order, walk
from finback.identification.selection.regression import Regression
from finback.identification.selection.search import best_subset
from finback.identification.selection.select import Selection, select
from finback.identification.selection.stability import stability
from finback.identification.term import Term
from finback.records import FlightRecord, Hold, Sweep

CUBIC = library(polynomial_terms(("alpha", "q", "elevator"), 3))
PUBLISHED = ("1", "alpha", "q", "elevator", "alpha^2", "alpha^3")
NONE = np.array([], dtype=np.int64)
ROUNDING = 1e-9
PRICE = 12.0
SHARED = -0.43364  # of q+alpha_dot: the published model's coefficient (Shi & Fan 2013, Eq. 5)


def chosen_labels(selection: Selection) -> set[str]:
    return set(selection.form.labels())


def labels_of(alpha_dot: tuple[str, ...], q_dot: tuple[str, ...]) -> set[str]:
    return set(ModelForm.parse(alpha_dot, q_dot).labels())


# libraries


def test_the_cubic_library_of_three_variables_has_twenty_terms() -> None:
    assert CUBIC.sizes == (20, 20)
    assert {term.label for term in CUBIC.alpha_dot} >= {"1", "alpha*q*elevator", "q^2*elevator", "alpha^3"}


def test_candidates_with_alpha_dot_stand_in_the_pitch_equation_only() -> None:
    form = library(polynomial_terms(("alpha", "q"), 1), further_q_dot=polynomial_terms(("alpha_dot",), 1))
    assert form.sizes == (3, 4)
    assert form.q_dot[-1].label == "alpha_dot"


def test_mistakes_in_a_library_are_named() -> None:
    with pytest.raises(InputError, match="different variables"):
        polynomial_terms(("alpha", "alpha"), 2)
    with pytest.raises(InputError, match="at most"):
        polynomial_terms(("alpha", "q", "elevator", "beta"), 8)
    with pytest.raises(InputError, match="false_alarm"):
        SelectionOptions(library=CUBIC, false_alarm=0.0)


# the search


def collinear_problem(seed: int, columns: int = 9, rows: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Columns that hang together, of which three make the target, and noise of variance 1."""
    random = np.random.default_rng(seed)
    regressors = random.normal(size=(rows, columns)) @ random.normal(size=(columns, columns))
    regressors *= 10.0 ** random.uniform(-3, 3, columns)
    truth = random.choice(columns, 3, replace=False)
    lengths = np.sqrt((regressors**2).sum(axis=0))
    weights = random.choice([-1, 1], 3) * random.uniform(5.0, 30.0, 3) / lengths[truth]
    return regressors, regressors[:, truth] @ weights + random.normal(size=rows)


@given(st.integers(0, 10_000))
@settings(deadline=None, max_examples=25)
def test_the_search_is_as_good_as_trying_every_subset(seed: int) -> None:
    regressors, target = collinear_problem(seed)
    regression = Regression.of(regressors, target)
    found = best_subset(regression, prices=np.full(9, PRICE), start=NONE)
    every = min(
        float(((target - (x := regressors[:, subset]) @ np.linalg.lstsq(x, target)[0]) ** 2).sum()) + PRICE * size
        for size in range(6)
        for subset in map(list, combinations(range(9), size))
    )
    criterion = regression.misfit(found) + PRICE * found.size
    # A local search may miss what needs two exchanges at once, by less than one term is worth.
    assert every - ROUNDING * every <= criterion <= every + PRICE


def test_a_regression_gives_the_coefficients_and_gains_of_least_squares() -> None:
    regressors, target = collinear_problem(3)
    regression, subset = Regression.of(regressors, target), np.array([1, 4, 6])
    values, covariance = regression.solution(subset)
    known, left = np.linalg.lstsq(regressors[:, subset], target)[:2]
    np.testing.assert_allclose(values, known, rtol=1e-8)
    np.testing.assert_allclose(covariance @ (regressors[:, subset].T @ regressors[:, subset]), np.eye(3), atol=1e-8)
    gains, misfit = regression.gains(subset)
    assert misfit == pytest.approx(float(left[0]))
    with_two = np.linalg.lstsq(regressors[:, [1, 2, 4, 6]], target)[1]
    assert gains[2] == pytest.approx(misfit - float(with_two[0]), rel=1e-6)


# orthogonal functions


def as_equations(seed: int) -> Equations:
    regressors, target = collinear_problem(seed)
    return Equations(regressors=regressors, target=target, blocks=np.arange(target.size) // 5)


def test_the_path_explains_in_falling_order_and_press_is_leave_one_out() -> None:
    equations = as_equations(5)
    order = orthogonal_order(equations.regressors, equations.target, np.arange(9))
    steps = walk(equations, order[:4], tuple("abcdefghi"), prices=np.full(9, PRICE), kept_out=(equations,))
    x, y = equations.regressors[:, order[:4]], equations.target
    errors = []
    for row in range(y.size):
        keep = np.arange(y.size) != row
        errors.append(float(y[row] - x[row] @ np.linalg.lstsq(x[keep], y[keep])[0]))
    assert steps[-1].press == pytest.approx(float(np.mean(np.square(errors))), rel=1e-6)
    assert steps[-1].prediction == pytest.approx(steps[-1].mean_square, rel=1e-6)  # it was fitted to these
    assert steps[-1].predicted_squared_error == pytest.approx(steps[-1].mean_square + 4 * PRICE / y.size)
    alone = (equations.regressors.T @ y) ** 2 / (equations.regressors**2).sum(axis=0) / (y @ y)
    assert steps[0].explained == pytest.approx(float(alone.max()))


def test_a_selection_that_hangs_by_noise_is_not_stable() -> None:
    random = np.random.default_rng(6)
    regressors = random.normal(size=(400, 6))
    clear = Equations(
        regressors=regressors, target=3.0 * regressors[:, 0] + random.normal(size=400), blocks=np.arange(400) // 4
    )
    weak = replace(clear, target=clear.target + PRICE**0.5 / 20.0 * regressors[:, 1])
    for equations, lowest, highest in ((clear, 0.9, 1.0), (weak, 0.1, 0.9)):
        found = best_subset(equations.regression(), prices=np.full(6, PRICE), start=NONE)
        repeated = stability(equations, found, prices=np.full(6, PRICE), count=60, seed=1)
        assert repeated.frequency[0] == 1.0
        assert lowest <= repeated.same <= highest
    assert 0.1 < repeated.frequency[1] < 0.9


# selection from flights


@pytest.fixture(scope="module")
def measured(clean: Sweep, noisy: Callable[..., Sweep]) -> Sweep:
    return noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=1)


@pytest.fixture(scope="module")
def published(measured: Sweep, options: IdentificationOptions) -> Selection:
    return select(
        measured, options, SelectionOptions(library=CUBIC, bootstraps=5, prediction=("multistep-1", "release-2"))
    )


def test_the_published_terms_are_found_and_no_others(published: Selection) -> None:
    assert chosen_labels(published) == labels_of(PUBLISHED, PUBLISHED)
    assert published.orders == (3, 3)
    assert published.warnings == ()
    assert 0.9 < published.variance < 1.1
    assert all((item.evidence > published.price) == item.chosen for item in published.candidates)
    assert published.same >= 0.8
    assert set(published.collinearity.labels) == chosen_labels(published)
    assert published.collinearity.unknown == ()


def test_the_predicted_error_press_and_the_kept_flights_agree(published: Selection) -> None:
    assert {step.term for step in published.path[:12]} == chosen_labels(published)
    pse = [step.predicted_squared_error for step in published.path]
    assert int(np.argmin(pse)) == 11
    assert published.path[11].press < 1.1
    assert 0.8 < published.path[11].prediction < 1.2
    assert published.path[9].prediction > 2.0


OTHER_ONE = {(0, 0, 0): 0.01, (1, 0, 0): -0.6, (0, 1, 0): 0.95, (0, 0, 1): -0.08, (1, 1, 0): -0.9, (1, 0, 1): 0.7}
OTHER_TWO = {(0, 0, 0): 0.05, (1, 0, 0): -6.0, (0, 1, 0): -0.9, (0, 0, 1): -6.0, (1, 1, 0): -5.0, (1, 0, 1): 8.0}
OTHER_TWO[0, 0, 2] = 9.0


def other_model() -> PolynomialModel:
    """A model with q·alpha, alpha·elevator and elevator² but no power of alpha above the first."""
    rates = [
        Polynomial.build(terms, variables=VARIABLES, value_unit=unit)
        for terms, unit in ((OTHER_ONE, "rad_s"), (OTHER_TWO, "rad_s2"))
    ]
    return PolynomialModel(alpha_dot=rates[0], q_dot=rates[1], covariance=np.zeros((13, 13)))


@pytest.mark.parametrize("hold", [Hold.FOH, Hold.ZOH])
def test_terms_of_another_model_are_found_too(
    flights: Callable[..., tuple[FlightRecord, ...]],
    noisy: Callable[..., Sweep],
    options: IdentificationOptions,
    hold: Hold,
) -> None:
    records = [flight for flight in flights(other_model(), hold) if len(flight) > 100]
    sweep = noisy(Sweep(study="other", records=tuple(records)), alpha_deg=0.1, q_deg_s=0.1, seed=2)
    found = select(sweep, options, SelectionOptions(library=CUBIC, bootstraps=0))
    assert chosen_labels(found) == labels_of(
        ("1", "alpha", "q", "elevator", "alpha*q", "alpha*elevator"),
        ("1", "alpha", "q", "elevator", "alpha*q", "alpha*elevator", "elevator^2"),
    )
    assert found.orders == (1, 1)
    assert found.same == 0.0


def test_an_alpha_dot_term_that_says_nothing_new_is_left_to_the_explicit_ones(
    measured: Sweep, options: IdentificationOptions
) -> None:
    candidates = library(
        polynomial_terms(("alpha", "q", "elevator"), 3), further_q_dot=polynomial_terms(("alpha_dot",), 1)
    )
    found = select(measured, options, SelectionOptions(library=candidates, bootstraps=0))
    assert chosen_labels(found) == labels_of(PUBLISHED, PUBLISHED)
    assert found.determined
    (note,) = found.warnings
    assert note.startswith("q and alpha_dot in dq/dt cannot be told apart")
    low, high = (float(part.replace("−", "-")) for part in note.split(" = ")[1].split(";")[0].split(" … "))
    assert low < SHARED < high


Rates = Callable[[np.ndarray, np.ndarray], np.ndarray]


def coupled_rates(state: np.ndarray, inputs: np.ndarray, coupled: float) -> np.ndarray:
    """A rolling, slipping aircraft: alpha·beta in dα/dt, p·r and r² - p² in dq/dt (Shi & Fan 2013, Eq. 3 to 5).

    It has a canard, whose part in dq/dt shrinks with alpha. ``coupled`` is 0 or 1: without these, or with them.
    """
    (alpha, q), (elevator, canard, p, r, beta) = state, inputs
    return np.array(
        [
            0.98 * q
            - 0.35 * alpha
            - 0.57 * alpha**2
            + 2.2 * alpha**3
            - 0.04 * elevator
            - coupled * (0.4 * alpha * beta + 0.07 * canard),
            -8.0 * alpha
            - 0.86 * q
            - 4.7 * elevator
            - 7.5 * alpha**2
            + 25.0 * alpha**3
            + coupled * (0.9 * p * r + 0.15 * (r**2 - p**2) + 2.5 * canard - 3.0 * alpha * canard),
        ]
    )


def coupled_flight(
    make_record: Callable[..., FlightRecord], number: int, alpha: float, elevator: float, rates: Rates
) -> FlightRecord:
    """Integrate under random sums of sines on elevator, canard, p, r and beta, straight between samples."""
    random, interval = np.random.default_rng(number), 0.01
    time = interval * np.arange(1501)
    sizes = np.array([0.05, 0.06, 0.8, 0.5, 0.1])  # rad and rad/s
    waves = random.uniform(0.1, 1.2, (5, 8)), random.uniform(0.0, 6.28, (5, 8))
    sines = np.sin(2 * np.pi * waves[0] * time[:, np.newaxis, np.newaxis] + waves[1]).sum(axis=2)
    inputs = np.array([elevator, 0.0, 0.0, 0.0, 0.0]) + sizes / np.sqrt(8) * sines
    states = np.empty((time.size, 2))
    states[0] = alpha, 0.0
    for i in range(time.size - 1):
        x, middle = states[i], 0.5 * (inputs[i] + inputs[i + 1])
        one = rates(x, inputs[i])
        two = rates(x + 0.5 * interval * one, middle)
        three = rates(x + 0.5 * interval * two, middle)
        four = rates(x + interval * three, inputs[i + 1])
        states[i + 1] = x + interval / 6 * (one + 2 * two + 2 * three + four)
    record = make_record(f"coupled-{number}", states, inputs[:, 0])
    _, canard, p, r, beta = inputs.T
    return record.with_columns(canard_rad=canard, p_rad_s=p, r_rad_s=r, beta_rad=beta)


@pytest.mark.parametrize("coupled", [1.0, 0.0])
def test_coupling_terms_are_found_among_all_candidates_where_there_are_some(
    make_record: Callable[..., FlightRecord],
    noisy: Callable[..., Sweep],
    options: IdentificationOptions,
    coupled: float,
) -> None:
    starts = ((0.1, -0.15), (0.2, -0.3), (0.0, 0.0))
    flights = tuple(
        coupled_flight(make_record, i, *start, partial(coupled_rates, coupled=coupled))
        for i, start in enumerate(starts)
    )
    sweep = noisy(Sweep(study="coupled", records=flights), alpha_deg=0.1, q_deg_s=0.1, seed=1)
    further = ("canard", "alpha*canard", "canard^2", "beta", "alpha*beta")
    candidates = library(
        (*CUBIC.alpha_dot, *map(Term.parse, further)),
        further_q_dot=map(Term.parse, ("p*r", "r^2-p^2", "beta^2", "alpha_dot")),
    )
    found = select(sweep, options, SelectionOptions(library=candidates, bootstraps=0))
    both = ("alpha", "q", "elevator", "alpha^2", "alpha^3")
    if not coupled:
        assert chosen_labels(found) == labels_of(both, both)
        assert any(note.startswith("left out") and "canard in dq/dt" in note for note in found.warnings)
        return
    coupling = ("p*r", "r^2-p^2", "canard", "alpha*canard")
    assert chosen_labels(found) == labels_of((*both, "alpha*beta", "canard"), (*both, *coupling))
    model = identify(sweep, replace(options, selection=(found.options,))).model
    assert model.q_dot.coefficient(p_rad_s=1, r_rad_s=1) == pytest.approx(0.9, rel=0.02)
    assert model.q_dot.coefficient(r_rad_s=2) == -model.q_dot.coefficient(p_rad_s=2)


def rated(state: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """The same dα/dt with the canard and alpha·beta; of these, dq/dt knows dα/dt only."""
    rate = float(coupled_rates(state, inputs, 1.0)[0])
    return np.array([rate, -6.0 * state[0] - 0.7 * state[1] - 7.0 * inputs[0] - 0.9 * rate])


def test_q_and_alpha_dot_are_told_apart_where_alpha_dot_has_causes_of_its_own(
    make_record: Callable[..., FlightRecord],
    noisy: Callable[..., Sweep],
    options: IdentificationOptions,
) -> None:
    flights = tuple(coupled_flight(make_record, i, 0.1 * i, -0.08 * i, rated) for i in range(3))
    sweep = noisy(Sweep(study="rated", records=flights), alpha_deg=0.1, q_deg_s=0.1, seed=1)
    candidates = library(
        (*polynomial_terms(("alpha", "q", "elevator"), 2), *map(Term.parse, ("alpha^3", "canard", "alpha*beta"))),
        further_q_dot=[Term.parse("alpha_dot")],
    )
    found = select(sweep, options, SelectionOptions(library=candidates, bootstraps=0))
    both = ("alpha", "q", "elevator")
    assert chosen_labels(found) == labels_of(
        (*both, "alpha^2", "alpha^3", "canard", "alpha*beta"), (*both, "alpha_dot")
    )
    assert found.collinearity.unknown == ()


def test_a_term_that_the_library_lacks_raises_the_price(measured: Sweep, options: IdentificationOptions) -> None:
    quadratic = library(polynomial_terms(("alpha", "q", "elevator"), 2))
    found = select(measured, options, SelectionOptions(library=quadratic, bootstraps=0))
    assert found.variance > 2.0
    assert found.price > 2.0 * PRICE
    assert any("lacks something" in note for note in found.warnings)


def test_what_cannot_be_selected_is_refused(measured: Sweep, options: IdentificationOptions) -> None:
    names = tuple(record.name for record in measured.records)
    with pytest.raises(InputError, match="every flight"):
        select(measured, options, SelectionOptions(library=CUBIC, prediction=names))
    with pytest.raises(InputError, match="no flight"):
        select(measured, options, SelectionOptions(library=CUBIC, prediction=("absent",)))
    narrow = replace(options, alpha_window_rad=(0.78, 0.79))
    with pytest.raises(RefusedError, match="none of the flights"):
        select(measured, narrow, SelectionOptions(library=CUBIC))
