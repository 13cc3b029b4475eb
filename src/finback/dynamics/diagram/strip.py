"""One strip of a diagram: what a vertical line through it meets, computed once for each μ."""

from __future__ import annotations

import math
import sys
from bisect import bisect
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, final

from finback.dynamics.connection.loop import Loop, LoopKind, loops
from finback.dynamics.cycle.fold import CycleFold
from finback.dynamics.cycle.lyapunov import lyapunov_coefficients
from finback.dynamics.diagram.annulus import folds_of
from finback.dynamics.diagram.cell import Line
from finback.dynamics.diagram.curve import Cell, CurveKind
from finback.dynamics.diagram.knot import Knot
from finback.dynamics.diagram.scan import LoopEnd, annulus_of
from finback.dynamics.family import Family
from finback.dynamics.flow import Flow, derivative, horner
from finback.dynamics.orbit.annulus import Annulus, groups, poles
from finback.dynamics.orbit.splitting import Route
from finback.dynamics.roots import real_roots
from finback.errors import RefusedError

_BESIDE: Final = 1e-5  # of the width of a strip: where the equilibria that meet at its edge are the nearest ones
_GUESSED: Final = 0.01  # of the whole difference of neighboring λ: about what a chord is wrong by
_NO_TURN: Final = 1e-13  # of its terms, or of the rate: a Lyapunov coefficient or trace below it has no sign


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Strip:
    """A strip and what is known of it so far.

    Attributes:
        family: the family.
        cell: the strip.
        index: its place among all strips.
        most_turns: of connections.
        refusals: what could not be computed, in words, and at which μ.
    """

    family: Family
    cell: Cell
    index: int
    most_turns: int
    refusals: dict[str, list[float]] = field(default_factory=dict)
    _poles: dict[float, tuple[float, ...]] = field(default_factory=dict)
    _hindered: set[tuple[float, tuple[int, ...]]] = field(default_factory=set)
    _loops: dict[float, Mapping[Route, Loop]] = field(default_factory=dict)
    _folds: dict[tuple[float, tuple[int, ...]], tuple[CycleFold, ...] | None] = field(default_factory=dict)

    def hindered(self, mu: float, key: tuple[int, ...]) -> bool:
        """Tell whether the search for folds of cycles around a group met an obstacle at a μ."""
        return (mu, key) in self._hindered

    @property
    def keys(self) -> tuple[tuple[int, ...], ...]:
        """The groups of equilibria that cycles may enclose: neighbors, the first and the last no saddles."""
        centers = self.antisaddles
        return tuple(tuple(range(a, b + 1)) for k, a in enumerate(centers) for b in centers[k:])

    @property
    def antisaddles(self) -> tuple[int, ...]:
        """The equilibria that are no saddles."""
        return tuple(index for index, saddle in enumerate(self.cell.saddles) if not saddle)

    def equilibria(self, mu: float) -> tuple[float, ...]:
        """Return all equilibria by rising x; none where they cannot be told apart."""
        if mu not in self._poles:
            try:
                found = poles(self.family.at(mu, 0.0))
            except RefusedError:
                found = ()
            fits = tuple(pole.saddle for pole in found) == self.cell.saddles
            self._poles[mu] = tuple(pole.x for pole in found) if fits else ()
        return self._poles[mu]

    def rate(self, mu: float) -> float:
        """Return a typical rate of the flow."""
        slope = derivative(self.family.at(mu, 0.0).force)
        return math.sqrt(max((abs(horner(slope, x)) for x in self.equilibria(mu)), default=0.0))

    def hopf(self, mu: float, index: int) -> Knot | None:
        """Return the Hopf point of an antisaddle; None where it cannot be told from other equilibria."""
        places = self.equilibria(mu)
        return self.hopf_at(mu, places[index]) if places else None

    def hopf_at(self, mu: float, x: float) -> Knot:
        """Return the Hopf point at a known place."""
        flow = self.family.at(mu, 0.0)
        lean = 0.0
        if -horner(derivative(flow.force), x) > sys.float_info.min:  # else others are here, within rounding
            first, second = lyapunov_coefficients(flow.damping, flow.force, x)
            size = _lyapunov_size(flow.damping, flow.force, x)
            lean = first if abs(first) > _NO_TURN * size else second
        return Knot(
            mu=mu,
            lam=-horner(flow.damping, x) + 0.0,
            x=x,
            residual=horner(flow.force, x),
            resolved=True,
            # Supercritical: a stable cycle is born as λ rises; subcritical: an unstable one dies.
            change=(0, -1) if lean > 0.0 else (1, 0) if lean < 0.0 else (0, 0),
        )

    def loops(self, mu: float) -> Mapping[Route, Loop]:
        """Return the loops by their routes; none where they could not be found."""
        if mu not in self._loops:
            found: Mapping[Route, Loop] = {}
            if self.equilibria(mu) and any(self.cell.saddles):
                try:
                    found = {loop.route: loop for loop in self._search(mu)}
                except RefusedError as error:
                    self.refusals.setdefault(f"loops: {error.message}", []).append(mu)
            self._loops[mu] = found
        return self._loops[mu]

    def _search(self, mu: float) -> tuple[Loop, ...]:
        """Search for all loops, from what is known at the neighboring μ."""
        doubts = self._doubts(mu)
        guesses = {route: (loop.lam, _GUESSED * doubts[route]) for route, loop in self._loops_near(mu).items()}
        return loops(self.family, mu, most_turns=self.most_turns, guesses=guesses)

    def known_loops(self) -> tuple[float, ...]:
        """Return the μ at which loops were found, by rising μ."""
        return tuple(sorted(mu for mu, found in self._loops.items() if found))

    def merging(self, line: Line, side: int) -> tuple[int, ...]:
        """Return the equilibria that meet at a line on the left (side 0) or right (1) of the strip."""
        edge, width = self.cell.mu.item(side), self.cell.mu.item(1) - self.cell.mu.item(0)
        places = self.equilibria(edge + (0.5 - side) * 2.0 * _BESIDE * width)
        if not places or math.isinf(line.x):
            return ()
        order = sorted(range(len(places)), key=lambda index: abs(places[index] - line.x))
        return tuple(order[: 3 if line.kind is CurveKind.PITCHFORK else 2])

    def hopf_on_line(self, mu: float, near: float) -> Knot:
        """Return the Hopf point of an equilibrium on a line where others meet."""
        flow = self.family.at(mu, 0.0)
        roots = real_roots(flow.force, magnitudes=flow.force_sizes)
        return self.hopf_at(mu, min((root.value for root in roots), key=lambda x: abs(x - near)))

    def folds(self, mu: float, key: tuple[int, ...]) -> tuple[CycleFold, ...] | None:
        """Return the folds of cycles around a group of equilibria, outward; None where they could not be looked for."""
        if (mu, key) not in self._folds:
            self._folds[mu, key] = self._find_folds(mu, key)
        return self._folds[mu, key]

    def _find_folds(self, mu: float, key: tuple[int, ...]) -> tuple[CycleFold, ...] | None:
        places = self.equilibria(mu)
        if not places:
            return None
        flow = self.family.at(mu, 0.0)
        annulus, obstacle = self._annulus(flow, mu, key)
        found: tuple[CycleFold, ...] = ()
        if annulus is not None:
            try:
                found = folds_of(flow, annulus, lambda lam: self.bounding(mu, key, lam))
            except RefusedError as error:
                obstacle = error.message
        if obstacle:
            around = "-".join(str(index) for index in dict.fromkeys((key[0], key[-1])))
            said = f"cycles around {around}: not all orbits could be followed to the ends of their annulus"
            self.refusals.setdefault(said, []).append(mu)
            self._hindered.add((mu, key))
        return found

    def _annulus(self, flow: Flow, mu: float, key: tuple[int, ...]) -> tuple[Annulus | None, str]:
        """Return the closed orbits around a group, and what hindered the search; from loops nearby, or else exact."""
        ends = None
        annulus: Annulus | None = None
        for find in (self._loops_near, self.loops)[mu in self._loops :]:
            ends = self._loop_ends(key, find(mu))
            if ends is not None:
                annulus = annulus_of(flow, self.equilibria(mu), key, *ends)
                if annulus is not None and not annulus.obstacle:
                    return annulus, ""
        if ends is not None:
            return annulus, "" if annulus is None else annulus.obstacle
        if sum(self.cell.saddles) == 1 and self.loops(mu):
            return None, "a loop that bounds them is not known"
        group = next(group for group in groups(flow) if (group.first, group.last) == (key[0], key[-1]))
        try:
            annulus = group.annulus()
        except RefusedError as error:
            return None, error.message
        return annulus, "" if annulus is None else annulus.obstacle

    def _loops_near(self, mu: float) -> Mapping[Route, Loop]:
        """Return loops between those of the neighboring μ at which they are known, their λ and traces on a chord."""
        known = self.known_loops()
        after = bisect(known, mu)
        if not 0 < after < len(known):
            return {}
        low, high = known[after - 1], known[after]
        share = (mu - low) / (high - low)
        return {
            route: replace(
                loop,
                lam=loop.lam + share * (other.lam - loop.lam),
                saddle_trace=loop.saddle_trace + share * (other.saddle_trace - loop.saddle_trace),
            )
            for route, loop in self._loops[low].items()
            if (other := self._loops[high].get(route)) is not None
        }

    def _loop_ends(
        self, key: tuple[int, ...], known: Mapping[Route, Loop]
    ) -> tuple[LoopEnd | None, LoopEnd | None] | None:
        """Return the loops at the inner and the outer end of an annulus; None where one of them is not known."""
        inner = outer = None
        passed = []
        for route, loop in known.items():
            if loop.kind is not LoopKind.HOMOCLINIC:
                continue
            inside = self.enclosed(loop.mu, loop)
            if inside == key:
                mirrored = route.source < key[0] if route.turns == 1 else route.side > 0
                end = LoopEnd(saddle=route.source, lam=loop.lam, trace=loop.saddle_trace, mirrored=mirrored)
                inner, outer = (inner, end) if route.turns == 1 else (end, outer)
            elif route.turns == 1 and route.source in key[1:-1] and set(inside) < set(key):
                passed.append((route, loop))
        if len(key) == 3 and inner is None and len(passed) == 2:
            # A large loop that rounding does not tell from the small one which it follows first, and then the other.
            route, loop = max(passed, key=lambda pair: pair[1].lam)
            inner = LoopEnd(saddle=route.source, lam=loop.lam, trace=loop.saddle_trace, mirrored=route.side > 0)
        bounded = key[0] > 0 or key[-1] + 1 < len(self.cell.saddles)
        if (len(key) > 1) != (inner is not None) or bounded != (outer is not None):
            return None
        return inner, outer

    def bounding(self, mu: float, key: tuple[int, ...], lam: float) -> list[float]:
        """Return the λ of the loops at the ends of an annulus, exactly if one may be near a given λ."""
        if mu not in self._loops:
            rough, doubts = self._loops_near(mu), self._doubts(mu)
            near = _at_ends(rough, key, {route: self.enclosed(loop.mu, loop) for route, loop in rough.items()})
            if near and all(abs(lam - loop.lam) > doubts[loop.route] for loop in near):
                return [loop.lam for loop in near]
        found = self.loops(mu)
        ends = _at_ends(found, key, {route: self.enclosed(mu, loop) for route, loop in found.items()})
        return [loop.lam for loop in ends]

    def _doubts(self, mu: float) -> Mapping[Route, float]:
        """Return what λ of loops taken from the neighbors may be wrong by: their whole difference, and more."""
        known = self.known_loops()
        after = bisect(known, mu)
        if not 0 < after < len(known):
            return {}
        low, high = self._loops[known[after - 1]], self._loops[known[after]]
        least = 1e-6 * self.rate(mu)
        return {route: least + abs(low[route].lam - high[route].lam) for route in low.keys() & high.keys()}

    def loop_knot(self, mu: float, route: Route) -> Knot | None:
        """Return a loop as a point of its curve."""
        loop = self.loops(mu).get(route)
        if loop is None:
            return None
        return Knot(
            mu=mu,
            lam=loop.lam,
            x=loop.turns.item(-1) if loop.turns.size else loop.to_x,
            residual=loop.residual,
            resolved=loop.resolved,
            change=(0, 0) if abs(loop.saddle_trace) <= _NO_TURN * self.rate(mu) else change_at_loop(loop),
        )

    def enclosed(self, mu: float, loop: Loop) -> tuple[int, ...]:
        """Return the equilibria inside the cycles that are born from a loop."""
        if loop.kind is LoopKind.HETEROCLINIC:
            return ()
        low, high = sorted((loop.from_x, loop.turns.item(0)))
        if loop.turns.size > 1:
            low, high = loop.turns.min(), loop.turns.max()
            return tuple(index for index, x in enumerate(self.equilibria(mu)) if low < x < high)
        saddle = loop.route.source
        return tuple(index for index, x in enumerate(self.equilibria(mu)) if low < x < high and index != saddle)


def _at_ends(
    found: Mapping[Route, Loop], key: tuple[int, ...], enclosed: Mapping[Route, tuple[int, ...]]
) -> list[Loop]:
    """Return those loops that bound the annulus around a group, by what each encloses."""
    round_trips = [loop for loop in found.values() if loop.kind is LoopKind.HOMOCLINIC]
    own = [loop for loop in round_trips if enclosed[loop.route] == key or loop.route.source in key]
    if any(enclosed[loop.route] == key and loop.turns.size == 1 for loop in round_trips):
        return own
    neighbors = {key[0] - 1, key[-1] + 1}
    straight = [loop for loop in found.values() if not loop.route.turns]
    return own + [loop for loop in straight if {loop.route.source, loop.route.target} == neighbors]


def change_at_loop(loop: Loop) -> tuple[int, int]:
    """Return how many stable and unstable cycles are born as λ rises through a loop.

    A loop is stable where the trace of its saddle is negative, and with λ a stable cycle moves outward, an unstable
    one inward: so a stable cycle inside dies in its loop, and outside it is born of it.
    """
    if loop.kind is LoopKind.HETEROCLINIC or loop.saddle_trace == 0.0:
        return (0, 0)
    outside = loop.turns.size > 1
    return born(stable=loop.saddle_trace < 0.0, outside=outside)


def born(*, stable: bool, outside: bool) -> tuple[int, int]:
    """Return the same for any closed curve of saddles and connections, by its stability and the side of the cycles."""
    if stable:
        return (1, 0) if outside else (-1, 0)
    return (0, -1) if outside else (0, 1)


def fold_knot(mu: float, fold: CycleFold) -> Knot:
    """Return a fold of cycles as a point of its curve."""
    return Knot(
        mu=mu,
        lam=fold.lam,
        x=fold.x_max,
        residual=fold.residual,
        resolved=fold.resolved,
        change=(fold.vanishing, fold.vanishing),
    )


def _lyapunov_size(damping: tuple[float, ...], force: tuple[float, ...], x: float) -> float:
    """Return what the first coefficient f''/16 + f' g''/(16 ω²) is summed from."""
    f1, g1 = derivative(damping), derivative(force)
    f2, g2 = derivative(f1), derivative(g1)
    return (abs(horner(f2, x)) + abs(horner(f1, x) * horner(g2, x) / horner(g1, x))) / 16.0
