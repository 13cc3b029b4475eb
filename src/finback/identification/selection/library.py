"""Libraries of candidate terms."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations_with_replacement
from typing import Final

from finback.arrays import IntArray
from finback.errors import InputError
from finback.identification.model_form import Equation, ModelForm
from finback.identification.term import ALPHA, ALPHA_DOT, Term

MOST_TERMS: Final = 200
"""Of one equation: beyond, no record of minutes tells them apart."""


def polynomial_terms(variables: Sequence[str], degree: int) -> tuple[Term, ...]:
    """Return all monomials of some variables up to a degree, the constant first: 20 for three variables and degree 3.

    Args:
        variables: such as ``alpha``, ``q``, ``elevator``; with or without their SI unit.
        degree: highest sum of exponents, >= 1.

    Raises:
        InputError: no variable, one twice, an unknown one, or more terms than anybody could tell apart.
    """
    names = tuple(Term.parse(variable).label for variable in variables)
    if not names or len(set(names)) < len(names) or degree < 1:
        raise InputError(f"a library needs different variables and a degree >= 1, got {names}, {degree}")
    texts = [
        "*".join(product) or "1"
        for order in range(degree + 1)
        for product in combinations_with_replacement(names, order)
    ]
    if len(texts) > MOST_TERMS:
        raise InputError(f"a library of {len(texts)} terms, expected at most {MOST_TERMS}", hint="lower the degree")
    return tuple(Term.parse(text) for text in texts)


def library(terms: Iterable[Term], *, further_q_dot: Iterable[Term] = ()) -> ModelForm:
    """Return the form of which terms are to be selected: the same candidates in both equations.

    Args:
        terms: candidates; those that hold dα/dt count for dq/dt only, each term once.
        further_q_dot: candidates for dq/dt only, such as ``alpha_dot`` or ``r^2-p^2``.
    """
    both = tuple(dict.fromkeys(terms))
    second = tuple(dict.fromkeys((*both, *further_q_dot)))
    return ModelForm(alpha_dot=tuple(term for term in both if ALPHA_DOT not in term.variables), q_dot=second)


def power_of_alpha(library: ModelForm, column: int) -> int:
    """Return the exponent of a column that is a power of alpha and nothing else; 0 for all others."""
    monomials = library.terms[column][1].monomials
    factors = monomials[0].factors
    return factors[0][1] if len(monomials) == 1 and len(factors) == 1 and factors[0][0] == ALPHA else 0


def alpha_orders(library: ModelForm, columns: IntArray) -> tuple[int, int]:
    """Return the highest power of alpha alone among these columns, in dα/dt and in dq/dt; 0 where there is none."""
    powers = [(library.terms[i][0], power_of_alpha(library, i)) for i in columns.tolist()]
    one, two = (max((power for equation, power in powers if equation is wanted), default=0) for wanted in Equation)
    return one, two
