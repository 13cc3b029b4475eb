"""Families of periodic orbits of any field by continuation, from a Hopf point or a nearly closed orbit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.branch import scaled_field
from finback.dynamics.continuation.collocation import DEGREE, CycleEquations
from finback.dynamics.continuation.cycle_point import CyclePoint, FollowedCycle, cycle_happenings, extent
from finback.dynamics.continuation.field import BlackBox, FieldError, ScaledField
from finback.dynamics.continuation.hopf import HopfPoint
from finback.dynamics.continuation.path import PathPoint, correct, null_direction, point_at
from finback.errors import InputError, RefusedError

_GROWTH: Final = 1.4
_VANISHED: Final = 0.3  # of the first amplitude: a family that shrinks to this has reached another Hopf point


class CycleEnding(StrEnum):
    """Why a family of cycles ends."""

    PARAMETER_LIMIT = "parameter-limit"
    STATE_LIMIT = "state-limit"
    PERIOD_LIMIT = "period-limit"
    """it approaches a homoclinic or heteroclinic loop, if the period keeps growing"""
    HOPF_POINT = "hopf-point"
    """it shrinks to an equilibrium"""
    UNRESOLVED = "unresolved"
    """the mesh is too coarse for the orbit"""
    STEP_TOO_SMALL = "step-too-small"
    FIELD_FAILED = "field-failed"
    POINTS_USED_UP = "points-used-up"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CycleOptions:
    """How a family of cycles is followed. Lengths are in typical sizes.

    Attributes:
        intervals: of the mesh, each with a polynomial of degree four.
        first_amplitude: root mean square of the first cycle at a Hopf point.
        largest_step: root mean square of the change of the orbit, with period and parameter.
        smallest_step: where it is given up.
        largest_turn_rad: a step over which the tangent turns by more is halved.
        most_points: of the family.
        largest_period: times the first period.
        largest_defect: of the differential equation between Gauss points, in units of the orbit's rates.
    """

    intervals: int = 30
    first_amplitude: float = 0.01
    largest_step: float = 0.1
    smallest_step: float = 1e-6
    largest_turn_rad: float = 0.5
    most_points: int = 200
    largest_period: float = 50.0
    largest_defect: float = 0.05

    def __post_init__(self) -> None:
        """Check."""
        if self.intervals < 4 or self.most_points < 2 or not 0.0 < self.smallest_step < self.largest_step:
            raise InputError(
                f"{self.intervals} intervals, {self.most_points} points, steps from {self.smallest_step:g} to"
                f" {self.largest_step:g}: at least 4 intervals and 2 points, steps rising"
            )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CycleBranch:
    """A family of n cycles.

    Attributes:
        parameter: shape (n,).
        period: shape (n,).
        state_min: smallest value of each state, shape (n, d).
        state_max: largest, shape (n, d).
        multipliers_real: Floquet multipliers, shape (n, d).
        multipliers_imag: imaginary parts.
        stable: all multipliers but the one along the orbit lie inside the unit circle, shape (n,).
        trivial_error: distance of that one from 1: what the multipliers are worth, shape (n,). Near a loop it grows;
            beyond 0.01 ``stable`` is not to be trusted, and no point found by multipliers is reported.
        residual: largest of the collocation equations, in units of the orbit's rates, shape (n,).
        defect: of the differential equation at the mesh points, in the same units, shape (n,).
        orbit_time: times of the orbit's nodes, the first again at the end, shape (n, N + 1).
        orbit_state: states there, shape (n, N + 1, d).
        end: why the family ends.
        end_note: the same in words.
        points: what happens on it, in its order.
    """

    parameter: FloatArray
    period: FloatArray
    state_min: FloatArray
    state_max: FloatArray
    multipliers_real: FloatArray
    multipliers_imag: FloatArray
    stable: NDArray[np.bool_]
    trivial_error: FloatArray
    residual: FloatArray
    defect: FloatArray
    orbit_time: FloatArray
    orbit_state: FloatArray
    end: CycleEnding
    end_note: str
    points: tuple[CyclePoint, ...]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        names = ("parameter", "period", "state_min", "state_max", "multipliers_real", "multipliers_imag")
        for name in (*names, "trivial_error", "residual", "defect", "orbit_time", "orbit_state"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        stable = np.array(self.stable, dtype=np.bool_)
        stable.setflags(write=False)
        object.__setattr__(self, "stable", stable)


def cycles_from_hopf(box: BlackBox, hopf: HopfPoint, options: CycleOptions | None = None) -> CycleBranch:
    """Return the family of cycles that begins at a Hopf point.

    Args:
        box: the field of one parameter on which the point was found.
        hopf: where to begin.
        options: mesh and steps.

    Raises:
        RefusedError: no small cycle is found, as where the point lies at a corner of the field.
    """
    scaled, options = scaled_field(box), options or CycleOptions()
    d = scaled.states
    mesh = np.linspace(0.0, 1.0, options.intervals + 1)
    count = options.intervals * DEGREE
    turn = np.exp(2j * math.pi * np.arange(count) / count)
    vector = (hopf.eigenvector_real + 1j * hopf.eigenvector_imag) / scaled.scale[:d]
    wave = (turn[:, np.newaxis] * vector).real
    wave /= math.sqrt(float((wave * wave).sum()) / count)
    rest = hopf.state / scaled.scale[:d]
    period = 2.0 * math.pi / hopf.frequency
    nodes = rest + options.first_amplitude * wave
    equations = CycleEquations(scaled, mesh, nodes, period)
    along = np.append(wave.ravel() / math.sqrt(count), [0.0, 0.0])
    u = equations.unknowns(nodes, period, hopf.parameter / float(scaled.scale[d]))
    try:
        found = correct(equations, u, along, float(along @ u), equations.jacobian(u))
    except FieldError as error:
        raise RefusedError(f"the field failed {error}", hint="choose a smaller first amplitude") from error
    if found is None:
        raise RefusedError(
            f"no cycle of amplitude {options.first_amplitude:g} is found at parameter {hopf.parameter:g}",
            hint="choose a smaller first amplitude; at a corner of the field start from an orbit",
        )
    return _family(scaled, equations, point_at(equations, found, along), options)


def cycles_from_orbit(
    box: BlackBox,
    *,
    time: ArrayLike,
    state: ArrayLike,
    parameter: float,
    options: CycleOptions | None = None,
    upward: bool = True,
) -> CycleBranch:
    """Return the family of cycles through an orbit that is nearly closed, as integration gives one.

    Args:
        box: the field of one parameter.
        time: rising, the whole period, shape (n,).
        state: the orbit, shape (n, d); its ends need not quite meet.
        parameter: where.
        options: mesh and steps.
        upward: into which direction of the parameter to follow it.

    Raises:
        InputError: shapes that do not fit.
        RefusedError: no cycle is found near it.
    """
    scaled, options = scaled_field(box), options or CycleOptions()
    times, states = np.asarray(time, dtype=np.float64), np.asarray(state, dtype=np.float64)
    if times.ndim != 1 or states.shape != (times.size, scaled.states) or not (np.diff(times) > 0.0).all():
        raise InputError(f"times {times.shape} must rise and states {states.shape} have a row for each")
    period = float(times[-1] - times[0])
    share = (times - times[0]) / period
    # A straight correction closes the gap between the ends.
    states = (states - share[:, np.newaxis] * (states[-1] - states[0])) / scaled.scale[: scaled.states]
    mesh = np.linspace(0.0, 1.0, options.intervals + 1)
    count = options.intervals * DEGREE
    nodes = np.array([np.interp(np.arange(count) / count, share, column) for column in states.T]).T
    equations = CycleEquations(scaled, mesh, nodes, period)
    u = equations.unknowns(nodes, period, parameter / float(scaled.scale[-1]))
    row = np.zeros(len(u))
    row[-1] = 1.0
    try:
        found = correct(equations, u, row, float(u[-1]), equations.jacobian(u))
    except FieldError as error:
        raise RefusedError(f"the field failed {error}") from error
    if found is None:
        raise RefusedError(f"no cycle is found near this orbit at parameter {parameter:g}", hint="integrate longer")
    direction = null_direction(equations.jacobian(found))
    if (direction[-1] > 0.0) != upward:
        direction = -direction
    return _family(scaled, equations, point_at(equations, found, direction), options)


def _family(scaled: ScaledField, equations: CycleEquations, start: PathPoint, options: CycleOptions) -> CycleBranch:
    here = FollowedCycle.of(equations, start)
    cycles, happened = [here], list[CyclePoint]()
    first_period = equations.orbit(start.u)[1]
    first_amplitude = _amplitude(here)
    step = 0.5 * options.first_amplitude
    end, note = CycleEnding.POINTS_USED_UP, f"{options.most_points} points"
    while len(cycles) < options.most_points:
        try:
            there = _next(here, step, options)
        except FieldError as error:
            there, note = None, f"the field failed {error}"
            if step * 0.5 < options.smallest_step:
                end = CycleEnding.FIELD_FAILED
                break
        if there is None:
            step *= 0.5
            if step < options.smallest_step:
                end, note = CycleEnding.STEP_TOO_SMALL, f"no further cycle within {step:.1e}"
                break
            continue
        if _shrunk(here, there, first_amplitude):
            end, note = CycleEnding.HOPF_POINT, "the cycles shrink to an equilibrium"
            break
        happened += cycle_happenings(here, there)
        cycles.append(there)
        if (reached := _reached(scaled, there, first_period, options)) is not None:
            end, note = reached
            break
        if here.point.tangent @ there.point.tangent > math.cos(0.5 * options.largest_turn_rad):
            step = min(options.largest_step, step * _GROWTH)
        here = _renewed(there) if len(cycles) % 2 else there
    return _collected(scaled, cycles, happened, end, note)


def _next(here: FollowedCycle, step: float, options: CycleOptions) -> FollowedCycle | None:
    point = here.point
    guess = point.u + step * point.tangent
    u = correct(here.equations, guess, point.tangent, float(point.tangent @ guess), point.jacobian)
    if u is None or np.linalg.norm(u - guess) > step:
        return None
    there = point_at(here.equations, u, u - point.u)
    if there.tangent @ point.tangent < math.cos(options.largest_turn_rad):
        return None
    return FollowedCycle.of(here.equations, there)


def _renewed(cycle: FollowedCycle) -> FollowedCycle:
    """Return the same cycle on a mesh of its own, itself the reference of the phase; unchanged if that fails."""
    old = cycle.equations
    nodes, period, parameter = old.orbit(cycle.point.u)
    mesh = old.finer_mesh(nodes)
    times = CycleEquations(old.scaled, mesh, nodes, period).node_times()
    moved = old.states_at(nodes, times)
    equations = CycleEquations(old.scaled, mesh, moved, period)
    u = equations.unknowns(moved, period, parameter)
    way, slope, rise = old.orbit(cycle.point.tangent)
    along = equations.unknowns(old.states_at(way, times), slope, rise)
    try:
        found = correct(equations, u, along, float(along @ u), equations.jacobian(u))
    except FieldError:
        found = None
    return cycle if found is None else FollowedCycle.of(equations, point_at(equations, found, along))


def _amplitude(cycle: FollowedCycle) -> float:
    nodes, _, _ = cycle.equations.orbit(cycle.point.u)
    return math.sqrt(float(((nodes - nodes.mean(axis=0)) ** 2).sum()) / len(nodes))


def _shrunk(here: FollowedCycle, there: FollowedCycle, first: float) -> bool:
    """Tell whether the family has reached an equilibrium, or passed through it to its own mirror image."""
    before, after = (cycle.equations.orbit(cycle.point.u)[0] for cycle in (here, there))
    turned = float(((before - before.mean(axis=0)) * (after - after.mean(axis=0))).sum()) < 0.0
    return turned or _amplitude(there) < _VANISHED * first


def _reached(
    scaled: ScaledField, cycle: FollowedCycle, first_period: float, options: CycleOptions
) -> tuple[CycleEnding, str] | None:
    """Return why the family ends at this cycle, if it does."""
    nodes, period, parameter = cycle.equations.orbit(cycle.point.u)
    low, high = scaled.limits[:-1].T
    least, most = scaled.limits[-1]
    if not least <= parameter <= most:
        return CycleEnding.PARAMETER_LIMIT, "the last cycle lies beyond the range of the parameter"
    if (nodes < low).any() or (nodes > high).any():
        return CycleEnding.STATE_LIMIT, "the last cycle leaves the box of states"
    if period > options.largest_period * first_period:
        return CycleEnding.PERIOD_LIMIT, f"the period is {period:.6g}"
    defect = cycle.equations.defect(cycle.point.u)
    if defect > options.largest_defect:
        return CycleEnding.UNRESOLVED, f"a defect of {defect:.1e} with {options.intervals} intervals"
    return None


def _collected(
    scaled: ScaledField, cycles: list[FollowedCycle], happened: list[CyclePoint], end: CycleEnding, note: str
) -> CycleBranch:
    orbits = [cycle.equations.orbit(cycle.point.u) for cycle in cycles]
    sizes = scaled.scale[:-1]
    extents = [extent(cycle.equations, nodes) for cycle, (nodes, _, _) in zip(cycles, orbits, strict=True)]
    multipliers = np.array([cycle.multipliers for cycle in cycles])
    times = [
        np.append(cycle.equations.node_times(), 1.0) * period
        for cycle, (_, period, _) in zip(cycles, orbits, strict=True)
    ]
    return CycleBranch(
        parameter=np.array([parameter for _, _, parameter in orbits]) * scaled.scale[-1],
        period=np.array([period for _, period, _ in orbits]),
        state_min=np.array([low for low, _ in extents]) * sizes,
        state_max=np.array([high for _, high in extents]) * sizes,
        multipliers_real=multipliers.real,
        multipliers_imag=multipliers.imag,
        stable=np.array([cycle.stable for cycle in cycles]),
        trivial_error=np.abs(multipliers - 1.0).min(axis=1),
        residual=np.array([cycle.point.residual for cycle in cycles]),
        defect=np.array([cycle.equations.defect(cycle.point.u) for cycle in cycles]),
        orbit_time=np.array(times),
        orbit_state=np.array([np.vstack((nodes, nodes[:1])) for nodes, _, _ in orbits]) * sizes,
        end=end,
        end_note=note,
        points=tuple(happened),
    )
