"""The full simulator against the identified model and its analysis: metrics and a verdict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from finback.flight.equilibrium import EquilibriumCurve, SimulatedEquilibrium
from finback.validation.bifurcation import HoldFold, RampFold
from finback.validation.metric import Judgement, Metric
from finback.validation.options import ValidationOptions
from finback.validation.trajectory import Holdout


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """What the simulator said about a model.

    Attributes:
        verdict: over all counted metrics: any disagreement wins, then anything inconclusive.
        metrics: every comparison, those that are not counted included.
        holdouts: the hold-out flights beside their predictions.
        hold_folds: the simulator's folds by hold bisection, ordered by alpha.
        ramp_folds: the same folds by ramps.
        equilibria: the simulator's equilibria at the listed elevators.
        curve: the simulator's own equilibrium curve, elevator over alpha.
        options: what was asked for.
        notes: what a reader of the verdict must know, sentences.
    """

    verdict: Judgement
    metrics: tuple[Metric, ...]
    holdouts: tuple[Holdout, ...]
    hold_folds: tuple[HoldFold, ...]
    ramp_folds: tuple[RampFold, ...]
    equilibria: tuple[SimulatedEquilibrium, ...]
    curve: EquilibriumCurve
    options: ValidationOptions
    notes: tuple[str, ...]
