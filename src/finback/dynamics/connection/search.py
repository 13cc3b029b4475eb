"""The search for saddle connections over the elevator."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.connection.connection import Direction, Heteroclinic, Homoclinic, elevator_gradient
from finback.dynamics.equilibrium import Kind, eigenvalues, kind_of
from finback.dynamics.flow import Flow, Rest, Scale, derivative, flow_at, horner, natural_scale, rests
from finback.dynamics.fold import folds
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.orbit.splitting import Field, Route, routes
from finback.dynamics.orbit.splitting_search import Joint, Search
from finback.dynamics.roots import real_roots
from finback.errors import RefusedError

_MARGINS: Final = (1e-6, 1e-5, 1e-4, 1e-3)  # of a stretch, left out at folds, where orbits become infinitely slow
_LOOP_NODES: Final = 24  # elevators at which the splitting of orbits that turn is sampled; it need not be monotone
_MOST_TURNS: Final = 6
_SMALL: Final = 1e-10  # units of the flow
_ITERATIONS: Final = 200  # more than bisection of a stretch needs


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """Elevators between two folds, or between a fold and the end of the range: the equilibria keep number and kind.

    Attributes:
        elevator_rad: its ends, shape (2,).
        saddles: how many saddles there are.
        others: how many other equilibria.
        obstacle: why it could not be searched, wholly or in part; empty if it was.
    """

    elevator_rad: FloatArray
    saddles: int
    others: int
    obstacle: str

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "elevator_rad", frozen_array(self.elevator_rad))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Connections:
    """What was found, and where it was looked for.

    Attributes:
        heteroclinics: by rising elevator.
        homoclinics: by rising elevator.
        stretches: what was searched, by rising elevator.
    """

    heteroclinics: tuple[Heteroclinic, ...]
    homoclinics: tuple[Homoclinic, ...]
    stretches: tuple[Stretch, ...]


def connections(system: LienardSystem, elevator_range_rad: tuple[float, float]) -> Connections:
    """Find the saddle connections.

    Every stretch between two folds is searched whole; one that no fold ends, up to the end of the given range, if
    that lies in it. Heteroclinic orbits that do not turn: all of them, because their splitting is monotone in the
    elevator. Orbits that turn: each sign change of their splitting between 24 elevators of a stretch and the
    connections of fewer turns (two sign changes between neighbors would be missed). With one saddle, or with one
    equilibrium between two, an orbit that turns more often than twice, or once, is enclosed by its own first arc.
    With more there may be orbits that turn any number of times; those of more than six turns are not looked for. What
    lies nearer to a fold than a millionth of the stretch (up to a thousandth, where orbits are too slow to be followed
    there) is not seen.
    """
    heteroclinics: list[Heteroclinic] = []
    homoclinics: list[Homoclinic] = []
    stretches: list[Stretch] = []
    for low, high in _stretches(system, elevator_range_rad):
        kinds: tuple[Kind, ...] = ()
        obstacle = ""
        try:
            scale, kinds = natural_scale(system, 0.5 * (low + high))
            stage = _Stage.of(system, scale, 0.5 * (low + high))
            for joint in stage.joints(low, high):
                if joint.route.source == joint.route.target:
                    homoclinics.append(stage.homoclinic(joint))
                else:
                    heteroclinics.append(stage.heteroclinic(joint))
        except RefusedError as refusal:
            obstacle = refusal.message
        saddles = kinds.count(Kind.SADDLE)
        stretches.append(
            Stretch(
                elevator_rad=frozen_array((low, high)),
                saddles=saddles,
                others=len(kinds) - saddles,
                obstacle=obstacle,
            )
        )
    return Connections(
        heteroclinics=tuple(sorted(heteroclinics, key=lambda found: found.elevator_rad)),
        homoclinics=tuple(sorted(homoclinics, key=lambda found: found.elevator_rad)),
        stretches=tuple(stretches),
    )


def _stretches(system: LienardSystem, elevator_range_rad: tuple[float, float]) -> Iterator[tuple[float, float]]:
    ends = sorted({fold.elevator_rad for fold in folds(system)})
    if system.elevator_gain == 0.0 or not ends:
        return  # without a fold there is one equilibrium at most, or the elevator moves none
    low, high = elevator_range_rad
    yield from pairwise([*([low] if low < ends[0] else []), *ends, *([high] if high > ends[-1] else [])])


@final
@dataclass(frozen=True, slots=True)
class _Stage:
    """A stretch: the system in units of its size there."""

    system: LienardSystem
    scale: Scale
    still: Flow  # at elevator 0
    push: float  # what the elevator adds to g
    middle: tuple[Rest, ...]  # the equilibria in the middle
    extrema: tuple[float, ...]  # of g, which the elevator does not move
    zeros: tuple[float, ...]  # of f

    @classmethod
    def of(cls, system: LienardSystem, scale: Scale, middle: float) -> _Stage:
        still = flow_at(system, 0.0, scale)
        slope = derivative(still.force)
        return cls(
            system=system,
            scale=scale,
            still=still,
            push=system.elevator_gain * scale.time_s * scale.time_s / scale.length_rad,
            middle=rests(flow_at(system, middle, scale)),
            extrema=tuple(root.value for root in real_roots(slope)) if any(slope) else (),
            zeros=tuple(root.value for root in real_roots(still.damping)) if any(still.damping) else (),
        )

    def joints(self, low: float, high: float) -> tuple[Joint, ...]:
        every = tuple(routes(self.middle, _MOST_TURNS))
        field = cache(self.field)
        ends = tuple(_near(field, every, end, other) for end, other in ((low, high), (high, low)))
        phases = np.pi * (np.arange(_LOOP_NODES) + 0.5) / _LOOP_NODES
        nodes = ends[0] + (ends[1] - ends[0]) * 0.5 * (1.0 - np.cos(phases))
        inner = frozenset(nodes.tolist())

        def wanted(route: Route, elevator: float) -> bool:
            if not route.turns:
                return elevator not in inner
            return elevator not in ends and self._can_close(route, field(elevator).points)

        samples = (ends[0], *sorted(inner), ends[1])
        return Search(field=field, samples=samples, unit=high - low, wanted=wanted, guesses={}).joints(every)

    def field(self, elevator: float) -> Field:
        pushed = self.still.force[0] + self.push * elevator
        size = self.still.force_sizes[0] + abs(self.push * elevator)
        flow = Flow(
            damping=self.still.damping,
            force=(pushed, *self.still.force[1:]),
            force_sizes=(size, *self.still.force_sizes[1:]),
        )
        return Field.of(flow, self._points(flow))

    def _points(self, flow: Flow) -> tuple[Rest, ...]:
        """Return the equilibria: each between the extrema of g between which it lies in the middle of the stretch."""
        force, slope = flow.force, derivative(flow.force)
        found = []
        for seed in self.middle:
            low = max((x for x in self.extrema if x < seed.x), default=-math.inf)
            high = min((x for x in self.extrema if x > seed.x), default=math.inf)
            x = _root(force, slope, seed.x, (low, high))
            trace, determinant = horner(flow.damping, x), -horner(slope, x)
            if (determinant < 0.0) != (seed.kind is Kind.SADDLE):
                raise RefusedError("near a fold the equilibria cannot be told apart in double precision")
            values, _ = eigenvalues(trace, determinant)
            found.append(Rest(x=x, kind=kind_of(trace, determinant), eigenvalues_real=values))
        return tuple(found)

    def _can_close(self, route: Route, points: tuple[Rest, ...]) -> bool:
        """Tell whether f changes its sign where a loop can be, as it must (Bendixson 1901)."""
        if route.source != route.target:
            return True
        ends = [-np.inf if points[0].kind is not Kind.SADDLE else points[0].x]
        ends.append(np.inf if points[-1].kind is not Kind.SADDLE else points[-1].x)
        if route.turns == 1:
            ends[(1 - route.side) // 2] = points[route.source].x
        return any(ends[0] < zero < ends[1] for zero in self.zeros)

    def heteroclinic(self, joint: Joint) -> Heteroclinic:
        field, length = self.field(joint.parameter), self.scale.length_rad
        source, target = (field.points[k].x * length for k in (joint.route.source, joint.route.target))
        turns = np.array(field.turning_points(joint.route)) * length
        return Heteroclinic(
            elevator_rad=joint.parameter,
            from_alpha_rad=source,
            to_alpha_rad=target,
            turns_alpha_rad=turns,
            direction=_direction(joint.route),
            elevator_interval_rad=self._interval(joint, field),
            bracket_rad=frozen_array(joint.bracket),
            residual_rad_s=self._miss(joint, field) * self.scale.speed_rad_s,
            resolved=joint.resolved,
            in_domain=bool(self.system.supports([source, target, *turns]).all()),
        )

    def homoclinic(self, joint: Joint) -> Homoclinic:
        field, length = self.field(joint.parameter), self.scale.length_rad
        saddle = field.points[joint.route.source].x * length
        turns = np.array(field.turning_points(joint.route)) * length
        return Homoclinic(
            elevator_rad=joint.parameter,
            alpha_rad=saddle,
            turn_alpha_rad=float(turns[0]),
            turns_alpha_rad=turns,
            direction=_direction(joint.route),
            divergence_1_s=float(self.system.damping(saddle)),
            elevator_interval_rad=self._interval(joint, field),
            bracket_rad=frozen_array(joint.bracket),
            residual_rad=self._miss(joint, field) * length,
            resolved=joint.resolved,
            in_domain=bool(self.system.supports([saddle, *turns]).all()),
        )

    def _miss(self, joint: Joint, field: Field) -> float:
        """Return the splitting, or of a canard, which throws a miss apart, the least miss as a share of y."""
        if not joint.route.turns or abs(joint.residual) <= _SMALL:
            return joint.residual
        least = field.least_miss(joint.route)
        return least if abs(least) < abs(joint.residual) else joint.residual

    def _interval(self, joint: Joint, field: Field) -> FloatArray:
        gradient = elevator_gradient(self.system, joint.parameter, field.splitting(joint.route), self.scale)
        return self.system.interval(joint.parameter, gradient)


def _direction(route: Route) -> Direction:
    return Direction.RISING if route.side > 0 else Direction.FALLING


def _near(field: Callable[[float], Field], every: tuple[Route, ...], end: float, other: float) -> float:
    """Return an elevator near an end of a stretch, as near as orbits can be followed."""
    for margin in _MARGINS[:-1]:
        elevator = end + margin * (other - end)
        try:
            for route in every:
                if not route.turns:
                    field(elevator).gap(route)
        except RefusedError:
            continue
        return elevator
    return end + _MARGINS[-1] * (other - end)


def _root(force: tuple[float, ...], slope: tuple[float, ...], start: float, ends: tuple[float, float]) -> float:
    """Return the zero of g between two of its extrema, where it is monotone: Newton's method, kept inside."""
    low, high = ends
    x = start
    rising = horner(slope, x) > 0.0
    last = math.inf
    for _ in range(_ITERATIONS):
        value, steepness = horner(force, x), horner(slope, x)
        if value == 0.0:
            return x
        low, high = (low, x) if (value > 0.0) == rising else (x, high)
        newton = x - value / steepness if steepness else math.nan
        step = abs(newton - x)
        if step <= math.ulp(x) or (step < _SMALL and step >= 0.5 * last):  # rounding keeps it from falling further
            return newton
        if not low < newton < high:
            newton = 0.5 * (low + high)
        x, last = newton, step
    raise RefusedError("near a fold the equilibria cannot be told apart in double precision")
