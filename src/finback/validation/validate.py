"""The full simulator against the identified model and its analysis: metrics and a verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, final

from finback.dynamics.any_form import AnyAnalysis
from finback.flight.equilibrium import (
    EquilibriumCurve,
    SimulatedEquilibrium,
    SimulatedFold,
    equilibria,
    equilibrium_curve,
)
from finback.flight.plan import FlightOptions
from finback.flight.sweep import plan_flights
from finback.flight.vehicle import Vehicle
from finback.identification.identify import Identification
from finback.records import Sweep
from finback.units import to_si
from finback.validation.bifurcation import Approach, approaches, describe, hold_fold, ramp_fold
from finback.validation.comparison import equilibrium_metric, holdout_metrics, paired_equilibria
from finback.validation.fold import (
    FlownFold,
    FoldComparison,
    compare_folds,
    fold_count_metric,
    fold_metrics,
    fold_notes,
)
from finback.validation.linearization import linear_metrics
from finback.validation.metric import Judgement, Metric, verdict
from finback.validation.options import ValidationOptions
from finback.validation.trajectory import Holdout, predict, refuse_seen

_NOISE_SLACK: Final = 6.0  # standard deviations that noise may have moved a recorded initial state; 2e-9 lie beyond
_LARGEST_SLACK_RAD: Final = to_si(2.0, "deg")  # two flights that start farther apart are two, whatever the noise
_LARGEST_SLACK_RAD_S: Final = to_si(2.0, "deg_s")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """What the simulator said about a model.

    Attributes:
        verdict: over all counted metrics: any disagreement wins, then anything inconclusive.
        metrics: every comparison, those that are not counted included.
        holdouts: the hold-out flights beside their predictions.
        folds: the simulator's folds, ordered by alpha, each with the predicted one it was paired with and as flown.
        equilibria: the simulator's equilibria at the listed elevators.
        curve: the simulator's own equilibrium curve, elevator over alpha.
        options: what was asked for.
        notes: what a reader of the verdict must know, sentences.
    """

    verdict: Judgement
    metrics: tuple[Metric, ...]
    holdouts: tuple[Holdout, ...]
    folds: tuple[FoldComparison, ...]
    equilibria: tuple[SimulatedEquilibrium, ...]
    curve: EquilibriumCurve
    options: ValidationOptions
    notes: tuple[str, ...]


def validate(  # noqa: PLR0913, PLR0917 - the one place that sees a record, a model, an analysis and an aircraft
    sweep: Sweep,
    identification: Identification,
    analysis: AnyAnalysis,
    rig: Vehicle,
    options: ValidationOptions,
    flight: FlightOptions,
    progress: Callable[[str], None],
) -> Validation:
    """Fly the simulator against a model and its analysis, and judge.

    Nothing of the model decides what is flown. Nothing flown here is in the fit.

    Args:
        sweep: what the model was identified from; only looked at to refuse hold-out flights that are in it.
        identification: the model.
        analysis: what was predicted from it.
        rig: the simulator.
        options: what to fly and what is tolerated.
        flight: limits and steps of the flights.
        progress: is told in short sentences what happens.

    Raises:
        InputError: a hold-out maneuver is among the flights of the sweep, or cannot be flown within the limits.
        RefusedError: no hold-out maneuver starts from a trim that exists.
    """
    holdouts, not_flown = _fly_holdouts(sweep, identification, rig, options, flight, progress)
    progress("equilibria of the simulator")
    curve, simulated_folds = _simulated_curve(rig, flight)
    simulated = tuple(
        point
        for elevator in options.equilibrium_elevators_rad
        for point in equilibria(rig.derivatives, elevator_rad=elevator, alpha_limits_rad=flight.alpha_limits_rad)
    )
    reached, notes = approaches(rig.derivatives, curve, simulated_folds, options.fold, flight)
    folds = compare_folds(simulated_folds, _fly_folds(rig, reached, options, flight, progress), analysis)
    metrics = (
        *holdout_metrics(holdouts, options.tolerances),
        fold_count_metric(folds, analysis),
        *fold_metrics(folds, analysis, options.tolerances),
        equilibrium_metric(
            simulated, analysis, options.equilibrium_elevators_rad, options.tolerances.equilibrium_alpha
        ),
        *linear_metrics(
            paired_equilibria(simulated, analysis, options.equilibrium_elevators_rad),
            rig.derivatives,
            options.tolerances.q_rmse,
        ),
    )
    return Validation(
        verdict=verdict(metrics),
        metrics=metrics,
        holdouts=holdouts,
        folds=folds,
        equilibria=simulated,
        curve=curve,
        options=options,
        notes=(*not_flown, *notes, *fold_notes(folds, analysis), *_nothing_counted(metrics)),
    )


def _fly_holdouts(
    sweep: Sweep,
    identification: Identification,
    rig: Vehicle,
    options: ValidationOptions,
    flight: FlightOptions,
    progress: Callable[[str], None],
) -> tuple[tuple[Holdout, ...], tuple[str, ...]]:
    """Fly every hold-out maneuver that can be flown and predict it; say which cannot."""
    planned = plan_flights(options.holdout, rig.derivatives, flight)
    flights = [replace(plan, name=f"holdout-{plan.name}") for plan in planned.plans]
    refuse_seen(
        flights,
        sweep,
        alpha_slack_rad=min(_NOISE_SLACK * identification.alpha_noise_rad, _LARGEST_SLACK_RAD),
        q_slack_rad_s=min(_NOISE_SLACK * identification.q_noise_rad_s, _LARGEST_SLACK_RAD_S),
    )
    holdouts: list[Holdout] = []
    for number, plan in enumerate(flights, start=1):
        progress(f"{plan.name} ({number} of {len(flights)})")
        holdouts.append(predict(identification.model, rig.fly(plan), seed=options.seed))
    return tuple(holdouts), tuple(f"hold-out {note}" for note in planned.notes)


def _simulated_curve(rig: Vehicle, flight: FlightOptions) -> tuple[EquilibriumCurve, tuple[SimulatedFold, ...]]:
    """Return the simulator's equilibria within the limits of alpha and elevator, and its folds.

    Folds are looked for up to three times the elevator range, so that one beyond the limits is known, if not flown.
    """
    least, most = flight.elevator_limits_rad
    wide = (2.0 * least - most, 2.0 * most - least)
    curve, folds = equilibrium_curve(
        rig.derivatives, alpha_limits_rad=flight.alpha_limits_rad, elevator_limits_rad=wide
    )
    within = (least <= curve.elevator_rad) & (curve.elevator_rad <= most)
    columns = {name: getattr(curve, name)[within] for name in ("alpha_rad", "elevator_rad", "q_rad_s", "stable")}
    return EquilibriumCurve(**columns), folds


def _fly_folds(
    rig: Vehicle,
    reached: tuple[Approach, ...],
    options: ValidationOptions,
    flight: FlightOptions,
    progress: Callable[[str], None],
) -> tuple[FlownFold, ...]:
    """Fly every fold that can be flown, both ways."""
    flown: list[FlownFold] = []
    for approach in reached:
        progress(f"fold at {describe(approach.fold)}: hold bisection")
        hold = hold_fold(rig, approach, options.fold, flight)
        progress(f"fold at {describe(approach.fold)}: {len(options.fold.ramp_rates_rad_s)} ramps")
        flown.append(FlownFold(hold=hold, ramp=ramp_fold(rig, approach, options.fold, flight)))
    return tuple(flown)


def _nothing_counted(metrics: tuple[Metric, ...]) -> tuple[str, ...]:
    return () if any(metric.counted for metric in metrics) else ("nothing could be counted",)
