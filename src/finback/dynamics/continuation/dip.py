"""Where the parameter nearly stands still between points of a branch: two turns within a step, a cusp, or neither."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from finback.dynamics.continuation.event import Observed, observe
from finback.dynamics.continuation.field import FieldError, ScaledField
from finback.dynamics.continuation.path import between

_FLAT: Final = 1e-9  # of the tangent: its component along the parameter, as rounding leaves it
_DIP: Final = 0.5  # of the greater neighbor; toward zero it falls faster, at the least as a parabola does
_GOLDEN: Final = 0.381966011250105
_SECTIONS: Final = 45  # of a step: its root of rounding, and some more
_RANK: Final = 1e-5  # of the largest singular value: a smaller one says that another branch crosses


def dips(scaled: ScaledField, seen: Sequence[Observed]) -> tuple[list[Observed], list[Observed]]:
    """Look at each minimum of the parameter's share of the tangent.

    Returns:
        the points, with one more wherever the parameter turns twice between neighbors; and where it does no more than
        stand still within rounding.
    """
    added: dict[int, Observed] = {}
    cusps: list[Observed] = []
    for k in range(1, len(seen) - 1):
        sizes = [abs(one.along) for one in seen[k - 1 : k + 2]]
        low = sizes[1] <= min(sizes[0], sizes[2]) and sizes[1] < _DIP * max(sizes[0], sizes[2])
        sign = float(np.sign(seen[k - 1].along))
        if not low or sign * seen[k + 1].along <= 0.0 or sign * seen[k].along < 0.0:
            continue
        trials = [(sign * found.along, i, found) for i in (k - 1, k) for found in [_lowest(scaled, seen, i, sign)]]
        height, i, lowest = min(trials, key=lambda trial: trial[0])
        singular = np.linalg.svd(lowest.point.jacobian)[1]
        if height > _FLAT or singular[-1] <= _RANK * singular[0]:
            continue
        if height < -_FLAT:
            added[i] = lowest
        else:
            cusps.append(lowest)
    return [one for k, point in enumerate(seen) for one in (point, *([added[k]] if k in added else []))], cusps


def _lowest(scaled: ScaledField, seen: Sequence[Observed], index: int, sign: float) -> Observed:
    """Return the point between two where the parameter changes least, or the other way (golden section)."""
    before, after = seen[index], seen[index + 1]

    def at(share: float) -> Observed:
        return observe(scaled, [between(scaled, before.point, after.point, share)])[0]

    def height(one: Observed) -> float:
        return sign * one.along

    best = min((before, after), key=height)
    low, high = 0.0, 1.0
    try:
        left, right = at(_GOLDEN), at(1.0 - _GOLDEN)
        for _ in range(_SECTIONS):
            best = min((best, left, right), key=height)
            if height(best) < -_FLAT:
                break
            if height(left) <= height(right):
                high = low + (1.0 - _GOLDEN) * (high - low)
                left, right = at(low + _GOLDEN * (high - low)), left
            else:
                low += _GOLDEN * (high - low)
                left, right = right, at(high - _GOLDEN * (high - low))
    except FieldError:
        pass
    return best
