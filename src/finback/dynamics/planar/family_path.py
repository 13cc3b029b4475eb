"""The path of a family of limit cycles: from one to the next, on rays that are changed where another serves better."""

from __future__ import annotations

import math
from collections.abc import Iterator
from enum import StrEnum
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.planar.cycle_path import Shooting, Turned
from finback.dynamics.planar.orbit import Line, PlanarOrbit
from finback.errors import RefusedError

SMALLEST: Final = 2e-3  # half-widths of the box: where a family begins beside its Hopf point, and ends at one
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
_SWELLING: Final = 3.0  # of ∫ divergence within a turn: beyond, it is begun where it then shrinks
_COARSE: Final = 1e-6  # of the place on the ray, for one unit in the last place of the parameter
_ONCE: Final = 3  # changes of sign by chords: where it crosses, and at both ends of the state itself, which has none
_TWICE: Final = -1e3  # beside anything else
_WORTH: Final = 4.0  # of ∫ divergence, for an e-th of the sine at which the ray is crossed


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
    FLAT = "flat"
    """the parameter stands still to all its digits while the cycles go on to change (canards): double precision ends"""
    LOST = "lost"
    """it could not be followed, within the steps allowed, to any of these"""


def crossed(shooting: Shooting, parameter: float, center: tuple[float, float]) -> tuple[float, float]:
    """Return the direction from a focus in which the linearization crosses most plainly."""
    jacobian = shooting.field(parameter).jacobian(*center)
    angles = math.pi * np.arange(24) / 24
    rays = np.array([np.cos(angles), np.sin(angles)])
    rates = jacobian @ rays
    sines = np.abs(rays[0] * rates[1] - rays[1] * rates[0]) / np.hypot(*rates)
    best = int(np.argmax(sines))
    return float(rays[0, best]), float(rays[1, best])


def best_ray(
    rates: tuple[FloatArray, FloatArray], states: FloatArray, exponents: FloatArray
) -> tuple[float, tuple[float, float]]:
    """Return distance and direction, from the origin, of the state of a cycle from which a turn does best.

    The cycle should cross the ray once, and plainly, and ∫ divergence up to there be great: what follows then shrinks.
    """
    x, y = states.T
    sines = np.abs(x * rates[1] - y * rates[0]) / np.hypot(x, y) / np.hypot(*rates)
    turned = np.outer(x, y) - np.outer(y, x)  # row k: on which side of the ray through state k each state lies
    ahead = (np.outer(x, x) + np.outer(y, y))[:, :-1] > 0.0
    once = ((np.sign(turned[:, :-1]) != np.sign(turned[:, 1:])) & ahead).sum(axis=1) <= _ONCE
    with np.errstate(divide="ignore"):  # a tangency is the worst
        best = int(np.argmax(exponents + _WORTH * np.log(sines) + np.where(once, 0.0, _TWICE)))
    along = math.hypot(x[best], y[best])
    return along, (float(x[best]) / along, float(y[best]) / along)


def tangent_of(shooting: Shooting, point: Turned) -> tuple[float, float]:
    """Return the direction of a family in (place on the ray, share of the range of the parameter), of length 1."""
    a, b = point.by_along, point.by_parameter * shooting.span
    size = math.hypot(a, b)
    return (-b / size, a / size) if size else (1.0, 0.0)


def followed(
    shooting: Shooting, first: Turned, tangent: tuple[float, float], parameter_range: tuple[float, float]
) -> tuple[list[Turned], FamilyEnd]:
    """Follow a family by its arc length in the place on the ray and the share of the range."""
    points, step, turned_at = [first], _FIRST, first
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
                end = _stuck(shooting, last)
                if end is not FamilyEnd.LOST or last is turned_at or len(points) == 1:
                    return points, end
                try:  # where a cycle crosses its ray thrice, it may be followed on another
                    points[-1], tangent = _other_ray(shooting, points[-2], last)
                except RefusedError:
                    return points, end
                step, turned_at = _FIRST, points[-1]
            continue
        for end in _ends(shooting, last, point, parameter_range):
            return points, end
        points.append(point)
        if len(points) > _FEW and _returned(shooting, first, point, moved):
            return [*points, first], FamilyEnd.CLOSED
        tangent = found
        step = min(1.6 * step, _LONGEST) if turned > _STRAIGHT else step
        if point.plainness < _PLAIN or point.orbit.growth().max() > _SWELLING:
            try:
                points[-1], tangent = _other_ray(shooting, last, point)
            except RefusedError:
                return points, _stuck(shooting, point)
    return points, FamilyEnd.LOST


def _next(
    shooting: Shooting, last: Turned, guess: tuple[float, float], tangent: tuple[float, float]
) -> tuple[Turned, tuple[float, float]]:
    """Return the cycle near a guess and the tangent there; the last one if there is none."""
    try:
        point = shooting.corrected(*guess, tangent, last)
    except RefusedError:
        return last, tangent
    found = tangent_of(shooting, point)
    onward = found[0] * tangent[0] + found[1] * tangent[1] >= 0.0
    return point, found if onward else (-found[0], -found[1])


def _ends(shooting: Shooting, last: Turned, point: Turned, parameter_range: tuple[float, float]) -> Iterator[FamilyEnd]:
    """Yield why a family ends at a point, if it does."""
    if not parameter_range[0] <= point.parameter <= parameter_range[1]:
        yield FamilyEnd.PARAMETER
    states = point.orbit.samples(4)
    if not ((shooting.box[:, 0] <= states) & (states <= shooting.box[:, 1])).all():
        yield FamilyEnd.BOX
    if point.along < SMALLEST and point.along < last.along:
        yield FamilyEnd.HOPF


def _returned(shooting: Shooting, first: Turned, point: Turned, moved: float) -> bool:
    if first.ray.direction != point.ray.direction:
        return False
    apart = math.hypot(point.along - first.along, (point.parameter - first.parameter) / shooting.span)
    return apart < moved


def _swollen(orbit: PlanarOrbit) -> FloatArray:
    """Return ∫ divergence up to each state of ``samples(4)``, roughly: as it is at the beginning of the piece."""
    growth = orbit.growth()
    return np.append(np.repeat(growth[:-1], 4), growth[-1])


def _other_ray(shooting: Shooting, last: Turned, point: Turned) -> tuple[Turned, tuple[float, float]]:
    states = point.orbit.samples(4)
    along, direction = best_ray(point.field.velocity(*states.T), states - point.center, _swollen(point.orbit))
    attracting = point.log_multiplier <= 0.0
    start = shooting.turn_at(point.parameter, along, point.center, direction, attracting=attracting)
    found = shooting.corrected(along, point.parameter, tangent_of(shooting, start), start)
    fresh = tangent_of(shooting, found)
    moved = found.along - _where(last.orbit, found.ray), (found.parameter - last.parameter) / shooting.span
    onward = fresh[0] * moved[0] + fresh[1] * moved[1]
    return found, fresh if onward >= 0.0 else (-fresh[0], -fresh[1])


def _where(orbit: PlanarOrbit, ray: Line) -> float:
    """Return where a cycle crosses a half line, by chords between its states."""
    x, y = (orbit.samples(16) - ray.point).T
    (a, b), (c, d) = ray.normal, ray.direction
    across, along = a * x + b * y, c * x + d * y
    crossing = np.flatnonzero((across[:-1] * across[1:] <= 0.0) & (along[:-1] + along[1:] > 0.0))
    places = [
        float(along[k] + across[k] / (across[k] - across[k + 1]) * (along[k + 1] - along[k]))
        for k in crossing.tolist()
        if across[k] != across[k + 1]
    ]
    return max(places, default=0.0)


def _stuck(shooting: Shooting, last: Turned) -> FamilyEnd:
    """Tell whether a family that cannot be followed has come to a saddle: where the cycle is slowest."""
    states = last.orbit.samples(8)
    rates = np.hypot(*last.field.velocity(*states.T))
    size = float(np.ptp(states, axis=0).max())
    if last.grain > _COARSE:
        return FamilyEnd.FLAT
    try:
        saddle = shooting.center(last.field, tuple(states[int(np.argmin(rates))].tolist()))
    except RefusedError:
        return FamilyEnd.LOST
    near = float(np.hypot(*(states - saddle).T).min()) < _NEAR_SADDLE * size
    is_saddle = float(np.linalg.det(last.field.jacobian(*saddle))) < 0.0
    return FamilyEnd.CONNECTION if near and is_saddle else FamilyEnd.LOST
