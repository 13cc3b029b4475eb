"""Where something happens on a curve of equilibria: found by signs between neighboring points, then closed in.

Four signs are watched (Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed. 2004, section 10.2): the tangent's
component along the parameter (folds), the determinant of Jacobian and tangent (branch points), the product of all sums
of two eigenvalues (Hopf points and neutral saddles) and the number of unstable eigenvalues, which tells the last two
apart. A step over which more than one thing may have happened is halved until each stands alone. Where a sign is
exactly zero at a point, as when a step lands on a Hopf point, the next point's sign decides.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray
from finback.dynamics.continuation.field import FIRST_STEP, FieldError, ScaledField
from finback.dynamics.continuation.path import PathPoint, between
from finback.dynamics.zero import zero_between

_HALVINGS: Final = 14
_DOUBTS: Final = 2  # halvings where only the parameter's cubic suggests that it turns twice
_SHARE: Final = 1e-15  # of a step: Brent's method ends at rounding
_FIRST_BRACKET: Final = 1e-11  # typical sizes; widened tenfold until the signs differ beyond rounding
_JUMP: Final = 3.0 * FIRST_STEP  # typical sizes: outside of what a difference across a corner smooths
_BALANCED: Final = 1e-9  # of the largest eigenvalue: a sum of two that differences cannot tell from zero
_FEW: Final = 3
_ONE_PAIR: Final = 2  # eigenvalues
_STILL_JUMPS: Final = 1.5  # a smooth test function doubles when the distance from its zero does


class Happening(StrEnum):
    """What is seen between two neighboring points."""

    FOLD = "fold"
    BRANCH_POINT = "branch-point"
    HOPF = "hopf"
    NEUTRAL_SADDLE = "neutral-saddle"
    COINCIDENCE = "coincidence"
    """more eigenvalues cross the imaginary axis than one thing explains, and no halving of the step parts them"""


@final
@dataclass(frozen=True, slots=True)
class Observed:
    """A point with what is watched at it.

    Attributes:
        point: where.
        eigenvalues: shape (d,).
        along: the tangent's component along the parameter.
        branching: determinant of Jacobian and tangent.
        pairs: product of all sums of two eigenvalues over the largest.
        balance: the smallest of these sums in absolute value.
        unstable: number of eigenvalues with positive real parts.
    """

    point: PathPoint
    eigenvalues: NDArray[np.complex128]
    along: float
    branching: float
    pairs: float
    balance: float
    unstable: int


@final
@dataclass(frozen=True, slots=True)
class Located:
    """Where a test function changes its sign.

    Attributes:
        kind: what happens.
        at: the point.
        before: a point on one side where the sign is beyond rounding.
        after: one on the other side.
        test: value of the test function at the point.
        corner: the test function jumps here: the field has a corner.
    """

    kind: Happening
    at: Observed
    before: Observed
    after: Observed
    test: float
    corner: bool


TESTS: Final[dict[Happening, Callable[[Observed], float]]] = {
    Happening.FOLD: lambda seen: seen.along,
    Happening.BRANCH_POINT: lambda seen: seen.branching,
    Happening.HOPF: lambda seen: seen.pairs,
    Happening.NEUTRAL_SADDLE: lambda seen: seen.pairs,
}


def observe(scaled: ScaledField, points: list[PathPoint]) -> list[Observed]:
    """Return the points with what is watched at them."""
    d = scaled.states
    jacobians = np.array([point.jacobian for point in points])
    tangents = np.array([point.tangent for point in points])
    eigenvalues = scaled.eigenvalues(jacobians)
    branching = np.linalg.det(np.concatenate((jacobians, tangents[:, np.newaxis, :]), axis=1))
    unstable = (eigenvalues.real > 0.0).sum(axis=1)
    sums = _sums(eigenvalues)
    pairs, balance = sums.prod(axis=-1).real, np.abs(sums).min(axis=-1, initial=1.0)
    watched = zip(tangents[:, d].tolist(), branching.tolist(), pairs.tolist(), balance.tolist(), strict=True)
    return [
        Observed(point, eigenvalues[k], *values, int(unstable[k]))
        for k, (point, values) in enumerate(zip(points, watched, strict=True))
    ]


def pair_sums(eigenvalues: NDArray[np.complex128]) -> FloatArray:
    """Return the product of all sums of two eigenvalues over their sizes, for each row of shape (n, d)."""
    product: FloatArray = _sums(eigenvalues).prod(axis=-1).real
    return product


def _sums(eigenvalues: NDArray[np.complex128]) -> NDArray[np.complex128]:
    one, other = np.triu_indices(eigenvalues.shape[-1], 1)
    size = np.abs(eigenvalues).max(axis=-1, keepdims=True)
    size[size == 0.0] = 1.0
    return np.asarray((eigenvalues[..., one] + eigenvalues[..., other]) / size)


def neutral_throughout(seen: list[Observed]) -> bool:
    """Tell whether two eigenvalues are opposite within rounding nearly everywhere: then their sum has no signs."""
    return sum(one.balance < _BALANCED for one in seen) > max(_FEW, 0.5 * len(seen))


def happenings(scaled: ScaledField, seen: list[Observed]) -> list[Located]:
    """Return everything located on a list of neighboring points, in its order."""
    if neutral_throughout(seen):
        seen = [replace(one, pairs=1.0, balance=1.0) for one in seen]
    found: list[Located] = []
    last = 0
    for index in range(1, len(seen)):
        if index + 1 < len(seen) and not _clear(seen[index]):
            continue  # exactly on something: it lies between this point's neighbors
        found += _resolved(scaled, seen[last], seen[index], _HALVINGS)
        last = index
    return found


def _clear(seen: Observed) -> bool:
    return seen.along != 0.0 and seen.branching != 0.0 and seen.pairs != 0.0 and seen.balance > _BALANCED


def _changed(before: float, after: float) -> bool:
    return bool(np.sign(before) != np.sign(after))  # a product could underflow


def _kinds(before: Observed, after: Observed) -> tuple[set[Happening], bool, bool]:
    """Return what happened between two points, whether it stands alone, and if not whether more eigenvalues cross."""
    fold, branch, pair = (
        _changed(getattr(before, name), getattr(after, name)) for name in ("along", "branching", "pairs")
    )
    change = abs(after.unstable - before.unstable)
    kinds: set[Happening] = set()
    if fold:
        kinds.add(Happening.FOLD)
    if branch:
        kinds.add(Happening.BRANCH_POINT)
    if pair:
        kinds.add(Happening.HOPF if change >= 2 else Happening.NEUTRAL_SADDLE)
    # One eigenvalue crosses at a fold and at a branch point, two at a Hopf point, none at a neutral saddle. On the
    # bent branch of a pitchfork fold and branch point fall together, and no eigenvalue crosses zero.
    expected = 2 if Happening.HOPF in kinds else int(fold != branch)
    alone = len(kinds) <= 1 or kinds == {Happening.FOLD, Happening.BRANCH_POINT}
    return kinds, alone and change == expected, change > expected and change >= _ONE_PAIR


def _resolved(scaled: ScaledField, before: Observed, after: Observed, halvings: int) -> list[Located]:
    kinds, alone, more = _kinds(before, after)
    doubtful = not kinds and alone and _may_turn_twice(before, after)
    if halvings == 0 and more:
        kinds = {*kinds - {Happening.HOPF, Happening.NEUTRAL_SADDLE}, Happening.COINCIDENCE}
    if (alone and not doubtful) or halvings == 0:
        return [located for kind in sorted(kinds) if (located := _located(scaled, kind, before, after))]
    try:
        middle = observe(scaled, [between(scaled, before.point, after.point, 0.5)])[0]
        if not _clear(middle):
            middle = observe(scaled, [between(scaled, before.point, after.point, 0.53)])[0]
    except FieldError:
        return []
    left = min(halvings - 1, _DOUBTS) if doubtful else halvings - 1
    return [*_resolved(scaled, before, middle, left), *_resolved(scaled, middle, after, left)]


def _crossing(before: Observed, after: Observed) -> Callable[[Observed], float]:
    """Return the mean real part of those eigenvalues that cross the imaginary axis between two points."""
    low, high = sorted((before.unstable, after.unstable))

    def mean(seen: Observed) -> float:
        return float(np.sort(seen.eigenvalues.real)[::-1][low:high].mean())

    return mean


def _may_turn_twice(before: Observed, after: Observed) -> bool:
    """Tell whether the parameter's cubic through both points and slopes rises and falls between them."""
    chord = after.point.u - before.point.u
    d = before.point.jacobian.shape[0]
    sign = 1.0 if before.along > 0.0 else -1.0
    first, last = sign * before.along, sign * after.along
    middle = 1.5 * sign * float(chord[d]) / float(np.linalg.norm(chord)) - 0.25 * (first + last)
    bend, slope = 2.0 * (first + last - 2.0 * middle), 4.0 * middle - 3.0 * first - last
    inside = bend > 0.0 and 0.0 < -slope < 2.0 * bend
    return inside and first - slope * slope / (4.0 * bend) < 0.0


def _located(scaled: ScaledField, kind: Happening, before: Observed, after: Observed) -> Located | None:
    test = _crossing(before, after) if kind is Happening.COINCIDENCE else TESTS[kind]
    cache: dict[float, Observed] = {0.0: before, 1.0: after}

    def at(share: float) -> Observed:
        if share not in cache:
            point = between(scaled, before.point, after.point, share)
            cache[share] = observe(scaled, [point])[0]
        return cache[share]

    def value(share: float) -> float:
        return test(at(share))

    length = float(np.linalg.norm(after.point.u - before.point.u))
    if kind is Happening.BRANCH_POINT:  # the plane across the chord is no help there: see its own equations
        nearest = min((before, after), key=lambda seen: abs(test(seen)))
        return Located(kind, nearest, before, after, test(nearest), corner=False)
    try:
        share = _zero(value)
        corner = _is_corner(value, share, length, test(before), test(after))
        if corner and kind is Happening.FOLD:
            share = _extremum(at, share, length, scaled.states, minimum=test(before) < 0.0)
        low, high = _bracket(value, share, length)
        return Located(kind, at(share), at(low), at(high), value(share), corner)
    except FieldError:
        return None


def _zero(value: Callable[[float], float]) -> float:
    """Return where it changes its sign between 0 and 1, a zero at an end included."""
    root = zero_between(value, 0.0, 1.0, xtol=_SHARE)
    if math.isnan(root):
        raise FieldError("a sign changes and does not, at the same place")
    return root


def _is_corner(value: Callable[[float], float], share: float, length: float, before: float, after: float) -> bool:
    """Tell whether the test function jumps, as seen from just outside what a difference smooths."""
    step = _JUMP / length
    near = value(share + step) - value(share - step)
    far = value(share + 2.0 * step) - value(share - 2.0 * step)
    return abs(far) < _STILL_JUMPS * abs(near) and (after - before) * near > 0.0


def _extremum(at: Callable[[float], Observed], share: float, length: float, state: int, *, minimum: bool) -> float:
    """Return where the parameter turns: the corner itself, by golden section, which does not mind it."""
    golden = 0.5 * (5.0**0.5 - 1.0)
    sign = 1.0 if minimum else -1.0

    def height(place: float) -> float:
        return sign * float(at(place).point.u[state])

    low, high = share - _JUMP / length, share + _JUMP / length
    left, right = high - golden * (high - low), low + golden * (high - low)
    while high - low > 4.0 * _SHARE and (high - low) * length > 1e-13:  # rounding of scaled values
        if height(left) <= height(right):
            high, right = right, left
            left = high - golden * (high - low)
        else:
            low, left = left, right
            right = low + golden * (high - low)
    middle: float = 0.5 * (low + high)
    return middle


def _bracket(value: Callable[[float], float], share: float, length: float) -> tuple[float, float]:
    """Return two shares around one, as near as possible, between which the sign changes."""
    width = _FIRST_BRACKET / length
    while width < 1.0:
        low, high = share - width, share + width
        if value(low) * value(high) < 0.0:
            return low, high
        width *= 10.0
    return 0.0, 1.0
