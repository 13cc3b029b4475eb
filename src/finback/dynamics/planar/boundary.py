"""Curves that bound stability regions of a planar field: what of them lies in a box, their area, the nearest point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Final, final

import numpy as np
from scipy.optimize import minimize_scalar

from finback.arrays import FloatArray
from finback.dynamics.flow import derivative, horner
from finback.dynamics.planar.orbit import Line, PlanarOrbit

_PARTS: Final = 8  # of a segment, between which it crosses an edge of the box once at most
_NODES: Final = 32  # Gauss-Legendre, exact for what series of degree 30 make
_ITERATIONS: Final = 200
_SLIVER: Final = 1e-10  # of a part: what minimize_scalar is asked for


class BoundaryKind(StrEnum):
    """What a curve of a boundary is."""

    SADDLE = "saddle"
    """a branch of the stable manifold of a saddle"""
    CYCLE = "cycle"
    """an unstable limit cycle"""
    ORBIT = "orbit"
    """an orbit that leaves the box for good: the manifold of something at infinity"""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """A stretch of a curve: polynomials of a parameter from 0 to ``span``.

    Attributes:
        series: by rising power, shape (n, 2).
        span: its sign is the direction in which the curve was followed.
    """

    series: FloatArray
    span: float

    def at(self, parameter: FloatArray | float) -> FloatArray:
        """Return states, shape (2, ...)."""
        return np.asarray(np.polynomial.polynomial.polyval(parameter, self.series), dtype=np.float64)


@final
@dataclass(frozen=True, slots=True, eq=False)
class BoundaryCurve:
    """A curve of a boundary, in the direction in which it was followed.

    Attributes:
        kind: what it is.
        index: of the saddle in the setting, or of the cycle among those found; -1 for an orbit.
        segments: in their order.
        left: +1 if the region lies on the left of the curve, -1 if on its right, 0 if on both sides.
        orbit: the orbit that makes the segments, after the series of a manifold.
        end: what it comes to at last: where it ends, or the source or the place on a cycle that it winds around.
    """

    kind: BoundaryKind
    index: int
    segments: tuple[Segment, ...]
    left: int
    orbit: PlanarOrbit
    end: tuple[float, float]

    def states(self) -> FloatArray:
        """Return states along it, shape (n, 2)."""
        parts = [segment.at(np.linspace(0.0, segment.span, _PARTS + 1)[:-1]).T for segment in self.segments]
        last = self.segments[-1]
        return np.concatenate([*parts, [last.at(last.span)]])


def segments_of(orbit: PlanarOrbit) -> tuple[Segment, ...]:
    """Return an orbit as segments."""
    return tuple(Segment(piece[:2].T, float(span)) for piece, span in zip(orbit.series, orbit.spans, strict=True))


@final
@dataclass(frozen=True, slots=True)
class Edges:
    """A box, and places along its edge: 0 to 4, counterclockwise from the lower left corner."""

    low: tuple[float, float]
    high: tuple[float, float]

    def state(self, place: float) -> tuple[float, float]:
        """Return the state at a place."""
        side, share = divmod(place % 4.0, 1.0)
        (x0, y0), (x1, y1) = self.low, self.high
        begin, end = (
            ((x0, y0), (x1, y0)),
            ((x1, y0), (x1, y1)),
            ((x1, y1), (x0, y1)),
            ((x0, y1), (x0, y0)),
        )[int(side)]
        return begin[0] + share * (end[0] - begin[0]), begin[1] + share * (end[1] - begin[1])

    def inward(self, place: float) -> tuple[float, float]:
        """Return the normal that points into the box."""
        return ((0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0))[int(place % 4.0)]

    def place(self, state: FloatArray, axis: int, *, upper: bool) -> float:
        """Return the place of a state on one of the sides."""
        shares = [(float(s) - low) / (high - low) for s, low, high in zip(state, self.low, self.high, strict=True)]
        if axis == 1:
            return 3.0 - shares[0] if upper else shares[0]
        return 1.0 + shares[1] if upper else 4.0 - shares[1]

    def area(self, begin: float, end: float) -> float:
        """Return ½∮(x dy − y dx) along the edge, counterclockwise."""
        corners = [float(k) for k in range(math.ceil(begin), math.ceil(end)) if begin < k < end]
        states = [self.state(place) for place in (begin, *corners, end)]
        return 0.5 * math.fsum(a[0] * b[1] - a[1] * b[0] for a, b in pairwise(states))


def closing(curve: BoundaryCurve, edges: Edges) -> float:
    """Return ½∫(x dy − y dx) along the little that is missing between a curve and what it comes to."""
    last = curve.segments[-1]
    x, y = last.at(last.span)
    inside = edges.low[0] < x < edges.high[0] and edges.low[1] < y < edges.high[1]
    return 0.5 * float(x * curve.end[1] - y * curve.end[0]) if inside else 0.0


def cut_at_ray(segments: tuple[Segment, ...], ray: Line) -> tuple[Segment, ...]:
    """Return segments up to their last crossing of a half line; none if they never cross it."""
    (a, b), (c, d) = ray.normal, ray.direction
    for index in range(len(segments) - 1, -1, -1):
        segment = segments[index]
        shifted = segment.series - np.concatenate([[ray.point], np.zeros((len(segment.series) - 1, 2))])
        across, along = (shifted @ np.array(vector) for vector in ((a, b), (c, d)))
        steps = np.linspace(0.0, segment.span, _PARTS + 1)
        values = np.polynomial.polynomial.polyval(steps, across)
        for k in np.flatnonzero(values[:-1] * values[1:] < 0.0).tolist()[::-1]:
            time = _crossing(across.tolist(), 0.0, float(steps[k]), float(steps[k + 1]))
            if horner(along.tolist(), time) > 0.0:
                return (*segments[:index], Segment(segment.series, time))
    return ()


def inside_parts(segment: Segment, edges: Edges) -> tuple[list[tuple[float, float]], list[float]]:
    """Return the intervals of the parameter within a box, and the places where the segment crosses its edge."""
    steps = np.linspace(0.0, segment.span, _PARTS + 1)
    states = segment.at(steps)
    cuts, places = [0.0], []
    for axis, upper, level in (
        (axis, upper, (edges.high if upper else edges.low)[axis]) for axis in (0, 1) for upper in (False, True)
    ):
        series = segment.series[:, axis].tolist()
        for begin, end in _sides(series, level, steps, states[axis] - level):
            time = _crossing(series, level, begin, end)
            cuts.append(time)
            other = 1 - axis
            state = segment.at(time)
            if edges.low[other] <= state[other] <= edges.high[other]:
                places.append(edges.place(state, axis, upper=upper))
    cuts = [*sorted(cuts, key=abs), segment.span]
    kept = []
    for a, b in pairwise(cuts):
        x, y = segment.at(0.5 * (a + b))
        if edges.low[0] < x < edges.high[0] and edges.low[1] < y < edges.high[1]:
            kept.append((a, b))
    return kept, places


def _sides(series: list[float], level: float, steps: FloatArray, beyond: FloatArray) -> Iterator[tuple[float, float]]:
    """Yield intervals at whose ends a series lies on different sides of a level, an extremum between two steps seen."""
    slopes = np.polynomial.polynomial.polyval(steps, derivative(series))
    for k in range(len(steps) - 1):
        begin, end = float(steps[k]), float(steps[k + 1])
        if beyond[k] * beyond[k + 1] < 0.0:
            yield begin, end
        elif slopes[k] * slopes[k + 1] < 0.0 and beyond[k] * slopes[k] * (end - begin) < 0.0:
            top = _crossing([*derivative(series)], 0.0, begin, end)
            if (horner(series, top) - level) * beyond[k] < 0.0:
                yield begin, top
                yield top, end


def swept(segment: Segment, begin: float, end: float) -> float:
    """Return ½∫(x dy − y dx) along a part of a segment."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    times = 0.5 * (end - begin) * (nodes + 1.0) + begin
    x, y = segment.at(times)
    slopes = segment.series[1:] * np.arange(1, len(segment.series))[:, np.newaxis]
    dx, dy = np.polynomial.polynomial.polyval(times, slopes)
    return 0.25 * (end - begin) * float(weights @ (x * dy - y * dx))


def nearest(curve: BoundaryCurve, center: FloatArray, scales: FloatArray) -> tuple[float, int, float]:
    """Return the least scaled distance from a center to a curve, the segment and the parameter where it is."""
    best = min(_candidates(curve, center, scales))
    _, index, part = best
    segment = curve.segments[index]

    def distance(parameter: float) -> float:
        return float(np.hypot(*((segment.at(parameter) - center) / scales)))

    low, high = sorted((segment.span * max(0, part - 1) / _PARTS, segment.span * min(_PARTS, part + 1) / _PARTS))
    found = minimize_scalar(distance, bounds=(low, high), method="bounded", options={"xatol": _SLIVER * (high - low)})
    parameter = min((float(found.x), low, high), key=distance)
    return distance(parameter), index, parameter


def _candidates(curve: BoundaryCurve, center: FloatArray, scales: FloatArray) -> Iterator[tuple[float, int, int]]:
    for index, segment in enumerate(curve.segments):
        states = segment.at(np.linspace(0.0, segment.span, _PARTS + 1)).T
        distances = np.hypot(*((states - center) / scales).T)
        part = int(distances.argmin())
        yield float(distances[part]), index, part


def _crossing(series: list[float], level: float, begin: float, end: float) -> float:
    rising = horner(series, end) > level
    for _ in range(_ITERATIONS):
        middle = 0.5 * (begin + end)
        if middle in (begin, end):
            break
        if (horner(series, middle) > level) == rising:
            end = middle
        else:
            begin = middle
    return end
