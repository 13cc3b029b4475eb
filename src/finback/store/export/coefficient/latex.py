"""A model in coefficient form as LaTeX, each number with the digits that its standard error supports."""

from __future__ import annotations

from typing import Final

from finback.identification.coefficient.form import ALPHA_RATE, PITCH_RATE, REFERENCE_PITCH_RATE, SPEED
from finback.identification.term import Monomial, Term
from finback.store.export.coefficient.terms import CoefficientEquations
from finback.store.export.latex import concise, power_of, symbol_of

_SYMBOLS: Final = {
    PITCH_RATE: r"\hat{q}",
    REFERENCE_PITCH_RATE: r"\hat{q}_0",
    SPEED: r"\hat{V}",
    ALPHA_RATE: r"\hat{\dot{\alpha}}",
    "thrust_n": "T",
    "density_kg_m3": r"\rho",
}
_MEANINGS: Final = {
    PITCH_RATE: r"\frac{q \bar{c}}{2 V}",
    REFERENCE_PITCH_RATE: r"\frac{q \bar{c}}{2 V_0}",
    SPEED: r"\frac{V}{V_0}",
    ALPHA_RATE: r"\frac{\dot{\alpha} \bar{c}}{2 V}",
}
_NAMES: Final = {"CX": "C_X", "CZ": "C_Z", "CD": "C_D", "CL": "C_L", "Cm": "C_m"}


def coefficients_in_latex(equations: CoefficientEquations) -> str:
    r"""Return an ``aligned`` block: the coefficients as sums, what their variables are, and the motion by them.

    A number with a standard error is written with its two first digits in parentheses, ``0.12345(12)``, and no digit
    beyond; one without is written with all its digits.
    """
    form = equations.model.form
    used = {name for _, term in form.terms for name in term.variables}
    lines = [
        *(f"{_NAMES[name]} &= {_sum(equations, name)}" for name in form.names),
        *(f"{_SYMBOLS[name]} &= {meaning}" for name, meaning in _MEANINGS.items() if name in used),
        *_motion(equations),
        *_airframe(equations),
    ]
    return (
        f"% {equations.source}; SI and radians; standard errors in units of the last digit\n"
        "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}\n"
    )


def _sum(equations: CoefficientEquations, name: str) -> str:
    model = equations.model
    text = ""
    rows = zip(model.form.terms, model.numbers.tolist(), model.standard_errors.tolist(), strict=True)
    for (_, term), number, error in (row for row in rows if row[0][0] == name):
        product = r"\,".join([concise(abs(number), error), *_term(term)])
        sign = "-" if number < 0 else "+" if text else ""
        text = f"{text} {sign} {product}" if text else f"{sign}{product}"
    return text


def _term(term: Term) -> list[str]:
    if len(term.monomials) == 1 and term.monomials[0].weight == 1.0:
        return _factors(term.monomials[0])
    text = ""
    for part in term.monomials:
        size = [] if abs(part.weight) == 1.0 and part.factors else [f"{abs(part.weight):g}"]
        sign = "-" if part.weight < 0 else "+" if text else ""
        product = r"\,".join([*size, *_factors(part)])
        text = f"{text} {sign} {product}" if text else f"{sign}{product}"
    return [rf"\left({text}\right)"]


def _factors(part: Monomial) -> list[str]:
    symbols = ((_SYMBOLS.get(name) or symbol_of(name), power) for name, power in part.factors)
    return [symbol if power == 1 else power_of(symbol, power) for symbol, power in symbols]


def _motion(equations: CoefficientEquations) -> list[str]:
    turned = [
        r"C_X &= C_L \sin\alpha - C_D \cos\alpha",
        r"C_Z &= -C_L \cos\alpha - C_D \sin\alpha",
    ]
    return [
        *([] if equations.body else turned),
        r"m\,a_x &= \bar{q} S\,C_X + T \cos\epsilon",
        r"m\,a_z &= \bar{q} S\,C_Z - T \sin\epsilon",
        r"\bar{q} &= \frac{1}{2} \rho V^2",
        r"\dot{V} &= a_x \cos\alpha + a_z \sin\alpha - g \sin(\theta - \alpha)",
        r"\dot{\alpha} &= q + \frac{a_z \cos\alpha - a_x \sin\alpha + g \cos(\theta - \alpha)}{V}",
        r"\dot{\theta} &= q",
        r"I_y\,\dot{q} &= \bar{q} S \left(\bar{c}\,C_m + z\,C_X - x\,C_Z\right) + T\,d",
    ]


def _airframe(equations: CoefficientEquations) -> list[str]:
    frame = equations.model.airframe
    values = (
        ("m", frame.mass_kg, r"\mathrm{kg}"),
        ("S", frame.wing_area_m2, r"\mathrm{m}^2"),
        (r"\bar{c}", frame.chord_m, r"\mathrm{m}"),
        ("I_y", frame.pitch_inertia_kg_m2, r"\mathrm{kg}\,\mathrm{m}^2"),
        (r"\epsilon", frame.thrust_angle_rad, r"\mathrm{rad}"),
        ("d", frame.thrust_arm_m, r"\mathrm{m}"),
        ("x", frame.reference_x_m, r"\mathrm{m}"),
        ("z", frame.reference_z_m, r"\mathrm{m}"),
        ("V_0", equations.model.reference_speed_m_s, r"\mathrm{m}\,\mathrm{s}^{-1}"),
    )
    return [rf"{name} &= {concise(float(value), 0.0)}\,{unit}" for name, value, unit in values]
