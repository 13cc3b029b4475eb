"""Where trace or determinant vanish on a path of equilibria, or the path meets another one.

A sign counts beyond rounding only; a node that has none, because a step ended on the very point, is passed over, and
the point is found between its neighbors. Between nodes of one sign an extremum towards zero is looked at, so that two
zeros within a step are not missed.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.planar.jet import PlanarJet, Point
from finback.dynamics.planar.path import Node, along, corrected, cross, dot, norm
from finback.dynamics.zero import zero_between

_NEWTON_STEPS: Final = 20
_SAME: Final = 1e-7  # in units of half the box: nearer events of one kind are one
_FAR: Final = 0.5  # of the distance of the nodes: Newton must not leave for another zero
_CONVERGED: Final = 1e-11
_TOUCHING: Final = 10.0  # roundings: an extremum this near zero touches it
_HALF_DIGITS: Final = sys.float_info.epsilon**0.5  # two zeros nearer than this to each other are one that touches


@final
@dataclass(frozen=True, slots=True)
class Quantity:
    """A function on the path, with its gradient by states and parameter and a bound on its rounding."""

    value: Callable[[Point], float]
    gradient: Callable[[Point], Point]
    noise: Callable[[Point], float]

    def sign(self, at: Point) -> int:
        """Return -1, 1, or 0 where rounding could have made either."""
        value = self.value(at)
        return 0 if abs(value) <= self.noise(at) else 1 if value > 0.0 else -1


@final
@dataclass(frozen=True, slots=True)
class Event:
    """A zero of a quantity on a path.

    Attributes:
        at: where.
        error: bound on what rounding has moved it, in units of half the box.
        crossing: whether the sign changes; if not, the quantity touches zero.
    """

    at: Point
    error: float
    crossing: bool


def trace_of(jet: PlanarJet) -> Quantity:
    """Return the trace of the Jacobian as a quantity."""

    def value(at: Point) -> float:
        p, q, _ = jet.first(at)
        return p[0] + q[1]

    return Quantity(value, jet.trace_gradient, jet.trace_noise)


def determinant_of(jet: PlanarJet) -> Quantity:
    """Return the determinant of the Jacobian as a quantity."""

    def value(at: Point) -> float:
        p, q, _ = jet.first(at)
        return p[0] * q[1] - p[1] * q[0]

    return Quantity(value, jet.determinant_gradient, jet.determinant_noise)


def zeros(jet: PlanarJet, nodes: Sequence[Node], quantity: Quantity) -> tuple[Event, ...]:
    """Return the zeros of a quantity on a path, in its order; none where it is zero throughout within rounding."""
    signs = [quantity.sign(here.at) for here in nodes]
    found: list[Event] = []
    known = [k for k, sign in enumerate(signs) if sign]
    for left, right in pairwise(known):
        a, b = nodes[left].at, nodes[right].at
        if right > left + 1:  # a step ended on it
            found += _polished(
                jet,
                quantity,
                nodes[(left + right) // 2].at,
                norm(along(b, a, -1.0)),
                crossing=signs[left] != signs[right],
            )
        elif signs[left] != signs[right]:
            found += _between(jet, quantity, a, b)
        elif _approaches(quantity, nodes[left], nodes[right], signs[left]):
            found += _dip(jet, quantity, a, b)
    return distinct(found)


def distinct(events: Sequence[Event]) -> tuple[Event, ...]:
    """Leave out events that are the same as an earlier one."""
    kept: list[Event] = []
    for event in events:
        if all(norm(along(event.at, other.at, -1.0)) > _SAME for other in kept):
            kept.append(event)
    return tuple(kept)


def _on_chord(jet: PlanarJet, a: Point, b: Point, share: float) -> Point:
    """Return the point of the path across the chord from a to b at a share of its length."""
    chord = along(b, a, -1.0)
    guess = along(a, chord, share)
    at = corrected(jet, guess, chord)
    return guess if at is None else at


def _between(jet: PlanarJet, quantity: Quantity, a: Point, b: Point) -> tuple[Event, ...]:
    share = zero_between(lambda s: quantity.value(_on_chord(jet, a, b, s)), 0.0, 1.0, xtol=1e-9)
    share = 0.5 if math.isnan(share) else share
    return _polished(jet, quantity, _on_chord(jet, a, b, share), norm(along(b, a, -1.0)), crossing=True)


def _approaches(quantity: Quantity, left: Node, right: Node, sign: int) -> bool:
    """Tell whether a quantity tends to zero from both nodes: an extremum towards zero lies between."""
    before = sign * dot(quantity.gradient(left.at), left.tangent)
    after = sign * dot(quantity.gradient(right.at), right.tangent)
    return before < 0.0 < after


def _dip(jet: PlanarJet, quantity: Quantity, a: Point, b: Point) -> tuple[Event, ...]:
    """Return two zeros on both sides of an extremum beyond zero, one where it touches zero, none where it does not."""
    chord = along(b, a, -1.0)

    def slope(share: float) -> float:
        at = _on_chord(jet, a, b, share)
        p, q, _ = jet.first(at)
        tangent = cross(p, q)
        turned = 1.0 if dot(tangent, chord) >= 0.0 else -1.0
        return turned * dot(quantity.gradient(at), tangent)

    if slope(0.0) * slope(1.0) >= 0.0:
        return ()
    middle = _on_chord(jet, a, b, zero_between(slope, 0.0, 1.0, xtol=1e-14))
    size = max(abs(quantity.value(a)), abs(quantity.value(b)))
    if abs(quantity.value(middle)) <= _TOUCHING * (quantity.noise(middle) + sys.float_info.epsilon * size):
        return (Event(middle, _TOUCHING**0.5 * _HALF_DIGITS, crossing=False),)
    if quantity.sign(middle) == quantity.sign(a):
        return ()
    return _between(jet, quantity, a, middle) + _between(jet, quantity, middle, b)


def _polished(
    jet: PlanarJet, quantity: Quantity, start: Point, distance: float, *, crossing: bool
) -> tuple[Event, ...]:
    """Solve both rates and the quantity for zero by Newton's method with exact derivatives."""
    if not crossing:
        return (Event(start, _TOUCHING**0.5 * _HALF_DIGITS, crossing=False),)
    at = np.array(start)
    for _ in range(_NEWTON_STEPS):
        place = (float(at[0]), float(at[1]), float(at[2]))
        matrix, values = equations(jet, quantity, place)
        try:
            step = np.linalg.solve(matrix, values)
        except np.linalg.LinAlgError:
            break
        at = at - step
        if float(np.abs(step).max()) <= _CONVERGED * (1.0 + float(np.abs(at).max())):
            break
    polished = (float(at[0]), float(at[1]), float(at[2]))
    if not np.isfinite(at).all() or norm(along(polished, start, -1.0)) > _FAR * distance:
        return (Event(start, distance * 1e-9, crossing=True),)
    return (Event(polished, rounding(jet, quantity, polished), crossing=True),)


def equations(jet: PlanarJet, quantity: Quantity, at: Point) -> tuple[FloatArray, FloatArray]:
    """Return the derivative by states and parameter, shape (3, 3), and the values of both rates and the quantity."""
    p, q, rates = jet.first(at)
    return np.array([p, q, quantity.gradient(at)]), np.array([*rates, quantity.value(at)])


def rounding(jet: PlanarJet, quantity: Quantity, at: Point) -> float:
    """Bound how far rounding moves the zero of both rates and the quantity; infinite where it is singular."""
    matrix, _ = equations(jet, quantity, at)
    noise = np.array([jet.noise(0, (0, 0, 0), at), jet.noise(1, (0, 0, 0), at), quantity.noise(at)])
    try:
        return float((np.abs(np.linalg.inv(matrix)) @ noise).max())
    except np.linalg.LinAlgError:
        return float("inf")


def bracket(jet: PlanarJet, quantity: Quantity, event: Event) -> FloatArray:
    """Return two points of the path on both sides of an event where the sign is beyond rounding, shape (2, 3).

    They are the nearest found by doubling steps; the event itself, twice, where none is found within reach.
    """
    p, q, _ = jet.first(event.at)
    normal = cross(p, q)
    length = norm(normal)
    if length == 0.0:
        return np.array([event.at, event.at])
    tangent = (normal[0] / length, normal[1] / length, normal[2] / length)
    ends = []
    for side in (-1.0, 1.0):
        step = max(event.error, 1e-15)
        end = event.at
        while step < 0.1:
            at = corrected(jet, along(event.at, tangent, side * step), tangent)
            if at is not None and quantity.sign(at):
                end = at
                break
            step *= 2.0
        ends.append(end)
    return np.array(ends)
