"""Between the forms of a model: the paper's, the explicit one, one shared rate term, and the Liénard form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NoReturn, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.dual import Dual
from finback.dynamics.lienard import Curve, LienardSystem
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import RefusedError

Exponents = tuple[int, int, int]
Terms = Mapping[Exponents, Dual]
"""Exponents of (alpha, q, elevator) -> coefficient."""

_DEGREES: Final = ("alpha_deg", "q_deg_s", "elevator_deg")
_Q: Final = (0, 1, 0)
_ELEVATOR: Final = (0, 0, 1)
_ROUNDINGS: Final = 8  # conversion to SI, substitution of dα/dt, products and difference


def reduce(model: PolynomialModel) -> LienardSystem:
    """Eliminate q from a model: Eq. (4)-(11) of Shi & Fan (2013), for any orders in alpha.

    With dα/dt = A(α) + a_q q + a_δ δ and dq/dt = B(α) + b_q q + b_δ δ, differentiating the first and inserting the
    second gives f = A' + b_q, g = a_q B − b_q A, c₁ = a_q b_δ − b_q a_δ, c₂ = a_δ. This is exact.

    Raises:
        RefusedError: a term is not of that shape (such as alpha*q or elevator^2), or dα/dt does not depend on q.
    """
    alpha_dot, q_dot = _model_terms(model)
    _refuse_foreign_terms(alpha_dot, q_dot)
    zero = Dual(0.0, np.zeros(model.coefficients.size))
    a_q, a_elevator = alpha_dot.get(_Q, zero), alpha_dot.get(_ELEVATOR, zero)
    b_q, b_elevator = q_dot.get(_Q, zero), q_dot.get(_ELEVATOR, zero)
    if a_q.value == 0.0:
        raise RefusedError(
            "alpha_dot does not depend on q: the two equations are not one equation of second order",
            hint="a Liénard form needs the term q in alpha_dot (about 1)",
        )
    a, b = _in_alpha(alpha_dot), _in_alpha(q_dot)
    damping = {0: b_q} | {k - 1: c.times(k) for k, c in a.items() if k > 0}
    if 1 in a:
        damping[0] = a[1] + b_q
    force = {k: _difference(a_q * b.get(k, zero), b_q * a.get(k, zero)) for k in sorted({0} | set(a) | set(b))}
    pitch_rate = [((k, 0), -c / a_q) for k, c in a.items()] + [((0, 1), -a_elevator / a_q)]
    gain = _difference(a_q * b_elevator, b_q * a_elevator)
    box = _common_domain(model)[[VARIABLES.index("alpha_rad"), VARIABLES.index("elevator_rad")]]
    return LienardSystem(
        damping=_curve({(k,): c for k, c in damping.items()}, "1_s", box[:1]),
        force=_curve({(k,): c for k, c in force.items()}, "rad_s2", box[:1]),
        elevator_gain=gain.value,
        elevator_gain_sensitivity=gain.gradient,
        elevator_rate_gain=a_elevator.value,
        elevator_rate_gain_sensitivity=a_elevator.gradient,
        pitch_rate=_curve(dict(pitch_rate), "rad_s", box),
        pitch_rate_gain=1.0 / a_q.value,
        covariance=model.covariance,
        domain=box,
    )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PaperForm:
    """The coefficients of Eq. (4) and (5) of Shi & Fan (2013) at zero sideslip, canard, roll and yaw rate.

    dα/dt = (1 + C_zq) q + Σ C_z[k] αᵏ + C_zde δ and dq/dt = M_zq q + M_zad dα/dt + Σ M_z[k] αᵏ + M_zde δ.
    **In degrees**: alpha and δ in deg, q in deg/s, time in s, as the paper prints them; C_z[2] is in 1/(deg s).

    Attributes:
        C_zq: derivative by q, less 1.
        C_z: constant and powers of alpha, rising, any number.
        C_zde: derivative by the elevator.
        M_zq: derivative by q.
        M_zad: derivative by dα/dt.
        M_z: constant and powers of alpha, rising, any number.
        M_zde: derivative by the elevator.
    """

    C_zq: float
    C_z: tuple[float, ...]
    C_zde: float
    M_zq: float
    M_zad: float
    M_z: tuple[float, ...]
    M_zde: float


def from_paper(form: PaperForm) -> PolynomialModel:
    """Return the explicit model in SI: dα/dt substituted in Eq. (5), no covariance, no statement of a domain."""
    alpha_dot = _terms(form.C_z, 1.0 + form.C_zq, form.C_zde)
    q_dot = _terms(form.M_z, form.M_zq, form.M_zde)
    for term, value in alpha_dot.items():
        q_dot[term] = q_dot.get(term, 0.0) + form.M_zad * value
    size = len(alpha_dot) + len(q_dot)
    return PolynomialModel(
        alpha_dot=Polynomial.build(alpha_dot, variables=_DEGREES, value_unit="deg_s").to_si(),
        q_dot=Polynomial.build(q_dot, variables=_DEGREES, value_unit="deg_s2").to_si(),
        covariance=frozen_array(np.zeros((size, size))),
    )


def _terms(in_alpha: tuple[float, ...], q: float, elevator: float) -> dict[tuple[int, ...], float]:
    terms: dict[tuple[int, ...], float] = {(k, 0, 0): value for k, value in enumerate(in_alpha)}
    return terms | {(0, 1, 0): q, (0, 0, 1): elevator}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SharedRateForm:
    """dq/dt = k (q + dα/dt) + R(alpha, elevator): the paper's form with M_zq = M_zad = k.

    Attributes:
        alpha_dot: dα/dt, as in the model.
        rate_gain_1_s: k.
        rate_gain_error_1_s: its standard error.
        remainder: R in rad/s², over the variables of the model, without q.
        remainder_errors: standard errors of its coefficients, shape (terms,).
    """

    alpha_dot: Polynomial
    rate_gain_1_s: float
    rate_gain_error_1_s: float
    remainder: Polynomial
    remainder_errors: FloatArray

    def __post_init__(self) -> None:
        """Freeze the errors."""
        object.__setattr__(self, "remainder_errors", frozen_array(self.remainder_errors))


def shared_rate_form(model: PolynomialModel) -> SharedRateForm:
    """Write the moment equation with one gain k for q and dα/dt alike; errors by the delta method.

    With a_q and b_q the derivatives of dα/dt and dq/dt by q, k = b_q / (1 + a_q), and R is what remains.

    Raises:
        RefusedError: q enters not just linearly, or q + dα/dt does not depend on q.
    """
    alpha_dot, q_dot = _model_terms(model)
    _refuse_other_rates(alpha_dot, q_dot)
    zero = Dual(0.0, np.zeros(model.coefficients.size))
    rate = alpha_dot.get(_Q, zero)
    rate = Dual(1.0 + rate.value, rate.gradient)
    if rate.value == 0.0:
        raise RefusedError("q + alpha_dot does not depend on q: there is no shared rate term", hint="a_q is -1")
    gain = q_dot.get(_Q, zero) / rate
    rest = {
        term: q_dot.get(term, zero) - gain * alpha_dot.get(term, zero) for term in sorted({*alpha_dot, *q_dot} - {_Q})
    }
    return SharedRateForm(
        alpha_dot=model.alpha_dot,
        rate_gain_1_s=gain.value,
        rate_gain_error_1_s=gain.standard_error(model.covariance),
        remainder=Polynomial.build(
            {term: c.value for term, c in rest.items()},
            variables=VARIABLES,
            value_unit="rad_s2",
            domain=model.q_dot.domain,
        ),
        remainder_errors=frozen_array([c.standard_error(model.covariance) for c in rest.values()]),
    )


def _refuse_other_rates(alpha_dot: Terms, q_dot: Terms) -> None:
    foreign = [
        f"{_label(term)} in {name}"
        for name, terms in (("alpha_dot", alpha_dot), ("q_dot", q_dot))
        for term in terms
        if term != _Q and term[1] > 0
    ]
    if foreign:
        raise RefusedError(
            f"one shared rate term cannot hold {', '.join(foreign)}", hint="q may enter to the first power only, alone"
        )


def split_rate_form(model: PolynomialModel) -> NoReturn:
    """Refuse to tell M_zq and M_zad apart; the message says why.

    Raises:
        RefusedError: always.
    """
    terms = " + ".join(model.alpha_dot.labels())
    raise RefusedError(
        "M_zq and M_zalphadot cannot be told apart: alpha_dot is itself a combination of the model's terms "
        f"({terms}), so the columns q, alpha_dot and these are exactly collinear, whatever is flown",
        hint="use shared_rate_form: one gain k of (q + alpha_dot), or keep the explicit form",
    )


def _model_terms(model: PolynomialModel) -> tuple[Terms, Terms]:
    """Return the terms of dα/dt and of dq/dt with their derivatives by the model's coefficients.

    Terms that are exactly zero (no value, no variance) are left out.
    """
    size = model.coefficients.size
    unit = np.eye(size)
    powers = np.concatenate([model.alpha_dot.powers, model.q_dot.powers])
    split = model.alpha_dot.coefficients.size
    alpha_dot: dict[Exponents, Dual] = {}
    q_dot: dict[Exponents, Dual] = {}
    for i, (exponents, value) in enumerate(zip(powers.tolist(), model.coefficients.tolist(), strict=True)):
        if value != 0.0 or model.covariance[i, i] != 0.0:
            alpha, q, elevator = exponents
            (alpha_dot if i < split else q_dot)[alpha, q, elevator] = Dual(value, unit[i])
    return alpha_dot, q_dot


def _label(exponents: Exponents) -> str:
    """Return how messages write a term: ``alpha^2*q``."""
    one = Polynomial.build({exponents: 1.0}, variables=VARIABLES, value_unit="1")
    return one.labels()[0]


def _refuse_foreign_terms(alpha_dot: Terms, q_dot: Terms) -> None:
    foreign = [
        f"{_label(term)} in {name}"
        for name, terms in (("alpha_dot", alpha_dot), ("q_dot", q_dot))
        for term in terms
        if term not in (_Q, _ELEVATOR) and term[1:] != (0, 0)
    ]
    if foreign:
        raise RefusedError(
            f"the Liénard form cannot hold {', '.join(foreign)}",
            hint="it holds powers of alpha, and q and elevator to the first power only",
        )


def _difference(left: Dual, right: Dual) -> Dual:
    """Return left − right; exactly 0 where rounding alone may have left the difference.

    A remainder of 1e-17 in place of 0 as the highest coefficient would put roots at angles of 1e16.
    """
    result = left - right
    lost = abs(result.value) <= _ROUNDINGS * np.finfo(np.float64).eps * (abs(left.value) + abs(right.value))
    return Dual(0.0, result.gradient) if lost else result


def _in_alpha(terms: Terms) -> dict[int, Dual]:
    return {alpha: c for (alpha, q, elevator), c in terms.items() if q == 0 and elevator == 0}


def _common_domain(model: PolynomialModel) -> FloatArray:
    low = np.maximum(model.alpha_dot.domain[:, 0], model.q_dot.domain[:, 0])
    high = np.minimum(model.alpha_dot.domain[:, 1], model.q_dot.domain[:, 1])
    return np.stack([low, high], axis=1)


def _curve(terms: Mapping[tuple[int, ...], Dual], value_unit: str, domain: FloatArray) -> Curve:
    ordered = sorted(terms)
    variables = ("alpha_rad", "elevator_rad")[: len(ordered[0])]
    return Curve(
        polynomial=Polynomial.build(
            {key: terms[key].value for key in ordered}, variables=variables, value_unit=value_unit, domain=domain
        ),
        sensitivity=frozen_array([terms[key].gradient for key in ordered]),
    )
