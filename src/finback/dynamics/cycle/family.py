"""Families of limit cycles over the elevator, each end of them named, folds of cycles passed and located."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, final

import numpy as np
from scipy.optimize import brentq

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.cycle.branch import FamilyEnd
from finback.dynamics.cycle.closing import confirmed
from finback.dynamics.cycle.cycle import Cycle, by_theta, cycle_of, sizes_of
from finback.dynamics.cycle.flow_cycle import flow_cycle_of
from finback.dynamics.cycle.track import WEIGHT, Frame, Spot, Track
from finback.dynamics.cycle.variation import half_orbit, variation
from finback.dynamics.flow import flow_at, natural_scale
from finback.dynamics.hopf import Hopf, hopf_points
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.orbit.annulus import poles, reach
from finback.dynamics.orbit.turn import Stage
from finback.errors import InputError, RefusedError

_FIRST: Final = -6.9  # of w: a cycle of a thousandth of the way to the saddle
_LOOP: Final = 26.0  # of w: nearer to the saddle than 1e-11 of the way
_NEAR_LOOP: Final = 6.0  # of w: a cycle that is lost beyond it ends at a loop through more than one saddle
_LARGE: Final = 3.0  # of w without a saddle: twenty times the size of the system
_STEP: Final = 0.6
_LONGEST: Final = 0.9
_SHORTEST: Final = 1e-3
_TURN: Final = 0.35  # rad between the directions of two steps
_MOST: Final = 600
_SWITCH: Final = 0.5  # of w: by how much the other side must be nearer to a saddle to name the cycle
_ASIDE: Final = 0.1  # of a step: how far beside its beginning a family that has come back may pass
_CENTER: Final = 1e-9  # of the logarithm of a multiplier: orbits around a center differ from 0 by rounding
_RETURNED: Final = 5  # points before a family can have come back to its beginning


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ElevatorCycleFold:
    """Two cycles meet and vanish as the elevator moves.

    Attributes:
        cycle: the cycle at which they meet; its multiplier is 1.
        elevator_rad: the elevator there.
        elevator_interval_rad: 95 % interval by the delta method (integrals along the cycle), shape (2,).
        bracket_rad: largest angles of two cycles of the family beside it, one stable, one not, shape (2,).
        residual: logarithm of the multiplier, as evaluated: zero at a fold.
        in_domain: whether the whole cycle lies at angles where data supported the model.
    """

    cycle: Cycle
    elevator_rad: float
    elevator_interval_rad: FloatArray
    bracket_rad: FloatArray
    residual: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_interval_rad", "bracket_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CycleFamily:
    """Cycles that go over into each other.

    Attributes:
        cycles: in order along the family, two or more but for a family that is lost at once.
        begin: where it begins: ``HOPF``, or the end reached by following a given cycle backward.
        end: where it ends.
        begin_elevator_rad: the elevator of that end; of a loop, to the digits that the last cycle shows.
        end_elevator_rad: the same.
        folds: folds of cycles on the way.
        obstacle: what of it could not be found and why, in words; empty if there is nothing to say. A family of which
            nothing could be found has no cycles, begins at its Hopf point, and is lost there.
    """

    cycles: tuple[Cycle, ...]
    begin: FamilyEnd
    end: FamilyEnd
    begin_elevator_rad: float
    end_elevator_rad: float
    folds: tuple[ElevatorCycleFold, ...]
    obstacle: str


def cycle_families(system: LienardSystem, elevator_range_rad: tuple[float, float]) -> tuple[CycleFamily, ...]:
    """Follow the cycles born at each Hopf point in a range of elevators; one that ends at another is listed once.

    A degenerate Hopf point around which all orbits are closed (a center) bears no limit cycles, and no family. A family
    that cannot be followed from its Hopf point is listed as lost there, with the reason; the others are unharmed.

    Raises:
        InputError: the range is empty.
    """
    _check(elevator_range_rad)
    families: list[CycleFamily] = []
    points = hopf_points(system)
    reached: list[float] = []
    for hopf in points:
        inside = elevator_range_rad[0] <= hopf.elevator_rad <= elevator_range_rad[1]
        if inside and hopf.alpha_rad not in reached:
            try:
                family = _from_hopf(system, elevator_range_rad, hopf)
            except RefusedError as refusal:
                family = CycleFamily(
                    cycles=(),
                    begin=FamilyEnd.HOPF,
                    end=FamilyEnd.LOST,
                    begin_elevator_rad=hopf.elevator_rad,
                    end_elevator_rad=hopf.elevator_rad,
                    folds=(),
                    obstacle=refusal.message,
                )
            if family is None:
                continue
            if family.end is FamilyEnd.HOPF and family.cycles:
                # The last cycle is a thousandth of the way to a saddle; the point inside it is known in closed form.
                middle = 0.5 * (family.cycles[-1].alpha_min_rad + family.cycles[-1].alpha_max_rad)
                other = min(points, key=lambda point: abs(point.alpha_rad - middle))
                reached.append(other.alpha_rad)
                family = replace(family, end_elevator_rad=other.elevator_rad)
            families.append(family)
    return tuple(families)


def cycle_family(system: LienardSystem, cycle: Cycle, elevator_range_rad: tuple[float, float]) -> CycleFamily:
    """Follow a cycle both ways as the elevator moves.

    Args:
        system: the system.
        cycle: one of its cycles.
        elevator_range_rad: where it is followed; holds the cycle's elevator.

    Raises:
        InputError: the range is empty, or does not hold the elevator of the cycle.
        RefusedError: the cycle is none of the system's.
    """
    _check(elevator_range_rad)
    if not elevator_range_rad[0] <= cycle.elevator_rad <= elevator_range_rad[1]:
        raise InputError("the cycle to be followed lies outside the elevator range")
    track = _track(system, cycle.elevator_rad, elevator_range_rad)
    turns = (cycle.alpha_min_rad / track.scale.length_rad, cycle.alpha_max_rad / track.scale.length_rad)
    begin = _named(track, cycle.elevator_rad, turns)
    ways = []
    along = track.tangent(begin)
    for way in (-1.0, 1.0):
        spots, end, at = _follow(track, begin, (way * along[0], way * along[1]))
        ways.append((spots, end, at))
        if end is FamilyEnd.CLOSED:
            return _family(track, spots, *[(FamilyEnd.CLOSED, begin.elevator_rad)] * 2)
    (back, first, first_at), (ahead, last, last_at) = ways
    return _family(track, [*reversed(back[1:]), *ahead], (first, first_at), (last, last_at))


def _check(elevator_range_rad: tuple[float, float]) -> None:
    low, high = elevator_range_rad
    if not low < high:
        raise InputError(f"the elevator range ({low}, {high}) is empty", hint="give the lower end first")


def _track(system: LienardSystem, elevator_rad: float, elevator_range_rad: tuple[float, float]) -> Track:
    scale, _ = natural_scale(system, elevator_rad)
    flow = flow_at(system, elevator_rad, scale)
    places = [pole.x for pole in poles(flow)]
    return Track(system, scale, elevator_range_rad, reach(flow, places[0], places[-1]))


def _named(track: Track, elevator_rad: float, turns: tuple[float, float]) -> Spot:
    """Return a cycle by its name on the side where it comes nearer to a saddle."""
    frame = max(track.frames(elevator_rad, turns)[:2], key=lambda frame: track.name(frame, turns, None))
    w = track.name(frame, turns, None)
    spot = track.at(frame, w, elevator_rad, math.nan)
    found = None if spot is None else track.on_elevator(spot, frame, w, elevator_rad)
    if found is None:
        raise RefusedError("there is no cycle of the system at the place given")
    return found


def _from_hopf(system: LienardSystem, elevator_range_rad: tuple[float, float], hopf: Hopf) -> CycleFamily | None:
    """Follow the cycles born at a Hopf point; None if they are no limit cycles."""
    track = _track(system, hopf.elevator_rad, elevator_range_rad)
    place = hopf.alpha_rad / track.scale.length_rad
    tiny = 1e-9
    start = None
    for frame in track.frames(hopf.elevator_rad, (place - tiny, place + tiny))[:2]:
        guess = track.at(frame, _FIRST, hopf.elevator_rad, math.nan)
        start = None if guess is None else track.on_name(guess, _FIRST)
        if start is not None and math.isfinite(frame.outer):
            break
    if start is None:
        raise RefusedError("no cycle could be found beside a Hopf point")
    low, high = elevator_range_rad
    if not low <= start.elevator_rad <= high:
        ends = (FamilyEnd.HOPF, hopf.elevator_rad), (FamilyEnd.RANGE, hopf.elevator_rad)
        return _family(track, [], *ends)
    spots, end, at = _follow(track, start, (1.0, 0.0))
    if not any(abs(spot.growth) > _CENTER for spot in spots):
        return None
    return _family(track, spots, (FamilyEnd.HOPF, hopf.elevator_rad), (end, at))


def _follow(track: Track, begin: Spot, direction: tuple[float, float]) -> tuple[list[Spot], FamilyEnd, float]:
    """Follow a family; return its cycles, how it ends, and the elevator there."""
    spots = [begin]
    length, heading = _STEP, direction
    scale = WEIGHT / track.span
    while len(spots) < _MOST:
        spot = spots[-1]
        following = _step(track, spot, heading, length)
        if following is None:
            length *= 0.5
            if length >= _SHORTEST:
                continue
            return spots, *_lost(track, spot)
        moved = following.w - spot.w, (following.elevator_rad - spot.elevator_rad) * scale
        size = math.hypot(*moved)
        turned = math.acos(max(-1.0, min(1.0, (moved[0] * heading[0] + moved[1] * heading[1]) / size)))
        if turned > _TURN and length > _SHORTEST and len(spots) > 1:
            length *= 0.5
            continue
        if not track.elevator_range_rad[0] <= following.elevator_rad <= track.elevator_range_rad[1]:
            return _to_range(track, spots, following)
        spots.append(following)
        end = _ended(track, spots)
        if end is not None:
            return spots, end, following.elevator_rad
        heading = (moved[0] / size, moved[1] / size)
        length = min(length * (1.3 if turned < 0.5 * _TURN else 1.0), _LONGEST)
        spots[-1], heading = _switched(track, spots, heading)
    return spots, FamilyEnd.LOST, spots[-1].elevator_rad


def _step(track: Track, spot: Spot, heading: tuple[float, float], length: float) -> Spot | None:
    target = spot.w + length * heading[0], spot.elevator_rad + length * heading[1] * track.span / WEIGHT
    found = track.solve(spot, target, heading)
    if found is None or abs(found.w - target[0]) > 2.0 * length:
        return None
    off = abs(found.elevator_rad - target[1]) * WEIGHT / track.span
    return found if off <= 2.0 * length else None


def _to_range(track: Track, spots: list[Spot], beyond: Spot) -> tuple[list[Spot], FamilyEnd, float]:
    """End a family at the end of the range that the next step would leave."""
    low, high = track.elevator_range_rad
    edge = low if beyond.elevator_rad < low else high
    spot = spots[-1]
    if beyond.elevator_rad != spot.elevator_rad:
        share = (edge - spot.elevator_rad) / (beyond.elevator_rad - spot.elevator_rad)
        last = track.on_elevator(beyond, beyond.frame, spot.w + share * (beyond.w - spot.w), edge)
        if last is not None and share > 0.0:
            spots.append(_refreshed(track, last))
    return spots, FamilyEnd.RANGE, edge


def _ended(track: Track, spots: list[Spot]) -> FamilyEnd | None:
    """Name the end that the last cycle has reached, if any."""
    last, before = spots[-1], spots[-2]
    rising, over = last.w > before.w, not math.isnan(last.frame.over)
    if math.isinf(last.frame.outer) and not over:
        if last.w > _LARGE and rising:
            return FamilyEnd.LARGE
    elif last.w > _LOOP and rising:
        return FamilyEnd.LOOP
    if last.w < _FIRST and not rising and not over:
        return FamilyEnd.HOPF
    return FamilyEnd.CLOSED if len(spots) > _RETURNED and _returns(track, spots) else None


def _returns(track: Track, spots: list[Spot]) -> bool:
    """Tell whether the last step passed the cycle that the family began with, in the direction in which it began.

    In the plane of elevator and largest angle the curve of a family does not cross itself: one cycle goes through each
    point.
    """
    scale = np.array([WEIGHT / track.reach, WEIGHT / track.span])
    first, second, before, last = (scale * (spot.turns[1], spot.elevator_rad) for spot in (*spots[:2], *spots[-2:]))
    here, there = last - before, first - before
    if not here.any():
        return False
    along = float(there @ here) / float(here @ here)
    off = float(np.hypot(*(there - along * here)))
    return 0.0 < along <= 1.0 and off < _ASIDE * float(np.hypot(*here)) and float((second - first) @ here) > 0.0


def _switched(track: Track, spots: list[Spot], heading: tuple[float, float]) -> tuple[Spot, tuple[float, float]]:
    """Name the last cycle anew, by the equilibria now beside it, where it is nearest to a saddle."""
    last, before = spots[-1], spots[-2]
    try:
        frames = track.frames(last.elevator_rad, last.turns)
    except RefusedError:
        return last, heading  # just where two equilibria meet, somewhere
    own = min(frames, key=lambda frame: (not last.frame.alike(frame), abs(_over(frame) - _over(last.frame))))
    best = max(frames, key=lambda frame: track.name(frame, last.turns, last))
    nearer = track.name(best, last.turns, last) > last.w + _SWITCH
    if own.same(last.frame) and not nearer:
        return replace(last, frame=own), heading
    frame = best if nearer else own
    w, earlier = track.name(frame, last.turns, last), track.name(frame, before.turns, before)
    spot = track.at(frame, w, last.elevator_rad, math.nan)
    spot = None if spot is None else track.on_elevator(spot, frame, w, last.elevator_rad)
    if spot is None or not math.isfinite(earlier):
        return last, heading
    moved = spot.w - earlier, (last.elevator_rad - before.elevator_rad) * WEIGHT / track.span
    size = math.hypot(*moved)
    return spot, (moved[0] / size, moved[1] / size)


def _over(frame: Frame) -> float:
    return 0.0 if math.isnan(frame.over) else frame.over


def _lost(track: Track, spot: Spot) -> tuple[FamilyEnd, float]:
    """Name the end of a family that no short step continues."""
    if spot.w > _NEAR_LOOP and not (math.isinf(spot.frame.outer) and math.isnan(spot.frame.over)):
        return FamilyEnd.LOOP, spot.elevator_rad
    step = 1e-3 * track.span
    counts = set()
    for change in (-step, 0.0, step):
        try:
            counts.add(len(track.equilibria(spot.elevator_rad + change)))
        except RefusedError:
            counts.add(-1)
    return (FamilyEnd.EQUILIBRIA_MEET if len(counts) > 1 else FamilyEnd.LOST), spot.elevator_rad


def _family(
    track: Track, spots: list[Spot], begin: tuple[FamilyEnd, float], end: tuple[FamilyEnd, float]
) -> CycleFamily:
    folds: list[ElevatorCycleFold] = []
    obstacles: list[str] = []
    for low, high in pairwise(spots):
        if low.growth * high.growth < 0.0:
            try:
                folds.append(_fold(track, low, high))
            except RefusedError as refusal:
                between = sorted((low.elevator_rad, high.elevator_rad))
                words = f"a fold of cycles near elevators {between[0]:.6g} to {between[1]:.6g} rad is not located"
                obstacles.append(f"{words}: {refusal.message}")
    cycles = [_cycle(track, spot) for spot in spots]
    missing = [spot.elevator_rad for spot, cycle in zip(spots, cycles, strict=True) if cycle is None]
    if missing:
        obstacles.append(
            f"{len(missing)} cycles at elevators {min(missing):.9g} to {max(missing):.9g} rad do not close within "
            "rounding when followed once more (a canard), and are left out"
        )
    elif FamilyEnd.LOST in (begin[0], end[0]):
        obstacles.append("it could not be followed farther in ever shorter steps")
    if cycles and cycles[0] is None and begin[0] is not FamilyEnd.HOPF:
        begin = (
            FamilyEnd.LOST,
            next((spot.elevator_rad for spot, one in zip(spots, cycles, strict=True) if one), begin[1]),
        )
    if cycles and cycles[-1] is None:
        pairs = reversed(list(zip(spots, cycles, strict=True)))
        end = FamilyEnd.LOST, next((spot.elevator_rad for spot, one in pairs if one), begin[1])
    return CycleFamily(
        cycles=tuple(cycle for cycle in cycles if cycle is not None),
        begin=begin[0],
        end=end[0],
        begin_elevator_rad=begin[1],
        end_elevator_rad=end[1],
        folds=tuple(folds),
        obstacle="; ".join(obstacles),
    )


def _cycle(track: Track, spot: Spot) -> Cycle | None:
    """Return a cycle of a family as a whole turn confirms it; None if none does."""
    field = spot.chart.field
    rests = np.array([field.u_of(x) for x in track.equilibria(spot.elevator_rad)])
    found = confirmed(Stage(spot.chart, rests), spot.p, spot.growth)
    if found is None:
        return None
    cycle = flow_cycle_of(found, spot.frame.inside)
    try:
        return cycle_of(track.system, spot.elevator_rad, track.scale, (field, found.right), cycle)
    except RefusedError:
        return None


def _fold(track: Track, low: Spot, high: Spot) -> ElevatorCycleFold:
    """Locate the cycle with multiplier 1 between two cycles of a family: the elevator turns there.

    Raises:
        RefusedError: the two cannot be named alike; the family could not be followed between them.
    """
    if not low.frame.alike(high.frame):
        renamed = _renamed(track, low, high)
        if renamed is None:
            raise RefusedError("the cycles on its two sides have no name in common")
        low = renamed
    cache: dict[float, Spot] = {low.w: low, high.w: high}

    def growth(w: float) -> float:
        if w not in cache:
            near = min(cache.values(), key=lambda spot: abs(spot.w - w))
            found = track.on_name(near, w)
            if found is None:
                raise RefusedError("a fold of cycles was bracketed, but could not be followed")
            cache[w] = found
        return cache[w].growth

    w = float(brentq(growth, low.w, high.w, xtol=1e-12))
    growth(w)
    spot = _refreshed(track, cache[w])
    field, right = spot.chart.field, spot.found.right
    halves = half_orbit(field, right, forward=True), half_orbit(field, right, forward=False)
    rows = variation(field, halves, right, sizes_of(track.system)).closing
    moved = by_theta(track.system, spot.elevator_rad, track.scale, rows)
    push = float(rows[1][0]) * track.system.elevator_gain * track.scale.time_s**2 / track.scale.length_rad
    ends = low.turns[1], high.turns[1]
    cycle = _cycle(track, spot)
    if cycle is None:
        raise RefusedError("the cycle there does not close when it is followed once more")
    cycle = replace(cycle, bracket_rad=frozen_array(np.sort(ends) * track.scale.length_rad))
    gradient = track.system.root_shift(moved, push)
    return ElevatorCycleFold(
        cycle=cycle,
        elevator_rad=spot.elevator_rad,
        elevator_interval_rad=track.system.interval(spot.elevator_rad, gradient),
        bracket_rad=cycle.bracket_rad,
        residual=spot.growth,
        in_domain=cycle.in_domain,
    )


def _refreshed(track: Track, spot: Spot) -> Spot:
    """Return a cycle with the equilibria beside and inside it looked up anew."""
    frames = [frame for frame in track.frames(spot.elevator_rad, spot.turns) if frame.alike(spot.frame)]
    return replace(spot, frame=min(frames, key=lambda frame: abs(_over(frame) - _over(spot.frame))))


def _renamed(track: Track, spot: Spot, like: Spot) -> Spot | None:
    """Name a cycle as another is named."""
    frames = [frame for frame in track.frames(spot.elevator_rad, spot.turns) if frame.alike(like.frame)]
    if not frames:
        return None
    frame = min(frames, key=lambda frame: abs(_over(frame) - _over(like.frame)))
    w = track.name(frame, spot.turns, spot)
    begin = track.at(frame, w, spot.elevator_rad, math.nan) if math.isfinite(w) else None
    return None if begin is None else track.on_elevator(begin, frame, w, spot.elevator_rad)
