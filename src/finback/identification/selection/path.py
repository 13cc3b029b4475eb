"""Multivariate orthogonal functions: terms in the order in which they explain most, with the errors predicted for each.

Each term is made orthogonal to those before it, so that what it explains is its own (Morelli 1995). The predicted
squared error adds to the mean square of the fit what the terms' coefficients, fitted to noise, would add to the error
of a prediction: a price for each term (Barron 1984). PRESS predicts each equation from all others (Allen 1974).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.identification.selection.equations import Equations


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One more term. All errors are in units of the noise variance, per equation.

    Attributes:
        term: the term and its equation.
        explained: share of the target's sum of squares that it explains beyond the terms before.
        mean_square: of what is left.
        predicted_squared_error: ``mean_square`` plus the price of all terms so far.
        press: mean square of each equation's error when it is predicted from the others.
        prediction: mean square of the errors on flights that were kept out; 0 if there are none.
    """

    term: str
    explained: float
    mean_square: float
    predicted_squared_error: float
    press: float
    prediction: float


def orthogonal_order(regressors: FloatArray, target: FloatArray, among: IntArray) -> IntArray:
    """Return columns in the order in which each explains most beyond those before it.

    Args:
        regressors: shape (n, p).
        target: shape (n,).
        among: the columns to be ordered.
    """
    rest, residual = regressors[:, among] / np.sqrt((regressors[:, among] ** 2).sum(axis=0)), target.copy()
    order: list[int] = []
    left = list(range(among.size))
    while left:
        lengths = (rest[:, left] ** 2).sum(axis=0)
        gains = np.where(lengths > 1e-12, (rest[:, left].T @ residual) ** 2 / np.maximum(lengths, 1e-12), 0.0)
        place = left.pop(int(np.argmax(gains)))
        order.append(place)
        length = float(np.sqrt((rest[:, place] ** 2).sum()))
        if length <= 1e-6:
            continue
        direction = rest[:, place] / length
        residual -= direction * (direction @ residual)
        rest[:, left] -= np.outer(direction, direction @ rest[:, left])
    return among[np.array(order, dtype=np.int64)]


def walk(
    equations: Equations,
    order: IntArray,
    labels: tuple[str, ...],
    *,
    prices: FloatArray,
    kept_out: tuple[Equations, ...],
) -> tuple[Step, ...]:
    """Take terms one after the other and predict the error after each.

    Args:
        equations: that were fitted.
        order: columns.
        labels: of all columns.
        prices: of all columns, shape (p,).
        kept_out: the same of flights that were not fitted; none or one.
    """
    rows, total = equations.target.size, float(equations.target @ equations.target)
    basis, upper = np.linalg.qr(equations.regressors[:, order])
    parts = basis.T @ equations.target
    residual, leverage = equations.target.copy(), np.zeros(rows)
    steps, paid = [], np.cumsum(prices[order])
    for k in range(order.size):
        residual = residual - basis[:, k] * parts[k]
        leverage = leverage + basis[:, k] ** 2
        left = float(residual @ residual)
        coefficients = np.linalg.solve(upper[: k + 1, : k + 1], parts[: k + 1])
        steps.append(
            Step(
                term=labels[order[k]],
                explained=float(parts[k] ** 2) / total,
                mean_square=left / rows,
                predicted_squared_error=(left + paid[k]) / rows,
                press=float(np.mean((residual / np.maximum(1 - leverage, 1e-9)) ** 2)),
                prediction=sum(
                    float(np.mean((other.target - other.regressors[:, order[: k + 1]] @ coefficients) ** 2))
                    for other in kept_out
                ),
            )
        )
    return tuple(steps)
