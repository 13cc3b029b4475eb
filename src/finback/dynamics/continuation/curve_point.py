"""Points of codimension two on curves of folds and Hopf points: test functions, and where they change their signs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Final, Protocol, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.event import Observed, pair_sums
from finback.dynamics.continuation.field import FieldError, ScaledField
from finback.dynamics.continuation.hopf import critical_pair, lyapunov_by_differences
from finback.dynamics.continuation.path import Equations, PathPoint, between
from finback.dynamics.zero import zero_between

_ALONG: Final = 1e-4  # typical sizes: of the derivative along the null vector
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


class Condition(Protocol):
    """The last equation of a curve."""

    def __call__(self, u: FloatArray) -> float:
        """Return its value; zero on the curve."""


Test = Callable[[PathPoint, PathPoint], float]
"""(point, neighbor that fixes signs of vectors) -> test function."""


def located(
    curve: Equations, points: list[PathPoint], kind: CodimensionTwo, test: Test
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

            share = zero_between(value, 0.0, 1.0, xtol=_SHARE)
            if math.isnan(share):
                continue
            found.append((between(curve, before, after, share), before, after, kind, value(share)))
        except (FieldError, ValueError):  # lost between the points, or nan between them: another event is nearer
            continue
    return found


def in_order(
    points: list[PathPoint],
    found: list[tuple[PathPoint, PathPoint, PathPoint, CodimensionTwo, float]],
    scaled: ScaledField,
) -> tuple[CodimensionTwoPoint, ...]:
    """Return located points in the user's units, in the order of the curve."""
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


def cusp_test(scaled: ScaledField, singular: Condition) -> Test:
    """The determinant's derivative along the null vector, p · f_xx q q but for a factor without a zero."""

    def test(point: PathPoint, neighbor: PathPoint) -> float:
        vector, reference = (np.linalg.svd(_states_of(scaled, one))[2][-1] for one in (point, neighbor))
        step = np.append(vector if vector @ reference >= 0.0 else -vector, [0.0, 0.0]) * _ALONG
        return (singular(point.u + step) - singular(point.u - step)) / (2.0 * _ALONG)

    return test


def second_zero(scaled: ScaledField) -> Test:
    """The sum of the products of all eigenvalues but one, which is that of all but the zero one."""

    def test(point: PathPoint, _: PathPoint) -> float:
        values = _values_of(scaled, point)
        return float(sum(np.delete(values, k).prod() for k in range(len(values))).real) if len(values) > 1 else math.nan

    return test


def pair_beside_zero(scaled: ScaledField) -> Test:
    """The product of the sums of two eigenvalues, the zero one left out; nan unless the nearest pair is complex."""

    def test(point: PathPoint, _: PathPoint) -> float:
        values = _values_of(scaled, point)
        rest = np.delete(values, int(np.argmin(np.abs(values))))
        if len(rest) < 2 or critical_pair(rest)[0].imag == 0.0:
            return math.nan
        return float(pair_sums(rest[np.newaxis])[0])

    return test


def pair_product(scaled: ScaledField, size: float) -> Test:
    """The product of the pair: ω², negative for a neutral saddle."""

    def test(point: PathPoint, _: PathPoint) -> float:
        first, second = critical_pair(_values_of(scaled, point))
        return (first * second).real / size**2

    return test


def _without_pair(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    one, other = np.triu_indices(len(values), 1)
    index = int(np.argmin(np.abs(values[one] + values[other])))
    return np.delete(values, [one[index], other[index]])


def zero_beside_pair(scaled: ScaledField, size: float) -> Test:
    """The product of the other eigenvalues; nan where the pair is real."""

    def test(point: PathPoint, _: PathPoint) -> float:
        values = _values_of(scaled, point)
        if len(values) < 3 or critical_pair(values)[0].imag == 0.0:
            return math.nan
        return float((_without_pair(values) / size).prod().real)

    return test


def other_pairs(scaled: ScaledField) -> Test:
    """The product of the sums of two of the other eigenvalues; nan where the nearest pair is real."""

    def test(point: PathPoint, _: PathPoint) -> float:
        rest = _without_pair(_values_of(scaled, point))
        if len(rest) < 2 or critical_pair(rest)[0].imag == 0.0:
            return math.nan
        return float(pair_sums(rest[np.newaxis])[0])

    return test


def criticality(scaled: ScaledField, point: PathPoint) -> float:
    """Return the first Lyapunov coefficient at a point of a Hopf curve; nan where the pair is real."""
    values = _values_of(scaled, point)
    if critical_pair(values)[0].imag == 0.0:
        return math.nan
    top = PathPoint(point.u, point.tangent, point.jacobian[: scaled.states], point.residual)
    return lyapunov_by_differences(scaled, Observed(top, values, 0.0, 0.0, 0.0, 0.0, 0))
