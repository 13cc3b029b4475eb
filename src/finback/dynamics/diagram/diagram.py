"""The two-parameter diagram of a family: every curve of the plane (μ, λ) in one call.

λ is a rotation parameter, so that on each vertical line each loop and each fold of cycles is found for itself, without
continuation from a neighbor: a curve cannot be left or taken for another one. What lies on neighboring vertical lines
is joined, more lines are drawn where curves bend and end, and the ends themselves are located.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, final

from finback.arrays import frozen_array
from finback.dynamics.cycle.bautin import bautin_points
from finback.dynamics.diagram.cell import Line, cells, lines
from finback.dynamics.diagram.curve import CurveKind, Diagram, DiagramCurve, DiagramOptions, DiagramPoint, PointKind
from finback.dynamics.diagram.event import (
    Event,
    bautin_events,
    crossings,
    ended,
    ended_at_edge,
    event_key,
    line_key,
    neutral_loops,
)
from finback.dynamics.diagram.fold import fold_strands
from finback.dynamics.diagram.knot import Knot, Window, curve_of, spaced
from finback.dynamics.diagram.loop import Strand, hopf_strands, loop_strands, smoothed
from finback.dynamics.diagram.strip import Strip
from finback.dynamics.family import Family
from finback.dynamics.flow import horner
from finback.errors import InputError

_ROUNDING: Final = 1e-12  # of the range of μ
_MARGIN: Final = 0.15  # of the height of an automatic window, above and below
_ROOM: Final = 0.5  # of the spread of all special points: what a natural range of μ has beyond them
_DEFAULT: Final = DiagramOptions()
_FRAMED: Final = (CurveKind.HOPF, CurveKind.HOMOCLINIC, CurveKind.SADDLE_CYCLE, CurveKind.CYCLE_FOLD)


def diagram(
    family: Family,
    mu_range: tuple[float, float],
    *,
    lam_range: tuple[float, float] | None = None,
    options: DiagramOptions = _DEFAULT,
) -> Diagram:
    """Find every curve of the plane (μ, λ) between two values of μ.

    Lines on which equilibria meet, Hopf curves and Bogdanov-Takens and Bautin points are closed forms; loops and folds
    of cycles are found by shooting at each μ; where curves cross and end is bisected. What was not resolved is in the
    notes and flags of the answer.

    Args:
        family: the family.
        mu_range: low and high, finite.
        lam_range: the window of λ; None: around the curves that bound limit cycles.
        options: how densely.

    Raises:
        InputError: a range is empty or not finite.
        RefusedError: μ has no effect; the force vanishes everywhere.
    """
    low, high = mu_range
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"mu from {low} to {high} is no range", hint="give low < high, both finite")
    if lam_range is not None and not (all(map(math.isfinite, lam_range)) and lam_range[0] < lam_range[1]):
        raise InputError(f"lam from {lam_range[0]} to {lam_range[1]} is no range", hint="give low < high, both finite")
    every = lines(family)
    # A line within rounding of an edge is that edge.
    low, high = (
        next((line.mu for line in every if abs(line.mu - edge) <= _ROUNDING * (high - low)), edge)
        for edge in (low, high)
    )
    mu_range = (low, high)
    marks = [line for line in every if low <= line.mu <= high]
    strips = [
        Strip(family=family, cell=cell, index=index, most_turns=options.most_turns)
        for index, cell in enumerate(cells(family, mu_range, marks))
    ]
    drawn = [_Drawn(strip, [], []) for strip in strips]
    nodes = [_nodes(strip, marks, options.nodes) for strip in strips]
    for one, places in zip(drawn, nodes, strict=True):
        one.strands[:] = [*hopf_strands(one.strip, places), *loop_strands(one.strip, places)]
    window = Window(mu=high - low, lam=_height([s for one in drawn for s in one.strands]), share=options.smoothness)
    for one, places in zip(drawn, nodes, strict=True):
        _draw(one, places, marks, window)
    return _named(family, mu_range, lam_range, marks, drawn, options)


def natural_mu_range(family: Family, *also: float) -> tuple[float, float]:
    """Return a range of μ around all lines and Bautin points of a family, and other values.

    Raises:
        RefusedError: μ has no effect; the force vanishes everywhere.
    """
    places = [*also, *(line.mu for line in lines(family)), *(point.mu for point in bautin_points(family))]
    low, high = (min(places), max(places)) if places else (0.0, 0.0)
    room = _ROOM * (max(high - low, abs(low), abs(high)) or 1.0)
    return low - room, high + room


@final
@dataclass(slots=True)
class _Drawn:
    """A strip with its curves and points."""

    strip: Strip
    strands: list[Strand]
    events: list[Event]


def _nodes(strip: Strip, marks: Sequence[Line], count: int) -> list[float]:
    low, high = strip.cell.mu.tolist()
    met = {line.mu for line in marks}
    return spaced(low, high, count, singular=(low in met, high in met))


def _height(strands: Sequence[Strand]) -> float:
    framed = [s for s in strands if s.kind in _FRAMED] or list(strands)
    values = [knot.lam for strand in framed for knot in strand.knots]
    return (max(values) - min(values) if values else 0.0) or 1.0


def _draw(one: _Drawn, places: Sequence[float], marks: Sequence[Line], window: Window) -> None:
    """Find all curves and points of a strip."""
    strip = one.strip
    bautin = list(bautin_events(strip, bautin_points(strip.family)))
    dense = sorted({*smoothed(strip, one.strands, window), *places, *(event.mu for event in bautin)})
    hopf = hopf_strands(strip, dense)
    on_curves = [*hopf, *loop_strands(strip, sorted({*dense} - {event.mu for event in bautin}))]
    events = [*bautin, *crossings(strip, on_curves, corners=True)]
    done = []
    for strand in on_curves:
        met = [strand.at(event.mu) for event in events if strand.label in event.labels]
        closed, fresh = ended(strip, strand.with_knots(met), events, marks)
        done.append(closed)
        events += fresh
    # Only now the curves reach to their ends.
    late = [*crossings(strip, done, corners=False), *neutral_loops(strip, done)]
    done = [s.with_knots(s.at(event.mu) for event in late if s.label in event.labels) for s in done]
    events += late
    folds, cusps = fold_strands(strip, events, window)
    one.strands[:] = [*done, *(_fold_ends(strip, strand, marks) for strand in folds)]
    one.events[:] = [*events, *cusps]


def _fold_ends(strip: Strip, strand: Strand, marks: Sequence[Line]) -> Strand:
    """Name the ends of a curve of folds of cycles that lie at the edges of its strip."""
    for side in (0, 1):
        if strand.ends[side]:
            continue
        edge = strip.cell.mu.item(side)
        if strand.end_knot(side).mu == edge:
            strand = strand.with_end(side, "range")
        else:
            strand, _ = ended_at_edge(strip, strand, side, [line for line in marks if line.mu == edge])
    return strand


def _named(
    family: Family,
    mu_range: tuple[float, float],
    lam_range: tuple[float, float] | None,
    marks: Sequence[Line],
    drawn: Sequence[_Drawn],
    options: DiagramOptions,
) -> Diagram:
    window = lam_range or _window([strand for one in drawn for strand in one.strands])
    line_names = _line_names(marks)
    points, names = _points(drawn, marks, line_names)
    found = [_line_curve(family, line, line_names[line_key(line)], window, drawn) for line in marks]
    for one in drawn:
        for strand in one.strands:
            ends = tuple(names.get(end, line_names.get(end, end)) for end in strand.ends)
            found.append(
                curve_of(
                    strand.kind,
                    _name(one, strand.label),
                    one.strip.index,
                    strand.knots,
                    enclosed=strand.enclosed,
                    ends=(ends[0], ends[1]),
                )
            )
    return Diagram(
        family=family,
        mu_range=frozen_array(mu_range),
        lam_range=frozen_array(window),
        cells=tuple(one.strip.cell for one in drawn),
        curves=tuple(found),
        points=points,
        notes=tuple(_notes(drawn)),
        options=options,
    )


def _name(one: _Drawn, label: str) -> str:
    return f"{label}, strip {one.strip.index}"


def _line_names(marks: Sequence[Line]) -> dict[str, str]:
    counts: dict[CurveKind, int] = {}
    names = {}
    for line in marks:
        counts[line.kind] = counts.get(line.kind, 0) + 1
        names[line_key(line)] = f"{line.kind} line {counts[line.kind]}"
    return names


def _points(
    drawn: Sequence[_Drawn], marks: Sequence[Line], line_names: dict[str, str]
) -> tuple[tuple[DiagramPoint, ...], dict[str, str]]:
    """Return all points, and their names by their keys."""
    meeting: dict[str, set[str]] = {}
    events: dict[str, Event] = {}
    for line in marks:
        if math.isfinite(line.lam):
            event = _bogdanov_takens(line)
            events.setdefault(event_key(event), event)
            meeting.setdefault(event_key(event), set()).add(line_names[line_key(line)])
    for one in drawn:
        for event in one.events:
            events.setdefault(event_key(event), event)
            meeting.setdefault(event_key(event), set()).update(_name(one, label) for label in event.labels)
        for strand in one.strands:
            for end in strand.ends:
                meeting.setdefault(end, set()).add(_name(one, strand.label))
    names: dict[str, str] = {}
    counts: dict[PointKind, int] = {}
    points = []
    for key, event in sorted(events.items(), key=lambda item: (item[1].mu, item[1].lam)):
        counts[event.kind] = counts.get(event.kind, 0) + 1
        names[key] = f"{event.kind} {counts[event.kind]}"
        points.append(
            DiagramPoint(
                kind=event.kind,
                name=names[key],
                exact=event.exact,
                mu=event.mu,
                lam=event.lam,
                x=event.x,
                bracket=frozen_array(event.bracket),
                residual=event.residual,
                resolved=event.resolved,
                curves=tuple(sorted(meeting[key])),
            )
        )
    return tuple(points), names


def _bogdanov_takens(line: Line) -> Event:
    return Event(
        kind=PointKind.BOGDANOV_TAKENS,
        mu=line.mu,
        lam=line.lam,
        x=line.x,
        bracket=(line.mu, line.mu),
        residual=0.0,
        resolved=True,
        exact=True,
        labels=(),
    )


def _line_curve(
    family: Family, line: Line, name: str, window: tuple[float, float], drawn: Sequence[_Drawn]
) -> DiagramCurve:
    values = sorted({*window, *([line.lam] if window[0] < line.lam < window[1] else [])})
    residual = horner(family.at(line.mu, 0.0).force, line.x) if math.isfinite(line.x) else math.nan
    knots = [Knot(mu=line.mu, lam=lam, x=line.x, residual=residual, resolved=True, change=(0, 0)) for lam in values]
    left = max((one.strip.index for one in drawn if one.strip.cell.mu.item(1) <= line.mu), default=-1)
    return curve_of(line.kind, name, left, knots, enclosed=(), ends=("range", "range"))


def _window(strands: Sequence[Strand]) -> tuple[float, float]:
    framed = [s for s in strands if s.kind in _FRAMED] or list(strands)
    values = [knot.lam for strand in framed for knot in strand.knots] or [0.0]
    low, high = min(values), max(values)
    margin = _MARGIN * ((high - low) or 2.0 * abs(high) or 1.0)
    return low - margin, high + margin


def _notes(drawn: Sequence[_Drawn]) -> Iterator[str]:
    for one in drawn:
        for text, places in one.strip.refusals.items():
            where = sorted(set(places))
            at = (
                f"mu = {where[0]:.6g}" if len(where) == 1 else f"{len(where)} mu from {where[0]:.6g} to {where[-1]:.6g}"
            )
            yield f"strip {one.strip.index}: {text} (at {at})"
