"""The annuli in which closed orbits can lie, and the rotation parameter λ* across each.

A closed orbit of x' = y, y' = f y + g crosses y = 0 twice and encloses equilibria that follow each other, from one
that is no saddle to one that is none. For each such group the orbits around it fill an annulus, which ends inward at
the one equilibrium or at a loop through a saddle of the group, outward at a loop through a neighboring saddle, or
nowhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.dynamics.flow import Flow, derivative, horner
from finback.dynamics.orbit.closure import Chart, Closed, Way, closed, field_at
from finback.dynamics.roots import real_roots, sign_across
from finback.errors import RefusedError

NEAREST: Final = 1e-12
"""How near to a saddle an annulus is followed, as a share of its size."""

_DEPTHS: Final = (NEAREST, 1e-6, 1e-3)  # where an orbit at an end of an annulus is looked for
_SMALLEST: Final = 1e-4  # of the size: nearer to a focus the closed form holds to rounding
_TINY: Final = math.log(1e-4)  # of p: one orbit still smaller, to hold the cycles beside a Hopf point
_STEP: Final = 0.5  # of p: what happens in an annulus happens over a factor of a distance
_SHORTEST: Final = 0.1  # of a step
_LONG_STEP: Final = 1.0  # the same at less than ``_TAIL`` of the size from a saddle, where all is a power of it
_TAIL: Final = 1e-3
_FAR: Final = 10.0  # sizes of the system, beyond which nothing new is expected
_OVERDAMPED: Final = 2.0  # the same where the multiplier is beyond e^±10, which grows outward
_STRONG: Final = 10.0
_MOST_NODES: Final = 400
_MOST_CHARTS: Final = 6  # how often the side that names larger orbits is changed


@final
@dataclass(frozen=True, slots=True)
class Pole:
    """An equilibrium, by the sign of its force's slope alone, which λ does not change.

    Attributes:
        x: where.
        saddle: whether it is a saddle.
    """

    x: float
    saddle: bool


@final
@dataclass(frozen=True, slots=True)
class Stretch:
    """Closed orbits of one chart, by rising p: outward.

    Attributes:
        chart: what p means.
        nodes: the orbits, one or more.
    """

    chart: Chart
    nodes: tuple[Closed, ...]


@final
@dataclass(frozen=True, slots=True)
class Annulus:
    """The closed orbits around one group of equilibria.

    Attributes:
        enclosed: the equilibria inside.
        stretches: the orbits, outward; the last of one chart is the first of the next.
        inner_saddle: the saddle of the loop at the inner end; nan if a focus is there.
        outer_saddle: the saddle of the loop at the outer end; nan if there is none.
        obstacle: why it was not followed to its end; empty if it was.
    """

    enclosed: tuple[Pole, ...]
    stretches: tuple[Stretch, ...]
    inner_saddle: float
    outer_saddle: float
    obstacle: str

    @property
    def inner(self) -> Closed:
        """The innermost orbit: it differs from the loop or focus there by nothing that λ shows."""
        return self.stretches[0].nodes[0]

    @property
    def outer(self) -> Closed:
        """The outermost orbit."""
        return self.stretches[-1].nodes[-1]


def poles(flow: Flow) -> tuple[Pole, ...]:
    """Return all equilibria, by rising x.

    Raises:
        RefusedError: one is degenerate within rounding (a fold), or the force is zero everywhere.
    """
    slope = derivative(flow.force)
    found = []
    for root in real_roots(flow.force, magnitudes=flow.force_sizes):
        sign = sign_across(slope, root.bracket) if root.resolved else 0
        if not sign:
            raise RefusedError("closed orbits are not searched where two equilibria meet (a fold) within rounding")
        found.append(Pole(root.value, sign > 0))
    return tuple(found)


def reach(flow: Flow, low: float, high: float) -> float:
    """Return the size of a system: how far the zeros of f and g, complex ones too, lie from the middle of a stretch."""
    middle, found = 0.5 * (low + high), [high - low]
    for row in (np.trim_zeros(flow.force, "b"), np.trim_zeros(flow.damping, "b")):
        if len(row) > 1:
            found += np.abs(np.polynomial.polynomial.polyroots(row) - middle).tolist()
    return max(found) or 1.0


def groups(flow: Flow) -> tuple[Group, ...]:
    """Return every group of equilibria that cycles may enclose: neighbors, one more no saddle than saddles.

    Raises:
        RefusedError: as for ``poles``.
    """
    points = poles(flow)
    centers = [index for index, point in enumerate(points) if not point.saddle]
    pairs = ((first, last) for k, last in enumerate(centers) for first in reversed(centers[: k + 1]))
    return tuple(Group(flow, points, first, last) for first, last in pairs)


@final
@dataclass(frozen=True, slots=True)
class Group:
    """Equilibria that follow each other, from one that is no saddle to one that is none.

    Attributes:
        flow: the flow.
        points: all its equilibria.
        first: the index of the first of the group.
        last: that of the last.
    """

    flow: Flow
    points: tuple[Pole, ...]
    first: int
    last: int

    @property
    def enclosed(self) -> tuple[Pole, ...]:
        """The equilibria of the group."""
        return self.points[self.first : self.last + 1]

    @property
    def limits(self) -> tuple[float, float]:
        """The neighboring saddles, beyond which no cycle around the group reaches, or infinite."""
        low = self.points[self.first - 1].x if self.first else -math.inf
        return low, self.points[self.last + 1].x if self.last + 1 < len(self.points) else math.inf

    def annulus(self) -> Annulus | None:
        """Follow the closed orbits from the inner to the outer end; None if there are none at any λ."""
        outer = self._to_saddle()
        inner = self._from_focus(outer) if self.first == self.last else self._over_saddle()
        if inner is None:
            return None
        chart, low = inner
        nodes = list(self._outward(chart, low, outer))
        if not nodes:
            return None
        stretches = [Stretch(chart, tuple(nodes))]
        obstacle = ""
        if outer is not None:
            rest = list(self._towards_saddle(outer, nodes[-1]))
            stretches += [Stretch(outer, tuple(rest))] if rest else []
            if not (rest and math.exp(-rest[-1].p) < 2.0 * NEAREST * self._size(outer)):
                obstacle = "the loop at its outer end passes another saddle too near to be followed to it"
        else:
            stretches += self._farther(nodes[-1], mirrored=not chart.field.mirrored)
            if not self._is_far(stretches[-1].nodes[-1]):
                last = stretches[-1].nodes[-1]
                obstacle = f"orbits larger than from x = {last.x_min:.6g} to {last.x_max:.6g} could not be followed"
        return Annulus(
            enclosed=self.enclosed,
            stretches=tuple(stretches),
            inner_saddle=math.nan if self.first == self.last else chart.field.origin,
            outer_saddle=math.nan if outer is None else outer.field.origin,
            obstacle=obstacle,
        )

    @property
    def rate(self) -> float:
        """A typical rate around the group: the fastest of its equilibria's, without damping."""
        slope = derivative(self.flow.force)
        return math.sqrt(max(abs(horner(slope, point.x)) for point in self.points[self.first : self.last + 1]))

    @property
    def _reach(self) -> float:
        return reach(self.flow, self.points[self.first].x, self.points[self.last].x)

    def _is_far(self, node: Closed) -> bool:
        """Tell whether nothing new is expected farther out: by size, or where the damping rules the orbit."""
        radius = 0.5 * (node.x_max - node.x_min)
        return radius > (_OVERDAMPED if abs(node.growth) > _STRONG else _FAR) * self._reach

    def chart(self, way: Way, origin: float, *, mirrored: bool) -> Chart:
        """Return the flow around one equilibrium, with the cells in which orbits around the group turn."""
        field = field_at(self.flow, origin, mirrored=mirrored)
        (low, high), inside = self.limits, (self.points[self.first].x, self.points[self.last].x)
        cells = sorted((field.u_of(low), field.u_of(inside[0]))), sorted((field.u_of(inside[1]), field.u_of(high)))
        left, right = reversed(cells) if mirrored else cells
        return Chart(field, way, (left[0], left[1]), (right[0], right[1]), self.rate)

    def _size(self, chart: Chart) -> float:
        """Return how far the saddle at the origin of a chart is from the group."""
        return -chart.right[0]

    def _to_saddle(self) -> Chart | None:
        """Return the chart of the outer end: at the neighboring saddle through which the loop there goes."""
        charts = [
            self.chart(Way.TO_SADDLE, limit, mirrored=mirrored)
            for limit, mirrored in zip(self.limits, (True, False), strict=True)
            if math.isfinite(limit)
        ]
        for depth in _DEPTHS:
            for chart in charts:
                if closed(chart, -math.log(depth * self._size(chart)), 0.0) is not None:
                    return chart
        return None

    def _from_focus(self, outer: Chart | None) -> tuple[Chart, float]:
        mirrored = outer is not None and outer.field.mirrored
        chart = self.chart(Way.FROM_FOCUS, self.points[self.first].x, mirrored=mirrored)
        size = self._reach if outer is None else self._size(outer)
        return chart, math.log(_SMALLEST * size)

    def _over_saddle(self) -> tuple[Chart, float] | None:
        """Return the chart of the inner end: at the saddle through which the loop there goes."""
        inside = [point for point in self.points[self.first : self.last + 1] if point.saddle]
        for depth in _DEPTHS:
            low = math.log(depth * self.rate * (self.points[self.last].x - self.points[self.first].x))
            for point in inside:
                for mirrored in (False, True):
                    chart = self.chart(Way.OVER_SADDLE, point.x, mirrored=mirrored)
                    if closed(chart, low, 0.0) is not None:
                        return chart, low
        return None

    def _outward(self, chart: Chart, low: float, outer: Chart | None, guess: float | None = None) -> Iterator[Closed]:
        """Yield orbits until half of the way to the saddle of the outer end is behind, or far outward.

        They begin at p = ``low``, beside a focus with one still smaller; but not if the λ of the first is given.
        """
        p, begins, guess = low, guess is None, guess or 0.0
        if begins and chart.way is Way.FROM_FOCUS:
            tiny = closed(chart, p + _TINY, guess)
            if tiny is not None:
                yield tiny
                guess = tiny.lam
        before, share = p, 1.0
        for index in range(_MOST_NODES):
            node = closed(chart, p, guess)
            if node is None:
                # Where the damping rules an orbit, λ* grows so fast that a shorter step may still be followed.
                share *= 0.5
                if outer is not None or not index or share < _SHORTEST:
                    return
                p = before + share * _STEP
                continue
            yield node
            if outer is None:
                if self._is_far(node):
                    return
            elif index and outer.field.u_of(outermost(node, outer)) > -0.5 * self._size(outer):
                return
            guess, before = node.lam, p
            p = self._next(chart, p, outer) if share == 1.0 else p + share * _STEP

    def _farther(self, node: Closed, *, mirrored: bool) -> Iterator[Stretch]:
        """Yield what else can be followed outward when orbits are named by where they turn on the other side.

        Where the damping rules an orbit, it may be drawn to the others along both halves from one of its ends, and
        driven from them along both from the other.
        """
        failed = 0
        for _ in range(_MOST_CHARTS):
            if failed == 2 or self._is_far(node):
                return
            chart = self.chart(Way.FROM_FOCUS, self.points[self.first if mirrored else self.last].x, mirrored=mirrored)
            turn = chart.field.u_of(node.x_min if mirrored else node.x_max)
            nodes = tuple(self._outward(chart, math.log(turn), None, node.lam))
            failed = 0 if len(nodes) > 1 else failed + 1
            if not failed:
                yield Stretch(chart, nodes)
                node = nodes[-1]
            mirrored = not mirrored

    def _next(self, chart: Chart, p: float, outer: Chart | None) -> float:
        """Return the next p; in the chart of a focus the last is half of the way to the saddle exactly."""
        if chart.way is Way.FROM_FOCUS and outer is not None:
            half = math.log(0.5 * self._size(outer)) + 1e-9
            return min(p + _STEP, half) if p < half else p + _STEP
        small = _TAIL * self.rate * (self.points[self.last].x - self.points[self.first].x)
        return p + (_LONG_STEP if chart.way is Way.OVER_SADDLE and p < math.log(small) else _STEP)

    def _towards_saddle(self, chart: Chart, begin: Closed) -> Iterator[Closed]:
        size = self._size(chart)
        p, guess = -math.log(-chart.field.u_of(outermost(begin, chart))), begin.lam
        end = -math.log(NEAREST * size)
        while p <= end + 1e-9:
            node = closed(chart, p, guess)
            if node is None:
                return
            yield node
            guess = node.lam
            step = _LONG_STEP if p > -math.log(_TAIL * size) else _STEP
            p = end if p < end < p + step else p + step


def outermost(node: Closed, chart: Chart) -> float:
    """Return where an orbit turns on the side of a chart's saddle."""
    return node.x_min if chart.field.mirrored else node.x_max
