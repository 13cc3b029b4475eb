"""Limit cycles of a planar field over a range of its parameter: at some parameters, and as families."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike

from finback.dynamics.analysis_cycles import CycleVerdict
from finback.dynamics.hopf import Criticality
from finback.dynamics.planar.center import PlanarCenter, planar_center
from finback.dynamics.planar.closed import closed_orbits
from finback.dynamics.planar.cycle import PlanarCycle, isolated_cycles
from finback.dynamics.planar.cycle_family import PlanarCycleFamily, family_from_cycle, family_from_hopf
from finback.dynamics.planar.hopf import PlanarHopf
from finback.dynamics.planar.setting import planar_setting
from finback.dynamics.planar.system import PlanarSystem
from finback.errors import RefusedError
from finback.units import quantity_of

_MOST_FOLLOWED: Final = 12  # families that begin at no Hopf point
_SLACK: Final = 1e-3  # of the size of a cycle: how far a chord between neighbors of a family may miss one between them

_NEAR: Final = 1e-6  # half-widths of the box: a Hopf point and the equilibrium that it is
_ONWARD: Final = np.array([-1.5, 2.5])  # of two neighbors: one and a half of their distance beyond the second


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterCycles:
    """The limit cycles of a planar field in a box, over a range of its parameter; measured, not proved, to be all.

    Attributes:
        cycles: at the parameters searched, by rising parameter, then by period.
        centers: what was found there of orbits that are closed beside each other, and so no limit cycles.
        families: those born at Hopf points, then those through cycles that belong to none of these.
        verdict: whether there are any; for a planar field absence is not proved, so never ``PROVED_ABSENT``.
        statement: the same in words, with what was searched.
        searched: the parameters at which cycles were looked for.
        obstacles: what could not be searched or followed, in words.
    """

    cycles: tuple[PlanarCycle, ...]
    centers: tuple[PlanarCenter, ...]
    families: tuple[PlanarCycleFamily, ...]
    verdict: CycleVerdict
    statement: str
    searched: tuple[float, ...]
    obstacles: tuple[str, ...]


def parameter_cycles(
    system: PlanarSystem, parameters: Sequence[float], box: ArrayLike, hopf_points: Sequence[PlanarHopf]
) -> ParameterCycles:
    """Find limit cycles within a box over the range of some parameters.

    Besides the families of all Hopf points given, any cycle found on none of them is followed both ways: at most
    twelve families.

    Args:
        system: the system.
        parameters: where cycles are looked for, two or more, rising; families are followed between first and last.
        box: low and high of both states, in SI, shape (2, 2).
        hopf_points: all Hopf points in box and range.
    """
    ends = (parameters[0], parameters[-1])
    obstacles: list[str] = []
    found: list[PlanarCycle] = []
    centers: list[PlanarCenter] = []
    for parameter in parameters:
        try:
            setting = planar_setting(system, parameter, box)
            closed = closed_orbits(setting)
            centers += [planar_center(setting, band) for band in closed.bands]
            found += isolated_cycles(setting, closed)
        except RefusedError as refusal:
            obstacles.append(refusal.message)
    families: list[PlanarCycleFamily] = []
    for hopf in hopf_points:
        try:
            if around := _center_of(system, hopf, box):
                centers += around
                continue
            families.append(family_from_hopf(system, hopf, ends, box))
        except RefusedError as refusal:
            obstacles.append(refusal.message)
    followed = 0
    for cycle in found:
        if followed < _MOST_FOLLOWED and not any(_passes(family, cycle) for family in families):
            followed += 1
            try:
                families.append(family_from_cycle(system, cycle, ends, box))
            except RefusedError as refusal:
                obstacles.append(refusal.message)
    some = bool(found) or any(family.parameter.size for family in families)
    none = CycleVerdict.UNKNOWN if obstacles else CycleVerdict.NONE_FOUND
    return ParameterCycles(
        cycles=tuple(found),
        centers=tuple(centers),
        families=tuple(families),
        verdict=CycleVerdict.FOUND if some else none,
        statement=(
            f"{'Limit cycles were' if some else 'No limit cycle was'} found within the ranges of the states: measured, "
            f"not proved, at {len(parameters)} values of {quantity_of(system.variables[2])} evenly over its range; "
            "from these and from Hopf points they were followed." + _continuum(centers)
        ),
        searched=tuple(parameters),
        obstacles=tuple(dict.fromkeys(obstacles)),
    )


def _center_of(system: PlanarSystem, hopf: PlanarHopf, box: ArrayLike) -> list[PlanarCenter]:
    """Return the center that a Hopf point without criticality is, if it is one."""
    if hopf.criticality is not Criticality.DEGENERATE:
        return []
    setting = planar_setting(system, hopf.parameter, box)
    near = [
        band
        for band in closed_orbits(setting).bands
        if np.abs(band.ray.point - hopf.state / setting.units).max() < _NEAR
    ]
    return [planar_center(setting, band) for band in near]


def _continuum(centers: Sequence[PlanarCenter]) -> str:
    """Say where closed orbits are no limit cycles."""
    places = len({center.parameter for center in centers})
    if not places:
        return ""
    return (
        f" At {places} of its values orbits around an equilibrium are closed within rounding, each beside others: a "
        "center, whose closed orbits are a continuum and no limit cycles."
    )


def _passes(family: PlanarCycleFamily, cycle: PlanarCycle) -> bool:
    """Tell whether a cycle lies between two neighbors of a family."""
    extents, parameters = np.hstack([family.low, family.high]), family.parameter
    if len(parameters) < 2:
        return False
    turns = np.flatnonzero(np.diff(np.sign(family.log_multiplier)))
    if 0 < turns.size == len(family.folds):  # at a fold the parameter turns between two others
        extents = np.insert(extents, turns + 1, [np.hstack([f.low, f.high]) for f in family.folds], axis=0)
        parameters = np.insert(parameters, turns + 1, [fold.parameter for fold in family.folds])
    # Towards an end other than a Hopf point the family goes on for less than a step.
    extents = np.vstack([_ONWARD @ extents[1::-1], extents, _ONWARD @ extents[-2:]])
    parameters = np.hstack([_ONWARD @ parameters[1::-1], parameters, _ONWARD @ parameters[-2:]])
    here = np.hstack([cycle.low, cycle.high])
    before, after = parameters[:-1], parameters[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (cycle.parameter - before) / (after - before)
    between = (share >= 0.0) & (share <= 1.0)
    moved = np.diff(extents, axis=0)
    missed = np.abs(extents[:-1] + np.where(between, share, 0.0)[:, np.newaxis] * moved - here)
    room = 0.5 * np.abs(moved) + _SLACK * np.tile(cycle.high - cycle.low, 2)
    return bool((between & (missed <= room).all(axis=1)).any())
