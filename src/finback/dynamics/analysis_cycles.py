"""Limit cycles over a range of elevators: at the elevators of a grid, as families, and where there are none."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache
from itertools import groupby, pairwise
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.cycle.cycle import Cycle, cycles
from finback.dynamics.cycle.family import CycleFamily, cycle_families, cycle_family
from finback.dynamics.equilibrium import Kind, equilibria
from finback.dynamics.fold import folds
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.roots import real_roots
from finback.dynamics.stability.absence import Absence, AbsenceMeasured, AbsenceProven, absence
from finback.dynamics.stability.level_criterion import field_of, plausible, strip_of
from finback.errors import RefusedError
from finback.units import from_si

_MOST_SEARCHED: Final = 101  # elevators; of a finer grid only so many are searched
_MOST_CELLS: Final = 30  # between elevators at which a proof of absence is judged possible or not
_ASIDE: Final = 0.02  # of such a cell: beside a fold, where it is judged too
_MOST_FOLLOWED: Final = 12  # families that begin at no Hopf point
_SLACK: Final = 1e-3  # of the amplitude: how far a chord between neighbors of a family may miss the cycle between them

_NAMED: Final = 3  # elevators with the same obstacle that words name

_TOO_FAR: Final = "orbits go so far that numbers overflow"
_AT: Final = "at elevator"
_FROM: Final = "from a cycle at elevator"


@final
@dataclass(slots=True)
class _Obstacles:
    """What could not be searched or followed: the same reason is said once, with its elevators."""

    found: dict[tuple[str, str], list[float]] = field(default_factory=dict)

    def add(self, reason: str, place: str = "", elevator_rad: float = 0.0) -> None:
        """Add a reason, with ``place`` (``_AT`` or ``_FROM``) and elevator if it has one."""
        self.found.setdefault((place, reason), []).append(elevator_rad)

    def words(self) -> Iterator[str]:
        for (place, reason), elevators in self.found.items():
            if not place:
                yield reason
                continue
            said = ", ".join(in_degrees(elevator) for elevator in elevators[:_NAMED])
            more = len(elevators) - _NAMED
            yield f"{place} {said}{f' and {more} more' if more > 0 else ''}: {reason}"


class CycleVerdict(StrEnum):
    """What is known of limit cycles over the elevator range."""

    PROVED_ABSENT = "proved-absent"
    """there is none at any elevator of the range"""
    NONE_FOUND = "none-found"
    """none was found, but at some elevators no theorem excludes it"""
    FOUND = "found"
    UNKNOWN = "unknown"
    """the search was refused"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CycleAbsence:
    """Where limit cycles are excluded, and how well.

    Attributes:
        verdict: over the whole range.
        statement: the same in words, with the elevators.
        parts: for each set of equilibria that a cycle can enclose, intervals of elevators with what proves it, or with
            what was measured there.
        undecided_rad: elevators at which no theorem excludes a cycle around every set of equilibria: intervals, shape
            (n, 2), rising.
    """

    verdict: CycleVerdict
    statement: str
    parts: tuple[AbsenceProven | AbsenceMeasured, ...]
    undecided_rad: FloatArray

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "undecided_rad", frozen_array(self.undecided_rad))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ElevatorCycles:
    """The limit cycles of a system over a range of elevators.

    Attributes:
        cycles: at the elevators of the grid, by rising elevator; as ``cycles`` orders them at each.
        families: those born at Hopf points, then those through cycles that belong to none of these.
        absence: where there is none.
        searched_rad: elevators of the grid at which cycles were looked for; at the others they are proved absent.
        obstacles: what could not be searched or followed, in words.
    """

    cycles: tuple[Cycle, ...]
    families: tuple[CycleFamily, ...]
    absence: CycleAbsence
    searched_rad: tuple[float, ...]
    obstacles: tuple[str, ...]


def elevator_cycles(system: LienardSystem, grid_rad: Sequence[float]) -> ElevatorCycles:
    """Find limit cycles over the range of a grid, two elevators or more, rising.

    Elevators at which their absence is proved are not searched; of the others at most 101 of the grid. Besides the
    families of all Hopf points in the range, any cycle found on none of them is followed both ways: at most twelve
    families. Families without Hopf point that live between two elevators of the grid only are not seen.
    """
    grid = _thinned(grid_rad, _MOST_SEARCHED)
    if not system.damping.ascending.any():
        return _conservative(grid[0], grid[-1])
    obstacles = _Obstacles()
    proofs = _proofs(system, grid, obstacles)
    undecided = _undecided((grid[0], grid[-1]), proofs)
    searched = [e for e in grid if any(low <= e <= high for low, high in undecided)]
    found = [_cycles(system, elevator, obstacles) for elevator in searched]
    parts = tuple(part for proof in proofs for part in proof.parts)
    # Where the grid is too coarse to see what the samples of an interval without proof show.
    between = [
        elevator
        for part in parts
        if isinstance(part, AbsenceMeasured)
        for elevator, count in zip(part.sampled_rad.tolist(), part.counts, strict=True)
        if count > 0
    ]
    seeds = [*found, *(_cycles(system, elevator, obstacles) for elevator in sorted(between))]
    families = _families(system, (grid[0], grid[-1]), seeds, obstacles)
    some = any(seeds) or any(family.cycles for family in families)
    verdict = _verdict(undecided, some=some, refused=bool(obstacles.found))
    return ElevatorCycles(
        cycles=tuple(cycle for one in found for cycle in one),
        families=tuple(families),
        absence=CycleAbsence(
            verdict=verdict,
            statement=_statement(verdict, (grid[0], grid[-1]), parts, undecided),
            parts=parts,
            undecided_rad=frozen_array(np.array(undecided).reshape(-1, 2)),
        ),
        searched_rad=tuple(searched),
        obstacles=tuple(obstacles.words()),
    )


def _conservative(low: float, high: float) -> ElevatorCycles:
    """Return that there is no limit cycle where the energy is constant along every orbit."""
    return ElevatorCycles(
        cycles=(),
        families=(),
        absence=CycleAbsence(
            verdict=CycleVerdict.PROVED_ABSENT,
            statement=(
                f"There is no limit cycle between elevator {in_degrees(low)} and {in_degrees(high)}: without damping "
                "the energy is constant along every orbit, so that no closed orbit stands alone."
            ),
            parts=(),
            undecided_rad=frozen_array(np.empty((0, 2))),
        ),
        searched_rad=(),
        obstacles=(),
    )


def _proofs(system: LienardSystem, grid: Sequence[float], obstacles: _Obstacles) -> list[Absence]:
    """Prove the absence of cycles on runs of the grid on which plain numbers say that a proof can succeed."""
    edges = _thinned(grid, _MOST_CELLS + 1)
    turns = [fold.elevator_rad for fold in folds(system)]
    hope = cache(lambda elevator: _hopeful(system, elevator))
    hopeful = []
    for low, high in pairwise(edges):
        aside = _ASIDE * (high - low)
        beside = [turn + way * aside for turn in turns for way in (-1, 1) if low < turn + way * aside < high]
        hopeful.append(all(map(hope, (low, high, *beside))) and not low <= _idle(system) <= high)
    # Beside a cell without hope a proof takes long: it would be pushed as near to its limit as it goes.
    clear = [all(hopeful[max(0, k - 1) : k + 2]) for k in range(len(hopeful))]
    found = []
    for good, run in groupby(range(len(clear)), key=clear.__getitem__):
        if good:
            cells = list(run)
            try:
                with np.errstate(invalid="ignore"):  # a branch to infinity: powers without a coefficient are 0 times it
                    found.append(absence(system, (edges[cells[0]], edges[cells[-1] + 1])))
            except RefusedError as refusal:
                obstacles.add(refusal.message)
    return found


def _idle(system: LienardSystem) -> float:
    """Return the elevator at which every angle is an equilibrium; nan if there is none such."""
    constant, *others = system.force.ascending.tolist()
    return math.nan if any(others) or not system.elevator_gain else -constant / system.elevator_gain


def _hopeful(system: LienardSystem, elevator: float) -> bool:
    """Tell whether the theorems can hold at an elevator, by plain numbers: to try them in vain takes long."""
    damping, force = system.damping.ascending.tolist(), system.force.ascending.tolist()
    if not any(force[1:]):  # there is no equilibrium
        return bool(force[0] + system.elevator_gain * elevator)
    one_sign = any(damping) and not any(root.crossing for root in real_roots(damping))
    if one_sign or not any(force[2:]):  # about a linear force all levels are symmetric: the sign of f decides
        return one_sign
    field = field_of(damping, force)
    try:
        points = [point for point in equilibria(system, elevator) if point.kind is not Kind.SADDLE]
    except RefusedError:
        return False
    signs = [int(np.sign(float(system.damping(point.alpha_rad)))) for point in points]
    # A cycle around several equilibria is excluded by the sign of f only.
    return len(points) < 2 and all(
        sign and plausible(strip_of(field, (point.alpha_rad, point.alpha_rad)), sign)
        for point, sign in zip(points, signs, strict=True)
    )


def _undecided(ends: tuple[float, float], proofs: Sequence[Absence]) -> list[tuple[float, float]]:
    """Return the elevators without proof: outside of all proofs, and the intervals in them that no theorem decides."""
    reached, found = ends[0], []
    for proof in proofs:
        low, high = proof.elevator_range_rad.tolist()
        if low > reached:
            found.append((reached, low))
        found += [
            (float(part.elevator_rad[0]), float(part.elevator_rad[1]))
            for part in proof.parts
            if isinstance(part, AbsenceMeasured)
        ]
        reached = high
    if reached < ends[1]:
        found.append((reached, ends[1]))
    joined: list[tuple[float, float]] = []
    for low, high in sorted(found):
        if joined and low <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(high, joined[-1][1]))
        else:
            joined.append((low, high))
    return joined


def _thinned(elevators: Sequence[float], most: int) -> list[float]:
    if len(elevators) <= most:
        return list(elevators)
    return [elevators[k * (len(elevators) - 1) // (most - 1)] for k in range(most)]


def _cycles(system: LienardSystem, elevator: float, obstacles: _Obstacles) -> tuple[Cycle, ...]:
    try:
        return cycles(system, elevator).cycles
    except RefusedError as refusal:
        obstacles.add(refusal.message, _AT, elevator)
    except ArithmeticError:
        obstacles.add(_TOO_FAR, _AT, elevator)
    return ()


def _families(
    system: LienardSystem,
    ends: tuple[float, float],
    seeds: Sequence[tuple[Cycle, ...]],
    obstacles: _Obstacles,
) -> list[CycleFamily]:
    """Return the families of the Hopf points, and of all cycles found that are on none of them."""
    families: list[CycleFamily] = []
    try:
        families += cycle_families(system, ends)
    except RefusedError as refusal:
        obstacles.add(refusal.message)
    except ArithmeticError:
        obstacles.add(f"families of Hopf points: {_TOO_FAR}")
    followed = 0
    for cycle in (cycle for one in seeds for cycle in one):
        if any(_passes(family, cycle) for family in families):
            continue
        if followed == _MOST_FOLLOWED:
            obstacles.add(f"more than {_MOST_FOLLOWED} families of cycles begin at no Hopf point")
            break
        followed += 1
        try:
            families.append(cycle_family(system, cycle, ends))
        except RefusedError as refusal:
            obstacles.add(refusal.message, _FROM, cycle.elevator_rad)
        except ArithmeticError:
            obstacles.add(_TOO_FAR, _FROM, cycle.elevator_rad)
    return families


def _passes(family: CycleFamily, cycle: Cycle) -> bool:
    """Tell whether a cycle lies between two neighbors of a family."""
    sequence = list(_with_folds(family))
    if len(sequence) < len(family.cycles) + len(family.folds) or not sequence:
        sequence = list(family.cycles)
    return any(_between(before, after, cycle) for before, after in pairwise(sequence))


def _with_folds(family: CycleFamily) -> Iterator[Cycle]:
    """Yield the cycles of a family, those at its folds among them: there the elevator turns between two others."""
    folds = iter(family.folds)
    yield from family.cycles[:1]
    for before, after in pairwise(family.cycles):
        if before.stable != after.stable:
            yield from (fold.cycle for fold in [next(folds, None)] if fold is not None)
        yield after


def _between(before: Cycle, after: Cycle, cycle: Cycle) -> bool:
    low, high = sorted((before.elevator_rad, after.elevator_rad))
    if not low <= cycle.elevator_rad <= high:
        return False
    share = (cycle.elevator_rad - before.elevator_rad) / ((after.elevator_rad - before.elevator_rad) or 1.0)
    ends = [
        (getattr(one, name), getattr(other, name))
        for one, other, name in ((before, after, "alpha_min_rad"), (before, after, "alpha_max_rad"))
    ]
    room = 0.5 * sum(abs(b - a) for a, b in ends) + _SLACK * cycle.amplitude_rad
    here = (cycle.alpha_min_rad, cycle.alpha_max_rad)
    return all(abs(a + share * (b - a) - x) <= room for (a, b), x in zip(ends, here, strict=True))


# in words


def in_degrees(value: float) -> str:
    """Write an angle in rad as degrees with three decimals."""
    return f"{from_si(value, 'deg'):.3f}°"


def _verdict(undecided: Sequence[tuple[float, float]], *, some: bool, refused: bool) -> CycleVerdict:
    if some:
        return CycleVerdict.FOUND
    if not undecided:
        return CycleVerdict.PROVED_ABSENT
    return CycleVerdict.UNKNOWN if refused else CycleVerdict.NONE_FOUND


def _statement(
    verdict: CycleVerdict,
    ends: tuple[float, float],
    parts: Sequence[AbsenceProven | AbsenceMeasured],
    undecided: Sequence[tuple[float, float]],
) -> str:
    whole = f"between elevator {in_degrees(ends[0])} and {in_degrees(ends[1])}"
    theorems = ", ".join(dict.fromkeys(part.theorem.value for part in parts if isinstance(part, AbsenceProven)))
    where = ", ".join(f"{in_degrees(low)} to {in_degrees(high)}" for low, high in undecided)
    beyond = f"elsewhere there is none, which is proved (by {theorems})" if theorems else "no theorem excludes any"
    if verdict is CycleVerdict.PROVED_ABSENT:
        return f"There is no limit cycle {whole}: proved for the coefficients as they are (by {theorems})."
    if verdict is CycleVerdict.FOUND:
        return (
            f"Limit cycles were found {whole}. They were looked for from {where}, so that their number there is "
            f"measured, not proved; {beyond}."
        )
    if verdict is CycleVerdict.NONE_FOUND:
        return f"No limit cycle was found {whole}: measured, not proved, from {where}; {beyond}."
    return f"No limit cycle was found {whole}, but from {where} the search did not succeed everywhere; {beyond}."
