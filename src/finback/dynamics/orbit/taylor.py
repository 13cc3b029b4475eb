"""Orbits of a Liénard flow by their Taylor series in time: each step as long as its series allows.

The recursion is the classical one (Jorba & Zou, "A software package for the numerical integration of ODEs by means
of high-order Taylor methods", Experimental Mathematics 14, 2005); the step is such that the last terms fall below
rounding. Every piece keeps its series, so an event inside it is a root of a polynomial.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.flow import Flow, horner
from finback.dynamics.orbit.taylor_kernel import (
    AT_REST,
    ESCAPED,
    ON_AXIS,
    ON_SECTION,
    ORDER,
    OUT_OF_STEPS,
    expand,
    travel,
)

LONGEST: Final = 100.0  # where the series is (nearly) exact, a step as long as it holds would end beyond everything
_LONGEST_PIECE: Final = 1.0  # the same, of a piece that is to be drawn or measured
MOST_PIECES: Final = 4000  # an orbit between two saddles has 10 to 60, one that creeps into a node some hundred
_FAR: Final = 1e9  # in units of the flow: beyond it an orbit has blown up


class Ending(StrEnum):
    """How a path ends."""

    SECTION = "section"
    """it reached the vertical line it was to reach"""
    AXIS = "axis"
    """it turned: y became 0 first"""
    REST = "rest"
    """it came so near to an equilibrium that it no longer moves in double precision"""
    AWAY = "away"
    """it went where every force pushes it on outward, or blew up"""
    NOWHERE = "nowhere"
    """it came to none of these within the steps allowed"""


ENDINGS: Final = {
    ON_SECTION: Ending.SECTION,
    ON_AXIS: Ending.AXIS,
    AT_REST: Ending.REST,
    ESCAPED: Ending.AWAY,
    OUT_OF_STEPS: Ending.NOWHERE,
}


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
    damping, force = np.array(flow.damping), np.array(flow.force)
    table = blank_table(flow)
    x, y = start
    for _ in range(MOST_PIECES):
        table[0, 0], table[1, 0] = x, y
        span = min(expand(damping, force, table), _LONGEST_PIECE)
        if not span:
            return
        piece = _piece(table, span if forward else -span)
        x, y = piece.at(piece.span)
        if not (abs(x) < _FAR and abs(y) < _FAR):
            return
        yield piece


def follow(flow: Flow, start: tuple[float, float], *, forward: bool, section: float, turns: int = 1) -> Path:
    """Follow an orbit to the line x = ``section`` or through so many zeros of y, whichever comes first.

    Between two zeros of y the orbit moves in one direction, so nothing is missed: a step is shorter than half a turn.
    """
    state = np.array([*start, 1.0 if forward else -1.0, 0.0, 0.0, 0.0, 0.0])
    limits = np.array([section, LONGEST, MOST_PIECES, 0.0])
    record = np.empty((MOST_PIECES, 4, ORDER + 1))
    ending = travel(np.array(flow.damping), np.array(flow.force), state, limits, np.empty(turns), record)
    followed = tuple(_piece(row, float(row[3, 0])) for row in record[: int(state[6])])
    return Path(followed, ENDINGS[ending], float(state[0]), float(state[1]))


def blank_table(flow: Flow) -> FloatArray:
    """Return room for the series of x, y, f and the powers of x."""
    return np.zeros((max(len(flow.damping), len(flow.force), 2) + 2, ORDER + 1))


def _piece(table: FloatArray, span: float) -> Piece:
    x, y, f = table[0].tolist(), table[1].tolist(), table[2, :-1].tolist()
    return Piece(tuple(x), tuple(y), tuple(f), span)
