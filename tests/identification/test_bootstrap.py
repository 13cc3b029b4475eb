"""Two roads to the uncertainty of coefficients, and two to that of what is computed from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.fold import folds
from finback.dynamics.model import PolynomialModel
from finback.dynamics.reduction import reduce
from finback.errors import InputError, RefusedError
from finback.identification.bootstrap import Scheme, bootstrap
from finback.identification.identify import identify
from finback.identification.method import Method
from finback.identification.options import IdentificationOptions
from finback.identification.propagation import analysis_numbers, fold_and_hopf_numbers, propagate
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
        (Scheme.BLOCK, Method.WEAK_FORM),
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


def test_both_roads_to_the_folds_agree_where_the_model_is_known(
    clean: Sweep, noisy: Noisy, options: IdentificationOptions
) -> None:
    model = identify(noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=1), options).model
    found = {number.name: number for number in propagate(model, fold_and_hopf_numbers(model))}
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
    found = propagate(vague, fold_and_hopf_numbers(vague))
    assert found
    vanishing = [number for number in found if number.existing < 0.975]
    assert vanishing
    assert not any(number.determined for number in vanishing)
    sharp = replace(truth, covariance=np.diag((1e-6 * errors) ** 2))
    assert all(number.determined for number in propagate(sharp, fold_and_hopf_numbers(sharp)))


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
