"""The analysis of a reduced model in one value: equilibria, connections, limit cycles, stability regions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from finback.dynamics.analysis_cycles import ElevatorCycles, elevator_cycles, in_degrees
from finback.dynamics.analysis_notes import (
    connection_notes,
    cycle_notes,
    elevator_notes,
    equilibrium_notes,
    fold_notes,
    region_notes,
    trace_notes,
)
from finback.dynamics.branch import Branch, branch
from finback.dynamics.connection.search import Connections, connections
from finback.dynamics.cycle.cycle import Cycle
from finback.dynamics.equilibrium import Equilibrium, equilibria
from finback.dynamics.fold import Fold, folds
from finback.dynamics.hopf import (
    BogdanovTakens,
    Hopf,
    NeutralSaddle,
    bogdanov_takens_points,
    hopf_points,
    neutral_saddles,
)
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.reduction import reduce
from finback.dynamics.stability.regime import Regime, regimes
from finback.dynamics.stability.region import StabilityRegion, each_stability_region
from finback.errors import InputError, RefusedError
from finback.units import to_si


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class AnalysisOptions:
    """What is analyzed.

    Attributes:
        elevator_range_rad: lowest and highest elevator at which equilibria are listed.
        elevator_step_rad: distance of two of them; adjusted so that it divides the range.
        alpha_range_rad: lowest and highest angle of interest; what lies outside is counted in the notes only.
        branch_points: points of the branch, evenly spaced in angle.
        region_alpha_rad: angles to which stability regions are cut; they reach farther than any data.
    """

    elevator_range_rad: tuple[float, float]
    elevator_step_rad: float
    alpha_range_rad: tuple[float, float]
    branch_points: int = 1601
    region_alpha_rad: tuple[float, float] = (to_si(-100.0, "deg"), to_si(100.0, "deg"))

    def __post_init__(self) -> None:
        """Refuse empty ranges and steps."""
        for name, (low, high) in (
            ("elevator_range_rad", self.elevator_range_rad),
            ("alpha_range_rad", self.alpha_range_rad),
            ("region_alpha_rad", self.region_alpha_rad),
        ):
            if not low < high:
                raise InputError(f"analysis.{name}: ({low}, {high}) is empty", hint="give the lower end first")
        if not self.elevator_step_rad > 0.0:
            raise InputError(f"analysis.elevator_step_rad: {self.elevator_step_rad} is not a step", hint="make it > 0")
        if self.branch_points < 2:
            raise InputError(f"analysis.branch_points: {self.branch_points} points make no curve", hint="use 2 or more")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """What was found.

    Attributes:
        system: the system analyzed.
        options: the ranges.
        branch: all equilibria in the alpha range, by angle.
        equilibria: over the elevator grid, by rising elevator, then by angle.
        folds: in the alpha range, by angle, at whatever elevator they lie.
        hopf_points: in the alpha range, by angle, at whatever elevator they lie.
        neutral_saddles: likewise.
        bogdanov_takens: likewise: where trace and determinant vanish together within rounding.
        connections: saddle connections, with all their saddles in the alpha range, and where they were looked for.
        limit_cycles: around equilibria in the alpha range: at the elevators of the grid, their families over the
            range, and where there are none.
        regimes: the elevator range, split at folds, Hopf points, saddle connections and folds of cycles; between two of
            these nothing changes what bounds the stability regions.
        regions: stability regions of the sinks in the alpha range, in the middle of each regime; by rising elevator.
        notes: what a reader must know, in words: what is extrapolated, what lies outside the ranges.
    """

    system: LienardSystem
    options: AnalysisOptions
    branch: Branch
    equilibria: tuple[Equilibrium, ...]
    folds: tuple[Fold, ...]
    hopf_points: tuple[Hopf, ...]
    neutral_saddles: tuple[NeutralSaddle, ...]
    bogdanov_takens: tuple[BogdanovTakens, ...]
    connections: Connections
    limit_cycles: ElevatorCycles
    regimes: tuple[Regime, ...]
    regions: tuple[StabilityRegion, ...]
    notes: tuple[str, ...]


@np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what is not finite is said so, or refused by its value
def analyze(system: LienardSystem, options: AnalysisOptions) -> Analysis:
    """Find equilibria over the grid, the branch, its folds and zeros of the trace, connections, cycles, regions.

    Where a search was not possible, a note says so.

    Raises:
        RefusedError: the equilibria can be found at no elevator of the grid.
    """
    low, high = options.alpha_range_rad
    grid = _elevator_grid(options)
    every_equilibrium, degenerate = _equilibria(system, grid)
    every_fold = folds(system)
    kept_folds = tuple(fold for fold in every_fold if low <= fold.alpha_rad <= high)
    hopf = tuple(point for point in hopf_points(system) if low <= point.alpha_rad <= high)
    neutral = tuple(point for point in neutral_saddles(system) if low <= point.alpha_rad <= high)
    double = tuple(point for point in bogdanov_takens_points(system) if low <= point.alpha_rad <= high)
    kept = tuple(point for point in every_equilibrium if low <= point.alpha_rad <= high)
    searched = connections(system, options.elevator_range_rad)
    kept_connections = _within(searched, options.alpha_range_rad)
    every_cycle = elevator_cycles(system, grid)
    kept_cycles = _around(every_cycle, options.alpha_range_rad)
    turns = [fold.elevator_rad for family in every_cycle.families for fold in family.folds]
    split = regimes(system, options.elevator_range_rad, others=turns)
    regions, region_left_out, refusals = _regions(system, options, split)
    return Analysis(
        system=system,
        options=options,
        branch=branch(system, np.linspace(low, high, options.branch_points)),
        equilibria=kept,
        folds=kept_folds,
        hopf_points=hopf,
        neutral_saddles=neutral,
        bogdanov_takens=double,
        connections=kept_connections,
        limit_cycles=kept_cycles,
        regimes=split,
        regions=regions,
        notes=(
            *elevator_notes(system, options.elevator_range_rad),
            *degenerate,
            *fold_notes(system, kept_folds, left_out=len(every_fold) - len(kept_folds)),
            *trace_notes(system, hopf, double),
            *equilibrium_notes(system, kept, left_out=len(every_equilibrium) - len(kept)),
            *connection_notes(system, searched, kept_connections, options.elevator_range_rad),
            *cycle_notes(kept_cycles, left_out=len(every_cycle.cycles) - len(kept_cycles.cycles)),
            *region_notes(system, split, regions, refusals, left_out=region_left_out),
        ),
    )


def analyze_model(model: PolynomialModel, options: AnalysisOptions) -> Analysis:
    """Reduce a model to its Liénard form and analyze that."""
    return analyze(reduce(model), options)


def _equilibria(system: LienardSystem, grid: list[float]) -> tuple[tuple[Equilibrium, ...], tuple[str, ...]]:
    """Return the equilibria over a grid of elevators, and in words where they are not isolated."""
    found: list[Equilibrium] = []
    refused: list[tuple[float, RefusedError]] = []
    for elevator in grid:
        try:
            found += equilibria(system, elevator)
        except RefusedError as refusal:
            refused.append((elevator, refusal))
    if len(refused) == len(grid):
        raise RefusedError(f"no equilibria can be told at any elevator of the range: {refused[0][1].message}")
    notes = (f"At elevator {in_degrees(at)} no equilibrium is listed: {why.message}." for at, why in refused)
    return tuple(found), tuple(notes)


def _within(searched: Connections, alpha_range_rad: tuple[float, float]) -> Connections:
    """Keep the connections whose saddles lie in the alpha range."""
    low, high = alpha_range_rad
    return replace(
        searched,
        heteroclinics=tuple(
            found
            for found in searched.heteroclinics
            if low <= min(found.from_alpha_rad, found.to_alpha_rad)
            and max(found.from_alpha_rad, found.to_alpha_rad) <= high
        ),
        homoclinics=tuple(found for found in searched.homoclinics if low <= found.alpha_rad <= high),
    )


def _around(found: ElevatorCycles, alpha_range_rad: tuple[float, float]) -> ElevatorCycles:
    """Keep the cycles around equilibria in the alpha range, and the families that hold one."""

    def holds(cycle: Cycle) -> bool:
        inside = cycle.enclosed_alpha_rad
        return bool(((alpha_range_rad[0] <= inside) & (inside <= alpha_range_rad[1])).any())

    return replace(
        found,
        cycles=tuple(cycle for cycle in found.cycles if holds(cycle)),
        families=tuple(f for f in found.families if not f.cycles or any(map(holds, f.cycles))),
    )


def _regions(
    system: LienardSystem, options: AnalysisOptions, split: tuple[Regime, ...]
) -> tuple[tuple[StabilityRegion, ...], int, tuple[str, ...]]:
    """Return the stability regions of each regime, how many lie outside the alpha range, and why others are missing."""
    low, high = options.alpha_range_rad
    found: list[StabilityRegion] = []
    left_out, refusals = 0, []
    for regime in split:
        if not any(low <= bounds.alpha_rad <= high for bounds in regime.bounds):
            left_out += len(regime.bounds)
            continue
        elevator = regime.elevator_seen_rad
        try:
            every = each_stability_region(system, elevator, alpha_range_rad=options.region_alpha_rad)
        except RefusedError as refusal:
            refusals.append(f"Stability regions at elevator {in_degrees(elevator)}: {refusal.message}.")
            continue
        for one in every:
            if not low <= one.alpha_rad <= high:
                left_out += 1
            elif isinstance(one, StabilityRegion):
                found.append(one)
            else:
                place = f"alpha {in_degrees(one.alpha_rad)}, elevator {in_degrees(elevator)}"
                refusals.append(f"The stability region of the sink at {place} was not found: {one.obstacle}.")
    return tuple(found), left_out, tuple(refusals)


def _elevator_grid(options: AnalysisOptions) -> list[float]:
    low, high = options.elevator_range_rad
    steps = max(1, round((high - low) / options.elevator_step_rad))
    return [float(value) for value in np.linspace(low, high, steps + 1)]
