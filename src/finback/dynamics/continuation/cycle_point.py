"""What happens on a family of cycles: found by signs between neighboring cycles, confirmed by their multipliers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.collocation import CycleEquations
from finback.dynamics.continuation.field import FieldError
from finback.dynamics.continuation.path import PathPoint, between, bordered
from finback.dynamics.zero import zero_between

_MET: Final = 1e-2  # a second multiplier this near to 1 (or -1, or the circle) is taken to have met it
_FLAT: Final = 1e-10  # typical sizes: a parameter that turns by less than this is flat, not folded
_SHARE: Final = 1e-12
_SAMPLES: Final = 12  # of each interval, between which extrema are taken from parabolas


class CycleHappening(StrEnum):
    """What may happen on a family of cycles."""

    FOLD = "fold"
    """the parameter turns: a stable and an unstable cycle meet"""
    PERIOD_DOUBLING = "period-doubling"
    """a multiplier passes -1"""
    TORUS = "torus"
    """a complex pair of multipliers passes the unit circle (Neimark-Sacker)"""
    BRANCH_POINT = "branch-point"
    """a multiplier passes 1 and the parameter does not turn: another family crosses"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CyclePoint:
    """Something that happens on a family of cycles.

    Attributes:
        kind: what.
        parameter: where, in the user's unit.
        period: of the cycle, time.
        state_min: smallest value of each state on it, shape (d,).
        state_max: largest.
        multipliers_real: Floquet multipliers, shape (d,); one is 1, along the orbit.
        multipliers_imag: imaginary parts.
        bracket_parameter: of the cycles on either side, shape (2,).
        residual: largest of the collocation equations, in units of the orbit's rates.
        test: value of the test function, zero at the point.
    """

    kind: CycleHappening
    parameter: float
    period: float
    state_min: FloatArray
    state_max: FloatArray
    multipliers_real: FloatArray
    multipliers_imag: FloatArray
    bracket_parameter: FloatArray
    residual: float
    test: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state_min", "state_max", "multipliers_real", "multipliers_imag", "bracket_parameter"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True)
class FollowedCycle:
    """A cycle with its own equations."""

    equations: CycleEquations
    point: PathPoint
    multipliers: NDArray[np.complex128]

    @classmethod
    def of(cls, equations: CycleEquations, point: PathPoint) -> FollowedCycle:
        """Return the cycle with its multipliers."""
        return cls(equations, point, equations.multipliers(point.jacobian))

    @property
    def others(self) -> NDArray[np.complex128]:
        """The multipliers but for the one along the orbit."""
        return np.delete(self.multipliers, int(np.argmin(np.abs(self.multipliers - 1.0))))

    @property
    def stable(self) -> bool:
        """Whether all other multipliers lie inside the unit circle."""
        return bool((np.abs(self.others) < 1.0).all())


def _test(kind: CycleHappening) -> Callable[[FollowedCycle], float]:
    def fold(cycle: FollowedCycle) -> float:
        return float(cycle.point.tangent[-1])

    def doubling(cycle: FollowedCycle) -> float:
        return float((1.0 + cycle.others).prod().real)

    def torus(cycle: FollowedCycle) -> float:
        one, other = np.triu_indices(len(cycle.others), 1)
        return float((cycle.others[one] * cycle.others[other] - 1.0).prod().real)

    def branching(cycle: FollowedCycle) -> float:
        sign, size = np.linalg.slogdet(bordered(cycle.point.jacobian, cycle.point.tangent))
        return float(sign * math.exp(size / len(cycle.point.u)))

    tests = {
        CycleHappening.FOLD: fold,
        CycleHappening.PERIOD_DOUBLING: doubling,
        CycleHappening.TORUS: torus,
        CycleHappening.BRANCH_POINT: branching,
    }
    return tests[kind]


def cycle_happenings(here: FollowedCycle, there: FollowedCycle) -> list[CyclePoint]:
    """Return what happens between two neighboring cycles on one mesh."""
    found = []
    for kind in CycleHappening:
        if kind is CycleHappening.TORUS and here.equations.states < 3:
            continue
        test = _test(kind)
        if test(here) * test(there) < 0.0 and (point := _located(kind, here, there)) is not None:
            found.append(point)
    return found


def _located(kind: CycleHappening, here: FollowedCycle, there: FollowedCycle) -> CyclePoint | None:
    equations, test = here.equations, _test(kind)
    cache: dict[float, FollowedCycle] = {0.0: here, 1.0: there}

    def at(share: float) -> FollowedCycle:
        if share not in cache:
            cache[share] = FollowedCycle.of(equations, between(equations, here.point, there.point, share))
        return cache[share]

    try:
        share = zero_between(lambda s: test(at(s)), 0.0, 1.0, xtol=_SHARE)
        if math.isnan(share):
            return None
        cycle = at(share)
    except FieldError:  # where families cross, the equations are singular
        share, cycle = 0.5, min((here, there), key=lambda one: abs(test(one)))
    if not _confirmed(kind, cycle, here, there):
        return None
    nodes, period, parameter = equations.orbit(cycle.point.u)
    scale = equations.scaled.scale
    low, high = extent(equations, nodes)
    sides = [one.point.u[-1] * scale[-1] for one in (here, there)]
    return CyclePoint(
        kind=kind,
        parameter=parameter * float(scale[-1]),
        period=period,
        state_min=low * scale[:-1],
        state_max=high * scale[:-1],
        multipliers_real=cycle.multipliers.real,
        multipliers_imag=cycle.multipliers.imag,
        bracket_parameter=np.array(sides),
        residual=cycle.point.residual,
        test=test(cycle),
    )


def _confirmed(kind: CycleHappening, cycle: FollowedCycle, here: FollowedCycle, there: FollowedCycle) -> bool:
    """Tell whether the multipliers bear a sign out: where a parameter is flat to rounding, signs mean nothing."""
    trivial = float(np.abs(cycle.multipliers - 1.0).min())
    if kind is CycleHappening.FOLD:
        turned = min(abs(float(cycle.point.u[-1] - side.point.u[-1])) for side in (here, there))
        return turned > _FLAT and float(np.abs(cycle.others - 1.0).min()) < _MET
    if kind is CycleHappening.PERIOD_DOUBLING:
        return float(np.abs(cycle.others + 1.0).min()) < _MET and trivial < _MET
    if kind is CycleHappening.TORUS:  # two real ones of product 1 are not on the circle
        pair = cycle.others[cycle.others.imag > 0.0]
        return bool(pair.size) and float(np.abs(np.abs(pair) - 1.0).min()) < _MET and trivial < _MET
    return abs(float(here.point.u[-1] - there.point.u[-1])) > _FLAT


def extent(equations: CycleEquations, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and largest scaled states, parabolas through fine samples."""
    places = (np.arange(_SAMPLES) / _SAMPLES)[np.newaxis]
    times = (equations.mesh[:-1, np.newaxis] + equations.widths[:, np.newaxis] * places).ravel()
    values = equations.states_at(nodes, times)
    ends = []
    for sign in (-1.0, 1.0):
        heights = sign * values
        top = heights.argmax(axis=0)
        rows = (top[np.newaxis] + np.array([[-1], [0], [1]])) % len(times)
        spans = times[rows] - times[top] + (rows < top - 1) * 1.0 - (rows > top + 1) * 1.0
        left, middle, right = np.take_along_axis(heights, rows, axis=0)
        a, b = spans[0], spans[2]
        bend = ((left - middle) / a - (right - middle) / b) / (a - b)
        slope = (left - middle) / a - bend * a
        rise = np.where(bend < 0.0, -0.25 * slope**2 / np.where(bend < 0.0, bend, 1.0), 0.0)
        ends.append(sign * (middle + rise))
    return ends[0], ends[1]
