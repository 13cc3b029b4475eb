"""Branch points: where two curves of equilibria of a planar field cross."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.planar.event import Event, distinct
from finback.dynamics.planar.jet import PlanarJet, Point
from finback.dynamics.planar.path import Node, along, corrected, cross, dot, norm
from finback.dynamics.zero import zero_between

_NEWTON_STEPS: Final = 20
_ROUNDING: Final = 1e-9
"""Relative size below which a coefficient of the branching equation, or a rank, is zero: it is computed at a point
that is known to the root of rounding where the crossing is oblique, and better elsewhere."""


class Crossing(StrEnum):
    """How two branches cross."""

    TRANSCRITICAL = "transcritical"
    """both go on to both sides of the parameter"""
    PITCHFORK = "pitchfork"
    """one of them turns round here, so that one equilibrium becomes three"""
    DEGENERATE = "degenerate"
    """the second derivatives do not tell: the branches touch, or more than two meet"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarBranchPoint:
    """An equilibrium where the Jacobian and the derivative by the parameter together lose rank.

    A change of the coefficients that does not respect what makes the branches cross (an invariant line, a symmetry)
    takes the point apart, so it has no interval.

    Attributes:
        parameter: where.
        state: shape (2,).
        crossing: how the branches cross there.
        other_eigenvalue: the eigenvalue that is not zero, in 1/s.
        slopes: directions of both branches in (first state, second state, parameter), in SI and of any length,
            shape (2, 3); nan where they are not known.
        residual: largest minor of (Jacobian, derivative by the parameter), as evaluated.
        in_domain: whether state and parameter lie where data supported the system.
    """

    parameter: float
    state: FloatArray
    crossing: Crossing
    other_eigenvalue: float
    slopes: FloatArray
    residual: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, "state", frozen_array(self.state))
        object.__setattr__(self, "slopes", frozen_array(self.slopes))


def branch_events(jet: PlanarJet, nodes: Sequence[Node]) -> tuple[Event, ...]:
    """Return where a path runs through another one: the cross product of the gradients turns round."""
    known = [k for k, here in enumerate(nodes) if here.side]
    found = []
    for left, right in pairwise(known):
        if nodes[left].side == nodes[right].side and right == left + 1:
            continue
        start = nodes[(left + right) // 2].at if right > left + 1 else _turning(jet, nodes[left], nodes[right])
        at = _polished(jet, start)
        distance = norm(along(nodes[right].at, nodes[left].at, -1.0))
        near = norm(along(at, start, -1.0)) < distance
        found.append(Event(at if near else start, 1e-8, crossing=nodes[left].side != nodes[right].side))
    return distinct(found)


def branch_point(jet: PlanarJet, event: Event) -> PlanarBranchPoint:
    """Describe a branch point."""
    at = event.at
    p, q, _ = jet.first(at)
    crossing, slopes = _slopes(jet, at)
    first, second, parameter = jet.to_si(at)
    state = np.array([first, second])
    return PlanarBranchPoint(
        parameter=parameter,
        state=state,
        crossing=crossing,
        other_eigenvalue=p[0] + q[1],
        slopes=slopes * np.array(jet.units),
        residual=max(abs(minor) for minor in cross(p, q)),
        in_domain=jet.system.contains(state, parameter),
    )


def _turning(jet: PlanarJet, left: Node, right: Node) -> Point:
    chord = along(right.at, left.at, -1.0)

    def place(share: float) -> Point:
        guess = along(left.at, chord, share)
        at = corrected(jet, guess, chord)
        return guess if at is None else at

    def side(share: float) -> float:
        p, q, _ = jet.first(place(share))
        return dot(cross(p, q), chord)

    share = zero_between(side, 0.0, 1.0, xtol=1e-10)
    return place(0.5 if math.isnan(share) else share)


def _polished(jet: PlanarJet, start: Point) -> Point:
    """Solve rates and minors for zero by Gauss and Newton's method: five equations that three numbers fulfill."""
    at = np.array(start)
    for _ in range(_NEWTON_STEPS):
        place = (float(at[0]), float(at[1]), float(at[2]))
        p, q, rates = jet.first(place)
        by_p, by_q = _hessian(jet, 0, place), _hessian(jet, 1, place)
        minors = np.cross(p, q)
        turning = np.array([np.cross(by_p[k], q) + np.cross(p, by_q[k]) for k in range(3)]).T
        matrix = np.vstack([p, q, turning])
        step = np.linalg.lstsq(matrix, np.concatenate([rates, minors]), rcond=None)[0]
        at = at - step
        if not np.isfinite(at).all():
            return start
        if float(np.abs(step).max()) <= 1e-15 * (1.0 + float(np.abs(at).max())):
            break
    return float(at[0]), float(at[1]), float(at[2])


def _hessian(jet: PlanarJet, row: int, at: Point) -> FloatArray:
    """Return the second derivatives of a rate by states and parameter, shape (3, 3)."""
    result = np.zeros((3, 3))
    for j in range(3):
        for k in range(3):
            order = [0, 0, 0]
            order[j] += 1
            order[k] += 1
            result[j, k] = jet.derivative(row, (order[0], order[1], order[2]), at)
    return result


def _slopes(jet: PlanarJet, at: Point) -> tuple[Crossing, FloatArray]:
    """Solve the branching equation a ξ² + 2 b ξ η + c η² = 0 on the plane of directions that both gradients allow."""
    p, q, _ = jet.first(at)
    left, values, right = np.linalg.svd(np.array([p, q]))
    across = left[:, 1]
    form = across[0] * _hessian(jet, 0, at) + across[1] * _hessian(jet, 1, at)
    unknown = np.full((2, 3), np.nan)
    if not values[0] > 0.0:
        return Crossing.DEGENERATE, unknown
    # First axis: the direction at a held parameter; second: across it.
    plane = right[1:]
    still = plane[0] * plane[1, 2] - plane[1] * plane[0, 2]
    length = float(np.linalg.norm(still))
    if length <= _ROUNDING:
        return Crossing.DEGENERATE, unknown
    still = still / length
    other = np.cross(right[0], still)
    a, b, c = float(still @ form @ still), float(still @ form @ other), float(other @ form @ other)
    size = max(abs(a), abs(b), abs(c))
    if b * b - a * c <= _ROUNDING * size * size:
        return Crossing.DEGENERATE, unknown
    if abs(a) <= _ROUNDING * size:
        directions = [still, other - c / (2.0 * b) * still]
        crossing = Crossing.PITCHFORK
    else:
        root = (b * b - a * c) ** 0.5
        directions = [other + (-b + sign * root) / a * still for sign in (1.0, -1.0)]
        crossing = Crossing.TRANSCRITICAL
    return crossing, np.array([d / np.linalg.norm(d) for d in directions])
