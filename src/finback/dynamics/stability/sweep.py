"""Stability regions over the elevator: area and smallest escape as functions of it, and where they are greatest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np
from scipy.optimize import brentq

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.flow import Rest, flow_at, natural_scale, rests
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.stability.basin import area, basin, nearest
from finback.dynamics.stability.region import theta_columns
from finback.errors import RefusedError

_FINE: Final = 1e-12  # of the elevator's range: how exactly a greatest value is located


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Greatest:
    """Where a quantity of the stability region is greatest over the elevator, between two elevators of a sweep.

    Attributes:
        elevator_rad: the elevator.
        value: the quantity there, in the sweep's unit.
        interval: its 95 % interval, shape (2,); to first order the place of the maximum does not widen it.
        slope: its derivative by the elevator there, as evaluated; not near 0 where it has a corner.
    """

    elevator_rad: float
    value: float
    interval: FloatArray
    slope: float

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "interval", frozen_array(self.interval))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RegionSweep:
    """The stability region of the only sink over the elevator; arrays of equal length n.

    Attributes:
        elevator_rad: the elevators, rising.
        alpha_rad: the sink; nan where there is no region, like all that follows.
        alpha_range_rad: angles to which the area is cut, shape (2,).
        area_rad2_s: area within the range of angles.
        area_slope_rad_s: its derivative by the elevator.
        area_interval_rad2_s: 95 % interval, shape (n, 2).
        escape_distance_rad: the smallest disturbance that escapes.
        escape_slope: its derivative by the elevator.
        escape_interval_rad: 95 % interval, shape (n, 2).
        saddles: how many saddles bound the region; 0 where there is none.
        greatest_area: every local maximum of the area.
        greatest_escape: every local maximum of the smallest escape.
    """

    elevator_rad: FloatArray
    alpha_rad: FloatArray
    alpha_range_rad: FloatArray
    area_rad2_s: FloatArray
    area_slope_rad_s: FloatArray
    area_interval_rad2_s: FloatArray
    escape_distance_rad: FloatArray
    escape_slope: FloatArray
    escape_interval_rad: FloatArray
    saddles: tuple[int, ...]
    greatest_area: tuple[Greatest, ...]
    greatest_escape: tuple[Greatest, ...]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in (
            "elevator_rad",
            "alpha_rad",
            "alpha_range_rad",
            "area_rad2_s",
            "area_slope_rad_s",
            "area_interval_rad2_s",
            "escape_distance_rad",
            "escape_slope",
            "escape_interval_rad",
        ):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True)
class _Sight:
    """A region at one elevator: value, slope by the elevator and interval of both quantities."""

    alpha: float
    area: tuple[float, float, FloatArray]
    escape: tuple[float, float, FloatArray]
    saddles: int


def region_sweep(
    system: LienardSystem, elevators_rad: Sequence[float], *, alpha_range_rad: tuple[float, float]
) -> RegionSweep:
    """Find the stability region of the only sink at rising elevators, and where its area and escape are greatest.

    A maximum is bracketed by the derivatives at two neighboring elevators, which are exact (see ``boundary_motion``),
    and located between them; narrower ones than the distance of two elevators may be missed.

    Args:
        system: the system.
        elevators_rad: the elevators.
        alpha_range_rad: angles to which the area is cut.
    """
    elevators = [float(value) for value in elevators_rad]
    if not elevators or any(b <= a for a, b in pairwise(elevators)):
        raise RefusedError("the elevators of a sweep are to rise")
    sights = [_sight(system, elevator, alpha_range_rad) for elevator in elevators]
    unseen = _Sight(np.nan, (np.nan, np.nan, np.full(2, np.nan)), (np.nan, np.nan, np.full(2, np.nan)), 0)
    rows = [sight or unseen for sight in sights]

    def greatest(part: Callable[[_Sight], tuple[float, float, FloatArray]]) -> tuple[Greatest, ...]:
        found = []
        for (left, before), (right, after) in pairwise(zip(elevators, sights, strict=True)):
            if before and after and part(before)[1] > 0.0 > part(after)[1]:
                found += _greatest(system, (left, right), alpha_range_rad, part)
        return tuple(found)

    return RegionSweep(
        elevator_rad=frozen_array(elevators),
        alpha_rad=frozen_array([row.alpha for row in rows]),
        alpha_range_rad=frozen_array(alpha_range_rad),
        area_rad2_s=frozen_array([row.area[0] for row in rows]),
        area_slope_rad_s=frozen_array([row.area[1] for row in rows]),
        area_interval_rad2_s=frozen_array([row.area[2] for row in rows]),
        escape_distance_rad=frozen_array([row.escape[0] for row in rows]),
        escape_slope=frozen_array([row.escape[1] for row in rows]),
        escape_interval_rad=frozen_array([row.escape[2] for row in rows]),
        saddles=tuple(row.saddles for row in rows),
        greatest_area=greatest(lambda sight: sight.area),
        greatest_escape=greatest(lambda sight: sight.escape),
    )


def _sight(system: LienardSystem, elevator_rad: float, alpha_range_rad: tuple[float, float]) -> _Sight | None:
    """Return the region at an elevator; none where there is not exactly one sink, or no region can be followed."""
    try:
        scale, _ = natural_scale(system, elevator_rad)
        flow = flow_at(system, elevator_rad, scale)
        points = rests(flow)
        sinks: list[Rest] = [point for point in points if point.kind.stable]
        if len(sinks) != 1:
            return None
        length, speed = scale.length_rad, scale.speed_rad_s
        limits = (alpha_range_rad[0] / length, alpha_range_rad[1] / length)
        inner = max(map(abs, limits))
        found = basin(flow, points, sinks[0], max(inner, *(abs(point.x) for point in points)), inner)
        size, size_by = area(flow, found, limits)
        near = nearest(flow, found)
    except RefusedError:
        return None
    columns = theta_columns(system, elevator_rad, scale)
    push = system.elevator_gain * scale.time_s**2 / length  # what the elevator adds to the constant of the force
    constant = len(flow.damping)
    return _Sight(
        alpha=sinks[0].x * length,
        area=(
            size * length * speed,
            float(size_by[constant]) * push * length * speed,
            system.interval(size * length * speed, length * speed * (size_by @ columns)),
        ),
        escape=(
            near.distance * length,
            float(near.by[constant]) * push * length,
            system.interval(near.distance * length, length * (near.by @ columns)),
        ),
        saddles=len(found.entering),
    )


def _greatest(
    system: LienardSystem,
    ends: tuple[float, float],
    alpha_range_rad: tuple[float, float],
    part: Callable[[_Sight], tuple[float, float, FloatArray]],
) -> list[Greatest]:
    """Locate a maximum between two elevators with a rising and a falling quantity."""

    def slope(elevator: float) -> float:
        sight = _sight(system, elevator, alpha_range_rad)
        if sight is None:
            raise RefusedError("a region between two others could not be followed")
        return part(sight)[1]

    try:
        elevator = float(brentq(slope, *ends, xtol=_FINE * (ends[1] - ends[0]), rtol=1e-15))
    except RefusedError:
        return []
    sight = _sight(system, elevator, alpha_range_rad)
    if sight is None:
        return []
    value, steepness, interval = part(sight)
    return [Greatest(elevator_rad=elevator, value=value, interval=frozen_array(interval), slope=steepness)]
