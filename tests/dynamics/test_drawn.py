"""Models drawn from a covariance: the same in every order of the terms, and spread as the covariance says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.arrays import FloatArray, IntArray
from finback.dynamics.drawn import covariance_root, drawn_coefficients
from finback.dynamics.model import PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError

VARIABLES = ("alpha_rad", "q_rad_s", "elevator_rad", "canard_rad", "beta_rad")
TERMS = ((0, 0, 0, 0, 0), (1, 0, 0, 0, 0), (3, 0, 0, 0, 0), (0, 1, 0, 0, 0), (0, 0, 1, 0, 0), (1, 0, 0, 1, 1))
DRAWS = 64
# 4096 evenly spread draws; independent ones would tell a variance to 0.022, and 21 of them to three times that.
SPREAD = 0.05


def polynomial(unit: str, scale: float) -> Polynomial:
    values = scale * np.array([0.1, -2.0, 7.0, 0.9, -4.0, 30.0])
    return Polynomial.build(dict(zip(TERMS, values.tolist(), strict=True)), variables=VARIABLES, value_unit=unit)


def covariance(rank: int) -> FloatArray:
    """Correlated, over four orders of magnitude."""
    mix = np.random.default_rng(3).standard_normal((2 * len(TERMS), rank))
    return mix @ mix.T * np.outer(*(2 * [np.logspace(-4.0, 0.0, 2 * len(TERMS))]))


@pytest.fixture(scope="module")
def model() -> PolynomialModel:
    return PolynomialModel(
        alpha_dot=polynomial("rad_s", 1.0), q_dot=polynomial("rad_s2", 10.0), covariance=covariance(2 * len(TERMS))
    )


def reordered(model: PolynomialModel, first: IntArray, second: IntArray) -> tuple[PolynomialModel, IntArray]:
    places = np.concatenate([first, len(TERMS) + second])
    halves = [
        replace(half, powers=half.powers[order], coefficients=half.coefficients[order])
        for half, order in ((model.alpha_dot, first), (model.q_dot, second))
    ]
    moved = model.covariance[np.ix_(places, places)]
    return PolynomialModel(alpha_dot=halves[0], q_dot=halves[1], covariance=moved), places


@given(first=st.permutations(range(len(TERMS))), second=st.permutations(range(len(TERMS))))
def test_another_order_of_terms_draws_the_same_models(
    model: PolynomialModel, first: list[int], second: list[int]
) -> None:
    other, places = reordered(model, np.array(first), np.array(second))
    drawn = drawn_coefficients(model, DRAWS, seed=5)
    np.testing.assert_array_equal(drawn_coefficients(other, DRAWS, seed=5), drawn[:, places])


def test_another_order_of_inputs_draws_the_same_models(model: PolynomialModel) -> None:
    order = [0, 1, 2, 4, 3]
    halves = [
        replace(half, variables=tuple(VARIABLES[i] for i in order), powers=half.powers[:, order], domain=half.domain)
        for half in (model.alpha_dot, model.q_dot)
    ]
    other = PolynomialModel(alpha_dot=halves[0], q_dot=halves[1], covariance=model.covariance)
    np.testing.assert_array_equal(drawn_coefficients(other, DRAWS, seed=5), drawn_coefficients(model, DRAWS, seed=5))


def test_a_coefficient_that_is_exact_is_not_drawn_and_moves_no_other(model: PolynomialModel) -> None:
    kept = np.ones(2 * len(TERMS), dtype=np.bool_)
    kept[2] = False
    exact = replace(model, covariance=np.where(np.outer(kept, kept), model.covariance, 0.0))
    drawn = drawn_coefficients(exact, DRAWS, seed=5)
    assert (drawn[:, 2] == model.coefficients[2]).all()
    short = np.array([0, 1, 3, 4, 5])
    left = PolynomialModel(
        alpha_dot=replace(
            model.alpha_dot, powers=model.alpha_dot.powers[short], coefficients=model.alpha_dot.coefficients[short]
        ),
        q_dot=model.q_dot,
        covariance=model.covariance[np.ix_(kept, kept)],
    )
    np.testing.assert_array_equal(drawn_coefficients(left, DRAWS, seed=5), drawn[:, kept])


@pytest.mark.parametrize("rank", [1, 5, 12])
def test_draws_are_spread_as_the_covariance_says(model: PolynomialModel, rank: int) -> None:
    uncertain = replace(model, covariance=covariance(rank))
    scale = np.sqrt(np.diag(uncertain.covariance))
    scaled = (drawn_coefficients(uncertain, 4096, seed=1) - model.coefficients) / scale
    np.testing.assert_allclose(scaled.mean(axis=0), 0.0, atol=SPREAD / 3)
    np.testing.assert_allclose(
        scaled.T @ scaled / len(scaled), uncertain.covariance / np.outer(scale, scale), atol=SPREAD
    )


def test_seeds_differ_exact_models_do_not_and_none_is_no_number_of_draws(model: PolynomialModel) -> None:
    assert (drawn_coefficients(model, 3, seed=0) != drawn_coefficients(model, 3, seed=1)).all()
    exact = replace(model, covariance=np.zeros_like(model.covariance))
    np.testing.assert_array_equal(drawn_coefficients(exact, 2, seed=0), np.tile(model.coefficients, (2, 1)))
    with pytest.raises(InputError):
        drawn_coefficients(model, 0, seed=0)


def test_the_root_of_a_covariance_is_one_and_keeps_its_order() -> None:
    """Rank 3 of 5, sizes over eight orders of magnitude, one number known exactly."""
    part = np.random.default_rng(2).standard_normal((5, 3)) * np.array([[1e-4], [1.0], [0.0], [1e4], [3.0]])
    covariance = part @ part.T
    root = covariance_root(covariance)
    deviations = np.sqrt(np.diag(covariance)) + np.array([0.0, 0.0, 1.0, 0.0, 0.0])
    np.testing.assert_allclose((root @ root.T - covariance) / np.outer(deviations, deviations), 0.0, atol=1e-12)
    assert not root[2].any()
    assert not root[:, 2].any()
    order = np.array([3, 1, 4, 2, 0])
    turned = covariance_root(covariance[np.ix_(order, order)])
    # A root of what is zero but for rounding is the root of rounding.
    np.testing.assert_allclose((turned - root[np.ix_(order, order)]) / deviations[order, np.newaxis], 0.0, atol=1e-6)
