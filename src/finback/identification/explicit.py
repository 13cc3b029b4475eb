"""The explicit model of a form: dα/dt substituted in dq/dt, with the covariance of the coefficients carried along."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.dual import Dual
from finback.dynamics.model import PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.identification.term import ALPHA_DOT, Monomial, Term

Explicit = dict[tuple[int, ...], Dual]
"""Exponents -> coefficient with its derivative by the coefficients of the form."""


def explicit_model(
    alpha_dot: Sequence[Term],
    q_dot: Sequence[Term],
    variables: tuple[str, ...],
    *,
    coefficients: FloatArray,
    covariance: FloatArray,
    domain: FloatArray,
) -> PolynomialModel:
    """Multiply out all terms, with dα/dt replaced by its own equation.

    Args:
        alpha_dot: terms of dα/dt.
        q_dot: terms of dq/dt; they may hold ``alpha_dot_rad_s`` to the first power.
        variables: of the model: alpha, q, the elevator, further inputs.
        coefficients: those of dα/dt first, shape (p,), in SI.
        covariance: of the coefficients, shape (p, p).
        domain: of the variables, shape (v, 2).
    """
    duals = [Dual(float(value), row) for value, row in zip(coefficients, np.eye(coefficients.size), strict=True)]
    first, second = multiplied_out(alpha_dot, q_dot, variables, duals)
    carry = np.array([dual.gradient for dual in (*first.values(), *second.values())])
    return PolynomialModel(
        alpha_dot=_polynomial(first, variables, "rad_s", domain),
        q_dot=_polynomial(second, variables, "rad_s2", domain),
        covariance=frozen_array(carry @ covariance @ carry.T),
    )


def multiplied_out(
    alpha_dot: Sequence[Term], q_dot: Sequence[Term], variables: tuple[str, ...], coefficients: Sequence[Dual]
) -> tuple[Explicit, Explicit]:
    """Return the explicit terms of dα/dt and of dq/dt, of coefficients with derivatives by whatever they depend on."""
    first: Explicit = {}
    for term, coefficient in zip(alpha_dot, coefficients[: len(alpha_dot)], strict=True):
        for part in term.monomials:
            _add(first, _exponents(part, variables), coefficient.times(part.weight))
    second: Explicit = {}
    for term, coefficient in zip(q_dot, coefficients[len(alpha_dot) :], strict=True):
        for part in term.monomials:
            exponents, weighted = _exponents(part, variables), coefficient.times(part.weight)
            if dict(part.factors).get(ALPHA_DOT, 0):
                for inner, value in first.items():
                    _add(second, tuple(a + b for a, b in zip(exponents, inner, strict=True)), weighted * value)
            else:
                _add(second, exponents, weighted)
    return first, second


def _exponents(part: Monomial, variables: tuple[str, ...]) -> tuple[int, ...]:
    """Return the exponents of the variables; that of dα/dt is left out."""
    powers = dict(part.factors)
    return tuple(powers.get(name, 0) for name in variables)


def _add(terms: Explicit, exponents: tuple[int, ...], value: Dual) -> None:
    terms[exponents] = terms[exponents] + value if exponents in terms else value


def _polynomial(terms: Explicit, variables: tuple[str, ...], unit: str, domain: FloatArray) -> Polynomial:
    return Polynomial.build(
        {exponents: dual.value for exponents, dual in terms.items()},
        variables=variables,
        value_unit=unit,
        domain=domain,
    )
