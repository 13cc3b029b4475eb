"""Families of limit cycles of a planar system over its parameter, through their folds, with their ends named."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.equilibrium import Kind
from finback.dynamics.lienard import NORMAL_95
from finback.dynamics.linearity import BENT
from finback.dynamics.planar.cycle import PlanarCycle, extremes
from finback.dynamics.planar.cycle_path import Shooting, Turned
from finback.dynamics.planar.family_path import SMALLEST, FamilyEnd, best_ray, crossed, followed, tangent_of
from finback.dynamics.planar.hopf import PlanarHopf
from finback.dynamics.planar.setting import PlanarSetting, planar_setting
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.planar.wedge import pushes
from finback.dynamics.zero import zero_between
from finback.errors import InputError, RefusedError

_OUTWARD: Final = 8  # steps along a ray to find both signs about a fold
_SMALLER: Final = (1.0, 0.2, 0.04)  # than the first cycle usually is
_STILL: Final = 1e-13  # of the range: a parameter that moves by less does not move
_ASIDE: Final = 0.02  # of the place on the ray: the first secant towards a fold of other coefficients
_SECANTS: Final = 12
_FARTHEST: Final = 0.5  # of the place on the ray: a step that leads nowhere
_PLACED: Final = 1e-5
_RESOLVED: Final = 1e-12  # of the range: a fold from which the family moves less says only that it is flat


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarCycleFold:
    """A fold of cycles: one that attracts and one that repels meet and vanish.

    Attributes:
        parameter: where.
        period: of the cycle there.
        low: least value of each state, shape (2,).
        high: greatest value of each state, shape (2,).
        parameter_interval: 95 % interval by the delta method, shape (2,); infinite where the fold is not linear in the
            coefficients as far as their errors reach (``linearity``).
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
    direction = crossed(shooting, hopf.parameter, center)
    first = _born(shooting, hopf, center, direction)
    points, end = followed(shooting, first, (1.0, 0.0), parameter_range)
    if max(abs(point.parameter - hopf.parameter) for point in points) <= _STILL * shooting.span:
        raise RefusedError(f"around the Hopf point at {hopf.parameter:.6g} orbits are closed within rounding: a center")
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
    still = np.zeros(len(states))
    along, direction = best_ray(setting.field.velocity(*states.T), states - inside[0], still)
    start = shooting.turn_at(cycle.parameter, along, inside[0], direction, attracting=cycle.stable)
    first = shooting.corrected(along, cycle.parameter, (0.0, 1.0), start)
    tangent = tangent_of(shooting, first)
    onward, end = followed(shooting, first, tangent, parameter_range)
    if end is FamilyEnd.CLOSED:
        return _family(setting, shooting, onward, (end, end))
    backward, begin = followed(shooting, first, (-tangent[0], -tangent[1]), parameter_range)
    return _family(setting, shooting, [*backward[:0:-1], *onward], (begin, end))


def _born(shooting: Shooting, hopf: PlanarHopf, center: tuple[float, float], direction: tuple[float, float]) -> Turned:
    """Return a small cycle beside a Hopf point; the smaller, the sooner the parameter turns or cycles grow."""
    for smaller in _SMALLER:
        try:
            start = shooting.turn_at(hopf.parameter, smaller * SMALLEST, center, direction, attracting=True)
            return shooting.on_ray(smaller * SMALLEST, start)
        except RefusedError as refusal:
            last = refusal
    raise last


def _shooting(
    system: PlanarSystem, parameter: float, parameter_range: tuple[float, float], box: ArrayLike
) -> tuple[PlanarSetting, Shooting]:
    low, high = parameter_range
    if not (math.isfinite(low) and math.isfinite(high) and low <= parameter <= high and low < high):
        raise InputError(f"a family at {parameter} needs a range of parameters around it, got ({low}, {high})")
    setting = planar_setting(system, parameter, box)
    return setting, Shooting(system, setting.scale, setting.box, high - low)


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
    domain, states = setting.system.supported, point.orbit.samples(4) * setting.units
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
    sides = [end.parameter - point.parameter for end in (left, right)]
    if sides[0] * sides[1] < 0.0 and min(map(abs, sides)) > _RESOLVED * shooting.span:
        return []  # the parameter goes on: it passes a value at which orbits are closed about a center
    orbit = point.orbit
    weight, x, y, exponent = orbit.nodes()
    p, q = point.field.velocity(x, y)
    pushed = pushes(setting.system, point.parameter, setting.scale, x, y)
    wedge = p[..., np.newaxis] * pushed[1] - q[..., np.newaxis] * pushed[0]
    total = np.tensordot(weight * np.exp(exponent.min() - exponent), wedge, 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        gradient = -total[1:] / total[0]
    bounds = np.array(_bounds(point)) * setting.units
    return [
        PlanarCycleFold(
            parameter=point.parameter,
            period=abs(orbit.duration) * setting.scale.time,
            low=bounds[0],
            high=bounds[1],
            parameter_interval=_interval(setting, shooting, point, gradient),
            bracket=np.array([point.ray.at(along - width), point.ray.at(along + width)]) * setting.units,
            residual=point.log_multiplier,
            resolved=max(map(abs, sides)) > _RESOLVED * shooting.span,
            in_domain=_supported(setting, point),
        )
    ]


def _interval(setting: PlanarSetting, shooting: Shooting, point: Turned, gradient: FloatArray) -> FloatArray:
    """Return the 95 % interval of a fold's parameter; infinite if a fold is not near where the gradient foretells."""
    system = setting.system
    interval = system.interval(point.parameter, gradient)
    half = 0.5 * float(interval[1] - interval[0])
    if not (0.0 < half < math.inf):
        return interval
    change = system.covariance @ gradient * (NORMAL_95**2 / half)
    for sign in (1.0, -1.0):
        moved = Shooting(system.moved(sign * change), setting.scale, setting.box, shooting.span)
        foretold = point.parameter + sign * half
        try:
            found = _fold_near(moved, point, foretold)
        except RefusedError:
            found = math.nan
        if not abs(found - foretold) <= BENT * half:
            return frozen_array([-math.inf, math.inf])
    return interval


def _fold_near(shooting: Shooting, like: Turned, parameter: float) -> float:
    """Return the parameter of the fold near a place, by secants; at a fold it is hardly moved by an error of the place.

    Raises:
        RefusedError: there are no cycles, or no fold of them.
    """
    start = shooting.turn_at(parameter, like.along, like.center, like.ray.direction, attracting=True)
    before = shooting.on_ray(like.along, start)
    there = shooting.on_ray(like.along * (1.0 + _ASIDE), before)
    for _ in range(_SECANTS):
        rise = there.log_multiplier - before.log_multiplier
        step = -there.log_multiplier * (there.along - before.along) / rise if rise else math.inf
        if not abs(step) < _FARTHEST * there.along:
            break
        before, there = there, shooting.on_ray(there.along + step, there)
        if abs(step) < _PLACED * there.along:
            return there.parameter
    raise RefusedError("no fold of cycles was found near a place")
