"""The metrics of hold-out flights and equilibria: simulator beside prediction, with uncertainty and tolerance."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

from finback.dynamics.any_form import AnyAnalysis
from finback.flight.equilibrium import SimulatedEquilibrium
from finback.units import from_si
from finback.validation.linearization import Pair
from finback.validation.matching import match
from finback.validation.metric import Metric, Tolerance, worst
from finback.validation.options import Tolerances
from finback.validation.prediction import PredictedEquilibrium, Prediction, prediction
from finback.validation.trajectory import MINIMUM_COMPARED_S, Holdout

_COMPARED: Final = Tolerance(value=0.5, source="definition: a verdict needs a flight that was compared")


def holdout_metrics(holdouts: Iterable[Holdout], tolerances: Tolerances) -> tuple[Metric, ...]:
    """Return RMSE and Theil's coefficient of alpha and pitch rate, four metrics a flight; a perfect prediction is 0."""
    metrics: list[Metric] = []
    for flight in holdouts:
        counted, note = flight.in_domain, ""
        if not counted:
            note = f"extrapolated: the flight leaves the fitted domain within {MINIMUM_COMPARED_S:g} s"
        elif flight.compared < len(flight.record):
            note = f"the first {flight.compared_s:.2f} s; there the flight leaves the fitted domain"
        rows = (
            ("alpha RMSE", "rad", flight.alpha_rmse_rad, flight.alpha_rmse_u95_rad, tolerances.alpha_rmse),
            ("pitch rate RMSE", "rad_s", flight.q_rmse_rad_s, flight.q_rmse_u95_rad_s, tolerances.q_rmse),
            ("alpha Theil", "1", flight.alpha_theil.coefficient, flight.alpha_theil_u95, tolerances.theil),
            ("pitch rate Theil", "1", flight.q_theil.coefficient, flight.q_theil_u95, tolerances.theil),
        )
        metrics += [
            Metric(
                name=f"{flight.record.name}: {name}",
                unit=unit,
                simulated=0.0,
                predicted=value,
                uncertainty=u95,
                tolerance=tolerance.value,
                source=tolerance.source,
                counted=counted,
                note=note,
            )
            for name, unit, value, u95, tolerance in rows
        ]
    return (*metrics, *_nothing_compared(metrics))


def _nothing_compared(metrics: Sequence[Metric]) -> tuple[Metric, ...]:
    """Return a metric that is inconclusive if hold-out flights were flown and none could be compared."""
    if not metrics or any(metric.counted for metric in metrics):
        return ()
    return (
        Metric(
            name="hold-out flights",
            unit="1",
            simulated=0.0,
            predicted=0.0,
            uncertainty=math.inf,
            tolerance=_COMPARED.value,
            source=_COMPARED.source,
            note="none of them lies in the fitted domain",
        ),
    )


def equilibrium_metric(
    simulated: Sequence[SimulatedEquilibrium],
    analysis: AnyAnalysis,
    elevators_rad: Sequence[float],
    tolerance: Tolerance,
) -> Metric:
    """Return the worst alpha of an equilibrium at the listed elevators.

    Points outside the fitted domain are left out. Points nearer to its edge than the tolerance are compared if they
    find a partner, but need none. Any other point without a partner, simulated or predicted, disagrees.
    """
    model = prediction(analysis)
    candidates: list[Metric] = []
    left_out = 0
    for elevator in elevators_rad:
        ours = [point for point in simulated if point.elevator_rad == elevator]
        left_out += sum(_depth(point, model) < -tolerance.value for point in ours)
        candidates += _equilibrium_pairs(ours, model.equilibria(elevator), model, tolerance)
    if not candidates:
        note = "no simulated equilibrium lies in the fitted domain"
        return _equilibrium(math.nan, math.nan, 0.0, tolerance, note=note, counted=False)
    found = worst(candidates)
    said = [f"the worst of {len(candidates)}, {found.note}"]
    if left_out:
        said.append(f"{left_out} outside the fitted domain left out")
    return _equilibrium(found.simulated, found.predicted, found.uncertainty, tolerance, note="; ".join(said))


def paired_equilibria(
    simulated: Sequence[SimulatedEquilibrium], analysis: AnyAnalysis, elevators_rad: Sequence[float]
) -> tuple[Pair, ...]:
    """Return the equilibria in the fitted domain at the listed elevators, each with its predicted partner."""
    model = prediction(analysis)
    pairs: list[Pair] = []
    for elevator in elevators_rad:
        ours = [point for point in simulated if point.elevator_rad == elevator and _depth(point, model) >= 0.0]
        theirs = [point for point in model.equilibria(elevator) if point.in_domain]
        matching = match([point.alpha_rad for point in ours], [point.alpha_rad for point in theirs])
        pairs += [(ours[row], theirs[column]) for row, column in matching.pairs]
    return tuple(pairs)


def _equilibrium_pairs(
    simulated: Sequence[SimulatedEquilibrium],
    predicted: Sequence[PredictedEquilibrium],
    model: Prediction,
    tolerance: Tolerance,
) -> list[Metric]:
    """Return one metric for each pair at one elevator, and for each point that lacks its partner."""
    ours = [point for point in simulated if _depth(point, model) >= -tolerance.value]
    theirs = [point for point in predicted if _depth(point, model) >= -tolerance.value]
    matching = match([point.alpha_rad for point in ours], [point.alpha_rad for point in theirs])
    metrics: list[Metric] = []
    for row, column in matching.pairs:
        point, other = ours[row], theirs[column]
        half = 0.5 * float(other.alpha_interval_rad[1] - other.alpha_interval_rad[0])
        note = f"at elevator {from_si(point.elevator_rad, 'deg'):z.2f} deg"
        metrics.append(_equilibrium(point.alpha_rad, other.alpha_rad, half, tolerance, note=note))
    for row in matching.simulated_alone:
        if _depth(point := ours[row], model) > tolerance.value:
            note = f"not predicted at elevator {from_si(point.elevator_rad, 'deg'):z.2f} deg"
            metrics.append(_equilibrium(point.alpha_rad, math.nan, 0.0, tolerance, note=note))
    for column in matching.predicted_alone:
        if _depth(other := theirs[column], model) > tolerance.value:
            note = f"not in the simulator at elevator {from_si(other.elevator_rad, 'deg'):z.2f} deg"
            metrics.append(_equilibrium(math.nan, other.alpha_rad, 0.0, tolerance, note=note))
    return metrics


def _equilibrium(
    simulated: float, predicted: float, uncertainty: float, tolerance: Tolerance, *, note: str, counted: bool = True
) -> Metric:
    return Metric(
        name="equilibria: alpha",
        unit="rad",
        simulated=simulated,
        predicted=predicted,
        uncertainty=uncertainty,
        tolerance=tolerance.value,
        source=tolerance.source,
        counted=counted,
        note=note,
    )


def _depth(point: SimulatedEquilibrium | PredictedEquilibrium, model: Prediction) -> float:
    """Return how far an equilibrium lies inside the fitted domain, < 0 outside, in rad of alpha."""
    return model.depth(point.alpha_rad, point.q_rad_s, point.elevator_rad)
