"""The analysis of a planar polynomial field in one value: equilibria, connections, limit cycles, stability regions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.planar.analysis_cycles import ParameterCycles, parameter_cycles
from finback.dynamics.planar.branch import PlanarBranches, planar_branches
from finback.dynamics.planar.connection import PlanarHeteroclinic, PlanarHomoclinic
from finback.dynamics.planar.connection_search import PlanarConnections, planar_connections
from finback.dynamics.planar.equilibrium import PlanarEquilibrium, planar_equilibria
from finback.dynamics.planar.family_path import FamilyEnd
from finback.dynamics.planar.path import BranchEnd
from finback.dynamics.planar.region import PlanarRegion, planar_regions
from finback.dynamics.planar.system import PlanarSystem
from finback.errors import InputError, RefusedError
from finback.units import from_si, quantity_of, unit_of

_SAME: Final = 1e-9  # of the range: two events so near to each other are one place


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarAnalysisOptions:
    """What is analyzed, in the units of the system's variables.

    Attributes:
        parameter_range: lowest and highest parameter.
        parameter_step: distance of two parameters at which equilibria are listed; adjusted so that it divides the
            range. A closed branch that lies between two of them is not seen.
        first_range: lowest and highest first state of interest; branches end at these edges.
        second_range: the same for the second state.
        cycle_parameters: how many parameters, evenly spaced over the range, limit cycles are looked for at.
    """

    parameter_range: tuple[float, float]
    parameter_step: float
    first_range: tuple[float, float]
    second_range: tuple[float, float]
    cycle_parameters: int = 17

    def __post_init__(self) -> None:
        """Refuse empty ranges and steps."""
        for name in ("parameter_range", "first_range", "second_range"):
            low, high = getattr(self, name)
            if not (np.isfinite([low, high]).all() and low < high):
                raise InputError(f"analysis.{name}: ({low}, {high}) is no range", hint="give the lower end first")
        if not self.parameter_step > 0.0:
            raise InputError(f"analysis.parameter_step: {self.parameter_step} is not a step", hint="make it > 0")
        if self.cycle_parameters < 2:
            raise InputError(
                f"analysis.cycle_parameters: {self.cycle_parameters} parameters are no range", hint="use 2 or more"
            )

    @property
    def box(self) -> FloatArray:
        """Low and high of both states, shape (2, 2)."""
        return np.array([self.first_range, self.second_range])

    @property
    def disturbance_units(self) -> tuple[float, float]:
        """The units in which the smallest disturbance that escapes is measured: half of the range of each state."""
        first, second = (0.5 * (high - low) for low, high in (self.first_range, self.second_range))
        return first, second

    @property
    def grid(self) -> tuple[float, ...]:
        """The parameters at which equilibria are listed, rising, both ends of the range included."""
        low, high = self.parameter_range
        steps = max(1, round((high - low) / self.parameter_step))
        return tuple(np.linspace(low, high, steps + 1).tolist())


class PlanarEvent(StrEnum):
    """What ends a regime of a planar field."""

    RANGE = "range"
    """nothing: the range of the parameter ends"""
    FOLD = "fold"
    CUSP = "cusp"
    HOPF = "hopf"
    BOGDANOV_TAKENS = "bogdanov-takens"
    BRANCH_POINT = "branch-point"
    HETEROCLINIC = "heteroclinic"
    HOMOCLINIC = "homoclinic"
    CYCLE_FOLD = "cycle-fold"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarRegime:
    """An interval of the parameter in which none of the events that were found lies.

    Attributes:
        parameter: the interval, shape (2,).
        events: what lies at its ends.
        parameter_seen: its middle, where the stability regions were looked for.
        regions: how many were found there: sinks within the ranges.
        obstacle: why they were not found; empty if they were.
    """

    parameter: FloatArray
    events: tuple[PlanarEvent, PlanarEvent]
    parameter_seen: float
    regions: int
    obstacle: str

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "parameter", frozen_array(self.parameter))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarAnalysis:
    """What was found.

    Attributes:
        system: the field.
        options: the ranges.
        equilibria: over the grid, within the box, by rising parameter, then by state.
        found: branches, folds, cusps, Hopf points, neutral saddles, Bogdanov-Takens points, branch points.
        connections: saddle connections within the box, and where they were looked for.
        limit_cycles: within the box: at some parameters, and their families.
        regimes: the range of the parameter, split at folds, cusps, Hopf and Bogdanov-Takens points, crossing branches,
            saddle connections and folds of cycles.
        regions: stability regions of the sinks in the box, in the middle of each regime; disturbances in units of half
            the range of each state.
        notes: what a reader must know, in words: what was searched, what is extrapolated.
    """

    system: PlanarSystem
    options: PlanarAnalysisOptions
    equilibria: tuple[PlanarEquilibrium, ...]
    found: PlanarBranches
    connections: PlanarConnections
    limit_cycles: ParameterCycles
    regimes: tuple[PlanarRegime, ...]
    regions: tuple[PlanarRegion, ...]
    notes: tuple[str, ...]


def analyze_planar(system: PlanarSystem, options: PlanarAnalysisOptions) -> PlanarAnalysis:
    """Find equilibria over the grid, the branches through them and what lies on these; connections, cycles, regions.

    Raises:
        RefusedError: equilibria are isolated at no parameter of the grid.
    """
    every, missing = _equilibria(system, options)
    box = options.box
    kept = tuple(p for p in every if ((box[:, 0] <= p.state) & (p.state <= box[:, 1])).all())
    found = planar_branches(system, options.parameter_range, box, kept)
    searched = np.linspace(*options.parameter_range, options.cycle_parameters).tolist()
    with np.errstate(divide="ignore", invalid="ignore"):  # what is not finite there is refused by its value
        joined = planar_connections(system, options.parameter_range, box)
        cycles = parameter_cycles(system, searched, box, found.hopf_points)
        regimes, regions = _regions(system, options, _events(found, joined, cycles))
    return PlanarAnalysis(
        system=system,
        options=options,
        equilibria=kept,
        found=found,
        connections=joined,
        limit_cycles=cycles,
        regimes=regimes,
        regions=regions,
        notes=(
            *missing,
            *_equilibrium_notes(kept, left_out=len(every) - len(kept)),
            *_branch_notes(found),
            *_point_notes(system, found),
            *_orbit_notes(system, options, joined, cycles),
            *_regime_notes(system, regimes),
        ),
    )


def _equilibria(
    system: PlanarSystem, options: PlanarAnalysisOptions
) -> tuple[tuple[PlanarEquilibrium, ...], tuple[str, ...]]:
    """Return the equilibria over the grid, and in words where they are not isolated."""
    found: list[PlanarEquilibrium] = []
    refused: list[tuple[float, RefusedError]] = []
    for parameter in options.grid:
        try:
            found += planar_equilibria(system, parameter)
        except RefusedError as refusal:
            refused.append((parameter, refusal))
    if len(refused) == len(options.grid):
        raise refused[0][1]
    notes = (f"At {_place(system, place)} no equilibrium is listed: {why.message}." for place, why in refused)
    return tuple(found), tuple(notes)


def _events(
    found: PlanarBranches, joined: PlanarConnections, cycles: ParameterCycles
) -> list[tuple[float, PlanarEvent]]:
    """Return the parameters at which what bounds the stability regions may change."""
    return [
        *((point.parameter, PlanarEvent.FOLD) for point in found.folds),
        *((point.parameter, PlanarEvent.CUSP) for point in found.cusps),
        *((point.parameter, PlanarEvent.HOPF) for point in found.hopf_points),
        *((point.parameter, PlanarEvent.BOGDANOV_TAKENS) for point in found.bogdanov_takens),
        *((point.parameter, PlanarEvent.BRANCH_POINT) for point in found.branch_points),
        *((orbit.parameter, PlanarEvent.HETEROCLINIC) for orbit in joined.heteroclinics),
        *((orbit.parameter, PlanarEvent.HOMOCLINIC) for orbit in joined.homoclinics),
        *(
            (fold.parameter, PlanarEvent.CYCLE_FOLD)
            for family in cycles.families
            for fold in family.folds
            if fold.resolved
        ),
    ]


def _regions(
    system: PlanarSystem, options: PlanarAnalysisOptions, events: list[tuple[float, PlanarEvent]]
) -> tuple[tuple[PlanarRegime, ...], tuple[PlanarRegion, ...]]:
    """Return the regimes between neighboring events, and the stability regions in the middle of each."""
    low, high = options.parameter_range
    near = _SAME * (high - low)
    ends = [(low, PlanarEvent.RANGE)]
    for parameter, event in sorted(events):
        if ends[-1][0] + near < parameter < high - near:
            ends.append((parameter, event))
    regimes: list[PlanarRegime] = []
    regions: list[PlanarRegion] = []
    for (left, before), (right, after) in pairwise([*ends, (high, PlanarEvent.RANGE)]):
        middle = 0.5 * (left + right)
        found: tuple[PlanarRegion, ...] = ()
        obstacle = ""
        try:
            found = planar_regions(system, middle, options.box, disturbance_units=options.disturbance_units)
        except RefusedError as refusal:
            obstacle = refusal.message
        except ArithmeticError:
            obstacle = "orbits go so far that numbers overflow"
        regions += found
        regimes.append(
            PlanarRegime(
                parameter=frozen_array((left, right)),
                events=(before, after),
                parameter_seen=middle,
                regions=len(found),
                obstacle=obstacle,
            )
        )
    return tuple(regimes), tuple(regions)


def _regime_notes(system: PlanarSystem, regimes: tuple[PlanarRegime, ...]) -> Iterator[str]:
    """Say where stability regions are missing, and that none is sought beyond the ranges."""
    for regime in regimes:
        if regime.obstacle:
            yield f"Stability regions at {_place(system, regime.parameter_seen)}: {regime.obstacle}."
    if not any(regime.regions or regime.obstacle for regime in regimes):
        yield "There is no stability region: no equilibrium within the ranges is stable where they were looked for."


def _orbit_notes(
    system: PlanarSystem, options: PlanarAnalysisOptions, joined: PlanarConnections, cycles: ParameterCycles
) -> Iterator[str]:
    """Say what was searched, and what could not be."""
    yield cycles.statement
    low, high = (_place(system, end) for end in options.parameter_range)
    if not any(stretch.saddles or stretch.obstacle for stretch in joined.stretches):
        yield f"There is no saddle within the ranges from {low} to {high}, and so no saddle connection."
    elif not (joined.heteroclinics or joined.homoclinics or any(stretch.obstacle for stretch in joined.stretches)):
        yield (
            f"No saddle connection was found within the ranges from {low} to {high}: measured, not proved, at 25 "
            "places of each stretch on which the equilibria keep number and kind."
        )
    for stretch in joined.stretches:
        if stretch.obstacle:
            low, high = (_place(system, float(end)) for end in stretch.parameter)
            yield f"Saddle connections from {low} to {high} could not be searched to the end: {stretch.obstacle}."
    for obstacle in cycles.obstacles:
        yield f"Limit cycles could not be searched to the end: {obstacle}."
    leaving = sum(FamilyEnd.BOX in family.ends for family in cycles.families)
    if leaving:
        yield f"Families of limit cycles that leave the ranges of the states, where they were not followed: {leaving}."
    lost = sum(FamilyEnd.LOST in family.ends for family in cycles.families)
    if lost:
        yield f"Families of limit cycles that could not be followed to an end: {lost}."
    every: list[PlanarHeteroclinic | PlanarHomoclinic] = [*joined.heteroclinics, *joined.homoclinics]
    for orbit in every:
        if not orbit.in_domain:
            place = _place(system, orbit.parameter)
            yield f"The saddle connection at {place} is extrapolated: no data supported the model."


def _equilibrium_notes(kept: tuple[PlanarEquilibrium, ...], *, left_out: int) -> Iterator[str]:
    if not kept:
        yield "There is no equilibrium within the ranges at any parameter of the grid."
    if left_out:
        yield f"Equilibria outside the ranges of the states, not listed: {left_out}."
    outside = sum(not point.in_domain for point in kept)
    if outside:
        yield f"Equilibria listed where no data supported the model, extrapolated: {outside}."


def _branch_notes(found: PlanarBranches) -> Iterator[str]:
    stalled = sum(BranchEnd.STALLED in branch.ends for branch in found.branches)
    if stalled:
        yield f"Branches that could not be followed to an edge of the ranges: {stalled}."
    if found.conservative:
        yield "The trace is zero all along a branch: no Hopf point can be told there."


def _point_notes(system: PlanarSystem, found: PlanarBranches) -> Iterator[str]:
    for name, points in (
        ("fold", found.folds),
        ("Hopf point", found.hopf_points),
        ("neutral saddle", found.neutral_saddles),
    ):
        for point in points:
            if not point.in_domain:
                yield f"The {name} at {_place(system, point.parameter)} is extrapolated: no data supported the model."
    for cusp in found.cusps:
        yield (
            f"At {_place(system, cusp.parameter)} the branch stands still in the parameter without turning round: "
            "a cusp, or two folds within rounding."
        )
    for double in found.bogdanov_takens:
        yield f"At {_place(system, double.parameter)} trace and determinant vanish together within rounding."
    for crossing in found.branch_points:
        yield (
            f"At {_place(system, crossing.parameter)} branches cross ({crossing.crossing}): only coefficients that "
            "keep a symmetry or an invariant line leave it so."
        )


def _place(system: PlanarSystem, parameter: float) -> str:
    name = system.variables[2]
    unit = unit_of(name)
    if unit == "rad":
        return f"{quantity_of(name)} {from_si(parameter, 'deg'):.3f}°"
    return f"{quantity_of(name)} {parameter:.6g}" + ("" if unit == "1" else f" {unit.replace('_', '/')}")
