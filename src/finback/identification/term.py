"""Terms of a model: monomials over named variables in SI, and fixed combinations of them such as r² - p²."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray
from finback.errors import InputError
from finback.units import quantity_of, si_name, si_unit, unit_of

ALPHA: Final = "alpha_rad"
Q: Final = "q_rad_s"
ALPHA_DOT: Final = "alpha_dot_rad_s"
ELEVATOR: Final = "elevator_rad"

KNOWN: Final = (ALPHA, Q, ALPHA_DOT, ELEVATOR, "canard_rad", "beta_rad", "p_rad_s", "r_rad_s")
"""The variables that a term's text may name without their unit, in the order in which a term lists its factors."""

_SYMBOLS: Final = {quantity_of(name): name for name in KNOWN}
_PART: Final = re.compile(r"([+-]?)([^+-]+)")
_FACTOR: Final = re.compile(r"([A-Za-z]\w*)(?:\^(\d+))?")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Monomial:
    """A product of powers of variables, times a fixed weight.

    Attributes:
        factors: (variable, exponent >= 1) pairs, each variable once; empty for the constant.
        weight: a fixed number, not 0.
    """

    factors: tuple[tuple[str, int], ...] = ()
    weight: float = 1.0

    def __post_init__(self) -> None:
        """Check the variables and exponents, and bring the factors into order."""
        names = [name for name, _ in self.factors]
        for name in names:
            if si_unit(unit_of(name)) != unit_of(name):
                raise InputError(f"variable '{name}' of a term is not in SI", hint=f"use {si_name(name)}")
        if len(set(names)) < len(names) or any(power < 1 for _, power in self.factors):
            raise InputError(f"a monomial names each variable once, with an exponent >= 1, got {self.factors}")
        if not (np.isfinite(self.weight) and self.weight):
            raise InputError(f"the weight of a monomial is a number other than 0, got {self.weight}")
        object.__setattr__(self, "factors", tuple(sorted(self.factors, key=_place)))

    @property
    def symbol(self) -> str:
        """The product without its weight, as ``alpha^2*q``; ``1`` for the constant."""
        parts = (f"{quantity_of(name)}{f'^{power}' if power > 1 else ''}" for name, power in self.factors)
        return "*".join(parts) or "1"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """What one coefficient multiplies: a monomial, or a fixed sum of them.

    Variables are named with their SI unit: ``alpha_rad``, ``q_rad_s``, ``alpha_dot_rad_s``, ``elevator_rad``,
    ``canard_rad``, ``beta_rad``, ``p_rad_s``, ``r_rad_s``, or any other name that ends in an SI unit. ``Term.parse``
    reads ``1``, ``alpha^2``, ``alpha*q``, ``p*r``, ``r^2-p^2``, ``q+alpha_dot``.

    Attributes:
        monomials: at least one, no two of the same factors.
    """

    monomials: tuple[Monomial, ...]

    def __post_init__(self) -> None:
        """Check that there is something to sum, once each."""
        symbols = [monomial.factors for monomial in self.monomials]
        if not symbols or len(set(symbols)) < len(symbols):
            raise InputError("a term is a sum of one or more different monomials")

    @classmethod
    def of(cls, **exponents: int) -> Term:
        """Make a monomial: ``Term.of(alpha_rad=2, q_rad_s=1)``; without arguments, the constant."""
        return cls(monomials=(Monomial(factors=tuple(exponents.items())),))

    @classmethod
    def parse(cls, text: str) -> Term:
        """Read a term as ``label`` writes it; a known variable may be named without its unit.

        Raises:
            InputError: the text is no sum of monomials, or a variable is unknown.
        """
        squeezed = re.sub(r"\s+", "", text).replace("**", "^")
        parts = _PART.findall(squeezed)
        if not squeezed or "".join(f"{sign}{body}" for sign, body in parts) != squeezed:
            raise InputError(f"'{text}' is no term", hint="write 1, alpha^2, alpha*q, p*r or r^2-p^2")
        return cls(
            monomials=tuple(
                Monomial(factors=_factors(body, text), weight=-1.0 if sign == "-" else 1.0) for sign, body in parts
            )
        )

    @property
    def label(self) -> str:
        """How tables and files write the term, without units: ``alpha^2*q``, ``r^2-p^2``."""
        first, *others = self.monomials
        head = f"{_weight(first.weight, first=True)}{first.symbol}"
        return head + "".join(f"{_weight(part.weight, first=False)}{part.symbol}" for part in others)

    @property
    def variables(self) -> tuple[str, ...]:
        """The variables of all monomials, each once, known ones first."""
        return tuple(
            sorted({name for part in self.monomials for name, _ in part.factors}, key=lambda n: _place((n, 0)))
        )

    @property
    def degree(self) -> int:
        """The highest sum of exponents of a monomial."""
        return max(sum(power for _, power in part.factors) for part in self.monomials)

    def __call__(self, values: Mapping[str, ArrayLike]) -> FloatArray:
        """Evaluate at one value (or broadcastable array) for each variable, in SI.

        Raises:
            InputError: a variable has no value.
        """
        shape = np.broadcast_shapes(*(np.shape(value) for value in values.values())) if values else ()
        total = np.zeros(shape)
        for part in self.monomials:
            product = np.full(shape, part.weight)
            for name, power in part.factors:
                if name not in values:
                    raise InputError(f"term {self.label}: there is no value for '{name}'")
                product = product * np.asarray(values[name], dtype=np.float64) ** power
            total = total + product
        return total


def _place(factor: tuple[str, int]) -> tuple[int, str]:
    """Return where a factor stands: known variables in their order, then the others by name."""
    name = factor[0]
    return (KNOWN.index(name) if name in KNOWN else len(KNOWN), name)


def _weight(weight: float, *, first: bool) -> str:
    sign = "-" if weight < 0 else "" if first else "+"
    return sign if abs(weight) == 1.0 else f"{sign}{abs(weight):g}*"


def _factors(body: str, text: str) -> tuple[tuple[str, int], ...]:
    """Return (variable, exponent) pairs of ``alpha^2*q``."""
    if body == "1":
        return ()
    exponents: dict[str, int] = {}
    for factor in body.split("*"):
        found = _FACTOR.fullmatch(factor)
        if not found:
            raise InputError(f"'{factor}' in term '{text}' is no power of a variable", hint="write alpha^2 or q")
        name = _variable(found[1], text)
        exponents[name] = exponents.get(name, 0) + int(found[2] or 1)
    return tuple(exponents.items())


def _variable(word: str, text: str) -> str:
    """Return the variable that a word names, with or without its unit."""
    if word in _SYMBOLS:
        return _SYMBOLS[word]
    try:
        unit_of(word)
    except InputError:
        near = get_close_matches(word, _SYMBOLS, n=3, cutoff=0.4)
        raise InputError(
            f"unknown variable '{word}' in term '{text}'",
            hint=f"did you mean {' or '.join(near)}?" if near else f"known: {', '.join(_SYMBOLS)}, or a name with unit",
        ) from None
    return word
