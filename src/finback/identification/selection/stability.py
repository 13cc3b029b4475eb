"""How stable a selection is: repeated on data of which whole blocks are drawn with replacement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.identification.selection.equations import Equations
from finback.identification.selection.regression import Regression
from finback.identification.selection.search import best_subset


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Stability:
    """What repeated selections chose.

    Attributes:
        frequency: share of the selections that chose each candidate, shape (p,).
        same: share of the selections that chose exactly the terms that all data chose.
    """

    frequency: FloatArray
    same: float


def stability(equations: Equations, chosen: IntArray, *, prices: FloatArray, count: int, seed: int) -> Stability:
    """Repeat a selection on resampled blocks (Künsch 1989: blocks keep what neighbors have in common).

    A block is drawn more or less often, so each repetition sees the noise once more: frequencies are lower than the
    chance that another flight of the same maneuvers would choose the same, never higher.

    Args:
        equations: all of them.
        chosen: what all data chose.
        prices: of each term, shape (p,).
        count: repetitions; 0 for none, then all shares are 0.
        seed: of the draws.
    """
    random = np.random.default_rng(seed)
    numbers = np.unique(equations.blocks)
    rows = [np.flatnonzero(equations.blocks == number) for number in numbers]
    frequency, same = np.zeros(equations.regressors.shape[1]), 0
    for _ in range(count):
        drawn = np.concatenate([rows[i] for i in random.integers(0, len(rows), len(rows))])
        found = best_subset(
            Regression.of(equations.regressors[drawn], equations.target[drawn]),
            prices=prices,
            start=chosen,
        )
        frequency[found] += 1.0
        same += int(np.array_equal(found, chosen))
    return Stability(frequency=frozen_array(frequency / max(1, count)), same=same / max(1, count))
