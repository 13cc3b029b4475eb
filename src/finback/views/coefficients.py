"""The coefficients of a model as the paper prints them: in degrees, each with its standard error and unit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.any_form import AnyAnalysis
from finback.dynamics.lienard import Curve, LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import shared_rate_form
from finback.errors import RefusedError
from finback.identification.identify import Identification
from finback.units import from_si, quantity_of, unit_of
from finback.views.labels import display_unit, short, with_error

_SYMBOLS: Final = {"alpha": "α", "q": "q", "elevator": "δe"}
_POWERS: Final = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_PER_SECOND: Final = "1_s"  # of the damping, which a polynomial can only call "1"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficient:
    """One coefficient, ready to be read.

    Attributes:
        term: what it multiplies, such as ``α²``.
        value: with its standard error, in degrees.
        unit: of the value.
        relative: standard error in percent of the value.
    """

    term: str
    value: str
    unit: str
    relative: str


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Equation:
    """One polynomial of a model.

    Attributes:
        title: which one, such as ``dα/dt``.
        note: where it comes from.
        coefficients: its terms.
    """

    title: str
    note: str
    coefficients: tuple[Coefficient, ...]


def equations(identification: Identification, analysis: AnyAnalysis) -> tuple[Equation, ...]:
    """Return the identified model, the paper's form of its moment equation, and the Liénard form, if it has them."""
    model, errors = identification.model, identification.standard_errors
    split = model.alpha_dot.coefficients.size
    alpha_dot = _terms(model.alpha_dot, errors[:split], model.alpha_dot.value_unit)
    q_dot = _terms(model.q_dot, errors[split:], model.q_dot.value_unit)
    return (
        Equation(title="dα/dt", note="identified; Eq. (4)", coefficients=alpha_dot),
        Equation(title="dq/dt", note="identified; Eq. (5) with dα/dt substituted", coefficients=q_dot),
        *_shared(model),
        *(_lienard(analysis.system) if isinstance(analysis.system, LienardSystem) else ()),
    )


def _shared(model: PolynomialModel) -> tuple[Equation, ...]:
    """Return the moment equation with one gain for q and dα/dt; nothing where the model has no such form."""
    try:
        form = shared_rate_form(model)
    except RefusedError:
        return ()
    rate = Coefficient(
        term="q + dα/dt",
        value=with_error(form.rate_gain_1_s, form.rate_gain_error_1_s),
        unit="1/s",
        relative=_percent(form.rate_gain_1_s, form.rate_gain_error_1_s),
    )
    rest = _terms(form.remainder, form.remainder_errors, form.remainder.value_unit)
    return (Equation(title="dq/dt, shared rate term", note="Eq. (5) with M_zq = M_zα̇", coefficients=(rate, *rest)),)


def _lienard(system: LienardSystem) -> tuple[Equation, ...]:
    gain_error = float(np.sqrt(system.elevator_gain_sensitivity @ system.covariance @ system.elevator_gain_sensitivity))
    gain = Coefficient(
        term="δe",
        value=with_error(system.elevator_gain, gain_error),
        unit="1/s²",
        relative=_percent(system.elevator_gain, gain_error),
    )
    damping = _curve(system, system.damping, _PER_SECOND)
    force = (*_curve(system, system.force, "rad_s2"), gain)
    return (
        Equation(title="f(α)", note="damping of the Liénard form; Eq. (11), (36)", coefficients=damping),
        Equation(title="g(α) + c₁ δe", note="force of the Liénard form; Eq. (11), (36)", coefficients=force),
    )


def _curve(system: LienardSystem, curve: Curve, unit: str) -> tuple[Coefficient, ...]:
    variances = np.einsum("ij,jk,ik->i", curve.sensitivity, system.covariance, curve.sensitivity)
    return _terms(curve.polynomial, np.sqrt(np.maximum(variances, 0.0)), unit)


def _terms(polynomial: Polynomial, errors: FloatArray, value_unit: str) -> tuple[Coefficient, ...]:
    """Return the terms of a polynomial in SI, in degrees; ``value_unit`` is the SI unit of its value."""
    rows = []
    terms = zip(polynomial.powers.tolist(), polynomial.coefficients, errors, strict=True)
    for powers, value, error in sorted(terms, key=lambda term: term[0][::-1]):
        factor = from_si(1.0, display_unit(value_unit))
        unit = _dimension(value_unit)
        for name, power in zip(polynomial.variables, powers, strict=True):
            factor /= from_si(1.0, display_unit(unit_of(name))) ** power
            for part, exponent in _dimension(unit_of(name)).items():
                unit[part] = unit.get(part, 0) - power * exponent
        rows.append(
            Coefficient(
                term=_name(polynomial.variables, powers),
                value=with_error(float(value) * factor, float(error) * factor),
                unit=_unit_text(unit),
                relative=_percent(float(value), float(error)),
            )
        )
    return tuple(rows)


def _name(variables: tuple[str, ...], powers: list[int]) -> str:
    parts = []
    for name, power in zip(variables, powers, strict=True):
        if power:
            symbol = _SYMBOLS.get(quantity_of(name), quantity_of(name))
            parts.append(symbol if power == 1 else f"{symbol}{str(power).translate(_POWERS)}")
    return " ".join(parts) or "1"


def _dimension(unit: str) -> dict[str, int]:
    """Return the exponents of a unit suffix as shown: ``rad_s2`` -> deg 1, s -2."""
    first, *divisors = display_unit(unit).split("_")
    found = {} if first == "1" else {first: 1}
    for divisor in divisors:
        symbol = divisor.rstrip("0123456789")
        found[symbol] = found.get(symbol, 0) - int(divisor[len(symbol) :] or 1)
    return found


def _unit_text(exponents: dict[str, int]) -> str:
    above, below = (
        [
            part if sign * power == 1 else f"{part}{str(sign * power).translate(_POWERS)}"
            for part, power in sorted(exponents.items())
            if sign * power > 0
        ]
        for sign in (1, -1)
    )
    if not below:
        return " ".join(above) or "–"
    return f"{' '.join(above) or '1'}/{below[0] if len(below) == 1 else '(' + ' '.join(below) + ')'}"


def _percent(value: float, error: float) -> str:
    return f"{short(100.0 * error / abs(value))} %" if value else "–"
