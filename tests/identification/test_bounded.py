"""Known and bounded coefficients, and terms of any kind, in the weak form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from finback.arrays import FloatArray
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.identification.bounded import solve_within
from finback.identification.identify import identify
from finback.identification.model_form import Equation, ModelForm
from finback.identification.options import IdentificationOptions
from finback.identification.term import Term
from finback.records import FlightRecord, Hold, Sweep

FORM = ModelForm.polynomial((1, 1))


def test_a_bound_is_kept_and_the_rest_is_the_best_within_it() -> None:
    random = np.random.default_rng(1)
    regressors, target = random.standard_normal((60, FORM.size)), random.standard_normal(60)
    free = np.linalg.lstsq(regressors, target, rcond=None)[0]
    low = free[2] + 0.1
    form = FORM.bound(Equation.ALPHA_DOT, Term.parse("alpha"), low, np.inf).bound(
        Equation.Q_DOT, Term.parse("alpha"), -9.0, 9.0
    )
    found = solve_within(regressors, target, form, form.known, np.arange(form.size), judged=False)
    limits = np.where(np.arange(form.size) == 2, low, -np.inf), np.full(form.size, np.inf)
    best = lsq_linear(regressors, target, bounds=limits, method="bvls").x
    np.testing.assert_allclose(found.coefficients, best, rtol=1e-10)
    assert found.coefficients[2] == low
    assert not found.covariance[2].any()
    assert (np.delete(np.diag(found.covariance), 2) > 0).all()


def test_a_known_coefficient_sharpens_the_others(
    clean: Sweep, noisy: Callable[..., Sweep], options: IdentificationOptions, exact: FloatArray
) -> None:
    sweep = noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=3)
    form = options.model_form.fix(Equation.Q_DOT, Term.parse("alpha^3"), float(exact[10]))
    loose, tight = identify(sweep, options), identify(sweep, replace(options, form=(form,)))
    assert tight.model.coefficients[10] == exact[10]
    assert tight.standard_errors[10] == 0.0
    assert (tight.standard_errors[6:] < 1.001 * loose.standard_errors[6:]).all()
    assert tight.standard_errors[8] < 0.9 * loose.standard_errors[8]


@pytest.mark.parametrize("hold", [Hold.FOH, Hold.ZOH])
def test_terms_of_any_kind_are_recovered_from_clean_flights(
    flights: Callable[..., tuple[FlightRecord, ...]], options: IdentificationOptions, truth: PolynomialModel, hold: Hold
) -> None:
    rows = dict(zip(map(tuple, truth.q_dot.powers.tolist()), truth.q_dot.coefficients.tolist(), strict=True))
    wanted = {**rows, (1, 1, 0): -0.8, (1, 0, 1): 1.5}  # alpha*q, alpha*elevator
    changed = replace(truth, q_dot=Polynomial.build(wanted, variables=VARIABLES, value_unit="rad_s2"),
                      covariance=np.zeros((14, 14)))  # fmt: skip
    polynomial = options.model_form
    form = ModelForm(
        alpha_dot=polynomial.alpha_dot, q_dot=(*polynomial.q_dot, Term.parse("alpha*q"), Term.parse("alpha*elevator"))
    )
    result = identify(Sweep(study="", records=flights(model=changed, hold=hold)), replace(options, form=(form,)))
    fitted = result.model.q_dot
    found = dict(zip(map(tuple, fitted.powers.tolist()), fitted.coefficients.tolist(), strict=True))
    # The quadrature of products is good to interval² at corners: measured 1.6e-5.
    for powers, value in wanted.items():
        assert found[powers] == pytest.approx(value, rel=1e-4), powers


def test_a_shared_rate_term_gives_the_same_model_with_a_smaller_error(
    clean: Sweep, noisy: Callable[..., Sweep], options: IdentificationOptions, exact: FloatArray
) -> None:
    sweep = noisy(clean, alpha_deg=0.1, q_deg_s=0.1, seed=4)
    form = ModelForm(
        alpha_dot=options.model_form.alpha_dot,
        q_dot=(Term.parse("q+alpha_dot"), *options.model_form.q_dot[:1], *options.model_form.q_dot[2:]),
    )
    result = identify(sweep, replace(options, form=(form,)))
    order = [result.model.q_dot.powers.tolist().index(list(row)) for row in ([0, 0, 0], [0, 1, 0], [1, 0, 0])]
    errors = result.standard_errors[6:][order]
    assert (np.abs(result.model.q_dot.coefficients[order] - exact[6:9]) < 5 * errors).all()
