"""A curve of equilibria through (state, parameter), followed by its arclength.

Where the Jacobian and the derivative by the parameter have full rank, the tangent is the cross product of the
gradients of both rates, whose last component is the determinant. It keeps its orientation through folds and turns
round at branch points, which is how they are told apart.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

from finback.dynamics.planar.jet import PlanarJet, Point

_FIRST_STEP: Final = 0.02  # in units of half the box
_LONGEST_STEP: Final = 0.1
_SHORTEST_STEP: Final = 1e-8
_TURN: Final = 0.1  # rad from one tangent to the next, aimed at
_SHARPEST_TURN: Final = 0.25
_NEWTON_STEPS: Final = 8
_CONVERGED: Final = 4.0 * sys.float_info.epsilon
_SETTLED: Final = 1e-10  # Newton steps below it that no longer shrink are rounding
_SINGULAR: Final = 1e-9  # sine of the angle between both gradients
_NODES: Final = 20_000
_SLACK: Final = 1e-12  # a branch along the edge of the box lies in it


class BranchEnd(StrEnum):
    """Why a branch of equilibria ends where it does."""

    PARAMETER_LOW = "parameter-low"
    """the lower end of the parameter range"""
    PARAMETER_HIGH = "parameter-high"
    """the upper end of the parameter range"""
    BOX = "box"
    """the edge of the box of states"""
    CLOSED = "closed"
    """it returned to where it began"""
    STALLED = "stalled"
    """no step, however short, led on"""


@final
@dataclass(frozen=True, slots=True)
class Node:
    """One point of a path: place, unit tangent, trace, determinant, and which way the cross product points.

    ``side`` is 1 where it points along the tangent, -1 against it, 0 where it vanishes: at a branch point.
    """

    at: Point
    tangent: Point
    trace: float
    determinant: float
    side: int


_PARAMETER_ENDS: Final = (BranchEnd.PARAMETER_LOW, BranchEnd.PARAMETER_HIGH)


def dot(one: Point, other: Point) -> float:
    """Return the scalar product."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def cross(one: Point, other: Point) -> Point:
    """Return the vector product."""
    return (
        one[1] * other[2] - one[2] * other[1],
        one[2] * other[0] - one[0] * other[2],
        one[0] * other[1] - one[1] * other[0],
    )


def along(start: Point, direction: Point, length: float) -> Point:
    """Return start + length · direction."""
    return (
        start[0] + length * direction[0],
        start[1] + length * direction[1],
        start[2] + length * direction[2],
    )


def norm(vector: Point) -> float:
    """Return the length."""
    return math.sqrt(dot(vector, vector))


def corrected(jet: PlanarJet, guess: Point, normal: Point) -> Point | None:
    """Return the equilibrium in the plane through ``guess`` across ``normal``, by Newton's method; None if it fails."""
    at, last = guess, math.inf
    for _ in range(_NEWTON_STEPS):
        p, q, (value, other) = jet.first(at)
        q_normal, normal_p = cross(q, normal), cross(normal, p)
        volume = dot(p, q_normal)
        if volume == 0.0 or not math.isfinite(volume):
            return None
        step = (
            -(value * q_normal[0] + other * normal_p[0]) / volume,
            -(value * q_normal[1] + other * normal_p[1]) / volume,
            -(value * q_normal[2] + other * normal_p[2]) / volume,
        )
        at = along(at, step, 1.0)
        length = norm(step)
        if length <= _CONVERGED * (1.0 + norm(at)) or (length < _SETTLED and length >= last):
            return at
        if not length < 1e3:
            return None
        last = length
    return at if last < _SETTLED else None


def node(jet: PlanarJet, at: Point, towards: Point) -> Node:
    """Return the node at an equilibrium, its tangent on the side of ``towards``."""
    p, q, _ = jet.first(at)
    normal = cross(p, q)
    length, full = norm(normal), norm(p) * norm(q)
    if length <= _SINGULAR * full or length == 0.0:
        return Node(at, towards, p[0] + q[1], normal[2], 0)
    side = 1 if dot(normal, towards) >= 0.0 else -1
    tangent = (side * normal[0] / length, side * normal[1] / length, side * normal[2] / length)
    return Node(at, tangent, p[0] + q[1], normal[2], side)


def follow(jet: PlanarJet, start: Node, low: Point, high: Point) -> tuple[list[Node], BranchEnd]:
    """Follow a path from ``start`` along its tangent to the first point outside the box, which is included.

    Returns:
        The nodes after ``start``; for a closed path the last one is ``start`` again.
    """
    nodes: list[Node] = []
    here, step = start, _FIRST_STEP
    while len(nodes) < _NODES:
        found = _stepped(jet, here, step)
        if found is None:
            step *= 0.5
            if step < _SHORTEST_STEP:
                return nodes, BranchEnd.STALLED
            continue
        after, turn = found
        if len(nodes) >= 2 and _passes(jet, here.at, after.at, start):
            return [*nodes, start], BranchEnd.CLOSED
        nodes.append(after)
        ending = _outside(after.at, low, high)
        if ending is not None:
            return nodes, ending
        here = after
        step = min(_LONGEST_STEP, step * min(2.0, max(0.5, _TURN / max(turn, 1e-3))))
    return nodes, BranchEnd.STALLED


def _stepped(jet: PlanarJet, here: Node, step: float) -> tuple[Node, float] | None:
    """Return the next node and the angle to its tangent; None if the step is too long."""
    guess = along(here.at, here.tangent, step)
    at = corrected(jet, guess, here.tangent)
    if at is None or norm(along(at, guess, -1.0)) > 0.25 * step:
        return None
    after = node(jet, at, here.tangent)
    turn = norm(along(after.tangent, here.tangent, -1.0))
    if turn > _SHARPEST_TURN:
        return None
    return after, turn


def _passes(jet: PlanarJet, before: Point, after: Point, start: Node) -> bool:
    """Tell whether the path from ``before`` to ``after`` runs through ``start``, in its direction."""
    chord = along(after, before, -1.0)
    length = norm(chord)
    offset = along(start.at, before, -1.0)
    share = dot(offset, chord) / length**2
    if not 0.0 < share <= 1.0 or dot(chord, start.tangent) < 0.5 * length:
        return False
    foot = along(before, chord, share)
    if norm(along(start.at, foot, -1.0)) > 0.25 * length:
        return False
    at = corrected(jet, foot, chord)
    return at is not None and norm(along(at, start.at, -1.0)) < 1e-8


def _outside(at: Point, low: Point, high: Point) -> BranchEnd | None:
    if at[2] < low[2]:
        return BranchEnd.PARAMETER_LOW
    if at[2] > high[2]:
        return BranchEnd.PARAMETER_HIGH
    inside = all(low[k] - _SLACK <= at[k] <= high[k] + _SLACK for k in (0, 1))
    return None if inside else BranchEnd.BOX


def clipped(jet: PlanarJet, inside: Node, outside: Node, low: Point, high: Point) -> tuple[Node, BranchEnd] | None:
    """Return where a path first meets the edge of the box between two neighbors, and which edge that is.

    None where it is not found: the inner node lies on the edge itself, or the path turns round just beyond it.
    """
    chord = along(outside.at, inside.at, -1.0)
    crossed = []
    for k, ends in ((0, (BranchEnd.BOX,) * 2), (1, (BranchEnd.BOX,) * 2), (2, _PARAMETER_ENDS)):
        a, b = inside.at[k], outside.at[k]
        if b < low[k] <= a:
            crossed.append(((low[k] - a) / (b - a), k, low[k], ends[0]))
        if a <= high[k] < b:
            crossed.append(((high[k] - a) / (b - a), k, high[k], ends[1]))
    for share, k, edge, end in sorted(crossed):
        guess = along(inside.at, chord, share)
        normal = (float(k == 0), float(k == 1), float(k == 2))
        at = corrected(jet, along(guess, normal, edge - guess[k]), normal)
        if at is not None and norm(along(at, guess, -1.0)) <= norm(chord):
            return node(jet, at, inside.tangent), end
    return None
