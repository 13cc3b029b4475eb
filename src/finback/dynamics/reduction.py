"""Between the forms of a model: the paper's, the explicit one, one shared rate term, and the Liénard form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NoReturn, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.dual import Dual
from finback.dynamics.lienard import Curve, LienardSystem
from finback.dynamics.lienard_form import Exponents, Terms, lienard_form, model_terms, term_label
from finback.dynamics.model import INPUT, VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import RefusedError
from finback.units import from_si

_DEGREES: Final = ("alpha_deg", "q_deg_s", "elevator_deg")
_FURTHER: Final = ("canard_deg", "beta_deg", "p_rad_s", "r_rad_s")
_Q: Final = (0, 1, 0)


def reduce(model: PolynomialModel) -> LienardSystem:
    """Eliminate q from a model: Eq. (4)-(11) of Shi & Fan (2013), for any orders in alpha.

    With dα/dt = A(α) + a_q q + a_δ δ and dq/dt = B(α) + b_q q + b_δ δ, differentiating the first and inserting the
    second gives f = A' + b_q, g = a_q B − b_q A, c₁ = a_q b_δ − b_q a_δ, c₂ = a_δ. This is exact. Where a_δ = 0, b_q
    may be a polynomial in alpha.

    ``lienard_form`` gives the same equation with every input free to move.

    Raises:
        InputError: the model has further inputs that nobody holds.
        RefusedError: a term is not of that shape (such as elevator^2), or dα/dt does not depend on q.
    """
    model.refuse_inputs("reduce")
    alpha_dot, q_dot = model_terms(model)
    _refuse_foreign_terms(alpha_dot, q_dot, model)
    form = lienard_form(model)
    gain, rate_gain = _part(form.force, 1), _part(form.rate_gain(INPUT), 0)
    return LienardSystem(
        damping=_part(form.damping, 0),
        force=_part(form.force, 0),
        elevator_gain=float(gain(0.0)),
        elevator_gain_sensitivity=gain.gradient(0.0),
        elevator_rate_gain=float(rate_gain(0.0)),
        elevator_rate_gain_sensitivity=rate_gain.gradient(0.0),
        pitch_rate=form.pitch_rate,
        pitch_rate_gain=form.pitch_rate_gain,
        covariance=form.covariance,
        domain=form.force.polynomial.domain,
    )


def _part(curve: Curve, power: int) -> Curve:
    """Return what multiplies this power of the elevator in a curve in alpha and the elevator: a curve in alpha."""
    polynomial = curve.polynomial
    keep = polynomial.powers[:, 1] == power
    return Curve(
        polynomial=Polynomial(
            variables=polynomial.variables[:1],
            powers=polynomial.powers[keep, :1],
            coefficients=polynomial.coefficients[keep],
            value_unit=polynomial.value_unit,
            domain=polynomial.domain[:1],
        ),
        sensitivity=curve.sensitivity[keep],
    )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PaperForm:
    """The coefficients of Eq. (4) and (5) of Shi & Fan (2013).

    dα/dt = (1 + C_zq) q + Σ C_z[k] αᵏ + C_zde δ + C_zdc δ_c + C_zab α β and
    dq/dt = M_zq q + M_zad dα/dt + Σ M_z[k] αᵏ + M_zde δ + M_zdc δ_c + f_q(p, r), with f_q of Eq. (3):
    f_pr p r + f_rr (r² − p²).
    **In degrees**: alpha and δ in deg, q in deg/s, time in s, as the paper prints them; C_z[2] is in 1/(deg s).

    Attributes:
        C_zq: derivative by q, less 1.
        C_z: constant and powers of alpha, rising, any number.
        C_zde: derivative by the elevator.
        M_zq: derivative by q.
        M_zad: derivative by dα/dt.
        M_z: constant and powers of alpha, rising, any number.
        M_zde: derivative by the elevator.
        C_zdc: derivative of dα/dt by the canard.
        M_zdc: derivative of dq/dt by the canard.
        C_zab: coefficient of alpha times sideslip, in 1/(deg s).
        f_pr: (I_z − I_x)/I_y, a pure number: the term is in rad/s² for roll and yaw rates in rad/s.
        f_rr: I_xz/I_y, likewise.
    """

    C_zq: float
    C_z: tuple[float, ...]
    C_zde: float
    M_zq: float
    M_zad: float
    M_z: tuple[float, ...]
    M_zde: float
    C_zdc: float = 0.0
    M_zdc: float = 0.0
    C_zab: float = 0.0
    f_pr: float = 0.0
    f_rr: float = 0.0


def from_paper(form: PaperForm) -> PolynomialModel:
    """Return the explicit model in SI: dα/dt substituted in Eq. (5), no covariance, no statement of a domain.

    Its further inputs are those that have an effect, of ``canard_rad``, ``beta_rad``, ``p_rad_s``, ``r_rad_s``.
    """
    alpha_dot = _terms(form.C_z, q=1.0 + form.C_zq, elevator=form.C_zde, canard=form.C_zdc)
    if form.C_zab:
        alpha_dot[1, 0, 0, 0, 1, 0, 0] = form.C_zab
    q_dot = _terms(form.M_z, q=form.M_zq, elevator=form.M_zde, canard=form.M_zdc)
    for term, value in alpha_dot.items():
        q_dot[term] = q_dot.get(term, 0.0) + form.M_zad * value
    turning = {(1, 1): form.f_pr, (0, 2): form.f_rr, (2, 0): -form.f_rr}
    q_dot |= {(0,) * 5 + rates: from_si(value, "deg_s2") for rates, value in turning.items() if value}
    used = [column for column in range(3, 7) if any(term[column] for term in (*alpha_dot, *q_dot))]
    variables = (*_DEGREES, *(_FURTHER[column - 3] for column in used))
    size = len(alpha_dot) + len(q_dot)

    def polynomial(terms: Mapping[Exponents, float], unit: str) -> Polynomial:
        kept = {(*term[:3], *(term[column] for column in used)): value for term, value in terms.items()}
        return Polynomial.build(kept, variables=variables, value_unit=unit).to_si()

    return PolynomialModel(
        alpha_dot=polynomial(alpha_dot, "deg_s"),
        q_dot=polynomial(q_dot, "deg_s2"),
        covariance=frozen_array(np.zeros((size, size))),
    )


def _terms(in_alpha: tuple[float, ...], *, q: float, elevator: float, canard: float) -> dict[Exponents, float]:
    """Return terms over alpha, q, elevator, canard, beta, p, r; the canard's only if it has an effect."""
    terms: dict[Exponents, float] = {(k, *(0,) * 6): value for k, value in enumerate(in_alpha)}
    terms |= {(0, 1, 0, 0, 0, 0, 0): q, (0, 0, 1, 0, 0, 0, 0): elevator}
    return terms | ({(0, 0, 0, 1, 0, 0, 0): canard} if canard else {})


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
    model.refuse_inputs("shared_rate_form")
    alpha_dot, q_dot = model_terms(model)
    _refuse_other_rates(alpha_dot, q_dot, model)
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


def _refuse_other_rates(alpha_dot: Terms, q_dot: Terms, model: PolynomialModel) -> None:
    foreign = [
        f"{term_label(term, model)} in {name}"
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


def _refuse_foreign_terms(alpha_dot: Terms, q_dot: Terms, model: PolynomialModel) -> None:
    # With an elevator in dα/dt, a damping b_q(α) would multiply it.
    most = 0 if any(term[2] for term in alpha_dot) else np.inf
    foreign = [
        f"{term_label(term, model)} in {name}"
        for name, terms, powers_with_q in (("alpha_dot", alpha_dot, 0), ("q_dot", q_dot, most))
        for term in terms
        if not (
            (term[1] == 0 and term[2] == 0)
            or (term[1] == 1 and term[2] == 0 and term[0] <= powers_with_q)
            or term == (0, 0, 1)
        )
    ]
    if foreign:
        raise RefusedError(
            f"the Liénard form cannot hold {', '.join(foreign)}",
            hint="it holds powers of alpha, and q and elevator to the first power only; a planar system holds any term",
        )
