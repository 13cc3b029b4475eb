"""Orbits of a Liénard flow by their Taylor series in time: each step as long as its series allows.

The recursion is the classical one (Jorba & Zou, "A software package for the numerical integration of ODEs by means
of high-order Taylor methods", Experimental Mathematics 14, 2005); the step is such that the last terms fall below
rounding. Every piece keeps its series, so an event inside it is a root of a polynomial.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from operator import mul
from typing import Final, final

from scipy.optimize import brentq

from finback.dynamics.capture import Capture
from finback.dynamics.flow import Flow, horner

ORDER: Final = 24
_TOLERANCE: Final = 1e-17  # of the last terms, relative to the state: below rounding, so that it does not accumulate
_LONGEST_S: Final = 1.0  # where the series is (nearly) exact, a step as long as it holds would end beyond everything
_MOST_PIECES: Final = 600  # an orbit between two saddles has 10 to 60
_ITERATIONS: Final = 10_000  # far beyond what bisection of all doubles needs
_FAR: Final = 1e9  # in units of the flow: beyond it an orbit has blown up


class Ending(StrEnum):
    """How a path ends."""

    SECTION = "section"
    """it reached the vertical line it was to reach"""
    AXIS = "axis"
    """it turned: y became 0 first"""
    REST = "rest"
    """it came so near to an equilibrium that it ends in that"""
    NOWHERE = "nowhere"
    """it blew up, or came to none of these within the steps allowed"""


@final
@dataclass(frozen=True, slots=True)
class Piece:
    """One step of an orbit.

    Attributes:
        x: series of x by rising power of the time since the piece began.
        y: series of y.
        f: series of f(x).
        span: its duration, negative when followed backward.
    """

    x: tuple[float, ...]
    y: tuple[float, ...]
    f: tuple[float, ...]
    span: float

    def at(self, time: float) -> tuple[float, float]:
        """Return x and y at a time since the piece began."""
        return horner(self.x, time), horner(self.y, time)


@final
@dataclass(frozen=True, slots=True)
class Path:
    """A stretch of an orbit.

    Attributes:
        pieces: in the order followed; the last is cut where the path ends.
        ending: how it ends.
        x: where it ends.
        y: the same.
    """

    pieces: tuple[Piece, ...]
    ending: Ending
    x: float
    y: float

    @property
    def duration(self) -> float:
        """The time it takes, negative when followed backward."""
        return math.fsum(piece.span for piece in self.pieces)


def pieces(flow: Flow, start: tuple[float, float], *, forward: bool) -> Iterator[Piece]:
    """Follow an orbit piece by piece; ends where it blows up or after a fixed number of pieces."""
    x, y = start
    for _ in range(_MOST_PIECES):
        piece = _piece(flow, x, y, forward=forward)
        if not (math.isfinite(piece.span) and piece.span):
            return
        x, y = piece.at(piece.span)
        if not (abs(x) < _FAR and abs(y) < _FAR):
            return
        yield piece


def follow(
    flow: Flow, start: tuple[float, float], *, forward: bool, section: float, traps: Sequence[Capture] = ()
) -> Path:
    """Follow an orbit to the line x = ``section``, to y = 0 or into a trap, whichever comes first.

    Between two zeros of y the orbit moves in one direction, so nothing is missed: a step is shorter than half a turn,
    because the series of a rotation ends its use before.
    """
    followed: list[Piece] = []
    x, y = start
    for piece in pieces(flow, start, forward=forward):
        end_x, end_y = piece.at(piece.span)
        span, ending = piece.span, Ending.NOWHERE
        if end_y * y <= 0.0:
            span, ending = _root(piece.y, 0.0, span), Ending.AXIS
            end_x, end_y = horner(piece.x, span), 0.0
        if (end_x - section) * (x - section) <= 0.0:
            span, ending = _root(piece.x, section, span), Ending.SECTION
            end_x, end_y = section, horner(piece.y, span)
        if ending is not Ending.NOWHERE:
            followed.append(Piece(piece.x, piece.y, piece.f, span))
            return Path(tuple(followed), ending, end_x, end_y)
        followed.append(piece)
        x, y = end_x, end_y
        if any(trap.depth(x, y) < 1.0 for trap in traps):
            return Path(tuple(followed), Ending.REST, x, y)
    return Path(tuple(followed), Ending.NOWHERE, x, y)


def cut_at(piece: Piece, section: float) -> float:
    """Return the time at which a piece crosses x = ``section``, between its beginning and its end."""
    return _root(piece.x, section, piece.span)


def _piece(flow: Flow, x: float, y: float, *, forward: bool) -> Piece:
    damping, force = flow.damping, flow.force
    highest = max(len(damping), len(force)) - 1
    xs, ys = [x], [y]
    powers: list[list[float]] = [xs, *([] for _ in range(highest - 1))]  # powers[j - 1] is the series of x^j
    fs: list[float] = []
    for k in range(ORDER):
        backward = xs[::-1]
        for j in range(1, highest):
            powers[j].append(sum(map(mul, powers[j - 1], backward)))
        f = sum(c * powers[j][k] for j, c in enumerate(damping[1:]))
        g = sum(c * powers[j][k] for j, c in enumerate(force[1:]))
        if k == 0:
            f, g = f + damping[0], g + force[0]
        fs.append(f)
        xs.append(ys[k] / (k + 1))
        ys.append((sum(map(mul, fs, reversed(ys))) + g) / (k + 1))
    span = _span(xs, ys)
    return Piece(tuple(xs), tuple(ys), tuple(fs), span if forward else -span)


def _span(xs: Sequence[float], ys: Sequence[float]) -> float:
    """Return the step after which the last two terms are below the tolerance, at most ``_LONGEST_S``."""
    # A state at the origin has no size of its own; what a second changes of it, times rounding, bounds it from below.
    change = sys.float_info.epsilon * max(abs(xs[1]), abs(ys[1]))
    small = _TOLERANCE * max(abs(xs[0]), abs(ys[0]), change)
    spans: list[float] = []
    for k in (ORDER - 1, ORDER):
        last = max(abs(xs[k]), abs(ys[k]))
        if not math.isfinite(last):
            return 0.0
        if last > 0.0:
            spans.append((small / last) ** (1.0 / k))
    return min((*spans, _LONGEST_S))


def _root(series: Sequence[float], level: float, span: float) -> float:
    """Return the time in a piece at which a series takes a value that lies between those at its ends."""

    def excess(time: float) -> float:
        return horner(series, time) - level

    if excess(0.0) == 0.0:
        return 0.0 if excess(span) != 0.0 else span
    if excess(0.0) * excess(span) > 0.0:  # by rounding only: the end was evaluated to lie on it
        return span
    tiny = 4.0 * math.ulp(1.0)
    xtol = max(tiny * abs(span), sys.float_info.min)
    return float(brentq(excess, min(0.0, span), max(0.0, span), xtol=xtol, rtol=tiny, maxiter=_ITERATIONS))
