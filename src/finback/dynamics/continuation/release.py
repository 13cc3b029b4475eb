"""Curves on which all rates but one vanish: they lead from one equilibrium to the next, at the same parameter.

Releasing an equation leaves a curve in the box of states, and every zero of the released rate on it is an equilibrium
(the systematic search of Goman & Khramtsovsky's KRIT, 1993). Newton's method from scattered starts misses equilibria
with small regions of attraction; these curves pass through them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.branch import scaled_field
from finback.dynamics.continuation.field import BlackBox, FieldError, ScaledField
from finback.dynamics.continuation.path import (
    ContinuationOptions,
    Ending,
    PathPoint,
    between,
    correct,
    follow,
    joined,
    null_direction,
    point_at,
    within,
)
from finback.dynamics.zero import zero_between
from finback.errors import RefusedError

_SHARE: Final = 1e-15


@final
class Released:
    """The rates at a held parameter but for one, as equations of a curve in the scaled states.

    Args:
        scaled: the field.
        parameter: its scaled parameter.
        row: which rate may be anything.
    """

    def __init__(self, scaled: ScaledField, parameter: float, row: int) -> None:
        self._scaled = scaled
        self._parameter = parameter
        self._row = row
        self._kept = [index for index in range(scaled.states) if index != row]

    def __call__(self, u: FloatArray) -> FloatArray:
        """Return the other rates."""
        return self._scaled(np.append(u, self._parameter))[self._kept]

    def jacobian(self, u: FloatArray) -> FloatArray:
        """Return their derivatives by the states."""
        return self._scaled.state_jacobian(np.append(u, self._parameter))[self._kept]

    def rate(self, u: FloatArray) -> float:
        """Return the released rate."""
        return float(self._scaled(np.append(u, self._parameter))[self._row])


def equilibria_along(
    scaled: ScaledField, x: FloatArray, parameter: float, row: int, options: ContinuationOptions
) -> list[FloatArray]:
    """Return the equilibria, scaled states, on the curve through one on which all rates but one vanish.

    Pairs that lie within one step are found where the released rate has a minimum of its size between two points.

    Args:
        scaled: the field.
        x: an equilibrium, scaled, shape (d,).
        parameter: scaled.
        row: the released rate.
        options: steps along the curve.
    """
    equations = Released(scaled, parameter, row)
    outside = within(scaled.limits[: scaled.states], scaled.states, scaled.states)
    found: list[FloatArray] = []
    try:
        start = point_at(equations, x, null_direction(equations.jacobian(x)))
        forward = follow(equations, start, outside, options)
        points = forward.points
        if forward.ending is not Ending.CLOSED:
            points = joined(follow(equations, start.reversed(), outside, options), forward)
        rates = [equations.rate(point.u) for point in points]
    except (FieldError, np.linalg.LinAlgError):
        return []
    for index in range(len(points) - 1):
        found += _zeros(equations, points[index], points[index + 1], rates[index], rates[index + 1])
    return found


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ReleasedCurve:
    """A curve on which all rates but one vanish, at one parameter.

    Attributes:
        state: its n points, shape (n, d).
        equilibria: the m zeros of the released rate on it, in its order, shape (m, d).
        end: why it ends at its last point; it begins where it was asked to.
        end_note: the same in words.
    """

    state: FloatArray
    equilibria: FloatArray
    end: Ending
    end_note: str

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, "state", frozen_array(self.state))
        object.__setattr__(self, "equilibria", frozen_array(self.equilibria))


def released_curve(
    box: BlackBox, *, parameter: float, state: ArrayLike, along: int, released: int, options: ContinuationOptions
) -> ReleasedCurve:
    """Return the curve on which all rates but one vanish, followed one way from a side of the box, and its equilibria.

    Args:
        box: a field of one parameter.
        parameter: held.
        state: near the curve's beginning, shape (d,); the state ``along`` is kept as it is.
        along: which state rises at the beginning.
        released: which rate may be anything.
        options: steps along the curve; a pair of equilibria within one is found, two pairs are not.

    Raises:
        RefusedError: the curve is not found at its beginning.
    """
    scaled = scaled_field(box)
    d = scaled.states
    equations = Released(scaled, parameter / float(scaled.scale[d]), released)
    row = np.eye(d)[along]
    u = np.asarray(state, dtype=np.float64) / scaled.scale[:d]
    try:
        found = correct(equations, u, row, float(u[along]), equations.jacobian(u))
        if found is None:
            raise RefusedError(f"the other rates do not vanish together near state {np.asarray(state).tolist()}")
        path = follow(equations, point_at(equations, found, row), within(scaled.limits[:d], d, d), options)
        rates = [equations.rate(point.u) for point in path.points]
    except FieldError as error:
        raise RefusedError(f"the field failed {error}") from error
    points = path.points
    zeros = [points[0].u] if rates[0] == 0.0 else []
    for index in range(len(points) - 1):
        zeros += _zeros(equations, points[index], points[index + 1], rates[index], rates[index + 1])
    return ReleasedCurve(
        state=np.array([point.u for point in points]) * scaled.scale[:d],
        equilibria=np.array(zeros).reshape(-1, d) * scaled.scale[:d],
        end=path.ending,
        end_note=path.note,
    )


def _zeros(equations: Released, before: PathPoint, after: PathPoint, first: float, last: float) -> list[FloatArray]:
    """Return the zeros of the released rate between two points."""
    cache: dict[float, PathPoint] = {0.0: before, 1.0: after}

    def at(share: float) -> PathPoint:
        if share not in cache:
            cache[share] = between(equations, before, after, share)
        return cache[share]

    def value(share: float) -> float:
        return equations.rate(at(share).u)

    def slope(share: float) -> float:
        point, step = at(share), 1e-6
        return equations.rate(point.u + step * point.tangent) - equations.rate(point.u - step * point.tangent)

    try:
        if first * last < 0.0:
            return [at(_root(value, 0.0, 1.0)).u]
        if last == 0.0:
            return [after.u]
        if first == 0.0 or not first * slope(0.0) < 0.0 < first * slope(1.0):
            return []
        lowest = _root(slope, 0.0, 1.0)
        if first * value(lowest) >= 0.0:
            return []
        return [at(_root(value, 0.0, lowest)).u, at(_root(value, lowest, 1.0)).u]
    except FieldError:
        return []


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    root = zero_between(function, low, high, xtol=_SHARE)
    if math.isnan(root):
        raise FieldError("a rate changes its sign and does not, at the same place")
    return root
