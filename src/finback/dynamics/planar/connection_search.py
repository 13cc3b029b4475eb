"""The search for saddle connections of a planar system over its parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.equilibrium import Kind
from finback.dynamics.planar.connection import PlanarHeteroclinic, PlanarHomoclinic, planar_connection
from finback.dynamics.planar.setting import PlanarSetting, checked_box, continued, planar_setting
from finback.dynamics.planar.splitting import Pairing, Splittings, pairings
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.zero import zero_between
from finback.errors import InputError, RefusedError

_PARTS: Final = 16  # of the range, at whose ends the equilibria are counted
_HALVINGS: Final = 14  # towards a fold between two of them
_NODES: Final = 25  # of a stretch, denser towards its ends, at which splittings are compared
_EDGE_HALVINGS: Final = 8  # towards where a branch begins, or ceases, to come to the section
_TURNS: Final = 2
_CLOSED: Final = 1e-8  # half-widths of the box: a sign change with a larger splitting is a jump, no connection
_JUMP: Final = 1e-6  # of the stretch: a sign change confined to that, and still ...
_APART: Final = 1e-2  # ... so large, is a jump
_DOUBLINGS: Final = 40
_SAME: Final = 1e-9  # of the range: nearer connections between the same saddles on the same sides are one
_LOST: Final = 1e3
_SHORTEST: Final = 4096  # parts of the way from one node to the next

Value = Callable[[float], float]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarStretch:
    """Parameters between which the equilibria keep number and kind.

    Attributes:
        parameter: its ends, shape (2,).
        saddles: how many saddles lie in the box at its beginning.
        others: how many other equilibria do.
        obstacle: why it could not be searched, wholly or in part; empty if it was.
    """

    parameter: FloatArray
    saddles: int
    others: int
    obstacle: str

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "parameter", frozen_array(self.parameter))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarConnections:
    """What was found, and where it was looked for.

    Attributes:
        heteroclinics: by rising parameter.
        homoclinics: by rising parameter.
        stretches: what was searched, by rising parameter.
    """

    heteroclinics: tuple[PlanarHeteroclinic, ...]
    homoclinics: tuple[PlanarHomoclinic, ...]
    stretches: tuple[PlanarStretch, ...]


def planar_connections(system: PlanarSystem, parameter_range: tuple[float, float], box: ArrayLike) -> PlanarConnections:
    """Find saddle connections within a box by shooting.

    The range is cut where the equilibria change in number or kind. On each stretch, branches of the manifolds of all
    saddles in the box are compared at 25 parameters: between two saddles on their perpendicular bisector, for loops on
    a half line behind each other equilibrium; there the second crossing is compared, too. Each change of sign is
    followed to a root, and kept if the branches meet there: a jump is no connection. Not seen are two connections
    between neighboring parameters, those that cross a section more than twice, and those that leave 1.5 times the box.

    Args:
        system: the system.
        parameter_range: lowest and highest parameter.
        box: low and high of both states, in SI, shape (2, 2).

    Raises:
        InputError: range or box are empty.
    """
    low, high = parameter_range
    sides = checked_box(box)
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"a range of parameters needs two ends, the lower first, got ({low}, {high})")
    found: list[tuple[Pairing, PlanarHeteroclinic | PlanarHomoclinic]] = []
    stretches = []
    for one, other in _stretches(system, low, high, sides):
        obstacle, saddles, others = "", 0, 0
        try:
            search = _Search(system, sides, one, other)
            inside = [
                kind
                for kind, point in zip(search.middle.kinds, search.middle.points, strict=True)
                if search.middle.holds(point)
            ]
            saddles = inside.count(Kind.SADDLE)
            others = len(inside) - saddles
            for pairing, connection in search.run():
                if not any(_same(pairing, connection, *known, _SAME * (high - low)) for known in found):
                    found.append((pairing, connection))
            obstacle = "; ".join(sorted(search.obstacles))
        except RefusedError as refusal:
            obstacle = refusal.message
        stretches.append(
            PlanarStretch(parameter=frozen_array((one, other)), saddles=saddles, others=others, obstacle=obstacle)
        )
    ordered = sorted((connection for _, connection in found), key=lambda connection: connection.parameter)
    return PlanarConnections(
        heteroclinics=tuple(c for c in ordered if isinstance(c, PlanarHeteroclinic)),
        homoclinics=tuple(c for c in ordered if isinstance(c, PlanarHomoclinic)),
        stretches=tuple(stretches),
    )


def _stretches(system: PlanarSystem, low: float, high: float, box: FloatArray) -> Iterator[tuple[float, float]]:
    """Cut the range where the saddles, the sinks or the others change in number."""

    def census(parameter: float) -> tuple[int, ...]:
        try:
            kinds = planar_setting(system, parameter, box).kinds
        except RefusedError:
            return ()
        return (len(kinds), kinds.count(Kind.SADDLE), sum(kind.stable for kind in kinds))

    nodes = np.linspace(low, high, _PARTS + 1).tolist()
    seen = [census(node) for node in nodes]
    begin = nodes[0]
    for (left, before), (right, after) in pairwise(zip(nodes, seen, strict=True)):
        if before == after:
            continue
        a, b = left, right
        for _ in range(_HALVINGS):
            middle = 0.5 * (a + b)
            kinds = census(middle)
            if kinds == before:
                a = middle
            elif kinds == after:
                b = middle
            else:  # more than one change between two nodes: the part between is left out
                break
        yield begin, a
        begin = b
    yield begin, nodes[-1]


class _Search:
    """The search of one stretch."""

    def __init__(self, system: PlanarSystem, box: FloatArray, low: float, high: float) -> None:
        self.low, self.high = low, high
        self.obstacles: set[str] = set()
        self.middle = planar_setting(system, 0.5 * (low + high), box)
        phases = np.pi * (np.arange(_NODES) + 0.5) / _NODES
        self.nodes: list[float] = (low + (high - low) * 0.5 * (1.0 - np.cos(phases))).tolist()
        self.settings: dict[int, PlanarSetting] = {}
        self.guides: dict[int, dict[int, FloatArray]] = {}
        self._between: dict[float, Splittings] = {}
        half = _NODES // 2
        for order in (range(half, _NODES), range(half - 1, -1, -1)):
            self._follow(list(order))

    def _follow(self, order: list[int]) -> None:
        """Follow the equilibria and their eigenvectors from the middle node outward."""
        for index in order:
            near = next((k for k in (index - 1, index + 1) if k in self.settings), None)
            known = self.middle if near is None else self.settings[near]
            guides = {} if near is None else self.guides[near]
            try:
                setting = _reached(known, self.nodes[index])
                frames = Splittings(setting, guides, _TURNS)
                saddles = [k for k, kind in enumerate(setting.kinds) if kind is Kind.SADDLE]
                vectors = {k: frames.frame(k).eigenvectors for k in saddles}
            except RefusedError as refusal:
                self.obstacles.add(refusal.message)
                return
            self.settings[index], self.guides[index] = setting, vectors

    def run(self) -> Iterator[tuple[Pairing, PlanarHeteroclinic | PlanarHomoclinic]]:
        every = pairings(self.middle, _TURNS)
        values: dict[int, list[float]] = {}
        for index in sorted(self.settings):
            there = Splittings(self.settings[index], self.guides[index], _TURNS)
            values[index] = [self._value(there, pairing) for pairing in every]
        for left, right in pairwise(sorted(values)):
            self._between.clear()
            for k, pairing in enumerate(every):
                before, after = values[left][k], values[right][k]
                ends = (self.nodes[left], before), (self.nodes[right], after)

                def value(parameter: float, pairing: Pairing = pairing, left: int = left, right: int = right) -> float:
                    return self._value(self._at(parameter, left, right), pairing)

                if math.isnan(before) != math.isnan(after):
                    ends = _edge(value, *ends)
                if ends[0][1] * ends[1][1] < 0.0:
                    yield from self._connection(value, pairing, ends, (left, right))

    def _value(self, there: Splittings, pairing: Pairing) -> float:
        try:
            return there.value(pairing)
        except RefusedError as refusal:
            self.obstacles.add(refusal.message)
            return math.nan

    def _at(self, parameter: float, left: int, right: int) -> Splittings:
        if parameter in self._between:  # the halvings of one pairing are mostly those of another
            return self._between[parameter]
        one, other = self.settings[left], self.settings[right]
        share = (parameter - one.parameter) / (other.parameter - one.parameter)
        try:
            setting = continued(one, parameter, one.points + share * (other.points - one.points))
        except RefusedError:  # one far outside the box does not move evenly
            setting = _reached(one, parameter)
        self._between[parameter] = Splittings(setting, self.guides[left], _TURNS)
        return self._between[parameter]

    def _connection(
        self,
        value: Value,
        pairing: Pairing,
        ends: tuple[tuple[float, float], tuple[float, float]],
        nodes: tuple[int, int],
    ) -> Iterator[tuple[Pairing, PlanarHeteroclinic | PlanarHomoclinic]]:
        (low, before), (high, after) = ends
        # Near a jump the values do not fall, however near its two sides come; bisection tells soon.
        while high - low > _JUMP * (self.high - self.low) and min(abs(before), abs(after)) > _APART:
            middle = 0.5 * (low + high)
            found = value(middle)
            if math.isnan(found):
                return
            if found * before > 0.0:
                low, before = middle, found
            else:
                high, after = middle, found
        if min(abs(before), abs(after)) > _APART:
            return

        def clipped(parameter: float) -> float:
            found = value(parameter)
            return _LOST if math.isnan(found) else max(-_LOST, min(_LOST, found))

        xtol = 1e-16 * (self.high - self.low)
        parameter = zero_between(clipped, low, high, xtol=xtol)
        if math.isnan(parameter) or not abs(value(parameter)) < _CLOSED:
            return
        bracket = _bracket(value, parameter, 4.0 * max(math.ulp(parameter), math.ulp(high - low)))
        if bracket is None:
            self.obstacles.add("a connection was found, but no bracket of it")
            return
        yield pairing, planar_connection(self._at(parameter, *nodes), pairing, bracket)


def _reached(known: PlanarSetting, parameter: float) -> PlanarSetting:
    """Return the setting at another parameter, by steps as short as it takes for no equilibrium to go far.

    Those far outside the box may move by many times its size from one node to the next.

    Raises:
        RefusedError: no step, however short, leads on.
    """
    here, step = known, parameter - known.parameter
    shortest = abs(step) / _SHORTEST
    while here.parameter != parameter:
        ahead = here.parameter + step
        if (parameter - ahead) * step <= 0.0:
            ahead = parameter
        try:
            here = continued(here, ahead, here.points)
        except RefusedError:
            step *= 0.5
            if abs(step) < shortest:
                raise
    return here


def _edge(
    value: Value, one: tuple[float, float], other: tuple[float, float]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Look for a change of sign between a parameter where there is a splitting and one where there is none."""
    known, unknown = (other, one) if math.isnan(one[1]) else (one, other)
    for _ in range(_EDGE_HALVINGS):
        middle = 0.5 * (known[0] + unknown[0])
        found = value(middle)
        if math.isnan(found):
            unknown = (middle, found)
        elif found * known[1] < 0.0:
            first, second = sorted(((middle, found), known))
            return first, second
        else:
            known = (middle, found)
    return known, known


def _bracket(value: Value, parameter: float, step: float) -> tuple[float, float] | None:
    for _ in range(_DOUBLINGS):
        low, high = parameter - step, parameter + step
        if value(low) * value(high) < 0.0:
            return low, high
        step *= 4.0
    return None


def _same(
    one: Pairing,
    first: PlanarHeteroclinic | PlanarHomoclinic,
    other: Pairing,
    second: PlanarHeteroclinic | PlanarHomoclinic,
    slack: float,
) -> bool:
    ends = [(p.source, p.target, p.leaving, p.entering) for p in (one, other)]
    return ends[0] == ends[1] and abs(first.parameter - second.parameter) < slack
