"""Coefficients that a study knows: the tables ``[identification.fixed]`` and ``[identification.bounded]``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from finback.errors import FinbackError, InputError
from finback.identification.model_form import Equation, ModelForm
from finback.identification.term import Term
from finback.study.faults import nearest, show
from finback.study.reading import Reader
from finback.units import from_si, unit_of

_RATES: Final = {Equation.ALPHA_DOT: "rad_s", Equation.Q_DOT: "rad_s2"}
_DEGREES: Final = {"rad": "deg", "rad_s": "deg_s", "rad_s2": "deg_s2"}
"""In which people write them; all other variables stay in SI."""


def with_known(
    reader: Reader, form: ModelForm, fixed: Mapping[str, Any], bounded: Mapping[str, Any], place: str
) -> ModelForm | None:
    """Return the form with coefficients fixed and bounded, or nothing where a table has a fault.

    Keys name equation and term, ``"alpha_dot: q"``; values are in degrees and seconds, as ``identify`` prints them.

    Args:
        reader: of the whole file.
        form: the form.
        fixed: key -> number.
        bounded: key -> [low, high], either of which may be infinite.
        place: of the table that holds both.
    """
    before = len(reader.faults)
    for name, table in (("fixed", fixed), ("bounded", bounded)):
        for key, value in table.items():
            there = f"{place}.{name}.'{key}'"
            numbers = _numbers(value, pair=name == "bounded")
            if not numbers:
                expected = "two numbers, the lower one first" if name == "bounded" else "a finite number"
                reader.fault(there, f"must be {expected}, got {show(value)}")
                continue
            try:
                equation, term, scale = _coefficient(key, form)
                values = [number / scale for number in numbers]
                form = form.fix(equation, term, *values) if name == "fixed" else form.bound(equation, term, *values)
            except FinbackError as error:
                reader.fault(there, f"{error.message}{f' ({error.hint})' if error.hint else ''}")
    return form if len(reader.faults) == before else None


def _numbers(value: object, *, pair: bool) -> list[float]:
    """Return the number or the two bounds that stand there; nothing if they are not what they must be."""
    given = value if pair and isinstance(value, list) else [value]
    numbers = [float(item) for item in given if isinstance(item, int | float) and not isinstance(item, bool)]
    if not len(numbers) == len(given) == (2 if pair else 1):
        return []
    sound = numbers[0] < numbers[1] if pair else math.isfinite(numbers[0])
    return numbers if sound else []


def _coefficient(key: str, form: ModelForm) -> tuple[Equation, Term, float]:
    """Return the coefficient that a key names, and what one of its SI units is in degrees and seconds.

    Raises:
        InputError: it names none, or one that has no single unit.
    """
    name, colon, text = key.partition(":")
    if not colon or name.strip() not in set(Equation):
        raise InputError(f"'{name.strip()}' is no equation{nearest(name.strip(), list(Equation))}")
    equation, term = Equation(name.strip()), Term.parse(text.strip())
    form.index(equation, term)
    scales = {_scale(_RATES[equation], dict(part.factors)) for part in term.monomials}
    if max(scales) > min(scales) * (1.0 + 1e-12):
        raise InputError("the parts of this term have different units, so its coefficient has none in degrees")
    return equation, term, max(scales)


def _scale(rate: str, factors: Mapping[str, int]) -> float:
    scale = from_si(1.0, _DEGREES[rate])
    for variable, power in factors.items():
        unit = unit_of(variable)
        scale /= from_si(1.0, _DEGREES.get(unit, unit)) ** power
    return scale
