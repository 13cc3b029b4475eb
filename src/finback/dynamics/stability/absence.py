"""Where a Liénard system has no limit cycle: proved where theorems reach, measured elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from itertools import pairwise
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.cycle.flow_cycle import FlowCycles, flow_cycles
from finback.dynamics.flow import Flow, Scale, flow_at
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.roots import real_roots, sign_across
from finback.dynamics.stability.interval import Effort
from finback.dynamics.stability.level_criterion import Strip, energy_levels, field_of, mean_damping, plausible, strip_of
from finback.errors import RefusedError

_CELLS: Final = 16  # intervals of equilibria to begin with, on each branch
_HALVINGS: Final = 8  # of such an interval, where it is decided only in part
_MOST_BOXES: Final = 400_000  # over the whole range, some seconds; proofs that succeed take a few thousand
_NEAR: Final = 1e-9  # of an angle: an equilibrium found twice
_SAMPLES: Final = 9  # elevators at which cycles are looked for where nothing was proved


class Theorem(StrEnum):
    """Why there is no limit cycle."""

    INDEX = "index"
    """a closed orbit encloses equilibria of total index 1 (Poincaré 1885), and there are none such"""
    BENDIXSON = "bendixson"
    """the divergence f has one sign wherever a closed orbit around these equilibria could lie (Bendixson 1901)"""
    MEAN_DAMPING = "mean-damping"
    """the mean of f between the equilibrium and any x up to its neighbors has one sign (see ``level_criterion``)"""
    ENERGY_LEVELS = "energy-levels"
    """the integral of f is ordered at the two ends of every level of the potential (see ``level_criterion``)"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class AbsenceProven:
    """No limit cycle around certain equilibria, for every elevator of an interval.

    All inequalities were decided with rounding bounded, for the coefficients as they are; the elevators at the ends are
    those of the angles, rounded.

    Attributes:
        elevator_rad: the interval, shape (2,).
        enclosed: how many equilibria such a cycle would enclose; 0 if there are none that it could.
        alpha_rad: where the first of them moves over the interval, shape (2,); nan if there are none.
        theorem: what proves it.
        boxes: how many boxes of interval arithmetic decided it; 0 where counting roots did.
    """

    elevator_rad: FloatArray
    enclosed: int
    alpha_rad: FloatArray
    theorem: Theorem
    boxes: int

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_rad", "alpha_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class AbsenceMeasured:
    """An interval in which no theorem above decides: cycles were looked for at some elevators.

    Attributes:
        elevator_rad: the interval, shape (2,).
        enclosed: how many equilibria a cycle would enclose.
        alpha_rad: where the first of them moves over the interval, shape (2,).
        sampled_rad: elevators at which cycles were looked for, shape (n,).
        counts: how many were found at each, shape (n,); -1 where none was, as the search was refused or hindered.
    """

    elevator_rad: FloatArray
    enclosed: int
    alpha_rad: FloatArray
    sampled_rad: FloatArray
    counts: tuple[int, ...]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_rad", "alpha_rad", "sampled_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Absence:
    """What is known of the absence of limit cycles over a range of elevators.

    Attributes:
        elevator_range_rad: the range, shape (2,).
        parts: for each set of equilibria that a cycle can enclose, intervals that cover all elevators of the range at
            which it exists; by number enclosed, then by angle.
    """

    elevator_range_rad: FloatArray
    parts: tuple[AbsenceProven | AbsenceMeasured, ...]

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "elevator_range_rad", frozen_array(self.elevator_range_rad))

    @property
    def proven(self) -> bool:
        """Whether there is provably no limit cycle at any elevator of the range."""
        return all(isinstance(part, AbsenceProven) for part in self.parts)

    @property
    def refuted(self) -> bool:
        """Whether a limit cycle was found somewhere in the range."""
        return any(isinstance(part, AbsenceMeasured) and max(part.counts) > 0 for part in self.parts)


@final
@dataclass(frozen=True, slots=True)
class _Piece:
    """Equilibria between two neighboring folds, as far as elevators of the range hold them; angles rise."""

    alpha: tuple[float, float]
    elevator: tuple[float, float]  # at these angles
    saddle: bool

    @property
    def span(self) -> tuple[float, float]:
        return min(self.elevator), max(self.elevator)


def absence(system: LienardSystem, elevator_range_rad: tuple[float, float]) -> Absence:
    """Prove the absence of limit cycles over a range of elevators, as far as it goes.

    The equilibrium is the parameter: on a branch of equilibria between two folds the elevator is monotone, so an
    interval of angles is an interval of elevators, folds included. Intervals that no theorem decides are halved up to
    eight times, until 400 000 boxes are spent; at a Hopf point, where cycles begin, a small one always remains.

    Raises:
        RefusedError: every angle is an equilibrium.
    """
    low, high = elevator_range_rad
    if not low <= high:
        raise RefusedError(f"the range of elevators ({low}, {high}) is empty")
    pieces = list(_pieces(system, low, high))
    parts: list[AbsenceProven | AbsenceMeasured] = []
    effort = Effort(_MOST_BOXES)
    for piece in pieces:
        if not piece.saddle:
            parts += _around_one(system, piece, effort)
    parts += _around_many(system, pieces)
    parts += _around_none([piece.span for piece in pieces if not piece.saddle], (low, high))
    return Absence(elevator_range_rad=frozen_array(elevator_range_rad), parts=tuple(parts))


def _pieces(system: LienardSystem, low: float, high: float) -> Iterator[_Piece]:
    """Yield the stretches of equilibria on which g is monotone, by rising angle."""
    force = system.force.ascending.tolist()
    slope = [k * c for k, c in enumerate(force)][1:] or [0.0]
    gain = system.elevator_gain
    folds = [root.bracket for root in real_roots(slope) if root.crossing] if any(slope) else []
    edges = [(-math.inf, -math.inf), *folds, (math.inf, math.inf)]
    ends = []
    for elevator in (low, high):
        row = [force[0] + gain * elevator, *force[1:]]
        sizes = [abs(force[0]) + abs(gain * elevator), *map(abs, force[1:])]
        ends.append(real_roots(row, magnitudes=sizes))
    for (left, _), (_, right) in pairwise(edges):
        held = [[root for root in roots if left < root.value < right] for roots in ends]
        saddle = _rises(slope, left, right)
        outer = [left, right]
        rises = saddle != (gain > 0.0)  # the elevator, with the angle: δ = −g/c₁
        for side, roots in enumerate(held if rises else held[::-1]):
            if roots:
                outer[side] = roots[0].bracket[side] if side == 0 else roots[-1].bracket[1]
        values = [float(system.holding_elevator(x)) if gain else low for x in outer]
        if not all(map(math.isfinite, outer)) or (gain and not _overlaps(values, low, high)) or not (gain or held[0]):
            continue
        spans = (max(low, min(high, values[0])), max(low, min(high, values[1]))) if gain else (low, high)
        yield _Piece((outer[0], outer[1]), spans, saddle)


def _rises(slope: list[float], left: float, right: float) -> bool:
    """Tell the sign of g' between two neighboring roots of it."""
    if math.isinf(left) and math.isinf(right):
        middle = 0.0
    elif math.isinf(left):
        middle = right - 1.0 - abs(right)
    elif math.isinf(right):
        middle = left + 1.0 + abs(left)
    else:
        middle = 0.5 * (left + right)
    return sign_across(slope, (middle, middle)) > 0


def _overlaps(values: list[float], low: float, high: float) -> bool:
    return min(values) <= high and max(values) >= low


def _around_one(system: LienardSystem, piece: _Piece, effort: Effort) -> Iterator[AbsenceProven | AbsenceMeasured]:
    """Yield what is known of cycles around one equilibrium, neighbors of one finding joined."""
    field = field_of(system.damping.ascending.tolist(), system.force.ascending.tolist())
    # At one elevator the interval is but the rounding of one angle, which no halving decides.
    moves = bool(system.elevator_gain) and piece.span[0] < piece.span[1]
    cells = list(pairwise(np.linspace(*piece.alpha, _CELLS + 1).tolist())) if moves else [piece.alpha]
    findings: list[tuple[tuple[float, float], Theorem | None, int]] = []
    for cell in cells:
        findings += _decide(system, strip_of(field, cell), _HALVINGS if moves else 0, effort)
    joined: list[tuple[tuple[float, float], Theorem | None, int]] = []
    for cell, theorem, boxes in findings:
        if joined and joined[-1][1] is theorem:
            (start, _), _, before = joined.pop()
            joined.append(((start, cell[1]), theorem, before + boxes))
        else:
            joined.append((cell, theorem, boxes))
    for cell, theorem, boxes in joined:
        elevators = _elevators(system, piece, cell)
        if theorem is None:
            yield _measured(system, elevators, cell, 1)
        else:
            yield AbsenceProven(
                elevator_rad=frozen_array(elevators),
                enclosed=1,
                alpha_rad=frozen_array(cell),
                theorem=theorem,
                boxes=boxes,
            )


def _decide(
    system: LienardSystem, strip: Strip, halvings: int, effort: Effort
) -> list[tuple[tuple[float, float], Theorem | None, int]]:
    """Decide an interval of equilibria, or its halves."""
    damping = system.damping.ascending.tolist()
    sign = sign_across(damping, strip.s)
    if sign and not any(strip.s[0] < root.bracket[1] and root.bracket[0] < strip.s[1] for root in real_roots(damping)):
        boxes = mean_damping(strip, sign, effort)
        if boxes:
            return [(strip.s, Theorem.MEAN_DAMPING, boxes)]
        boxes = energy_levels(strip, sign, effort)
        if boxes:
            return [(strip.s, Theorem.ENERGY_LEVELS, boxes)]
    middle = 0.5 * (strip.s[0] + strip.s[1])
    if (
        not halvings
        or effort.left <= 0
        or not strip.s[0] < middle < strip.s[1]
        or not any(plausible(part, way) for part in _ends(strip) for way in (-1, 1))
    ):
        return [(strip.s, None, 0)]
    halves = ((strip.s[0], middle), (middle, strip.s[1]))
    return [one for half in halves for one in _decide(system, strip_of(strip.field, half), halvings - 1, effort)]


def _ends(strip: Strip) -> Iterator[Strip]:
    """Yield the two ends and the middle of an interval of equilibria."""
    for place in (strip.s[0], 0.5 * (strip.s[0] + strip.s[1]), strip.s[1]):
        yield strip_of(strip.field, (place, place))


def _elevators(system: LienardSystem, piece: _Piece, cell: tuple[float, float]) -> tuple[float, float]:
    """Return the elevators that hold the ends of an interval of angles, within those of the piece, the lower first."""
    if not system.elevator_gain:
        return piece.span
    low, high = piece.span
    values = [
        piece.elevator[piece.alpha.index(x)] if x in piece.alpha else float(system.holding_elevator(x)) for x in cell
    ]
    return max(low, min(values)), min(high, max(values))


def _around_many(system: LienardSystem, pieces: list[_Piece]) -> Iterator[AbsenceProven | AbsenceMeasured]:
    """Yield what is known of cycles around three equilibria or more: an odd number, no saddles at the ends."""
    damping = system.damping.ascending.tolist()
    for first, start in enumerate(pieces):
        for last in range(first + 2, len(pieces), 2):
            if start.saddle or pieces[last].saddle:
                continue
            members = pieces[first : last + 1]
            low = max(piece.span[0] for piece in members)
            high = min(piece.span[1] for piece in members)
            if low > high or (low == high and system.elevator_gain):
                continue
            left = pieces[first - 1].alpha[0] if first else -math.inf
            right = pieces[last + 1].alpha[1] if last + 1 < len(pieces) else math.inf
            roots = real_roots(damping) if any(damping) else ()
            one_sign = any(damping) and all(root.bracket[1] <= left or root.bracket[0] >= right for root in roots)
            if one_sign:
                yield AbsenceProven(
                    elevator_rad=frozen_array((low, high)),
                    enclosed=len(members),
                    alpha_rad=frozen_array(start.alpha),
                    theorem=Theorem.BENDIXSON,
                    boxes=0,
                )
            else:
                yield _measured(system, (low, high), start.alpha, len(members))


def _around_none(spans: list[tuple[float, float]], whole: tuple[float, float]) -> Iterator[AbsenceProven]:
    """Yield the elevators at which there is nothing that a cycle could enclose."""
    reached = whole[0]
    for low, high in [*sorted(spans), (whole[1], whole[1])]:
        if low > reached or (not spans and whole[0] == whole[1]):
            yield AbsenceProven(
                elevator_rad=frozen_array((reached, low)),
                enclosed=0,
                alpha_rad=frozen_array((math.nan, math.nan)),
                theorem=Theorem.INDEX,
                boxes=0,
            )
        reached = max(reached, high)


def _measured(
    system: LienardSystem, elevators: tuple[float, float], alpha: tuple[float, float], enclosed: int
) -> AbsenceMeasured:
    """Look for cycles at some elevators inside an interval."""
    shares = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    sampled = np.unique(elevators[0] + (elevators[1] - elevators[0]) * shares)
    counts = tuple(_count(system, elevator, alpha, enclosed) for elevator in sampled.tolist())
    return AbsenceMeasured(
        elevator_rad=frozen_array(elevators),
        enclosed=enclosed,
        alpha_rad=frozen_array(alpha),
        sampled_rad=sampled,
        counts=counts,
    )


@lru_cache(maxsize=4 * _SAMPLES)
def _found(flow: Flow) -> FlowCycles:
    """Search once where several parts ask at the same elevator."""
    return flow_cycles(flow)


def _count(system: LienardSystem, elevator_rad: float, alpha: tuple[float, float], enclosed: int) -> int:
    """Return how many cycles are found around so many equilibria, the first of them in an interval; -1 if unknown."""
    try:
        found = _found(flow_at(system, elevator_rad, Scale(length_rad=1.0, time_s=1.0)))
    except RefusedError:
        return -1

    def meant(around: tuple[float, ...]) -> bool:
        near = _NEAR * max(abs(x) for x in (*around, *alpha))
        return len(around) == enclosed and alpha[0] - near <= around[0] <= alpha[1] + near

    count = sum(meant(cycle.enclosed) for cycle in found.cycles)
    hindered = any(search.obstacle for search in found.searched if meant(search.enclosed))
    return count if count or not hindered else -1
