"""Terms and forms of models."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.dynamics.model import PolynomialModel
from finback.dynamics.reduction import PaperForm, from_paper
from finback.errors import InputError
from finback.identification.model_form import Equation, ModelForm
from finback.identification.term import KNOWN, Monomial, Term

EXACT = 1e-12
"""Relative: a handful of products in double precision."""

MONOMIALS = st.dictionaries(st.sampled_from(KNOWN), st.integers(1, 4), max_size=3).map(
    lambda factors: Monomial(factors=tuple(factors.items()))
)
TERMS = st.lists(MONOMIALS, min_size=1, max_size=3, unique_by=lambda part: part.factors).map(
    lambda parts: Term(monomials=tuple(parts))
)


@given(TERMS)
def test_a_label_reads_back_as_its_term(term: Term) -> None:
    assert Term.parse(term.label) == term


@given(TERMS, st.lists(st.floats(-2, 2), min_size=len(KNOWN), max_size=len(KNOWN)))
def test_a_term_is_the_sum_of_its_products(term: Term, numbers: list[float]) -> None:
    values = dict(zip(KNOWN, numbers, strict=True))
    expected = sum(np.prod([values[name] ** power for name, power in part.factors]) for part in term.monomials)
    assert float(term(values)) == pytest.approx(float(expected), rel=EXACT, abs=EXACT)


@pytest.mark.parametrize("text", ["", "alpha^", "alfa", "2*alpha", "alpha**", "alpha^2q", "+", "alpha_deg", "q^0"])
def test_what_is_no_term_is_a_mistake(text: str) -> None:
    with pytest.raises(InputError):
        Term.parse(text)


def test_a_term_of_roll_and_yaw_is_one_term() -> None:
    term = Term.parse("r^2 - p^2")
    assert term({"r_rad_s": 3.0, "p_rad_s": 2.0}) == 5.0
    assert term.label == "r^2-p^2"


def test_the_polynomial_form_is_that_of_the_paper() -> None:
    form = ModelForm.polynomial((2, 4))
    assert [term.label for term in form.alpha_dot] == ["1", "q", "alpha", "alpha^2", "elevator"]
    assert form.labels()[5:] == tuple(
        f"{label} in dq/dt" for label in ("1", "q", "alpha", "alpha^2", "alpha^3", "alpha^4", "elevator")
    )
    coefficients = np.arange(1.0, form.size + 1)
    model = form.model(coefficients, np.diag(coefficients**2), [(-1.0, 1.0)] * 3)
    np.testing.assert_array_equal(model.coefficients, coefficients)
    np.testing.assert_array_equal(model.covariance, np.diag(coefficients**2))


def test_a_shared_rate_term_is_substituted_as_the_paper_does() -> None:
    paper = PaperForm(C_zq=-0.02, C_z=(0.1, -0.4), C_zde=-0.03, M_zq=-0.4, M_zad=-0.4, M_z=(2.0, -8.0), M_zde=-4.0)
    expected = from_paper(paper)
    form = ModelForm.parse(["1", "q", "alpha", "elevator"], ["q+alpha_dot", "1", "alpha", "elevator"])
    values = expected.alpha_dot
    first = [values.coefficient(**dict(term.monomials[0].factors)) for term in form.alpha_dot]
    second = [-0.4, np.deg2rad(2.0), -8.0, -4.0]
    model = form.model(np.array([*first, *second]), np.zeros((8, 8)), [(-1, 1)] * 3)
    point = (0.1, 0.2, -0.05)
    assert float(model.q_dot(*point)) == pytest.approx(float(expected.q_dot(*point)), rel=EXACT)


def test_the_covariance_is_carried_through_the_substitution() -> None:
    form = ModelForm.parse(["1", "q", "alpha", "p*r"], ["alpha*alpha_dot", "r^2-p^2", "alpha", "elevator"])
    generator = np.random.default_rng(0)
    center, root = generator.normal(size=form.size), generator.normal(size=(form.size, form.size))
    covariance = root @ root.T

    def explicit(values: np.ndarray) -> PolynomialModel:
        return form.model(values, covariance, [(-1, 1)] * len(form.variables))

    step = 1e-6
    derivative = np.stack(
        [
            (explicit(center + step * row).coefficients - explicit(center - step * row).coefficients) / (2 * step)
            for row in np.eye(form.size)
        ],
        axis=1,
    )
    expected = derivative @ covariance @ derivative.T
    np.testing.assert_allclose(explicit(center).covariance, expected, rtol=1e-7, atol=1e-7)
    assert explicit(center).inputs == ("p_rad_s", "r_rad_s")


def test_known_and_bounded_coefficients_are_told() -> None:
    form = ModelForm.polynomial((1, 1))
    known = form.fix(Equation.ALPHA_DOT, Term.parse("q"), 1.0).bound(Equation.Q_DOT, Term.parse("alpha"), -9.0, 0.0)
    assert known.free.tolist() == [0, 2, 3, 4, 5, 6, 7]
    assert known.known.tolist() == [0, 1, 0, 0, 0, 0, 0, 0]
    assert known.bounds[6].tolist() == [-9.0, 0.0]
    with pytest.raises(InputError, match="twice"):
        known.fix(Equation.ALPHA_DOT, Term.parse("q"), 1.0)
    with pytest.raises(InputError, match="no term"):
        form.fix(Equation.ALPHA_DOT, Term.parse("alpha^7"), 1.0)


@pytest.mark.parametrize(
    ("alpha_dot", "q_dot"), [(["alpha_dot"], ["1"]), (["1"], ["alpha_dot^2"]), ([], ["1"]), (["q"], ["q", "q"])]
)
def test_forms_without_meaning_are_mistakes(alpha_dot: list[str], q_dot: list[str]) -> None:
    with pytest.raises(InputError):
        ModelForm.parse(alpha_dot, q_dot)
