"""The analysis of a planar polynomial field: branches, equilibria and what is located on them, in one value."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from finback.dynamics.planar import PlanarSystem
from finback.dynamics.planar_branch import PlanarBranches, planar_branches
from finback.dynamics.planar_equilibrium import PlanarEquilibrium, planar_equilibria
from finback.dynamics.planar_path import BranchEnd
from finback.errors import InputError
from finback.units import from_si, quantity_of, unit_of


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
    """

    parameter_range: tuple[float, float]
    parameter_step: float
    first_range: tuple[float, float]
    second_range: tuple[float, float]

    def __post_init__(self) -> None:
        """Refuse empty ranges and steps."""
        for name in ("parameter_range", "first_range", "second_range"):
            low, high = getattr(self, name)
            if not (np.isfinite([low, high]).all() and low < high):
                raise InputError(f"analysis.{name}: ({low}, {high}) is no range", hint="give the lower end first")
        if not self.parameter_step > 0.0:
            raise InputError(f"analysis.parameter_step: {self.parameter_step} is not a step", hint="make it > 0")

    @property
    def grid(self) -> tuple[float, ...]:
        """The parameters at which equilibria are listed, rising, both ends of the range included."""
        low, high = self.parameter_range
        steps = max(1, round((high - low) / self.parameter_step))
        return tuple(np.linspace(low, high, steps + 1).tolist())


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarAnalysis:
    """What was found about equilibria.

    Attributes:
        system: the field.
        options: the ranges.
        equilibria: over the grid, within the box, by rising parameter, then by state.
        found: branches, folds, cusps, Hopf points, neutral saddles, Bogdanov-Takens points, branch points.
        notes: what a reader must know, in words.
    """

    system: PlanarSystem
    options: PlanarAnalysisOptions
    equilibria: tuple[PlanarEquilibrium, ...]
    found: PlanarBranches
    notes: tuple[str, ...]


def analyze_planar(system: PlanarSystem, options: PlanarAnalysisOptions) -> PlanarAnalysis:
    """Find all equilibria over the grid, the branches through them, and what lies on these.

    Raises:
        RefusedError: equilibria are not isolated at a parameter of the grid.
    """
    every = tuple(point for parameter in options.grid for point in planar_equilibria(system, parameter))
    box = np.array([options.first_range, options.second_range])
    kept = tuple(p for p in every if ((box[:, 0] <= p.state) & (p.state <= box[:, 1])).all())
    found = planar_branches(system, options.parameter_range, box, kept)
    return PlanarAnalysis(
        system=system,
        options=options,
        equilibria=kept,
        found=found,
        notes=(
            *_equilibrium_notes(kept, left_out=len(every) - len(kept)),
            *_branch_notes(found),
            *_point_notes(system, found),
        ),
    )


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
