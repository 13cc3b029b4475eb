"""Orbits of a planar polynomial field, piece by piece, with their crossings of a line."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.flow import horner
from finback.dynamics.planar.field import PlanarField
from finback.dynamics.planar.kernel import CROSSED, FAR, GOING, ORDER, PARTS, STIFF, trace
from finback.dynamics.planar.stiff_kernel import TABLES, trace_stiff

MOST_PIECES: Final = 2000
"""Pieces allowed in one orbit; one between two saddles has 10 to 60, a turn about a focus 10 to 40."""

_MOST_CROSSINGS: Final = 64  # of the whole line: an orbit that winds so often around something else comes to nothing
_ITERATIONS: Final = 200  # more than bisection of a piece needs

NODES: Final = 20
PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(NODES)
"""Gauss-Legendre nodes between -1 and 1, on each piece."""
_SHARES: Final = 0.5 * (PLACES + 1.0)
_AT_NODES: Final = np.vander(_SHARES, ORDER + 1, increasing=True)
_INTEGRATED: Final = 1.0 / np.arange(1, ORDER + 2)
_TO_NODES: Final = _AT_NODES * _SHARES[:, np.newaxis] * _INTEGRATED
_PRIMITIVES: Final = [np.polynomial.legendre.legint(row, lbnd=-1) for row in np.eye(NODES)]
_NO_LINE: Final = np.zeros(4)
_Kernel = Callable[..., tuple[int, int]]


class PlanarEnding(StrEnum):
    """How an orbit ends."""

    SECTION = "section"
    """it crossed the line as often as it was to"""
    TRAP = "trap"
    """it came so near to an equilibrium that it ends in that"""
    FAR = "far"
    """it blew up or went farther than it was to be followed"""
    NOWHERE = "nowhere"
    """it came to none of these within the pieces allowed"""


@final
@dataclass(frozen=True, slots=True)
class Line:
    """A line, or the half of it that begins at a point.

    Attributes:
        point: a point on it.
        direction: along it, of length 1.
        half: whether only what lies from the point in that direction counts.
    """

    point: tuple[float, float]
    direction: tuple[float, float]
    half: bool

    @property
    def normal(self) -> tuple[float, float]:
        """The direction turned counterclockwise by a right angle; what crosses that way has sense +1."""
        return -self.direction[1], self.direction[0]

    def at(self, along: float) -> tuple[float, float]:
        """Return the point at a place along the line."""
        return self.point[0] + along * self.direction[0], self.point[1] + along * self.direction[1]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Where an orbit ends by itself.

    Attributes:
        traps: rows of ``planar_capture``, shape (n, 5): inside these ellipses.
        far: beyond this |x| or |y|.
    """

    traps: FloatArray
    far: float


@final
@dataclass(frozen=True, slots=True)
class Hit:
    """A crossing of the line.

    Attributes:
        piece: index of the piece in which it is.
        time: since that began.
        along: place along the line.
        sense: +1 or -1, as followed: backward in time the opposite of what the field does.
    """

    piece: int
    time: float
    along: float
    sense: int


@final
@dataclass(frozen=True, slots=True, eq=False)
class PlanarOrbit:
    """A stretch of an orbit.

    Attributes:
        series: of x, y and the divergence by rising power of the time since a piece began, shape (n, 3, ORDER + 1).
        spans: duration of each piece, negative when followed backward, shape (n,).
        ending: how it ends.
        trap: index of the trap in which it ended, -1 if in none.
        hits: its crossings of the line.
        end: where it ends.
    """

    series: FloatArray
    spans: FloatArray
    ending: PlanarEnding
    trap: int
    hits: tuple[Hit, ...]
    end: tuple[float, float]

    @property
    def duration(self) -> float:
        """The time it takes, negative when followed backward."""
        return math.fsum(self.spans.tolist())

    def upto(self, hit: Hit) -> PlanarOrbit:
        """Return the stretch that ends at a crossing."""
        return self.cut(hit.piece, hit.time)

    def cut(self, piece: int, time: float) -> PlanarOrbit:
        """Return the stretch that ends at a time since a piece began."""
        spans = self.spans[: piece + 1].copy()
        spans[-1] = time
        series = self.series[: piece + 1]
        x, y = (horner(series[-1, row].tolist(), time) for row in range(2))
        hits = tuple(hit for hit in self.hits if (hit.piece, abs(hit.time)) <= (piece, abs(time)))
        return PlanarOrbit(series, spans, PlanarEnding.SECTION, -1, hits, (x, y))

    def none(self) -> PlanarOrbit:
        """Return the stretch without length at its beginning."""
        start = (float(self.series[0, 0, 0]), float(self.series[0, 1, 0]))
        return PlanarOrbit(self.series[:0], self.spans[:0], PlanarEnding.SECTION, -1, (), start)

    def growth(self) -> FloatArray:
        """Return ∫ divergence dt from the beginning to the beginning of each piece and to the end, shape (n + 1,)."""
        grown = (self._scaled()[:, 2] * _INTEGRATED).sum(axis=1) * self.spans
        return np.concatenate([[0.0], np.cumsum(grown)])

    def samples(self, parts: int) -> FloatArray:
        """Return states along it, ``parts`` to a piece and the end, shape (n parts + 1, 2)."""
        places = np.vander(np.arange(parts) / parts, ORDER + 1, increasing=True)
        values = self._scaled()[:, :2] @ places.T
        return np.concatenate([values.transpose(0, 2, 1).reshape(-1, 2), [self.end]])

    def nodes(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return weight (dt), x, y and ∫ divergence dt from the beginning, at Gauss-Legendre nodes, each (n, 20)."""
        scaled = self._scaled()
        x, y = (scaled[:, :2] @ _AT_NODES.T).transpose(1, 0, 2)
        span = self.spans[:, np.newaxis]
        exponent = (scaled[:, 2] @ _TO_NODES.T) * span + self.growth()[:-1, np.newaxis]
        return 0.5 * span * _WEIGHTS, x, y, exponent

    def _scaled(self) -> FloatArray:
        """Return the series by powers of the time as a share of the span."""
        return self.series * (self.spans[:, np.newaxis] ** np.arange(ORDER + 1))[:, np.newaxis]


def fate(field: PlanarField, start: tuple[float, float], limits: Limits, *, forward: bool) -> PlanarOrbit:
    """Follow an orbit into a trap, or far away, or as long as the pieces allow."""
    return _follow(field, start, limits, forward=forward, line=None, stop=(0, 0))


def winding(field: PlanarField, start: float, limits: Limits, *, forward: bool, line: Line, sense: int) -> PlanarOrbit:
    """Follow an orbit from a place on a half line until it has wound around the point once.

    That is: until it has crossed the half line once more in ``sense`` (as followed) than against it.
    """
    return _follow(field, line.at(start), limits, forward=forward, line=line, stop=(sense, 0), leaving=sense)


def crossings(
    field: PlanarField, start: tuple[float, float], limits: Limits, *, forward: bool, line: Line, most: int
) -> PlanarOrbit:
    """Follow an orbit until it has crossed a line ``most`` times, in whatever sense."""
    return _follow(field, start, limits, forward=forward, line=line, stop=(0, most))


def _follow(  # noqa: PLR0913 - the three ways to follow meet here
    field: PlanarField,
    start: tuple[float, float],
    limits: Limits,
    *,
    forward: bool,
    line: Line | None,
    stop: tuple[int, int],
    leaving: int = 0,
) -> PlanarOrbit:
    series, spans = np.empty((MOST_PIECES, 3, ORDER + 1)), np.empty(MOST_PIECES)
    table = np.empty((len(field.factors) + 2, ORDER + 1))
    state = np.array(start)
    row = _NO_LINE if line is None else _row(line, leaving)
    heading = 1.0 if forward else -1.0
    hits: list[Hit] = []
    used, code, crossed = 0, CROSSED, 0
    kernel: _Kernel = trace
    while code in (CROSSED, STIFF) and crossed < _MOST_CROSSINGS:
        crossed += 1
        code, used = kernel(
            field.factors, field.weights, table, state, heading, row, limits.traps, limits.far, series, spans, used
        )
        if code == STIFF:
            kernel, table = trace_stiff, TABLES  # from here on: an orbit seldom leaves what attracts it for long
            row[3] = 0.0
        if code != CROSSED or line is None:
            continue
        for hit in _hits(line, series[used - 1], float(spans[used - 1]), used - 1, leaving=row[3]):
            hits.append(hit)
            net, most = stop
            if (net and sum(one.sense for one in hits) == net) or len(hits) == most:
                whole = PlanarOrbit(series[:used], spans[:used], PlanarEnding.SECTION, -1, tuple(hits), start)
                return whole.upto(hit)
        row[3] = 0.0
    ending = {FAR: PlanarEnding.FAR, GOING: PlanarEnding.NOWHERE, CROSSED: PlanarEnding.NOWHERE}.get(
        code, PlanarEnding.TRAP
    )
    end = (float(state[0]), float(state[1]))
    return PlanarOrbit(series[:used], spans[:used], ending, max(code, -1), tuple(hits), end)


def _row(line: Line, leaving: int) -> FloatArray:
    a, b = line.normal
    return np.array([a, b, -a * line.point[0] - b * line.point[1], float(leaving)])


def _hits(line: Line, piece: FloatArray, span: float, index: int, *, leaving: float) -> Sequence[Hit]:
    """Return the crossings within a piece; ``leaving`` is the sign with which it leaves the line, or 0."""
    (a, b), (c, d) = line.normal, line.direction
    across = a * (piece[0]) + b * piece[1]
    across[0] -= a * line.point[0] + b * line.point[1]
    excess = across.tolist()
    found = []
    left, before = 0.0, leaving or excess[0]
    for part in range(1, PARTS + 1):
        right = span * part / PARTS
        after = horner(excess, right)
        if before * after < 0.0:
            time = _root(excess, left, right, rising=after > 0.0)
            along = c * (horner(piece[0].tolist(), time) - line.point[0])
            along += d * (horner(piece[1].tolist(), time) - line.point[1])
            if along > 0.0 or not line.half:
                found.append(Hit(index, time, along, 1 if after > 0.0 else -1))
        if after != 0.0:
            before = after
        left = right
    return found


def _root(series: Sequence[float], inside: float, outside: float, *, rising: bool) -> float:
    """Return where a series that is known to change its sign does so: Newton's method within the bracket."""
    time = 0.5 * (inside + outside)
    for _ in range(_ITERATIONS):
        value = slope = 0.0
        for coefficient in reversed(series):
            slope = slope * time + value
            value = value * time + coefficient
        if value == 0.0:
            return time
        if (value > 0.0) == rising:
            outside = time
        else:
            inside = time
        newton = time - value / slope if slope else math.inf
        if not min(inside, outside) < newton < max(inside, outside):
            newton = 0.5 * (inside + outside)
        if abs(newton - time) <= math.ulp(outside) or newton in (inside, outside):
            return newton
        time = newton
    return time
