"""A model in coefficient form as functions in C99."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from finback.store.export.coefficient.statements import (
    RATES,
    STATES,
    Statement,
    coefficients,
    constants,
    late,
    motion,
    turning,
    unused,
    variables,
)
from finback.store.export.coefficient.terms import AIR, CoefficientEquations

COEFFICIENTS: Final = "finback_coefficients"
MOTION: Final = "finback_motion"
_MOVING: Final = ("airspeed_m_s", "alpha_rad", "q_rad_s", "alpha_dot_rad_s")


def coefficients_in_c(equations: CoefficientEquations) -> str:
    """Return a file that defines the coefficients, and the motion by them.

    ``void finback_coefficients(V, alpha, q, dalpha/dt, elevator, …, double coefficients[3])`` and
    ``void finback_motion(V, alpha, theta, q, elevator, …, density, thrust, gravity, double rates[6])``, doubles in SI
    as their names say. Powers are products.
    """
    said = "\n".join(f" * {_comment(line)}".rstrip() for line in _head(equations))
    return (
        f"/*\n{said}\n */\n\n#include <math.h>\n\n"
        f"{_signature(COEFFICIENTS, _arguments(equations), 'coefficients[3]')};\n\n"
        f"{_signature(MOTION, _motion_arguments(equations), 'rates[6]')};\n\n"
        f"{_coefficients(equations)}\n{_motion(equations)}"
    )


def _head(equations: CoefficientEquations) -> list[str]:
    names = ", ".join(equations.model.form.names)
    return [
        f"{names} of {equations.source}, and longitudinal motion by them. SI and radians.",
        "",
        f"{COEFFICIENTS}: coefficients[0..2] are {names}, pure numbers.",
        f"{MOTION}: rates[0..5] are {', '.join(RATES)}.",
        f"The flights had a thrust_n of {equations.model.airframe.thrust_n:.6g} in the mean.",
        "",
        *equations.said(),
    ]


def _comment(text: str) -> str:
    return text.replace("*/", "* /").replace("\\", "/").replace("/*", "/ *")


def _arguments(equations: CoefficientEquations) -> tuple[str, ...]:
    return (*_MOVING, *equations.inputs, *equations.air)


def _motion_arguments(equations: CoefficientEquations) -> tuple[str, ...]:
    return (*STATES, *equations.inputs, *AIR)


def _signature(name: str, arguments: Sequence[str], result: str) -> str:
    return f"void {name}({', '.join(f'double {one}' for one in arguments)}, double {result})"


def _lines(statements: Sequence[Statement]) -> str:
    return "".join(
        f"    const double {one.name} = {one.text};{f' /* {one.meaning} */' if one.meaning else ''}\n"
        for one in statements
    )


def _coefficients(equations: CoefficientEquations) -> str:
    names, arguments = equations.model.form.names, _arguments(equations)
    body = [*variables(equations), *late(equations), *coefficients(equations, names)]
    known = [one for one in constants(equations) if not unused([one.name], body)]
    lost = "".join(f"    (void){name};\n" for name in unused(arguments, body))
    result = "".join(f"    coefficients[{index}] = {name};\n" for index, name in enumerate(names))
    return f"{_signature(COEFFICIENTS, arguments, 'coefficients[3]')}\n{{\n{lost}{_lines([*known, *body])}{result}}}\n"


def _motion(equations: CoefficientEquations) -> str:
    arguments = _motion_arguments(equations)
    one, two, three = equations.model.form.names
    passed = ", ".join(_arguments(equations))
    call = f"{COEFFICIENTS}({passed}, coefficients);"
    first = call.replace("alpha_dot_rad_s", "0.0")
    again = f"    {call}\n" if equations.late else ""
    body = motion(equations)
    known = [part for part in constants(equations) if not unused([part.name], [*body, turning()])]
    result = "".join(f"    rates[{index}] = {name};\n" for index, name in enumerate(RATES))
    return (
        f"{_signature(MOTION, arguments, 'rates[6]')}\n{{\n    double coefficients[3];\n{_lines(known)}"
        f"    {first} /* neither force depends on dalpha/dt */\n"
        f"    const double {one} = coefficients[0];\n    const double {two} = coefficients[1];\n{_lines(body)}"
        f"{again}    const double {three} = coefficients[2];\n{_lines([turning()])}{result}}}\n"
    )
