"""Which curves bound the stability region of a sink of a planar field, and its area within a box."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.equilibrium import Kind
from finback.dynamics.planar.boundary import (
    BoundaryCurve,
    BoundaryKind,
    Edges,
    Segment,
    closing,
    cut_at_ray,
    inside_parts,
    segments_of,
    swept,
)
from finback.dynamics.planar.closed import closed_orbits
from finback.dynamics.planar.manifold import PlanarManifold, planar_manifold, saddle_frame
from finback.dynamics.planar.map import fates
from finback.dynamics.planar.map_kernel import LOST
from finback.dynamics.planar.orbit import Limits, PlanarEnding, fate
from finback.dynamics.planar.return_map import ClosedOrbit
from finback.dynamics.planar.setting import PlanarSetting
from finback.errors import RefusedError

_AROUND: Final = 6.0  # times the box: as far as cycles are searched, of which a part may lie in the box
_SAMPLES: Final = 240  # along the edge of the box
_RESUMED: Final = 6  # times that an orbit may use all its pieces on its way to where it goes
_ASIDE: Final = 0.01  # of a cycle's distance: where its two sides are tried, or half way to the next cycle
_FARTHEST: Final = 1e6  # times the box: where the region reaches to infinity, orbits come back from very far
_FAR: Final = 20.0  # times the box: up to there curves are followed backward, and beyond it an orbit may not be slow
_HALVINGS: Final = 100  # more than bisection of a side of the box needs
_NEAR: Final = 1e-7  # of a certain ellipse around a source: nearer to it the rest of a curve has no area to speak of
_OUTSIDE: Final = 2.0  # times the box: an orbit that ends beyond, by its many pieces, is on its way out
_WOUND: Final = 0.05  # half-widths of the box
_MET: Final = 1e-6  # sides of the box: two places so near are one crossing, found in two ways


@final
@dataclass(frozen=True, slots=True, eq=False)
class Basin:
    """The stability region of a sink, in the units of the setting.

    Attributes:
        sink: its index in the setting.
        curves: what bounds it.
        manifolds: stable manifold of each saddle on the boundary, by index of the saddle.
        area: within the box.
    """

    sink: int
    curves: tuple[BoundaryCurve, ...]
    manifolds: dict[int, PlanarManifold]
    area: float


def basins(setting: PlanarSetting) -> tuple[Basin, ...]:
    """Find the stability region of every sink in the box."""
    sinks = [k for k, kind in enumerate(setting.kinds) if kind.stable]
    shared = _Saddles(setting), closed_orbits(setting, _AROUND).isolated
    return tuple(
        _Search(setting, sink, trap, *shared).basin()
        for trap, sink in enumerate(sinks)
        if setting.holds(setting.points[sink])
    )


class _Saddles:
    """All saddles not too far away, and where their unstable branches go."""

    def __init__(self, setting: PlanarSetting) -> None:
        most = _FARTHEST * float(np.abs(setting.box).max())
        self.stable: dict[int, PlanarManifold] = {}
        self.goals: dict[int, list[tuple[FloatArray, int]]] = {}
        for index, kind in enumerate(setting.kinds):
            x, y = setting.points[index].tolist()
            if kind is not Kind.SADDLE or max(abs(x), abs(y)) > most:
                continue
            frame = saddle_frame(setting.field, (x, y), np.eye(2))
            unstable = planar_manifold(frame, stable=False)
            self.stable[index] = planar_manifold(frame, stable=True)
            self.goals[index] = []
            for side in (-1.0, 1.0):
                u, v = unstable.at(side * unstable.radius)
                self.goals[index].append((side * unstable.series[1], goal(setting, (float(u), float(v)))))


def wide(setting: PlanarSetting, *, forward: bool) -> Limits:
    """Return where an orbit is given up: backward where no curve comes back to the box, forward very far away."""
    size = float(np.abs(setting.box).max())
    return Limits(setting.attracting, _FARTHEST * size) if forward else Limits(setting.repelling, _FAR * size)


def goal(setting: PlanarSetting, start: tuple[float, float]) -> int:
    """Return the index of the sink, among sinks, to which a state goes; -1 if it is lost or goes to none."""
    lost = _FAR * float(np.abs(setting.box).max())
    for _ in range(_RESUMED):
        orbit = fate(setting.field, start, wide(setting, forward=True), forward=True)
        if orbit.ending is not PlanarEnding.NOWHERE:
            return orbit.trap
        start = orbit.end
        if max(abs(start[0]), abs(start[1])) > lost:  # so slow, and so far
            return -1
    return -1


class _Search:
    """The search for what bounds the region of one sink."""

    def __init__(
        self, setting: PlanarSetting, sink: int, trap: int, saddles: _Saddles, cycles: tuple[ClosedOrbit, ...]
    ) -> None:
        self.setting, self.sink, self.trap = setting, sink, trap
        (x0, x1), (y0, y1) = setting.box.tolist()
        self.edges = Edges((x0, y0), (x1, y1))
        self.saddles, self.cycles = saddles, cycles
        self.curves = [*self._branches(), *self._bounding_cycles()]

    def basin(self) -> Basin:
        self._follow_orbits()
        area = math.fsum(curve.left * closing(curve, self.edges) for curve in self.curves)
        parts = [
            (curve, inside_parts(segment, self.edges), segment) for curve in self.curves for segment in curve.segments
        ]
        area += math.fsum(
            curve.left * swept(segment, a, b) for curve, (kept, _), segment in parts if curve.left for a, b in kept
        )
        area += math.fsum(self.edges.area(a, b) for a, b in self._inside(self._places()))
        kept = {curve.index for curve in self.curves if curve.kind is BoundaryKind.SADDLE}
        return Basin(self.sink, tuple(self.curves), {k: self.saddles.stable[k] for k in sorted(kept)}, area)

    def _enters(self, state: tuple[float, float]) -> bool:
        return goal(self.setting, state) == self.trap

    def _branches(self) -> Iterator[BoundaryCurve]:
        """Yield both stable branches of each saddle that has an unstable branch into the sink."""
        for index, goals in self.saddles.goals.items():
            reached = [vector for vector, trap in goals if trap == self.trap]
            whole = self.saddles.stable[index]
            if not reached:
                continue
            for side in (-1.0, 1.0):
                head = Segment(whole.series, side * whole.radius)
                (a, b), (c, d) = side * whole.series[1], reached[0]
                left = 0 if len(reached) == 2 else (1 if a * d - b * c > 0.0 else -1)
                yield self._followed(BoundaryKind.SADDLE, index, (head,), left)

    def _followed(
        self, kind: BoundaryKind, index: int, begin: tuple[Segment, ...], left: int, place: float = 0.0
    ) -> BoundaryCurve:
        """Follow a curve backward in time from the end of its first segment, or from a place on the edge."""
        x, y = begin[0].at(begin[0].span).tolist() if begin else self.edges.state(place)
        field, limits = self.setting.field, wide(self.setting, forward=False)
        # Into a source the curve is followed nearly to its end, past where it is certain.
        traps = limits.traps * ([1.0, 1.0] + [_NEAR**-2] * 3)
        far = max(limits.far, 2.0 * abs(x), 2.0 * abs(y))
        orbit = fate(field, (x, y), Limits(traps, far), forward=False)
        segments, end = (*begin, *segments_of(orbit)), orbit.end
        if orbit.ending is PlanarEnding.TRAP:
            end = (float(traps[orbit.trap, 0]), float(traps[orbit.trap, 1]))
        elif orbit.ending is PlanarEnding.NOWHERE and max(map(abs, orbit.end)) < _OUTSIDE * far / _FAR:
            segments, end = self._wound(segments, orbit.end)
        return BoundaryCurve(kind, index, segments, left, orbit, end)

    def _wound(
        self, segments: tuple[Segment, ...], end: tuple[float, float]
    ) -> tuple[tuple[Segment, ...], tuple[float, float]]:
        """Cut a curve that winds onto an unstable cycle where it last crosses the ray of that."""
        unstable = [cycle for cycle in self.cycles if cycle.log_multiplier > 0.0]
        distances = [float(np.hypot(*(cycle.orbit.samples(8) - end).T).min()) for cycle in unstable]
        if min(distances, default=math.inf) < _WOUND:
            cycle = unstable[int(np.argmin(distances))]
            if cut := cut_at_ray(segments, cycle.ray):
                return cut, cycle.ray.at(cycle.along)
        raise RefusedError("a boundary of the stability region winds without end around what was not found")

    def _bounding_cycles(self) -> Iterator[BoundaryCurve]:
        """Yield each unstable cycle one side of which goes to the sink."""
        for index, cycle in enumerate(self.cycles):
            if cycle.log_multiplier <= 0.0 or not self._enters_box(cycle):
                continue
            step = _ASIDE * cycle.along
            for other in self.cycles:
                if other is not cycle and other.ray == cycle.ray:
                    step = min(step, 0.5 * abs(other.along - cycle.along))
            inner, outer = (self._enters(cycle.ray.at(cycle.along + sign * step)) for sign in (-1.0, 1.0))
            if not (inner or outer):
                continue
            # Followed counterclockwise a cycle has its inside on the left; sense is that forward in time.
            turned = cycle.sense if cycle.orbit.duration > 0.0 else -cycle.sense
            left = 0 if inner and outer else (turned if inner else -turned)
            orbit = cycle.orbit
            yield BoundaryCurve(BoundaryKind.CYCLE, index, segments_of(orbit), left, orbit, orbit.end)

    def _enters_box(self, cycle: ClosedOrbit) -> bool:
        segments = segments_of(cycle.orbit)
        return any(inside_parts(segment, self.edges)[0] for segment in segments)

    def _places(self) -> list[float]:
        """Return where curves that separate cross the edge of the box, rising."""
        places = [
            place
            for curve in self.curves
            if curve.left
            for segment in curve.segments
            for place in inside_parts(segment, self.edges)[1]
        ]
        places += [self._start(curve) for curve in self.curves if curve.kind is BoundaryKind.ORBIT]
        return sorted(places)

    def _start(self, curve: BoundaryCurve) -> float:
        state = curve.segments[0].at(0.0)
        sides = [(abs(state[axis] - self.setting.box[axis, k]), axis, k) for axis in (0, 1) for k in (0, 1)]
        _, axis, k = min(sides)
        return self.edges.place(state, axis, upper=bool(k))

    def _inside(self, places: list[float]) -> list[tuple[float, float]]:
        """Return the stretches of the edge, between crossings, that lie in the region."""
        if not places:
            return [(0.0, 4.0)] if self._enters(self.edges.state(0.0)) else []
        around = pairwise([*places, places[0] + 4.0])
        within = [(a, b, self._enters(self.edges.state(0.5 * (a + b)))) for a, b in around]
        if any(one[2] == other[2] for one, other in pairwise([*within, within[0]])):
            raise RefusedError(
                "the boundary of the stability region crosses the edge of the box more often than was found",
                hint="take another box",
            )
        return [(a, b) for a, b, inside in within if inside]

    def _follow_orbits(self) -> None:
        """Add the boundaries that the edge of the box shows and that are neither manifolds nor cycles."""
        for _ in range(_SAMPLES):
            unknown = self._changes(self._places())
            following = [(place, left) for place, left in unknown if self._leaves(place)]
            if not unknown:
                return
            if not following:
                raise RefusedError(
                    "a boundary of the stability region enters the box and was not found",
                    hint="take a larger box, in which the saddle or cycle lies that bounds the region",
                )
            place, left = following[0]
            self.curves.append(self._followed(BoundaryKind.ORBIT, -1, (), left, place))

    def _leaves(self, place: float) -> bool:
        """Tell whether the field points out of the box: the orbit there came through it."""
        p, q = self.setting.field.flow.velocity(*self.edges.state(place))
        a, b = self.edges.inward(place)
        return a * p + b * q < 0.0

    def _changes(self, known: list[float]) -> list[tuple[float, int]]:
        """Return places on the edge, none of them known, where the region begins or ends, and on which side it lies."""
        places = 4.0 * (np.arange(_SAMPLES) + 0.5) / _SAMPLES
        states = np.array([self.edges.state(float(place)) for place in places])
        fate_of = fates(self.setting, states)
        inside = [
            fate_of[k] == self.trap or (fate_of[k] == LOST and self._enters((float(x), float(y))))
            for k, (x, y) in enumerate(states)
        ]
        found = []
        for k in range(_SAMPLES):
            a, b = float(places[k]), float(places[(k + 1) % _SAMPLES]) + (4.0 if k + 1 == _SAMPLES else 0.0)
            between = sum(a < place + turn < b for place in known for turn in (0.0, 4.0))
            if (inside[k] != inside[(k + 1) % _SAMPLES]) == bool(between % 2):
                continue
            if between or min((abs((a - p + 2.0) % 4.0 - 2.0) for p in known), default=1.0) < _MET:
                continue
            change = self._bisected(a, b)
            if change is not None and all(abs((change[0] - p + 2.0) % 4.0 - 2.0) > _MET for p in known):
                found.append(change)
        return found

    def _bisected(self, a: float, b: float) -> tuple[float, int] | None:
        before, after = (self._enters(self.edges.state(place)) for place in (a, b))
        if before == after:  # only the map, which is less exact, sees a difference
            return None
        for _ in range(_HALVINGS):
            middle = 0.5 * (a + b)
            if middle in (a, b):
                break
            if self._enters(self.edges.state(middle)) == before:
                a = middle
            else:
                b = middle
        # Seen from the edge inward, what comes before, counterclockwise, lies on the left.
        return a % 4.0, 1 if before else -1
