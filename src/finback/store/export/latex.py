"""A model as LaTeX: two aligned equations, each number with the digits that its standard error supports."""

from __future__ import annotations

import math
from typing import Final

from finback.digits import NOT_DETERMINED, exponent, supported
from finback.dynamics.polynomial import Polynomial
from finback.store.export.equations import Equations
from finback.units import quantity_of

_SYMBOLS: Final = {
    "alpha": r"\alpha",
    "beta": r"\beta",
    "elevator": r"\delta_e",
    "canard": r"\delta_c",
    "aileron": r"\delta_a",
    "rudder": r"\delta_r",
}


def latex(equations: Equations) -> str:
    r"""Return an ``aligned`` block: ``\dot\alpha`` and ``\dot q`` as sums, in SI.

    A coefficient with a standard error is written with its two first digits in parentheses, ``0.12345(12)``, and no
    digit beyond; one without is written with all its digits.
    """
    first, second = equations.standard_errors
    lines = [
        rf"\dot{{{symbol_of(name)}}} &= {_sum(polynomial, errors.tolist())}"
        for name, polynomial, errors in (
            (equations.variables[0], equations.first, first),
            (equations.variables[1], equations.second, second),
        )
    ]
    return (
        f"% {equations.source}; {', '.join((*equations.variables, *equations.rates))}\n"
        "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}\n"
    )


def concise(value: float, error: float) -> str:
    """Return a number as ``0.12345(12)``, or with all its digits if ``error`` is 0.

    The number in parentheses is the standard error in units of the last digit shown. Numbers far from 1 are written
    with a power of ten. Of an error that is not finite nothing is known, and nothing is shown.
    """
    if not math.isfinite(error):
        return rf"\text{{({NOT_DETERMINED})}}"
    if error == 0:
        return _scientific(repr(value))
    power = exponent(value, error)
    if -4 <= power <= 5 and error < 10.0:
        power = 0
    number, uncertainty = supported(value, error, power=power)
    last = uncertainty.replace(".", "").lstrip("0")
    return rf"{number}({last}) \times 10^{{{power}}}" if power else f"{number}({last})"


def _scientific(text: str) -> str:
    mantissa, _, exponent = text.partition("e")
    return rf"{mantissa} \times 10^{{{int(exponent)}}}" if exponent else mantissa


def _sum(polynomial: Polynomial, errors: list[float]) -> str:
    result = ""
    rows = zip(polynomial.powers.tolist(), polynomial.coefficients.tolist(), errors, strict=True)
    for row, coefficient, error in rows:
        number = concise(abs(coefficient), error)
        powers = [
            symbol_of(name) if power == 1 else power_of(symbol_of(name), power)
            for name, power in zip(polynomial.variables, row, strict=True)
            if power
        ]
        sign = "-" if coefficient < 0 else "+" if result else ""
        result += f" {sign} " + r"\,".join([number, *powers]) if result else sign + r"\,".join([number, *powers])
    return result or "0"


def power_of(symbol: str, power: int) -> str:
    """Return a power >= 2 of a symbol."""
    return f"{{{symbol}}}^{{{power}}}" if "_" in symbol else f"{symbol}^{{{power}}}"


def symbol_of(name: str) -> str:
    """Return the symbol of a variable that is named with its unit."""
    quantity = quantity_of(name)
    if quantity in _SYMBOLS or len(quantity) == 1:
        return _SYMBOLS.get(quantity, quantity)
    escaped = quantity.replace("_", r"\_")
    return rf"\mathit{{{escaped}}}"
