"""A model's covariance is one that random numbers can have."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from finback.arrays import FloatArray
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
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
