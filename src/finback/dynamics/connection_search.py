"""The search for saddle connections over the elevator."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise, permutations
from typing import Final, final

import numpy as np
from scipy.optimize import brentq

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.connection import Direction, Heteroclinic, Homoclinic, elevator_gradient
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest, Scale, flow_at, natural_scale, rests
from finback.dynamics.fold import folds
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.roots import real_roots
from finback.dynamics.splitting import Splitting, around, between
from finback.dynamics.taylor import Ending
from finback.errors import RefusedError

_MARGINS: Final = (1e-6, 1e-5, 1e-4, 1e-3)  # of a stretch, left out at folds, where orbits become infinitely slow
_LOOP_NODES: Final = 24  # elevators at which the splitting of loops is sampled; it need not be monotone
_RELATIVE: Final = 4.0 * math.ulp(1.0)
_CLOSED: Final = 1e-8  # of the system's size: a sign change with a larger splitting is a jump, no connection
_DOUBLINGS: Final = 40
_APART: Final = 1e3  # sizes of the system
_ITERATIONS: Final = 10_000  # far beyond what bisection of all doubles needs

Gap = Callable[[float], Splitting]


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
    """Find the saddle connections that turn at most once.

    Every stretch between two folds is searched whole; one that no fold ends, up to the end of the given range, if
    that lies in it. Heteroclinic orbits that do not turn: all of them, because their splitting is monotone in the
    elevator. Homoclinic orbits that turn once: each sign change of the splitting between 24 elevators of a stretch (two
    between neighboring elevators would be missed). With one other equilibrium between two saddles there are no
    connections of another kind: an orbit that has turned twice is enclosed by its own first arc. With more
    equilibria there may be, and they are not looked for. What lies nearer to a fold than a millionth of the
    stretch (up to a thousandth, where orbits are too slow to be followed there) is not seen.
    """
    heteroclinics: list[Heteroclinic] = []
    homoclinics: list[Homoclinic] = []
    stretches: list[Stretch] = []
    for low, high in _stretches(system, elevator_range_rad):
        kinds: tuple[Kind, ...] = ()
        obstacle = ""
        try:
            scale, kinds = natural_scale(system, 0.5 * (low + high))
            search = _Search(system, scale, low, high, kinds)
            heteroclinics += search.heteroclinics()
            homoclinics += search.homoclinics()
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
class _Search:
    """The search of one stretch."""

    system: LienardSystem
    scale: Scale
    low: float
    high: float
    kinds: tuple[Kind, ...]

    def heteroclinics(self) -> Iterator[Heteroclinic]:
        saddles = [index for index, kind in enumerate(self.kinds) if kind is Kind.SADDLE]
        for source, target in permutations(saddles, 2):

            def gap(elevator: float, source: int = source, target: int = target) -> Splitting:
                flow, points = self._at(elevator)
                return between(flow, points, source, target)

            (low, before), (high, after) = self._end(gap, self.low, self.high), self._end(gap, self.high, self.low)
            if before * after < 0.0:
                elevator = self._root(gap, low, high)
                found = gap(elevator)
                at_section = found.outgoing.path.ending is Ending.SECTION  # two that turn short of it never meet
                if found.met and at_section and abs(found.value) < _CLOSED:
                    yield self._heteroclinic(elevator, found, self._bracket(gap, elevator))

    def homoclinics(self) -> Iterator[Homoclinic]:
        loops = [
            (index, side)
            for index, kind in enumerate(self.kinds)
            for side in (-1, 1)
            if kind is Kind.SADDLE and 0 <= index + side < len(self.kinds)
        ]
        for index, side in loops:

            def gap(elevator: float, index: int = index, side: int = side) -> Splitting:
                flow, points = self._at(elevator)
                return around(flow, points, index, side)

            for left, right in self._sign_changes(gap, index, side):
                elevator = self._root(gap, left, right)
                found = gap(elevator)
                if found.met and abs(found.value) < _CLOSED:
                    yield self._homoclinic(elevator, found, self._bracket(gap, elevator))

    @staticmethod
    def _end(gap: Gap, end: float, other: float) -> tuple[float, float]:
        """Return an elevator near an end of the stretch, as near as orbits can be followed, and the splitting there."""
        for margin in _MARGINS[:-1]:
            elevator = end + margin * (other - end)
            try:
                return elevator, gap(elevator).value
            except RefusedError:
                continue
        elevator = end + _MARGINS[-1] * (other - end)
        return elevator, gap(elevator).value

    def _at(self, elevator: float) -> tuple[Flow, tuple[Rest, ...]]:
        flow = flow_at(self.system, elevator, self.scale)
        points = rests(flow)
        same = [kind is Kind.SADDLE for kind in self.kinds] == [point.kind is Kind.SADDLE for point in points]
        if not same:
            raise RefusedError("near a fold the equilibria cannot be told apart in double precision")
        return flow, points

    def _sign_changes(self, gap: Gap, index: int, side: int) -> Iterator[tuple[float, float]]:
        """Yield neighboring elevators, denser towards the ends, between which the splitting changes its sign.

        A loop needs a sign change of f within it (Bendixson 1901), so most elevators need no orbit.
        """
        damping = self.system.damping.ascending.tolist()
        zeros = [root.value / self.scale.length_rad for root in real_roots(damping)] if any(damping) else []
        phases = np.pi * (np.arange(_LOOP_NODES) + 0.5) / _LOOP_NODES
        nodes = self.low + (self.high - self.low) * 0.5 * (1.0 - np.cos(phases))
        values = []
        for elevator in nodes.tolist():
            _, points = self._at(elevator)
            start, last = points[index].x, points[-1 if side > 0 else 0]
            limit = last.x if last.kind is Kind.SADDLE else side * math.inf
            inside = any(min(start, limit) < zero < max(start, limit) for zero in zeros)
            values.append(gap(elevator).value if inside else math.nan)
        for (left, before), (right, after) in pairwise(zip(nodes.tolist(), values, strict=True)):
            if before * after < 0.0:
                yield left, right

    def _root(self, gap: Gap, low: float, high: float) -> float:
        def value(elevator: float) -> float:
            found = gap(elevator).value
            # A branch that never turns is far from one that does, not infinitely far. If neither turns (nan) any sign
            # will do: there is no connection here, and what the search then ends at is not a met one.
            return found if abs(found) < _APART else math.copysign(_APART, found)

        xtol = max(1e-16 * (self.high - self.low), sys.float_info.min)
        return float(brentq(value, low, high, xtol=xtol, rtol=_RELATIVE, maxiter=_ITERATIONS))

    def _bracket(self, gap: Gap, elevator: float) -> FloatArray:
        """Return two elevators around a connection where the splitting has a sign and opposite ones."""
        step = 4.0 * max(math.ulp(elevator), math.ulp(self.high - self.low))
        for _ in range(_DOUBLINGS):
            low, high = max(self.low, elevator - step), min(self.high, elevator + step)
            if gap(low).value * gap(high).value < 0.0:
                return frozen_array((low, high))
            step *= 4.0
        raise RefusedError("a connection was found, but no bracket of it")

    def _heteroclinic(self, elevator: float, found: Splitting, bracket: FloatArray) -> Heteroclinic:
        source, target = (branch.manifold.saddle * self.scale.length_rad for branch in (found.outgoing, found.incoming))
        gradient = elevator_gradient(self.system, elevator, found, self.scale)
        return Heteroclinic(
            elevator_rad=elevator,
            from_alpha_rad=source,
            to_alpha_rad=target,
            direction=Direction.RISING if target > source else Direction.FALLING,
            elevator_interval_rad=self.system.interval(elevator, gradient),
            bracket_rad=bracket,
            residual_rad_s=found.value * self.scale.speed_rad_s,
            in_domain=bool(self.system.supports((source, target)).all()),
        )

    def _homoclinic(self, elevator: float, found: Splitting, bracket: FloatArray) -> Homoclinic:
        length = self.scale.length_rad
        saddle, turn = found.outgoing.manifold.saddle * length, found.outgoing.path.x * length
        gradient = elevator_gradient(self.system, elevator, found, self.scale)
        return Homoclinic(
            elevator_rad=elevator,
            alpha_rad=saddle,
            turn_alpha_rad=turn,
            direction=Direction.RISING if turn > saddle else Direction.FALLING,
            divergence_1_s=float(self.system.damping(saddle)),
            elevator_interval_rad=self.system.interval(elevator, gradient),
            bracket_rad=bracket,
            residual_rad=found.value * length,
            in_domain=bool(self.system.supports((saddle, turn)).all()),
        )
