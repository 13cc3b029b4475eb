"""Limit cycles of a Liénard system at a held elevator: where they are, how stable, how well known."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.polynomial import polynomial

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.cycle.flow_cycle import FlowCycle, Searched, locate
from finback.dynamics.cycle.variation import NODES, HalfOrbit, Variation, cycle_halves, cycle_stretches, variation
from finback.dynamics.flow import Scale, flow_at, natural_scale
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.orbit.closure import Field
from finback.dynamics.orbit.natural_unit import natural_unit
from finback.errors import RefusedError

_ZOOM: Final = np.linspace(-1.0, 1.0, 33)
_BEYOND: Final = 0.01  # of a step: between the last node of one step and the first of the next
_LARGEST: Final = 700.0  # of the logarithm of a number


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """A limit cycle: a periodic motion that others near it approach, or leave.

    Attributes:
        elevator_rad: the elevator, held.
        alpha_min_rad: the smallest angle.
        alpha_max_rad: the largest.
        amplitude_rad: half of their difference.
        q_min_rad_s: the smallest pitch rate.
        q_max_rad_s: the largest.
        period_s: the time of a turn.
        log_multiplier: logarithm of the Floquet multiplier: what a deviation grows by in a turn.
        enclosed_alpha_rad: the equilibria inside, by rising angle, shape (n,).
        amplitude_interval_rad: 95 % interval by the delta method (wedge integrals along the cycle), shape (2,).
        period_interval_s: the same for the period.
        bracket_rad: two places of the largest angle around it from which orbits miss themselves on opposite sides,
            shape (2,).
        residual_rad: by how much the orbit misses itself, in angle.
        in_domain: whether the whole cycle lies at angles where data supported the model.
    """

    elevator_rad: float
    alpha_min_rad: float
    alpha_max_rad: float
    amplitude_rad: float
    q_min_rad_s: float
    q_max_rad_s: float
    period_s: float
    log_multiplier: float
    enclosed_alpha_rad: FloatArray
    amplitude_interval_rad: FloatArray
    period_interval_s: FloatArray
    bracket_rad: FloatArray
    residual_rad: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("enclosed_alpha_rad", "amplitude_interval_rad", "period_interval_s", "bracket_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))

    @property
    def multiplier(self) -> float:
        """The Floquet multiplier; 0 or inf beyond double precision."""
        return math.exp(self.log_multiplier) if self.log_multiplier < _LARGEST else math.inf

    @property
    def stable(self) -> bool:
        """Whether deviations decay."""
        return self.log_multiplier < 0.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Cycles:
    """The limit cycles at one elevator, and where they were looked for.

    Attributes:
        cycles: by number of equilibria enclosed, then by place, then outward; measured, not proven, to be all.
        searched: what was done for every group of equilibria; places in units of ``scale``.
        scale: those units.
    """

    cycles: tuple[Cycle, ...]
    searched: tuple[Searched, ...]
    scale: Scale


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CycleOrbit:
    """A cycle as a closed curve, in order of time, the first point repeated at the end; arrays of equal length.

    Attributes:
        time_s: since the largest angle.
        alpha_rad: the angle.
        alpha_dot_rad_s: its rate.
        q_rad_s: pitch rate.
    """

    time_s: FloatArray
    alpha_rad: FloatArray
    alpha_dot_rad_s: FloatArray
    q_rad_s: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("time_s", "alpha_rad", "alpha_dot_rad_s", "q_rad_s"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def cycles(system: LienardSystem, elevator_rad: float) -> Cycles:
    """Find the limit cycles at a held elevator (see ``flow_cycle`` for what is searched).

    Raises:
        RefusedError: two equilibria meet there within rounding.
    """
    flow, scale = natural_unit(flow_at(system, elevator_rad, Scale(length_rad=1.0, time_s=1.0)))
    found, searched = locate(flow)
    return Cycles(
        cycles=tuple(cycle_of(system, elevator_rad, scale, (one.field, one.right), one.cycle) for one in found),
        searched=searched,
        scale=scale,
    )


def cycle_of(
    system: LienardSystem, elevator_rad: float, scale: Scale, place: tuple[Field, float], flow_cycle: FlowCycle
) -> Cycle:
    """Return a cycle of a flow with units, pitch rate and intervals.

    Args:
        system: the system.
        elevator_rad: the elevator.
        scale: the units of the flow.
        place: the flow in the coordinate in which the cycle was found, and where it turns on the right in that.
        flow_cycle: the cycle.
    """
    field, right = place
    amplitude = 0.5 * (flow_cycle.x_max - flow_cycle.x_min) * scale.length_rad
    period = flow_cycle.period * scale.time_s
    left = min(field.u_of(flow_cycle.x_min), field.u_of(flow_cycle.x_max))
    gradients = [np.zeros(len(system.covariance))] * 2
    try:
        halves = cycle_halves(field, (left, right), flow_cycle.log_multiplier)
        orbit: Iterable[HalfOrbit] = halves
        if system.covariance.any():
            moves = variation(field, halves, right, sizes_of(system))
            gradients = _gradients(system, elevator_rad, scale, moves)
    except RefusedError:
        # So stiff that its steps are too many to be kept for integrals along it: they are looked at one by one.
        orbit = cycle_stretches(field, (left, right), flow_cycle.log_multiplier)
        gradients = [np.full(len(system.covariance), math.inf if system.covariance.any() else 0.0)] * 2
    low, high = flow_cycle.x_min * scale.length_rad, flow_cycle.x_max * scale.length_rad
    rates = _pitch_rates(system, elevator_rad, scale, field, orbit)
    return Cycle(
        elevator_rad=elevator_rad,
        alpha_min_rad=low,
        alpha_max_rad=high,
        amplitude_rad=amplitude,
        q_min_rad_s=rates[0],
        q_max_rad_s=rates[1],
        period_s=period,
        log_multiplier=flow_cycle.log_multiplier,
        enclosed_alpha_rad=frozen_array(np.array(flow_cycle.enclosed) * scale.length_rad),
        amplitude_interval_rad=system.interval(amplitude, gradients[0]),
        period_interval_s=system.interval(period, gradients[1]),
        bracket_rad=frozen_array(flow_cycle.bracket * scale.length_rad),
        residual_rad=flow_cycle.residual * scale.length_rad,
        in_domain=bool(system.supports((low, high)).all()),
    )


def cycle_orbit(system: LienardSystem, cycle: Cycle) -> CycleOrbit:
    """Return a cycle as a closed curve, some hundred points."""
    scale, _ = natural_scale(system, cycle.elevator_rad)
    flow = flow_at(system, cycle.elevator_rad, scale)
    field = Field(np.array(flow.damping), np.array(flow.force), 0.0, mirrored=False)
    left, right = cycle.alpha_min_rad / scale.length_rad, cycle.alpha_max_rad / scale.length_rad
    ahead, behind = cycle_halves(field, (left, right), cycle.log_multiplier)
    turn = np.array([0.0]), np.array([right]), np.array([0.0])
    # Backward from the right end is the second half of the turn, from its end.
    times = np.concatenate([turn[0], ahead.time.ravel(), behind.time.ravel()[::-1] + cycle.period_s / scale.time_s])
    x = np.concatenate([turn[1], ahead.x.ravel(), behind.x.ravel()[::-1]])
    y = np.concatenate([turn[2], ahead.y.ravel(), behind.y.ravel()[::-1]])
    alpha, alpha_dot = x * scale.length_rad, y * scale.speed_rad_s
    q = system.pitch_rate_at(alpha, alpha_dot, cycle.elevator_rad)
    alpha, alpha_dot, q = (np.append(row, row[0]) for row in (alpha, alpha_dot, q))
    times = np.append(times * scale.time_s, cycle.period_s)
    return CycleOrbit(time_s=times, alpha_rad=alpha, alpha_dot_rad_s=alpha_dot, q_rad_s=q)


def sizes_of(system: LienardSystem) -> tuple[int, int]:
    """Return how many coefficients the damping and the force of a system have."""
    return system.damping.ascending.size, system.force.ascending.size


def by_theta(
    system: LienardSystem, elevator_rad: float, scale: Scale, by_coefficients: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Return the derivative by θ, shape (p,), of what has these derivatives by the coefficients of the flow."""
    length, time = scale.length_rad, scale.time_s
    by_f, by_g = by_coefficients
    moved = by_g[0] * time * time / length * elevator_rad * system.elevator_gain_sensitivity
    for power, row in zip(system.damping.polynomial.powers[:, 0], system.damping.sensitivity, strict=True):
        moved = moved + by_f[power] * time * length**power * row
    for power, row in zip(system.force.polynomial.powers[:, 0], system.force.sensitivity, strict=True):
        moved = moved + by_g[power] * time * time * length ** (power - 1) * row
    return np.asarray(moved)


def _gradients(system: LienardSystem, elevator_rad: float, scale: Scale, moves: Variation) -> list[FloatArray]:
    """Return the derivatives by θ of the amplitude and of the period, shape (p,) each; not finite at a fold."""
    with np.errstate(all="ignore"):
        low, high, period = (
            by_theta(system, elevator_rad, scale, rows) for rows in (moves.x_min, moves.x_max, moves.period)
        )
        return [0.5 * (high - low) * scale.length_rad, period * scale.time_s]


def _pitch_rates(
    system: LienardSystem, elevator_rad: float, scale: Scale, field: Field, orbit: Iterable[HalfOrbit]
) -> tuple[float, float]:
    """Return the least and the largest pitch rate: the best of the nodes, then three closer looks."""
    sign = -1.0 if field.mirrored else 1.0
    held = _held(system, elevator_rad)

    def rate(x: FloatArray, y: FloatArray) -> FloatArray:
        alpha, alpha_dot = (field.origin + sign * x) * scale.length_rad, sign * y * scale.speed_rad_s
        return np.asarray(polynomial.polyval(alpha, held, tensor=False) + system.pitch_rate_gain * alpha_dot)

    best: list[tuple[float, FloatArray, float]] = [(-math.inf, np.zeros((0, 2)), 0.0)] * 2
    for stretch in orbit:
        values = rate(stretch.x, stretch.y)
        for index, way in enumerate((-1.0, 1.0)):
            piece, node = np.unravel_index(int(np.argmax(way * values)), values.shape)
            found = way * float(values[piece, node])
            if found > best[index][0]:
                best[index] = (found, stretch.series[piece].T.copy(), float(NODES[node]))
    ends = []
    for way, (value, series, place) in zip((-1.0, 1.0), best, strict=True):
        center, width, highest = place, 2.0 / NODES.size, value
        for _ in range(3):
            times = np.clip(center + width * _ZOOM, -_BEYOND, 1.0 + _BEYOND)
            x, y = (np.vander(times, len(series), increasing=True) @ series).T
            near = way * rate(x, y)
            center, width, highest = float(times[int(np.argmax(near))]), width / 12.0, float(near.max())
        ends.append(way * highest)
    return ends[0], ends[1]


def _held(system: LienardSystem, elevator_rad: float) -> FloatArray:
    """Return q where dα/dt = 0 by rising power of alpha, at a held elevator."""
    curve = system.pitch_rate.polynomial
    row = np.zeros(int(curve.powers[:, 0].max(initial=0)) + 1)
    np.add.at(row, curve.powers[:, 0], curve.coefficients * elevator_rad ** curve.powers[:, 1])
    return row
