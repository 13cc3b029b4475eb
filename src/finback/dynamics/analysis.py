"""The analysis of a reduced model: equilibria, folds, the branch and its trace, in one value."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.branch import Branch, branch
from finback.dynamics.connection_search import Connections, connections
from finback.dynamics.equilibrium import Equilibrium, equilibria
from finback.dynamics.fold import Fold, folds
from finback.dynamics.hopf import (
    BogdanovTakens,
    Criticality,
    Hopf,
    NeutralSaddle,
    bogdanov_takens_points,
    hopf_points,
    neutral_saddles,
)
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.reduction import reduce
from finback.dynamics.stability_region import StabilityRegion, stability_region
from finback.errors import InputError, RefusedError
from finback.units import from_si, to_si


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
        regions: stability regions, one for each regime: halfway between neighboring folds and heteroclinic
            connections, where different saddles bound it; by rising elevator.
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
    regions: tuple[StabilityRegion, ...]
    notes: tuple[str, ...]


def analyze(system: LienardSystem, options: AnalysisOptions) -> Analysis:
    """Find equilibria over the grid, the branch, its folds and zeros of the trace, connections, stability regions.

    Where a search was not possible, a note says so.
    """
    low, high = options.alpha_range_rad
    grid = _elevator_grid(options)
    every_equilibrium = tuple(point for elevator in grid for point in equilibria(system, elevator))
    every_fold = folds(system)
    kept_folds = tuple(fold for fold in every_fold if low <= fold.alpha_rad <= high)
    hopf = tuple(point for point in hopf_points(system) if low <= point.alpha_rad <= high)
    neutral = tuple(point for point in neutral_saddles(system) if low <= point.alpha_rad <= high)
    double = tuple(point for point in bogdanov_takens_points(system) if low <= point.alpha_rad <= high)
    kept = tuple(point for point in every_equilibrium if low <= point.alpha_rad <= high)
    searched = connections(system, options.elevator_range_rad)
    kept_connections = _within(searched, options.alpha_range_rad)
    regions, refusals = _regions(system, options, searched)
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
        regions=regions,
        notes=(
            *_elevator_notes(system, options),
            *_fold_notes(system, kept_folds, left_out=len(every_fold) - len(kept_folds)),
            *_trace_notes(system, hopf, neutral, double),
            *_equilibrium_notes(system, kept, left_out=len(every_equilibrium) - len(kept)),
            *_connection_notes(searched, kept_connections),
            *_region_notes(system, regions),
            *refusals,
        ),
    )


def analyze_model(model: PolynomialModel, options: AnalysisOptions) -> Analysis:
    """Reduce a model to its Liénard form and analyze that."""
    return analyze(reduce(model), options)


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


def _regions(
    system: LienardSystem, options: AnalysisOptions, searched: Connections
) -> tuple[tuple[StabilityRegion, ...], tuple[str, ...]]:
    """Return a stability region for each regime in the elevator range, and why there is none where one was tried."""
    low, high = options.elevator_range_rad
    found, refusals = [], []
    for stretch in searched.stretches:
        if not stretch.others or not stretch.saddles:
            continue
        ends = [float(end) for end in stretch.elevator_rad]
        inner = [c.elevator_rad for c in searched.heteroclinics if ends[0] < c.elevator_rad < ends[1]]
        for left, right in pairwise([ends[0], *inner, ends[1]]):
            elevator = 0.5 * (max(left, low) + min(right, high))
            if not max(left, low) < min(right, high):
                continue
            try:
                found.append(stability_region(system, elevator, alpha_range_rad=options.region_alpha_rad))
            except RefusedError as refusal:
                refusals.append(f"At elevator {_degrees(elevator)} {refusal.message}.")
    return tuple(found), tuple(refusals)


def _elevator_grid(options: AnalysisOptions) -> list[float]:
    low, high = options.elevator_range_rad
    steps = max(1, round((high - low) / options.elevator_step_rad))
    return [float(value) for value in np.linspace(low, high, steps + 1)]


def _degrees(value: float) -> str:
    return f"{from_si(value, 'deg'):.3f}°"


def _elevator_notes(system: LienardSystem, options: AnalysisOptions) -> Iterator[str]:
    if system.elevator_gain == 0.0:
        yield "The elevator has no effect on the equilibria: there is no branch and no fold."
    low, high = (float(end) for end in system.domain[1])
    if _is_empty(system.domain):
        yield "An input is held where no data supported the model: everything is extrapolated."
        return
    if options.elevator_range_rad[0] < low or options.elevator_range_rad[1] > high:
        yield (
            f"The data hold elevators from {_degrees(low)} to {_degrees(high)}; beyond them the analysis relies on the "
            "elevator entering linearly."
        )


def _is_empty(domain: FloatArray) -> bool:
    return bool((domain[:, 0] > domain[:, 1]).any())


def _fold_notes(system: LienardSystem, found: tuple[Fold, ...], *, left_out: int) -> Iterator[str]:
    if not found and system.elevator_gain != 0.0:
        yield "There is no fold in the alpha range."
    if left_out:
        yield f"Folds outside the alpha range, not listed: {left_out}."
    for fold in found:
        if not fold.in_domain and not _is_empty(system.domain):
            low, high = (float(end) for end in system.domain[0])
            yield (
                f"The fold at alpha {_degrees(fold.alpha_rad)}, elevator {_degrees(fold.elevator_rad)} is "
                f"extrapolated: the data hold alpha from {_degrees(low)} to {_degrees(high)}."
            )


def _trace_notes(
    system: LienardSystem,
    hopf: tuple[Hopf, ...],
    neutral: tuple[NeutralSaddle, ...],
    double: tuple[BogdanovTakens, ...],
) -> Iterator[str]:
    if not system.damping.ascending.any():
        yield "The damping is zero everywhere: the system is conservative."
    meanings: list[tuple[Hopf | NeutralSaddle | BogdanovTakens, str]] = []
    for point in hopf:
        known = point.criticality is not Criticality.DEGENERATE
        meanings.append((point, f"a {point.criticality} Hopf point" if known else "a Hopf point, degenerate"))
    meanings += [(p, "no Hopf point, because the equilibrium there is a saddle (its trace is zero)") for p in neutral]
    meanings += [(p, "a Bogdanov-Takens point within rounding (the determinant vanishes too)") for p in double]
    for zero, meaning in sorted(meanings, key=lambda item: item[0].alpha_rad):
        extrapolated = "" if zero.in_domain else "; extrapolated"
        yield (
            f"The damping changes its sign at alpha {_degrees(zero.alpha_rad)}, elevator "
            f"{_degrees(zero.elevator_rad)}: {meaning}{extrapolated}."
        )


def _equilibrium_notes(system: LienardSystem, kept: tuple[Equilibrium, ...], *, left_out: int) -> Iterator[str]:
    if left_out:
        yield f"Equilibria outside the alpha range, not listed: {left_out}."
    outside = sum(not point.in_domain for point in kept)
    if outside:
        yield f"Equilibria listed outside the alpha range of the data, extrapolated: {outside}."
    turns = [fold.alpha_rad for fold in folds(system)]
    vague = sum(any(p.alpha_interval_rad[0] <= turn <= p.alpha_interval_rad[1] for turn in turns) for p in kept)
    if vague:
        yield (
            f"Equilibria so near a fold that their interval reaches past it, where a linear interval no longer holds: "
            f"{vague}."
        )


def _connection_notes(searched: Connections, kept: Connections) -> Iterator[str]:
    for stretch in searched.stretches:
        low, high = (_degrees(float(end)) for end in stretch.elevator_rad)
        between = f"between elevator {low} and {high}"
        if stretch.obstacle:
            yield f"Saddle connections {between} could not be searched to the end: {stretch.obstacle}."
        elif stretch.saddles and stretch.others > 1:
            yield f"Saddle connections {between} were searched only as far as they turn at most once."
    left_out = sum(len(getattr(searched, name)) - len(getattr(kept, name)) for name in ("heteroclinics", "homoclinics"))
    if left_out:
        yield f"Saddle connections with saddles outside the alpha range, not listed: {left_out}."
    extrapolated = [c.elevator_rad for c in kept.heteroclinics if not c.in_domain]
    extrapolated += [c.elevator_rad for c in kept.homoclinics if not c.in_domain]
    for elevator in extrapolated:
        yield (
            f"The saddle connection at elevator {_degrees(elevator)} is extrapolated: it reaches angles at which no "
            "data supported the model."
        )


def _region_notes(system: LienardSystem, found: tuple[StabilityRegion, ...]) -> Iterator[str]:
    if found and np.isfinite(system.domain[0]).any():
        yield (
            "The stability regions reach beyond the alpha range of the data: their outer parts are extrapolated, and "
            "their area within the stated angles is the model's, not the aircraft's."
        )
