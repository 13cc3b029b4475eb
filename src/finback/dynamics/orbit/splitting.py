"""How far two manifolds of saddles miss each other, for orbits that turn any number of times."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest, horner
from finback.dynamics.orbit.manifold import Branch, graph, manifold
from finback.dynamics.orbit.taylor import ENDINGS, LONGEST, Ending, follow
from finback.dynamics.orbit.taylor_kernel import ORDER, travel
from finback.errors import RefusedError

FARTHEST: Final = 1e3  # units of the flow: the value of a splitting where one of the two goes to rest or away
_MOST_PIECES: Final = 20_000  # 10 to 60 but where a strong damping makes an orbit creep
_ROUNDING: Final = 1e-12  # units of the flow: turning points of different orbits nearer than this are the same
_AT_SADDLE: Final = 1e-7  # the same beside a saddle, where an orbit turns at the root of its distance
_SHARES: Final = tuple(k / 16.0 for k in range(1, 16))
_NO_RECORD: Final = np.empty((0, 4, ORDER + 1))


@final
@dataclass(frozen=True, slots=True)
class Route:
    """Which branch is to run into which: an orbit from a saddle to a saddle that crosses y = 0 so many times.

    Attributes:
        source: the saddle it leaves, by its place among the equilibria.
        side: to which side, -1 or 1.
        turns: how often y is 0 between the two.
        target: the saddle it enters.
    """

    source: int
    side: int
    turns: int
    target: int

    @property
    def arrival(self) -> int:
        """From which side it enters: y > 0 leaves to the right, and enters from the left."""
        return self.side if self.turns % 2 else -self.side


@final
@dataclass(frozen=True, slots=True)
class Splitting:
    """An unstable branch against a stable one.

    Attributes:
        value: its sign tells which passes outside the other (positive: the unstable one). Without a turn it is the
            difference of |y| halfway between the saddles, else that of x where the unstable branch turns last.
        outgoing: the unstable branch.
        incoming: the stable branch.
    """

    value: float
    outgoing: Branch
    incoming: Branch


def routes(points: tuple[Rest, ...], most_turns: int) -> Iterator[Route]:
    """Yield every route that can be: without a turn first, near saddles first, then by the number of turns.

    Outside the outermost saddle nothing comes back. One equilibrium between two saddles: an orbit that has turned
    twice is enclosed by its own first arc. One saddle: an orbit that has passed it from both sides is too.
    """
    saddles = [index for index, point in enumerate(points) if point.kind is Kind.SADDLE]
    inner = {(index, side) for index in saddles for side in (-1, 1) if 0 <= index + side < len(points)}
    pairs = [(a, b) for a in saddles for b in saddles if a != b]
    for source, target in sorted(pairs, key=lambda pair: abs(pair[0] - pair[1])):
        yield Route(source, 1 if target > source else -1, 0, target)
    others = len(points) - len(saddles)
    most = min(most_turns, 1 if others < 2 else 2 if len(saddles) < 2 else most_turns)
    for turns in range(1, most + 1):
        for source, side in sorted(inner):
            for target in saddles:
                route = Route(source, side, turns, target)
                if (target, route.arrival) in inner and (others > 1 or target == source):
                    yield route


@final
@dataclass(frozen=True, slots=True)
class Field:
    """A flow with its equilibria, and its coefficients in arrays, as machine code takes them."""

    flow: Flow
    points: tuple[Rest, ...]
    damping: FloatArray
    force: FloatArray

    @classmethod
    def of(cls, flow: Flow, points: tuple[Rest, ...]) -> Field:
        """Make it."""
        return cls(flow, points, np.array(flow.damping), np.array(flow.force))

    def gap(self, route: Route) -> float:
        """Return the value of the splitting, or ±``FARTHEST`` where there is none to compare.

        It is that where the unstable branch goes away, or the stable one to rest, before the place of comparison
        (positive), or the other way about (negative).

        Raises:
            RefusedError: a branch comes nowhere within the steps allowed.
        """
        if not route.turns:
            return self._height_gap(route)
        arrival = route.arrival
        out = self._out(route)
        back = self._reach(route.target, arrival, arrival, stable=True, turns=1)
        return _apart(out, back)

    def limit(self, route: Route, cut: Route, *, above: bool) -> float:
        """Return the value of a splitting just beside the place where a connection of fewer turns makes it jump.

        Beside a connection a branch turns just before the saddle and goes on along the one side of it, or passes the
        saddle and goes on along the other. Above, in λ, an unstable branch passes, and a stable one turns. The value is
        0 where rounding decides its sign: the sign tells which of two connections comes first.

        Args:
            route: the route.
            cut: the connection; this field is where it exists.
            above: whether the side of larger λ is meant.
        """
        arrival = route.arrival
        leaves = (cut.source, cut.side) == (route.source, route.side)
        enters = (cut.target, cut.arrival) == (route.target, arrival) and not cut.turns
        if not route.turns:
            if leaves:
                return self.gap(Route(cut.target, route.side, 0, route.target)) if above else -FARTHEST
            return self.gap(Route(route.source, route.side, 0, cut.source))
        out = self._reach_beside(route, cut, above=above) if leaves else self._out(route)
        turns_there = out == arrival * self.points[cut.target].x or (enters and above)
        if not enters:
            back = self._reach(route.target, arrival, arrival, stable=True, turns=1)
        elif above:
            back = arrival * self.points[cut.source].x
        else:
            back = self._reach(cut.source, arrival, arrival, stable=True, turns=1)
        value = _apart(out, back)
        return value if abs(value) > (_AT_SADDLE if turns_there else _ROUNDING) else 0.0

    def splitting(self, route: Route) -> Splitting:
        """Return both branches of a route, as they run, and the value."""
        section = math.nan if route.turns else self._halfway(route)
        out = self._branch(route.source, route.side, section, stable=False, turns=max(1, route.turns))
        back = self._branch(route.target, route.arrival, section, stable=True, turns=1)
        return Splitting(self.gap(route), out, back)

    def _out(self, route: Route) -> float:
        return self._reach(route.source, route.side, route.arrival, stable=False, turns=route.turns)

    def _reach_beside(self, route: Route, cut: Route, *, above: bool) -> float:
        """Return where the unstable branch of a route turns, beside a connection that it has on the way."""
        side = -cut.arrival if above else cut.arrival
        left = route.turns - cut.turns - (0 if above else 1)
        if left and (cut.target, side) == (route.source, route.side):  # round and round beside a loop
            left = (left - 1) % (cut.turns + (0 if above else 1)) + 1
            left = 0 if left > cut.turns else left
        if not left:
            return route.arrival * self.points[cut.target].x
        return self._reach(cut.target, side, route.arrival, stable=False, turns=left)

    def turning_points(self, route: Route) -> tuple[float, ...]:
        """Return where the unstable branch of a route crosses y = 0, as the route does; nan if it rests before."""
        if not route.turns:
            return ()
        landings = np.full(route.turns, np.nan)
        self._travel(route.source, route.side, math.nan, landings, stable=False)
        return tuple(landings.tolist())

    def least_miss(self, route: Route) -> float:
        """Return by how much the two branches miss each other in y where that is the least share of y on the last arc.

        Where the arc first draws orbits together and then spreads them (a canard), a miss of rounding there is a large
        one at the turn; nan where they could be compared nowhere.
        """
        found = self._least_on_arc(route, last=True)
        if route.turns == 1:  # the same with time reversed: the first arc may be the one that throws orbits apart
            found = min(found, self._least_on_arc(route, last=False))
        return found[1]

    def _least_on_arc(self, route: Route, *, last: bool) -> tuple[float, float]:
        """Return the least share of y by which the branches miss each other on the last or first arc; and the miss."""
        own, other = (route.source, route.side), (route.target, route.arrival)
        own, other = (own, other) if last else (other, own)
        found = (math.inf, math.nan)
        ending, turn, _ = self._travel(*own, math.nan, np.empty(route.turns), stable=not last)
        if ending is not Ending.AXIS:
            return found
        saddle = self.points[other[0]].x
        for share in _SHARES:
            section = turn + share * (saddle - turn)
            state = np.array([turn, 0.0, 1.0 if last else -1.0, 0.0, 0.0, 0.0, 0.0])
            limits = np.array([section, LONGEST, _MOST_PIECES, 0.0])
            one = travel(self.damping, self.force, state, limits, np.empty(1), _NO_RECORD)
            end, _, y = self._travel(*other, section, np.empty(1), stable=last)
            if ENDINGS[one] is end is Ending.SECTION:
                miss = state.item(1) - y
                found = min(found, (abs(miss / y), miss))
        return found

    def _reach(self, index: int, side: int, outward: int, *, stable: bool, turns: int) -> float:
        """Return where a branch turns for the given time, counted outward; infinite away, minus infinite at rest."""
        if not 0 <= index + side < len(self.points):
            return math.inf
        ending, x, _ = self._travel(index, side, math.nan, np.empty(turns), stable=stable)
        if ending is Ending.AXIS:
            return outward * x
        return math.inf if ending is Ending.AWAY else -math.inf

    def _height_gap(self, route: Route) -> float:
        """Compare |y| halfway; a branch that turns short of it counts minus the distance, whatever the other does."""
        section = self._halfway(route)
        ending, x, y = self._travel(route.source, route.side, section, np.empty(1), stable=False)
        if ending is not Ending.SECTION:
            return -abs(section - x) if ending is not Ending.AWAY else FARTHEST
        ending, back_x, back_y = self._travel(route.target, route.arrival, section, np.empty(1), stable=True)
        if ending is Ending.SECTION:
            return abs(y) - abs(back_y)
        if ending is Ending.AWAY:
            return -FARTHEST
        # The stable branch turned short of the section; the other passes it there, or turns before.
        ending, _, _ = self._travel(route.source, route.side, back_x, np.empty(1), stable=False)
        return abs(section - back_x) * (1.0 if ending is Ending.SECTION else -1.0)

    def _halfway(self, route: Route) -> float:
        return 0.5 * (self.points[route.source].x + self.points[route.target].x)

    def _room(self, index: int, side: int) -> float:
        """Return how far a series is used at most: half the way to the next equilibrium."""
        return 0.5 * abs(self.points[index + side].x - self.points[index].x)

    def _travel(
        self, index: int, side: int, section: float, landings: FloatArray, *, stable: bool
    ) -> tuple[Ending, float, float]:
        """Follow a branch to a section, or through as many zeros of y as ``landings`` has places."""
        saddle = self.points[index]
        series, radius = graph(self.damping, self.force, saddle, stable=stable)
        reach = side * min(radius, self._room(index, side))
        start = saddle.x + reach, horner(series, reach)
        state = np.array([*start, -1.0 if stable else 1.0, 0.0, 0.0, 0.0, 0.0])
        limits = np.array([section, LONGEST, _MOST_PIECES, 0.0, *[point.x for point in self.points]])
        ending = ENDINGS[travel(self.damping, self.force, state, limits, landings, _NO_RECORD)]
        if ending is Ending.NOWHERE:
            raise RefusedError("a manifold of a saddle could not be followed: it needs too many steps")
        return ending, float(state[0]), float(state[1])

    def _branch(self, index: int, side: int, section: float, *, stable: bool, turns: int) -> Branch:
        whole = manifold(self.flow, self.points[index], stable=stable)
        reach = side * min(whole.radius, self._room(index, side))
        start = (whole.saddle + reach, horner(whole.series, reach))
        path = follow(self.flow, start, forward=not stable, section=section, turns=turns)
        return Branch(whole, reach, path)


def _apart(out: float, back: float) -> float:
    if math.isinf(out) and out == back:
        return FARTHEST
    return max(-FARTHEST, min(FARTHEST, out - back))
