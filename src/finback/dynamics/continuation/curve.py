"""Curves of folds and of Hopf points of any field in the plane of two parameters, with what happens on them.

A fold curve solves f = 0, det f_x = 0; a Hopf curve f = 0 and "the sum of two eigenvalues is 0", which stays smooth
where the pair becomes real (Bogdanov-Takens) and goes on as a curve of neutral saddles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.curve_point import (
    CodimensionTwo,
    CodimensionTwoPoint,
    Condition,
    criticality,
    cusp_test,
    in_order,
    located,
    other_pairs,
    pair_beside_zero,
    pair_product,
    second_zero,
    zero_beside_pair,
)
from finback.dynamics.continuation.field import BlackBox, FieldError, ScaledField
from finback.dynamics.continuation.hopf import critical_pair
from finback.dynamics.continuation.path import (
    ContinuationOptions,
    Ending,
    Path,
    PathPoint,
    correct,
    follow,
    joined,
    null_direction,
    point_at,
    within,
)
from finback.errors import InputError, RefusedError

_STEP: Final = 1e-5  # typical sizes: of differences of the last equation, whose rounding is 1e-11
_NEWTON: Final = 20


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FoldCurve:
    """A curve of n folds in the plane of two parameters.

    Attributes:
        parameters: shape (n, 2), the user's units.
        state: shape (n, d).
        residual: of f and det f_x, in typical rates, shape (n,).
        beginning: why it ends at its first point.
        end: why it ends at its last point.
        points: cusps, Bogdanov-Takens and zero-Hopf points on it, in its order.
    """

    parameters: FloatArray
    state: FloatArray
    residual: FloatArray
    beginning: Ending
    end: Ending
    points: tuple[CodimensionTwoPoint, ...]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("parameters", "state", "residual"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class HopfCurve:
    """A curve of n Hopf points, or beyond a Bogdanov-Takens point of neutral saddles, in the plane of two parameters.

    Attributes:
        parameters: shape (n, 2), the user's units.
        state: shape (n, d).
        frequency: of the pair, rad / time, shape (n,); nan for neutral saddles.
        lyapunov: first Lyapunov coefficient, shape (n,); nan for neutral saddles.
        neutral: the pair is real: no Hopf point, shape (n,).
        residual: of f and the sum of the pair, in typical rates, shape (n,).
        beginning: why it ends at its first point.
        end: why it ends at its last point.
        points: Bogdanov-Takens, Bautin, zero-Hopf and double-Hopf points on it, in its order.
    """

    parameters: FloatArray
    state: FloatArray
    frequency: FloatArray
    lyapunov: FloatArray
    neutral: NDArray[np.bool_]
    residual: FloatArray
    beginning: Ending
    end: Ending
    points: tuple[CodimensionTwoPoint, ...]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("parameters", "state", "frequency", "lyapunov", "residual"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        neutral = np.array(self.neutral, dtype=np.bool_)
        neutral.setflags(write=False)
        object.__setattr__(self, "neutral", neutral)


@final
class _Curve:
    """f = 0 and one condition more, in the scaled state and two scaled parameters."""

    def __init__(self, scaled: ScaledField, condition: Condition) -> None:
        self.scaled = scaled
        self._condition = condition

    def __call__(self, u: FloatArray) -> FloatArray:
        return np.append(self.scaled(u), self._condition(u))

    def jacobian(self, u: FloatArray) -> FloatArray:
        last = np.empty(len(u))
        for column in range(len(u)):
            step = np.zeros(len(u))
            step[column] = _STEP
            last[column] = (self._condition(u + step) - self._condition(u - step)) / (2.0 * _STEP)
        return np.vstack((self.scaled.jacobian(u), last))


def fold_curve(
    box: BlackBox, *, state: ArrayLike, parameters: ArrayLike, options: ContinuationOptions | None = None
) -> FoldCurve:
    """Return the curve of folds through a point, followed both ways.

    Args:
        box: a field of two parameters.
        state: near a fold, shape (d,).
        parameters: where, shape (2,).
        options: steps.

    Raises:
        InputError: not two parameters.
        RefusedError: no fold is found near the point.
    """
    scaled = _plane(box)

    def singular(u: FloatArray) -> float:
        return float(np.linalg.det(scaled.jacobian(u)[:, : scaled.states]))

    curve = _Curve(scaled, singular)
    points, backward, forward = _both_ways(curve, scaled, state, parameters, options or ContinuationOptions())
    tests = {
        CodimensionTwo.CUSP: cusp_test(scaled, singular),
        CodimensionTwo.BOGDANOV_TAKENS: second_zero(scaled),
        CodimensionTwo.ZERO_HOPF: pair_beside_zero(scaled),
    }
    found = [point for kind, test in tests.items() for point in located(curve, points, kind, test)]
    values = np.array([point.u for point in points]) * scaled.scale
    return FoldCurve(
        parameters=values[:, -2:],
        state=values[:, :-2],
        residual=np.array([point.residual for point in points]),
        beginning=backward.ending,
        end=forward.ending,
        points=in_order(points, found, scaled),
    )


def hopf_curve(
    box: BlackBox, *, state: ArrayLike, parameters: ArrayLike, options: ContinuationOptions | None = None
) -> HopfCurve:
    """Return the curve of Hopf points through a point, followed both ways, neutral saddles included.

    Args:
        box: a field of two parameters and at least two states.
        state: near a Hopf point, shape (d,).
        parameters: where, shape (2,).
        options: steps.

    Raises:
        InputError: not two parameters, or one state.
        RefusedError: no Hopf point is found near the point.
    """
    scaled = _plane(box)
    if scaled.states < 2:
        raise InputError("a field of one state has no Hopf points")

    def pair(u: FloatArray) -> tuple[complex, complex]:
        return critical_pair(scaled.eigenvalues(scaled.jacobian(u)))

    start = np.concatenate((np.asarray(state, dtype=np.float64), np.asarray(parameters, dtype=np.float64)))
    size = float(np.abs(scaled.eigenvalues(scaled.jacobian(start / scaled.scale))).max()) or 1.0

    def balanced(u: FloatArray) -> float:
        return sum(pair(u)).real / size

    curve = _Curve(scaled, balanced)
    points, backward, forward = _both_ways(curve, scaled, state, parameters, options or ContinuationOptions())
    pairs = [pair(point.u) for point in points]
    neutral = np.array([first.imag == 0.0 for first, _ in pairs])
    lyapunov = [math.nan if flat else criticality(scaled, point) for flat, point in zip(neutral, points, strict=True)]
    known = {id(point): value for point, value in zip(points, lyapunov, strict=True)}
    tests = {
        CodimensionTwo.BOGDANOV_TAKENS: pair_product(scaled, size),
        CodimensionTwo.BAUTIN: lambda point, _: known[id(point)] if id(point) in known else criticality(scaled, point),
        CodimensionTwo.ZERO_HOPF: zero_beside_pair(scaled, size),
        CodimensionTwo.DOUBLE_HOPF: other_pairs(scaled),
    }
    found = [point for kind, test in tests.items() for point in located(curve, points, kind, test)]
    values = np.array([point.u for point in points]) * scaled.scale
    return HopfCurve(
        parameters=values[:, -2:],
        state=values[:, :-2],
        frequency=np.array([first.imag or math.nan for first, _ in pairs]),
        lyapunov=np.array(lyapunov),
        neutral=neutral,
        residual=np.array([point.residual for point in points]),
        beginning=backward.ending,
        end=forward.ending,
        points=in_order(points, found, scaled),
    )


def _plane(box: BlackBox) -> ScaledField:
    if box.parameters != 2:
        raise InputError(f"a curve in the plane needs a field of two parameters, not {box.parameters}")
    return ScaledField(box)


def _both_ways(
    curve: _Curve, scaled: ScaledField, state: ArrayLike, parameters: ArrayLike, options: ContinuationOptions
) -> tuple[list[PathPoint], Path, Path]:
    u = np.concatenate((np.asarray(state, dtype=np.float64), np.asarray(parameters, dtype=np.float64))) / scaled.scale
    try:
        for _ in range(_NEWTON):  # to the nearest point of the curve
            jacobian = curve.jacobian(u)
            across = null_direction(jacobian)
            found = correct(curve, u, across, float(across @ u), jacobian)
            if found is not None:
                break
            u = u - np.linalg.lstsq(jacobian, curve(u), rcond=None)[0]
    except FieldError as error:
        raise RefusedError(f"the field failed {error}") from error
    if found is None:
        raise RefusedError("no point of the curve is found near the start", hint="locate it on a branch first")
    start = point_at(curve, found, null_direction(curve.jacobian(found)))
    outside = within(scaled.limits, scaled.states, len(scaled.scale))
    forward = follow(curve, start, outside, options)
    if forward.ending is Ending.CLOSED:
        return forward.points, forward, forward
    backward = follow(curve, start.reversed(), outside, options)
    return joined(backward, forward), backward, forward
