"""The analysis of a reduced model: equilibria, folds, the branch and its trace, in one value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from finback.dynamics.branch import Branch, TraceZero
from finback.dynamics.equilibrium import Equilibrium
from finback.dynamics.fold import Fold
from finback.dynamics.lienard import LienardSystem
from finback.errors import InputError


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class AnalysisOptions:
    """What is analyzed.

    Attributes:
        elevator_range_rad: lowest and highest elevator at which equilibria are listed.
        elevator_step_rad: distance of two of them; adjusted so that it divides the range.
        alpha_range_rad: lowest and highest angle of interest; what lies outside is counted in the notes only.
        branch_points: points of the branch, evenly spaced in angle.
    """

    elevator_range_rad: tuple[float, float]
    elevator_step_rad: float
    alpha_range_rad: tuple[float, float]
    branch_points: int = 1601

    def __post_init__(self) -> None:
        """Refuse empty ranges and steps."""
        for name, (low, high) in (
            ("elevator_range_rad", self.elevator_range_rad),
            ("alpha_range_rad", self.alpha_range_rad),
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
        trace_zeros: sign changes of the trace in the alpha range, by angle.
        notes: what a reader must know, in words: what is extrapolated, what lies outside the ranges.
    """

    system: LienardSystem
    options: AnalysisOptions
    branch: Branch
    equilibria: tuple[Equilibrium, ...]
    folds: tuple[Fold, ...]
    trace_zeros: tuple[TraceZero, ...]
    notes: tuple[str, ...]
