"""The published model of the F-8 II as test data."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from finback.dynamics.model import PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import PaperForm, from_paper

AIRCRAFT = Path(__file__).parents[2] / "aircraft" / "f8ii"


@pytest.fixture(scope="session")
def paper_model() -> PolynomialModel:
    """The model from which the aircraft is built, exact by definition."""
    table = tomllib.loads((AIRCRAFT / "published.toml").read_text(encoding="utf-8"))
    rate, moment = table["alpha_dot_deg_s"], table["q_dot_deg_s2"]
    powers = ("constant", "alpha", "alpha2", "alpha3")
    return from_paper(
        PaperForm(
            C_zq=rate["q"] - 1.0,
            C_z=tuple(rate[name] for name in powers),
            C_zde=rate["elevator"],
            M_zq=moment["q_plus_alpha_dot"],
            M_zad=moment["q_plus_alpha_dot"],
            M_z=tuple(moment[name] for name in powers),
            M_zde=moment["elevator"],
        )
    )


@pytest.fixture(scope="session")
def fitted_model(paper_model: PolynomialModel) -> PolynomialModel:
    """The same coefficients with what a fit adds: a box of data, and standard errors of 0.1 % without correlation."""
    box = np.array([[-0.55, 0.78], [-1.5, 1.5], [-0.7, 0.35]])

    def boxed(polynomial: Polynomial) -> Polynomial:
        return Polynomial(
            variables=polynomial.variables,
            powers=polynomial.powers,
            coefficients=polynomial.coefficients,
            value_unit=polynomial.value_unit,
            domain=box,
        )

    return PolynomialModel(
        alpha_dot=boxed(paper_model.alpha_dot),
        q_dot=boxed(paper_model.q_dot),
        covariance=np.diag((1e-3 * paper_model.coefficients) ** 2),
    )
