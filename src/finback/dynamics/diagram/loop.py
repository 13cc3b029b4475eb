"""Hopf curves and curves of loops through one strip of a diagram."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, final

from finback.dynamics.connection.loop import Loop, LoopKind
from finback.dynamics.diagram.curve import CurveKind
from finback.dynamics.diagram.knot import Knot, Window, bends
from finback.dynamics.diagram.strip import Strip, born
from finback.dynamics.equilibrium import eigenvalues
from finback.dynamics.flow import derivative, horner
from finback.dynamics.orbit.splitting import Route

_ROUNDS: Final = 4  # of looking again where a curve bends
_TOGETHER: Final = 1e-11  # of the rate: two connections nearer than this at every μ are one by a symmetry


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Strand:
    """A curve inside one strip, while it is followed.

    Attributes:
        kind: what happens on it.
        label: its name but for the strip.
        routes: of the loop, or of both connections of a saddle cycle; empty otherwise.
        enclosed: as ``DiagramCurve.enclosed``.
        at: the point of it at a μ, None where there is none.
        knots: its points by rising μ.
        ends: what is at its ends; empty words while that is not known.
    """

    kind: CurveKind
    label: str
    routes: tuple[Route, ...]
    enclosed: tuple[int, ...]
    at: Callable[[float], Knot | None]
    knots: tuple[Knot, ...]
    ends: tuple[str, str] = ("", "")

    def with_knots(self, knots: Iterable[Knot | None]) -> Strand:
        """Return it with more points."""
        more = {knot.mu: knot for knot in knots if knot is not None}
        return replace(self, knots=tuple(sorted((more | {k.mu: k for k in self.knots}).values(), key=lambda k: k.mu)))

    def with_end(self, side: int, name: str, knot: Knot | None = None) -> Strand:
        """Return it with an end at the side 0 or 1 named, and its last point there."""
        ends = (name, self.ends[1]) if side == 0 else (self.ends[0], name)
        return replace(self if knot is None else self.with_knots([knot]), ends=ends)

    def end_knot(self, side: int) -> Knot:
        """Return the first or the last point."""
        return self.knots[-side]


def hopf_strands(strip: Strip, nodes: Sequence[float]) -> list[Strand]:
    """Return the Hopf curve of each antisaddle."""
    found = []
    for index in strip.antisaddles:

        def at(mu: float, index: int = index) -> Knot | None:
            return strip.hopf(mu, index)

        knots = tuple(knot for mu in nodes if (knot := at(mu)) is not None)
        if knots:
            found.append(
                Strand(kind=CurveKind.HOPF, label=f"hopf {index}", routes=(), enclosed=(index,), at=at, knots=knots)
            )
    return found


def loop_strands(strip: Strip, nodes: Sequence[float]) -> list[Strand]:
    """Return the curves of all loops, cut where a loop of that kind does not exist at a node."""
    known = [mu for mu in nodes if strip.loops(mu)]
    routes = dict.fromkeys(route for mu in known for route in strip.loops(mu))
    found = []
    for route in routes:
        runs: list[list[float]] = [[]]
        for mu in known:
            if route in strip.loops(mu):
                runs[-1].append(mu)
            elif runs[-1]:
                runs.append([])
        found += [_loop_strand(strip, route, run, number) for number, run in enumerate(runs, start=1) if run]
    return [*found, *_saddle_cycles(strip, found)]


def smoothed(strip: Strip, strands: list[Strand], window: Window) -> list[float]:
    """Look again where curves of loops bend; return all nodes."""
    nodes = {knot.mu for strand in strands for knot in strand.knots}
    for _ in range(_ROUNDS):
        fresh = loop_strands(strip, sorted(nodes))
        more = {mu for strand in fresh if strand.routes for mu in bends(strand.knots, window)} - nodes
        if not more:
            break
        nodes |= more
    return sorted(nodes)


def _loop_strand(strip: Strip, route: Route, run: Sequence[float], number: int) -> Strand:
    loop = strip.loops(run[len(run) // 2])[route]

    def at(mu: float) -> Knot | None:
        return strip.loop_knot(mu, route)

    homoclinic = loop.kind is LoopKind.HOMOCLINIC
    return Strand(
        kind=CurveKind.HOMOCLINIC if homoclinic else CurveKind.HETEROCLINIC,
        label=_label(route) + (f" ({number})" if number > 1 else ""),
        routes=(route,),
        enclosed=strip.enclosed(loop.mu, loop),
        at=at,
        knots=tuple(knot for mu in run if (knot := at(mu)) is not None),
    )


def _label(route: Route) -> str:
    side = "right" if route.side > 0 else "left"
    if route.source != route.target:
        turns = f" by {route.turns} turns" if route.turns else ""
        return f"heteroclinic {route.source} {side} to {route.target}{turns}"
    return f"{'large ' if route.turns > 1 else ''}homoclinic {route.source} {side}"


def _saddle_cycles(strip: Strip, strands: list[Strand]) -> list[Strand]:
    """Return the pairs of connections that exist at one λ along the whole curve."""
    found = []
    for index, one in enumerate(strands):
        for other in strands[index + 1 :]:
            if not closes(one.routes[0], other.routes[0]):
                continue
            shared = sorted({knot.mu for knot in one.knots} & {knot.mu for knot in other.knots})
            if len(shared) > 2 and all(_together(strip, mu, one, other) for mu in shared):
                found.append(_saddle_cycle(strip, one.routes[0], other.routes[0], shared))
    return found


def closes(one: Route, other: Route) -> bool:
    """Tell whether two connections make a closed curve of saddles: a two-saddle cycle or a figure-eight."""
    if one.source == one.target:
        return one.source == other.source == other.target and one.turns == other.turns == 1 and one.side != other.side
    return (one.source, one.target) == (other.target, other.source) and one.turns == other.turns == 0


def _together(strip: Strip, mu: float, one: Strand, other: Strand) -> bool:
    first, second = one.at(mu), other.at(mu)
    return first is not None and second is not None and abs(first.lam - second.lam) <= _TOGETHER * strip.rate(mu)


def _saddle_cycle(strip: Strip, one: Route, other: Route, nodes: Sequence[float]) -> Strand:
    eight = one.source == one.target

    def at(mu: float) -> Knot | None:
        pair = [strip.loops(mu).get(route) for route in (one, other)]
        knot = strip.loop_knot(mu, one)
        if knot is None or pair[0] is None or pair[1] is None:
            return None
        return replace(
            knot,
            lam=0.5 * (pair[0].lam + pair[1].lam),
            residual=pair[0].lam - pair[1].lam,
            change=_change_at_cycle(strip, pair[0], outside=eight),
        )

    places = strip.loops(nodes[0])[one], strip.loops(nodes[0])[other]
    inside = [index for pole in places for index in strip.enclosed(nodes[0], pole)]
    low, high = sorted((one.source, one.target))
    label = f"figure-eight {low}" if eight else f"two-saddle cycle {low}-{high}"
    knots = [at(mu) for mu in nodes]
    return Strand(
        kind=CurveKind.SADDLE_CYCLE,
        label=label,
        routes=(one, other),
        enclosed=tuple(sorted({*inside, low})) if eight else tuple(range(low + 1, high)),
        at=at,
        knots=tuple(knot for knot in knots if knot is not None),
    )


def _change_at_cycle(strip: Strip, loop: Loop, *, outside: bool) -> tuple[int, int]:
    lean = stability(strip, loop)
    return (0, 0) if lean == 0.0 else born(stable=lean > 0.0, outside=outside)


def stability(strip: Strip, loop: Loop) -> float:
    """Return the logarithm of the product of the ratios of eigenvalues at both ends of a connection.

    A saddle cycle of two such connections is stable where it is positive (Cherkas 1968; Reyn 1980).
    """
    slope = derivative(strip.family.at(loop.mu, 0.0).force)
    total = 0.0
    for x, trace in ((loop.from_x, loop.saddle_trace), (loop.to_x, loop.to_trace)):
        expanding, contracting = eigenvalues(trace, -horner(slope, x))[0]
        total += math.log(-contracting / expanding)
    return total


def sign_changes(strip: Strip, one: Strand, other: Strand) -> list[tuple[float, float]]:
    """Return the pairs of neighboring nodes between which two curves cross."""
    mine, theirs = ({knot.mu: knot.lam for knot in strand.knots} for strand in (one, other))
    apart = [(mu, mine[mu] - theirs[mu]) for mu in sorted(mine.keys() & theirs.keys())]
    clear = [(mu, gap) for mu, gap in apart if abs(gap) > _TOGETHER * strip.rate(mu)]
    return [(low, high) for (low, before), (high, after) in pairwise(clear) if before * after < 0.0]
