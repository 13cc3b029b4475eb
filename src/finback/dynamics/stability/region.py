"""The stability region of a sink at a held elevator: its boundary, its area, the smallest disturbance that escapes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.flow import Flow, Rest, Scale, flow_at, natural_scale, rests
from finback.dynamics.lienard import NORMAL_95, LienardSystem
from finback.dynamics.stability.basin import Basin, area, basin, crossings, nearest
from finback.dynamics.stability.boundary_curve import CurveEnd, series_at
from finback.dynamics.stability.tongue import backward_trap
from finback.errors import RefusedError

_SAMPLES: Final = 8  # points of a polyline on each step of the integration
_WIDE: Final = 3.0  # times the range of angles: where tongues have all but ended


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BoundaryBranch:
    """One branch of the stable manifold of a saddle, within the range of angles, from the saddle backward in time.

    Attributes:
        saddle_alpha_rad: the saddle.
        side: -1 if the branch enters the saddle from smaller angles, 1 from larger.
        ending: where it comes from.
        alpha_rad: points of the branch, shape (n,).
        alpha_dot_rad_s: dα/dt there.
        q_rad_s: pitch rate there.
        half_width_rad: half of the 95 % interval of its place, across it, in the plane of alpha and (dα/dt)/ω; delta
            method, so it holds while the displacement is small; grows along the branch.
    """

    saddle_alpha_rad: float
    side: int
    ending: CurveEnd
    alpha_rad: FloatArray
    alpha_dot_rad_s: FloatArray
    q_rad_s: FloatArray
    half_width_rad: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("alpha_rad", "alpha_dot_rad_s", "q_rad_s", "half_width_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BoundaryCycle:
    """An unstable limit cycle on the boundary, once round, within the range of angles.

    Attributes:
        alpha_min_rad: least angle of the whole cycle.
        alpha_max_rad: greatest.
        period_s: its period.
        around: whether the region lies inside it; else it is a hole in the region.
        alpha_rad: points of the cycle, shape (n,).
        alpha_dot_rad_s: dα/dt there.
        q_rad_s: pitch rate there.
        half_width_rad: as for a branch.
    """

    alpha_min_rad: float
    alpha_max_rad: float
    period_s: float
    around: bool
    alpha_rad: FloatArray
    alpha_dot_rad_s: FloatArray
    q_rad_s: FloatArray
    half_width_rad: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("alpha_rad", "alpha_dot_rad_s", "q_rad_s", "half_width_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Tongue:
    """A strip of the region that goes on to infinity: the proof that the region is unbounded.

    Every orbit that is, at ``alpha_rad``, between the two curves |dα/dt| = slope |alpha|^power moves on outward for
    ever when followed backward in time, and stays between them: checked as two inequalities between polynomials, by
    counting roots, with rounding. The strip of the region is there.

    Attributes:
        alpha_rad: from where on this holds.
        low_rad_s: dα/dt of the strip's lower border there.
        high_rad_s: of its upper border.
        power: the power of the curves.
        slopes: of the two curves, in rad^(1−power)/s, shape (2,); zero if it was not proved.
        obstacle: why it was not proved; empty if it was.
    """

    alpha_rad: float
    low_rad_s: float
    high_rad_s: float
    power: int
    slopes: FloatArray
    obstacle: str

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "slopes", frozen_array(self.slopes))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityRegion:
    """All states from which a sink is reached with the elevator held.

    Attributes:
        elevator_rad: the elevator.
        alpha_rad: the sink.
        q_rad_s: its pitch rate.
        boundary: the branches of stable manifolds that bound it, by saddle and side; empty if none does.
        cycles: the unstable limit cycles that bound it, the one around it first.
        alpha_range_rad: angles to which boundary and area are cut, shape (2,).
        area_rad2_s: area in the plane of alpha and dα/dt, within the range of angles; infinite if the region is
            unbounded there.
        area_interval_rad2_s: 95 % interval of it, shape (2,), by the delta method like the others.
        area_beyond_rad2_s: least and greatest that lies beyond the range of angles, shape (2,): what was integrated
            there, and with it a bound of the tongues from there on, infinite where a tongue is not proved.
        tongues: strips that go on to infinity; none if the region is bounded, or its boundary was not followed to three
            times the range of angles.
        frequency_rad_s: undamped frequency ω of the sink, by which disturbances in dα/dt are scaled.
        escape_distance_rad: the smallest disturbance that escapes: the least √(Δα² + (Δα_dot/ω)²) to the boundary;
            infinite if the region is the whole plane.
        escape_interval_rad: 95 % interval of it, shape (2,).
        escape_alpha_rad: the nearest point of the boundary; nan if there is none, like the next two.
        escape_alpha_dot_rad_s: the same.
        escape_q_rad_s: the same.
        in_domain: whether the sink, the saddles, the cycles and the nearest point of the boundary lie at angles where
            data supported the model; the tongues never do.
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    boundary: tuple[BoundaryBranch, ...]
    cycles: tuple[BoundaryCycle, ...]
    alpha_range_rad: FloatArray
    area_rad2_s: float
    area_interval_rad2_s: FloatArray
    area_beyond_rad2_s: FloatArray
    tongues: tuple[Tongue, ...]
    frequency_rad_s: float
    escape_distance_rad: float
    escape_interval_rad: FloatArray
    escape_alpha_rad: float
    escape_alpha_dot_rad_s: float
    escape_q_rad_s: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("alpha_range_rad", "area_interval_rad2_s", "area_beyond_rad2_s", "escape_interval_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RegionNotFound:
    """A sink whose stability region could not be found.

    Attributes:
        elevator_rad: the elevator.
        alpha_rad: the sink.
        obstacle: why.
    """

    elevator_rad: float
    alpha_rad: float
    obstacle: str


def stability_region(
    system: LienardSystem, elevator_rad: float, *, alpha_range_rad: tuple[float, float]
) -> StabilityRegion:
    """Find the stability region of the only sink.

    Args:
        system: the system.
        elevator_rad: the elevator, held.
        alpha_range_rad: angles to which the region is cut.

    Raises:
        RefusedError: there is no sink, or more than one; an orbit cannot be followed to its end; nothing was found that
            bounds the region, and yet it need not be the whole plane.
    """
    place = _place(system, elevator_rad)
    sinks = [point for point in place.points if point.kind.stable]
    if not sinks:
        raise RefusedError("there is no stability region: no equilibrium is stable")
    if len(sinks) > 1:
        raise RefusedError(f"the stability region of one sink is asked for, and here are {len(sinks)}")
    return place.region(sinks[0], alpha_range_rad)


def stability_regions(
    system: LienardSystem, elevator_rad: float, *, alpha_range_rad: tuple[float, float]
) -> tuple[StabilityRegion, ...]:
    """Find the stability region of every sink, by rising angle; arguments and errors as ``stability_region``."""
    place = _place(system, elevator_rad)
    return tuple(place.region(point, alpha_range_rad) for point in place.points if point.kind.stable)


def each_stability_region(
    system: LienardSystem, elevator_rad: float, *, alpha_range_rad: tuple[float, float]
) -> tuple[StabilityRegion | RegionNotFound, ...]:
    """Find the stability region of every sink, or why it was not found: one that is refused does not hide the others.

    Raises:
        RefusedError: the equilibria cannot be found.
    """
    place = _place(system, elevator_rad)
    found: list[StabilityRegion | RegionNotFound] = []
    for point in place.points:
        if not point.kind.stable:
            continue
        try:
            found.append(place.region(point, alpha_range_rad))
        except RefusedError as refusal:
            obstacle = refusal.message
        except ArithmeticError:
            obstacle = "orbits go so far that numbers overflow"
        else:
            continue
        alpha = point.x * place.scale.length_rad
        found.append(RegionNotFound(elevator_rad=elevator_rad, alpha_rad=alpha, obstacle=obstacle))
    return tuple(found)


def _place(system: LienardSystem, elevator_rad: float) -> _Place:
    scale, _ = natural_scale(system, elevator_rad)
    flow = flow_at(system, elevator_rad, scale)
    return _Place(system, elevator_rad, scale, flow, rests(flow))


def theta_columns(system: LienardSystem, elevator_rad: float, scale: Scale) -> FloatArray:
    """Return the derivative by θ of the flow's coefficients, those of f by rising power and then of g, shape (n, p)."""
    length, time = scale.length_rad, scale.time_s
    f, g = system.damping.ascending.size, system.force.ascending.size
    rows = np.zeros((f + g, system.elevator_gain_sensitivity.size))
    for power, row in zip(system.damping.polynomial.powers[:, 0], system.damping.sensitivity, strict=True):
        rows[power] += time * length**power * row
    for power, row in zip(system.force.polynomial.powers[:, 0], system.force.sensitivity, strict=True):
        rows[f + power] += time * time * length ** float(power - 1) * row
    rows[f] += time * time / length * elevator_rad * system.elevator_gain_sensitivity
    return rows


@final
@dataclass(frozen=True, slots=True)
class _Place:
    """A system at an elevator, and its flow in natural units."""

    system: LienardSystem
    elevator_rad: float
    scale: Scale
    flow: Flow
    points: tuple[Rest, ...]

    def region(self, sink: Rest, alpha_range_rad: tuple[float, float]) -> StabilityRegion:
        length, speed = self.scale.length_rad, self.scale.speed_rad_s
        limits = (alpha_range_rad[0] / length, alpha_range_rad[1] / length)
        if not limits[0] < limits[1]:
            raise RefusedError(f"the range of angles {alpha_range_rad} is empty")
        reach = _WIDE * max(map(abs, (*limits, *(point.x for point in self.points))))
        found = basin(self.flow, self.points, sink, reach, max(map(abs, limits)))
        columns = theta_columns(self.system, self.elevator_rad, self.scale)
        size, size_by = area(self.flow, found, limits)
        near = nearest(self.flow, found)
        alpha, alpha_dot = near.x * length, near.y * speed
        angles = [sink.x, *(saddle.x for saddle, _ in found.entering)]
        angles += [x for cycle in found.cycles for x in (cycle.x_min, cycle.x_max)]
        angles += [near.x] if found.curves else []
        beyond, tongues = self._beyond(found, size, reach)
        size *= length * speed
        sampled = [self._sampled(found, number, limits, columns, near.frequency) for number in range(len(found.curves))]
        return StabilityRegion(
            elevator_rad=self.elevator_rad,
            alpha_rad=sink.x * length,
            q_rad_s=float(self.system.pitch_rate(sink.x * length, self.elevator_rad)),
            boundary=tuple(self._branches(found, sampled)),
            cycles=tuple(self._cycles(found, sampled)),
            alpha_range_rad=frozen_array(alpha_range_rad),
            area_rad2_s=size,
            area_interval_rad2_s=self.system.interval(size, length * speed * (size_by @ columns)),
            area_beyond_rad2_s=frozen_array(np.array(beyond) * length * speed),
            tongues=tongues,
            frequency_rad_s=near.frequency / self.scale.time_s,
            escape_distance_rad=near.distance * length,
            escape_interval_rad=self.system.interval(near.distance * length, length * (near.by @ columns)),
            escape_alpha_rad=alpha,
            escape_alpha_dot_rad_s=alpha_dot,
            escape_q_rad_s=float(self.system.pitch_rate_at(alpha, alpha_dot, self.elevator_rad)),
            in_domain=bool(self.system.supports([x * length for x in angles]).all()),
        )

    def _beyond(self, found: Basin, size: float, reach: float) -> tuple[tuple[float, float], tuple[Tongue, ...]]:
        """Return the least and greatest area beyond the range of angles, in flow units, and the tongues."""
        length, speed = self.scale.length_rad, self.scale.speed_rad_s
        if math.isinf(size) or not found.curves:
            return (math.inf, math.inf), ()
        whole = area(self.flow, found, (-reach, reach))[0]
        if math.isinf(whole):  # the boundary was not followed so far, or is open there
            return (0.0, math.inf), ()
        wide = max(0.0, whole - size)
        bound = wide
        tongues: list[Tongue] = []
        if not found.enclosed:
            for line, heights in zip((-reach, reach), crossings(found, (-reach, reach)), strict=True):
                for (low, _), (high, _) in zip(heights[::2], heights[1::2], strict=True):
                    trap = backward_trap(self.flow, line, (low, high))
                    tongues.append(
                        Tongue(
                            alpha_rad=line * length,
                            low_rad_s=low * speed,
                            high_rad_s=high * speed,
                            power=trap.power,
                            slopes=frozen_array(np.array([trap.low, trap.high]) * speed / length**trap.power),
                            obstacle=trap.obstacle,
                        )
                    )
                    bound += (high - low) / trap.rate if trap.rate else math.inf
        return (wide, bound), tuple(tongues)

    def _branches(self, found: Basin, sampled: Sequence[FloatArray]) -> Iterator[BoundaryBranch]:
        for curve, points in zip(found.branches, sampled, strict=False):
            if len(points):
                alpha, alpha_dot, half_width = points.T
                yield BoundaryBranch(
                    saddle_alpha_rad=curve.saddle.x * self.scale.length_rad,
                    side=curve.side,
                    ending=curve.ending,
                    alpha_rad=alpha,
                    alpha_dot_rad_s=alpha_dot,
                    q_rad_s=self.system.pitch_rate_at(alpha, alpha_dot, self.elevator_rad),
                    half_width_rad=half_width,
                )

    def _cycles(self, found: Basin, sampled: Sequence[FloatArray]) -> Iterator[BoundaryCycle]:
        for number, (curve, points) in enumerate(zip(found.cycles, sampled[len(found.branches) :], strict=True)):
            alpha, alpha_dot, half_width = points.T
            yield BoundaryCycle(
                alpha_min_rad=curve.x_min * self.scale.length_rad,
                alpha_max_rad=curve.x_max * self.scale.length_rad,
                period_s=curve.period * self.scale.time_s,
                around=found.enclosed and number == 0,
                alpha_rad=alpha,
                alpha_dot_rad_s=alpha_dot,
                q_rad_s=self.system.pitch_rate_at(alpha, alpha_dot, self.elevator_rad),
                half_width_rad=half_width,
            )

    def _sampled(
        self, found: Basin, number: int, limits: tuple[float, float], columns: FloatArray, frequency: float
    ) -> FloatArray:
        """Return points of a curve between the limits, with the half-widths of their 95 % intervals; shape (n, 3)."""
        rows: list[FloatArray] = []
        for segment, wedge in zip(found.curves[number].segments, found.wedges[number], strict=True):
            for start, end in segment.within(limits):
                steps = np.linspace(start, end, _SAMPLES + 1)[1 if rows else 0 :]
                x, y = segment.at(steps)
                rate = np.array([self.flow.acceleration(*state) for state in zip(x, y, strict=True)])
                motion = series_at(wedge, steps) @ columns
                spread = np.sqrt(np.maximum(0.0, np.einsum("ij,jk,ik->i", motion, self.system.covariance, motion)))
                with np.errstate(invalid="ignore", divide="ignore"):  # the saddle itself, put right below
                    across = NORMAL_95 * spread / np.hypot(frequency * y, rate)
                rows.append(np.column_stack([x, y, across]))
        points = np.concatenate(rows) if rows else np.empty((0, 3))
        if len(points) > 1 and not math.isfinite(points[0, 2]):
            points[0, 2] = points[1, 2]
        units = np.array([self.scale.length_rad, self.scale.speed_rad_s, self.scale.length_rad])
        return np.asarray(points * units)
