"""All limit cycles of a flow that a systematic search finds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, final

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.cycle.fold import Extremum, extrema
from finback.dynamics.flow import Flow
from finback.dynamics.orbit.annulus import Annulus, Group, Stretch, groups
from finback.dynamics.orbit.closure import Chart, Closed, Probe, Way, newton_in_p, probe
from finback.dynamics.roots import real_roots
from finback.errors import RefusedError

_GRAIN: Final = 1e-14  # of the rate: λ* is known to no more
_ITERATIONS: Final = 200
_SURE: Final = 4e-16  # of p and 1
_GROWTH: Final = 4.0
_WIDEST: Final = 10.0  # of p
_COARSE: Final = 1e-3  # of p
_LOOSE: Final = 1e-9  # of the size of a cycle: one that misses itself by more is located from its other end as well
_LARGEST: Final = 700.0  # of the logarithm of a number


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlowCycle:
    """A limit cycle.

    Attributes:
        x_min: where it turns on the left.
        x_max: where it turns on the right.
        period: the time of a turn.
        log_multiplier: logarithm of the Floquet multiplier, ∮f dt.
        enclosed: the equilibria inside, by rising x.
        residual: by how much the orbit misses itself where it turns on the side away from its start, in x.
        bracket: two places of x_max around it from which orbits approach each other, or part, oppositely, shape (2,).
    """

    x_min: float
    x_max: float
    period: float
    log_multiplier: float
    enclosed: tuple[float, ...]
    residual: float
    bracket: FloatArray

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "bracket", frozen_array(self.bracket))

    @property
    def multiplier(self) -> float:
        """The Floquet multiplier: by how much a deviation has grown after a turn; 0 or inf beyond double precision."""
        return math.exp(self.log_multiplier) if self.log_multiplier < _LARGEST else math.inf

    @property
    def stable(self) -> bool:
        """Whether deviations decay."""
        return self.log_multiplier < 0.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Searched:
    """Where cycles around one group of equilibria were looked for.

    Attributes:
        enclosed: the equilibria of the group, by rising x.
        orbits: how many closed orbits of the rotated family were computed; 0 if none needed to be.
        innermost: x_min and x_max of the smallest, shape (2,); nan if none was computed.
        outermost: the same of the largest.
        finding: what is to be said, in words.
        obstacle: why the search did not reach the end of what there is to search; empty if it did. Where it is not,
            nothing is known of cycles beyond ``outermost``.
    """

    enclosed: tuple[float, ...]
    orbits: int
    innermost: FloatArray
    outermost: FloatArray
    finding: str
    obstacle: str

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("innermost", "outermost"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlowCycles:
    """The limit cycles of a flow, and where they were looked for.

    The number is measured, not proven, except where the finding of a search says that there can be none.

    Attributes:
        cycles: by number of equilibria enclosed, then by place, then outward.
        searched: every group of equilibria that a cycle can enclose.
    """

    cycles: tuple[FlowCycle, ...]
    searched: tuple[Searched, ...]

    def count(self, *enclosed: float) -> int:
        """Return how many cycles enclose exactly these equilibria, each given to six digits."""
        return sum(
            len(cycle.enclosed) == len(enclosed)
            and all(abs(a - b) <= 1e-6 * (1.0 + abs(b)) for a, b in zip(cycle.enclosed, enclosed, strict=True))
            for cycle in self.cycles
        )


@final
@dataclass(frozen=True, slots=True)
class Located:
    """A cycle with its place in a chart.

    Attributes:
        chart: the chart.
        p: its place there.
        found: the orbit at λ = 0.
        cycle: the cycle.
    """

    chart: Chart
    p: float
    found: Probe
    cycle: FlowCycle


def flow_cycles(flow: Flow) -> FlowCycles:
    """Find the limit cycles around every group of equilibria.

    The rotation parameter λ* is computed across each annulus of closed orbits (see ``annulus``), its extrema are
    found, and between them it is monotone, so that each change of its sign is one cycle. No search is made where the
    damping has one sign (Bendixson 1901).

    Raises:
        RefusedError: two equilibria meet within rounding; the force is zero everywhere.
    """
    found, searched = locate(flow)
    return FlowCycles(cycles=tuple(one.cycle for one in found), searched=searched)


def locate(flow: Flow) -> tuple[tuple[Located, ...], tuple[Searched, ...]]:
    """Do the same, and return each cycle with its place in a chart."""
    found: list[Located] = []
    searched: list[Searched] = []
    for group in sorted(groups(flow), key=lambda group: (len(group.enclosed), group.first)):
        reason = _no_search(flow, group)
        annulus = None if reason else group.annulus()
        enclosed = tuple(point.x for point in group.enclosed)
        if annulus is None:
            words = reason or "no orbit closes around these equilibria at any constant added to the damping"
            nothing = frozen_array((math.nan, math.nan))
            searched.append(
                Searched(
                    enclosed=enclosed,
                    orbits=0,
                    innermost=nothing,
                    outermost=nothing,
                    finding=f"none: {words}",
                    obstacle="",
                )
            )
            continue
        inside = tuple(_crossings(flow, annulus))
        found += inside
        searched.append(_searched(annulus, len(inside)))
    return tuple(found), tuple(searched)


def _no_search(flow: Flow, group: Group) -> str:
    if not any(flow.damping):
        return "the damping is zero everywhere, so that no closed orbit is isolated"
    low, high = group.limits
    zeros = [root.value for root in real_roots(flow.damping) if root.crossing]
    if not any(low < zero < high for zero in zeros):
        return "the damping has one sign wherever a cycle around these equilibria could lie (Bendixson 1901)"
    return ""


def _searched(annulus: Annulus, count: int) -> Searched:
    orbits = sum(len(stretch.nodes) for stretch in annulus.stretches)
    grain = _GRAIN * annulus.stretches[0].chart.rate
    if all(abs(node.lam) <= grain for stretch in annulus.stretches for node in stretch.nodes):
        words = "none: all orbits around these equilibria are closed within rounding (a center)"
    else:
        words = f"{count}, measured on {orbits} orbits, not proven"
        at_loop = [
            end.lam
            for end, saddle in ((annulus.inner, annulus.inner_saddle), (annulus.outer, annulus.outer_saddle))
            if not math.isnan(saddle)
        ]
        if any(abs(lam) <= grain for lam in at_loop):
            words += "; at its end lies a loop within rounding, and cycles near it cannot be told from it"
    if annulus.obstacle:
        words += f"; {annulus.obstacle}"
    return Searched(
        enclosed=tuple(point.x for point in annulus.enclosed),
        orbits=orbits,
        innermost=frozen_array((annulus.inner.x_min, annulus.inner.x_max)),
        outermost=frozen_array((annulus.outer.x_min, annulus.outer.x_max)),
        finding=words,
        obstacle=annulus.obstacle,
    )


def _crossings(flow: Flow, annulus: Annulus) -> Iterator[Located]:
    """Yield the cycles: the sign changes of λ* between its nodes and extrema."""
    enclosed = tuple(point.x for point in annulus.enclosed)
    turns = extrema(flow, annulus)
    for index, stretch in enumerate(annulus.stretches):
        grain = _GRAIN * stretch.chart.rate
        clear = [node for node in _monotone(stretch, index, turns) if abs(node.lam) > grain]
        for low, high in pairwise(clear):
            if low.lam * high.lam < 0.0:
                yield _best(stretch.chart, low, high, enclosed)


def _monotone(stretch: Stretch, index: int, turns: tuple[Extremum, ...]) -> list[Closed]:
    own = [turn.node for turn in turns if turn.stretch == index and math.isfinite(turn.node.growth)]
    return sorted([*stretch.nodes, *own], key=lambda node: node.p)


def _best(chart: Chart, low: Closed, high: Closed, enclosed: tuple[float, ...]) -> Located:
    """Locate a cycle from its right end, or, where both halves from there spread orbits too far, from its left."""
    brackets = [(chart, low, high)]
    if chart.way is Way.FROM_FOCUS:
        ends = [-chart.field.u_of(node.x_max if chart.field.mirrored else node.x_min) for node in (low, high)]
        if 0.0 < ends[0] < ends[1]:
            inner, outer = (replace(node, p=math.log(u)) for node, u in zip((low, high), ends, strict=True))
            brackets.append((chart.mirrored(), inner, outer))
    found: list[Located] = []
    for bracket in brackets:
        try:
            found.append(_located(*bracket, enclosed))
        except RefusedError:
            if not found and bracket is brackets[-1]:
                raise
            continue
        if abs(found[-1].found.miss) <= _LOOSE * (found[-1].cycle.x_max - found[-1].cycle.x_min):
            break
    return min(found, key=lambda one: abs(one.found.miss))


def _located(chart: Chart, low: Closed, high: Closed, enclosed: tuple[float, ...]) -> Located:
    """Find the p between two nodes at which λ* is zero, by Newton's method on the miss within the bracket."""
    inside, outside = low.p, high.p
    rising = high.lam > 0.0  # with λ*, whose sign is that of the miss at λ = 0
    p = low.p + (high.p - low.p) * low.lam / (low.lam - high.lam)
    for _ in range(_ITERATIONS):
        found = probe(chart, p, 0.0)
        if (found.miss > 0.0) == rising:
            outside = p
        else:
            inside = p
        usable = math.isfinite(found.miss) and chart.holds(found)
        change = newton_in_p(chart, p, found) if usable else math.inf
        if abs(change) <= _SURE * max(1.0, abs(p)) or outside - inside <= _SURE * max(1.0, abs(p)):
            break
        p = p + change if inside < p + change < outside else 0.5 * (inside + outside)
    if not chart.holds(found):
        raise RefusedError("a cycle was bracketed, but could not be followed")
    return Located(chart, p, found, flow_cycle_of(chart, found, enclosed, bracket_of(chart, p, found)))


def flow_cycle_of(chart: Chart, found: Probe, enclosed: tuple[float, ...], bracket: tuple[float, float]) -> FlowCycle:
    """Return the cycle that an orbit is, given what is inside and its bracket."""
    left, right = sorted((chart.field.x_of(found.ahead), chart.field.x_of(found.right)))
    return FlowCycle(
        x_min=left,
        x_max=right,
        period=found.durations[0] - found.durations[1],
        log_multiplier=found.dampings[0] - found.dampings[1],
        enclosed=enclosed,
        residual=found.miss,
        bracket=frozen_array(bracket),
    )


def bracket_of(chart: Chart, p: float, found: Probe) -> tuple[float, float]:
    """Return two places of x_max around a cycle from which orbits miss themselves on opposite sides.

    So near to a loop that no parameter tells one orbit from the next the miss has no sign; there they are such that
    the distance to the saddle differs by a factor e^±10.
    """
    here, distance = _right(chart, found), max(map(abs, chart.start(p)))
    step = min(_WIDEST, _SURE * max(1.0, abs(p), abs(here) / distance))
    while True:
        low, high = probe(chart, p - step, 0.0), probe(chart, p + step, 0.0)
        ends = _right(chart, low), _right(chart, high)
        # So near to a saddle that p moves no digit of x, both places are the same number.
        strict = min(ends) < here < max(ends) or step > _COARSE
        if (low.miss * high.miss < 0.0 and strict) or step >= _WIDEST:
            return min(*ends, here), max(*ends, here)
        step = min(_WIDEST, step * _GROWTH)


def _right(chart: Chart, found: Probe) -> float:
    return chart.field.x_of(found.ahead if chart.field.mirrored else found.right)
