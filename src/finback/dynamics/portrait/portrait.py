"""The phase portrait of a flow: equilibria, separatrices, limit cycles and some other orbits, as data for a drawing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.cycle.flow_cycle import FlowCycle, flow_cycles
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest, Scale, derivative, flow_at, horner, rests
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.orbit.manifold import manifold
from finback.dynamics.orbit.taylor import Ending, follow
from finback.dynamics.portrait.orbit import Stage, clipped, sampled, stage_of, thinned
from finback.dynamics.portrait.path import Box, DrawnCycle, Orbit, PathEnd, Portrait, Separatrix
from finback.errors import RefusedError

_GRID: Final = (7, 6)  # starts tried across and along the box
_PER_REGION: Final = 2
_SERIES: Final = 40  # points of a separatrix where its power series serves
_NULLCLINE: Final = 801
_MARGIN: Final = 0.6  # of the distance between the outer equilibria, on either side of a natural box


def phase_portrait(flow: Flow, box: Box | None = None) -> Portrait:
    """Compute a phase portrait.

    Args:
        flow: the flow.
        box: what is drawn; None: the equilibria and cycles with room around (``natural_box``).

    Raises:
        RefusedError: the force is zero everywhere.
    """
    points = rests(flow)
    notes: list[str] = []
    try:
        cycles = flow_cycles(flow).cycles
    except RefusedError as error:
        cycles = ()
        notes.append(f"limit cycles: {error.message}")
    frame = box or _framed(flow, points, cycles)
    stage = stage_of(flow, frame, points, cycles, _rate(flow, points))
    separatrices = tuple(_separatrices(stage, notes))
    drawn = tuple(_drawn(stage, cycle) for cycle in cycles)
    return Portrait(
        flow=flow,
        box=frame,
        equilibria=points,
        separatrices=separatrices,
        cycles=drawn,
        orbits=tuple(_orbits(stage, separatrices)),
        nullclines=tuple(_nullclines(flow, frame)),
        notes=tuple(notes),
    )


def system_portrait(system: LienardSystem, elevator_rad: float, box: Box | None = None) -> Portrait:
    """Compute the phase portrait of a Liénard system at a held elevator: x is alpha in rad, y is dα/dt in rad/s.

    Args:
        system: the system.
        elevator_rad: the elevator.
        box: in rad and rad/s; None: the equilibria and cycles with room around.
    """
    return phase_portrait(flow_at(system, elevator_rad, Scale(length_rad=1.0, time_s=1.0)), box)


def natural_box(flow: Flow) -> Box:
    """Return a box that holds the equilibria and limit cycles of a flow, with room around."""
    return _framed(flow, rests(flow), flow_cycles(flow).cycles)


def _rate(flow: Flow, points: Sequence[Rest]) -> float:
    """Return a typical rate: that of the fastest equilibrium."""
    slope = derivative(flow.force)
    return math.sqrt(max((abs(horner(slope, point.x)) for point in points), default=0.0)) or 1.0


def _framed(flow: Flow, points: Sequence[Rest], cycles: Sequence[FlowCycle]) -> Box:
    places = [point.x for point in points] + [x for cycle in cycles for x in (cycle.x_min, cycle.x_max)]
    low, high = (min(places), max(places)) if places else (-1.0, 1.0)
    width = high - low or max(1.0, abs(high))
    half = 0.5 * width * (1.0 + 2.0 * _MARGIN)
    middle = 0.5 * (low + high)
    speed = half * _rate(flow, points)
    return Box(x_low=middle - half, x_high=middle + half, y_low=-speed, y_high=speed)


def _separatrices(stage: Stage, notes: list[str]) -> Iterator[Separatrix]:
    for point in stage.equilibria:
        if point.kind is not Kind.SADDLE:
            continue
        for stable in (False, True):
            try:
                whole = manifold(stage.flow, point, stable=stable)
            except RefusedError as error:
                notes.append(f"separatrices at x = {point.x * stage.length:.6g}: {error.message}")
                continue
            # Not through the next equilibrium: a graph that runs into a node does not tell how far it is a manifold.
            rooms = [abs(other.x - point.x) for other in stage.equilibria if other is not point]
            reach = min([whole.radius, 1.0, *(0.5 * room for room in rooms)])
            for side in (-1, 1):
                u = side * reach * np.linspace(0.0, 1.0, _SERIES + 1)
                graph = np.stack([point.x + u, np.polynomial.polynomial.polyval(u, whole.series)], axis=1)
                rest = stage.followed((float(graph[-1, 0]), float(graph[-1, 1])), forward=not stable)
                yield Separatrix(
                    saddle_x=point.x * stage.length,
                    side=side,
                    stable=stable,
                    orbit=_with_beginning(stage, graph, rest),
                )


def _with_beginning(stage: Stage, graph: FloatArray, rest: Orbit) -> Orbit:
    """Return an orbit that begins with the graph of a manifold."""
    unit = np.array([stage.length, stage.length / stage.time])
    begin = [part * unit for part in clipped(thinned(graph), stage.box)]
    pieces = list(rest.pieces)
    if begin and pieces and np.array_equal(begin[-1][-1], pieces[0][0]):
        pieces[0] = np.concatenate([begin.pop(), pieces[0][1:]])
    return Orbit(
        start=frozen_array(graph[0] * unit),
        forward=rest.forward,
        pieces=(*begin, *pieces),
        end=rest.end,
        to_x=rest.to_x,
    )


def _drawn(stage: Stage, cycle: FlowCycle) -> DrawnCycle:
    """Follow a cycle for one turn, in the direction of time in which it attracts."""
    start = (cycle.x_max / stage.length, 0.0)
    path = follow(stage.flow, start, forward=cycle.stable, section=math.nan, turns=2)
    points = np.array([start, *sampled(path.pieces)])
    if path.ending is Ending.AXIS:
        points[-1] = start
    unit = np.array([stage.length, stage.length / stage.time])
    return DrawnCycle(cycle=cycle, pieces=tuple(part * unit for part in clipped(thinned(points), stage.box)))


def _orbits(stage: Stage, separatrices: Sequence[Separatrix]) -> Iterator[Orbit]:
    """Yield orbits through some states of each region, far from what is drawn already, backward and forward."""
    unit = np.array([stage.length, stage.length / stage.time])
    drawn = [part / unit for branch in separatrices for part in branch.orbit.pieces]
    tried: dict[tuple[object, ...], list[tuple[Orbit, Orbit, tuple[float, float]]]] = {}
    for start in _starts(stage):
        ahead, behind = (stage.followed(start, forward=way) for way in (True, False))
        tried.setdefault((*_fate(ahead), *_fate(behind)), []).append((ahead, behind, start))
    for group in tried.values():
        left = group
        for _ in range(_PER_REGION):
            if not left:
                break
            best = max(left, key=lambda item: _distance(item[2], drawn))
            left = [item for item in left if item is not best]
            yield from best[:2]
            drawn += [part / unit for orbit in best[:2] for part in orbit.pieces]


def _starts(stage: Stage) -> Iterator[tuple[float, float]]:
    """Yield states over the box, and on the axis between equilibria and cycles."""
    box = stage.box
    across, along = _GRID
    for row in range(along):
        for column in range(across):
            x = box.x_low + (box.x_high - box.x_low) * (column + (0.75 if row % 2 else 0.25)) / across
            yield x, box.y_low + (box.y_high - box.y_low) * (row + 0.5) / along
    places = sorted({*(point.x for point in stage.equilibria), *(place for _, place, _ in stage.cycles)})
    for low, high in pairwise(places):
        if box.x_low < low and high < box.x_high:
            yield 0.5 * (low + high), 0.0


def _fate(orbit: Orbit) -> tuple[object, ...]:
    """Return where an orbit goes, for the telling of regions: an equilibrium, a cycle, or which way out."""
    if orbit.end is PathEnd.REST:
        return PathEnd.REST, round(orbit.to_x, 9)
    last = orbit.pieces[-1][-1] if orbit.pieces else orbit.start
    if orbit.end is PathEnd.BOX:
        return PathEnd.BOX, bool(last[1] > 0.0)
    return orbit.end, len(orbit.pieces)


def _distance(start: tuple[float, float], drawn: Sequence[FloatArray]) -> float:
    return min((float(np.min(np.hypot(*(part - start).T))) for part in drawn), default=math.inf)


def _nullclines(flow: Flow, box: Box) -> Iterator[FloatArray]:
    """Yield y = −g/f inside the box, cut where f is zero."""
    x = np.linspace(box.x_low, box.x_high, _NULLCLINE)
    f = np.polynomial.polynomial.polyval(x, flow.damping)
    g = np.polynomial.polynomial.polyval(x, flow.force)
    with np.errstate(divide="ignore", invalid="ignore"):
        y = -g / f
    breaks = np.flatnonzero((f[:-1] * f[1:] <= 0.0) | ~np.isfinite(y[:-1]) | ~np.isfinite(y[1:])) + 1
    for part in np.split(np.stack([x, y], axis=1), breaks):
        inside = part[np.isfinite(part[:, 1])]
        if len(inside) > 1:
            yield from clipped(inside, box)
