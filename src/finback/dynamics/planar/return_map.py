"""How far an orbit of a planar field misses itself after one turn about an equilibrium, and where it does not."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.dynamics.planar.orbit import Line, PlanarEnding, PlanarOrbit, winding
from finback.dynamics.planar.setting import PlanarSetting
from finback.dynamics.zero import zero_between
from finback.errors import RefusedError

_CLOSED: Final = 1e-7  # of the distance: a change of sign with a larger miss is a jump, no closed orbit
_STRAIGHT: Final = 1e-12  # relative: within it Newton's method has done its work
_NEWTON: Final = 8
_LOST: Final = 1e3
_ROUNDINGS: Final = 8.0  # in each piece of an orbit: of its series, and of the coefficients of the field
_GREATEST: Final = 600.0  # its exponential is still a number, and so is what is made of it


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
@dataclass(frozen=True, slots=True)
class Tried:
    """What became of an orbit that begins on a ray.

    Attributes:
        along: where it begins.
        outward: how far it misses itself forward in time, relative to that; 0 within rounding, infinite if it is lost.
        miss: the same as computed, nan if it does not come round.
        period: the time of the turn.
    """

    along: float
    outward: float
    miss: float
    period: float


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
        edge: where the ray leaves the box.
        around: how many times the box orbits may reach.
    """

    setting: PlanarSetting
    ray: Line
    sense: int
    low: float
    high: float
    edge: float
    around: float

    def turn(self, along: float, *, forward: bool) -> PlanarOrbit:
        """Follow the orbit that begins there once around the point of the ray."""
        sense = self.sense if forward else -self.sense
        limits = self.setting.limits(forward=forward, around=self.around)
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

    def tried(self, along: float) -> Tried:
        """Follow the orbit of a place once around, in the direction of time in which its neighbors come nearer."""
        orbits = []
        for forward in (True, False):
            orbit = self.turn(along, forward=forward)
            if orbit.ending is PlanarEnding.SECTION:
                orbits.append((float(orbit.growth()[-1]), 1.0 if forward else -1.0, orbit))
                if orbits[-1][0] <= 0.0:
                    break
        if not orbits:
            return Tried(along, self.miss(along, forward=True), math.nan, math.nan)
        _, sign, orbit = min(orbits, key=lambda item: item[0])
        miss = sign * (orbit.hits[-1].along - along)
        known = abs(miss) > self._rounding(along, orbit)
        return Tried(along, miss / along if known else 0.0, miss / along, abs(orbit.duration))

    def outward(self, along: float) -> float:
        """Return the miss forward in time over the place, 0 within rounding; from the orbit backward if need be."""
        return self.tried(along).outward

    def _rounding(self, along: float, orbit: PlanarOrbit) -> float:
        """Bound what rounding has made of a miss.

        Each piece moves the state by some units of its last place, and the field by as much of all its terms; the wedge
        of that with the velocity grows by ∫ divergence up to the end, where the flux through the ray divides it.
        """
        field, growth = self.setting.field, orbit.growth()
        x, y = orbit.series[:, :2, 0].T
        terms, rates = field.sizes(x, y), np.abs(orbit.series[:, :2, 1])
        shifts = np.abs(orbit.spans) * terms + np.maximum(np.abs(x), np.abs(y))
        grown = np.exp(np.minimum(growth[-1] - growth[:-1], _GREATEST))
        wedge = float((grown * (rates[:, 0] * shifts[1] + rates[:, 1] * shifts[0])).sum())
        a, b = self.ray.normal
        p, q = field.flow.velocity(*self.ray.at(orbit.hits[-1].along))
        flux = abs(a * p + b * q) or math.inf
        own = along + abs(self.ray.point[0]) + abs(self.ray.point[1])
        return _ROUNDINGS * math.ulp(1.0) * (own + wedge / flux)

    def closed(self, low: float, high: float) -> ClosedOrbit | None:
        """Return the closed orbit between two places whose orbits miss themselves on opposite sides, if it is one."""
        for forward in self._directions(low, high):

            def value(along: float, *, forward: bool = forward) -> float:
                found = self.miss(along, forward=forward)
                return min(found, _LOST) if not math.isnan(found) else _LOST

            along = zero_between(value, low, high)
            if not math.isnan(along) and abs(value(along)) <= _CLOSED * along:
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
        along, orbit = self.settled(along, forward=forward)
        return ClosedOrbit(
            self.ray, self.sense, along, orbit, self._bracket(along, forward=forward), orbit.hits[-1].along - along
        )

    def settled(self, along: float, *, forward: bool) -> tuple[float, PlanarOrbit]:
        """Return where Newton's method ends that begins at a place, and the orbit from there.

        Raises:
            RefusedError: an orbit on the way does not come round.
        """
        for _ in range(_NEWTON):
            orbit = self.turn(along, forward=forward)
            if orbit.ending is not PlanarEnding.SECTION:
                raise RefusedError("a closed orbit is lost when it is followed from a place a rounding apart")
            slope = 1.0 - self._slope(along, orbit)
            step = (orbit.hits[-1].along - along) / slope if slope else math.inf
            if not abs(step) < 0.1 * along:
                break
            along += step
            if abs(step) <= _STRAIGHT * along:
                break
        return along, self.turn(along, forward=forward)

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
