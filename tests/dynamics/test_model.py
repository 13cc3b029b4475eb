"""A model's covariance is one that random numbers can have."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from finback.arrays import FloatArray
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.trajectory import free_run
from finback.errors import InputError

SIZE = 4
DOMAIN = [(-1.0, 1.0)] * 3


def model(covariance: FloatArray) -> PolynomialModel:
    terms = {(0, 0, 0): 0.1, (1, 0, 0): 1.0}
    return PolynomialModel(
        alpha_dot=Polynomial.build(terms, variables=VARIABLES, value_unit="rad_s", domain=DOMAIN),
        q_dot=Polynomial.build(terms, variables=VARIABLES, value_unit="rad_s2", domain=DOMAIN),
        covariance=covariance,
    )


@given(
    factor=arrays(np.float64, (SIZE, 2), elements=st.floats(-1.0, 1.0)),
    scale=arrays(np.float64, SIZE, elements=st.sampled_from([1e-8, 1e-3, 1.0, 1e4])),
)
def test_every_product_of_factors_is_a_covariance(factor: FloatArray, scale: FloatArray) -> None:
    # Of rank 2 at most, so two eigenvalues are nothing but rounding.
    scaled = np.where(np.abs(factor) < 1e-6, 0.0, factor) * scale[:, None]
    covariance = scaled @ scaled.T
    assert model(covariance).covariance.tobytes() == covariance.tobytes()


def changed(*changes: tuple[int, int, float]) -> FloatArray:
    covariance = np.eye(SIZE) * 1e-6
    for row, column, value in changes:
        covariance[row, column] = value
    return covariance


@pytest.mark.parametrize(
    ("covariance", "says"),
    [
        (np.eye(3), "shape"),
        (changed((0, 0, np.nan)), "not finite"),
        (changed((1, 0, np.inf), (0, 1, np.inf)), "not finite"),
        (changed((2, 2, -1e6)), "negative variance"),
        (changed((2, 2, -1e-30)), "negative variance"),
        (changed((2, 2, 0.0), (0, 2, 1e-9), (2, 0, 1e-9)), "without variance"),
        (changed((0, 1, 2e-6), (1, 0, 2e-6)), "exceeds"),
        (changed((0, 1, 1e308), (1, 0, 1e308)), "exceeds"),
        (changed((0, 1, 1e-7)), "not symmetric"),
        (
            changed((0, 1, 9e-7), (1, 0, 9e-7), (0, 2, 9e-7), (2, 0, 9e-7), (1, 2, -9e-7), (2, 1, -9e-7)),
            "not positive semidefinite",
        ),
    ],
)
def test_what_no_random_numbers_can_have_is_refused(covariance: FloatArray, says: str) -> None:
    with pytest.raises(InputError, match=says):
        model(covariance)


def test_a_model_exact_by_definition_has_no_covariance() -> None:
    assert not model(np.zeros((SIZE, SIZE))).covariance.any()


# further inputs

WIDE = (*VARIABLES, "canard_rad", "beta_rad")
BOX = [(-1.0, 1.0)] * 3 + [(-0.2, 0.2), (-0.1, 0.3)]


def wide(covariance: FloatArray | None = None) -> PolynomialModel:
    lift = {(0, 1, 0, 0, 0): 1.0, (1, 0, 0, 0, 0): -0.5, (1, 0, 0, 0, 1): 0.25, (0, 0, 0, 1, 0): 0.125}
    moment = {(1, 0, 0, 0, 0): -8.0, (1, 0, 0, 2, 0): 2.0, (0, 0, 0, 0, 1): 4.0}
    return PolynomialModel(
        alpha_dot=Polynomial.build(lift, variables=WIDE, value_unit="rad_s", domain=BOX),
        q_dot=Polynomial.build(moment, variables=WIDE, value_unit="rad_s2", domain=BOX),
        covariance=np.zeros((7, 7)) if covariance is None else covariance,
    )


inside = st.floats(-0.1, 0.2)


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), inside, inside)
def test_held_inputs_are_substituted(alpha: float, q: float, canard: float, beta: float) -> None:
    model = wide()
    held = model.held(beta_rad=beta, canard_rad=canard)
    assert (held.inputs, held.alpha_dot.variables) == ((), VARIABLES)
    for full, short in ((model.alpha_dot, held.alpha_dot), (model.q_dot, held.q_dot)):
        # A few roundings of terms of size 10.
        assert short(alpha, q, 0.3) == pytest.approx(float(full(alpha, q, 0.3, canard, beta)), rel=0, abs=1e-14)
    one = model.held(canard_rad=canard)
    assert one.inputs == ("beta_rad",)
    again = one.held(beta_rad=beta)
    np.testing.assert_allclose(again.coefficients, held.coefficients, rtol=1e-14, atol=1e-300)


def test_the_covariance_of_held_inputs_is_that_of_the_sums() -> None:
    factor = np.random.default_rng(2).standard_normal((7, 7))
    held = wide(factor @ factor.T).held(beta_rad=0.2, canard_rad=-0.1)
    assert held.alpha_dot.labels() == ("q", "alpha", "1")
    assert held.q_dot.labels() == ("alpha", "1")
    carry = np.array(
        [
            [1, 0, 0, 0, 0, 0, 0],
            [0, 1, 0.2, 0, 0, 0, 0],
            [0, 0, 0, -0.1, 0, 0, 0],
            [0, 0, 0, 0, 1, 0.01, 0],
            [0, 0, 0, 0, 0, 0, 0.2],
        ]
    )
    np.testing.assert_allclose(held.covariance, carry @ factor @ factor.T @ carry.T, rtol=0, atol=1e-14)


def test_a_value_of_zero_drops_terms_and_one_outside_empties_the_domain() -> None:
    held = wide().held(beta_rad=0.0, canard_rad=0.0)
    assert (held.alpha_dot.labels(), held.q_dot.labels()) == (("q", "alpha"), ("alpha",))
    assert held.alpha_dot.contains(0.5, 0.0, 0.0)
    outside = wide().held(beta_rad=-0.2, canard_rad=0.0)
    assert not outside.alpha_dot.contains(0.5, 0.0, 0.0)
    assert (outside.alpha_dot.domain[:, 0] > outside.alpha_dot.domain[:, 1]).all()


@pytest.mark.parametrize(
    ("values", "says"),
    [({"gamma_rad": 0.1}, "gamma_rad"), ({"alpha_rad": 0.1}, "alpha_rad"), ({"beta_rad": np.nan}, "beta_rad = nan")],
)
def test_what_cannot_be_held_is_named(values: dict[str, float], says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        wide().held(**values)
    assert "beta_rad" in caught.value.hint


def test_inputs_are_in_si_and_alike_in_both_equations() -> None:
    short = Polynomial.build({(1, 0, 0): 1.0}, variables=VARIABLES, value_unit="rad_s2")
    with pytest.raises(InputError, match="same variables"):
        PolynomialModel(alpha_dot=wide().alpha_dot, q_dot=short, covariance=np.zeros((5, 5)))
    degrees = Polynomial.build({(0, 1, 0, 0): 1.0}, variables=(*VARIABLES, "canard_deg"), value_unit="rad_s")
    with pytest.raises(InputError, match="canard_deg"):
        PolynomialModel(alpha_dot=degrees, q_dot=degrees, covariance=np.zeros((2, 2)))


def test_a_free_run_needs_held_inputs() -> None:
    still = {"time_s": [0.0, 0.1], "elevator_rad": [0.0, 0.0], "hold": "foh", "alpha_rad": 0.1, "q_rad_s": 0.0}
    with pytest.raises(InputError, match="free run: the model has further inputs"):
        free_run(wide(), **still)
    assert np.isfinite(free_run(wide().held(beta_rad=0.1, canard_rad=0.0), **still)).all()
