"""The search for saddle connections along any parameter, each kind of orbit between the places where it can jump.

The splitting of a route is continuous but where one of its two branches runs into another saddle on the way: at a
connection with fewer turns. So routes are taken by rising number of turns, and each is searched between the connections
found before. What changes sign there is a connection, and nothing slides from one kind to another.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise
from typing import Final, final

from scipy.optimize import brentq

from finback.dynamics.orbit.splitting import FARTHEST, Field, Route
from finback.errors import RefusedError

_RELATIVE: Final = 4.0 * math.ulp(1.0)
_ITERATIONS: Final = 10_000  # far beyond what bisection of all doubles needs
_DOUBLINGS: Final = 40
_WIDENINGS: Final = 4  # of the bracket around a guess
_WIDER: Final = 20.0
_JUMP: Final = 1e-3  # units of the flow: a splitting that changes by more between neighboring numbers has jumped
_MET: Final = 1e-9  # the same: of a connection that is so steep that it seems to jump, where its branches are nearest
_NARROW: Final = 1e-9  # units of the parameter: a bracket that rounding keeps wider than this resolves nothing
_TOGETHER: Final = 1e-13  # the same: two connections nearer to each other are one place
_APART: Final = 1e-12  # the same: nearer to another connection their order is not known


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """A place on the parameter where a route is an orbit.

    Attributes:
        route: the route.
        parameter: where.
        bracket: two places around it where the splitting has opposite signs.
        residual: the splitting there, as evaluated; infinite if it lies between the connection it is hidden by and the
            next number.
        resolved: whether the bracket is narrow, and no other connection of either branch so near that rounding decides
            which comes first.
    """

    route: Route
    parameter: float
    bracket: tuple[float, float]
    residual: float
    resolved: bool


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Where to look.

    Attributes:
        field: the flow at a value of the parameter.
        samples: values of the parameter, rising, at which every splitting is evaluated; with one only, every splitting
            rises with the parameter from minus to plus infinity.
        unit: a change of the parameter that matters.
        wanted: whether a route is to be evaluated at a value of the parameter.
        guesses: about where a route is a connection, and how well that is known; where it is not there, it is searched
            for as without a guess.
    """

    field: Callable[[float], Field]
    samples: tuple[float, ...]
    unit: float
    wanted: Callable[[Route, float], bool]
    guesses: Mapping[Route, tuple[float, float]]

    def joints(self, routes: Iterable[Route]) -> tuple[Joint, ...]:
        """Find the connections of all routes, given by rising number of turns, without a turn by rising distance.

        Raises:
            RefusedError: a branch could not be followed.
        """
        found: list[Joint] = []
        search = self._endless if len(self.samples) == 1 else self._sampled
        for route in routes:
            found += search(route, sorted((joint for joint in found if _cuts(joint.route, route)), key=_place))
        return tuple(sorted(found, key=_place))

    def within(self, route: Route, low: float, high: float, *, others: Sequence[float] = ()) -> tuple[Joint, ...]:
        """Find the connection of a route between two places where its splitting has opposite signs.

        Args:
            route: the route.
            low: one place.
            high: the other, higher.
            others: connections of fewer turns of either branch.

        Returns:
            one connection; none if the sign changes by a jump.
        """
        tiny = max(1e-16 * self.unit, sys.float_info.min)
        gap = cache(partial(self._gap, route))
        low, high = _unsaturated(gap, low, high, tiny)
        root = float(brentq(gap, low, high, xtol=tiny, rtol=_RELATIVE, maxiter=_ITERATIONS))
        distance = min((abs(other - root) for other in others), default=math.inf) / self.unit
        step = 2.0 * max(tiny, math.ulp(root))
        for _ in range(_DOUBLINGS):
            ends = max(low, root - step), min(high, root + step)
            values = [gap(end) for end in ends]
            if values[0] * values[1] < 0.0:
                break
            step *= 4.0
        if abs(values[1] - values[0]) > _JUMP and not (distance > _APART and self._meets(route, root)):
            return ()
        resolved = ends[1] - ends[0] < _NARROW * self.unit and distance > _APART
        return (Joint(route=route, parameter=root, bracket=ends, residual=gap(root), resolved=resolved),)

    def _meets(self, route: Route, place: float) -> bool:
        """Tell whether both branches meet on the last arc, however far apart it throws them at its turn (a canard)."""
        return bool(route.turns) and abs(self.field(place).least_miss(route)) <= _MET

    def _sampled(self, route: Route, cuts: Sequence[Joint]) -> Iterator[Joint]:
        others = [cut.parameter for cut in cuts]
        apart = _APART * self.unit  # nearer to a cut rounding decides on which side of it a branch passes
        lows = [self.samples[0], *(cut.bracket[1] + apart for cut in cuts)]
        highs = [*(cut.bracket[0] - apart for cut in cuts), self.samples[-1]]
        for low, high in zip(lows, highs, strict=True):
            places = [low, *(place for place in self.samples if low < place < high), high]
            places = [place for place in places if self.wanted(route, place)]
            values = [self._gap(route, place) for place in places]
            for (left, before), (right, after) in pairwise(zip(places, values, strict=True)):
                if left < right and before * after < 0.0:
                    yield from self.within(route, left, right, others=others)

    def _endless(self, route: Route, cuts: Sequence[Joint]) -> Iterator[Joint]:
        """Search between cuts, at which the limits of the splitting say whether there is a connection.

        One that lies nearer to a cut than rounding is placed there, and is not resolved.
        """
        others = [cut.parameter for cut in cuts]
        for before, after in pairwise([None, *cuts, None]):
            if before and not self._beside(route, before, others, above=True) < 0.0:
                continue
            if after and not self._beside(route, after, others, above=False) > 0.0:
                continue
            guessed = self._guessed(route, before, after)
            if guessed:
                yield from self.within(route, *guessed, others=others)
                continue
            low = self._next(route, before, 1.0) if before else math.nan
            high = self._next(route, after, -1.0) if after else math.nan
            if not before:
                low = self._far(route, after.bracket[0] if after else self.samples[0], -1.0)
            if not after:
                high = self._far(route, before.bracket[1] if before else self.samples[0], 1.0)
            if low < high:
                yield from self.within(route, low, high, others=others)
            unseen = before if math.isnan(low) else after if math.isnan(high) else None
            if unseen:
                yield Joint(
                    route=route,
                    parameter=unseen.parameter,
                    bracket=unseen.bracket,
                    residual=math.inf,
                    resolved=False,
                )

    def _guessed(self, route: Route, before: Joint | None, after: Joint | None) -> tuple[float, float] | None:
        """Return two places around a guess between two cuts where the splitting has opposite signs; None if unknown."""
        guess, step = self.guesses.get(route, (math.nan, math.nan))
        apart = _APART * self.unit
        lowest = before.bracket[1] + apart if before else -math.inf
        highest = after.bracket[0] - apart if after else math.inf
        if not lowest < guess < highest:
            return None
        gap = self._gap(route, guess)
        way = -math.copysign(1.0, gap)
        here = guess
        for _ in range(_WIDENINGS):
            there = here + way * step
            if not (gap and lowest < there < highest):
                return None
            if self._gap(route, there) * gap < 0.0:
                return (here, there) if way > 0.0 else (there, here)
            here, step = there, _WIDER * step
        return None

    def _next(self, route: Route, cut: Joint, way: float) -> float:
        """Return a place next to a cut where the splitting has the sign of its limit; nan if rounding hides it."""
        place, step = cut.bracket[1 if way > 0.0 else 0], cut.bracket[1] - cut.bracket[0]
        while abs(place - cut.parameter) < _APART * self.unit:
            if self._gap(route, place) * way < 0.0:
                return place
            place, step = place + way * step, 4.0 * step
        return math.nan

    def _beside(self, route: Route, cut: Joint, others: Sequence[float], *, above: bool) -> float:
        """Return the splitting beside a cut: its limit, or where two cuts are one within rounding, what it is there."""
        if sum(abs(other - cut.parameter) < _TOGETHER * self.unit for other in others) > 1:
            return self._gap(route, cut.bracket[1 if above else 0])
        return self.field(cut.parameter).limit(route, cut.route, above=above)

    def _far(self, route: Route, start: float, way: float) -> float:
        """Step away, doubling, until the splitting has the sign that it has at that end of the parameter."""
        place, step = start, self.unit
        for _ in range(_DOUBLINGS):
            if self._gap(route, place) * way > 0.0:
                return place
            place, step = place + way * step, 2.0 * step
        raise RefusedError("a splitting does not change its sign within any reasonable value of the parameter")

    def _gap(self, route: Route, place: float) -> float:
        return self.field(place).gap(route)


def _unsaturated(gap: Callable[[float], float], low: float, high: float, tiny: float) -> tuple[float, float]:
    """Halve a bracket as long as a splitting has no value at one of its ends: a secant through that leads nowhere."""
    while max(abs(gap(low)), abs(gap(high))) >= FARTHEST and high - low > tiny:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        low, high = (middle, high) if gap(middle) * gap(high) < 0.0 else (low, middle)
    return low, high


def _place(joint: Joint) -> float:
    return joint.parameter


def _cuts(fewer: Route, route: Route) -> bool:
    """Tell whether one connection is where the splitting of another can jump.

    The unstable branch jumps where it runs into a saddle on the way, the stable one, followed back to its first turn,
    where it comes straight from a saddle.
    """
    if route.turns:
        leaves = (fewer.source, fewer.side) == (route.source, route.side) and fewer.turns < route.turns
        enters = (fewer.target, fewer.arrival) == (route.target, route.arrival) and not fewer.turns
        return leaves or enters
    inside = range(min(route.source, route.target), max(route.source, route.target) + 1)
    shorter = not fewer.turns and fewer.source in inside and fewer.target in inside
    return shorter and fewer.side == route.side and (fewer.source == route.source or fewer.target == route.target)
