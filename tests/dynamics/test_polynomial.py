"""Polynomials with units, and the model made of two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.dynamics.model import PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError
from finback.units import from_si, to_si

ROUNDING = 1e-13  # relative to the sum of the absolute terms: some hundred roundings


def _sample() -> Polynomial:
    return Polynomial.build(
        {(0, 0): 3.0, (2, 1): -0.5, (1, 0): 2.0},
        variables=("alpha_deg", "q_deg_s"),
        value_unit="deg_s2",
        domain=[[-10.0, 20.0], [-30.0, 30.0]],
    )


def test_value_and_terms() -> None:
    polynomial = _sample()
    assert polynomial(2.0, 3.0) == 3.0 - 0.5 * 4.0 * 3.0 + 2.0 * 2.0
    np.testing.assert_array_equal(polynomial([0.0, 1.0], 1.0), [3.0, 4.5])
    assert polynomial.labels() == ("1", "alpha^2*q", "alpha")
    assert polynomial.coefficient(alpha_deg=2, q_deg_s=1) == -0.5
    assert polynomial.coefficient(alpha_deg=5) == 0.0


@given(st.floats(-40.0, 40.0), st.floats(-50.0, 50.0))
def test_conversion_to_si_is_the_same_function(alpha_deg: float, q_deg_s: float) -> None:
    polynomial = _sample()
    converted = polynomial.to_si()
    assert converted.variables == ("alpha_rad", "q_rad_s")
    assert converted.value_unit == "rad_s2"
    value = float(converted(to_si(alpha_deg, "deg"), to_si(q_deg_s, "deg_s")))
    size = 3.0 + 0.5 * alpha_deg**2 * abs(q_deg_s) + 2.0 * abs(alpha_deg)
    assert from_si(value, "deg_s2") == pytest.approx(polynomial(alpha_deg, q_deg_s), abs=ROUNDING * size)
    assert converted.contains(to_si(alpha_deg, "deg"), to_si(q_deg_s, "deg_s")) == polynomial.contains(
        alpha_deg, q_deg_s
    )


def test_derivative_is_the_central_difference() -> None:
    polynomial = _sample()
    step = 1e-4  # the polynomial is quadratic in alpha: the central difference is exact but for rounding
    difference = (polynomial(5.0 + step, 7.0) - polynomial(5.0 - step, 7.0)) / (2.0 * step)
    assert polynomial.derivative("alpha_deg")(5.0, 7.0) == pytest.approx(difference, rel=1e-9)
    with pytest.raises(InputError, match="beta_deg"):
        polynomial.derivative("beta_deg")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"coefficients": np.zeros(2)}, "as many coefficients"),
        ({"powers": np.array([[0, 0], [0, 0], [1, 0]])}, "no term stands twice"),
        ({"powers": np.array([[0, 0], [-1, 0], [1, 0]])}, "exponents >= 0"),
        ({"domain": np.zeros((3, 2))}, "domain"),
        ({"coefficients": np.array([1.0, np.nan, 2.0])}, "finite"),
        ({"variables": ("alpha", "q_deg_s")}, "names no unit"),
        ({"value_unit": "furlong"}, "unknown unit"),
    ],
)
def test_what_is_no_polynomial_is_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(_sample(), **change)


def test_asking_for_what_is_not_there() -> None:
    with pytest.raises(InputError, match="no variable beta_deg"):
        _sample().term(beta_deg=1)
    with pytest.raises(InputError, match="one value for each"):
        _sample()(1.0)


def test_arrays_cannot_be_changed_from_outside() -> None:
    given_powers = np.array([[1, 0]])
    polynomial = replace(_sample(), powers=given_powers, coefficients=np.ones(1))
    given_powers[0, 0] = 7
    assert polynomial.powers[0, 0] == 1
    with pytest.raises(ValueError, match="read-only"):
        polynomial.coefficients[0] = 2.0


def test_a_model_splits_its_coefficients_as_it_joins_them(paper_model: PolynomialModel) -> None:
    doubled = paper_model.with_coefficients(2.0 * paper_model.coefficients)
    np.testing.assert_array_equal(doubled.alpha_dot.coefficients, 2.0 * paper_model.alpha_dot.coefficients)
    np.testing.assert_array_equal(doubled.q_dot.coefficients, 2.0 * paper_model.q_dot.coefficients)


def test_a_model_takes_si_and_a_square_covariance_only(paper_model: PolynomialModel) -> None:
    with pytest.raises(InputError, match="to_si"):
        replace(paper_model, alpha_dot=_sample())
    with pytest.raises(InputError, match=r"expected \(12, 12\)"):
        replace(paper_model, covariance=np.zeros((6, 6)))
