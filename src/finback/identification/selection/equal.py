"""Structures that explain the data as well as the chosen one: where there are some, the choice is not determined.

A structure counts as equal if data that it made itself would leave the chosen one ahead as often as that: the terms
that it adds need only the evidence of a doubt, those that it drops are refunded at the price at which they came in.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import nsmallest
from typing import Final, final

import numpy as np

from finback.arrays import IntArray
from finback.identification.model_form import ModelForm
from finback.identification.selection.equations import Equations
from finback.identification.selection.library import alpha_orders
from finback.identification.selection.neighbors import neighbors
from finback.identification.selection.prices import Prices
from finback.identification.selection.regression import Regression
from finback.identification.selection.search import improved, thinned
from finback.identification.term import ALPHA_DOT

_NEAR: Final = 1.0
"""Cost in noise variances up to which a structure with other terms is equal."""
_SPURIOUS: Final = 6.0
"""The same for a structure with fewer terms: what noise alone explains passes a price by more in 5 % of the cases."""
_MOST_DECISIONS: Final = 5
"""Each one lowers the sum of squares; the first is mostly the last."""
_MOST: Final = 40
"""Structures that are judged further, those of the least cost."""
_MOST_SOUGHT: Final = 1000
"""Neighbors that are looked at, those of the least cost."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class EqualStructure:
    """A structure that explains the data as well as the chosen one. Errors are in units of the noise variance.

    Attributes:
        added: terms that it has beside the chosen ones.
        dropped: chosen terms that it lacks.
        orders: the highest power of alpha alone in its dα/dt and dq/dt.
        loss: how much its sum of squares is above that of the chosen structure; negative if it is below.
        predicted_squared_error: its mean square plus the prices of its terms.
        press: mean square of each equation's error when it is predicted from the others.
        prediction: mean square of the errors on flights that were kept out; 0 if there are none.
    """

    added: tuple[str, ...]
    dropped: tuple[str, ...]
    orders: tuple[int, int]
    loss: float
    predicted_squared_error: float
    press: float
    prediction: float

    def __str__(self) -> str:
        if not self.added:
            return f"without {' and '.join(self.dropped)}"
        if not self.dropped:
            return f"with {' and '.join(self.added)} besides"
        return f"{' and '.join(self.added)} in place of {' and '.join(self.dropped)}"


def equal_structures(
    regression: Regression,
    chosen: IntArray,
    library: ModelForm,
    *,
    prices: Prices,
    kept_out: tuple[Equations, ...],
) -> tuple[IntArray, ...]:
    """Return the columns of all structures that are equal to the chosen one, those of the least cost first.

    They are sought among the neighbors of the chosen structure, and where searches end that ask for less evidence. Each
    term of an equal structure is needed in it. Flights that were kept out count as well, if there are any.

    Args:
        regression: whitened equations.
        chosen: columns of the chosen structure.
        library: gives terms to the columns.
        prices: of all columns.
        kept_out: the equations of flights that were not fitted; none or one.
    """
    beside = prices.beside(library, chosen)
    misfit, predicted = regression.misfit(chosen), _predicted(regression, chosen, kept_out)
    # Terms with dα/dt that the chosen ones hold: the same model in other words, or a coincidence of coefficients.
    rates = np.array([ALPHA_DOT in term.variables for _, term in library.terms])
    blind = rates & (regression.gains(chosen)[0] == 0.0)
    found: dict[tuple[int, ...], float] = {}
    for columns in _sought(regression, chosen, beside, within=_SPURIOUS * prices.widening):
        added = np.setdiff1d(columns, chosen)
        dropped = np.setdiff1d(chosen, columns)
        if not columns.size or not (added.size or dropped.size) or tuple(columns.tolist()) in found:
            continue
        if blind[added].any():
            continue
        rise = regression.misfit(columns) - misfit
        if (regression.losses(columns) < beside.doubt[columns]).any():
            continue
        cost = rise + float(beside.doubt[added].sum()) - float(prices.enter[dropped].sum())
        cost += _predicted(regression, columns, kept_out) - predicted
        if cost <= prices.widening * (_NEAR if added.size else _SPURIOUS):
            found[tuple(columns.tolist())] = cost
    return tuple(np.array(columns) for columns in sorted(found, key=lambda key: found[key])[:_MOST])


def decided(
    regression: Regression,
    chosen: IntArray,
    library: ModelForm,
    *,
    prices: Prices,
    kept_out: tuple[Equations, ...],
) -> tuple[IntArray, tuple[IntArray, ...]]:
    """Let the flights that were kept out decide between equal structures.

    Returns:
        The structure of the least sum of squares on all flights, prices of its terms added, and what is equal to it.
    """
    for _ in range(_MOST_DECISIONS):
        near = equal_structures(regression, chosen, library, prices=prices, kept_out=kept_out)
        if not kept_out:
            break
        sums = [
            regression.misfit(columns) + float(prices.enter[columns].sum()) + _predicted(regression, columns, kept_out)
            for columns in (chosen, *near)
        ]
        best = int(np.argmin(sums))
        if best == 0:
            break
        chosen = near[best - 1]
    return chosen, near


def scored(  # noqa: PLR0913 - the data in both shapes, and two structures
    equations: Equations,
    regression: Regression,
    columns: IntArray,
    chosen: IntArray,
    library: ModelForm,
    *,
    prices: Prices,
    kept_out: tuple[Equations, ...],
) -> EqualStructure:
    """Return what speaks for and against one structure beside the chosen one."""
    labels = library.labels()
    basis = np.linalg.qr(equations.regressors[:, columns])[0]
    residual = equations.target - basis @ (basis.T @ equations.target)
    leverage = (basis**2).sum(axis=1)
    squares = float(residual @ residual)
    return EqualStructure(
        added=tuple(labels[i] for i in np.setdiff1d(columns, chosen)),
        dropped=tuple(labels[i] for i in np.setdiff1d(chosen, columns)),
        orders=alpha_orders(library, columns),
        loss=squares - regression.misfit(chosen),
        predicted_squared_error=(squares + float(prices.paid[columns].sum())) / regression.rows,
        press=float(np.mean((residual / np.maximum(1 - leverage, 1e-9)) ** 2)),
        prediction=_predicted(regression, columns, kept_out) / max(1, sum(other.target.size for other in kept_out)),
    )


def _sought(regression: Regression, chosen: IntArray, prices: Prices, *, within: float) -> list[IntArray]:
    """Return structures that may be equal."""
    near = neighbors(regression, chosen, added=prices.doubt, dropped=prices.enter, within=within, reach=2)
    ends = [improved(regression, prices.doubt, start) for start in (chosen, thinned(regression, prices.doubt))]
    return [*(item.columns for item in nsmallest(_MOST_SOUGHT, near, key=lambda item: item.cost)), *ends]


def _predicted(regression: Regression, columns: IntArray, kept_out: tuple[Equations, ...]) -> float:
    """Return the sum of squares of the errors on the flights that were kept out."""
    if not kept_out:
        return 0.0
    coefficients = regression.solution(columns)[0]
    return sum(float(((other.target - other.regressors[:, columns] @ coefficients) ** 2).sum()) for other in kept_out)
