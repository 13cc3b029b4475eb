"""Curves of folds and of Hopf points of any field in the plane of two parameters, with what happens on them.

A fold curve solves f = 0, det f_x = 0; a Hopf curve f = 0 and "the sum of two eigenvalues is 0", which stays smooth
where the pair becomes real (Bogdanov-Takens) and goes on as a curve of neutral saddles.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Final, Protocol, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation_event import Observed, pair_sums
from finback.dynamics.continuation_field import BlackBox, FieldError, ScaledField
from finback.dynamics.continuation_hopf import critical_pair, lyapunov_coefficient
from finback.dynamics.continuation_path import (
    ContinuationOptions,
    Ending,
    Path,
    PathPoint,
    between,
    correct,
    follow,
    joined,
    null_direction,
    point_at,
    within,
)
from finback.errors import InputError, RefusedError

_STEP: Final = 1e-5  # typical sizes: of differences of the last equation, whose rounding is 1e-11
_ALONG: Final = 1e-4  # typical sizes: of the derivative along the null vector
_NEWTON: Final = 20
_SHARE: Final = 1e-14


class CodimensionTwo(StrEnum):
    """Points on curves of folds and Hopf points where something more is degenerate."""

    CUSP = "cusp"
    """two folds meet and vanish"""
    BOGDANOV_TAKENS = "bogdanov-takens"
    """two zero eigenvalues: a Hopf curve and a homoclinic curve end on the fold curve"""
    BAUTIN = "bautin"
    """the first Lyapunov coefficient is zero: the criticality changes, a fold of cycles begins"""
    ZERO_HOPF = "zero-hopf"
    """a zero eigenvalue and an imaginary pair"""
    DOUBLE_HOPF = "double-hopf"
    """two imaginary pairs"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CodimensionTwoPoint:
    """A located point of a fold or Hopf curve.

    Attributes:
        kind: what is degenerate.
        parameters: where, shape (2,), the user's units.
        state: the equilibrium, shape (d,).
        bracket_parameters: of the points of the curve on either side, shape (2, 2).
        residual: of the curve's equations, in typical rates.
        test: value of the test function, zero at the point.
    """

    kind: CodimensionTwo
    parameters: FloatArray
    state: FloatArray
    bracket_parameters: FloatArray
    residual: float
    test: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("parameters", "state", "bracket_parameters"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


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


class _Condition(Protocol):
    """The last equation of a curve."""

    def __call__(self, u: FloatArray) -> float: ...


@final
class _Curve:
    """f = 0 and one condition more, in the scaled state and two scaled parameters."""

    def __init__(self, scaled: ScaledField, condition: _Condition) -> None:
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
        CodimensionTwo.CUSP: _cusp_test(scaled, singular),
        CodimensionTwo.BOGDANOV_TAKENS: _second_zero(scaled),
        CodimensionTwo.ZERO_HOPF: _pair_beside_zero(scaled),
    }
    found = [point for kind, test in tests.items() for point in _located(curve, points, kind, test)]
    values = np.array([point.u for point in points]) * scaled.scale
    return FoldCurve(
        parameters=values[:, -2:],
        state=values[:, :-2],
        residual=np.array([point.residual for point in points]),
        beginning=backward.ending,
        end=forward.ending,
        points=_in_order(points, found, scaled),
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
    lyapunov = [math.nan if flat else _criticality(scaled, point) for flat, point in zip(neutral, points, strict=True)]
    tests = {
        CodimensionTwo.BOGDANOV_TAKENS: _pair_product(scaled, size),
        CodimensionTwo.BAUTIN: lambda point, _: _criticality(scaled, point),
        CodimensionTwo.ZERO_HOPF: _zero_beside_pair(scaled, size),
        CodimensionTwo.DOUBLE_HOPF: _other_pairs(scaled),
    }
    found = [point for kind, test in tests.items() for point in _located(curve, points, kind, test)]
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
        points=_in_order(points, found, scaled),
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


Test = Callable[[PathPoint, PathPoint], float]
"""(point, neighbor that fixes signs of vectors) -> test function."""


def _located(
    curve: _Curve, points: list[PathPoint], kind: CodimensionTwo, test: Test
) -> list[tuple[PathPoint, PathPoint, PathPoint, CodimensionTwo, float]]:
    """Return where a test function changes its sign: the point, its neighbors on the curve, the kind, its value."""
    found = []
    for before, after in pairwise(points):
        try:
            first, last = test(before, before), test(after, before)
            if not first * last < 0.0:  # nan: the test means nothing there
                continue

            def value(share: float, ends: tuple[PathPoint, PathPoint] = (before, after)) -> float:
                return test(between(curve, *ends, share), ends[0])

            share: float = brentq(value, 0.0, 1.0, xtol=_SHARE)
            found.append((between(curve, before, after, share), before, after, kind, value(share)))
        except (FieldError, ValueError):  # lost between the points, or nan between them: another event is nearer
            continue
    return found


def _in_order(
    points: list[PathPoint],
    found: list[tuple[PathPoint, PathPoint, PathPoint, CodimensionTwo, float]],
    scaled: ScaledField,
) -> tuple[CodimensionTwoPoint, ...]:
    place = {id(point): index for index, point in enumerate(points)}
    found = sorted(found, key=lambda one: (place[id(one[1])], float(one[1].tangent @ (one[0].u - one[1].u))))
    return tuple(
        CodimensionTwoPoint(
            kind=kind,
            parameters=(at.u * scaled.scale)[-2:],
            state=(at.u * scaled.scale)[:-2],
            bracket_parameters=np.array([before.u, after.u])[:, -2:] * scaled.scale[-2:],
            residual=at.residual,
            test=value,
        )
        for at, before, after, kind, value in found
    )


def _states_of(scaled: ScaledField, point: PathPoint) -> FloatArray:
    """Return the scaled derivatives of the rates by the states, a part of the curve's Jacobian."""
    return point.jacobian[: scaled.states, : scaled.states]


def _values_of(scaled: ScaledField, point: PathPoint) -> NDArray[np.complex128]:
    return scaled.eigenvalues(point.jacobian[: scaled.states])


def _cusp_test(scaled: ScaledField, singular: _Condition) -> Test:
    """The determinant's derivative along the null vector, p · f_xx q q but for a factor without a zero."""

    def test(point: PathPoint, neighbor: PathPoint) -> float:
        vector, reference = (np.linalg.svd(_states_of(scaled, one))[2][-1] for one in (point, neighbor))
        step = np.append(vector if vector @ reference >= 0.0 else -vector, [0.0, 0.0]) * _ALONG
        return (singular(point.u + step) - singular(point.u - step)) / (2.0 * _ALONG)

    return test


def _second_zero(scaled: ScaledField) -> Test:
    """The sum of the products of all eigenvalues but one, which is that of all but the zero one."""

    def test(point: PathPoint, _: PathPoint) -> float:
        values = _values_of(scaled, point)
        return float(sum(np.delete(values, k).prod() for k in range(len(values))).real) if len(values) > 1 else math.nan

    return test


def _pair_beside_zero(scaled: ScaledField) -> Test:
    """The product of the sums of two eigenvalues, the zero one left out; nan unless the nearest pair is complex."""

    def test(point: PathPoint, _: PathPoint) -> float:
        values = _values_of(scaled, point)
        rest = np.delete(values, int(np.argmin(np.abs(values))))
        if len(rest) < 2 or critical_pair(rest)[0].imag == 0.0:
            return math.nan
        return float(pair_sums(rest[np.newaxis])[0])

    return test


def _pair_product(scaled: ScaledField, size: float) -> Test:
    def test(point: PathPoint, _: PathPoint) -> float:
        first, second = critical_pair(_values_of(scaled, point))
        return (first * second).real / size**2

    return test


def _without_pair(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    one, other = np.triu_indices(len(values), 1)
    index = int(np.argmin(np.abs(values[one] + values[other])))
    return np.delete(values, [one[index], other[index]])


def _zero_beside_pair(scaled: ScaledField, size: float) -> Test:
    def test(point: PathPoint, _: PathPoint) -> float:
        values = _values_of(scaled, point)
        if len(values) < 3 or critical_pair(values)[0].imag == 0.0:
            return math.nan
        return float((_without_pair(values) / size).prod().real)

    return test


def _other_pairs(scaled: ScaledField) -> Test:
    def test(point: PathPoint, _: PathPoint) -> float:
        rest = _without_pair(_values_of(scaled, point))
        if len(rest) < 2 or critical_pair(rest)[0].imag == 0.0:
            return math.nan
        return float(pair_sums(rest[np.newaxis])[0])

    return test


def _criticality(scaled: ScaledField, point: PathPoint) -> float:
    values = _values_of(scaled, point)
    if critical_pair(values)[0].imag == 0.0:
        return math.nan
    top = PathPoint(point.u, point.tangent, point.jacobian[: scaled.states], point.residual)
    return lyapunov_coefficient(scaled, Observed(top, values, 0.0, 0.0, 0.0, 0))[0]
