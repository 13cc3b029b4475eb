"""What bounds the stability regions, over the elevator: it changes at named events only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Final, final

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.connection.search import connections
from finback.dynamics.cycle.flow_cycle import flow_cycles
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import flow_at, natural_scale, rests
from finback.dynamics.fold import folds
from finback.dynamics.hopf import hopf_points
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.stability.basin import destination
from finback.errors import RefusedError

_SAME: Final = 1e-12  # of the range: two events so near to each other are one place


class Event(StrEnum):
    """What ends a regime."""

    RANGE = "range"
    """nothing: the range of elevators ends"""
    FOLD = "fold"
    HOPF = "hopf"
    HETEROCLINIC = "heteroclinic"
    HOMOCLINIC = "homoclinic"
    OTHER = "other"
    """an elevator that the caller named, as that of a fold of cycles"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """What bounds the stability region of one sink.

    Attributes:
        alpha_rad: the sink.
        saddles_alpha_rad: the saddles on the boundary, each with both branches of its stable manifold; rising.
        slits: which of them have the region on both sides of their stable manifold.
        cycle: whether an unstable cycle around the sink alone bounds it; then no saddle does.
    """

    alpha_rad: float
    saddles_alpha_rad: tuple[float, ...]
    slits: tuple[bool, ...]
    cycle: bool


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Regime:
    """An interval of elevators in which no event changes what bounds the stability regions.

    Attributes:
        elevator_rad: the interval, shape (2,).
        events: what lies at its ends.
        elevator_seen_rad: its middle, where the bounds were found.
        bounds: of each sink there, by rising angle.
        obstacle: why they were not found; empty if they were.
    """

    elevator_rad: FloatArray
    events: tuple[Event, Event]
    elevator_seen_rad: float
    bounds: tuple[Bounds, ...]
    obstacle: str

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "elevator_rad", frozen_array(self.elevator_rad))


def regimes(
    system: LienardSystem, elevator_range_rad: tuple[float, float], *, others: Sequence[float] = ()
) -> tuple[Regime, ...]:
    """Split a range of elevators at folds, Hopf points and saddle connections; tell what bounds the regions between.

    Two neighboring regimes may have the same bounds: not every event changes them.

    Args:
        system: the system.
        elevator_range_rad: the range.
        others: further elevators at which to split, as those of folds of cycles.

    Returns:
        the regimes, by rising elevator; they cover the range.
    """
    low, high = elevator_range_rad
    if not low < high:
        raise RefusedError(f"the range of elevators ({low}, {high}) is empty")
    joined = connections(system, elevator_range_rad)
    every = [
        *((fold.elevator_rad, Event.FOLD) for fold in folds(system)),
        *((hopf.elevator_rad, Event.HOPF) for hopf in hopf_points(system)),
        *((found.elevator_rad, Event.HETEROCLINIC) for found in joined.heteroclinics),
        *((found.elevator_rad, Event.HOMOCLINIC) for found in joined.homoclinics),
        *((elevator, Event.OTHER) for elevator in others),
    ]
    ends = [(low, Event.RANGE)]
    for elevator, event in sorted(every):
        if ends[-1][0] + _SAME * (high - low) < elevator < high:
            ends.append((elevator, event))
    ends.append((high, Event.RANGE))
    return tuple(_regime(system, left, right) for left, right in pairwise(ends))


def _regime(system: LienardSystem, left: tuple[float, Event], right: tuple[float, Event]) -> Regime:
    middle = 0.5 * (left[0] + right[0])
    bounds: tuple[Bounds, ...] = ()
    obstacle = ""
    try:
        bounds = bounds_at(system, middle)
    except RefusedError as refusal:
        obstacle = refusal.message
    except ArithmeticError:
        obstacle = "orbits go so far that numbers overflow"
    return Regime(
        elevator_rad=frozen_array((left[0], right[0])),
        events=(left[1], right[1]),
        elevator_seen_rad=middle,
        bounds=bounds,
        obstacle=obstacle,
    )


def bounds_at(system: LienardSystem, elevator_rad: float) -> tuple[Bounds, ...]:
    """Tell what bounds the stability region of every sink at a held elevator, without following the boundary.

    Raises:
        RefusedError: an unstable manifold cannot be followed to its end.
    """
    scale, _ = natural_scale(system, elevator_rad)
    flow = flow_at(system, elevator_rad, scale)
    points = rests(flow)
    saddles = [point for point in points if point.kind is Kind.SADDLE]
    sinks = [point for point in points if point.kind.stable]
    if not sinks:
        return ()
    reached = {
        index: [destination(flow, saddle, side, points) for side in (-1, 1)] for index, saddle in enumerate(saddles)
    }
    found = []
    for sink in sinks:
        mine = [index for index in reached if sink in reached[index]]
        circled = not mine and any(cycle.enclosed == (sink.x,) for cycle in flow_cycles(flow).cycles)
        found.append(
            Bounds(
                alpha_rad=sink.x * scale.length_rad,
                saddles_alpha_rad=tuple(saddles[index].x * scale.length_rad for index in mine),
                slits=tuple(all(end is sink for end in reached[index]) for index in mine),
                cycle=circled,
            )
        )
    return tuple(found)
