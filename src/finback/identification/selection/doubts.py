"""What speaks against the terms that were chosen, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import IntArray
from finback.digits import interval
from finback.dynamics.lienard import NORMAL_95
from finback.identification.gate import collinearity
from finback.identification.model_form import Equation, ModelForm
from finback.identification.selection.equal import EqualStructure
from finback.identification.selection.equations import Equations
from finback.identification.selection.path import Step
from finback.identification.selection.prices import Prices
from finback.identification.selection.regression import Regression
from finback.identification.term import Term

_SIGNIFICANT: Final = 5.0
"""Standard deviations by which the mean square of what all candidates leave must pass 1 before a warning says so."""
_STABLE: Final = 0.8
"""Terms that fewer of the repetitions choose are named in a warning."""
_RATES: Final = {Equation.ALPHA_DOT: "dalpha/dt", Equation.Q_DOT: "dq/dt"}
_RATE: Final = Term.parse("alpha_dot")
_NAMED: Final = 5
"""Equal structures that are named in a warning; all are counted."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One candidate term. Evidence is in units of the noise variance: the square of a number of standard errors.

    Attributes:
        equation: where it would stand.
        term: what its coefficient would multiply.
        chosen: whether it is in the model.
        evidence: of a chosen term, how much the sum of squares would rise without it; of another one, how much it
            would fall with it.
        frequency: share of the resampled selections that chose it; 0 if there were none.
        rival: the term that could best stand in its place; empty if it is not chosen or none could.
        rival_loss: how much the sum of squares would rise with the rival instead; infinite without one.
    """

    equation: Equation
    term: Term
    chosen: bool
    evidence: float
    frequency: float
    rival: str
    rival_loss: float


def lacking(variance: float, freedom: int, *, alike: bool) -> tuple[str, ...]:
    """Say that the library lacks something, if noise as it was measured does not explain what all of it leaves.

    Args:
        variance: mean square of what it leaves.
        freedom: of this mean.
        alike: whether there are several flights, taken for alike in all but their motion.
    """
    if variance <= 1 + _SIGNIFICANT * math.sqrt(2 / max(1, freedom)):
        return ()
    size = math.sqrt(variance)
    trims = ", or the flights have constants of their own (constants_per_flight)" if alike else ""
    return (
        (
            f"even all candidates leave {size:.3g} times the noise of the records: the library lacks something, or the "
            f"air moved{trims}; terms may stand for what is not among them"
        ),
    )


def ambiguous(equal: Sequence[EqualStructure], orders: tuple[int, int]) -> tuple[str, ...]:
    """Name the structures that explain the data as well as the chosen one, which has these orders of alpha."""
    if not equal:
        return ()
    more = f"; and {len(equal) - _NAMED} more" if len(equal) > _NAMED else ""
    powers = [sorted({own, *(item.orders[i] for item in equal)}) for i, own in enumerate(orders)]
    highest = [
        f"; the highest power of alpha in {rate} may be {' or '.join(map(str, found))}"
        for rate, found in zip(_RATES.values(), powers, strict=True)
        if len(found) > 1
    ]
    return (
        (
            f"the terms are not determined: these {len(equal) + 1} structures explain the data equally: the chosen "
            f"one; {'; '.join(map(str, equal[:_NAMED]))}{more}{''.join(highest)}"
        ),
    )


def left_out(regression: Regression, chosen: IntArray, library: ModelForm, prices: Prices) -> tuple[str, ...]:
    """Say which expected terms were left out, and how large they may be."""
    labels, said = library.labels(), []
    missing = prices.expected & (regression.gains(chosen)[0] > 0)
    for column in np.setdiff1d(np.flatnonzero(missing), chosen).tolist():
        values, covariance = regression.solution(np.append(chosen, column))
        reach = NORMAL_95 * math.sqrt(prices.widening * float(covariance[-1, -1]))
        low, high = interval(float(values[-1]) - reach, float(values[-1]) + reach)
        said.append(f"{labels[column]} ({low} … {high})")
    if not said:
        return ()
    return (f"left out, because the noise hides it, but expected in any model (SI, 95 %): {', '.join(said)}",)


def shared(equations: Equations, chosen: IntArray, library: ModelForm) -> tuple[str, ...]:
    """Say what is known of terms with dα/dt that were left out because the others say the same.

    dq/dt then holds the sum of both: separate coefficients are not printed.
    """
    rates = [i for i, (_, term) in enumerate(library.terms) if term == _RATE and i not in chosen]
    for column in rates:
        judged = collinearity(equations.regressors, equations.target, library, np.sort(np.append(chosen, column)))
        together = [label for label in judged.unknown if label != library.labels()[column]]
        if len(together) == len(judged.unknown):
            continue
        if judged.shared:
            said = (
                f"q and alpha_dot in dq/dt cannot be told apart, one coefficient of both is known: {judged.shared[0]}"
            )
        else:
            said = f"alpha_dot in dq/dt cannot be told from {', '.join(together)}"
        return (f"{said}; the terms that were chosen hold the part of alpha_dot",)
    return ()


def unstable(
    candidates: Sequence[Candidate],
    path: Sequence[Step],
    size: int,
    *,
    price: float,
    repeats: int,
    predicted: bool,
) -> tuple[str, ...]:
    """Say which terms resampled data would not choose, and where PRESS and predictions would stop.

    Args:
        candidates: all of them.
        path: orthogonal functions.
        size: how many of them were chosen.
        price: the least evidence that brings in a term.
        repeats: how many resampled selections there were.
        predicted: whether flights were kept out.
    """
    found = [
        f"{item.term.label} in {_RATES[item.equation]}: only {item.frequency:.0%} of the resampled selections chose it"
        for item in candidates
        if repeats and item.chosen and item.frequency < _STABLE
    ]
    for what, values, asked in (
        ("PRESS", [step.press for step in path], True),
        ("the prediction of the flights kept out", [step.prediction for step in path], predicted),
    ):
        best = int(np.argmin(values)) + 1
        if asked and values[size - 1] > values[best - 1] * (1 + price / 100):
            found.append(f"{what} would have chosen {best} terms, not {size}")
    return tuple(found)
