"""Integrals of y, x y and x² y along the closed level curves of the cubic Hamiltonian (Shi & Fan 2013, Eq. 21-31).

With damping small of order ε the orbits of a cubic system stay near level curves of H = y²/2 + V(x), and a closed one
survives where the energy gained along it vanishes: a0 I0 + a1 I1 + a2 I2 = 0. All of this is first order in ε.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Final, final

import numpy as np
from scipy.optimize import brentq

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.normal_form.cubic import Cubic, outer_roots
from finback.errors import InputError, RefusedError

_COARSEST: Final = 1.0 / 8.0
_FINEST: Final = 1.0 / 1024.0
_REACH: Final = 4.2  # of the nodes: the outermost lies 1e-45 of the interval from its end
_ENOUGH: Final = 1e-14  # relative difference of two rules at which the finer one is at rounding
_RTOL: Final = 4.0 * float(np.finfo(np.float64).eps)


class RingKind(StrEnum):
    """A family of nested closed level curves."""

    BETWEEN_SADDLES = "between-saddles"
    """around the origin, up to the loop at the lower saddle; b2 > 0"""
    LEFT_WELL = "left-well"
    RIGHT_WELL = "right-well"
    OUTER = "outer"
    """around both wells, from the figure-eight outward"""
    SINGLE_WELL = "single-well"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Ring:
    """One family of closed level curves of H = y²/2 + quadratic u²/2 + cubic u³/3 + quartic u⁴/4, u = x − origin.

    Attributes:
        kind: which one.
        origin: the center inside it; for the outer ring the saddle.
        quadratic: c in the paper's notation; below 0 for the outer ring.
        cubic: b.
        quartic: a.
        top: the level of the outermost curve, measured from H at ``origin``; infinite where there is none.
        left: u from which the left turning points lie outward (outer ring), or beyond which none lie.
        right: the same on the right.
    """

    kind: RingKind
    origin: float
    quadratic: float
    cubic: float
    quartic: float
    top: float
    left: float
    right: float

    def potential(self, u: float) -> float:
        """Return V(u)."""
        return u * u * (0.5 * self.quadratic + u * (self.cubic / 3.0 + u * 0.25 * self.quartic))

    @property
    def saddles(self) -> tuple[float, ...]:
        """The saddles on the loop that bounds the ring, as u; none for a single well, two for a two-saddle cycle."""
        if self.kind is RingKind.SINGLE_WELL:
            return ()
        if self.kind is RingKind.OUTER:
            return (0.0,)
        walls = tuple(u for u in (self.left, self.right) if math.isfinite(u))
        return tuple(u for u in walls if self.kind is not RingKind.BETWEEN_SADDLES or self.potential(u) <= self.top)

    @property
    def size(self) -> float:
        """A level at which the quartic matters: the top, or the largest of what the coefficients make."""
        if math.isfinite(self.top):
            return self.top
        a = abs(self.quartic)
        return max(self.quadratic**2 / a, self.cubic**4 / a**3)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LevelIntegrals:
    """∮ u^k y dx (k = 0, 1, 2) once around a level curve, clockwise, and their derivatives ∮ u^k / y dx by the level.

    Attributes:
        level: H − H(origin).
        x_min: leftmost point of the curve.
        x_max: rightmost point.
        integrals: I0, I1, I2 about the ring's origin, shape (3,).
        slopes: dI0/ds (the period of the undamped motion), dI1/ds, dI2/ds, shape (3,); infinite at a saddle.
        error: bound of the error of ``integrals`` over I0 times the powers of the curve's width, as two rules differ.
    """

    level: float
    x_min: float
    x_max: float
    integrals: FloatArray
    slopes: FloatArray
    error: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("integrals", "slopes"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))

    @property
    def P(self) -> float:  # noqa: N802 - the paper's name
        """I1/I0 about the ring's origin."""
        return float(self.integrals[1] / self.integrals[0])

    @property
    def Q(self) -> float:  # noqa: N802 - the paper's name
        """I2/I0 about the ring's origin."""
        return float(self.integrals[2] / self.integrals[0])


def rings(cubic: Cubic) -> tuple[Ring, ...]:
    """Return all families of closed level curves of the undamped system, from left to right, the outer one last.

    The origin must be the middle one of three equilibria, or the only one.

    Raises:
        RefusedError: b2 is zero, or there is no center, or the origin is not where ``centered`` puts it.
    """
    roots = outer_roots(cubic)
    if cubic.b2 > 0.0 and cubic.b0 < 0.0:
        return (_between_saddles(cubic, roots[0], roots[1]),)
    if cubic.b2 < 0.0 < cubic.b0:
        left, right = roots
        outer = _ring(cubic, RingKind.OUTER, 0.0, math.inf, (left, right))
        depths = (-_potential(cubic, left), -_potential(cubic, right))
        return (
            _ring(cubic.moved(left), RingKind.LEFT_WELL, left, depths[0], (-math.inf, -left)),
            _ring(cubic.moved(right), RingKind.RIGHT_WELL, right, depths[1], (-right, math.inf)),
            outer,
        )
    if cubic.b2 < 0.0 and cubic.b0 < 0.0 and len(roots) < 2:
        return (_ring(cubic, RingKind.SINGLE_WELL, 0.0, math.inf, (0.0, 0.0)),)
    if cubic.b2 == 0.0:
        raise RefusedError(
            "b2 is zero: this is the quadratic force, whose loop is known in closed form", hint=_QUADRATIC
        )
    raise RefusedError(
        f"no closed level curve surrounds the origin alone, or a saddle with both wells (b1 = {cubic.b1}, "
        f"b0 = {cubic.b0})",
        hint="centered() moves the origin, if there are three equilibria",
    )


_QUADRATIC: Final = "see bogdanov_takens"


def level_integrals(ring: Ring, level: float) -> LevelIntegrals:
    """Return the integrals on one level curve, from 0 (for the outer ring the figure-eight) to ``ring.top``.

    By the double-exponential rule (Takahasi & Mori 1974), whose nodes crowd at the turning points, so that it holds up
    to the loop; its step is halved until two rules agree.

    Raises:
        InputError: the level is not in the ring.
    """
    if not 0.0 <= level <= ring.top or math.isinf(level) or (level == 0.0 and ring.kind is not RingKind.OUTER):
        raise InputError(f"level {level} is not in the ring, which reaches from 0 to {ring.top}")
    low, high = turning_points(ring, level)
    step, rough = _COARSEST, _rule(ring, level, (low, high), _COARSEST)
    while True:
        step /= 2.0
        fine = _rule(ring, level, (low, high), step)
        width = np.array([1.0, high - low, (high - low) ** 2])
        error = float(np.abs((fine[0] - rough[0]) / (fine[0, 0] * width)).max())
        if error < _ENOUGH or step <= _FINEST:
            break
        rough = fine
    return LevelIntegrals(
        level=level,
        x_min=ring.origin + low,
        x_max=ring.origin + high,
        integrals=fine[0],
        slopes=np.full(3, np.inf) if level in {ring.top, 0.0} else fine[1],
        error=max(error, _ENOUGH),
    )


def first_order(ring: Ring, on: LevelIntegrals, *, a2: float, a1: float) -> float:
    """Return the a0 at which this level curve survives to first order: the zero of a0 I0 + a1 I1 + a2 I2 (Eq. 25-29).

    With a2 = −1 it is Q − a1 P about x = 0.
    """
    x = ring.origin
    return -(a1 + a2 * x) * x - (a1 + 2.0 * a2 * x) * on.P - a2 * on.Q


def first_order_slope(ring: Ring, on: LevelIntegrals, *, a2: float, a1: float) -> float:
    """Return the derivative of ``first_order`` by the level; a cycle there is stable where it is positive.

    On a loop it is infinite, with the sign opposite to the damping at the saddle.
    """
    a1_here = a1 + 2.0 * a2 * ring.origin
    excess = -a1_here * on.P - a2 * on.Q
    if not np.isfinite(on.slopes[0]):
        damping = sum(excess + (a1_here + a2 * u) * u for u in ring.saddles)
        return -math.copysign(math.inf, damping) if damping else 0.0
    gain = excess * on.slopes[0] + a1_here * on.slopes[1] + a2 * on.slopes[2]
    return -float(gain / on.integrals[0])


def turning_points(ring: Ring, level: float) -> tuple[float, float]:
    """Return where a level curve crosses y = 0, as distances from the ring's origin."""
    if ring.kind is RingKind.OUTER:
        starts = (ring.left, ring.right)
        walls = (-math.inf, math.inf)
    else:
        starts = (0.0, 0.0)
        walls = (
            ring.left if ring.kind is not RingKind.SINGLE_WELL else -math.inf,
            ring.right if ring.kind is not RingKind.SINGLE_WELL else math.inf,
        )
    return _turn(ring, level, starts[0], walls[0]), _turn(ring, level, starts[1], walls[1])


def _turn(ring: Ring, level: float, start: float, wall: float) -> float:
    def excess(u: float) -> float:
        return ring.potential(u) - level

    if math.isinf(wall):
        step = max(abs(start), (4.0 * level / ring.quartic) ** 0.25, abs(ring.cubic) / ring.quartic)
        wall = start + math.copysign(step, wall)
        while excess(wall) <= 0.0:
            wall = start + 2.0 * (wall - start)
    if excess(wall) <= 0.0:
        return wall
    return float(brentq(excess, start, wall, xtol=np.finfo(np.float64).tiny, rtol=_RTOL, maxiter=500))


def _potential(cubic: Cubic, x: float) -> float:
    return -x * x * (0.5 * cubic.b0 + x * (cubic.b1 / 3.0 + x * 0.25 * cubic.b2))


def _ring(cubic: Cubic, kind: RingKind, origin: float, top: float, walls: tuple[float, float]) -> Ring:
    return Ring(
        kind=kind,
        origin=origin,
        quadratic=-cubic.b0,
        cubic=-cubic.b1,
        quartic=-cubic.b2,
        top=top,
        left=walls[0],
        right=walls[1],
    )


def _between_saddles(cubic: Cubic, left: float, right: float) -> Ring:
    top = min(_potential(cubic, left), _potential(cubic, right))
    return _ring(cubic, RingKind.BETWEEN_SADDLES, 0.0, top, (left, right))


def _rule(ring: Ring, level: float, ends: tuple[float, float], step: float) -> FloatArray:
    """Return ∮ u^k y dx and ∮ u^k / y dx by one rule, shape (2, 3).

    y² = (u − low)(high − u) m(u): the first two factors come from the nodes without cancellation.
    """
    low, high = ends
    total, product = low + high, low * high
    m2 = -0.5 * ring.quartic
    m1 = -2.0 / 3.0 * ring.cubic + m2 * total
    m0 = 2.0 * level / product
    fraction, rest, weight = _nodes(step)
    pieces = ((low, 0.0), (0.0, high)) if ring.kind is RingKind.OUTER else ((low, high),)
    found = np.zeros((2, 3))
    for start, end in pieces:
        length = end - start
        from_low, to_high = start - low + length * fraction, high - end + length * rest
        # Nearest to the end that is a turning point the position comes from it, too.
        u = np.where(fraction < 0.5, start + length * fraction, end - length * rest)
        speed = np.sqrt(from_low * to_high * np.maximum(-((m2 * u + m1) * u + m0), 0.0))
        powers = np.stack([np.ones_like(u), u, u * u])
        found[0] += 2.0 * step * length * (powers @ (weight * speed))
        with np.errstate(divide="ignore", invalid="ignore"):  # infinite at a saddle, and not used there
            found[1] += 2.0 * step * length * (powers @ (weight / speed))
    return found


@lru_cache(maxsize=16)
def _nodes(step: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the place of each node as a fraction from the left, the same from the right, and dfraction/dt."""
    count = round(_REACH / step)
    t = step * np.arange(-count, count + 1)
    grown = np.exp(np.pi * np.sinh(t))
    fraction, rest = grown / (1.0 + grown), 1.0 / (1.0 + grown)
    weight = np.pi * np.cosh(t) * fraction * rest
    return frozen_array(fraction), frozen_array(rest), frozen_array(weight)
