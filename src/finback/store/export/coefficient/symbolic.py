"""A model in coefficient form as a Python module of SymPy expressions."""

from __future__ import annotations

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
