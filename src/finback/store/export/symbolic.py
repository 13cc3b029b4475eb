"""A model in SymPy: as expressions, and as a Python module that makes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

from finback.errors import InputError
from finback.store.export.equations import Equations, written


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SymbolicModel:
    """A model as SymPy sees it.

    Attributes:
        symbols: one real symbol per variable, named with its SI unit.
        rates: the two expressions, coefficients as floats of 53 bits.
    """

    symbols: tuple[Any, ...]
    rates: tuple[Any, Any]


def symbolic(equations: Equations) -> SymbolicModel:
    """Return the equations as SymPy expressions.

    Raises:
        InputError: SymPy is not installed.
    """
    try:
        import sympy  # noqa: PLC0415 - an extra, and a second to import
    except ImportError:
        raise InputError("SymPy is not installed", hint="install it with: pip install 'finback[export]'") from None
    symbols = tuple(sympy.Symbol(name, real=True) for name in equations.variables)
    one, two = (
        sympy.Add(
            *(
                sympy.Float(coefficient) * sympy.Mul(*(s**p for s, p in zip(symbols, row, strict=True)))
                for row, coefficient in zip(part.powers.tolist(), part.coefficients.tolist(), strict=True)
            )
        )
        for part in (equations.first, equations.second)
    )
    return SymbolicModel(symbols=symbols, rates=(one, two))


def sympy_module(equations: Equations) -> str:
    """Return a Python module that defines a symbol per variable and an expression per rate, named with their units."""
    names = equations.variables
    lines = [
        f'"""{", ".join(equations.rates)} in SI, of {_quoted(equations.source)}."""',
        "",
        "from sympy import symbols",
        "",
        f'{", ".join(names)} = symbols("{" ".join(names)}", real=True)',
        "",
    ]
    for name, part in zip(equations.rates, (equations.first, equations.second), strict=True):
        text = written(part, lambda variable, power: variable if power == 1 else f"{variable}**{power}")
        lines.append(f"{name} = {text}")
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return text.replace("\\", "/").replace('"', "'")
