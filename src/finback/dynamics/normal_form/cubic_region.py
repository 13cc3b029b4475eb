"""Regions I-V of the cubic system between two saddles (Shi & Fan 2013, Fig. 3-4: a2 = −1, b2 = 1, b0 < 0).

They are cut out on the axis of a0 by the Hopf point at 0, the loop and, where there is one, the fold of cycles. Where
these lie is given: as exact values, found by shooting, or as first-order estimates; the answer says by which.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

from finback.dynamics.connection.loop import Loop, LoopKind, loops
from finback.dynamics.cycle.fold import cycle_folds
from finback.dynamics.first_order.abelian_zeros import first_order_folds
from finback.dynamics.first_order.saddles import loop_estimate
from finback.dynamics.normal_form.cubic import Cubic
from finback.errors import InputError, RefusedError

_TOGETHER: Final = 1e-9
"""Two halves of a two-saddle cycle whose a0 differ by less, in units of b0, leave no room for a loop between them."""


class Region(StrEnum):
    """The five regions, with what the origin is and which cycles surround it."""

    I = "I"  # noqa: E741 - the paper's name
    """a0 above all curves: a source, no cycle"""
    II = "II"
    """between the fold and the higher of the other two: a source, a stable cycle within an unstable one"""
    III = "III"
    """above the Hopf point, below the loop: a source, one stable cycle"""
    IV = "IV"
    """above the loop, below the Hopf point: a sink, one unstable cycle"""
    V = "V"
    """below all curves: a sink, no cycle"""
    BORDER = "border"
    """on one of the curves"""

    @property
    def cycles(self) -> tuple[bool, ...]:
        """Whether each cycle is stable, from the inner one outward; of no meaning on a border."""
        return {"II": (True, False), "III": (True,), "IV": (False,)}.get(self.value, ())

    @property
    def origin_stable(self) -> bool:
        """Whether the origin is a sink; of no meaning on a border."""
        return self in (Region.IV, Region.V)


class CurveSource(StrEnum):
    """How the values of a0 on the curves were obtained."""

    EXACT = "exact"
    """loop by shooting, fold as a double cycle of the system itself"""
    FIRST_ORDER = "first-order"
    """−k_sc b0 and −k_d b0"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RegionCurves:
    """The a0 on the curves B_sc and B_d at given a1, b1, b0; B_h is a0 = 0.

    Attributes:
        loop: a0 of the loop at the lower saddle. Where b1 = 0 ≠ a1 that is the homoclinic one that closes.
        folds: a0 of the fold of cycles, none or one.
        source: how they were obtained.
        cautions: what is known against them, empty if nothing.
    """

    loop: float
    folds: tuple[float, ...]
    source: CurveSource
    cautions: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what cannot be a diagram of five regions."""
        if not all(map(math.isfinite, (self.loop, *self.folds))):
            raise InputError(f"the curves need finite values of a0, got loop {self.loop}, folds {self.folds}")
        if len(self.folds) > 1:
            raise InputError(f"{len(self.folds)} folds of cycles: the five regions know one at most")
        if any(fold < max(0.0, self.loop) for fold in self.folds):
            raise InputError(
                f"a fold at a0 = {self.folds[0]} below the loop at {self.loop} or the Hopf point at 0",
                hint="in normal form with b2 = 1 two cycles exist below their fold and above both",
            )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RegionAnswer:
    """Where a system lies.

    Attributes:
        region: the region.
        source: by which curves.
        distance: from a0 to the nearest of them; to be held against what the source leaves uncertain.
        cautions: what is known against the curves, empty if nothing.
    """

    region: Region
    source: CurveSource
    distance: float
    cautions: tuple[str, ...]


def region(cubic: Cubic, curves: RegionCurves) -> RegionAnswer:
    """Return the region of a system, given the curves at its a1, b1, b0.

    Raises:
        RefusedError: the system is not in normal form with b2 = 1, or the origin is no focus or node between saddles.
    """
    _check(cubic)
    marks = (0.0, curves.loop, *curves.folds)
    return RegionAnswer(
        region=_region(cubic.a0, curves),
        source=curves.source,
        distance=min(abs(cubic.a0 - mark) for mark in marks),
        cautions=curves.cautions,
    )


def exact_curves(cubic: Cubic, *, folds: tuple[float, ...] | None = None) -> RegionCurves:
    """Return the curves at a1, b1, b0 of a system: the loop by shooting, the fold as a double cycle.

    Args:
        cubic: in normal form; its a0 does not matter.
        folds: a0 of the folds of cycles around the origin, none or one, where they are known; None: they are found.

    Raises:
        RefusedError: the system is not in normal form with b2 = 1, the origin is no focus or node between saddles,
            the loop was not found, or there are more folds of cycles than five regions know.
    """
    _check(cubic)
    loop = _loop(cubic)
    folds = _folds(cubic, loop) if folds is None else folds
    cautions = () if loop.resolved else ("the loop is nearer to a two-saddle cycle than double precision can tell",)
    return RegionCurves(loop=loop.lam, folds=folds, source=CurveSource.EXACT, cautions=cautions)


def _folds(cubic: Cubic, loop: Loop) -> tuple[float, ...]:
    found = tuple(fold.lam for fold in cycle_folds(cubic.family(), cubic.b0))
    if len(found) > 1:
        raise RefusedError(
            f"{len(found)} folds of cycles lie at these a1, b1, b0, and the five regions know one",
            hint="counts() tells what there is",
        )
    # Where it is exponentially near to the loop or the Hopf point, rounding may have put a fold below them.
    return tuple(max(fold, loop.lam, 0.0) for fold in found)


def first_order_curves(cubic: Cubic) -> RegionCurves:
    """Return the curves at a1, b1, b0 of a system to first order.

    Raises:
        RefusedError: the system is not in normal form with b2 = 1, or the origin is no focus or node between saddles.
    """
    _check(cubic)
    loop, folds = loop_estimate(cubic), first_order_folds(cubic)
    cautions = (estimate.caution for estimate in (loop, *(fold.a0 for fold in folds)))
    return RegionCurves(
        loop=loop.value,
        # A fold that double precision does not tell from its loop or Hopf point may fall a rounding below it.
        folds=tuple(max(fold.a0.value, loop.value, 0.0) for fold in folds),
        source=CurveSource.FIRST_ORDER,
        cautions=tuple(dict.fromkeys(text for text in cautions if text)),
    )


def _loop(cubic: Cubic) -> Loop:
    """Return the homoclinic loop around the origin, or half of the two-saddle cycle."""
    found = loops(cubic.family(), cubic.b0)
    closed = [loop for loop in found if loop.kind is LoopKind.HOMOCLINIC and loop.turns.size == 1]
    if len(closed) == 1:
        return closed[0]
    halves = [loop for loop in found if loop.kind is LoopKind.HETEROCLINIC and loop.turns.size == 0]
    if not closed and len(halves) == 2 and abs(halves[0].lam - halves[1].lam) < _TOGETHER * abs(cubic.b0):
        return halves[0]
    raise RefusedError(f"{len(closed)} loops around the origin were found for {cubic}")


def _check(cubic: Cubic) -> None:
    if not cubic.is_normal or cubic.b2 < 0.0 or cubic.b0 >= 0.0:
        raise RefusedError(
            f"the regions are those of the normal form with b2 = 1 and b0 < 0, and this is {cubic}",
            hint="centered() leads there, if b2 > 0 and there are three equilibria",
        )


def _region(a0: float, curves: RegionCurves) -> Region:
    if a0 in (0.0, curves.loop, *curves.folds):
        return Region.BORDER
    low, high = sorted((0.0, curves.loop))
    if a0 < low:
        return Region.V
    if a0 < high:
        return Region.III if curves.loop > 0.0 else Region.IV
    return Region.II if any(a0 < fold for fold in curves.folds) else Region.I
