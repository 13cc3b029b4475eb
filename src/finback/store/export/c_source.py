"""A model as a function in C99."""

from __future__ import annotations

from typing import Final

from finback.errors import InputError
from finback.store.export.equations import Equations, written

_KEYWORDS: Final = (
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while rates"
)


def c_source(equations: Equations, *, name: str = "finback_rates") -> str:
    """Return a file that defines ``void name(double x1, double x2, …, double rates[2])``.

    Arguments are the model's variables in their order, in SI, as their names say. Powers are products, so the value
    does not depend on a mathematical library.

    Args:
        equations: the model.
        name: of the function.

    Raises:
        InputError: a name is no name in C.
    """
    for word in (name, *equations.variables):
        if word in _KEYWORDS.split() or not (word.isidentifier() and word.isascii()):
            raise InputError(f"'{word}' is no name in C", hint="use ASCII letters, digits and _, and no keyword")
    arguments = ", ".join(f"double {variable}" for variable in equations.variables)
    one, two = (
        written(p, lambda variable, power: "*".join([variable] * power)) for p in (equations.first, equations.second)
    )
    unused = "".join(
        f"    (void){variable};\n"
        for column, variable in enumerate(equations.variables)
        if not (equations.first.powers[:, column].any() or equations.second.powers[:, column].any())
    )
    comment = equations.source.replace("*/", "* /").replace("\\", "/")
    return (
        f"/* {', '.join(equations.rates)} of {comment}. SI and radians. */\n\n"
        f"void {name}({arguments}, double rates[2]);\n\n"
        f"void {name}({arguments}, double rates[2])\n"
        "{\n"
        f"{unused}"
        f"    rates[0] = {one};\n"
        f"    rates[1] = {two};\n"
        "}\n"
    )
