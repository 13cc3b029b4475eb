"""What the doubt about the terms adds to the errors of the coefficients: model averaging about the chosen structure.

The variance of an average over structures has two parts: that within each, and that of their estimates about the
average (Buckland, Burnham and Augustin 1997). Here the estimate stays that of the chosen structure, so its distance
from the others' estimates is added. A term that another structure lacks has the coefficient 0 there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.dynamics.dual import Dual
from finback.identification.explicit import multiplied_out
from finback.identification.model_form import Equation, ModelForm
from finback.identification.selection.prices import Prices
from finback.identification.selection.regression import Regression

_Explicit = dict[tuple[Equation, tuple[int, ...]], float]
"""Equation and exponents of the library's variables -> coefficient."""


def spread(
    regression: Regression, chosen: IntArray, equal: Sequence[IntArray], library: ModelForm, *, prices: Prices
) -> FloatArray:
    """Return the covariance that is added to that of the explicit model's coefficients, in their order, shape (n, n).

    Structures that are equal to the chosen one weigh as much as it does. Each one with a single term more weighs by
    its likelihood, less the evidence of a doubt.

    Args:
        regression: whitened equations.
        chosen: columns of the chosen structure.
        equal: columns of the structures that are equal to it.
        library: gives terms to the columns.
        prices: of all columns.
    """
    gains, _ = regression.gains(chosen)
    doubt = prices.beside(library, chosen).doubt
    others = {tuple(columns.tolist()): 1.0 for columns in equal}
    for column in np.flatnonzero(gains > 0).tolist():
        columns = tuple(np.sort(np.append(chosen, column)).tolist())
        others.setdefault(columns, float(np.exp(0.5 * min(0.0, gains[column] - doubt[column]))))
    own = _explicit(regression, chosen, library)
    total = 1.0 + sum(others.values())
    moved = np.array(
        [
            [np.sqrt(weight / total) * (explicit.get(key, 0.0) - value) for key, value in own.items()]
            for explicit, weight in (
                (_explicit(regression, np.array(columns), library), weight) for columns, weight in others.items()
            )
        ]
    ).reshape(-1, len(own))
    return frozen_array(moved.T @ moved)


def _explicit(regression: Regression, columns: IntArray, library: ModelForm) -> _Explicit:
    """Return the coefficients of the explicit model of a structure, those of dα/dt first."""
    columns = np.sort(columns)  # those of dα/dt first
    coefficients = [Dual(value, np.empty(0)) for value in regression.solution(columns)[0].tolist()]
    terms = [library.terms[column] for column in columns.tolist()]
    alpha_dot, q_dot = ([term for equation, term in terms if equation is wanted] for wanted in Equation)
    both = multiplied_out(alpha_dot, q_dot, library.variables, coefficients)
    return {
        (equation, exponents): dual.value
        for equation, found in zip(Equation, both, strict=True)
        for exponents, dual in found.items()
    }
