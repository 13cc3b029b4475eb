"""Stability regions of the sinks of a planar system: boundary, area, and the smallest disturbance that escapes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.planar.basin import Basin, basins
from finback.dynamics.planar.boundary import BoundaryCurve, BoundaryKind, nearest
from finback.dynamics.planar.setting import PlanarSetting, planar_setting
from finback.dynamics.planar.splitting import Arm, arm_wedge
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.planar.wedge import cycle_shift, pushes
from finback.errors import InputError

_NOWHERE: Final = (math.inf, -1, -1, 0.0)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarBoundary:
    """A curve of the boundary of a stability region.

    Attributes:
        kind: a branch of a saddle's stable manifold, which begins at the saddle; an unstable cycle, which is closed; or
            an orbit that leaves the box for good, which begins where it does.
        separates: whether the region lies on one side only; if not, the curve is a cut in it.
        states: along it as far as it was followed, shape (n, 2).
    """

    kind: BoundaryKind
    separates: bool
    states: FloatArray

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "states", frozen_array(self.states))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarRegion:
    """All states from which a sink is reached, the parameter held. Names and units are in ``system.variables``.

    Attributes:
        parameter: held.
        state: the sink, shape (2,).
        boundary: the curves that bound it; empty if it holds the box.
        box: low and high of both states, to which the area is cut, shape (2, 2).
        area: of the region within the box, in the product of the units of the states.
        disturbance_units: by which disturbances of the two states are measured, shape (2,).
        escape_distance: of the smallest disturbance that escapes, √((Δs₁/unit₁)² + (Δs₂/unit₂)²); infinite if none
            was found to escape.
        escape_distance_interval: 95 % interval by the delta method, shape (2,); infinite where the boundary is an orbit
            from the edge of the box.
        escape_state: the nearest point of the boundary, shape (2,); not finite if there is none.
        in_domain: whether the sink, and the saddles and cycles on the boundary, lie where data supported the system.
    """

    parameter: float
    state: FloatArray
    boundary: tuple[PlanarBoundary, ...]
    box: FloatArray
    area: float
    disturbance_units: FloatArray
    escape_distance: float
    escape_distance_interval: FloatArray
    escape_state: FloatArray
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "box", "disturbance_units", "escape_distance_interval", "escape_state"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def planar_regions(
    system: PlanarSystem, parameter: float, box: ArrayLike, *, disturbance_units: tuple[float, float]
) -> tuple[PlanarRegion, ...]:
    """Find the stability region of every sink in a box, by first state of the sink.

    The boundary is made of the stable manifolds of those saddles that have an unstable branch into the sink (Chiang,
    Hirsch & Wu, IEEE Trans. Automatic Control 33, 1988), and of the unstable limit cycles whose one side goes there.
    Where 240 states along the edge of the box show a boundary that is neither, it is followed from there.

    Args:
        system: the system.
        parameter: held.
        box: low and high of both states, in SI, shape (2, 2); boundaries are followed to 20 times the box, and an orbit
            is lost that goes a million times as far, or too slowly beyond 20 times.
        disturbance_units: units of disturbances in the two states, in SI, both > 0.

    Raises:
        InputError: box or units are none.
        RefusedError: the equilibria cannot be found; a boundary enters the box that was not found.
    """
    scales = np.array(disturbance_units, dtype=np.float64)
    if scales.shape != (2,) or not (np.isfinite(scales) & (scales > 0.0)).all():
        raise InputError(f"disturbances need two positive units, got {disturbance_units}")
    setting = planar_setting(system, parameter, box)
    return tuple(_region(setting, basin, scales) for basin in basins(setting))


def _region(setting: PlanarSetting, basin: Basin, scales: FloatArray) -> PlanarRegion:
    units = setting.units
    sink = setting.points[basin.sink]
    distance, owner, segment, parameter = min(
        (
            (found[0], k, found[1], found[2])
            for k, curve in enumerate(basin.curves)
            if curve.left
            for found in [nearest(curve, sink, scales / units)]
        ),
        default=_NOWHERE,
    )
    state, interval = np.full(2, np.nan), frozen_array([-np.inf, np.inf])
    if owner >= 0:
        curve = basin.curves[owner]
        state = curve.segments[segment].at(parameter)
        gradient = _shift(setting, basin, curve, (segment, parameter), (scales / units, distance))
        interval = setting.system.interval(distance, gradient)
    return PlanarRegion(
        parameter=setting.parameter,
        state=sink * units,
        boundary=tuple(
            PlanarBoundary(kind=curve.kind, separates=bool(curve.left), states=curve.states() * units)
            for curve in basin.curves
        ),
        box=setting.box * units[:, np.newaxis],
        area=basin.area * float(units.prod()),
        disturbance_units=scales,
        escape_distance=distance,
        escape_distance_interval=interval,
        escape_state=state * units,
        in_domain=_supported(setting, basin),
    )


def _supported(setting: PlanarSetting, basin: Basin) -> bool:
    kinds = [curve.kind for curve in basin.curves]
    if BoundaryKind.ORBIT in kinds:
        return False
    states = [setting.points[[basin.sink]]]
    states += [setting.points[[curve.index]] for curve in basin.curves if curve.kind is BoundaryKind.SADDLE]
    states += [curve.states() for curve in basin.curves if curve.kind is BoundaryKind.CYCLE]
    return setting.supports(np.concatenate(states))


def _shift(
    setting: PlanarSetting,
    basin: Basin,
    curve: BoundaryCurve,
    place: tuple[int, float],
    measured: tuple[FloatArray, float],
) -> FloatArray:
    """Return how the least distance moves with θ, shape (p,): along the normal the curve by D, and the sink itself."""
    (index, parameter), (scales, distance) = place, measured
    x, y = curve.segments[index].at(parameter).tolist()
    if curve.kind is BoundaryKind.SADDLE:
        whole = basin.manifolds[curve.index]
        arm = Arm(whole, curve.segments[0].span if index else parameter, curve.orbit)
        orbit = curve.orbit.cut(index - 1, parameter) if index else curve.orbit.none()
        wedge = arm_wedge(setting, arm, orbit)
    elif curve.kind is BoundaryKind.CYCLE:
        wedge = cycle_shift(setting, curve.orbit).at(index, parameter)
    else:
        return np.full(setting.system.covariance.shape[0], np.nan)
    p, q = setting.field.flow.velocity(x, y)
    sink = setting.points[basin.sink]
    there = pushes(setting.system, setting.parameter, setting.scale, sink[:1], sink[1:])[:, 0]
    moved = -np.linalg.solve(setting.field.jacobian(float(sink[0]), float(sink[1])), there)
    toward = (np.array([x, y]) - sink) / scales**2 / distance
    with np.errstate(all="ignore"):  # where the curve cannot be followed by the wedge the interval is infinite
        crossing = toward @ np.array([-q, p]) / (p * p + q * q) * wedge
        return np.asarray((crossing - toward @ moved)[1:], dtype=np.float64)
