"""A model in coefficient form as a Python module of SymPy expressions."""

from __future__ import annotations

from typing import Any

from finback.errors import InputError
from finback.store.export.coefficient.statements import (
    RATES,
    STATES,
    coefficients,
    constants,
    late,
    motion,
    turning,
    variables,
)
from finback.store.export.coefficient.terms import AIR, CoefficientEquations


def coefficients_in_sympy(equations: CoefficientEquations) -> str:
    """Return a Python module: a symbol per state, input, and what else the motion needs; every expression over them.

    Names end in their SI unit; coefficients are ``CX``, ``CZ``, ``Cm`` or ``CD``, ``CL``, ``Cm``.
    """
    symbols = (*STATES, *equations.inputs, *AIR)
    *forces, moment = equations.model.form.names
    head = [
        f"{', '.join(equations.model.form.names)} of {equations.source}, and longitudinal motion by them.",
        "",
        f"Expressions in SI and radians: {', '.join((*equations.model.form.names, *RATES))}.",
        f"The flights had a thrust_n of {equations.model.airframe.thrust_n:.6g} in the mean.",
        "",
        *equations.said(),
    ]
    statements = [
        *constants(equations),
        *variables(equations),
        *coefficients(equations, forces),
        *motion(equations),
        *late(equations),
        *coefficients(equations, [moment]),
        turning(),
    ]
    return "\n".join(
        [
            '"""' + "\n".join(head).replace("\\", "/").replace('"', "'"),
            '"""',
            "",
            "from sympy import cos, sin, symbols",
            "",
            f'{", ".join(symbols)} = symbols("{" ".join(symbols)}", real=True)',
            "",
            *(f"{one.name} = {one.text}{f'  # {one.meaning}' if one.meaning else ''}" for one in statements),
            "",
        ]
    )


def symbolic_coefficients(equations: CoefficientEquations) -> dict[str, Any]:
    """Return the names of that module: symbols, expressions, and the airframe's numbers.

    Raises:
        InputError: SymPy is not installed.
    """
    names: dict[str, Any] = {}
    try:
        exec(coefficients_in_sympy(equations), names)  # noqa: S102 - our own text, of checked names and numbers
    except ImportError:
        raise InputError("SymPy is not installed", hint="install it with: pip install 'finback[export]'") from None
    return {name: value for name, value in names.items() if not name.startswith("__")}
