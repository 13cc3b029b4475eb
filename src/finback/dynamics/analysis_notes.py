"""What a reader of an analysis must know, in words: what is extrapolated, what lies outside, what was not searched."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.analysis_cycles import ElevatorCycles, in_degrees
from finback.dynamics.connection.connection import Heteroclinic, Homoclinic
from finback.dynamics.connection.search import Connections
from finback.dynamics.cycle.branch import FamilyEnd
from finback.dynamics.equilibrium import Equilibrium
from finback.dynamics.fold import Fold, folds
from finback.dynamics.hopf import BogdanovTakens, Criticality, Hopf
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.stability.regime import Regime
from finback.dynamics.stability.region import StabilityRegion

Range = tuple[float, float]


def elevator_notes(system: LienardSystem, elevator_range_rad: Range) -> Iterator[str]:
    """Say that the elevator has no effect, or goes beyond the data."""
    if system.elevator_gain == 0.0:
        yield "The elevator has no effect on the equilibria: there is no branch and no fold."
    low, high = (float(end) for end in system.domain[1])
    if _is_empty(system.domain):
        yield "An input is held where no data supported the model: everything is extrapolated."
        return
    if elevator_range_rad[0] < low or elevator_range_rad[1] > high:
        yield (
            f"The data hold elevators from {in_degrees(low)} to {in_degrees(high)}; beyond them the analysis relies on "
            "the elevator entering linearly."
        )


def _is_empty(domain: FloatArray) -> bool:
    return bool((domain[:, 0] > domain[:, 1]).any())


def fold_notes(system: LienardSystem, found: tuple[Fold, ...], *, left_out: int) -> Iterator[str]:
    """Say that there is no fold, how many are not listed, and which are extrapolated."""
    if not found and system.elevator_gain != 0.0:
        yield "There is no fold in the alpha range."
    if left_out:
        yield f"Folds outside the alpha range, not listed: {left_out}."
    for fold in found:
        if not fold.in_domain and not _is_empty(system.domain):
            low, high = (float(end) for end in system.domain[0])
            yield (
                f"The fold at alpha {in_degrees(fold.alpha_rad)}, elevator {in_degrees(fold.elevator_rad)} is "
                f"extrapolated: the data hold alpha from {in_degrees(low)} to {in_degrees(high)}."
            )


def trace_notes(system: LienardSystem, hopf: tuple[Hopf, ...], double: tuple[BogdanovTakens, ...]) -> Iterator[str]:
    """Say which zeros of the damping need a second parameter to be understood."""
    if not system.damping.ascending.any():
        yield "The damping is zero everywhere: the system is conservative."
    for point in hopf:
        if point.criticality is Criticality.DEGENERATE:
            yield (
                f"At the Hopf point at {_place(point)} the first Lyapunov coefficient vanishes within rounding, as at "
                "a Bautin point: which cycles are born there is not decided by it."
            )
    for found in double:
        yield (
            f"At {_place(found)} trace and determinant vanish together within rounding, as at a Bogdanov-Takens point: "
            "a small change of the model turns it into a Hopf point or a neutral saddle beside a fold."
        )


def _place(point: Hopf | BogdanovTakens) -> str:
    return f"alpha {in_degrees(point.alpha_rad)}, elevator {in_degrees(point.elevator_rad)}"


def equilibrium_notes(system: LienardSystem, kept: tuple[Equilibrium, ...], *, left_out: int) -> Iterator[str]:
    """Say how many equilibria are not listed, extrapolated, or too near to a fold for their interval."""
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


def connection_notes(
    system: LienardSystem, searched: Connections, kept: Connections, elevator_range_rad: Range
) -> Iterator[str]:
    """Say where connections were not searched to the end, and which lie outside of what is analyzed or known."""
    for stretch in searched.stretches:
        low, high = (in_degrees(float(end)) for end in stretch.elevator_rad)
        between = f"between elevator {low} and {high}"
        if stretch.obstacle:
            yield f"Saddle connections {between} could not be searched to the end: {stretch.obstacle}."
        elif stretch.saddles > 1 and stretch.others > 1:
            yield f"Saddle connections {between} were searched only as far as they turn at most six times."
    left_out = sum(len(getattr(searched, name)) - len(getattr(kept, name)) for name in ("heteroclinics", "homoclinics"))
    if left_out:
        yield f"Saddle connections with saddles outside the alpha range, not listed: {left_out}."
    every: list[Heteroclinic | Homoclinic] = [*kept.heteroclinics, *kept.homoclinics]
    for found in sorted(every, key=lambda one: one.elevator_rad):
        named = f"The saddle connection at elevator {in_degrees(found.elevator_rad)}"
        if not elevator_range_rad[0] <= found.elevator_rad <= elevator_range_rad[1]:
            yield f"{named} lies outside the elevator range: stretches between folds are searched whole."
        if not found.in_domain:
            yield f"{named} is extrapolated: it reaches angles at which no data supported the model."
        if not system.domain[1, 0] <= found.elevator_rad <= system.domain[1, 1] and not _is_empty(system.domain):
            yield f"{named} is beyond the elevators of the data, and relies on the elevator entering linearly."
        if not found.resolved:
            yield f"{named} cannot be told from its neighbor in double precision."


def cycle_notes(found: ElevatorCycles, *, left_out: int) -> Iterator[str]:
    """Say what is known of the absence of cycles, what could not be followed, and what is extrapolated."""
    yield found.absence.statement
    if left_out:
        yield f"Limit cycles around equilibria outside the alpha range, not listed: {left_out}."
    for obstacle in found.obstacles:
        yield f"Limit cycles could not be searched to the end: {obstacle}."
    lost = sum(FamilyEnd.LOST in (family.begin, family.end) for family in found.families)
    if lost:
        yield f"Families of limit cycles that could not be followed to an end: {lost}."
    outside = sum(not cycle.in_domain for cycle in found.cycles)
    if outside:
        yield f"Limit cycles listed that reach angles at which no data supported the model, extrapolated: {outside}."


def region_notes(
    system: LienardSystem,
    regimes: tuple[Regime, ...],
    found: tuple[StabilityRegion, ...],
    refusals: tuple[str, ...],
    *,
    left_out: int,
) -> Iterator[str]:
    """Say that regions are extrapolated, not listed, or not found."""
    if found and np.isfinite(system.domain[0]).any():
        yield (
            "The stability regions reach beyond the alpha range of the data: their outer parts are extrapolated, and "
            "their area within the stated angles is the model's, not the aircraft's."
        )
    if not any(regime.bounds or regime.obstacle for regime in regimes):
        yield "There is no stability region at any elevator of the range: no equilibrium is stable."
    if left_out:
        yield f"Stability regions of equilibria outside the alpha range, not listed: {left_out}."
    for regime in regimes:
        if regime.obstacle:
            low, high = (in_degrees(float(end)) for end in regime.elevator_rad)
            yield f"Stability regions between elevator {low} and {high} were not found: {regime.obstacle}."
    yield from refusals
