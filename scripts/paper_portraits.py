"""Phase portraits with chosen orbits, and with as few turns as a printed figure bears."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.flow import Flow, rests
from finback.dynamics.orbit.taylor import Piece, pieces
from finback.dynamics.portrait.path import Box, Orbit, PathEnd, Portrait
from finback.dynamics.portrait.portrait import phase_portrait

PER_PIECE: Final = 8
"""Points drawn of each step of the integration."""
BESIDE: Final = 0.1
"""Of the box: how far beyond it lines are kept, where the picture cuts them."""
MOST_PIECES: Final = 200
MOST_TURNS: Final = 7
"""Half turns that are drawn of an orbit, one way, if nothing else is said."""
MOST_BRANCH_TURNS: Final = 5
"""The same of a branch of a manifold."""
CLOSED: Final = 8e-3
"""Of the box: so near to its start a line is taken for closed; no orbit drawn here spirals so slowly."""
AT_REST: Final = 2e-3
"""Of the box: so near to an equilibrium a line has arrived."""


def portrait_of(
    flow: Flow, box: Box, starts: Sequence[tuple[float, float]], *, most_turns: int = MOST_TURNS
) -> Portrait:
    """Return a portrait with the orbits through these states instead of those that were chosen by themselves."""
    whole = phase_portrait(flow, box)
    branches = (replace(branch, orbit=_shortened(branch.orbit)) for branch in whole.separatrices)
    chosen = (through(flow, box, start, most_turns=most_turns) for start in starts)
    return replace(whole, separatrices=tuple(branches), orbits=tuple(chosen))


def through(flow: Flow, box: Box, start: tuple[float, float], *, most_turns: int = MOST_TURNS) -> Orbit:
    """Return the orbit through a state: its past and its future in one line, in the direction of time."""
    future, end = _followed(flow, box, start, forward=True, most_turns=most_turns)
    past, _ = _followed(flow, box, start, forward=False, most_turns=most_turns)
    whole = future if end is PathEnd.CYCLE else np.concatenate([past[::-1], future[1:]])
    return Orbit(start=whole[0], forward=True, pieces=_inside(whole, box), end=end, to_x=math.nan)


def future_of(flow: Flow, box: Box, start: tuple[float, float]) -> Orbit:
    """Return the orbit from a state on."""
    line, end = _followed(flow, box, start, forward=True, most_turns=MOST_TURNS)
    return Orbit(start=line[0], forward=True, pieces=_inside(line, box), end=end, to_x=math.nan)


def _shortened(orbit: Orbit) -> Orbit:
    """Return an orbit without the turns that are too many."""
    kept, turned = [], 0
    for piece in orbit.pieces:
        turns = turned + np.concatenate([[0], np.cumsum(np.diff(np.sign(piece[:, 1])) != 0.0)])
        kept.append(piece[turns <= MOST_BRANCH_TURNS])
        turned = int(turns[-1])
    return replace(orbit, pieces=tuple(piece for piece in kept if len(piece) > 1))


def _followed(
    flow: Flow, box: Box, start: tuple[float, float], *, forward: bool, most_turns: int
) -> tuple[FloatArray, PathEnd]:
    """Return the points of an orbit and how it ends: far outside, at an equilibrium, closed, or drawn long."""
    size = np.array([box.x_high - box.x_low, box.y_high - box.y_low])
    middle = 0.5 * np.array([box.x_high + box.x_low, box.y_high + box.y_low])
    places = np.array([[point.x, 0.0] for point in rests(flow)])
    points = [np.array([start])]
    turned = 0
    for piece in islice(pieces(flow, start, forward=forward), MOST_PIECES):
        points.append(_sampled(piece))
        last, before = points[-1][-1], points[-2][-1]
        turned += int(before[1] * last[1] < 0.0)
        gap = np.abs((points[-1] - points[0]) / size).max(axis=1)
        if turned and gap.min() < CLOSED:
            points[-1] = np.concatenate([points[-1][: int(gap.argmin()) + 1], points[0]])
            return np.concatenate(points), PathEnd.CYCLE
        if (np.abs(last - middle) > 2.0 * size).any():
            return np.concatenate(points), PathEnd.BOX
        if len(places) and (np.hypot(*((places - last) / size).T) < AT_REST).any():
            return np.concatenate(points), PathEnd.REST
        if turned > most_turns:
            break
    return np.concatenate(points), PathEnd.LONG


def _sampled(piece: Piece) -> FloatArray:
    times = piece.span * np.arange(1, PER_PIECE + 1) / PER_PIECE
    return np.column_stack([np.polynomial.polynomial.polyval(times, row) for row in (piece.x, piece.y)])


def _inside(line: FloatArray, box: Box) -> tuple[FloatArray, ...]:
    """Return the parts of a line within the box and a little beyond."""
    beside = BESIDE * np.array([box.x_high - box.x_low, box.y_high - box.y_low])
    low, high = np.array([box.x_low, box.y_low]) - beside, np.array([box.x_high, box.y_high]) + beside
    shown = np.all((low <= line) & (line <= high), axis=1)
    parts = np.split(np.arange(len(line)), np.flatnonzero(np.diff(shown)) + 1)
    # One point beyond each end, so that the picture's edge cuts the line, not its last point.
    kept = [part for part in parts if shown[part[0]]]
    return tuple(line[max(0, part[0] - 1) : part[-1] + 2] for part in kept if part.size > 1)
