"""A cycle followed as the elevator moves: where it is, and the step from one to the next.

A cycle is named by how far it turns between the equilibrium on its inner side and the saddle on its outer side, on the
side where it comes nearer to a saddle: w = log(r/s) with r and s the two distances; or by −log of the speed at which it
passes a saddle inside it. w runs from −∞ at a focus to ∞ at a loop, and keeps its digits at both ends. Steps are of
pseudo-arclength in (w, elevator), so that neither need rise all along.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, final

from finback.dynamics.flow import Flow, Scale, derivative, flow_at, horner
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.orbit.annulus import poles
from finback.dynamics.orbit.closure import Chart, Probe, Way, field_at, miss_by_p, probe, speed_at
from finback.errors import RefusedError

WEIGHT: Final = 12.0
"""How many units of w the whole elevator range counts for."""

_ITERATIONS: Final = 12
_SURE_W: Final = 1e-10
_SURE: Final = 1e-14  # of the elevator range
_GRAIN: Final = 4e-15  # of the size of a cycle: a miss that is rounding
_DIFFERENCE: Final = 1e-6  # of the elevator range: for the first derivative by the elevator; later steps give it
_NEWTON: Final = 6
_SAME: Final = 1e-9
_MOVED: Final = 0.3  # of the distance to its neighbor: an equilibrium that moves more in a step is another


@final
@dataclass(frozen=True, slots=True)
class Frame:
    """The equilibria next to a cycle: where it turns on the side that names it, then on the other.

    Attributes:
        inner: the last one inside, on the naming side.
        outer: the saddle beyond, or infinite.
        far_inner: the same on the other side.
        far_outer: the same.
        mirrored: whether the naming side is the left.
        over: a saddle inside by whose distance the cycle is named instead, nan if by where it turns: it passes below
            that saddle, or, mirrored, above.
        inside: all equilibria inside; where the frame was followed to a neighboring flow, those of before.
    """

    inner: float
    outer: float
    far_inner: float
    far_outer: float
    mirrored: bool
    over: float
    inside: tuple[float, ...]

    def alike(self, other: Frame) -> bool:
        """Tell whether both name by the same side and the same kind of place."""
        return self.mirrored is other.mirrored and math.isnan(self.over) is math.isnan(other.over)

    def same(self, other: Frame) -> bool:
        """Tell whether both are made of the same equilibria, as near as these are known."""
        pairs = zip(self.places, other.places, strict=True)
        return self.alike(other) and all(a == b or abs(a - b) <= _SAME * (1.0 + abs(a)) for a, b in pairs)

    @property
    def places(self) -> tuple[float, ...]:
        """The equilibria that the name depends on."""
        return (self.inner, self.outer, self.far_outer, 0.0 if math.isnan(self.over) else self.over)


@final
@dataclass(frozen=True, slots=True)
class Spot:
    """A cycle at an elevator.

    Attributes:
        frame: the equilibria beside it, at this elevator.
        w: its name.
        elevator_rad: the elevator.
        chart: the chart in which it was found.
        p: its place in the chart.
        found: the orbit.
        by_w: d(miss)/dw, over the size of the cycle.
        by_elevator: d(miss)/d(elevator) at a held w, over the size of the cycle; from the steps that led here.
    """

    frame: Frame
    w: float
    elevator_rad: float
    chart: Chart
    p: float
    found: Probe
    by_w: float
    by_elevator: float

    @property
    def growth(self) -> float:
        """The logarithm of the multiplier."""
        return self.found.dampings[0] - self.found.dampings[1]

    @property
    def turns(self) -> tuple[float, float]:
        """Where it turns: x_min and x_max."""
        field = self.chart.field
        low, high = sorted((field.x_of(self.found.ahead), field.x_of(self.found.right)))
        return low, high

    @property
    def miss(self) -> float:
        """By how much it does not close, over its size."""
        return self.found.miss / (self.found.right - self.found.ahead)


@final
@dataclass(frozen=True, slots=True)
class Track:
    """What stays the same along a family.

    Attributes:
        system: the system.
        scale: units of the flows.
        elevator_range_rad: where it is followed.
        reach: a length by which orbits without a saddle beside them are named.
    """

    system: LienardSystem
    scale: Scale
    elevator_range_rad: tuple[float, float]
    reach: float

    @property
    def span(self) -> float:
        """The length of the elevator range."""
        return self.elevator_range_rad[1] - self.elevator_range_rad[0]

    def flow(self, elevator_rad: float) -> Flow:
        """Return the flow at an elevator."""
        return flow_at(self.system, elevator_rad, self.scale)

    def equilibria(self, elevator_rad: float) -> tuple[float, ...]:
        """Return all equilibria at an elevator."""
        return tuple(pole.x for pole in poles(self.flow(elevator_rad)))

    def frames(self, elevator_rad: float, turns: tuple[float, float]) -> tuple[Frame, ...]:
        """Return the ways to name a cycle that turns at ``turns``: by the right turn, the left, and saddles inside.

        Raises:
            RefusedError: two equilibria meet within rounding, or none is inside.
        """
        places = self.equilibria(elevator_rad)
        inside = tuple(x for x in places if turns[0] < x < turns[1])
        if not inside:
            raise RefusedError("a cycle lost the equilibria inside it")
        below = max((x for x in places if x <= turns[0]), default=-math.inf)
        above = min((x for x in places if x >= turns[1]), default=math.inf)
        right, left = (inside[-1], above), (inside[0], below)
        sides = (Frame(*right, *left, False, math.nan, inside), Frame(*left, *right, True, math.nan, inside))
        return (*sides, *(replace(side, over=saddle) for saddle in inside[1::2] for side in sides))

    def name(self, frame: Frame, turns: tuple[float, float], begin: Spot | None) -> float:
        """Return w of a cycle in a frame; −inf if it cannot be told.

        Args:
            frame: the frame.
            turns: where the cycle turns.
            begin: the cycle, named in some other frame; needed to name it by a saddle inside.
        """
        if not math.isnan(frame.over):
            return -math.inf if begin is None else self._name_over(frame, begin)
        turn = turns[0] if frame.mirrored else turns[1]
        r, s = abs(turn - frame.inner), abs(frame.outer - turn)
        return math.log(r / self.reach) if math.isinf(s) else math.log(r / s)

    def _name_over(self, frame: Frame, begin: Spot) -> float:
        """Return −log of the speed at which a cycle passes a saddle."""
        field = begin.chart.field
        # In the mirror an arc above is one below; from the right end of the field the orbit below is ahead.
        forward = frame.mirrored is field.mirrored
        speed = abs(speed_at(field, begin.found.right, field.u_of(frame.over), forward=forward))
        return -math.log(speed / self.reach) if speed > 0.0 else -math.inf

    def at(self, frame: Frame, w: float, elevator_rad: float, by_elevator: float) -> Spot | None:
        """Follow the orbit named w at an elevator; None if it does not turn in the cells of the chart."""
        flow = self.flow(elevator_rad)
        moved = _moved(flow, frame)
        if moved is None:
            return None
        chart, p, by_w = self._chart(flow, moved, w)
        found = probe(chart, p, 0.0)
        if not (math.isfinite(found.miss) and chart.holds(found)):
            return None
        slope = miss_by_p(chart, p, found) * by_w / (found.right - found.ahead)
        return Spot(moved, w, elevator_rad, chart, p, found, slope, by_elevator)

    def _chart(self, flow: Flow, frame: Frame, w: float) -> tuple[Chart, float, float]:
        """Return the chart, p and dp/dw of an orbit."""
        rate = math.sqrt(abs(horner(derivative(flow.force), frame.inner)))
        total = abs(frame.outer - frame.inner)
        if not math.isnan(frame.over):
            way, origin, p, by_w = Way.OVER_SADDLE, frame.over, math.log(self.reach) - w, -1.0
        elif math.isinf(total):
            way, origin, p, by_w = Way.FROM_FOCUS, frame.inner, w + math.log(self.reach), 1.0
        elif w <= 0.0:
            way, origin = Way.FROM_FOCUS, frame.inner
            p, by_w = math.log(total) - math.log1p(math.exp(-w)), 1.0 / (1.0 + math.exp(w))
        else:
            way, origin = Way.TO_SADDLE, frame.outer
            p, by_w = math.log1p(math.exp(w)) - math.log(total), 1.0 / (1.0 + math.exp(-w))
        field = field_at(flow, origin, mirrored=frame.mirrored)
        left = sorted((field.u_of(frame.far_outer), field.u_of(frame.far_inner)))
        right = sorted((field.u_of(frame.inner), field.u_of(frame.outer)))
        return Chart(field, way, (left[0], left[1]), (right[0], right[1]), rate), p, by_w

    def tangent(self, spot: Spot) -> tuple[float, float]:
        """Return the direction in which a family goes on, in w and the weighted elevator, of unit length."""
        by_elevator = self._difference(spot) if math.isnan(spot.by_elevator) else spot.by_elevator
        along = by_elevator * self.span / WEIGHT, -spot.by_w
        size = math.hypot(*along)
        return (along[0] / size, along[1] / size) if size > 0.0 and math.isfinite(size) else (1.0, 0.0)

    def on_elevator(self, begin: Spot, frame: Frame, w: float, elevator_rad: float) -> Spot | None:
        """Solve for w at a held elevator."""
        spot = self.at(frame, w, elevator_rad, begin.by_elevator)
        for _ in range(_ITERATIONS):
            if spot is None or abs(spot.miss) <= _GRAIN:
                return spot
            change = -spot.miss / spot.by_w if spot.by_w else math.inf
            if abs(change) > 2.0:
                return None
            if abs(change) <= _SURE_W:
                return spot
            spot = self.at(spot.frame, spot.w + change, elevator_rad, begin.by_elevator)
        return None

    def on_name(self, begin: Spot, w: float) -> Spot | None:
        """Solve for the elevator at a held w."""
        return self.solve(begin, (w, begin.elevator_rad), (1.0, 0.0))

    def solve(self, begin: Spot, target: tuple[float, float], normal: tuple[float, float]) -> Spot | None:
        """Solve for the cycle on the line through ``target`` (w, elevator) across ``normal`` (w, weighted elevator)."""
        scale = WEIGHT / self.span
        spot = self.at(begin.frame, target[0], target[1], begin.by_elevator)
        by_elevator = begin.by_elevator
        for _ in range(_ITERATIONS):
            if spot is None:
                return None
            if math.isnan(by_elevator):
                by_elevator = self._difference(spot)
            # Newton: miss = 0 along the line.
            determinant = spot.by_w * normal[1] * scale - by_elevator * normal[0]
            off = normal[0] * (spot.w - target[0]) + normal[1] * scale * (spot.elevator_rad - target[1])
            if not (determinant and math.isfinite(determinant)):
                return None
            by = -(spot.miss * normal[1] * scale - by_elevator * off) / determinant
            change = -(spot.by_w * off - spot.miss * normal[0]) / determinant
            if abs(by) <= _SURE_W and (abs(change) <= _SURE * self.span or abs(spot.miss) <= _GRAIN):
                return replace(spot, by_elevator=by_elevator)
            following = self.at(spot.frame, spot.w + by, spot.elevator_rad + change, by_elevator)
            if following is not None and abs(change) > 1e-9 * self.span:
                linear = 0.5 * (spot.by_w + following.by_w) * by
                by_elevator = (following.miss - spot.miss - linear) / change
            spot = following
        return None

    def _difference(self, spot: Spot) -> float:
        step = _DIFFERENCE * self.span
        beside = self.at(spot.frame, spot.w, spot.elevator_rad + step, math.nan)
        return math.nan if beside is None else (beside.miss - spot.miss) / step


def _moved(flow: Flow, frame: Frame) -> Frame | None:
    """Follow the equilibria of a frame to a neighboring flow, by Newton's method; None if one is lost."""
    slope = derivative(flow.force)
    places = []
    for begin, neighbor in (
        (frame.inner, frame.outer),
        (frame.outer, frame.inner),
        (frame.far_inner, frame.far_outer),
        (frame.far_outer, frame.far_inner),
        (frame.over, frame.inner),
    ):
        x = begin
        if math.isfinite(x):
            saddle = horner(slope, x) > 0.0
            for _ in range(_NEWTON):
                steepness = horner(slope, x)
                change = -horner(flow.force, x) / steepness if steepness else math.inf
                x += change
                if abs(change) <= 1e-15 * max(abs(x), abs(begin - neighbor) if math.isfinite(neighbor) else 0.0):
                    break
            lost = not math.isfinite(x) or (horner(slope, x) > 0.0) != saddle
            if lost or (math.isfinite(neighbor) and abs(x - begin) > _MOVED * abs(begin - neighbor)):
                return None
        places.append(x)
    inner, outer, far_inner, far_outer, over = places
    return replace(frame, inner=inner, outer=outer, far_inner=far_inner, far_outer=far_outer, over=over)
