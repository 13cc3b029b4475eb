"""The curves that bound stability regions: stable branches of saddles followed backward to their end, and cycles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Final, final

import numpy as np
from scipy.optimize import brentq

from finback.arrays import FloatArray
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest, horner, shifted
from finback.dynamics.orbit.half_turn import HalfTurn, half_turn
from finback.dynamics.orbit.manifold import manifold
from finback.dynamics.orbit.taylor import Piece, pieces
from finback.dynamics.stability.capture import captures
from finback.errors import RefusedError

_SAMPLES: Final = 16  # of a segment, to see where it crosses a line; it turns once at most
_SHORT: Final = 0.9  # of the way to the next equilibrium: as far as the series of a branch is used
_NEAR: Final = 1e-7  # of the flow's units: nearer to a source the rest of a spiral has no area to speak of
_CLOSED: Final = 1e-10  # relative: two windings so near to each other have come to a cycle
_FIRST: Final = 4
_WINDINGS: Final = 500
_FAR: Final = 3.0
_NEWTON: Final = 30
_GREATEST: Final = 700.0  # its exponential is still a number


NODES, WEIGHTS = np.polynomial.legendre.leggauss(25)
"""Gauss's rule from -1 to 1, exact for the square of a series of degree 24."""


def series_at(series: FloatArray, parameter: FloatArray | float) -> FloatArray:
    """Return the values of power series, shape (terms,) or (terms, n), at a parameter of any shape."""
    powers = np.ones((*np.shape(parameter), len(series)))
    powers[..., 1:] = np.asarray(parameter)[..., np.newaxis]
    return np.asarray(np.multiply.accumulate(powers, axis=-1) @ series)


class CurveEnd(StrEnum):
    """Where a stable branch comes from, as it is followed backward in time."""

    AWAY = "away"
    """from infinity"""
    SOURCE = "source"
    """from an unstable equilibrium"""
    CYCLE = "cycle"
    """from an unstable limit cycle, around which it winds without end"""
    WINDS = "winds"
    """from infinity, around all equilibria in ever narrower turns: it crosses any range of x without end"""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """A stretch of a curve: polynomials of a parameter from 0 to ``span``.

    The parameter is the time; on the series of a manifold (``graph``) it is x − x_saddle.

    Attributes:
        x: coefficients of x by rising power.
        y: the same for y.
        f: the same for f(x).
        span: where the stretch ends; its sign is the direction in which the curve was followed.
        graph: which parameter it is.
    """

    x: FloatArray
    y: FloatArray
    f: FloatArray
    span: float
    graph: bool

    def at(self, parameter: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        """Return x and y."""
        return series_at(self.x, parameter), series_at(self.y, parameter)

    def within(self, limits: tuple[float, float]) -> list[tuple[float, float]]:
        """Return the intervals of the parameter, in the curve's direction, where x lies between the limits."""
        (first, last), (start, end) = (row.tolist() for row in self.at(np.array([0.0, self.span])))
        # A segment is shorter than half a turn: with one sign of y at both ends x is monotone.
        if (self.graph or start * end > 0.0) and (first < limits[0]) == (last < limits[0]):
            inside = [limits[0] < x < limits[1] for x in (first, last)]
            if all(inside):
                return [(0.0, self.span)]
            if (first > limits[1]) == (last > limits[1]):
                return []
        steps = np.linspace(0.0, self.span, _SAMPLES + 1)
        places, _ = self.at(steps)
        cuts = [0.0]
        for limit in limits:
            changes = np.flatnonzero(np.diff(np.sign(places - limit))).tolist()
            cuts += [self._crossing(limit, float(steps[k]), float(steps[k + 1])) for k in changes]
        cuts = [*sorted(cuts, key=abs), self.span]
        middles = [(a, b, float(self.at(0.5 * (a + b))[0])) for a, b in pairwise(cuts) if a != b]
        return [(a, b) for a, b, x in middles if limits[0] < x < limits[1]]

    def _crossing(self, limit: float, low: float, high: float) -> float:
        row = self.x.tolist()

        def excess(parameter: float) -> float:
            return horner(row, parameter) - limit

        if excess(low) * excess(high) > 0.0:  # it touches the limit, within rounding
            return low
        return float(brentq(excess, min(low, high), max(low, high), xtol=1e-300, rtol=1e-15))


@final
@dataclass(frozen=True, slots=True, eq=False)
class StableBranch:
    """One branch of the stable manifold of a saddle, from the saddle backward in time.

    Attributes:
        saddle: the saddle.
        side: -1 if the branch enters it from smaller x, 1 from larger.
        segments: the curve.
        ending: how it ends.
        turns: where it turned from y < 0 to y > 0, thus at the greater x, in the order met.
    """

    saddle: Rest
    side: int
    segments: tuple[Segment, ...]
    ending: CurveEnd
    turns: tuple[float, ...]


@final
@dataclass(frozen=True, slots=True, eq=False)
class CycleCurve:
    """A limit cycle, once round forward in time from its greatest x.

    Attributes:
        x_max: greatest x.
        x_min: least x.
        multiplier: of its return map; above 1 it is unstable.
        segments: the curve.
    """

    x_max: float
    x_min: float
    multiplier: float
    segments: tuple[Segment, ...]

    @property
    def period(self) -> float:
        """The time it takes."""
        return math.fsum(segment.span for segment in self.segments)


def stable_branch(
    flow: Flow, saddle: Rest, side: int, points: Sequence[Rest], reach: float, inner: float
) -> StableBranch:
    """Follow a stable branch backward until it has left |x| <= ``reach`` for good, or come to its end.

    One that winds outward around all equilibria and |x| <= ``inner``, in ever wider turns, is given up.

    Raises:
        RefusedError: it comes to no end within the steps allowed.
    """
    whole = manifold(flow, saddle, stable=True)
    beyond = [abs(point.x - saddle.x) for point in points if (point.x - saddle.x) * side > 0.0]
    first = side * min([whole.radius, *(_SHORT * distance for distance in beyond)])
    start = Segment(
        np.array([saddle.x, 1.0]),
        np.array(whole.series),
        np.array(shifted(flow.damping, saddle.x)),
        first,
        graph=True,
    )
    segments = [start]
    sources = captures(flow, points, forward=False)
    x, y = (float(value) for value in start.at(first))
    turns: list[float] = []

    def ended(ending: CurveEnd) -> StableBranch:
        return StableBranch(saddle, side, tuple(segments), ending, tuple(turns))

    for piece in pieces(flow, (x, y), forward=False):
        segments.append(_segment(piece, piece.span))
        before = y
        x, y = piece.at(piece.span)
        if _gone(points, x, y) and abs(x) > reach:
            return ended(CurveEnd.AWAY)
        for trap in sources:
            if trap.depth(x, y) < 1.0 and math.hypot(x - trap.sink, y) < _NEAR:
                return ended(CurveEnd.SOURCE)
        if before < 0.0 <= y:  # backward, orbits move from y < 0 to y > 0 at the greater x
            time, turn = turning(piece)
            turns.append(turn)
            if len(turns) > 1 and abs(turn - turns[-2]) <= _CLOSED * abs(turn - saddle.x):
                segments[-1] = _segment(piece, time)
                return ended(CurveEnd.CYCLE)
            if turn > max(inner, points[-1].x) and _unwinds(flow, turns):
                return ended(CurveEnd.WINDS)
    if max(abs(x), abs(y)) > reach:
        return ended(CurveEnd.AWAY)
    raise RefusedError("a stable manifold could not be followed to its end")


def _unwinds(flow: Flow, turns: Sequence[float]) -> bool:
    """Tell whether an orbit, backward in time, winds outward without end: whether it soon turns much farther out.

    One that soon leaves for good does not. Asked at its fourth turn, eighth, sixteenth and so on.
    """
    if len(turns) < _FIRST or len(turns) & (len(turns) - 1):
        return False
    x = turns[-1]
    for _ in range(2 * _WINDINGS):
        found = half_turn(flow, x, forward=False)
        if not found.landed:
            return False
        if abs(found.x) > _FAR * abs(turns[-1]):
            return True
        x = found.x
    return False


def _gone(points: Sequence[Rest], x: float, y: float) -> bool:
    """Tell whether, backward in time, an orbit is where it can only move on outward: beyond an outermost saddle."""
    if points[-1].kind is Kind.SADDLE and x > points[-1].x and y < 0.0:
        return True
    return points[0].kind is Kind.SADDLE and x < points[0].x and y > 0.0


def _segment(piece: Piece, span: float) -> Segment:
    return Segment(np.array(piece.x), np.array(piece.y), np.array(piece.f), span, graph=False)


def turning(piece: Piece) -> tuple[float, float]:
    """Return when y vanishes in a piece in which it changes its sign, and where."""

    def height(time: float) -> float:
        return piece.at(time)[1]

    low, high = sorted((0.0, piece.span))
    time = 0.0 if height(0.0) == 0.0 else float(brentq(height, low, high, xtol=1e-300, rtol=1e-15))
    return time, piece.at(time)[0]


def _slope(flow: Flow, x: float, first: HalfTurn, second: HalfTurn) -> float:
    """Return the derivative of where two half turns end by where they start, by the wedge (see ``HalfTurn``)."""
    growth = math.exp(min(first.damping + second.damping, _GREATEST))
    return growth * horner(flow.force, x) / horner(flow.force, second.x)


def cycle_curve(flow: Flow, x_max: float) -> CycleCurve:
    """Follow the cycle that passes through (x_max, 0), its greatest x, once round."""
    segments: list[Segment] = []
    x_min, y = math.nan, 0.0
    for piece in pieces(flow, (x_max, 0.0), forward=True):
        before, y = y, piece.at(piece.span)[1]
        if before < 0.0 <= y:
            x_min = turning(piece)[1]
        if before > 0.0 >= y:
            segments.append(_segment(piece, turning(piece)[0]))
            damping = math.fsum(_integral(segment.f, segment.span) for segment in segments)
            return CycleCurve(x_max, x_min, math.exp(damping), tuple(segments))
        segments.append(_segment(piece, piece.span))
    raise RefusedError("a cycle could not be followed once round")


def enclosing_cycle(flow: Flow, turn: float) -> CycleCurve:
    """Return the cycle onto which a branch winds whose last windings turn at x = ``turn``."""
    x = turn
    for _ in range(_NEWTON):
        first = half_turn(flow, x, forward=False)
        second = half_turn(flow, first.x, forward=False)
        step = (second.x - x) / (_slope(flow, x, first, second) - 1.0)
        x -= step
        if abs(step) <= 4.0 * math.ulp(abs(x) + abs(second.x)):
            break
    return cycle_curve(flow, x)


def _integral(series: FloatArray, span: float) -> float:
    return horner([0.0, *(series / np.arange(1, series.size + 1))], span)


def integrals(segments: Sequence[Segment], limits: tuple[float, float]) -> Iterator[float]:
    """Yield ∫ y dx over the part of each segment between the limits, in the curve's direction."""
    for segment in segments:
        for start, end in segment.within(limits):
            half = 0.5 * (end - start)
            y = series_at(segment.y, start + half * (NODES + 1.0))
            yield half * float(WEIGHTS @ (y if segment.graph else y * y))
