"""Folds of cycles through one strip of a diagram: which of one μ are those of the next, and where they begin and end.

At some μ all folds are found (``cycle_folds``), and told apart by the equilibria inside and their order outward. That
order cannot change, so that two neighboring μ with as many folds are joined in order; where the number changes, the
point that explains it is looked for: a Bautin point takes the innermost one, a neutral or a double loop the one next
to it, a cusp takes two neighbors. Between, the folds are tracked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, final

from finback.dynamics.cycle.fold import CycleFold
from finback.dynamics.diagram.curve import CurveKind, PointKind
from finback.dynamics.diagram.event import Event, event_key
from finback.dynamics.diagram.knot import Knot, Window, bends
from finback.dynamics.diagram.loop import Strand
from finback.dynamics.diagram.strip import Strip, fold_knot
from finback.dynamics.diagram.track import between

_SHARES: Final = (0.006, 0.12, 0.37, 0.63, 0.88, 0.994)
"""Of the interval between two special points: where all folds are looked for."""
_NEARBY: Final = (0.3, 0.1, 0.03, 5e-3, 5e-4)
"""Of the gap between its last point and a special point at which it ends: where a curve is followed to it."""
_ROUNDS: Final = 4
_NEAR: Final = 0.02  # of the strip: so near to a special point folds may be lost before they reach it
_NARROW: Final = 1e-9  # of the strip: how narrow a cusp is bracketed

Key = tuple[int, ...]


@final
@dataclass(slots=True)
class _Thread:
    """A fold, while it is followed from one μ to the next.

    Attributes:
        key: the equilibria inside.
        folds: by rising μ.
        ends: at what it begins and ends; None where that is not known or at an edge of the strip.
        lost: whether it begins or ends for no known reason.
    """

    key: Key
    folds: list[tuple[float, CycleFold]]
    ends: list[Event | None] = field(default_factory=lambda: [None, None])
    lost: list[bool] = field(default_factory=lambda: [False, False])

    def at(self, strip: Strip, mu: float) -> CycleFold | None:
        """Return the fold at a μ between two known ones, tracked or else searched."""
        after = next((k for k, (place, _) in enumerate(self.folds) if place >= mu), 0)
        if self.folds[after][0] == mu:
            return self.folds[after][1]
        if not after:
            return None
        ends = self.folds[after - 1], self.folds[after]
        found = between(strip, self.key, mu, ends)
        if found is not None:
            return found
        share = (mu - ends[0][0]) / (ends[1][0] - ends[0][0])
        expected = ends[0][1].x_max + share * (ends[1][1].x_max - ends[0][1].x_max)
        return self.nearest(strip, mu, expected)

    def nearest(self, strip: Strip, mu: float, x_max: float) -> CycleFold | None:
        """Return that of all folds at a μ which turns nearest to a place."""
        folds = strip.folds(mu, self.key) or ()
        return min(folds, key=lambda fold: abs(fold.x_max - x_max), default=None)

    def add(self, mu: float, fold: CycleFold | None) -> None:
        """Add a point."""
        if fold is not None and all(place != mu for place, _ in self.folds):
            self.folds = sorted([*self.folds, (mu, fold)], key=lambda pair: pair[0])

    def knots(self) -> list[Knot]:
        """Return its points, those at its ends included."""
        inside = [fold_knot(mu, fold) for mu, fold in self.folds]
        for side, event in enumerate(self.ends):
            if event is not None:
                flat = event.kind is not PointKind.BAUTIN
                change = inside[-side].change
                knot = Knot(mu=event.mu, lam=event.lam, x=event.x, residual=math.nan, resolved=not flat, change=change)
                inside.insert(len(inside) * side, knot)
        return inside


def fold_strands(strip: Strip, events: Sequence[Event], window: Window) -> tuple[list[Strand], list[Event]]:
    """Return the curves of folds of cycles, and the cusps found."""
    threads, cusps = [], []
    for key in strip.keys:
        linker = _Linker(strip, key, events)
        threads += linker.threads()
        cusps += linker.cusps
    for thread in threads:
        _follow(strip, thread, window)
    numbers: dict[Key, int] = {}
    strands = []
    for thread in sorted(threads, key=lambda thread: (thread.key, thread.folds[0][0], thread.folds[0][1].x_max)):
        numbers[thread.key] = numbers.get(thread.key, 0) + 1
        strands.append(_strand(strip, thread, numbers[thread.key]))
    return strands, cusps


def _follow(strip: Strip, thread: _Thread, window: Window) -> None:
    """Add points to a curve, towards its ends and where it bends."""
    for side, event in enumerate(thread.ends):
        if event is None:
            continue
        last, fold = thread.folds[-side]
        for share in _NEARBY:
            mu = event.mu + share * (last - event.mu)
            thread.add(mu, thread.nearest(strip, mu, fold.x_max))
    for _ in range(_ROUNDS):
        wanted = bends(thread.knots(), window)
        before = len(thread.folds)
        for mu in wanted:
            thread.add(mu, thread.at(strip, mu))
        if len(thread.folds) == before:
            return


def _strand(strip: Strip, thread: _Thread, number: int) -> Strand:
    around = "-".join(str(index) for index in dict.fromkeys((thread.key[0], thread.key[-1])))

    def at(mu: float) -> Knot | None:
        fold = thread.at(strip, mu)
        return None if fold is None else fold_knot(mu, fold)

    names = [
        "unresolved" if lost else event_key(event) if event else ""
        for lost, event in zip(thread.lost, thread.ends, strict=True)
    ]
    return Strand(
        kind=CurveKind.CYCLE_FOLD,
        label=f"cycle-fold around {around}" + (f" ({number})" if number > 1 else ""),
        routes=(),
        enclosed=thread.key,
        at=at,
        knots=tuple(thread.knots()),
        ends=(names[0], names[1]),
    )


@final
class _Linker:
    """Joins the folds of neighboring μ."""

    def __init__(self, strip: Strip, key: Key, events: Sequence[Event]) -> None:
        self._strip = strip
        self._key = key
        self._events = events
        self._width = float(strip.cell.mu[1] - strip.cell.mu[0])
        self.cusps: list[Event] = []
        edges = strip.cell.mu.tolist()
        stops = sorted({*edges, *(event.mu for event in events if _taken(event, key, [0]) is not None)})
        nodes = {low + share * (high - low) for low, high in pairwise(stops) for share in _SHARES}
        # A special point that rounding puts beside an edge leaves no room between.
        nodes = {mu for mu in nodes if min(mu - edges[0], edges[1] - mu) > _NARROW * self._width}
        nodes |= {edge for edge in edges if strip.equilibria(edge)}
        self._nodes = sorted(mu for mu in nodes if strip.folds(mu, key) is not None)

    def _at(self, mu: float) -> tuple[CycleFold, ...]:
        return self._strip.folds(mu, self._key) or ()

    def threads(self) -> list[_Thread]:
        """Walk along the nodes; where a search met an obstacle, only what its neighbors confirm is believed."""
        clear = [mu for mu in self._nodes if not self._strip.hindered(mu, self._key)]
        if not clear:
            return []
        done: list[_Thread] = []
        before = clear[0]
        alive = [_Thread(self._key, [(before, fold)]) for fold in self._at(before)]
        for thread in alive:
            thread.lost[0] = before != self._nodes[0]
        for mu in self._nodes:
            if mu > before and (mu in clear or len(self._at(mu)) == len(alive)):
                alive = self._step((before, mu), alive, done)
                before = mu
        for thread in alive:
            thread.lost[1] = before != self._nodes[-1]
        return [*done, *alive]

    def _step(self, span: tuple[float, float], alive: list[_Thread], done: list[_Thread]) -> list[_Thread]:
        """Go on to the next node; return the threads there, outward."""
        folds = self._at(span[1])
        dies = len(alive) > len(folds)
        more = [thread.folds[-1][1] for thread in alive] if dies else list(folds)
        ends = self._explained(span, abs(len(alive) - len(folds)), more, dies=dies)
        if dies:
            for index, event in ends.items():
                self._close(alive[index], 1, event)
                done.append(alive[index])
            alive = [thread for index, thread in enumerate(alive) if index not in ends]
            ends = {}
        old = iter(alive)
        following = []
        for index, fold in enumerate(folds):
            if index in ends:
                thread = _Thread(self._key, [(span[1], fold)])
                self._close(thread, 0, ends[index])
            else:
                thread = next(old)
                thread.folds.append((span[1], fold))
            following.append(thread)
        return following

    def _close(self, thread: _Thread, side: int, event: Event | None) -> None:
        thread.ends[side] = event
        thread.lost[side] = event is None

    def _explained(
        self, span: tuple[float, float], count: int, more: list[CycleFold], *, dies: bool
    ) -> dict[int, Event | None]:
        """Return which of the folds end between two nodes, outward from 0, and at what."""
        ends: dict[int, Event | None] = {}
        if not count:
            return ends
        reach = _NEAR * self._width
        near = [event for event in self._events if span[0] - reach <= event.mu <= span[1] + reach]
        for event in sorted(near, key=lambda event: abs(event.mu - 0.5 * sum(span))):
            left = [index for index in range(len(more)) if index not in ends]
            place = _taken(event, self._key, left)
            beyond = event.mu > span[0] if dies else event.mu < span[1]
            if place is not None and beyond and len(ends) < count:
                ends[place] = event
        while count - len(ends) >= 2:
            left = [index for index in range(len(more)) if index not in ends]
            pair = min(pairwise(left), key=lambda pair: abs(more[pair[0]].lam - more[pair[1]].lam))
            ends[pair[0]] = ends[pair[1]] = self._cusp(span if dies else span[::-1], more, pair)
        if count > len(ends):
            ends[max(set(range(len(more))) - ends.keys())] = None
            self._strip.refusals.setdefault("a fold of cycles ends for no reason found", []).append(span[0])
        return ends

    def _cusp(self, span: tuple[float, float], more: list[CycleFold], pair: tuple[int, int]) -> Event | None:
        """Return where two folds meet, by bisection.

        Args:
            span: a μ with both folds, and one without.
            more: the folds at the first.
            pair: which two of them.
        """
        full, empty = span
        last = more[pair[0]], more[pair[1]]
        while abs(full - empty) > _NARROW * self._width:
            middle = 0.5 * (full + empty)
            folds = self._at(middle)
            if len(folds) == len(more):
                full, last = middle, (folds[pair[0]], folds[pair[1]])
            elif len(folds) == len(more) - 2:
                empty = middle
            else:
                self._strip.refusals.setdefault("folds of cycles near a cusp", []).append(middle)
                return None
        event = Event(
            kind=PointKind.CYCLE_CUSP,
            mu=0.5 * (full + empty),
            lam=0.5 * (last[0].lam + last[1].lam),
            x=0.5 * (last[0].x_max + last[1].x_max),
            bracket=(min(full, empty), max(full, empty)),
            residual=last[0].lam - last[1].lam,
            resolved=True,
            exact=True,
            labels=(),
        )
        self.cusps.append(event)
        return event


def _taken(event: Event, key: Key, left: list[int]) -> int | None:
    """Return which fold of a group a special point can end, if any."""
    if not left:
        return None
    if event.kind is PointKind.BAUTIN:
        return left[0] if event.labels == tuple(f"hopf {index}" for index in key) else None
    if event.kind in (PointKind.NEUTRAL_LOOP, PointKind.DOUBLE_HOMOCLINIC, PointKind.TWO_SADDLE_CYCLE):
        return (left[0] if event.outside else left[-1]) if event.enclosed == key else None
    return None
