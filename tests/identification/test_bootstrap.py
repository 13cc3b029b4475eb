"""Two roads to the uncertainty of coefficients, and two to that of what is computed from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.equilibrium import equilibria
from finback.dynamics.fold import folds
from finback.dynamics.hopf import neutral_saddles
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.planar.branch import planar_branches
from finback.dynamics.planar.equilibrium import planar_equilibria
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import reduce
from finback.errors import InputError, RefusedError
from finback.identification.bootstrap import Scheme, bootstrap
from finback.identification.followed_numbers import analysis_numbers
from finback.identification.identify import identify
from finback.identification.method import Method
from finback.identification.options import IdentificationOptions
from finback.identification.propagation import PropagatedNumber, propagate
from finback.records import Sweep

Noisy = Callable[..., Sweep]
DRAWS = 30
# 30 draws tell a standard deviation to 13 %; the largest of 12 strays more than four times as far once in 1000.
FEW = 0.55
# Residuals of a fit lack what the fit took out; short flights with a start of their own lack most (measured 0.2).
LACKING = 0.3


@pytest.mark.parametrize(
    ("scheme", "method"),
    [
        (Scheme.PARAMETRIC, Method.OUTPUT_ERROR),
        pytest.param(Scheme.BLOCK, Method.WEAK_FORM, marks=pytest.mark.slow),
    ],
)
def test_fitting_again_gives_the_errors_of_the_formula(
    clean: Sweep, noisy: Noisy, options: IdentificationOptions, scheme: Scheme, method: Method
) -> None:
    some = replace(clean, records=clean.records[:4])
    sweep, asked = noisy(some, alpha_deg=0.1, q_deg_s=0.1, seed=1), replace(options, method=method)
    found = bootstrap(sweep, asked, scheme=scheme, draws=DRAWS)
    stated = identify(sweep, asked).standard_errors
    ratio = found.standard_errors / stated
    assert (np.abs(np.log(ratio)) < FEW + LACKING).all()
    assert abs(np.median(np.log(ratio))) < LACKING
    assert (np.abs(found.bias) < 5 * stated / np.sqrt(DRAWS)).all()
    inside = (found.intervals()[:, 0] < found.estimate) & (found.estimate < found.intervals()[:, 1])
    assert inside.all()


def test_whole_flights_are_drawn_only_from_many(clean: Sweep, noisy: Noisy, options: IdentificationOptions) -> None:
    sweep = noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=1)
    found = bootstrap(sweep, options, scheme=Scheme.MANEUVER, draws=12)
    assert found.refused + len(found.coefficients) == 12
    # Eight flights that differ much: the order of magnitude.
    assert (np.abs(np.log10(found.standard_errors / identify(sweep, options).standard_errors)) < 1.0).all()
    few = Sweep(study="few", records=sweep.records[:3])
    with pytest.raises(RefusedError, match="at least 5"):
        bootstrap(few, options, scheme=Scheme.MANEUVER)
    with pytest.raises(InputError):
        bootstrap(few, options, scheme=Scheme.BLOCK, draws=1)


def folds_and_hopf_points(model: PolynomialModel, *, samples: int = 512) -> list[PropagatedNumber]:
    found = propagate(model, analysis_numbers(model), samples=samples)
    return [number for number in found if number.name.startswith(("fold", "hopf"))]


def test_both_roads_to_the_folds_agree_where_the_model_is_known(
    clean: Sweep, noisy: Noisy, options: IdentificationOptions
) -> None:
    model = identify(noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=1), options).model
    found = {number.name: number for number in folds_and_hopf_points(model)}
    exact = folds(reduce(model))
    for place, fold in enumerate(sorted(exact, key=lambda point: point.alpha_rad), start=1):
        number = found[f"fold {place} elevator_rad"]
        assert number.determined
        assert number.value == fold.elevator_rad
        # Differences against the closed form of the analysis.
        np.testing.assert_allclose(number.linear_interval, fold.elevator_interval_rad, rtol=1e-6)
        width = np.diff(number.sampled_interval)[0] / np.diff(number.linear_interval)[0]
        assert width == pytest.approx(1.0, abs=0.1)  # 512 even samples tell a 95 % width to 3 %


def test_a_fold_that_errors_can_make_vanish_is_not_determined(truth: PolynomialModel) -> None:
    errors = 1.5 * np.abs(truth.coefficients)  # a cubic term without a certain sign may have no fold
    vague = replace(truth, covariance=np.diag(errors**2))
    found = folds_and_hopf_points(vague)
    assert found
    vanishing = [number for number in found if number.existing < 0.975]
    assert vanishing
    assert not any(number.determined for number in vanishing)
    sharp = replace(truth, covariance=np.diag((1e-6 * errors) ** 2))
    assert all(number.determined for number in folds_and_hopf_points(sharp))


def test_any_number_can_be_propagated(truth: PolynomialModel) -> None:
    model = replace(truth, covariance=np.diag((0.01 * truth.coefficients) ** 2))
    weights = np.arange(1.0, truth.coefficients.size + 1)
    (number,) = propagate(model, lambda one: {"sum_1": float(weights @ one.coefficients)}, samples=2000)
    exact = float(np.sqrt(weights**2 @ np.diag(model.covariance)))
    assert number.linear_error == pytest.approx(exact, rel=1e-9)
    assert np.diff(number.sampled_interval)[0] == pytest.approx(2 * 1.96 * exact, rel=0.1)
    with pytest.raises(InputError):
        propagate(model, lambda _: {}, samples=10)


@pytest.mark.parametrize(("bend", "determined"), [(0.0, True), (0.05, True), (0.3, False)])
def test_a_number_that_bends_within_its_errors_is_not_determined(
    truth: PolynomialModel, bend: float, *, determined: bool
) -> None:
    """Of x + bend x² with x of variance 1, the ends of the interval miss by bend · 1.96²; its width hardly changes."""
    first = np.zeros(truth.coefficients.size)
    first[0] = 1.0
    model = replace(truth, covariance=np.outer(first, first))

    def bent(one: PolynomialModel) -> dict[str, float]:
        x = float(one.coefficients[0] - truth.coefficients[0])
        return {"bent_1": x + bend * x**2, "straight_1": x}

    found = {number.name: number for number in propagate(model, bent)}
    assert found["straight_1"].determined
    assert found["bent_1"].determined == determined
    for number in found.values():
        assert np.diff(number.sampled_interval)[0] == pytest.approx(2 * 1.96, rel=0.1)


def test_a_point_without_a_place_has_no_properties(truth: PolynomialModel) -> None:
    """Where a point lies is judged once for all that is said of it; a property that bends says nothing of the rest."""
    first = np.zeros(truth.coefficients.size)
    first[0] = 1.0
    model = replace(truth, covariance=np.outer(first, first))

    def points(one: PolynomialModel) -> dict[str, float]:
        x = float(one.coefficients[0] - truth.coefficients[0])
        return {
            "hopf 1 alpha_rad": x + 0.3 * x**2,
            "hopf 1 elevator_rad": x,
            "hopf 1 lyapunov_1_s": x,
            "hopf 10 alpha_rad": x,
            "hopf 10 lyapunov_1_s": x,
            "hopf 10 frequency_rad_s": x + 0.3 * x**2,
        }

    found = {number.name: number for number in propagate(model, points)}
    determined = {name for name, number in found.items() if number.determined}
    assert determined == {"hopf 10 alpha_rad", "hopf 10 lyapunov_1_s"}
    assert {name for name, number in found.items() if not number.reason} == determined
    # What exists in every sample is not blamed for existing in some.
    assert found["hopf 1 alpha_rad"].reason == "too nonlinear within its errors"
    assert found["hopf 1 lyapunov_1_s"].reason == "its place: too nonlinear within its errors"


def test_every_number_of_the_analysis_is_carried(truth: PolynomialModel) -> None:
    """The covariance of one coefficient only, the elevator's in dq/dt: what depends on it is known exactly."""
    column = 6 + [tuple(row) for row in truth.q_dot.powers.tolist()].index((0, 0, 1))
    covariance = np.zeros((truth.coefficients.size,) * 2)
    covariance[column, column] = (0.01 * truth.coefficients[column]) ** 2
    domain = np.array([[-0.3, 0.5], [-1.0, 1.0], [-0.4, 0.1]])
    model = replace(
        truth,
        alpha_dot=replace(truth.alpha_dot, domain=domain),
        q_dot=replace(truth.q_dot, domain=domain),
        covariance=covariance,
    )
    found = {number.name: number for number in propagate(model, analysis_numbers(model), samples=100)}
    kinds = {name.split(",")[-1].split()[0] for name in found}
    assert {"fold", "equilibrium"} <= kinds
    for name, number in found.items():
        if name.startswith("fold") and name.endswith("alpha_rad"):
            assert number.linear_error < 2e-3  # dα/dt has a small part of the elevator too
        if name.startswith("fold") and name.endswith("elevator_rad"):
            assert number.determined
            assert number.linear_error == pytest.approx(0.01 * abs(number.value), rel=0.2)


def test_points_of_a_lienard_model_are_the_closed_form_ones_of_any_model_beside_it(truth: PolynomialModel) -> None:
    """Followed in the plane of alpha and q, against roots of the reduced equation."""
    domain = np.array([[-0.4, 0.5], [-1.0, 1.0], [-0.4, 0.1]])
    one, two = (replace(rate, domain=domain) for rate in (truth.alpha_dot, truth.q_dot))
    like = replace(truth, alpha_dot=one, q_dot=two)
    numbers = analysis_numbers(like)
    for seed in range(4):
        scatter = 1.0 + 0.02 * np.random.default_rng(seed).standard_normal(like.coefficients.size)
        model = like.with_coefficients(like.coefficients * scatter)
        found, system = numbers(model), reduce(model)
        for name, points in (("fold", folds(system)), ("neutral-saddle", neutral_saddles(system))):
            assert len(points) == 2
            for place, point in enumerate(points, start=1):
                assert found[f"{name} {place} alpha_rad"] == pytest.approx(point.alpha_rad, rel=1e-8)
                assert found[f"{name} {place} elevator_rad"] == pytest.approx(point.elevator_rad, rel=1e-8)
                assert found[f"{name} {place} q_rad_s"] == pytest.approx(point.q_rad_s, rel=1e-8)
        for elevator in domain[2].tolist():
            title = f"at elevator {np.degrees(elevator):.2f} deg, equilibrium"
            for place, point in enumerate(equilibria(system, elevator), start=1):
                real = found[f"{title} {place} eigenvalue real_1_s"]
                imag = found[f"{title} {place} eigenvalue imag_1_s"]
                assert found[f"{title} {place} alpha_rad"] == pytest.approx(point.alpha_rad, rel=1e-8)
                assert real == pytest.approx(point.eigenvalues_real_1_s[0], rel=1e-7)
                assert imag == pytest.approx(point.eigenvalues_imag_1_s[0], rel=1e-7)
    with pytest.raises(InputError, match="other"):
        numbers(planar_model(0.0))


# alpha q, q² and elevator times alpha: no Liénard form holds it; a fold, and a Hopf point before it
PLANAR = (
    {(0, 0, 0): 0.02, (0, 1, 0): 0.98, (1, 0, 0): -0.55, (2, 0, 0): 0.7, (1, 1, 0): -0.25, (0, 0, 1): -0.08},
    {
        (0, 0, 0): 0.05,
        (0, 1, 0): -0.7,
        (1, 0, 0): -3.0,
        (3, 0, 0): 9.0,
        (1, 1, 0): 5.0,
        (0, 2, 0): 0.4,
        (1, 0, 1): 0.3,
        (0, 0, 1): -3.2,
    },
)
PLANAR_DOMAIN = np.array([[-0.1, 0.35], [-0.3, 0.3], [-0.2, 0.1]])


def planar_model(relative: float) -> PolynomialModel:
    one, two = (
        Polynomial.build(terms, variables=VARIABLES, value_unit=unit, domain=PLANAR_DOMAIN)
        for terms, unit in zip(PLANAR, ("rad_s", "rad_s2"), strict=True)
    )
    values = np.concatenate([one.coefficients, two.coefficients])
    return PolynomialModel(alpha_dot=one, q_dot=two, covariance=np.diag((relative * values) ** 2))


def test_numbers_of_a_planar_model_go_by_both_roads() -> None:
    """The linear road against the intervals of the analysis, the other against samples of one per cent."""
    model = planar_model(0.01)
    found = {number.name: number for number in propagate(model, analysis_numbers(model))}
    system, box, elevators = PlanarSystem.from_model(model), np.array([[-0.4, 0.6], [-0.7, 0.7]]), (-0.4, 0.3)
    starts = [p for value in np.linspace(*elevators, 8).tolist() for p in planar_equilibria(system, value)]
    branches = planar_branches(system, elevators, box, starts)
    (fold,), (hopf,) = branches.folds, branches.hopf_points
    same = {
        "fold 1 alpha_rad": fold.state_interval[0],
        "fold 1 q_rad_s": fold.state_interval[1],
        "fold 1 elevator_rad": fold.parameter_interval,
        "hopf 1 alpha_rad": hopf.state_interval[0],
        "hopf 1 elevator_rad": hopf.parameter_interval,
        "hopf 1 frequency_rad_s": hopf.frequency_interval,
        "hopf 1 lyapunov_1_s": hopf.lyapunov_interval,
    }
    for name, interval in same.items():
        assert found[name].determined
        np.testing.assert_allclose(found[name].linear_interval, interval, rtol=1e-5)
        width = np.diff(found[name].sampled_interval)[0] / np.diff(interval)[0]
        assert width == pytest.approx(1.0, abs=0.1)
    held = [number for name, number in found.items() if "equilibrium" in name]
    assert {number.name.rsplit(" ", 1)[-1] for number in held} == {"alpha_rad", "q_rad_s", "real_1_s", "imag_1_s"}
    assert all(number.determined for number in held if number.linear_error > 0.0)


def test_a_planar_fold_that_errors_can_make_vanish_is_not_determined() -> None:
    vague = planar_model(0.3)
    found = {number.name: number for number in folds_and_hopf_points(vague, samples=64)}
    assert found
    assert not any(number.determined for number in found.values())
    nowhere = np.array([(-np.inf, np.inf)] * 3)
    one, two = (replace(rate, domain=nowhere) for rate in (vague.alpha_dot, vague.q_dot))
    with pytest.raises(InputError, match="where to look"):
        analysis_numbers(replace(vague, alpha_dot=one, q_dot=two))
