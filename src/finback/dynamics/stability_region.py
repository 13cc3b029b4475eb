"""The stability region of a sink at a held elevator: its boundary, its area, the smallest disturbance that escapes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.optimize import minimize_scalar

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.capture import Capture, capture
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest, Scale, flow_at, natural_scale, only_sink, rests, shifted
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.manifold import Manifold, manifold
from finback.dynamics.taylor import cut_at, pieces
from finback.errors import RefusedError

_SAMPLES: Final = 8  # points of a polyline on each step of the integration
_NODES: Final = 25  # Gauss-Legendre, exact for the square of a series of degree 24
_FAR: Final = 1e6  # sizes of the system
_SLIVER: Final = 1e-9  # of the steps: what minimize_scalar is asked for


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BoundaryBranch:
    """One branch of the stable manifold of a saddle, from the saddle to where it leaves the range of angles.

    Attributes:
        saddle_alpha_rad: the saddle.
        side: -1 if the branch enters the saddle from smaller angles, 1 from larger.
        alpha_rad: points of the branch, shape (n,).
        alpha_dot_rad_s: dα/dt there.
        q_rad_s: pitch rate there.
    """

    saddle_alpha_rad: float
    side: int
    alpha_rad: FloatArray
    alpha_dot_rad_s: FloatArray
    q_rad_s: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("alpha_rad", "alpha_dot_rad_s", "q_rad_s"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityRegion:
    """All states from which the sink is reached with the elevator held.

    The region reaches beyond the range of angles (its tongues never end, though their area is finite).

    Attributes:
        elevator_rad: the elevator.
        alpha_rad: the sink.
        q_rad_s: its pitch rate.
        boundary: the branches that bound it, by saddle and side; complete.
        alpha_range_rad: angles to which boundary and area are cut, shape (2,).
        area_rad2_s: area in the plane of alpha and dα/dt, within the range of angles.
        frequency_rad_s: undamped frequency ω of the sink, by which disturbances in dα/dt are scaled.
        escape_distance_rad: the smallest disturbance that escapes: the least √(Δα² + (Δα_dot/ω)²) to the boundary.
        escape_alpha_rad: the nearest point of the boundary.
        escape_alpha_dot_rad_s: the same.
        escape_q_rad_s: the same.
        in_domain: whether the sink and the saddles lie at angles where data supported the model; the tongues never do.
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    boundary: tuple[BoundaryBranch, ...]
    alpha_range_rad: FloatArray
    area_rad2_s: float
    frequency_rad_s: float
    escape_distance_rad: float
    escape_alpha_rad: float
    escape_alpha_dot_rad_s: float
    escape_q_rad_s: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "alpha_range_rad", frozen_array(self.alpha_range_rad))


def stability_region(
    system: LienardSystem, elevator_rad: float, *, alpha_range_rad: tuple[float, float]
) -> StabilityRegion:
    """Find the stability region of the only sink.

    A saddle is on the boundary, with both its stable branches, exactly if one of its unstable branches runs into the
    sink (Chiang, Hirsch & Wu, IEEE Trans. Automatic Control 33, 1988).

    Args:
        system: the system.
        elevator_rad: the elevator, held.
        alpha_range_rad: angles to which the region is cut; sink and saddles must lie inside.

    Raises:
        RefusedError: there is no sink; there are other equilibria than it and saddles; a saddle lies outside the range;
            no saddle bounds the region (a cycle does, or nothing); an orbit cannot be followed to its end.
    """
    scale, _ = natural_scale(system, elevator_rad)
    flow = flow_at(system, elevator_rad, scale)
    points = rests(flow)
    saddles = tuple(point for point in points if point.kind is Kind.SADDLE)
    sink = only_sink(points)
    limits = (alpha_range_rad[0] / scale.length_rad, alpha_range_rad[1] / scale.length_rad)
    if any(not limits[0] < point.x < limits[1] for point in points):
        raise RefusedError("the stability region was not cut: a saddle lies outside the range of angles for it")
    trap = capture(flow, sink)
    bounding = [saddle for saddle in saddles if _enters(flow, saddle, sink, points, trap)]
    if not bounding:
        raise RefusedError("no saddle bounds the stability region: a cycle does, or nothing")
    curves = [
        (saddle, side, _stable_branch(flow, saddle, side, points, limits)) for saddle in bounding for side in (-1, 1)
    ]
    area = _area([[(side, curve) for owner, side, curve in curves if owner is saddle] for saddle in bounding])
    frequency = math.sqrt(-shifted(flow.force, sink.x)[1])
    distance, near_x, near_y = min(_nearest(curve, sink.x, frequency) for *_, curve in curves)
    alpha, alpha_dot = near_x * scale.length_rad, near_y * scale.speed_rad_s
    return StabilityRegion(
        elevator_rad=elevator_rad,
        alpha_rad=sink.x * scale.length_rad,
        q_rad_s=float(system.pitch_rate(sink.x * scale.length_rad, elevator_rad)),
        boundary=tuple(_boundary(system, elevator_rad, scale, saddle, side, curve) for saddle, side, curve in curves),
        alpha_range_rad=frozen_array(alpha_range_rad),
        area_rad2_s=area * scale.length_rad * scale.speed_rad_s,
        frequency_rad_s=frequency / scale.time_s,
        escape_distance_rad=distance * scale.length_rad,
        escape_alpha_rad=alpha,
        escape_alpha_dot_rad_s=alpha_dot,
        escape_q_rad_s=float(system.pitch_rate_at(alpha, alpha_dot, elevator_rad)),
        in_domain=bool(system.supports([point.x * scale.length_rad for point in (sink, *bounding)]).all()),
    )


@final
@dataclass(frozen=True, slots=True)
class _Segment:
    """A stretch of a branch: two polynomials of a parameter from 0 to span."""

    x: FloatArray
    y: FloatArray
    span: float
    graph: bool  # the parameter is x itself, not the time

    def at(self, parameter: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        return (
            np.asarray(np.polynomial.polynomial.polyval(parameter, self.x)),
            np.asarray(np.polynomial.polynomial.polyval(parameter, self.y)),
        )


def _enters(flow: Flow, saddle: Rest, sink: Rest, points: tuple[Rest, ...], trap: Capture) -> bool:
    """Tell whether the unstable branch towards the sink runs into it."""
    whole = manifold(flow, saddle, stable=False)
    side = 1 if sink.x > saddle.x else -1
    reach = min(whole.radius, 0.5 * abs(sink.x - saddle.x))
    start = _graph(whole, side * reach)
    x, y = (float(value) for value in start.at(start.span))
    for piece in pieces(flow, (x, y), forward=True):
        x, y = piece.at(piece.span)
        if trap.depth(x, y) < 1.0:
            return True
        # Beyond an outermost saddle, or below it where it can only move on outward, nothing comes back.
        if (points[-1].kind is Kind.SADDLE and x > points[-1].x and y > 0.0) or (
            points[0].kind is Kind.SADDLE and x < points[0].x and y < 0.0
        ):
            return False
    if max(abs(x), abs(y)) > _FAR:
        return False  # it blew up
    raise RefusedError("an unstable manifold comes neither to the sink nor away from it within the steps allowed")


def _graph(whole: Manifold, reach: float) -> _Segment:
    return _Segment(np.array([whole.saddle, 1.0]), np.array(whole.series), reach, graph=True)


def _stable_branch(
    flow: Flow, saddle: Rest, side: int, points: tuple[Rest, ...], limits: tuple[float, float]
) -> list[_Segment]:
    """Follow a stable branch backward until it leaves the limits for good."""
    whole = manifold(flow, saddle, stable=True)
    reach = min(whole.radius, 0.5 * abs(limits[(side + 1) // 2] - saddle.x))
    segments = [_graph(whole, side * reach)]
    start = tuple(float(value) for value in segments[0].at(side * reach))
    for piece in pieces(flow, (start[0], start[1]), forward=False):
        x, _ = piece.at(piece.span)
        if limits[0] < x < limits[1]:
            segments.append(_Segment(np.array(piece.x), np.array(piece.y), piece.span, graph=False))
            continue
        outer = points[0] if x < limits[0] else points[-1]
        if outer.kind is not Kind.SADDLE:
            raise RefusedError("the boundary leaves the range of angles where no saddle keeps it from coming back")
        span = cut_at(piece, limits[0] if x < limits[0] else limits[1])
        segments.append(_Segment(np.array(piece.x), np.array(piece.y), span, graph=False))
        return segments
    raise RefusedError("a stable manifold could not be followed to the end of the range of angles")


def _area(saddles: list[list[tuple[int, list[_Segment]]]]) -> float:
    """Return the area within the limits: ∮ y dx, to which the cuts at constant x add nothing.

    The two branches of one saddle are one curve from cut to cut; with two saddles the region lies between two of them.
    """
    loops = [math.fsum(side * _integral(curve) for side, curve in branches) for branches in saddles]
    return abs(loops[0] - loops[1]) if len(loops) == 2 else abs(loops[0])


def _integral(curve: list[_Segment]) -> float:
    """Return ∫ y dx along a branch, outward."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    total = []
    for segment in curve:
        _, y = segment.at(0.5 * segment.span * (nodes + 1.0))
        total.append(0.5 * segment.span * float(weights @ (y if segment.graph else y * y)))
    return math.fsum(total)


def _nearest(curve: list[_Segment], sink: float, frequency: float) -> tuple[float, float, float]:
    """Return the least scaled distance from the sink to a branch, and where."""

    def distance(segment: _Segment, parameter: FloatArray | float) -> FloatArray:
        x, y = segment.at(parameter)
        return np.hypot(x - sink, y / frequency)

    found = []
    for segment in curve:
        steps = np.linspace(0.0, segment.span, _SAMPLES + 1)
        values = distance(segment, steps)
        found.append((float(values.min()), int(values.argmin()), steps, segment))
    _, index, steps, segment = min(found, key=lambda item: item[0])
    low, high = sorted((float(steps[max(0, index - 1)]), float(steps[min(_SAMPLES, index + 1)])))
    best = minimize_scalar(
        lambda parameter: float(distance(segment, parameter)),
        bounds=(low, high),
        method="bounded",
        options={"xatol": _SLIVER * (high - low)},
    )
    parameter = min((float(best.x), low, high), key=lambda value: float(distance(segment, value)))
    x, y = segment.at(parameter)
    return float(distance(segment, parameter)), float(x), float(y)


def _boundary(
    system: LienardSystem, elevator_rad: float, scale: Scale, saddle: Rest, side: int, curve: list[_Segment]
) -> BoundaryBranch:
    sampled = [segment.at(np.linspace(0.0, segment.span, _SAMPLES + 1)[:-1]) for segment in curve]
    sampled.append(curve[-1].at(np.array([curve[-1].span])))
    x, y = (np.concatenate([part[k] for part in sampled]) for k in range(2))
    alpha, alpha_dot = x * scale.length_rad, y * scale.speed_rad_s
    return BoundaryBranch(
        saddle_alpha_rad=saddle.x * scale.length_rad,
        side=side,
        alpha_rad=alpha,
        alpha_dot_rad_s=alpha_dot,
        q_rad_s=system.pitch_rate_at(alpha, alpha_dot, elevator_rad),
    )
