"""One strip of a diagram: what a vertical line through it meets, computed once for each μ."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import groupby
from typing import Final, final

from finback.dynamics.connection.loop import Loop, LoopKind, loops
from finback.dynamics.cycle.fold import CycleFold
from finback.dynamics.cycle.lyapunov import lyapunov_coefficients
from finback.dynamics.diagram.annulus import folds_of
from finback.dynamics.diagram.cell import Line
from finback.dynamics.diagram.curve import Cell, CurveKind
from finback.dynamics.diagram.knot import Knot
from finback.dynamics.family import Family
from finback.dynamics.flow import derivative, horner
from finback.dynamics.orbit.annulus import groups, poles
from finback.dynamics.orbit.splitting import Route
from finback.dynamics.roots import real_roots
from finback.errors import RefusedError

_BESIDE: Final = 1e-5  # of the width of a strip: where the equilibria that meet at its edge are the nearest ones
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
    _folds: dict[float, Mapping[tuple[int, ...], tuple[CycleFold, ...]] | None] = field(default_factory=dict)

    def hindered(self, mu: float, key: tuple[int, ...]) -> bool:
        """Tell whether the search for folds of cycles around a group met an obstacle at a μ."""
        return (mu, key) in self._hindered

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
                    found = {loop.route: loop for loop in loops(self.family, mu, most_turns=self.most_turns)}
                except RefusedError as error:
                    self.refusals.setdefault(f"loops: {error.message}", []).append(mu)
            self._loops[mu] = found
        return self._loops[mu]

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

    def folds(self, mu: float) -> Mapping[tuple[int, ...], tuple[CycleFold, ...]] | None:
        """Return the folds of cycles by the equilibria inside, outward; None where they could not be looked for."""
        if mu not in self._folds:
            self._folds[mu] = self._find_folds(mu)
        return self._folds[mu]

    def _find_folds(self, mu: float) -> Mapping[tuple[int, ...], tuple[CycleFold, ...]] | None:
        if not self.equilibria(mu):
            return None
        keyed = []
        flow = self.family.at(mu, 0.0)
        for group in groups(flow):
            key = tuple(range(group.first, group.last + 1))
            try:
                found, obstacle = folds_of(flow, group)
            except RefusedError as error:
                found, obstacle = (), error.message
            if obstacle:
                around = "-".join(str(index) for index in dict.fromkeys((key[0], key[-1])))
                said = f"cycles around {around}: not all orbits could be followed to the ends of their annulus"
                self.refusals.setdefault(said, []).append(mu)
                self._hindered.add((mu, key))
            keyed += [(key, fold) for fold in found]
        keyed.sort(key=lambda pair: (pair[0], pair[1].x_max))
        return {key: tuple(fold for _, fold in pairs) for key, pairs in groupby(keyed, key=lambda pair: pair[0])}

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
