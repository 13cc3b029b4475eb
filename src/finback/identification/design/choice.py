"""D-optimal choice: the set of flights that leaves the smallest volume of uncertainty about a model.

Exact designs (each flight once or more) by greedy additions and exchanges (Fedorov 1972); how far they are from the
best conceivable one is told by the theorem of Kiefer and Wolfowitz (1960): if no candidate tells more than p of the
design's own measure, nothing better exists, and by how much one exceeds p bounds what is left to gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError, RefusedError
from finback.identification.design.information import Information

_MOST_EXCHANGES: Final = 1000
_MULTIPLICATIONS: Final = 2000
_START: Final = 1e-9
"""Of the mean information of all candidates, with which a choice begins, so that the first flights have a volume."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A set of flights, and what it will tell.

    Attributes:
        names: the flights, in the order in which they were found; one that is worth repeating stands there again.
        covariance: Cramér-Rao bound of the coefficients, shape (p, p), in SI.
        efficiency: volume of the information, as p-th root, over that of the best conceivable mixture of the
            candidates with as much flying: a lower bound, 1 for a design that cannot be improved.
    """

    names: tuple[str, ...]
    covariance: FloatArray
    efficiency: float

    def __post_init__(self) -> None:
        """Freeze the covariance."""
        object.__setattr__(self, "covariance", frozen_array(self.covariance))

    @property
    def standard_errors(self) -> FloatArray:
        """The smallest standard error that any unbiased estimate can have, shape (p,), in SI."""
        return frozen_array(np.sqrt(np.diag(self.covariance)))


def bound(flights: Sequence[Information]) -> FloatArray:
    """Return the Cramér-Rao bound of a set of flights: the smallest covariance, shape (p, p).

    Raises:
        RefusedError: they leave some coefficients undetermined.
    """
    total = np.sum([item.matrix for item in flights], axis=0)
    scale = np.sqrt(np.diag(total))
    if not (scale > 0).all() or np.linalg.cond(total / np.outer(scale, scale)) > 1e12:
        raise RefusedError(
            "these flights leave some coefficients undetermined", hint="add flights at other trims or amplitudes"
        )
    return frozen_array(np.linalg.inv(total / np.outer(scale, scale)) / np.outer(scale, scale))


def d_optimal(candidates: Sequence[Information], *, count: int, repeated: int = 1) -> Choice:
    """Choose flights.

    Args:
        candidates: what each could tell; all of one model.
        count: how many flights there are to be.
        repeated: how often one flight may be flown.

    Raises:
        InputError: too few candidates.
        RefusedError: all candidates together leave some coefficients undetermined.
    """
    if not 1 <= count <= len(candidates) * repeated:
        raise InputError(f"{count} flights cannot be chosen from {len(candidates)} candidates, each {repeated} times")
    whole = np.sum([item.matrix for item in candidates], axis=0)
    scale = np.sqrt(np.diag(whole))
    bound(candidates)  # refuses what no choice could determine
    matrices = np.array([item.matrix / np.outer(scale, scale) for item in candidates])
    chosen = _exchanged(matrices, _greedy(matrices, count, repeated), repeated)
    weights = np.bincount(chosen, minlength=len(matrices)) / count
    return Choice(
        names=tuple(candidates[i].flight.name for i in chosen),
        covariance=bound([candidates[i] for i in chosen]),
        efficiency=_efficiency(matrices, weights),
    )


def _log_volume(matrix: FloatArray) -> float:
    sign, value = np.linalg.slogdet(matrix)
    return float(value) if sign > 0 else -np.inf


def _greedy(matrices: FloatArray, count: int, repeated: int) -> list[int]:
    total = _START * matrices.mean(axis=0)
    chosen: list[int] = []
    for _ in range(count):
        able = [i for i in range(len(matrices)) if chosen.count(i) < repeated]
        best = max(able, key=lambda i: _log_volume(total + matrices[i]))
        chosen.append(best)
        total = total + matrices[best]
    return chosen


def _exchanged(matrices: FloatArray, chosen: list[int], repeated: int) -> list[int]:
    """Exchange one flight for another while that adds to the volume."""
    volume = _log_volume(matrices[chosen].sum(axis=0))
    for _ in range(_MOST_EXCHANGES):
        total, best = matrices[chosen].sum(axis=0), (volume + 1e-9, -1, -1)
        for place, old in enumerate(chosen):
            for new in range(len(matrices)):
                if new != old and chosen.count(new) < repeated:
                    changed = _log_volume(total - matrices[old] + matrices[new])
                    best = max(best, (changed, place, new))
        if best[1] < 0:
            break
        volume = best[0]
        chosen = [best[2] if place == best[1] else old for place, old in enumerate(chosen)]
    return chosen


def _efficiency(matrices: FloatArray, weights: FloatArray) -> float:
    """Bound the share of the best mixture's volume that a mixture has, from below.

    The multiplicative algorithm (Titterington 1976) approaches the best mixture; its largest directional derivative
    d bounds what is above it: volume of the best <= volume of this one · d/p.
    """
    size = matrices.shape[1]
    best = np.full(len(matrices), 1.0 / len(matrices))
    for _ in range(_MULTIPLICATIONS):
        inverse = np.linalg.inv(np.tensordot(best, matrices, axes=1))
        gains = np.einsum("ij,kji->k", inverse, matrices)
        if gains.max() < size * (1 + 1e-6):
            break
        best = best * gains / size
    above = _log_volume(np.tensordot(best, matrices, axes=1)) / size + float(np.log(gains.max() / size))
    return float(np.exp(_log_volume(np.tensordot(weights, matrices, axes=1)) / size - above))
