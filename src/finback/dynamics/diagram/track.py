"""A fold of cycles between two known ones: found from where it must be, without a search of the whole annulus."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from scipy.optimize import brentq

from finback.dynamics.cycle.fold import CycleFold
from finback.dynamics.diagram.annulus import fold_of
from finback.dynamics.diagram.scan import chart_at
from finback.dynamics.diagram.strip import Strip
from finback.dynamics.orbit.closure import Chart, Closed, Way, closed

_XTOL: Final = 1e-10  # of p: λ is flat there, and its error the square of this
_FIRST: Final = 0.02  # of p: how far beside the expected place is looked first
_WIDEST: Final = 2.0  # of p: and how far at most
_CLOSE: Final = 0.5  # of the way from the innermost equilibrium to a saddle: nearer to the saddle it is the origin

Located = tuple[float, CycleFold]
"""A fold and its μ."""


def between(strip: Strip, key: tuple[int, ...], mu: float, ends: tuple[Located, Located]) -> CycleFold | None:
    """Find the fold at a μ between those of two others on the same curve.

    Returns:
        the fold; None if it is not where it is expected: then a search will have to tell.
    """
    places = strip.equilibria(mu)
    if not places or not all(fold.resolved for _, fold in ends):
        return None
    charts = _charts(strip, key, mu, ends)
    if charts is None:
        return None
    chart, names = charts
    share = (mu - ends[0][0]) / (ends[1][0] - ends[0][0])
    expected = names[0] + share * (names[1] - names[0])
    guess = ends[0][1].lam + share * (ends[1][1].lam - ends[0][1].lam)
    node = _extremum(chart, expected, guess, abs(names[1] - names[0]))
    return None if node is None else _fold(strip, key, mu, (chart, *node), ends[0][1].vanishing)


def _charts(
    strip: Strip, key: tuple[int, ...], mu: float, ends: tuple[Located, Located]
) -> tuple[Chart, tuple[float, float]] | None:
    """Return a chart of the cycles at μ, and the names p that the two known folds have in such charts at their μ."""
    saddle = _nearest_saddle(strip, key, ends[0])
    names = []
    for place, fold in ends:
        here = strip.equilibria(place)
        if not here:
            return None
        if saddle is None:
            distance = fold.x_max - here[key[-1]]
            names.append(math.log(distance) if distance > 0.0 else math.nan)
        else:
            distance = here[saddle] - fold.x_max if saddle > key[-1] else fold.x_min - here[saddle]
            names.append(-math.log(distance) if distance > 0.0 else math.nan)
    if any(map(math.isnan, names)):
        return None
    return _chart(strip, key, mu, saddle), (names[0], names[1])


def _nearest_saddle(strip: Strip, key: tuple[int, ...], known: Located) -> int | None:
    """Return the neighboring saddle to which a cycle comes near, None if it does not."""
    places, fold = strip.equilibria(known[0]), known[1]
    near = []
    if key[0] > 0:
        left = places[key[0] - 1]
        near.append(((fold.x_min - left) / (places[key[0]] - left), key[0] - 1))
    if key[-1] + 1 < len(places):
        right = places[key[-1] + 1]
        near.append(((right - fold.x_max) / (right - places[key[-1]]), key[-1] + 1))
    return min(near)[1] if near and min(near)[0] < _CLOSE else None


def _chart(strip: Strip, key: tuple[int, ...], mu: float, saddle: int | None) -> Chart:
    flow, places = strip.family.at(mu, 0.0), strip.equilibria(mu)
    if saddle is None:
        return chart_at(flow, places, key, key[-1], Way.FROM_FOCUS, mirrored=False)
    return chart_at(flow, places, key, saddle, Way.TO_SADDLE, mirrored=saddle < key[0])


def _extremum(chart: Chart, expected: float, guess: float, step: float) -> tuple[Closed, Closed, Closed] | None:
    """Return the closed orbit where the growth over a turn is zero, and one on either side of it."""
    found: dict[float, Closed] = {}

    def growth(p: float) -> float:
        node = closed(chart, p, guess)
        if node is None:
            raise ArithmeticError
        found[p] = node
        return node.growth

    try:
        ends = _bracket(growth, expected, min(max(_FIRST, 0.2 * step), 0.25))
        if ends is None:
            return None
        low, high = ends
        root = float(brentq(growth, low, high, xtol=_XTOL))
        growth(root)
    except ArithmeticError:
        return None
    return found[root], found[low], found[high]


def _bracket(growth: Callable[[float], float], place: float, step: float) -> tuple[float, float] | None:
    here = growth(place)
    slope = (growth(place + step) - here) / step
    if slope == 0.0 or not np.isfinite(slope):
        return None
    # The first step is that of a secant, and half as much again.
    way = -here / slope
    target = place + math.copysign(max(1.5 * abs(way), 0.1 * step), way)
    for _ in range(6):
        if abs(target - place) > _WIDEST:
            return None
        if growth(target) * here < 0.0:
            return (place, target) if place < target else (target, place)
        target = place + 2.0 * (target - place)
    return None


def _fold(
    strip: Strip, key: tuple[int, ...], mu: float, at: tuple[Chart, Closed, Closed, Closed], vanishing: int
) -> CycleFold | None:
    chart, node, low, high = at
    if (-1 if low.growth < 0.0 else 1) != vanishing:
        return None  # another extremum
    hopf = strip.hopf(mu, key[0]) if len(key) == 1 else None
    enclosed = tuple(strip.equilibria(mu)[index] for index in key)
    return fold_of(
        chart, (node, low, high), enclosed, strip.bounding(mu, key, node.lam), math.nan if hopf is None else hopf.lam
    )
