"""Simple branch points: where two curves of equilibria cross, or one turns across another."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.event import Located
from finback.dynamics.continuation.field import FieldError, ScaledField

_CORRECTIONS: Final = 25
_STEP: Final = 1e-5  # of differences of the Jacobian, typical sizes
_IMPERFECT: Final = 1e-8  # typical rates: what must be added to make the curves cross, if they do
_SETTLED: Final = 1e-10
_TURNS: Final = 0.02  # the parameter's share of the tangent of a branch that turns across another


class Crossing(StrEnum):
    """How two branches of equilibria cross."""

    TRANSCRITICAL = "transcritical"
    PITCHFORK = "pitchfork"
    """one of the two turns there, so that the number of equilibria changes by two"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BranchPoint:
    """A simple branch point.

    Attributes:
        parameter: where, in the user's unit.
        state: the equilibrium, shape (d,).
        kind: by whether one of the branches turns.
        directions: tangents of both branches in typical sizes (state, parameter), shape (2, d + 1), of length 1; the
            first is that of the branch on which the point was found.
        bracket_parameter: of the points on either side, shape (2,).
        bracket_state: their states, shape (2, d).
        residual: largest rate left, in typical rates.
        test: smallest singular value of the scaled derivatives, zero where branches cross.
    """

    parameter: float
    state: FloatArray
    kind: Crossing
    directions: FloatArray
    bracket_parameter: FloatArray
    bracket_state: FloatArray
    residual: float
    test: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "directions", "bracket_parameter", "bracket_state"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def branch_point(scaled: ScaledField, located: Located) -> BranchPoint | None:
    """Return the branch point between two points, or nothing if the curves only come close to each other.

    Solved with its own equations, regular there (Moore 1980): f + b p = 0, pᵀ f_u = 0, pᵀ p = 1, b = 0 where the
    branches truly cross.
    """
    before, after = located.before.point, located.after.point
    weight = abs(located.before.branching) + abs(located.after.branching)
    share = abs(located.before.branching) / weight if weight else 0.5
    guess = before.u + share * (after.u - before.u)
    try:
        u, left, imperfection = _solved(scaled, guess)
        jacobian = scaled.jacobian(u)
        directions = _directions(scaled, u, jacobian, left)
        residual = float(np.abs(scaled(u)).max())
    except (FieldError, np.linalg.LinAlgError):
        return None
    reach = float(np.linalg.norm(after.u - before.u))
    if abs(imperfection) > _IMPERFECT or np.linalg.norm(u - guess) > 2.0 * reach or len(directions) < 2:
        return None
    d = scaled.states
    here = 0.5 * (before.tangent + after.tangent)
    directions = sorted(directions, key=lambda way: -abs(float(way @ here)))
    turns = min(abs(float(way[d])) for way in directions) < _TURNS
    sides = np.array([before.u, after.u]) * scaled.scale
    x = u * scaled.scale
    return BranchPoint(
        parameter=float(x[d]),
        state=x[:d],
        kind=Crossing.PITCHFORK if turns else Crossing.TRANSCRITICAL,
        directions=np.array(directions),
        bracket_parameter=sides[:, d],
        bracket_state=sides[:, :d],
        residual=residual,
        test=float(np.linalg.svd(jacobian)[1][-1]),
    )


def _solved(scaled: ScaledField, guess: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return the point, the left null vector and the imperfection b."""
    d, n = scaled.states, len(guess)
    left = np.linalg.svd(scaled.jacobian(guess))[0][:, -1]
    unknowns = np.concatenate((guess, left, [0.0]))

    def equations(values: FloatArray) -> FloatArray:
        u, p, b = values[:n], values[n : n + d], values[-1]
        return np.concatenate((scaled(u) + b * p, scaled.jacobian(u).T @ p, [p @ p - 1.0]))

    for _ in range(_CORRECTIONS):
        residual = equations(unknowns)
        matrix = np.empty((len(unknowns), len(unknowns)))
        for column in range(len(unknowns)):
            step = np.zeros(len(unknowns))
            step[column] = _STEP
            matrix[:, column] = (equations(unknowns + step) - equations(unknowns - step)) / (2.0 * _STEP)
        change = np.linalg.solve(matrix, -residual)
        unknowns = unknowns + change
        if np.abs(change).max() < _SETTLED:
            break
    return unknowns[:n], unknowns[n : n + d], float(unknowns[-1])


def _directions(scaled: ScaledField, u: FloatArray, jacobian: FloatArray, left: FloatArray) -> list[FloatArray]:
    """Return the tangents of both branches: the roots of p · f_uu (a φ + b ψ)² on the two null vectors φ, ψ."""
    one, other = np.linalg.svd(jacobian)[2][-2:]
    a = float(left @ scaled.second(u, one))
    b = float(left @ scaled.mixed(u, one, other))
    c = float(left @ scaled.second(u, other))
    root = b * b - a * c
    if root <= 0.0:
        return []
    far = -b - math.copysign(math.sqrt(root), b)  # a s² + 2 b s + c = 0 without cancelling
    ways = [far * one + a * other, c * one + far * other]
    return [way / np.linalg.norm(way) for way in ways if np.linalg.norm(way) > 0.0]
