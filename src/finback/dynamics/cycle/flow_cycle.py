"""All limit cycles of a flow that a systematic search finds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.cycle.closing import Closing, closing
from finback.dynamics.cycle.survey import Survey, survey
from finback.dynamics.flow import Flow, Scale
from finback.dynamics.orbit.annulus import Group, groups
from finback.dynamics.orbit.closure import Field
from finback.dynamics.orbit.natural_unit import natural_unit
from finback.dynamics.roots import real_roots

_SAME: Final = 1e-9  # of the size of a cycle: two that differ by less are one
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
        residual: by how much the orbit misses itself, in x: where it turns on the side away from its start, followed
            there both ways; or, where that would spread orbits too far, after a whole turn.
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
        orbits: how many orbits were followed round the group; 0 if none needed to be, or none goes round.
        innermost: where the smallest of them turns on the left and on the right, shape (2,); nan if there is none.
        outermost: the same of the largest.
        finding: what is to be said, in words.
        obstacle: where orbits could not be followed, or a cycle not located; empty if there was no such place. Of other
            cycles there nothing is known.
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
        field: the flow in the coordinate of the chart.
        right: where the cycle turns on the right in that.
        cycle: the cycle.
    """

    field: Field
    right: float
    cycle: FlowCycle


def flow_cycles(flow: Flow) -> FlowCycles:
    """Find the limit cycles around every group of equilibria.

    Orbits are followed once round from places along a line from the group outward (see ``survey``). Where the flow
    leads inward on one and outward on its neighbor, a cycle lies between; where it leads to the same side on both, as
    landings are monotone, or as a cubic through both tells. Each cycle is followed once more, all round, in the
    direction in which it attracts (see ``closing``): what does not close is no cycle, and said to be an obstacle. No
    search is made where the damping has one sign (Bendixson 1901). Cycles up to a hundred times the size of the system
    are looked for. The units of the flow do not matter.

    Raises:
        InputError: the coefficients span too many orders of magnitude for double precision.
        RefusedError: two equilibria meet within rounding; the force is zero everywhere.
    """
    scaled, scale = natural_unit(flow)
    found, searched = locate(scaled)
    return FlowCycles(
        cycles=tuple(_in_scale(one.cycle, scale) for one in found),
        searched=tuple(_searched_in_scale(one, scale) for one in searched),
    )


def _in_scale(cycle: FlowCycle, scale: Scale) -> FlowCycle:
    length = scale.length_rad
    return FlowCycle(
        x_min=cycle.x_min * length,
        x_max=cycle.x_max * length,
        period=cycle.period * scale.time_s,
        log_multiplier=cycle.log_multiplier,
        enclosed=tuple(x * length for x in cycle.enclosed),
        residual=cycle.residual * length,
        bracket=frozen_array(cycle.bracket * length),
    )


def _searched_in_scale(search: Searched, scale: Scale) -> Searched:
    length = scale.length_rad
    return Searched(
        enclosed=tuple(x * length for x in search.enclosed),
        orbits=search.orbits,
        innermost=frozen_array(search.innermost * length),
        outermost=frozen_array(search.outermost * length),
        finding=search.finding,
        obstacle=search.obstacle,
    )


def locate(flow: Flow) -> tuple[tuple[Located, ...], tuple[Searched, ...]]:
    """Do the same for a flow in units of its own size, and return each cycle with its place in a chart."""
    found: list[Located] = []
    searched: list[Searched] = []
    for group in sorted(groups(flow), key=lambda group: (len(group.enclosed), group.first)):
        enclosed = tuple(point.x for point in group.enclosed)
        reason = _no_search(flow, group)
        if reason:
            nothing = frozen_array((math.nan, math.nan))
            searched.append(
                Searched(
                    enclosed=enclosed,
                    orbits=0,
                    innermost=nothing,
                    outermost=nothing,
                    finding=f"none: {reason}",
                    obstacle="",
                )
            )
            continue
        seen = survey(group)
        inside: list[Located] = []
        failed: list[str] = []
        for change in seen.changes:
            closed = closing(change)
            if isinstance(closed, str):
                failed += [closed] if closed else []
            elif not any(_same(closed, one) for one in inside):
                inside.append(Located(closed.field, closed.right, flow_cycle_of(closed, enclosed)))
        found += sorted(inside, key=lambda one: one.cycle.x_max)
        searched.append(_searched(enclosed, seen, len(inside), failed))
    return tuple(found), tuple(searched)


def _no_search(flow: Flow, group: Group) -> str:
    if not any(flow.damping):
        return "the damping is zero everywhere, so that no closed orbit is isolated"
    low, high = group.limits
    zeros = [root.value for root in real_roots(flow.damping) if root.crossing]
    if not any(low < zero < high for zero in zeros):
        return "the damping has one sign wherever a cycle around these equilibria could lie (Bendixson 1901)"
    return ""


def _same(one: Closing, other: Located) -> bool:
    """Tell whether two stretches that meet found the same cycle."""
    low, high = one.turns
    near = _SAME * (high - low)
    return abs(low - other.cycle.x_min) <= near and abs(high - other.cycle.x_max) <= near


def flow_cycle_of(closed: Closing, enclosed: tuple[float, ...]) -> FlowCycle:
    """Return a located cycle, given what is inside."""
    low, high = closed.turns
    return FlowCycle(
        x_min=low,
        x_max=high,
        period=closed.period,
        log_multiplier=closed.growth,
        enclosed=enclosed,
        residual=closed.miss,
        bracket=frozen_array(closed.bracket),
    )


def _searched(enclosed: tuple[float, ...], seen: Survey, count: int, failed: list[str]) -> Searched:
    trials = seen.trials
    obstacles = [*failed, *seen.obstacles]
    if not trials and not obstacles:
        words = "none: no orbit closes around these equilibria, as none goes round them"
    elif trials and not any(trial.sign for trial in trials):
        words = "none: all orbits around these equilibria are closed within rounding (a center)"
    else:
        words = f"{count}, measured on {len(trials)} orbits, not proven"
        if seen.at_loop:
            words += "; at its end lies a loop within rounding, and cycles near it cannot be told from it"
    obstacle = "; ".join(obstacles)
    innermost, outermost = seen.reach
    return Searched(
        enclosed=enclosed,
        orbits=len(trials),
        innermost=frozen_array(innermost),
        outermost=frozen_array(outermost),
        finding=f"{words}; {obstacle}" if obstacle else words,
        obstacle=obstacle,
    )
