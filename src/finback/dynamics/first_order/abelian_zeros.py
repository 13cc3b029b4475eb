"""Limit cycles and folds of cycles of a cubic system to first order: zeros of the Abelian integral and their merging.

On each ring of level curves the a0 of the cycle is a function of the level (``first_order``); cycles at a given a0 are
its crossings, folds its extrema. The extrema are found by the sign of the slope, exact at the ends of the ring (by the
first Lyapunov coefficient at a center, by the damping at a saddle) and on a grid between them: two extrema between
neighboring points of the grid would be missed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np
from scipy.optimize import brentq

from finback.dynamics.first_order.abelian import (
    Ring,
    RingKind,
    first_order,
    first_order_slope,
    level_integrals,
    rings,
)
from finback.dynamics.first_order.estimate import FIRST_ORDER, Estimate, estimate_in_eps
from finback.dynamics.normal_form.cubic import Cubic
from finback.errors import RefusedError

_NEAREST: Final = 1e-13
"""Share of the ring's size within which a level cannot be told from the end of the ring in double precision."""
_DECADES_OUT: Final = 8  # beyond that many sizes only the leading powers are left
_PER_DECADE: Final = 6
_RTOL: Final = 1e-14


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FirstOrderCycle:
    """A level curve that survives as a limit cycle, to first order in the damping.

    Attributes:
        ring: which family it belongs to.
        level: H above the ring's origin.
        x_min: its leftmost point.
        x_max: its rightmost point.
        stable: whether it attracts.
    """

    ring: RingKind
    level: float
    x_min: float
    x_max: float
    stable: bool


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FirstOrderFold:
    """A level curve on which two cycles meet and vanish as a0 moves, to first order in the damping.

    Attributes:
        ring: which family it belongs to.
        level: H above the ring's origin.
        x_min: its leftmost point.
        x_max: its rightmost point.
        a0: the damping at the origin there.
        above: whether the two cycles exist for a0 above it; else below.
        resolved: whether the level is told from both ends of the ring in double precision; if not, only a0 holds.
    """

    ring: RingKind
    level: float
    x_min: float
    x_max: float
    a0: Estimate
    above: bool
    resolved: bool


def first_order_cycles(cubic: Cubic) -> tuple[FirstOrderCycle, ...]:
    """Return the limit cycles at the a0 of the system, to first order; by ring, then outward.

    Raises:
        RefusedError: as ``rings``, or the system is not in normal form.
    """
    _check(cubic)
    eps = math.sqrt(abs(cubic.b0))
    found = []
    for values in _all_values(cubic):
        marks = [values.first, *(fold.level for fold in _folds(values, eps) if fold.resolved), values.last(cubic.a0)]
        for low, high in pairwise(marks):
            before, after = values.a0(low) - cubic.a0, values.a0(high) - cubic.a0
            if before * after < 0.0:
                level = values.crossing(cubic.a0, low, high)
                on = level_integrals(values.ring, level)
                found.append(
                    FirstOrderCycle(
                        ring=values.ring.kind,
                        level=level,
                        x_min=on.x_min,
                        x_max=on.x_max,
                        stable=after > before,
                    )
                )
    return tuple(found)


def first_order_folds(cubic: Cubic) -> tuple[FirstOrderFold, ...]:
    """Return the folds of cycles of the systems that differ from this one in a0 only, to first order; by ring, outward.

    For b2 = 1 there is one if and only if a1 b1 > 0 and b_d < b0 < −a1 b1 (a0 ≈ −k_d b0, Shi & Fan 2013, Eq. 28-34);
    that none is found says nothing about cycles next to the two-saddle cycle (``first_order_saddles.loop_estimate``).
    For b2 = −1 and a1 = b1 = 0 there is one, of cycles around both wells: 0.752255640405833 b0.

    Raises:
        RefusedError: as ``rings``, or the system is not in normal form.
    """
    _check(cubic)
    eps = math.sqrt(abs(cubic.b0))
    return tuple(fold for values in _all_values(cubic) for fold in _folds(values, eps))


def _check(cubic: Cubic) -> None:
    if not cubic.is_normal:
        raise RefusedError("first-order estimates are for the normal form", hint="see cubic_normal_form and centered")


def _all_values(cubic: Cubic) -> list[_Values]:
    return [_Values(ring=ring, a2=cubic.a2, a1=cubic.a1) for ring in rings(cubic)]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Values:
    """The a0 of a cycle as a function of its level, on one ring."""

    ring: Ring
    a2: float
    a1: float

    @property
    def first(self) -> float:
        """The innermost level there are integrals for."""
        return 0.0 if self.ring.kind is RingKind.OUTER else _NEAREST * self.ring.size

    def last(self, a0: float) -> float:
        """Return the outermost level, or one beyond which no cycle at this a0 can lie."""
        if math.isfinite(self.ring.top):
            return self.ring.top
        # Far out I2/I0 is a fixed share of the squared width and I1/I0 stays finite.
        return max(self.ring.size * 10.0**_DECADES_OUT, self.ring.quartic * 100.0 * (a0 / self.a2) ** 2)

    def a0(self, level: float) -> float:
        return first_order(self.ring, level_integrals(self.ring, level), a2=self.a2, a1=self.a1)

    def slope(self, level: float) -> float:
        return first_order_slope(self.ring, level_integrals(self.ring, level), a2=self.a2, a1=self.a1)

    def crossing(self, a0: float, low: float, high: float) -> float:
        """Return the one level between two at which the cycle has this a0."""
        return float(brentq(lambda level: self.a0(level) - a0, low, high, xtol=1e-300, rtol=_RTOL))

    def slope_at_start(self) -> float:
        """Return the sign of the slope at the inner end, exactly where the integrals would cancel."""
        ring = self.ring
        if ring.kind is RingKind.OUTER:
            return self.slope(0.0)
        a1_here = self.a1 + 2.0 * self.a2 * ring.origin
        return -(self.a2 * ring.quadratic - a1_here * ring.cubic) / (2.0 * ring.quadratic**2)

    def slope_at_end(self) -> float:
        """Return the sign of the slope at the outer end."""
        return self.slope(self.ring.top) if math.isfinite(self.ring.top) else -self.a2

    def grid(self) -> list[float]:
        """Return levels from near one end of the ring to near the other, crowding at loops."""
        near_loop = np.geomspace(_NEAREST, 0.1, 13 * _PER_DECADE // 2)
        if self.ring.kind is RingKind.OUTER:
            shares = np.concatenate([near_loop, np.geomspace(0.1, 10.0**_DECADES_OUT, 9 * _PER_DECADE)[1:]])
        elif self.ring.kind is RingKind.SINGLE_WELL:
            shares = np.geomspace(1e-6, 10.0**_DECADES_OUT, 14 * _PER_DECADE)
        else:
            inner = np.concatenate([np.geomspace(1e-6, 0.05, 3 * _PER_DECADE), np.linspace(0.05, 0.9, 25)[1:]])
            shares = np.concatenate([inner, 1.0 - near_loop[::-1][1:]])
        return [float(share) * self.ring.size for share in shares]


def _folds(values: _Values, eps: float) -> list[FirstOrderFold]:
    ring, grid = values.ring, values.grid()
    slopes = [values.slope_at_start(), *map(values.slope, grid), values.slope_at_end()]
    points = [values.first, *grid, ring.top if math.isfinite(ring.top) else grid[-1]]
    # A point of the grid that falls on an extremum has no sign and is passed over.
    signed = [(x, math.copysign(1.0, slope)) for x, slope in zip(points, slopes, strict=True) if slope != 0.0]
    found = []
    for (low, before), (high, after) in pairwise(signed):
        if before == after:
            continue
        found.append(_fold(values, (low, high), eps, above=before < 0.0))
    return found


def _fold(values: _Values, between: tuple[float, float], eps: float, *, above: bool) -> FirstOrderFold:
    """Return the extremum between two levels; at an end of the ring what is nearer than rounding is not resolved."""
    ring, (low, high) = values.ring, between
    inner, outer = values.first, (1.0 - _NEAREST) * ring.top
    start, end = max(low, inner or _NEAREST * ring.size), min(high, outer)
    level, resolved = (low if low == values.first else high), False
    if start < end:
        ends = values.slope(start), values.slope(end)
        if ends[0] * ends[1] < 0.0:
            level = float(brentq(values.slope, start, end, xtol=1e-300, rtol=_RTOL))
            resolved = True
    on = level_integrals(ring, level)
    a0 = first_order(ring, on, a2=values.a2, a1=values.a1)
    cautions = () if resolved else ("nearer to the end of its ring than double precision can tell",)
    return FirstOrderFold(
        ring=ring.kind,
        level=level,
        x_min=on.x_min,
        x_max=on.x_max,
        a0=estimate_in_eps(a0, eps=eps, order=FIRST_ORDER, cautions=cautions),
        above=above,
        resolved=resolved,
    )
