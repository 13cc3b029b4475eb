"""How a term of a polynomial is written by hand: ``alpha^2*q``, ``elevator``, ``constant``."""

from __future__ import annotations

import re
from typing import Final

from finback.study.faults import nearest

CONSTANT: Final = "constant"
MAXIMUM_POWER: Final = 30
"""A higher power of one variable is taken for a mistake."""

_FACTOR: Final = re.compile(r"(?P<name>[^\W\d]\w*)(?:\^(?P<power>\d{1,9}))?")


def parse_term(text: str, symbols: tuple[str, ...]) -> tuple[int, ...]:
    """Return the exponents of a term, one for each symbol.

    Args:
        text: factors joined by ``*``, each a symbol or a power of one (``x^2``), or ``constant``.
        symbols: the variables without their units.

    Raises:
        ValueError: it is no such term; the message says why.
    """
    exponents = dict.fromkeys(symbols, 0)
    if text.strip() in (CONSTANT, "1"):
        return tuple(exponents.values())
    for part in text.split("*"):
        factor = _FACTOR.fullmatch(part.strip())
        if factor is None:
            raise ValueError(f"'{text}' is no term; write powers joined by '*', such as {_example(symbols)}")
        name, power = factor["name"], int(factor["power"] or 1)
        if name not in exponents:
            raise ValueError(f"unknown variable '{name}'{_meant(name, symbols)}")
        exponents[name] += power
        if exponents[name] > MAXIMUM_POWER:
            raise ValueError(f"a power above {MAXIMUM_POWER} is taken for a mistake")
    return tuple(exponents.values())


def _meant(name: str, symbols: tuple[str, ...]) -> str:
    """Return the end of a message: what may have been meant by a name that is no symbol."""
    digits = len(name) - len(name.rstrip("0123456789"))
    if digits and name[:-digits] in symbols:
        return f"; did you mean '{name[:-digits]}^{name[-digits:]}'?"
    return nearest(name, [*symbols, CONSTANT])


def _example(symbols: tuple[str, ...]) -> str:
    return f"'{symbols[0]}^2*{symbols[1]}', or '{CONSTANT}'"
