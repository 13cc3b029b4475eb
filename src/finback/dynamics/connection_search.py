"""The search for saddle connections over the elevator."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np
from scipy.optimize import brentq

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.connection import Direction, Heteroclinic, Homoclinic, elevator_gradient
from finback.dynamics.equilibrium import Kind, eigenvalues, kind_of
from finback.dynamics.flow import Flow, Rest, Scale, derivative, flow_at, horner, natural_scale
from finback.dynamics.fold import folds
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.roots import real_roots
from finback.dynamics.splitting import Field, Route, routes
from finback.dynamics.splitting_search import Joint, Search
from finback.errors import RefusedError

_MARGINS: Final = (1e-6, 1e-5, 1e-4, 1e-3)  # of a stretch, left out at folds, where orbits become infinitely slow
_LOOP_NODES: Final = 24  # elevators at which the splitting of orbits that turn is sampled; it need not be monotone
_MOST_TURNS: Final = 6
_RELATIVE: Final = 4.0 * np.finfo(np.float64).eps
_ITERATIONS: Final = 10_000  # far beyond what bisection of all doubles needs


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
            stage = _Stage.of(system, scale, kinds)
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
    kinds: tuple[Kind, ...]
    extrema: tuple[float, ...]  # of g, which the elevator does not move
    zeros: tuple[float, ...]  # of f

    @classmethod
    def of(cls, system: LienardSystem, scale: Scale, kinds: tuple[Kind, ...]) -> _Stage:
        flow = flow_at(system, 0.0, scale)
        slope = derivative(flow.force)
        extrema = tuple(root.value for root in real_roots(slope)) if any(slope) else ()
        zeros = tuple(root.value for root in real_roots(flow.damping)) if any(flow.damping) else ()
        return cls(system, scale, kinds, extrema, zeros)

    def joints(self, low: float, high: float) -> tuple[Joint, ...]:
        points = self.field(0.5 * (low + high)).points
        every = tuple(routes(points, _MOST_TURNS))
        ends = tuple(self._end(every, end, other) for end, other in ((low, high), (high, low)))
        phases = np.pi * (np.arange(_LOOP_NODES) + 0.5) / _LOOP_NODES
        nodes = ends[0] + (ends[1] - ends[0]) * 0.5 * (1.0 - np.cos(phases))
        inner = frozenset(nodes.tolist())

        def wanted(route: Route, elevator: float) -> bool:
            if not route.turns:
                return elevator not in inner
            return elevator not in ends and self._can_close(route, elevator)

        samples = (ends[0], *sorted(inner), ends[1])
        return Search(field=self.field, samples=samples, unit=high - low, wanted=wanted).joints(every)

    def _end(self, every: tuple[Route, ...], end: float, other: float) -> float:
        """Return an elevator near an end of the stretch, as near as orbits can be followed."""
        straight = [route for route in every if not route.turns]
        for margin in _MARGINS[:-1]:
            elevator = end + margin * (other - end)
            try:
                for route in straight:
                    self.field(elevator).gap(route)
            except RefusedError:
                continue
            return elevator
        return end + _MARGINS[-1] * (other - end)

    def field(self, elevator: float) -> Field:
        flow = flow_at(self.system, elevator, self.scale)
        points = _points(flow, self.extrema)
        if [kind is Kind.SADDLE for kind in self.kinds] != [point.kind is Kind.SADDLE for point in points]:
            raise RefusedError("near a fold the equilibria cannot be told apart in double precision")
        return Field.of(flow, points)

    def _can_close(self, route: Route, elevator: float) -> bool:
        """Tell whether f changes its sign where a loop can be, as it must (Bendixson 1901)."""
        if route.source != route.target:
            return True
        points = self.field(elevator).points
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
            residual_rad_s=joint.residual * self.scale.speed_rad_s,
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
            residual_rad=joint.residual * length,
            resolved=joint.resolved,
            in_domain=bool(self.system.supports([saddle, *turns]).all()),
        )

    def _interval(self, joint: Joint, field: Field) -> FloatArray:
        gradient = elevator_gradient(self.system, joint.parameter, field.splitting(joint.route), self.scale)
        return self.system.interval(joint.parameter, gradient)


def _direction(route: Route) -> Direction:
    return Direction.RISING if route.side > 0 else Direction.FALLING


def _points(flow: Flow, extrema: tuple[float, ...]) -> tuple[Rest, ...]:
    """Return the equilibria: at most one between neighboring extrema of g."""
    force, slope = flow.force, derivative(flow.force)
    highest = max(k for k, c in enumerate(force) if c)
    # Twice Fujiwara's (1916) bound of the roots.
    edge = 4.0 * max(abs(c / force[highest]) ** (1.0 / (highest - k)) for k, c in enumerate(force[:highest]))
    ends = (-edge, *(x for x in extrema if abs(x) < edge), edge)
    found = []
    for (low, below), (high, above) in pairwise((x, horner(force, x)) for x in ends):
        if below * above < 0.0:
            x = float(brentq(lambda x: horner(force, x), low, high, xtol=1e-300, rtol=_RELATIVE, maxiter=_ITERATIONS))
            trace, determinant = horner(flow.damping, x), -horner(slope, x)
            found.append(
                Rest(x=x, kind=kind_of(trace, determinant), eigenvalues_real=eigenvalues(trace, determinant)[0])
            )
    return tuple(found)
