"""Where to look when nobody says: the range of the data, or what shows every fold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.analysis import AnalysisOptions
from finback.dynamics.equilibrium import equilibria
from finback.dynamics.fold import folds
from finback.dynamics.hopf import hopf_points
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.planar.analysis import PlanarAnalysisOptions
from finback.dynamics.planar.equilibrium import planar_equilibria
from finback.dynamics.planar.system import PlanarSystem
from finback.errors import InputError
from finback.units import quantity_of

Range = tuple[float, float]

STEPS: Final = 50
"""Steps of the parameter over its range, if nobody says."""

MAXIMUM_POINTS: Final = 10_000
"""Values of the parameter at which equilibria are listed. More are taken for a mistake."""

_ROOM: Final = 0.1  # of what is to be seen, beyond either end; with 50 steps no step falls on an outer fold


def options_for(system: LienardSystem, ranges: Mapping[str, Range], steps: Mapping[str, float]) -> AnalysisOptions:
    """Return what to analyze: what is given, else where the data lie, else what shows every fold and Hopf point.

    Args:
        system: the system.
        ranges: ``elevator_rad`` and ``alpha_rad`` -> (low, high), as far as given.
        steps: ``elevator_rad`` -> step of the list of equilibria, if given; without, a fiftieth of the range.

    Raises:
        InputError: nothing says which elevators to look at.
    """
    elevator = ranges.get("elevator_rad") or _elevator_range(system)
    alpha = ranges.get("alpha_rad") or _alpha_range(system, elevator)
    step = _checked_step(elevator, steps.get("elevator_rad", (elevator[1] - elevator[0]) / STEPS))
    return AnalysisOptions(elevator_range_rad=elevator, elevator_step_rad=step, alpha_range_rad=alpha)


def planar_options_for(
    system: PlanarSystem, ranges: Mapping[str, Range], steps: Mapping[str, float]
) -> PlanarAnalysisOptions:
    """Return what to analyze of a planar field: what is given, else where the data lie, else where its equilibria lie.

    Args:
        system: the system.
        ranges: name of a state or of the parameter -> (low, high), as far as given.
        steps: name of the parameter -> step of the list of equilibria, if given; without, a fiftieth of the range.

    Raises:
        InputError: nothing says where to look.
    """
    first, second, name = system.variables
    stated = {
        variable: (float(low), float(high))
        for variable, (low, high) in zip(system.variables, system.domain, strict=True)
        if np.isfinite([low, high]).all() and low < high
    }
    known = {**stated, **ranges}
    if name not in known:
        raise InputError(
            f"nothing says at which {quantity_of(name)} to look: the model states no domain",
            hint=f"give a range: --parameter-range LOW HIGH, or {name} = [low, high] below [range] in the file",
        )
    low, high = known[name]
    step = _checked_step((low, high), steps.get(name, (high - low) / STEPS))
    for index, state in enumerate((first, second)):
        if state not in known:
            known[state] = _state_range(system, state, index, np.linspace(low, high, STEPS + 1).tolist())
    return PlanarAnalysisOptions(
        parameter_range=(low, high), parameter_step=step, first_range=known[first], second_range=known[second]
    )


def _state_range(system: PlanarSystem, name: str, index: int, grid: list[float]) -> Range:
    """Return what shows every equilibrium over the grid, in one state."""
    marks = [float(point.state[index]) for value in grid for point in planar_equilibria(system, value)]
    if len(set(marks)) < 2:
        raise InputError(
            f"nothing says at which {quantity_of(name)} to look: the equilibria do not spread over it",
            hint=f"give a range: --state-range {name}=LOW:HIGH, or {name} = [low, high] below [range] in the file",
        )
    return _with_room(marks)


def _checked_step(limits: Range, step: float) -> float:
    """Return the step, or refuse one that makes too many points; others are refused by the options themselves."""
    if step > 0.0 and not (points := (limits[1] - limits[0]) / step) <= MAXIMUM_POINTS:
        raise InputError(
            f"the range of the parameter has {points:.0f} steps, and {MAXIMUM_POINTS} are the most",
            hint="take a longer step or a shorter range",
        )
    return step


def _elevator_range(system: LienardSystem) -> Range:
    if _says_something(system.domain[1]):
        return float(system.domain[1, 0]), float(system.domain[1, 1])
    marks = [fold.elevator_rad for fold in folds(system)] + [point.elevator_rad for point in hopf_points(system)]
    if len(set(marks)) < 2:
        raise InputError(
            "nothing says which elevators to look at: the model states no domain and has no two folds or Hopf points",
            hint="give a range: --elevator-range LOW HIGH, or elevator_deg = [low, high] below [range] in the file",
        )
    return _with_room(marks)


def _alpha_range(system: LienardSystem, elevator: Range) -> Range:
    if _says_something(system.domain[0]):
        return float(system.domain[0, 0]), float(system.domain[0, 1])
    turns = [fold.alpha_rad for fold in folds(system) if elevator[0] <= fold.elevator_rad <= elevator[1]]
    ends = [point.alpha_rad for end in elevator for point in equilibria(system, end)]
    # At a fold the other equilibrium, on the far side, may lie farther out than at either end.
    inner = [f.elevator_rad for f in folds(system) if elevator[0] <= f.elevator_rad <= elevator[1]]
    ends += [point.alpha_rad for end in inner for point in equilibria(system, end)]
    marks = turns + ends
    if len(set(marks)) < 2:
        raise InputError(
            "nothing says which angles to look at: the model states no domain and has no two equilibria",
            hint="give a range: --alpha-range LOW HIGH, or alpha_deg = [low, high] below [range] in the file",
        )
    return _with_room(marks)


def _says_something(limits: FloatArray) -> bool:
    return bool(np.isfinite(limits).all() and limits[0] < limits[1])


def _with_room(marks: list[float]) -> Range:
    low, high = min(marks), max(marks)
    room = _ROOM * (high - low)
    return low - room, high + room
