"""Which predicted point is which simulated one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.optimize import linear_sum_assignment


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Matching:
    """Pairs of indices, and who found no partner.

    Attributes:
        pairs: (simulated, predicted), by rising index of the simulated.
        simulated_alone: indices without a partner.
        predicted_alone: the same of the predicted.
    """

    pairs: tuple[tuple[int, int], ...]
    simulated_alone: tuple[int, ...]
    predicted_alone: tuple[int, ...]


def match(simulated: Sequence[float], predicted: Sequence[float]) -> Matching:
    """Pair the points of two lists so that the sum of all distances is smallest; the longer list leaves some over.

    For ordered lists of equal length this pairs them in order.
    """
    distance = np.abs(np.subtract.outer(np.asarray(simulated, dtype=float), np.asarray(predicted, dtype=float)))
    rows, columns = linear_sum_assignment(distance)
    return Matching(
        pairs=tuple((int(row), int(column)) for row, column in zip(rows, columns, strict=True)),
        simulated_alone=tuple(sorted(set(range(len(simulated))) - {int(row) for row in rows})),
        predicted_alone=tuple(sorted(set(range(len(predicted))) - {int(column) for column in columns})),
    )
