"""The simulator's folds beside the predicted ones: which is which, and the metrics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

from finback.arrays import FloatArray
from finback.dynamics.any_form import AnyAnalysis
from finback.flight.equilibrium import SimulatedFold
from finback.units import from_si
from finback.validation.bifurcation import HoldFold, RampFold, describe
from finback.validation.matching import match
from finback.validation.metric import Metric, Tolerance
from finback.validation.options import Tolerances
from finback.validation.prediction import PredictedFold, Prediction, prediction

_COUNT: Final = Tolerance(value=0.5, source="definition: a number of folds is right or wrong")
_AT_LIMIT: Final = "the elevator limit is too near for ramps to pass the fold by the margin"
_MOST_PLACES: Final = 6
_CURVE_RAD: Final = 1e-9  # how well ``equilibrium_curve`` finds a fold; of elevator, it is far better


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlownFold:
    """A fold as it was flown.

    Attributes:
        hold: by hold bisection.
        ramp: by ramps.
    """

    hold: HoldFold
    ramp: RampFold


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FoldComparison:
    """One fold of the simulator, and all that is known of it.

    Attributes:
        simulated: on the simulator's own equilibrium curve.
        predicted: index among the folds of the analysis of the one that was paired with it; empty if none was.
        flown: as it was flown; empty if it cannot be.
    """

    simulated: SimulatedFold
    predicted: tuple[int, ...]
    flown: tuple[FlownFold, ...]


def compare_folds(
    simulated: Sequence[SimulatedFold], flown: Sequence[FlownFold], analysis: AnyAnalysis
) -> tuple[FoldComparison, ...]:
    """Pair each fold of the simulator with the predicted one next to it in alpha, and with its flights."""
    matching = match([fold.alpha_rad for fold in simulated], [fold.alpha_rad for fold in prediction(analysis).folds])
    partner = dict(matching.pairs)
    return tuple(
        FoldComparison(
            simulated=fold,
            predicted=(partner[row],) if row in partner else (),
            flown=tuple(witness for witness in flown if witness.hold.table_alpha_rad == fold.alpha_rad),
        )
        for row, fold in enumerate(simulated)
    )


def fold_count_metric(folds: Sequence[FoldComparison], analysis: AnyAnalysis) -> Metric:
    """Return the number of folds in the fitted domain; one that may lie on either side of its edge is unsure."""
    model = prediction(analysis)
    box = model.fold_box
    low, high = box[0].tolist()
    unsure = sum(
        least < edge < most
        for fold in model.folds
        for (least, most), edges in ((fold.alpha_interval_rad, box[0]), (fold.elevator_interval_rad, box[2]))
        for edge in edges
    )
    pairs = [(fold.simulated, model.folds[index]) for fold in folds for index in fold.predicted]
    unsure += sum(_within(ours, box, 2) != _within(theirs, box, 2) for ours, theirs in pairs)
    return Metric(
        name="number of folds",
        unit="1",
        simulated=float(sum(_inside(fold.simulated, model) for fold in folds)),
        predicted=float(sum(_inside(fold, model) for fold in model.folds)),
        uncertainty=float(unsure),
        tolerance=_COUNT.value,
        source=_COUNT.source,
        note=f"in the fitted domain, alpha {_degrees(low, high)}",
    )


def _inside(fold: SimulatedFold | PredictedFold, model: Prediction) -> bool:
    """Tell whether a fold lies where it would be predicted from data."""
    return all(_within(fold, model.fold_box, column) for column in range(3))


def _within(fold: SimulatedFold | PredictedFold, box: FloatArray, column: int) -> bool:
    value = (fold.alpha_rad, fold.q_rad_s, fold.elevator_rad)[column]
    return bool(box[column, 0] <= value <= box[column, 1])


def fold_metrics(folds: Sequence[FoldComparison], analysis: AnyAnalysis, tolerances: Tolerances) -> tuple[Metric, ...]:
    """Return the elevator of each fold of the simulator beside the predicted one.

    Each is compared on the simulator's own equilibrium curve, also where it cannot be flown, and as flown: by hold
    bisection and by ramps. U95 is the root sum of squares of the predicted interval's half-width and the simulator's
    uncertainty. A fold that is not predicted disagrees; one outside the fitted domain, simulated or predicted, is not
    counted, nor are
    ramps that the elevator limit ends too early: that is no fault of the model, and the other roads stand.
    """
    model = prediction(analysis)
    metrics: list[Metric] = []
    for fold, name in zip(folds, _names(folds), strict=True):
        value, half, note, counted = math.nan, 0.0, "no such fold is predicted", True
        for index in fold.predicted:
            predicted = model.folds[index]
            value, note = predicted.elevator_rad, ""
            half = 0.5 * float(predicted.elevator_interval_rad[1] - predicted.elevator_interval_rad[0])
            counted = _inside(predicted, model)
        if not (counted and _inside(fold.simulated, model)):
            counted, note = False, _why_left_out(fold, model)
        metrics += [
            Metric(
                name=f"{name}: elevator, {what}",
                unit="rad",
                simulated=simulated,
                predicted=value,
                uncertainty=math.hypot(half, uncertainty),
                tolerance=tolerance.value,
                source=tolerance.source,
                counted=counted and not barred,
                note=note or barred,
            )
            for what, simulated, uncertainty, tolerance, barred in _elevators(fold, tolerances)
        ]
    return tuple(metrics)


def _names(folds: Sequence[FoldComparison]) -> list[str]:
    """Return what each fold is called: by its alpha, with as many decimals as it takes to tell them apart."""
    alphas = [from_si(fold.simulated.alpha_rad, "deg") for fold in folds]
    for places in range(1, _MOST_PLACES):
        names = [f"fold at alpha {alpha:z.{places}f} deg" for alpha in alphas]
        if len(set(names)) == len(names):
            return names
    return [f"fold {number} at alpha {alpha:z.1f} deg" for number, alpha in enumerate(alphas, start=1)]


def _elevators(fold: FoldComparison, tolerances: Tolerances) -> list[tuple[str, float, float, Tolerance, str]]:
    """Return the elevators of a fold: by which road, value, 95 % uncertainty, tolerance, why it cannot count."""
    rows = [("equilibrium curve", fold.simulated.elevator_rad, _CURVE_RAD, tolerances.fold_elevator, "")]
    for witness in fold.flown:
        hold, ramp = witness.hold, witness.ramp
        # Nothing is known where no ramp jumped: the curve's own value stands there with an infinite uncertainty.
        barred = _AT_LIMIT if ramp.at_limit and math.isinf(ramp.uncertainty_rad) else ""
        at_rest = ramp.elevator_rad if math.isfinite(ramp.elevator_rad) else ramp.table_elevator_rad
        rows += [
            ("hold bisection", hold.elevator_rad, hold.uncertainty_rad, tolerances.fold_elevator, ""),
            ("ramps", at_rest, ramp.uncertainty_rad, tolerances.ramp_fold_elevator, barred),
        ]
    return rows


def fold_notes(folds: Sequence[FoldComparison], analysis: AnyAnalysis) -> tuple[str, ...]:
    """Return what a reader must know of the folds, sentences."""
    model = prediction(analysis)
    notes = [
        f"the simulator's fold at {describe(fold.simulated)} is left out of the verdict: {_why_left_out(fold, model)}"
        for fold in folds
        if not _inside(fold.simulated, model)
    ]
    notes += [
        f"{name}: {witness.ramp.rates_rad_s.size} ramps passed it by the margin, too few to extrapolate"
        for fold, name in zip(folds, _names(folds), strict=True)
        for witness in fold.flown
        if math.isinf(witness.ramp.uncertainty_rad)
    ]
    return tuple(notes)


def _why_left_out(fold: FoldComparison, model: Prediction) -> str:
    every: list[SimulatedFold | PredictedFold] = [fold.simulated, *(model.folds[index] for index in fold.predicted)]
    if not all(_within(one, model.domain, 0) for one in every):
        low, high = model.domain[0].tolist()
        return f"extrapolated: outside the fitted domain, alpha {_degrees(low, high)}"
    if not all(_within(one, model.domain, column) for one in every for column in (1, 2)):
        return "extrapolated: outside the fitted domain of pitch rate or elevator"
    if not all(model.alpha_range_rad[0] <= one.alpha_rad <= model.alpha_range_rad[1] for one in every):
        return f"not analyzed: outside the analyzed range, alpha {_degrees(*model.alpha_range_rad)}"
    return f"not analyzed: outside the analyzed range, elevator {_degrees(*model.elevator_range_rad)}"


def _degrees(low: float, high: float) -> str:
    return f"{from_si(low, 'deg'):z.2f} to {from_si(high, 'deg'):z.2f} deg"
