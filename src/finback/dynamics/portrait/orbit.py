"""Orbits as polylines: followed until a figure shows nothing more of them, and cut to a box."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.cycle.flow_cycle import FlowCycle
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest
from finback.dynamics.orbit.taylor import Piece, pieces
from finback.dynamics.portrait.path import Box, Orbit, PathEnd

_SAMPLES: Final = 12  # of a piece, which is less than half a turn
_APART: Final = 2e-3  # of the box: points nearer to each other are not all kept
_AT_REST: Final = 4e-3  # of the box: so near to an equilibrium an orbit has come to it
_ON_CYCLE: Final = 3e-3  # of the box: the same of a cycle
_BEYOND: Final = 4.0  # boxes from the middle of the box: an orbit so far out is not followed farther
_SECANTS: Final = 5
_MOST_TURNS: Final = 25
_CLOSED: Final = 1e-6  # of the box: an orbit that turns again where it turned is closed
_LONGEST: Final = 300.0  # units of time of the flow as scaled


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """A flow in units in which the box is 2 wide and rates are near 1, with all that ends an orbit.

    Attributes:
        flow: the flow, in these units.
        box: the box, in these units.
        equilibria: all, in these units.
        cycles: x_min and x_max, and whether the cycle attracts, in these units.
        length: units of the given flow in a unit of length.
        time: the same of time.
    """

    flow: Flow
    box: Box
    equilibria: tuple[Rest, ...]
    cycles: tuple[tuple[float, float, bool], ...]
    length: float
    time: float

    def followed(self, start: tuple[float, float], *, forward: bool) -> Orbit:
        """Follow an orbit from a state in these units; the orbit is in units of the given flow."""
        points: list[tuple[float, float]] = [start]
        end, to_x, time = PathEnd.BOX, math.nan, 0.0
        turns: list[float] = []  # the places where y changes its sign
        for piece in pieces(self.flow, start, forward=forward):
            inside = _sampled(piece)
            points += inside
            state = inside[-1]
            time += abs(piece.span)
            turned = state[1] * piece.y[0] <= 0.0
            if turned:
                turns.append(_turn(piece))
            found = self._rest(state, forward=forward)
            if not math.isnan(found):
                end, to_x = PathEnd.REST, found
                break
            if turned and self._on_cycle(turns[-2:], forward=forward):
                end = PathEnd.CYCLE
                break
            closed = turned and len(turns) > 2 and abs(turns[-1] - turns[-3]) < 2.0 * _CLOSED
            if closed or len(turns) > 2 * _MOST_TURNS or time > _LONGEST:
                end = PathEnd.LONG
                break
            if self._is_gone(state):
                break
        return self.orbit(np.array(points), start, (end, to_x), forward=forward)

    def orbit(
        self, points: FloatArray, start: tuple[float, float], end: tuple[PathEnd, float], *, forward: bool
    ) -> Orbit:
        """Return a polyline, given in these units, as an orbit in units of the given flow."""
        unit = np.array([self.length, self.length / self.time])
        return Orbit(
            start=frozen_array(np.array(start) * unit),
            forward=forward,
            pieces=tuple(frozen_array(part * unit) for part in clipped(thinned(points), self.box)),
            end=end[0],
            to_x=end[1] * self.length,
        )

    def _rest(self, state: tuple[float, float], *, forward: bool) -> float:
        for point in self.equilibria:
            attracts = point.kind.stable if forward else _repels(point.kind)
            if attracts and math.hypot(state[0] - point.x, state[1]) < 2.0 * _AT_REST:
                return point.x
        return math.nan

    def _on_cycle(self, turns: Sequence[float], *, forward: bool) -> bool:
        if len(turns) < 2:
            return False
        low, high = sorted(turns)
        return any(
            stable == forward and max(abs(low - left), abs(high - right)) < 2.0 * _ON_CYCLE
            for left, right, stable in self.cycles
        )

    def _is_gone(self, state: tuple[float, float]) -> bool:
        box = self.box
        across = abs(state[0] - 0.5 * (box.x_low + box.x_high)) / (box.x_high - box.x_low)
        along = abs(state[1] - 0.5 * (box.y_low + box.y_high)) / (box.y_high - box.y_low)
        return max(across, along) > _BEYOND


def _repels(kind: Kind) -> bool:
    return kind in (Kind.UNSTABLE_FOCUS, Kind.UNSTABLE_NODE)


def stage_of(flow: Flow, box: Box, points: Sequence[Rest], cycles: Sequence[FlowCycle], rate: float) -> Stage:
    """Scale a flow to a box."""
    length, time = 0.5 * (box.x_high - box.x_low), 1.0 / rate
    speed = length / time
    return Stage(
        flow=flow.in_units(length, time),
        box=Box(
            x_low=box.x_low / length, x_high=box.x_high / length, y_low=box.y_low / speed, y_high=box.y_high / speed
        ),
        equilibria=tuple(Rest(x=p.x / length, kind=p.kind, eigenvalues_real=_scaled(p, time)) for p in points),
        cycles=tuple((cycle.x_min / length, cycle.x_max / length, cycle.stable) for cycle in cycles),
        length=length,
        time=time,
    )


def _scaled(point: Rest, time: float) -> tuple[float, float]:
    high, low = point.eigenvalues_real
    return high * time, low * time


def _sampled(piece: Piece) -> list[tuple[float, float]]:
    return [piece.at(piece.span * k / _SAMPLES) for k in range(1, _SAMPLES + 1)]


def _turn(piece: Piece) -> float:
    """Return x where y is zero in a piece: by the secant method, to what a figure can show of a closed orbit."""
    before, after = 0.0, piece.span
    low, high = piece.at(before)[1], piece.at(after)[1]
    for _ in range(_SECANTS):
        if high == low:
            break
        before, after = after, after - high * (after - before) / (high - low)
        low, high = high, piece.at(after)[1]
    return piece.at(after)[0]


def sampled(path: Sequence[Piece]) -> list[tuple[float, float]]:
    """Return points along a path, its end included, its start not."""
    return [point for piece in path for point in _sampled(piece)]


def thinned(points: FloatArray) -> FloatArray:
    """Return a polyline without points that crowd; first and last are kept."""
    kept = [0]
    for index in range(1, len(points) - 1):
        x, y = points[index] - points[kept[-1]]
        if math.hypot(x, y) > 2.0 * _APART:
            kept.append(index)
    return np.asarray(points[[*kept, len(points) - 1]] if len(points) > 1 else points)


def clipped(points: FloatArray, box: Box) -> list[FloatArray]:
    """Return the parts of a polyline inside a box, each cut at its edge."""
    parts: list[list[tuple[float, float]]] = [[]]
    for (x0, y0), (x1, y1) in zip(points[:-1].tolist(), points[1:].tolist(), strict=True):
        shares = _inside(x0, y0, x1 - x0, y1 - y0, box)
        if shares is None:
            continue
        # The ends themselves are taken as they are, so that neighboring chords stay joined.
        enter = (x0, y0) if shares[0] == 0.0 else (x0 + shares[0] * (x1 - x0), y0 + shares[0] * (y1 - y0))
        leave = (x1, y1) if shares[1] == 1.0 else (x0 + shares[1] * (x1 - x0), y0 + shares[1] * (y1 - y0))
        if not parts[-1] or parts[-1][-1] != enter:
            parts.append([enter])
        parts[-1].append(leave)
    return [np.array(part) for part in parts if len(part) > 1]


def _inside(x: float, y: float, run: float, rise: float, box: Box) -> tuple[float, float] | None:
    """Return between which shares a chord lies in the box (Liang & Barsky 1984); None if nowhere."""
    low, high = 0.0, 1.0
    for start, change, bounds in ((x, run, (box.x_low, box.x_high)), (y, rise, (box.y_low, box.y_high))):
        if change == 0.0:
            if not bounds[0] <= start <= bounds[1]:
                return None
            continue
        near, far = sorted(((bounds[0] - start) / change, (bounds[1] - start) / change))
        low, high = max(low, near), min(high, far)
    return (low, high) if low < high else None
