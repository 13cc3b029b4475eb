"""Folds of cycles: where two cycles meet and vanish as the rotation parameter λ moves; extrema of λ* (see ``closure``).

At an extremum ∮(f + λ) dt, the logarithm of the multiplier, is zero. That integral keeps its digits where λ* has become
flat to rounding (towards a loop it is so exponentially), so that a fold is found and told from noise there as well.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, final

from scipy.optimize import brentq, minimize_scalar

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.family import Family
from finback.dynamics.flow import Flow, horner
from finback.dynamics.orbit.annulus import Annulus, Stretch, groups
from finback.dynamics.orbit.closure import Chart, Closed, Way, closed
from finback.errors import RefusedError

_NOISE: Final = 1e-13  # of the rate times the period: what rounding may leave of ∮f dt
_GAP: Final = 1e-8  # of the rate: nearer to a loop only λ has a meaning
_GRAIN: Final = 1e-14  # of the rate: nearer to the Hopf point a fold is not told from it
_XTOL: Final = 1e-12  # of p: λ* is flat at the fold
_DIP: Final = 1e-3  # of p: how well the least growth between two nodes is looked for
_DEEPEST: Final = 300.0  # of p: nearer to a saddle than e^−300 the square of the distance is no number


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CycleFold:
    """A semistable cycle: two cycles meet.

    Attributes:
        lam: the λ at which it exists, a constant added to the damping.
        x_min: where it turns on the left.
        x_max: where it turns on the right.
        period: the time of a turn.
        enclosed: the equilibria inside.
        vanishing: -1 if the two cycles exist for λ below, 1 if above.
        gap: distance of λ to that of the nearer loop at an end of the annulus; nan if there is none.
        residual: ∮(f + λ) dt, as evaluated: zero at a fold; nan where the fold is so near to a loop that it is known
            from the signs of the growth and of the saddle's trace only, its place and period by extrapolation.
        bracket: two places of x_max around it at whose closed orbits the residual has opposite signs, shape (2,).
        resolved: whether λ is told from those of the loops (by 1e-8 of the rate of the flow) and of the Hopf point
            (beyond rounding); where it is not, λ alone has a meaning.
    """

    lam: float
    x_min: float
    x_max: float
    period: float
    enclosed: tuple[float, ...]
    vanishing: int
    gap: float
    residual: float
    bracket: FloatArray
    resolved: bool

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "bracket", frozen_array(self.bracket))


@final
@dataclass(frozen=True, slots=True)
class Extremum:
    """An extremum of λ* inside an annulus.

    Attributes:
        stretch: the index of its stretch.
        node: the closed orbit there.
        low: a closed orbit farther in with a multiplier on one side of 1.
        high: one farther out with a multiplier on the other side.
    """

    stretch: int
    node: Closed
    low: Closed
    high: Closed


def cycle_folds(family: Family, mu: float) -> tuple[CycleFold, ...]:
    """Find the folds of cycles at a held μ, at whatever λ.

    All annuli are searched (see ``annulus``), on some 50 closed orbits each, denser towards loops; two folds that lie
    between neighbors without leaving a trace in the multiplier are missed: the count is measured, not proven.

    Raises:
        RefusedError: equilibria meet at this μ within rounding.
    """
    flow = family.at(mu, 0.0)
    found: list[CycleFold] = []
    for group in groups(flow):
        annulus = group.annulus()
        if annulus is not None:
            found += annulus_folds(flow, annulus)
    return tuple(sorted(found, key=lambda fold: fold.lam))


def annulus_folds(flow: Flow, annulus: Annulus) -> tuple[CycleFold, ...]:
    """Return the folds of cycles in one annulus, outward."""
    return tuple(_cycle_fold(flow, annulus, extremum) for extremum in extrema(flow, annulus))


def extrema(flow: Flow, annulus: Annulus) -> tuple[Extremum, ...]:
    """Return the extrema of λ* in an annulus, outward."""
    found = list(_in_tail(flow, annulus.stretches[0], 0, annulus.inner_saddle, inward=True))
    for index, stretch in enumerate(annulus.stretches):
        found += _inside(index, stretch)
    last = len(annulus.stretches) - 1
    found += _in_tail(flow, annulus.stretches[last], last, annulus.outer_saddle, inward=False)
    return tuple(found)


def sign_of_growth(chart: Chart, node: Closed) -> int:
    """Return the sign of the logarithm of a multiplier, 0 where rounding could have made it."""
    if abs(node.growth) <= _NOISE * max(1.0, chart.rate * node.period):
        return 0
    return 1 if node.growth > 0.0 else -1


def _inside(index: int, stretch: Stretch) -> Iterator[Extremum]:
    """Yield the extrema between the nodes of a stretch: where the growth changes its sign, once or, in a dip, twice."""
    chart = stretch.chart
    clear = [node for node in stretch.nodes if sign_of_growth(chart, node)]
    for before, (low, high) in zip([None, *clear], pairwise(clear), strict=False):
        if low.growth * high.growth < 0.0:
            yield from _extremum(index, chart, low, high)
        elif before is not None and _dips(before, low, high):
            turned = _dip(chart, before, low, high)
            if turned is not None:
                yield from _extremum(index, chart, before, turned)
                yield from _extremum(index, chart, turned, high)


def _dips(before: Closed, low: Closed, high: Closed) -> bool:
    same = before.growth * low.growth > 0.0
    return same and abs(low.growth) < min(abs(before.growth), abs(high.growth))


def _dip(chart: Chart, before: Closed, low: Closed, high: Closed) -> Closed | None:
    """Return a closed orbit between two whose growth has the other sign, where the growth comes nearest to zero."""
    sign = math.copysign(1.0, low.growth)
    turned: list[Closed] = []

    def height(p: float) -> float:
        node = _at(chart, p, low)
        if sign_of_growth(chart, node) == -sign:
            turned.append(node)
            raise StopIteration  # one such orbit tells as much as the lowest
        return sign * node.growth

    try:
        minimize_scalar(height, bounds=(before.p, high.p), method="bounded", options={"xatol": _DIP})
    except StopIteration:
        return turned[0]
    except RefusedError:
        if _varies(chart, before, low, high):
            raise
    return None


def _at(chart: Chart, p: float, near: Closed) -> Closed:
    node = closed(chart, p, near.lam)
    if node is None:
        raise RefusedError("a closed orbit between two others could not be followed")
    return node


def _extremum(index: int, chart: Chart, low: Closed, high: Closed) -> Iterator[Extremum]:
    """Yield the extremum between two closed orbits, unless λ* does not vary there: all orbits close, within rounding.

    Towards a saddle it need not vary to be there.
    """

    def growth(p: float) -> float:
        return low.growth if p == low.p else high.growth if p == high.p else _at(chart, p, low).growth

    try:
        node = _at(chart, float(brentq(growth, low.p, high.p, xtol=_XTOL)), low)
    except RefusedError:
        if _varies(chart, low, high):
            raise
        return
    if _varies(chart, low, node, high) or chart.way is not Way.FROM_FOCUS:
        yield Extremum(index, node, low, high)


def _varies(chart: Chart, *nodes: Closed) -> bool:
    """Tell whether λ* differs between closed orbits by more than rounding."""
    values = [node.lam for node in nodes]
    return max(values) - min(values) > _GRAIN * max(chart.rate, *map(abs, values))


def _in_tail(flow: Flow, stretch: Stretch, index: int, saddle: float, *, inward: bool) -> Iterator[Extremum]:
    """Yield the extremum nearer to a loop than the last node, if the trace of the saddle says that there is one.

    Towards a loop the growth runs to ±∞ with the sign of the trace, in proportion to the logarithm of the distance.
    """
    chart = stretch.chart
    end, neighbor = (stretch.nodes[0], stretch.nodes[1:2]) if inward else (stretch.nodes[-1], stretch.nodes[-2:-1])
    if math.isnan(saddle) or not neighbor:
        return
    trace = horner(flow.damping, saddle) + end.lam
    rise = (end.growth - neighbor[0].growth) / (end.p - neighbor[0].p) * (-1.0 if inward else 1.0)
    if not (sign_of_growth(chart, end) * trace < 0.0 and rise * trace > 0.0 and abs(trace) > _NOISE * chart.rate):
        return
    step = -1.5 * end.growth / rise  # half as far again as where a straight line crosses zero
    p = end.p - step if inward else end.p + step
    if abs(p) > _DEEPEST:
        turns = (end.period - neighbor[0].period) / (end.growth - neighbor[0].growth)
        period = end.period - turns * end.growth
        node = replace(end, p=p, growth=math.nan, period=period)
        far = replace(node, growth=-end.growth)
        yield Extremum(index, node, *((far, end) if inward else (end, far)))
        return
    beyond = closed(chart, p, end.lam)
    if beyond is not None and beyond.growth * end.growth < 0.0:
        low, high = (beyond, end) if inward else (end, beyond)
        yield from _extremum(index, chart, low, high)


def _cycle_fold(flow: Flow, annulus: Annulus, extremum: Extremum) -> CycleFold:
    node, chart = extremum.node, annulus.stretches[extremum.stretch].chart
    loops = [
        end.lam
        for end, saddle in ((annulus.inner, annulus.inner_saddle), (annulus.outer, annulus.outer_saddle))
        if not math.isnan(saddle)
    ]
    gap = min((abs(node.lam - lam) for lam in loops), default=math.nan)
    told = len(annulus.enclosed) > 1
    if not told:
        hopf = -horner(flow.damping, annulus.enclosed[0].x)
        told = abs(node.lam - hopf) > _GRAIN * max(chart.rate, abs(hopf))
    return CycleFold(
        lam=node.lam,
        x_min=node.x_min,
        x_max=node.x_max,
        period=node.period,
        enclosed=tuple(point.x for point in annulus.enclosed),
        # λ* rises outward where the growth is negative, so from negative to positive is a maximum.
        vanishing=-1 if extremum.low.growth < 0.0 else 1,
        gap=gap,
        residual=node.growth,
        bracket=frozen_array((extremum.low.x_max, extremum.high.x_max)),
        resolved=told and not gap <= _GAP * chart.rate,
    )
