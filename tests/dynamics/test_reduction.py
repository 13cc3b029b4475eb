"""The reduction against the printed coefficients, against the planar field, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import PaperForm, from_paper, reduce, shared_rate_form, split_rate_form
from finback.errors import RefusedError
from finback.units import from_si, si_factor

ROUNDING = 1e-13  # a few hundred roundings, relative to the size of what is compared


def _in_degrees(polynomial: Polynomial, *, value: bool) -> FloatArray:
    """Coefficients of a polynomial in alpha_rad as the paper prints them: in degrees."""
    powers = polynomial.powers[:, 0] - (1 if value else 0)
    return polynomial.coefficients * si_factor("deg") ** powers


@pytest.mark.parametrize(
    ("name", "printed", "last_digit"),
    [
        # Eq. (35)-(37), with one unit of the last printed digit.
        ("ag0", -1.211386346, 1e-9),
        ("ag1", -0.01992265993, 1e-11),
        ("ag2", 0.002050667285, 1e-12),
        ("bg0", 2.038986943, 1e-9),
        ("bg1", -8.243739010, 1e-9),
        ("bg2", -0.1379647003, 1e-10),
        ("c2", -0.03768490060652, 1e-14),
        # The last printed digit of these two is wrong: exact values, by rational arithmetic.
        ("bg3", 0.00819298799267, 1e-14),
        ("c1", -4.61985706111, 1e-11),
    ],
)
def test_the_printed_coefficients_follow(
    paper_model: PolynomialModel, name: str, printed: float, last_digit: float
) -> None:
    system = reduce(paper_model)
    values = {
        **{f"ag{k}": v for k, v in enumerate(_in_degrees(system.damping.polynomial, value=False))},
        **{f"bg{k}": v for k, v in enumerate(_in_degrees(system.force.polynomial, value=True))},
        "c1": system.elevator_gain,
        "c2": system.elevator_rate_gain,
    }
    assert values[name] == pytest.approx(printed, rel=0, abs=0.5 * last_digit)


def test_two_last_digits_of_the_paper_are_wrong(paper_model: PolynomialModel) -> None:
    system = reduce(paper_model)
    assert 0.5e-9 < abs(system.elevator_gain - -4.619857062) < 1e-9
    assert 0.5e-12 < abs(_in_degrees(system.force.polynomial, value=True)[3] - 0.008192987992) < 1e-12


_small = st.floats(-3.0, 3.0)
# Coefficients in degrees that are of size 1 in radians, as those of real models are.
_some = st.lists(_small, min_size=1, max_size=6).map(
    lambda row: tuple(value * si_factor("deg") ** (k - 1) for k, value in enumerate(row))
)
_gain = st.floats(0.3, 1.5)


@st.composite
def forms(draw: st.DrawFn) -> PaperForm:
    return PaperForm(
        C_zq=draw(_gain) - 1.0,
        C_z=draw(_some),
        C_zde=draw(_small),
        M_zq=draw(_small),
        M_zad=draw(_small),
        M_z=draw(_some),
        M_zde=draw(_small),
    )


@given(forms(), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-0.3, 0.3))
def test_eq_11_of_the_paper_term_by_term(form: PaperForm, alpha: float, beyond: float, elevator: float) -> None:
    """The paper's own formulas for f, g and b, evaluated in degrees, against the reduced system in radians."""
    system = reduce(from_paper(form))
    x, de = from_si(alpha + beyond, "deg"), from_si(elevator, "deg")
    a_q = 1.0 + form.C_zq
    f = [form.M_zq, a_q * form.M_zad, *(k * c * x ** (k - 1) for k, c in enumerate(form.C_z) if k)]
    g = [
        *(a_q * c * x**k for k, c in enumerate(form.M_z)),
        *(-form.M_zq * c * x**k for k, c in enumerate(form.C_z)),
        a_q * form.M_zde * de,
        -form.M_zq * form.C_zde * de,
    ]
    # The substituted form adds and cancels M_zad times alpha_dot, which rounds.
    size = sum(map(abs, g)) + 2.0 * abs(a_q * form.M_zad) * sum(abs(c * x**k) for k, c in enumerate(form.C_z))
    size += abs(2.0 * a_q * form.M_zad * form.C_zde * de)
    assert system.damping(alpha + beyond) == pytest.approx(sum(f), rel=0, abs=ROUNDING * (sum(map(abs, f)) + 1e-300))
    force = from_si(float(system.force(alpha + beyond)) + system.elevator_gain * elevator, "deg_s2")
    assert force == pytest.approx(sum(g), rel=0, abs=ROUNDING * (size + 1e-300))
    assert system.elevator_rate_gain == pytest.approx(form.C_zde)


@settings(max_examples=25, deadline=None)  # each example integrates an orbit
@given(forms(), st.floats(-0.1, 0.1), st.floats(-0.2, 0.2))
def test_the_second_derivative_along_an_orbit(form: PaperForm, alpha: float, q: float) -> None:
    """α'' by differencing the planar field along a flown orbit, with the elevator moving, is the Liénard equation."""
    model = from_paper(form)
    system = reduce(model)

    def elevator(t: float) -> float:
        return 0.05 * float(np.sin(3.0 * t))

    def field(t: float, state: FloatArray) -> list[float]:
        return [float(model.alpha_dot(*state, elevator(t))), float(model.q_dot(*state, elevator(t)))]

    orbit = solve_ivp(field, (0.0, 0.05), [alpha, q], method="DOP853", rtol=1e-12, atol=1e-13, dense_output=True)
    h, t = 2e-3, 0.025
    times = t + h * np.arange(-3, 4)
    rates = [field(time, orbit.sol(time))[0] for time in times]
    second = np.dot([-1, 9, -45, 0, 45, -9, 1], rates) / (60.0 * h)  # sixth-order central difference
    x = orbit.sol(t)[0]
    expected = (
        system.damping(x) * rates[3]
        + system.force(x)
        + system.elevator_gain * elevator(t)
        + system.elevator_rate_gain * 0.15 * np.cos(3.0 * t)
    )
    assert second == pytest.approx(float(expected), abs=1e-6 * (1.0 + abs(float(expected))))


def test_the_elevator_rate_gain_knows_its_uncertainty(paper_model: PolynomialModel) -> None:
    """c₂ is one coefficient of the model, so it moves with that one alone."""
    system = reduce(paper_model)
    row = paper_model.alpha_dot.term(elevator_rad=1)
    np.testing.assert_array_equal(system.elevator_rate_gain_sensitivity, np.eye(paper_model.coefficients.size)[row])
    assert system.damping.polynomial.value_unit == "1_s"


def test_pitch_rate_is_where_alpha_rests(paper_model: PolynomialModel) -> None:
    system = reduce(paper_model)
    for alpha, elevator in ((-0.3, 0.2), (0.5, -0.6)):
        q = float(system.pitch_rate(alpha, elevator))
        assert paper_model.alpha_dot(alpha, q, elevator) == pytest.approx(0.0, abs=1e-14)  # rounding of O(1) terms


def _with_terms(model: PolynomialModel, **extra: dict[tuple[int, int, int], float]) -> PolynomialModel:
    """Return the model with further terms in ``alpha_dot`` or ``q_dot`` and no covariance."""
    changed = {}
    for name, polynomial in (("alpha_dot", model.alpha_dot), ("q_dot", model.q_dot)):
        terms = dict(zip(map(tuple, polynomial.powers.tolist()), polynomial.coefficients.tolist(), strict=True))
        changed[name] = Polynomial.build(
            terms | extra.get(name, {}), variables=VARIABLES, value_unit=polynomial.value_unit, domain=polynomial.domain
        )
    size = sum(p.coefficients.size for p in changed.values())
    return PolynomialModel(**changed, covariance=np.zeros((size, size)))


def test_terms_that_the_form_cannot_hold_are_named(paper_model: PolynomialModel) -> None:
    model = _with_terms(
        paper_model, alpha_dot={(1, 1, 0): 0.1}, q_dot={(0, 0, 2): 0.1, (1, 0, 1): 0.2, (0, 2, 0): 0.1, (5, 0, 0): 1.0}
    )
    with pytest.raises(RefusedError) as caught:
        reduce(model)
    assert caught.value.message.endswith(
        "cannot hold alpha*q in alpha_dot, elevator^2 in q_dot, alpha*elevator in q_dot, q^2 in q_dot"
    )


def test_a_foreign_term_that_is_exactly_zero_is_no_term(paper_model: PolynomialModel) -> None:
    model = _with_terms(paper_model, q_dot={(1, 1, 0): 0.0})
    np.testing.assert_array_equal(reduce(model).force.ascending, reduce(paper_model).force.ascending)
    uncertain = np.zeros_like(model.covariance)
    uncertain[-1, -1] = 1e-6  # it may be there after all
    with pytest.raises(RefusedError, match=r"alpha\*q"):
        reduce(replace(model, covariance=uncertain))


def test_without_q_there_is_no_second_order(paper_model: PolynomialModel) -> None:
    with pytest.raises(RefusedError, match="does not depend on q"):
        reduce(_with_terms(paper_model, alpha_dot={(0, 1, 0): 0.0}))


def test_domain_is_where_both_equations_were_supported(paper_model: PolynomialModel) -> None:
    wide = np.array([[-0.5, 0.8], [-2.0, 2.0], [-0.6, 0.2]])
    other = np.array([[-0.6, 0.7], [-2.0, 2.0], [-0.5, 0.3]])
    model = replace(
        paper_model,
        alpha_dot=replace(paper_model.alpha_dot, domain=wide),
        q_dot=replace(paper_model.q_dot, domain=other),
    )
    np.testing.assert_array_equal(reduce(model).domain, [[-0.5, 0.7], [-0.5, 0.2]])


def test_the_shared_rate_form_gives_the_paper_back(paper_model: PolynomialModel) -> None:
    form = shared_rate_form(paper_model)
    assert form.rate_gain_1_s == pytest.approx(-0.43379543105980, rel=1e-14)
    degree = si_factor("deg")
    moments = {
        "1": 2.032347041 * degree,
        "alpha": -8.21732823573954,
        "alpha^2": -0.13571798007977 / degree,
        "alpha^3": 0.00801903617531 / degree**2,
        "elevator": -4.67496672860152,
    }
    found = dict(zip(form.remainder.labels(), form.remainder.coefficients.tolist(), strict=True))
    assert found == pytest.approx(moments, rel=1e-12)
    np.testing.assert_array_equal(form.remainder_errors, 0.0)
    assert form.rate_gain_error_1_s == 0.0


def test_errors_of_the_shared_rate_form_are_the_scatter_of_samples(paper_model: PolynomialModel) -> None:
    generator = np.random.default_rng(4)
    size = paper_model.coefficients.size
    mix = np.eye(size) + 0.3 * generator.standard_normal((size, size))  # correlated, as a fit makes them
    spread = mix * (0.003 * np.abs(paper_model.coefficients))[:, np.newaxis]
    form = shared_rate_form(replace(paper_model, covariance=spread @ spread.T))
    draws = paper_model.coefficients + generator.standard_normal((1500, size)) @ spread.T
    samples = [shared_rate_form(paper_model.with_coefficients(row)) for row in draws]
    # The standard deviation of 1500 draws is known to 1.8 %; four times that.
    assert np.std([s.rate_gain_1_s for s in samples]) == pytest.approx(form.rate_gain_error_1_s, rel=0.075)
    scatter = np.std([s.remainder.coefficients for s in samples], axis=0)
    np.testing.assert_allclose(scatter, form.remainder_errors, rtol=0.075)


def test_what_one_shared_rate_cannot_hold_is_named(paper_model: PolynomialModel) -> None:
    with pytest.raises(RefusedError, match=r"alpha\*q in q_dot"):
        shared_rate_form(_with_terms(paper_model, q_dot={(1, 1, 0): 0.1}))
    with pytest.raises(RefusedError, match="does not depend on q"):
        shared_rate_form(_with_terms(paper_model, alpha_dot={(0, 1, 0): -1.0}))


def test_a_split_is_refused_with_the_reason(paper_model: PolynomialModel) -> None:
    with pytest.raises(RefusedError, match="exactly collinear") as caught:
        split_rate_form(paper_model)
    assert "shared_rate_form" in caught.value.hint


@given(st.floats(-3.0, 3.0))
def test_any_split_gives_the_same_explicit_model(part: float) -> None:
    """Why the split is refused: moving part of M_zad elsewhere changes no explicit coefficient."""
    form = PaperForm(
        C_zq=-0.02, C_z=(0.1, -0.35, -0.01), C_zde=-0.04, M_zq=-0.4, M_zad=-0.4, M_z=(2.0, -8.0, -0.1), M_zde=-4.7
    )
    moved = replace(
        form,
        M_zad=form.M_zad - part,
        M_zq=form.M_zq + part * (1.0 + form.C_zq),
        M_z=tuple(m + part * c for m, c in zip(form.M_z, form.C_z, strict=True)),
        M_zde=form.M_zde + part * form.C_zde,
    )
    np.testing.assert_allclose(from_paper(moved).coefficients, from_paper(form).coefficients, rtol=1e-12)
