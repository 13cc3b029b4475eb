"""Families of limit cycles of a planar system over its parameter, through their folds, with their ends named."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.equilibrium import Kind
from finback.dynamics.planar.cycle import PlanarCycle, extremes
from finback.dynamics.planar.cycle_path import Shooting, Turned
from finback.dynamics.planar.hopf import PlanarHopf
from finback.dynamics.planar.setting import PlanarSetting, planar_setting
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.planar.wedge import pushes
from finback.dynamics.zero import zero_between
from finback.errors import InputError, RefusedError

_SMALLEST: Final = 2e-3  # half-widths of the box: where a family begins beside its Hopf point, and ends at one
_FIRST: Final = 4e-3  # length of a step: half-widths of the box and shares of the range
_SHARE: Final = 0.6  # of the place on the ray: as long as a step may be
_LONGEST: Final = 0.04
_SHORTEST: Final = 1e-6
_MOST: Final = 600
_FEW: Final = 10
_STRAIGHT: Final = 0.995  # so small an angle that the next step may be longer
_BEND: Final = 0.95  # cosine between tangents of neighboring points
_PLAIN: Final = 0.25  # sine of the angle at which the field crosses the ray; below it another ray is taken
_NEAR_SADDLE: Final = 0.1  # of the cycle's size
_OUTWARD: Final = 8  # steps along a ray to find both signs about a fold
_RESOLVED: Final = 1e-12  # of the range: a fold from which the family moves less says only that it is flat


class FamilyEnd(StrEnum):
    """Why a family begins or ends."""

    HOPF = "hopf"
    """the cycle shrinks to an equilibrium"""
    CONNECTION = "connection"
    """it comes to a saddle, and its period grows without end"""
    BOX = "box"
    """it leaves the box"""
    PARAMETER = "parameter"
    """the range of the parameter ends"""
    CLOSED = "closed"
    """the family returns to where it began"""
    LOST = "lost"
    """it could not be followed, within the steps allowed, to any of these"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarCycleFold:
    """A fold of cycles: one that attracts and one that repels meet and vanish.

    Attributes:
        parameter: where.
        period: of the cycle there.
        low: least value of each state, shape (2,).
        high: greatest value of each state, shape (2,).
        parameter_interval: 95 % interval by the delta method, shape (2,).
        bracket: two states through which cycles pass whose ∫ divergence dt has opposite signs, shape (2, 2).
        residual: ∫ divergence dt over the period, as evaluated: the logarithm of the multiplier.
        resolved: whether the family moves in the parameter beside it by more than rounding; near a loop of a neutral
            saddle it may be flat to all digits.
        in_domain: whether all of the cycle lies where data supported the system.
    """

    parameter: float
    period: float
    low: FloatArray
    high: FloatArray
    parameter_interval: FloatArray
    bracket: FloatArray
    residual: float
    resolved: bool
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("low", "high", "parameter_interval", "bracket"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarCycleFamily:
    """A connected family of cycles, in the order in which it runs; arrays of equal length n.

    Attributes:
        parameter: shape (n,).
        period: shape (n,).
        log_multiplier: ∫ divergence dt over the period, shape (n,).
        stable: where it attracts.
        low: least value of each state, shape (n, 2).
        high: greatest value of each state, shape (n, 2).
        in_domain: where all of the cycle lies where data supported the system.
        ends: why it begins and why it ends.
        folds: of cycles, in the order of the family.
    """

    parameter: FloatArray
    period: FloatArray
    log_multiplier: FloatArray
    stable: NDArray[np.bool_]
    low: FloatArray
    high: FloatArray
    in_domain: NDArray[np.bool_]
    ends: tuple[FamilyEnd, FamilyEnd]
    folds: tuple[PlanarCycleFold, ...]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("parameter", "period", "log_multiplier", "low", "high"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        for name in ("stable", "in_domain"):
            flags = np.array(getattr(self, name), dtype=np.bool_)
            flags.setflags(write=False)
            object.__setattr__(self, name, flags)


def family_from_hopf(
    system: PlanarSystem, hopf: PlanarHopf, parameter_range: tuple[float, float], box: ArrayLike
) -> PlanarCycleFamily:
    """Follow the cycles that are born in a Hopf point.

    Args:
        system: the system.
        hopf: where they are born; it must lie within range and box.
        parameter_range: lowest and highest parameter.
        box: low and high of both states, in SI, shape (2, 2).

    Raises:
        InputError: range or box are none.
        RefusedError: no cycle is found beside the point.
    """
    setting, shooting = _shooting(system, hopf.parameter, parameter_range, box)
    center = (float(hopf.state[0]) / setting.scale.first, float(hopf.state[1]) / setting.scale.second)
    direction = _crossed(shooting, hopf.parameter, center)
    start = shooting.turn_at(hopf.parameter, _SMALLEST, center, direction, attracting=True)
    first = shooting.on_ray(_SMALLEST, start)
    points, end = _followed(shooting, first, (1.0, 0.0), parameter_range)
    return _family(setting, shooting, points, (FamilyEnd.HOPF, end))


def family_from_cycle(
    system: PlanarSystem, cycle: PlanarCycle, parameter_range: tuple[float, float], box: ArrayLike
) -> PlanarCycleFamily:
    """Follow the family of a cycle both ways.

    Args:
        system: the system.
        cycle: one of them; its parameter must lie within the range.
        parameter_range: lowest and highest parameter.
        box: low and high of both states, in SI, shape (2, 2).

    Raises:
        InputError: range or box are none.
        RefusedError: it encloses no equilibrium that is not a saddle, or cannot be followed at all.
    """
    setting, shooting = _shooting(system, cycle.parameter, parameter_range, box)
    inside = [
        (float(x), float(y))
        for (x, y), kind in zip(setting.points, setting.kinds, strict=True)
        if kind is not Kind.SADDLE and (np.abs(cycle.enclosed / setting.units - (x, y)).max(axis=1) < 1e-9).any()
    ]
    if not inside:
        raise RefusedError("the cycle encloses no equilibrium from which its family could be seen")
    states = cycle.orbit / setting.units
    along, direction = _best_ray(setting.field.velocity(*states.T), states - inside[0])
    start = shooting.turn_at(cycle.parameter, along, inside[0], direction, attracting=cycle.stable)
    first = shooting.corrected(along, cycle.parameter, (0.0, 1.0), start)
    tangent = _tangent(shooting, first)
    onward, end = _followed(shooting, first, tangent, parameter_range)
    if end is FamilyEnd.CLOSED:
        return _family(setting, shooting, onward, (end, end))
    backward, begin = _followed(shooting, first, (-tangent[0], -tangent[1]), parameter_range)
    return _family(setting, shooting, [*backward[:0:-1], *onward], (begin, end))


def _shooting(
    system: PlanarSystem, parameter: float, parameter_range: tuple[float, float], box: ArrayLike
) -> tuple[PlanarSetting, Shooting]:
    low, high = parameter_range
    if not (math.isfinite(low) and math.isfinite(high) and low <= parameter <= high and low < high):
        raise InputError(f"a family at {parameter} needs a range of parameters around it, got ({low}, {high})")
    setting = planar_setting(system, parameter, box)
    return setting, Shooting(system, setting.scale, setting.box, high - low)


def _crossed(shooting: Shooting, parameter: float, center: tuple[float, float]) -> tuple[float, float]:
    """Return the direction from a focus in which the linearization crosses most plainly."""
    jacobian = shooting.field(parameter).jacobian(*center)
    angles = math.pi * np.arange(24) / 24
    rays = np.array([np.cos(angles), np.sin(angles)])
    rates = jacobian @ rays
    sines = np.abs(rays[0] * rates[1] - rays[1] * rates[0]) / np.hypot(*rates)
    best = int(np.argmax(sines))
    return float(rays[0, best]), float(rays[1, best])


def _best_ray(rates: tuple[FloatArray, FloatArray], states: FloatArray) -> tuple[float, tuple[float, float]]:
    """Return distance and direction, from the origin, of the state where orbits cross the ray most plainly."""
    x, y = states.T
    sines = np.abs(x * rates[1] - y * rates[0]) / np.hypot(x, y) / np.hypot(*rates)
    best = int(np.argmax(sines))
    along = math.hypot(x[best], y[best])
    return along, (float(x[best]) / along, float(y[best]) / along)


def _tangent(shooting: Shooting, point: Turned) -> tuple[float, float]:
    a, b = point.by_along, point.by_parameter * shooting.span
    size = math.hypot(a, b)
    return (-b / size, a / size) if size else (1.0, 0.0)


def _followed(
    shooting: Shooting, first: Turned, tangent: tuple[float, float], parameter_range: tuple[float, float]
) -> tuple[list[Turned], FamilyEnd]:
    """Follow a family by its arc length in the place on the ray and the share of the range."""
    points, step = [first], _FIRST
    while len(points) < _MOST:
        last = points[-1]
        step = min(step, _SHARE * last.along)
        guess = last.along + step * tangent[0], last.parameter + step * tangent[1] * shooting.span
        point, found = _next(shooting, last, guess, tangent)
        moved = math.hypot(point.along - last.along, (point.parameter - last.parameter) / shooting.span)
        turned = found[0] * tangent[0] + found[1] * tangent[1]
        if point is last or (turned < _BEND and step > 10.0 * _SHORTEST) or not moved < 2.0 * step:
            step *= 0.5
            if step < _SHORTEST:
                return points, _stuck(shooting, last)
            continue
        for end in _ends(shooting, last, point, parameter_range):
            return points, end
        points.append(point)
        if len(points) > _FEW and _returned(shooting, first, point, moved):
            return [*points, first], FamilyEnd.CLOSED
        tangent = found
        step = min(1.6 * step, _LONGEST) if turned > _STRAIGHT else step
        if point.plainness < _PLAIN:
            points[-1], tangent = _other_ray(shooting, point, tangent)
    return points, FamilyEnd.LOST


def _next(
    shooting: Shooting, last: Turned, guess: tuple[float, float], tangent: tuple[float, float]
) -> tuple[Turned, tuple[float, float]]:
    """Return the cycle near a guess and the tangent there; the last one if there is none."""
    try:
        point = shooting.corrected(*guess, tangent, last)
    except RefusedError:
        return last, tangent
    found = _tangent(shooting, point)
    onward = found[0] * tangent[0] + found[1] * tangent[1] >= 0.0
    return point, found if onward else (-found[0], -found[1])


def _ends(shooting: Shooting, last: Turned, point: Turned, parameter_range: tuple[float, float]) -> Iterator[FamilyEnd]:
    """Yield why a family ends at a point, if it does."""
    if not parameter_range[0] <= point.parameter <= parameter_range[1]:
        yield FamilyEnd.PARAMETER
    states = point.orbit.samples(4)
    if not ((shooting.box[:, 0] <= states) & (states <= shooting.box[:, 1])).all():
        yield FamilyEnd.BOX
    if point.along < _SMALLEST and point.along < last.along:
        yield FamilyEnd.HOPF


def _returned(shooting: Shooting, first: Turned, point: Turned, moved: float) -> bool:
    if first.ray.direction != point.ray.direction:
        return False
    apart = math.hypot(point.along - first.along, (point.parameter - first.parameter) / shooting.span)
    return apart < moved


def _other_ray(shooting: Shooting, point: Turned, tangent: tuple[float, float]) -> tuple[Turned, tuple[float, float]]:
    states = point.orbit.samples(4)
    along, direction = _best_ray(point.field.velocity(*states.T), states - point.center)
    attracting = point.log_multiplier <= 0.0
    start = shooting.turn_at(point.parameter, along, point.center, direction, attracting=attracting)
    found = shooting.corrected(along, point.parameter, (0.0, 1.0) if abs(start.by_along) > 1e-6 else (1.0, 0.0), start)
    fresh = _tangent(shooting, found)
    # A family that moves outward on one ray does so on any; away from folds the parameter tells more surely.
    same = fresh[1] * tangent[1] if abs(tangent[1]) > 0.2 else fresh[0] * tangent[0]
    return found, fresh if same >= 0.0 else (-fresh[0], -fresh[1])


def _stuck(shooting: Shooting, last: Turned) -> FamilyEnd:
    """Tell whether a family that cannot be followed has come to a saddle: where the cycle is slowest."""
    states = last.orbit.samples(8)
    rates = np.hypot(*last.field.velocity(*states.T))
    size = float(np.ptp(states, axis=0).max())
    try:
        saddle = shooting.center(last.field, tuple(states[int(np.argmin(rates))].tolist()))
    except RefusedError:
        return FamilyEnd.LOST
    near = float(np.hypot(*(states - saddle).T).min()) < _NEAR_SADDLE * size
    is_saddle = float(np.linalg.det(last.field.jacobian(*saddle))) < 0.0
    return FamilyEnd.CONNECTION if near and is_saddle else FamilyEnd.LOST


def _family(
    setting: PlanarSetting, shooting: Shooting, points: Sequence[Turned], ends: tuple[FamilyEnd, FamilyEnd]
) -> PlanarCycleFamily:
    bounds = np.array([_bounds(point) for point in points]) * setting.units
    growths = np.array([point.log_multiplier for point in points])
    folds = [
        fold
        for left, right in pairwise(points)
        if left.log_multiplier * right.log_multiplier < 0.0
        for fold in _fold(setting, shooting, left, right)
    ]
    return PlanarCycleFamily(
        parameter=np.array([point.parameter for point in points]),
        period=np.array([abs(point.orbit.duration) for point in points]) * setting.scale.time,
        log_multiplier=growths,
        stable=growths < 0.0,
        low=bounds[:, 0],
        high=bounds[:, 1],
        in_domain=np.array([_supported(setting, point) for point in points]),
        ends=ends,
        folds=tuple(folds),
    )


def _bounds(point: Turned) -> list[list[float]]:
    pairs = [extremes(point.orbit, state) for state in range(2)]
    return [[low[2] for low, _ in pairs], [high[2] for _, high in pairs]]


def _supported(setting: PlanarSetting, point: Turned) -> bool:
    domain, states = setting.system.domain, point.orbit.samples(4) * setting.units
    inside = (domain[:2, 0] <= states) & (states <= domain[:2, 1])
    return bool(inside.all()) and bool(domain[2, 0] <= point.parameter <= domain[2, 1])


def _fold(setting: PlanarSetting, shooting: Shooting, left: Turned, right: Turned) -> list[PlanarCycleFold]:
    """Return the fold between two cycles of a family, by the place on the ray of one where ∫ divergence vanishes."""
    near = {left.along: left}

    def growth(along: float) -> float:
        like = min(near.values(), key=lambda point: abs(point.along - along))
        near[along] = shooting.on_ray(along, like)
        return near[along].log_multiplier

    step = right.along - left.along if right.ray.direction == left.ray.direction else 0.05 * left.along
    low = high = left.along
    try:
        for _ in range(_OUTWARD):
            high = low + step
            if growth(high) * left.log_multiplier < 0.0:
                break
            step = -step if right.ray.direction != left.ray.direction else 1.5 * step
        else:
            return []
        along = zero_between(growth, low, high, rtol=1e-14)
        if math.isnan(along):
            return []
        point = shooting.on_ray(along, near.get(along, left))
        width = max(1e-9 * along, 4.0 * math.ulp(along))
        while growth(along - width) * growth(along + width) > 0.0:
            width *= 4.0
    except RefusedError:
        return []
    orbit = point.orbit
    weight, x, y, exponent = orbit.nodes()
    p, q = point.field.velocity(x, y)
    pushed = pushes(setting.system, point.parameter, setting.scale, x, y)
    wedge = p[..., np.newaxis] * pushed[1] - q[..., np.newaxis] * pushed[0]
    total = np.tensordot(weight * np.exp(-exponent), wedge, 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        gradient = -total[1:] / total[0]
    bounds = np.array(_bounds(point)) * setting.units
    apart = max(abs(end.parameter - point.parameter) for end in (left, right))
    return [
        PlanarCycleFold(
            parameter=point.parameter,
            period=abs(orbit.duration) * setting.scale.time,
            low=bounds[0],
            high=bounds[1],
            parameter_interval=setting.system.interval(point.parameter, gradient),
            bracket=np.array([point.ray.at(along - width), point.ray.at(along + width)]) * setting.units,
            residual=point.log_multiplier,
            resolved=apart > _RESOLVED * shooting.span,
            in_domain=_supported(setting, point),
        )
    ]
