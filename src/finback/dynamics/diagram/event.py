"""Special points of a strip: where its curves cross, where a loop is neutral, and what lies at the ends of curves."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

from scipy.optimize import brentq

from finback.dynamics.cycle.bautin import Bautin
from finback.dynamics.diagram.cell import Line
from finback.dynamics.diagram.curve import CurveKind, PointKind
from finback.dynamics.diagram.knot import Knot
from finback.dynamics.diagram.loop import Strand, closes, sign_changes, stability
from finback.dynamics.diagram.strip import Strip

_NEARBY: Final = (0.3, 0.1, 0.02, 3e-3, 3e-4)  # of a gap between nodes: where a curve is followed to its end
_SLACK: Final = 1e-5  # of the strip: so near to its end rounding may hide an orbit
_HALVINGS: Final = 14  # of a gap between nodes: how well the end of a curve that is lost is found
_DOUBLINGS: Final = 60
_FARTHER: Final = 100.0  # times the distance from a line: over such a way λ tells by how much it comes nearer
_NEARER: Final = 0.3  # over that way λ comes nearer by 10 at least, and its limit is far nearer than its last value
_DOUBTED: Final = 0.1  # of its distance from a Bogdanov-Takens point: a limit known to no more may be that point
_ROUNDING: Final = 1e-9  # of the rate: what is nearer is there


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A special point before it has a name; see ``DiagramPoint``.

    Attributes:
        labels: the curves that meet there, by their labels.
        enclosed: the equilibria inside the cycles that a fold ending there consists of; empty if none can.
        outside: whether those lie outside the loop.
    """

    kind: PointKind
    mu: float
    lam: float
    x: float
    bracket: tuple[float, float]
    residual: float
    resolved: bool
    exact: bool
    labels: tuple[str, ...]
    enclosed: tuple[int, ...] = ()
    outside: bool = False


def crossings(strip: Strip, strands: Sequence[Strand], *, corners: bool) -> Iterator[Event]:
    """Yield where two curves cross.

    Args:
        strip: the strip.
        strands: the curves.
        corners: whether those pairs are meant which make a saddle cycle where they cross, or all others.
    """
    for index, one in enumerate(strands):
        for other in strands[index + 1 :]:
            if set(one.routes) & set(other.routes):
                continue  # a saddle cycle and what it is made of
            if corners != (_corner(one, other)[0] is not PointKind.CROSSING):
                continue
            for low, high in sign_changes(strip, one, other):
                event = _crossing(one, other, low, high)
                if event is not None:
                    yield event


def _crossing(one: Strand, other: Strand, low: float, high: float) -> Event | None:
    def gap(mu: float) -> float:
        pair = one.at(mu), other.at(mu)
        return math.nan if pair[0] is None or pair[1] is None else pair[0].lam - pair[1].lam

    found = _root(gap, low, high)
    knots = (one.at(found[0]), other.at(found[0])) if found else (None, None)
    if found is None or knots[0] is None or knots[1] is None:
        return None
    kind, enclosed = _corner(one, other)
    return Event(
        kind=kind,
        mu=found[0],
        lam=0.5 * (knots[0].lam + knots[1].lam),
        x=knots[0].x,
        bracket=found[1],
        residual=found[2],
        resolved=True,
        exact=True,
        labels=(one.label, other.label),
        enclosed=enclosed,
        outside=kind is PointKind.DOUBLE_HOMOCLINIC,
    )


def _corner(one: Strand, other: Strand) -> tuple[PointKind, tuple[int, ...]]:
    if not (one.routes and other.routes and closes(one.routes[0], other.routes[0])):
        return PointKind.CROSSING, ()
    route = one.routes[0]
    if one.kind is CurveKind.HOMOCLINIC:
        return PointKind.DOUBLE_HOMOCLINIC, tuple(sorted({*one.enclosed, route.source, *other.enclosed}))
    low, high = sorted((route.source, route.target))
    return PointKind.TWO_SADDLE_CYCLE, tuple(range(low + 1, high))


def neutral_loops(strip: Strip, strands: Sequence[Strand]) -> Iterator[Event]:
    """Yield where a homoclinic loop has a saddle with zero trace, or a saddle cycle is neutral."""
    for strand in strands:
        if strand.kind not in (CurveKind.HOMOCLINIC, CurveKind.SADDLE_CYCLE):
            continue

        def lean(mu: float, strand: Strand = strand) -> float:
            loop = strip.loops(mu).get(strand.routes[0])
            if loop is None:
                return math.nan
            return loop.saddle_trace if strand.kind is CurveKind.HOMOCLINIC else -stability(strip, loop)

        signs = [(knot.mu, lean(knot.mu)) for knot in strand.knots]
        clear = [pair for pair in signs if pair[1] != 0.0 and not math.isnan(pair[1])]
        for (low, before), (high, after) in pairwise(clear):
            found = _root(lean, low, high) if before * after < 0.0 else None
            knot = strand.at(found[0]) if found else None
            if found and knot is not None:
                yield Event(
                    kind=PointKind.NEUTRAL_LOOP,
                    mu=found[0],
                    lam=knot.lam,
                    x=knot.x,
                    bracket=found[1],
                    residual=found[2],
                    resolved=knot.resolved,
                    exact=True,
                    labels=(strand.label,),
                    enclosed=strand.enclosed,
                    outside=(len(strand.routes) > 1 and strand.routes[0].source == strand.routes[0].target)
                    or strand.routes[0].turns > 1,
                )


def bautin_events(strip: Strip, points: Sequence[Bautin]) -> Iterator[Event]:
    """Yield the Bautin points of a strip."""
    low, high = strip.cell.mu.tolist()
    for point in points:
        places = strip.equilibria(point.mu) if low < point.mu < high else ()
        if places:
            index = min(range(len(places)), key=lambda k: abs(places[k] - point.x))
            yield Event(
                kind=PointKind.BAUTIN,
                mu=point.mu,
                lam=point.lam + 0.0,
                x=point.x,
                bracket=(point.bracket.item(0), point.bracket.item(1)),
                residual=point.residual,
                resolved=True,
                exact=True,
                labels=(f"hopf {index}",),
            )


def _root(gap: Callable[[float], float], low: float, high: float) -> tuple[float, tuple[float, float], float] | None:
    """Return where a function changes its sign, two places around with both signs, and its value; None if unknown."""
    try:
        tiny = 1e-15 * (high - low) + 4.0 * math.ulp(max(abs(low), abs(high)))
        found = float(brentq(gap, low, high, xtol=tiny, rtol=4.0 * math.ulp(1.0)))
    except ValueError:  # a value is not a number: the curves do not go through
        return None
    value = gap(found)
    step = 4.0 * tiny
    for _ in range(_DOUBLINGS):
        ends = max(low, found - step), min(high, found + step)
        values = gap(ends[0]), gap(ends[1])
        if values[0] * values[1] < 0.0:
            return found, ends, value
        step *= 4.0
        if step > high - low:
            break
    return found, (low, high), value


def ended(strip: Strip, strand: Strand, events: Sequence[Event], marks: Sequence[Line]) -> tuple[Strand, list[Event]]:
    """Return a curve with both ends found and named, and points that were found on the way.

    Names of events are not known yet: their place stands for them.

    Args:
        strip: the strip.
        strand: a Hopf curve or one of loops.
        events: the special points known so far.
        marks: the lines at the edges of the strip.
    """
    fresh: list[Event] = []
    for side in (0, 1):
        edge, inner = strip.cell.mu.item(side), strand.end_knot(side)
        if inner.mu == edge:
            strand = strand.with_end(side, "range")
        elif _runs_to(strip, strand, side):
            strand, more = ended_at_edge(strip, strand, side, [line for line in marks if line.mu == edge])
            fresh += more
        else:
            strand = _inside(strip, strand, side, events)
    return strand, fresh


def _runs_to(strip: Strip, strand: Strand, side: int) -> bool:
    """Tell whether beyond the last point of a curve nothing is known up to the edge."""
    edge, here = strip.cell.mu.item(side), strand.end_knot(side).mu
    low, high = sorted((edge, here))
    return strand.kind is CurveKind.HOPF or not any(low <= mu <= high and mu != here for mu in strip.known_loops())


def ended_at_edge(strip: Strip, strand: Strand, side: int, marks: Sequence[Line]) -> tuple[Strand, list[Event]]:
    """Return a curve with its end at an edge of the strip named, and the point there if it is a new one."""
    knots = strand.knots if side == 0 else strand.knots[::-1]
    if not marks:
        strip.refusals.setdefault(f"{strand.label}: not followed to the edge", []).append(knots[0].mu)
        return strand.with_end(side, "unresolved"), []
    rate = strip.rate(knots[0].mu)
    for line in marks:
        merging = strip.merging(line, side)
        own = strand.enclosed[0] if strand.kind is CurveKind.HOPF else -1
        if own in merging or (own < 0 and _tends_to(knots, line, rate)):
            end = Knot(mu=line.mu, lam=line.lam, x=line.x, residual=math.nan, resolved=True, change=knots[0].change)
            return strand.with_end(side, _bt_name(line), end), []
    if strand.kind is CurveKind.HOPF:
        return strand.with_end(side, line_key(marks[0]), strip.hopf_on_line(marks[0].mu, knots[0].x)), []
    touched = {index for line in marks for index in strip.merging(line, side)}
    saddles = {index for route in strand.routes for index in (route.source, route.target)}
    if strand.kind is CurveKind.HOMOCLINIC and touched & saddles and len(knots) > 2:
        value, doubt = _limit(knots, marks[0].mu)
        if any(doubt > _DOUBTED * abs(value - line.lam) for line in marks):
            strip.refusals.setdefault(f"{strand.label}: its limit at the line is not known", []).append(knots[0].mu)
            return strand.with_end(side, "unresolved"), []
        end = Knot(mu=marks[0].mu, lam=value, x=knots[0].x, residual=math.nan, resolved=False, change=knots[0].change)
        event = Event(
            kind=PointKind.SADDLE_NODE_LOOP,
            mu=end.mu,
            lam=value,
            x=end.x,
            bracket=(end.mu, end.mu),
            residual=doubt,
            resolved=False,
            exact=False,
            labels=(strand.label,),
        )
        return strand.with_end(side, event_key(event), end), [event]
    return strand.with_end(side, line_key(marks[0])), []


def _tends_to(knots: Sequence[Knot], line: Line, rate: float) -> bool:
    """Tell whether a curve of loops runs into a Bogdanov-Takens point: λ comes much nearer, and so does its limit."""
    if len(knots) < 3 or math.isnan(line.lam):
        return False
    near = abs(knots[0].lam - line.lam)
    if near <= _ROUNDING * rate:
        return True
    first = abs(knots[0].mu - line.mu)
    before = next((knot for knot in knots if abs(knot.mu - line.mu) >= _FARTHER * first), knots[-1])
    value, _ = _limit(knots, line.mu)
    return near <= _NEARER * abs(before.lam - line.lam) and abs(value - line.lam) <= _NEARER * near + _ROUNDING * rate


def _limit(knots: Sequence[Knot], mu: float) -> tuple[float, float]:
    """Return λ at μ from the last three points, in powers of the root of the distance, and what the third changes."""
    roots = [math.sqrt(abs(knot.mu - mu)) for knot in knots[:3]]
    values = [knot.lam for knot in knots[:3]]
    one = (values[0] * roots[1] - values[1] * roots[0]) / (roots[1] - roots[0])
    two = (values[1] * roots[2] - values[2] * roots[1]) / (roots[2] - roots[1])
    value = (one * roots[2] - two * roots[0]) / (roots[2] - roots[0])
    return value, abs(value - one)


def _inside(strip: Strip, strand: Strand, side: int, events: Sequence[Event]) -> Strand:
    """Follow a curve to its end inside the strip: at a point where two others cross, or where it is lost."""
    last = strand.end_knot(side)
    here, beyond = last.mu, last.mu
    outward = sorted(strip.known_loops(), key=lambda mu: abs(mu - last.mu))
    for beyond in (mu for mu in outward if (mu < last.mu) == (side == 0) and mu != last.mu):
        if strand.at(beyond) is None:
            break
        here = beyond
    low, high = sorted((here, beyond))
    slack = _SLACK * (strip.cell.mu.item(1) - strip.cell.mu.item(0))
    corners = (PointKind.TWO_SADDLE_CYCLE, PointKind.DOUBLE_HOMOCLINIC)
    found = [event for event in events if event.kind in corners and low - slack <= event.mu <= high + slack]
    if not found:
        return _lost(strip, strand, side, (here, beyond))
    event = min(found, key=lambda event: abs(event.lam - last.lam))
    strand = strand.with_knots(strand.at(event.mu + share * (last.mu - event.mu)) for share in _NEARBY)
    end = Knot(mu=event.mu, lam=event.lam, x=event.x, residual=math.nan, resolved=False, change=last.change)
    return strand.with_end(side, event_key(event), end)


def _lost(strip: Strip, strand: Strand, side: int, between: tuple[float, float]) -> Strand:
    there, gone = between
    for _ in range(_HALVINGS):
        middle = 0.5 * (there + gone)
        if strand.at(middle) is None:
            gone = middle
        else:
            there = middle
    strand = strand.with_knots([strand.at(there)])
    strip.refusals.setdefault(f"{strand.label}: ends where no other curve was found", []).append(gone)
    return strand.with_end(side, "unresolved")


def event_key(event: Event) -> str:
    """Return what stands for an event before it has a name."""
    return f"{event.kind}@{event.mu!r},{event.lam!r}"


def line_key(line: Line) -> str:
    """Return the same for a line."""
    return f"{line.kind}@{line.mu!r},{line.x!r}"


def _bt_name(line: Line) -> str:
    return f"{PointKind.BOGDANOV_TAKENS}@{line.mu!r},{line.lam!r}"
