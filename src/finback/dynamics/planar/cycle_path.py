"""One cycle of a family of a planar system: where it crosses a ray at which parameter, and how that moves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.planar.carried import carried, radau_nodes
from finback.dynamics.planar.field import PlanarField
from finback.dynamics.planar.orbit import Limits, Line, PlanarEnding, PlanarOrbit, winding
from finback.dynamics.planar.system import PlanarScale, PlanarSystem
from finback.errors import RefusedError

_REACH: Final = 1.5  # times the box: an orbit that leaves it is not on a cycle that lies in the box
_NEWTON: Final = 12
_STILL: Final = 1e-13
_LONG: Final = 0.5  # of the range of the parameter: a step that leads nowhere
_CLOSED: Final = 1e-13  # of the place on the ray: a miss that rounding makes
_ROUNDING: Final = 1e-7  # of the place on the ray: a larger miss is more than that, however short the steps ...
_NEARLY: Final = 1e-4  # ... but where a unit in the last place of the parameter makes one; up to there
_SHRINKING: Final = 0.3  # of the last step: of Newton's method near its end, but for rounding
_STEEP: Final = 10.0  # ∫ divergence over a piece: beyond, a rule for smooth functions does not see its exponential
_CLOSE: Final = 1e-8  # relative: steps this short are near the end


@final
@dataclass(frozen=True, slots=True, eq=False)
class Turned:
    """One turn about the center, and how far it misses itself.

    Attributes:
        parameter: held.
        along: where it begins on the ray.
        center: the equilibrium inside.
        ray: from the center.
        field: at this parameter.
        orbit: the turn, in the direction of time in which orbits come nearer to each other.
        miss: by how much it misses itself on the ray.
        by_along: derivative of the miss by ``along``.
        by_parameter: the same by the parameter, the center moving along.
    """

    parameter: float
    along: float
    center: tuple[float, float]
    ray: Line
    field: PlanarField
    orbit: PlanarOrbit
    miss: float
    by_along: float
    by_parameter: float

    @property
    def log_multiplier(self) -> float:
        """∫ divergence dt forward in time."""
        return float(self.orbit.growth()[-1]) * math.copysign(1.0, self.orbit.duration)

    @property
    def grain(self) -> float:
        """How far the miss moves with one unit in the last place of the parameter, relative to the place on the ray."""
        return math.ulp(self.parameter) * abs(self.by_parameter) / self.along

    @property
    def plainness(self) -> float:
        """How plainly the field crosses the ray where the turn begins: 1 at a right angle."""
        p, q = self.field.flow.velocity(*self.ray.at(self.along))
        return abs(self.ray.normal[0] * p + self.ray.normal[1] * q) / math.hypot(p, q)


@final
class Shooting:
    """A system measured for the shooting of cycles.

    Args:
        system: the system.
        scale: its units.
        box: low and high of both states in these units, shape (2, 2).
        span: length of the range of the parameter.
    """

    def __init__(self, system: PlanarSystem, scale: PlanarScale, box: FloatArray, span: float) -> None:
        self.system, self.scale, self.box, self.span = system, scale, box, span
        name = system.variables[2]
        first, second = (curve.polynomial.derivative(name) for curve in (system.first, system.second))
        self._slope = PlanarSystem.from_polynomials(first, second)
        self._limits = Limits(np.zeros((0, 5)), _REACH * float(np.abs(box).max()))

    def field(self, parameter: float) -> PlanarField:
        """Return the field at a parameter."""
        return PlanarField.of(self.system.at(parameter, self.scale))

    def center(self, field: PlanarField, near: tuple[float, float]) -> tuple[float, float]:
        """Return the equilibrium near a place.

        Raises:
            RefusedError: Newton's method does not come to one.
        """
        x, y = near
        for _ in range(_NEWTON):
            jacobian = field.jacobian(x, y)
            if abs(np.linalg.det(jacobian)) < 1e-12:
                break
            u, v = np.linalg.solve(jacobian, field.flow.velocity(x, y)).tolist()
            x, y = x - u, y - v
            if abs(u) + abs(v) <= _STILL:
                return x, y
        raise RefusedError("the equilibrium inside a cycle is lost")

    def turn(self, parameter: float, along: float, like: Turned) -> Turned:
        """Follow one turn from a place on the ray of a neighbor, that has the same direction.

        Raises:
            RefusedError: it does not come round.
        """
        return self.turn_at(parameter, along, like.center, like.ray.direction, attracting=like.log_multiplier <= 0.0)

    def turn_at(
        self,
        parameter: float,
        along: float,
        near: tuple[float, float],
        direction: tuple[float, float],
        *,
        attracting: bool,
    ) -> Turned:
        """Follow one turn from a place on the ray in a direction from the equilibrium near a place."""
        field = self.field(parameter)
        center = self.center(field, near)
        ray = Line(center, direction, half=True)
        a, b = ray.normal
        p, q = field.flow.velocity(*ray.at(along))
        sense = 1 if a * p + b * q > 0.0 else -1
        for forward in (attracting, not attracting):
            orbit = winding(field, along, self._limits, forward=forward, line=ray, sense=sense if forward else -sense)
            if orbit.ending is PlanarEnding.SECTION and orbit.growth()[-1] < 1.0:
                return self._measured(parameter, along, field, ray, orbit)
        raise RefusedError("an orbit does not come round")

    def _measured(self, parameter: float, along: float, field: PlanarField, ray: Line, orbit: PlanarOrbit) -> Turned:
        center = ray.point
        slope = PlanarField.of(self._slope.at(parameter, self.scale))
        drift = -np.linalg.solve(field.jacobian(*center), slope.flow.velocity(*center))
        steepest = float(np.abs(orbit.series[:, 2, 0] * orbit.spans).max())
        growth = math.exp(float(orbit.growth()[-1]))
        if steepest < _STEEP:
            weight, x, y, exponent = orbit.nodes()
            decay = weight * np.exp(float(orbit.growth()[-1]) - exponent)
            pushed = float((decay * _wedge(field, slope, x, y)).sum())
        else:
            _, x, y, divergence = radau_nodes(orbit)
            source = _wedge(field, slope, x, y)[..., np.newaxis]
            pushed = float(carried(orbit.spans, divergence, source, np.zeros(1))[-1, -1, 0])
        landed = orbit.hits[-1].along
        (p0, q0), (p1, q1) = (field.flow.velocity(*ray.at(place)) for place in (along, landed))
        c, d = ray.direction
        before, after = p0 * d - q0 * c, p1 * d - q1 * c
        moved = growth * (p0 * drift[1] - q0 * drift[0]) + pushed - (p1 * drift[1] - q1 * drift[0])
        return Turned(
            parameter,
            along,
            center,
            ray,
            field,
            orbit,
            landed - along,
            growth * before / after - 1.0,
            float(moved) / after,
        )

    def on_ray(self, along: float, like: Turned) -> Turned:
        """Return the cycle through a place on the ray of a neighbor: Newton's method in the parameter.

        Raises:
            RefusedError: it does not converge.
        """
        parameter, last = like.parameter, math.inf
        for _ in range(_NEWTON):
            there = self.turn(parameter, along, like)
            step = -there.miss / there.by_parameter if there.by_parameter else math.inf
            size = abs(step) / self.span
            if _settled(there, size, last):
                return there
            if not size < _LONG:
                break
            parameter, last = parameter + step, size
        raise RefusedError("no cycle was found through a place")

    def corrected(self, along: float, parameter: float, tangent: tuple[float, float], like: Turned) -> Turned:
        """Return the cycle near a guess, at a right angle to a tangent (along, parameter as a share of the range).

        Raises:
            RefusedError: Newton's method does not converge.
        """
        last = math.inf
        for _ in range(_NEWTON):
            there = self.turn(parameter, along, like)
            a, b = there.by_along, there.by_parameter * self.span
            determinant = a * tangent[1] - b * tangent[0]
            if not determinant:
                break
            one, other = -there.miss * tangent[1] / determinant, there.miss * tangent[0] / determinant
            size = max(abs(one) / along, abs(other))
            if _settled(there, size, last):
                return there
            along, parameter, last = along + one, parameter + other * self.span, size
            if not (0.0 < along < self._limits.far and abs(one) + abs(other) < 1.0):
                break
        raise RefusedError("a family of cycles could not be followed")


def _settled(there: Turned, step: float, last: float) -> bool:
    """Tell whether Newton's method has done its work: the turn closes, or its steps no longer shrink."""
    near = abs(there.miss) / there.along
    rounding = min(_NEARLY, _ROUNDING + 4.0 * there.grain)
    return near <= _CLOSED or (near <= rounding and last <= _CLOSE and step >= _SHRINKING * last)


def _wedge(field: PlanarField, slope: PlanarField, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the wedge of the velocity with its derivative by the parameter, the shape of the states."""
    p, q = field.velocity(x, y)
    dp, dq = slope.velocity(x, y)
    return np.asarray(p * dq - q * dp)
