"""Points of a curve while it is followed, and where the next ones are to be put."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.dynamics.diagram.curve import CurveKind, DiagramCurve

_CLOSEST: Final = 1e-6
"""Of an interval: how near to a singular end of it a curve is followed; the end itself is known otherwise."""
_CROWD: Final = (0.04, 0.008, 1e-3, 3e-5, _CLOSEST)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Knot:
    """One point of a curve; see ``DiagramCurve``."""

    mu: float
    lam: float
    x: float
    residual: float
    resolved: bool
    change: tuple[int, int]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """How large the plane is, for what counts as smooth.

    Attributes:
        mu: its width.
        lam: its height.
        share: how far a point may lie from the chord of its neighbors.
    """

    mu: float
    lam: float
    share: float


def spaced(low: float, high: float, count: int, *, singular: tuple[bool, bool]) -> list[float]:
    """Return places inside an interval, both ends included where they are not singular, crowded where they are."""
    t = np.linspace(0.0, 1.0, count)
    if singular[0] and singular[1]:
        t = 0.5 - 0.5 * np.cos(math.pi * t)
    elif singular[0]:
        t = t * t
    elif singular[1]:
        t = 1.0 - (1.0 - t) ** 2
    shares = set(t.tolist())
    if singular[0]:
        shares |= set(_CROWD)
    if singular[1]:
        shares |= {1.0 - share for share in _CROWD}
    shares -= {float(end) for end, bad in zip((0.0, 1.0), singular, strict=True) if bad}
    places = {low + share * (high - low) for share in shares if 0.0 < share < 1.0}
    return sorted(places | {end for end, share in ((low, 0.0), (high, 1.0)) if share in shares})


def bends(knots: Sequence[Knot], window: Window) -> list[float]:
    """Return the μ at which a curve is to be looked at again, because it bends between its points."""
    wanted = set()
    for before, here, after in zip(knots, knots[1:], knots[2:], strict=False):
        share = (here.mu - before.mu) / (after.mu - before.mu)
        chord = before.lam + share * (after.lam - before.lam)
        # What a chord misses of a curve that begins as a root is in μ, not in λ: the smaller one counts.
        steep = abs(after.lam - before.lam) / window.lam * window.mu / (after.mu - before.mu)
        if abs(here.lam - chord) > window.share * window.lam * max(1.0, steep):
            wanted |= {0.5 * (before.mu + here.mu), 0.5 * (here.mu + after.mu)}
    return sorted(wanted)


def curve_of(  # noqa: PLR0913 - a curve has as many parts
    kind: CurveKind,
    name: str,
    cell: int,
    knots: Sequence[Knot],
    *,
    enclosed: tuple[int, ...],
    ends: tuple[str, str],
    exact: bool = True,
    caution: str = "",
) -> DiagramCurve:
    """Make a curve of its points."""
    return DiagramCurve(
        kind=kind,
        name=name,
        cell=cell,
        exact=exact,
        mu=np.array([knot.mu for knot in knots]),
        lam=np.array([knot.lam for knot in knots]),
        x=np.array([knot.x for knot in knots]),
        residual=np.array([knot.residual for knot in knots]),
        resolved=np.array([knot.resolved for knot in knots], dtype=np.bool_),
        enclosed=enclosed,
        change=np.array([knot.change for knot in knots], dtype=np.float64).reshape(len(knots), 2),
        ends=ends,
        caution=caution,
    )
