"""Closed orbits of a planar field: zeros of how far an orbit misses itself after one turn about an equilibrium."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np
from scipy.optimize import brentq

from finback.dynamics.equilibrium import Kind
from finback.dynamics.planar.field import along_line
from finback.dynamics.planar.orbit import Line, PlanarEnding, PlanarOrbit, winding
from finback.dynamics.planar.setting import PlanarSetting
from finback.dynamics.roots import real_roots
from finback.errors import RefusedError

_DIRECTIONS: Final = 24  # of the ray from an equilibrium; the one that the field crosses most plainly is taken
_EVEN: Final = 28  # places on a stretch of the ray that the field crosses in one sense
_NEAR: Final = 12  # more places towards the equilibrium, each so many times nearer:
_RATIO: Final = 0.4
_CLOSED: Final = 1e-7  # of the distance: a change of sign with a larger miss is a jump, no closed orbit
_STRAIGHT: Final = 1e-12  # relative: within it Newton's method has done its work
_NEWTON: Final = 8
_LOST: Final = 1e3
_SECTIONS: Final = 60
_GOLDEN: Final = 0.381966011250105
_NARROW: Final = 1e-7  # relative: nearer to its minimum a miss changes by less than rounding
_PERIOD: Final = 1e-7  # relative: by how much periods of one cycle, found twice, may differ


@final
@dataclass(frozen=True, slots=True, eq=False)
class ClosedOrbit:
    """A closed orbit.

    Attributes:
        ray: a half line from an equilibrium inside it.
        sense: of its crossing of the ray, forward in time: +1 counterclockwise.
        along: where it crosses the ray.
        orbit: once around, forward if it attracts, else backward in time.
        bracket: two places on the ray around it whose orbits miss themselves on opposite sides.
        residual: by how much it misses itself on the ray, as evaluated.
    """

    ray: Line
    sense: int
    along: float
    orbit: PlanarOrbit
    bracket: tuple[float, float]
    residual: float

    @property
    def log_multiplier(self) -> float:
        """∫ divergence dt over one period: negative if it attracts."""
        return float(self.orbit.growth()[-1]) * math.copysign(1.0, self.orbit.duration)


@final
@dataclass(frozen=True, slots=True, eq=False)
class ReturnMap:
    """The return map of a stretch of a ray on which the field crosses it in one sense.

    Attributes:
        setting: the field.
        ray: the ray.
        sense: of the crossing forward in time.
        low: one end of the stretch.
        high: the other.
    """

    setting: PlanarSetting
    ray: Line
    sense: int
    low: float
    high: float

    def turn(self, along: float, *, forward: bool) -> PlanarOrbit:
        """Follow the orbit that begins there once around the point of the ray."""
        sense = self.sense if forward else -self.sense
        limits = self.setting.limits(forward=forward)
        return winding(self.setting.field, along, limits, forward=forward, line=self.ray, sense=sense)

    def miss(self, along: float, *, forward: bool) -> float:
        """Return by how much an orbit misses itself on the ray; if it does not come round, how it went instead."""
        orbit = self.turn(along, forward=forward)
        if orbit.ending is PlanarEnding.SECTION:
            return orbit.hits[-1].along - along
        if orbit.ending is PlanarEnding.NOWHERE:
            return math.nan
        near = math.hypot(orbit.end[0] - self.ray.point[0], orbit.end[1] - self.ray.point[1])
        return -along if orbit.ending is PlanarEnding.TRAP and near < along else math.inf

    def outward(self, along: float) -> float:
        """Return the sign of the miss forward in time, from the orbit backward where the one forward is lost."""
        forward = self.miss(along, forward=True)
        if math.isfinite(forward):
            return forward / along
        backward = self.miss(along, forward=False)
        return -backward / along if math.isfinite(backward) else forward

    def closed(self, low: float, high: float) -> ClosedOrbit | None:
        """Return the closed orbit between two places whose orbits miss themselves on opposite sides, if it is one."""
        for forward in self._directions(low, high):

            def value(along: float, *, forward: bool = forward) -> float:
                found = self.miss(along, forward=forward)
                return min(found, _LOST) if not math.isnan(found) else _LOST

            before, after = value(low), value(high)
            if before * after > 0.0:
                continue
            along = float(brentq(value, low, high, xtol=1e-300, rtol=4.0 * math.ulp(1.0), maxiter=500))
            if abs(value(along)) <= _CLOSED * along:
                return self._polished(along, forward=forward)
        return None

    def _directions(self, low: float, high: float) -> tuple[bool, bool]:
        """Return first the direction of time in which the orbits come nearer to each other."""
        orbits = [self.turn(along, forward=True) for along in (low, high)]
        growth = [float(orbit.growth()[-1]) for orbit in orbits if orbit.ending is PlanarEnding.SECTION]
        forward = bool(growth) and sum(growth) < 0.0
        return forward, not forward

    def _polished(self, along: float, *, forward: bool) -> ClosedOrbit:
        orbit = self.turn(along, forward=forward)
        if orbit.growth()[-1] > 0.0:
            forward = not forward
        for _ in range(_NEWTON):
            orbit = self.turn(along, forward=forward)
            if orbit.ending is not PlanarEnding.SECTION:
                raise RefusedError("a closed orbit is lost when it is followed from a place a rounding apart")
            step = (orbit.hits[-1].along - along) / (1.0 - self._slope(along, orbit))
            if not abs(step) < 0.1 * along:
                break
            along += step
            if abs(step) <= _STRAIGHT * along:
                break
        orbit = self.turn(along, forward=forward)
        return ClosedOrbit(
            self.ray, self.sense, along, orbit, self._bracket(along, forward=forward), orbit.hits[-1].along - along
        )

    def _slope(self, along: float, orbit: PlanarOrbit) -> float:
        """Return the derivative of the return map at a place."""
        a, b = self.ray.normal
        flux = []
        for place in (along, orbit.hits[-1].along):
            p, q = self.setting.field.flow.velocity(*self.ray.at(place))
            flux.append(a * p + b * q)
        return math.exp(min(700.0, float(orbit.growth()[-1]))) * flux[0] / flux[1]

    def _bracket(self, along: float, *, forward: bool) -> tuple[float, float]:
        step = 8.0 * math.ulp(along)
        while step < along:
            low, high = along - step, along + step
            if self.miss(low, forward=forward) * self.miss(high, forward=forward) < 0.0:
                return low, high
            step *= 8.0
        raise RefusedError("a closed orbit was found, but no bracket of it: two nearly meet there")


def closed_orbits(setting: PlanarSetting) -> tuple[ClosedOrbit, ...]:
    """Find the closed orbits in the box, each once, by where they cross a ray from an equilibrium inside them.

    A closed orbit has an equilibrium that is no saddle inside it (Poincaré 1885), and crosses any ray from that. From
    each such equilibrium one ray is searched to the edge of the box: every change of the sign of the miss between 40
    places on each stretch that the field crosses in one sense, and two zeros between neighboring places if the miss
    has a minimum there.
    """
    found: list[ClosedOrbit] = []
    for stretch in (stretch for point in _centers(setting) for stretch in _stretches(setting, point)):
        for low, high in _sign_changes(stretch):
            orbit = stretch.closed(low, high)
            if orbit is None or not setting.holds(orbit.orbit.samples(8)):
                continue
            if not any(_same(orbit, other) for other in found):
                found.append(orbit)
    return tuple(found)


def _centers(setting: PlanarSetting) -> list[tuple[float, float]]:
    return [
        (float(x), float(y))
        for (x, y), kind in zip(setting.points, setting.kinds, strict=True)
        if kind is not Kind.SADDLE and setting.holds(np.array([x, y]))
    ]


def _stretches(setting: PlanarSetting, point: tuple[float, float]) -> Iterator[ReturnMap]:
    """Cut the best ray from a point where the field does not cross it."""
    _, ray, cuts = min(_rays(setting, point), key=lambda item: item[0])
    a, b = ray.normal
    for low, high in pairwise(cuts):
        p, q = setting.field.flow.velocity(*ray.at(0.5 * (low + high)))
        yield ReturnMap(setting, ray, 1 if a * p + b * q > 0.0 else -1, low, high)


def _rays(setting: PlanarSetting, point: tuple[float, float]) -> Iterator[tuple[tuple[int, float], Line, list[float]]]:
    others = np.array([p for p in setting.points if tuple(p) != point]).reshape(-1, 2) - point
    for k in range(_DIRECTIONS):
        angle = 2.0 * math.pi * k / _DIRECTIONS
        direction = (math.cos(angle), math.sin(angle))
        reach = min(
            (side - at) / step if step else math.inf
            for at, step, sides in zip(point, direction, setting.box, strict=True)
            for side in [sides[1] if step > 0.0 else sides[0]]
        )
        ray = Line(point, direction, half=True)
        a, b = ray.normal
        rows = [along_line(table, point, direction) for table in (setting.field.flow.first, setting.field.flow.second)]
        across = a * rows[0] + b * rows[1]
        across[0] = 0.0
        if not across.any():
            continue
        cuts = [root.value for root in real_roots(across.tolist()) if 1e-9 * reach < root.value < reach]
        turned = others @ np.array([[direction[0], a], [direction[1], b]])  # along the ray, across it
        clear = np.abs(turned[turned[:, 0] > 0.0, 1]).min(initial=1.0)
        yield (len(cuts), -float(clear)), ray, [0.0, *cuts, reach]


def _sign_changes(stretch: ReturnMap) -> Iterator[tuple[float, float]]:
    low, high = stretch.low, stretch.high
    width = high - low
    phases = math.pi * (np.arange(_EVEN) + 0.5) / _EVEN
    places = low + width * 0.5 * (1.0 - np.cos(phases))
    if low == 0.0:
        places = np.concatenate([places[0] * _RATIO ** np.arange(_NEAR, 0, -1), places])
    values = [(float(along), stretch.outward(float(along))) for along in places]
    for (left, before), (right, after) in pairwise(values):
        if before * after < 0.0:
            yield left, right
    for one, two, three in zip(values, values[1:], values[2:], strict=False):
        signs = {math.copysign(1.0, value) for _, value in (one, two, three)}
        if len(signs) == 1 and abs(two[1]) <= min(abs(one[1]), abs(three[1])) and math.isfinite(two[1]):
            yield from _dip(stretch.outward, one, two, three)


def _dip(
    value: Callable[[float], float], one: tuple[float, float], two: tuple[float, float], three: tuple[float, float]
) -> Iterator[tuple[float, float]]:
    """Look whether the miss reaches the other sign at its smallest between three places."""
    sign = math.copysign(1.0, two[1])
    low, middle, high = one[0], two[0], three[0]
    least = abs(two[1])
    for _ in range(_SECTIONS):  # golden section; values may be infinite, where an orbit is lost
        right = high - middle > middle - low
        trial = middle + _GOLDEN * (high - middle if right else low - middle)
        value_there = sign * value(trial)
        if value_there < 0.0:
            yield one[0], trial
            yield trial, three[0]
            return
        if value_there < least:
            low, high = (middle, high) if right else (low, middle)
            middle, least = trial, value_there
        else:
            low, high = (low, trial) if right else (trial, high)
        if high - low < _NARROW * middle:
            return


def _same(one: ClosedOrbit, other: ClosedOrbit) -> bool:
    """Tell whether orbits found on the rays of two equilibria are one; on one ray they never are."""
    if one.ray == other.ray or one.log_multiplier * other.log_multiplier < 0.0:
        return False
    (low, high), (lower, higher) = ((s.min(axis=0), s.max(axis=0)) for s in (o.orbit.samples(32) for o in (one, other)))
    # The extremes of so many samples lie less than 1e-3 of the size inside the true ones.
    slack = 2e-3 * (high - low)
    if (np.abs(low - lower) > slack).any() or (np.abs(high - higher) > slack).any():
        return False
    period, another = abs(one.orbit.duration), abs(other.orbit.duration)
    return abs(period - another) < _PERIOD * period
