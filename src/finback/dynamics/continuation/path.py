"""Pseudo-arclength continuation: a curve of m equations in m + 1 unknowns, followed through folds and corners.

Predictor along the tangent, Newton corrector in the plane across it (Keller 1977; Allgower & Georg, Numerical
Continuation Methods, 1990, chapter 6), secant updates between Jacobians (Broyden). Where a piecewise smooth curve
turns sharply, no plane across the tangent meets it again; the other ray is then looked for around the corner.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Protocol, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.continuation.field import FieldError
from finback.errors import InputError

RESIDUAL: Final = 1e-10
"""Of the typical rates: what a point may leave."""

_QUADRATIC: Final = 1e-7  # a last correction this small leaves rounding only
_ROUNDING: Final = 1e-14
_CORRECTIONS: Final = 8
_SMOOTH: Final = 2e-3  # steps below this may turn by any angle: corners of tables
_AT_CORNER: Final = 1e-4  # a step this small that still fails stands at a sharp corner
_AROUND: Final = 1e-3  # radius in which the other ray is looked for
_BACKWARD: Final = 0.01  # of that radius: what lies nearer to the way back is the ray one came from
_GROWTH: Final = 1.5
_LOST: Final = 1e4  # typical sizes: a correction this long leads nowhere
_CLOSE: Final = 1e-5  # distance at which a branch has come back to its start


class Ending(StrEnum):
    """Why a branch ends."""

    PARAMETER_LIMIT = "parameter-limit"
    STATE_LIMIT = "state-limit"
    CLOSED = "closed"
    """it came back to where it started; it is not run twice"""
    STEP_TOO_SMALL = "step-too-small"
    FIELD_FAILED = "field-failed"
    POINTS_USED_UP = "points-used-up"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ContinuationOptions:
    """How a branch is followed. Lengths are in typical sizes (half the box unless sizes were given).

    Attributes:
        largest_step: > 0; what is narrower than this may be stepped over.
        smallest_step: where it is given up.
        largest_turn_rad: a step over which the tangent turns by more is halved, down to a step of 0.002.
        most_points: in each direction.
    """

    largest_step: float = 0.04
    smallest_step: float = 1e-7
    largest_turn_rad: float = 0.25
    most_points: int = 4000

    def __post_init__(self) -> None:
        """Check."""
        if not (0.0 < self.smallest_step < self.largest_step and self.largest_turn_rad > 0.0 and self.most_points > 1):
            raise InputError(
                f"steps from {self.smallest_step:g} to {self.largest_step:g}, turns up to {self.largest_turn_rad:g},"
                f" {self.most_points} points: steps and turns must be positive, points at least 2"
            )


class Equations(Protocol):
    """The equations of a curve, in scaled unknowns."""

    def __call__(self, u: FloatArray) -> FloatArray:
        """Return the residuals, shape (m,), for unknowns of shape (m + 1,); FieldError where undefined."""

    def jacobian(self, u: FloatArray) -> FloatArray:
        """Return their derivatives, shape (m, m + 1)."""


@final
@dataclass(frozen=True, slots=True)
class PathPoint:
    """A point of a curve: scaled unknowns (n,), unit tangent (n,), Jacobian (n - 1, n), largest residual."""

    u: FloatArray
    tangent: FloatArray
    jacobian: FloatArray
    residual: float

    def reversed(self) -> PathPoint:
        """Return the same point, run through the other way."""
        return PathPoint(self.u, -self.tangent, self.jacobian, self.residual)


def bordered(jacobian: FloatArray, row: FloatArray) -> FloatArray:
    """Return the Jacobian with one more row, shape (n, n)."""
    matrix = np.empty((len(row), len(row)))
    matrix[:-1] = jacobian
    matrix[-1] = row
    return matrix


def correct(
    equations: Equations,
    u: FloatArray,
    row: FloatArray,
    target: float,
    jacobian: FloatArray,
    *,
    secants: bool = False,
) -> FloatArray | None:
    """Return the solution with row · u = target near ``u``, or nothing if Newton's method does not reach it.

    Args:
        equations: of the curve.
        u: where to start.
        row: of the plane, shape (n,).
        target: of the plane.
        jacobian: at a point near ``u``; it is updated by secants and renewed where that converges badly.
        secants: never renew it: next to a corner differences are those of neither side.
    """
    residual = equations(u)
    size = float(np.abs(residual).max(initial=0.0))
    jacobian = jacobian.copy()
    for _ in range(5 * _CORRECTIONS if secants else _CORRECTIONS):
        try:
            change = np.linalg.solve(bordered(jacobian, row), np.append(-residual, target - row @ u))
        except np.linalg.LinAlgError:
            return None
        length = math.sqrt(change @ change)
        if not length < _LOST:
            return None
        u = u + change
        residual = equations(u)
        before, size = size, float(np.abs(residual).max(initial=0.0))
        if size <= RESIDUAL and (length <= _QUADRATIC or size <= _ROUNDING):
            return u
        if length <= _ROUNDING:
            return None
        if size > 0.2 * before and not secants:
            jacobian = equations.jacobian(u)
        else:
            jacobian += np.outer(residual, change / (length * length))
    return None


def tangent_of(jacobian: FloatArray, along: FloatArray) -> FloatArray:
    """Return the unit vector that the Jacobian annuls, turned along a direction (not perpendicular to it).

    Raises:
        np.linalg.LinAlgError: there is none, or more than one.
    """
    right = np.zeros(len(along))
    right[-1] = 1.0
    vector = np.asarray(np.linalg.solve(bordered(jacobian, along), right), dtype=np.float64)
    vector /= math.sqrt(vector @ vector)
    return vector


def null_direction(jacobian: FloatArray) -> FloatArray:
    """Return the unit vector that the Jacobian annuls best, of either sign, shape (n,)."""
    return np.asarray(np.linalg.svd(jacobian)[2][-1], dtype=np.float64)


def point_at(equations: Equations, u: FloatArray, along: FloatArray) -> PathPoint:
    """Return a solution as a point with its tangent."""
    jacobian = equations.jacobian(u)
    try:
        tangent = tangent_of(jacobian, along)
    except np.linalg.LinAlgError:
        tangent = null_direction(jacobian)
    if tangent @ along < 0.0:
        tangent = -tangent
    return PathPoint(u, tangent, jacobian, float(np.abs(equations(u)).max(initial=0.0)))


def between(equations: Equations, one: PathPoint, other: PathPoint, share: float) -> PathPoint:
    """Return the point of the curve between two points, at a share of the way along the mean of their tangents.

    Both legs of a corner lead along it, however sharp the corner is.

    Raises:
        FieldError: the curve does not meet the plane there.
    """
    way = one.tangent + other.tangent
    u = one.u + share * (other.u - one.u)
    mean = (1.0 - share) * one.jacobian + share * other.jacobian
    for attempt in range(3):
        jacobian = equations.jacobian(u) if attempt == 1 else mean
        found = correct(equations, u, way, float(way @ u), jacobian, secants=attempt > 1)
        if found is not None:
            point = point_at(equations, found, way)
            return _polished(equations, point, way) if point.residual > 0.0 else point
    raise FieldError("the curve was lost between two of its points")


def _polished(equations: Equations, point: PathPoint, way: FloatArray) -> PathPoint:
    """Return the point after one more Newton step, if that leaves less: located points are as good as they can be."""
    try:
        change = np.linalg.solve(bordered(point.jacobian, way), np.append(-equations(point.u), 0.0))
    except np.linalg.LinAlgError:
        return point
    residual = float(np.abs(equations(point.u + change)).max(initial=0.0))
    if not residual < point.residual:
        return point
    return PathPoint(point.u + change, point.tangent, point.jacobian, residual)


@final
@dataclass(frozen=True, slots=True)
class Path:
    """A followed half of a curve: its points from the start on, why it ended and in words where."""

    points: list[PathPoint]
    ending: Ending
    note: str


Outside = Callable[[FloatArray], tuple[int, float, Ending] | None]
"""Tells which unknown has passed which limit, if one has."""


def within(limits: FloatArray, states: int, unknowns: int) -> Outside:
    """Return the check of the box: states first, then parameters; ``limits`` has shape (n, 2)."""
    low, high = limits.T.copy()

    def outside(u: FloatArray) -> tuple[int, float, Ending] | None:
        v = u[:unknowns]
        beyond = (v < low) | (v > high)
        if not beyond.any():
            return None
        index = int(np.argmax(np.maximum(low - v, v - high)))
        limit = float(low[index] if v[index] < low[index] else high[index])
        return index, limit, Ending.STATE_LIMIT if index < states else Ending.PARAMETER_LIMIT

    return outside


def follow(  # noqa: C901 - one loop in which every way to end is named
    equations: Equations, start: PathPoint, outside: Outside, options: ContinuationOptions
) -> Path:
    """Follow a curve from a point along its tangent until it ends."""
    points = [start]
    step = 0.25 * options.largest_step
    while len(points) < options.most_points:
        try:
            there = _step(equations, points[-1], step, options)
            if there is None and step <= _AT_CORNER and (turned := _turned(equations, points)) is not None:
                points, there = turned
                step = _AROUND
        except FieldError as error:
            if step <= options.smallest_step:
                return Path(points, Ending.FIELD_FAILED, f"the field failed {error}")
            step *= 0.25
            continue
        if there is None:
            if step <= options.smallest_step:
                return Path(points, Ending.STEP_TOO_SMALL, f"no further point within {step:.1e} of the last")
            step *= 0.5
            continue
        here = points[-1]
        if (limit := outside(there.u)) is not None:
            last = _at_limit(equations, here, there, *limit[:2])
            if np.linalg.norm(last.u - here.u) > _ROUNDING:
                points.append(last)
            return Path(points, limit[2], f"unknown {limit[0]} reached its limit")
        if len(points) > 2 and _passes(equations, here, there, start):
            points.append(start)
            return Path(points, Ending.CLOSED, "back at its start")
        points.append(there)
        if here.tangent @ there.tangent > math.cos(0.5 * options.largest_turn_rad):
            step = min(options.largest_step, step * _GROWTH)
    return Path(points, Ending.POINTS_USED_UP, f"{options.most_points} points")


def _step(equations: Equations, here: PathPoint, step: float, options: ContinuationOptions) -> PathPoint | None:
    guess = here.u + step * here.tangent
    u = correct(equations, guess, here.tangent, float(here.tangent @ guess), here.jacobian)
    if u is None:
        return None
    smooth = step > _SMOOTH
    away = u - guess
    if math.sqrt(away @ away) > (0.4 if smooth else 2.0) * step:
        return None
    there = point_at(equations, u, u - here.u)
    if smooth and there.tangent @ here.tangent < math.cos(options.largest_turn_rad):
        return None
    return there


def _turned(equations: Equations, points: list[PathPoint]) -> tuple[list[PathPoint], PathPoint] | None:
    """Return the points up to just before a sharp corner and the first one on its other ray, if there is one."""
    here = points[-1]
    n = len(here.u)
    if (behind := _behind(equations, points)) is None:
        return None
    forward = (here.u - behind.u) / np.linalg.norm(here.u - behind.u)
    random = np.random.default_rng(0).standard_normal((4 * n, n))
    directions = [*np.eye(n), *-np.eye(n), forward, *(random / np.linalg.norm(random, axis=1)[:, np.newaxis])]
    best: tuple[float, PathPoint] | None = None
    for direction in directions:
        try:
            jacobian = equations.jacobian(here.u + _AROUND * direction)
            ray = null_direction(jacobian)
            for sign in (1.0, -1.0):
                guess = here.u + sign * _AROUND * ray
                u = correct(equations, guess, ray, float(ray @ guess), jacobian)
                if u is None or not 0.5 * _AROUND <= np.linalg.norm(u - here.u) <= 3.0 * _AROUND:
                    continue
                ahead = float((u - here.u) @ forward)
                aside = float(np.linalg.norm(u - here.u - ahead * forward))
                if ahead < 0.0 and aside < _BACKWARD * _AROUND:
                    continue
                if best is None or ahead > best[0]:
                    best = ahead, point_at(equations, u, sign * ray)
        except FieldError:
            continue
    if best is None:
        return None
    kept = [point for point in points[:-1] if np.linalg.norm(point.u - here.u) > _AROUND]
    return ([*kept, behind] if kept else points[:1]), best[1]


def _behind(equations: Equations, points: list[PathPoint]) -> PathPoint | None:
    """Return the point as far before the last as the other ray of a corner is entered beyond it."""
    here = points[-1]
    last = next((point for point in reversed(points) if np.linalg.norm(point.u - here.u) > 0.1 * _AROUND), None)
    way = here.tangent if last is None else (here.u - last.u) / np.linalg.norm(here.u - last.u)
    jacobian = here.jacobian if last is None else last.jacobian
    guess = here.u - _AROUND * way
    try:
        u = correct(equations, guess, way, float(way @ guess), jacobian)
        return None if u is None else point_at(equations, u, way)
    except FieldError:
        return None


def _at_limit(equations: Equations, here: PathPoint, there: PathPoint, index: int, limit: float) -> PathPoint:
    """Return the point where an unknown reaches its limit, between a point inside and one outside."""
    share = (limit - here.u[index]) / (there.u[index] - here.u[index])
    row = np.zeros(len(here.u))
    row[index] = 1.0
    u = here.u + share * (there.u - here.u)
    try:
        found = correct(equations, u, row, limit, there.jacobian)
        if found is not None and np.linalg.norm(found - u) <= 2.0 * np.linalg.norm(there.u - here.u):
            return point_at(equations, found, there.u - here.u)
        inside, low = here, 0.0
        high = 1.0
        for _ in range(40):  # the branch runs along the limit: halve
            middle = 0.5 * (low + high)
            point = between(equations, here, there, middle)
            if (point.u[index] - limit) * (here.u[index] - limit) > 0.0:
                inside, low = point, middle
            else:
                high = middle
    except FieldError:
        return here
    return inside


def _passes(equations: Equations, here: PathPoint, there: PathPoint, start: PathPoint) -> bool:
    """Tell whether the curve passes through its start between two points, in the direction it started in."""
    chord = there.u - here.u
    length = math.sqrt(chord @ chord)
    share = float((start.u - here.u) @ chord) / length**2
    if not 0.0 < share <= 1.0 or start.tangent @ chord < 0.0:
        return False
    away = start.u - here.u - share * chord
    if math.sqrt(away @ away) > 0.5 * length:
        return False
    try:
        met = between(equations, here, there, share)
    except FieldError:
        return False
    return bool(np.linalg.norm(met.u - start.u) <= _CLOSE)


def joined(backward: Path, forward: Path) -> list[PathPoint]:
    """Return both halves as one list, in the forward direction."""
    return [*(point.reversed() for point in reversed(backward.points[1:])), *forward.points]
