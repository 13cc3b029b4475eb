"""The metrics, from a real analysis and simulated points whose truth is known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.analysis import Analysis, AnalysisOptions, analyze_model
from finback.dynamics.equilibrium import equilibria
from finback.dynamics.model import PolynomialModel
from finback.flight.equilibrium import SimulatedEquilibrium, SimulatedFold
from finback.units import to_si
from finback.validation.bifurcation import HoldFold, RampFold
from finback.validation.comparison import equilibrium_metric
from finback.validation.fold import (
    FlownFold,
    FoldComparison,
    compare_folds,
    fold_count_metric,
    fold_metrics,
    fold_notes,
)
from finback.validation.metric import Judgement, Tolerance
from finback.validation.options import Tolerances

AGREES, DISAGREES, INCONCLUSIVE = Judgement.AGREES, Judgement.DISAGREES, Judgement.INCONCLUSIVE
TOLERANCE = Tolerance(value=to_si(0.1, "deg"), source="a requirement")
TOLERANCES = Tolerances(
    alpha_rmse=TOLERANCE,
    q_rmse=TOLERANCE,
    theil=TOLERANCE,
    fold_elevator=TOLERANCE,
    ramp_fold_elevator=TOLERANCE,
    equilibrium_alpha=TOLERANCE,
)
OPTIONS = AnalysisOptions(
    elevator_range_rad=(to_si(-40.0, "deg"), to_si(20.0, "deg")),
    elevator_step_rad=to_si(5.0, "deg"),
    alpha_range_rad=(to_si(-34.0, "deg"), to_si(46.0, "deg")),
)
ELEVATORS = tuple(to_si(elevator, "deg") for elevator in (-30.0, 0.0, 10.0))
SMALL = 1e-5
"""rad: an uncertainty far below the tolerance."""


def analyzed(model: PolynomialModel, low: float = -0.55, high: float = 0.78, spread: float = 1e-3) -> Analysis:
    """The analysis of the published model as if data between two alphas had given it."""
    covariance = np.diag((spread * model.coefficients) ** 2)
    box = np.array([[low, high], [-1.5, 1.5], [-0.7, 0.35]])
    rate, moment = replace(model.alpha_dot, domain=box), replace(model.q_dot, domain=box)
    return analyze_model(replace(model, alpha_dot=rate, q_dot=moment, covariance=covariance), OPTIONS)


@pytest.fixture(scope="module")
def analysis(paper_model: PolynomialModel) -> Analysis:
    return analyzed(paper_model, spread=1e-5)


def simulated_folds(analysis: Analysis) -> list[SimulatedFold]:
    return [
        SimulatedFold(elevator_rad=fold.elevator_rad, alpha_rad=fold.alpha_rad, q_rad_s=fold.q_rad_s)
        for fold in analysis.folds
    ]


def held(fold: SimulatedFold, error_rad: float = 0.0) -> HoldFold:
    elevator = fold.elevator_rad + error_rad
    return HoldFold(
        table_elevator_rad=fold.elevator_rad,
        table_alpha_rad=fold.alpha_rad,
        outward=1,
        elevator_rad=elevator,
        bracket_rad=(elevator - 0.5 * SMALL, elevator + 0.5 * SMALL),
        delay_rad=0.0,
        uncertainty_rad=SMALL,
        flights=5,
    )


def ramped(fold: SimulatedFold, uncertainty_rad: float = SMALL) -> RampFold:
    jumped = math.isfinite(uncertainty_rad)
    return RampFold(
        table_elevator_rad=fold.elevator_rad,
        table_alpha_rad=fold.alpha_rad,
        outward=1,
        alpha_crossing_rad=fold.alpha_rad - 0.1,
        rates_rad_s=np.array([1e-4, 2e-4, 3e-4, 4e-4]) if jumped else np.array([]),
        crossing_elevator_rad=np.full(4, fold.elevator_rad) if jumped else np.array([]),
        elevator_rad=fold.elevator_rad if jumped else math.nan,
        uncertainty_rad=uncertainty_rad,
        coefficients=np.array([fold.elevator_rad, 0.0, 0.0]) if jumped else np.full(3, math.nan),
        residual_rad=0.0,
        at_limit=False,
    )


def compared(
    folds: list[SimulatedFold], analysis: Analysis, *, error_rad: float = 0.0, ramp_u95_rad: float = SMALL
) -> tuple[FoldComparison, ...]:
    flown = [FlownFold(hold=held(fold, error_rad), ramp=ramped(fold, ramp_u95_rad)) for fold in folds]
    return compare_folds(folds, flown, analysis)


def test_folds_where_they_were_predicted_agree(analysis: Analysis) -> None:
    folds = simulated_folds(analysis)
    metrics = fold_metrics(compared(folds, analysis), analysis, TOLERANCES)
    assert len(metrics) == 6
    assert len({metric.name for metric in metrics}) == 6
    assert {metric.judgement for metric in metrics} == {AGREES}
    assert fold_count_metric(compared(folds, analysis), analysis).judgement is AGREES


def test_the_uncertainty_of_a_fold_is_that_of_both_sides(analysis: Analysis) -> None:
    folds = simulated_folds(analysis)
    metrics = fold_metrics(compared(folds, analysis), analysis, TOLERANCES)
    low, high = analysis.folds[0].elevator_interval_rad
    assert metrics[0].uncertainty == pytest.approx(0.5 * (high - low), rel=1e-3)
    assert metrics[1].uncertainty == pytest.approx(math.hypot(0.5 * (high - low), SMALL))
    assert metrics[1].uncertainty > SMALL


def test_a_fold_elsewhere_disagrees(analysis: Analysis) -> None:
    folds = simulated_folds(analysis)
    moved = compared(folds, analysis, error_rad=2.0 * TOLERANCE.value)
    metrics = fold_metrics(moved, analysis, TOLERANCES)
    assert [metric.judgement for metric in metrics] == 2 * [AGREES, DISAGREES, AGREES]


def test_a_fold_that_is_not_predicted_disagrees(analysis: Analysis) -> None:
    folds = simulated_folds(analysis)
    blind = replace(analysis, folds=analysis.folds[1:])
    first, *_, last = fold_metrics(compared(folds, blind), blind, TOLERANCES)
    assert first.judgement is DISAGREES
    assert math.isnan(first.predicted)
    assert first.note == "no such fold is predicted"
    assert last.judgement is AGREES
    assert fold_count_metric(compared(folds, blind), blind).judgement is DISAGREES


def test_a_fold_that_the_simulator_does_not_have_disagrees(analysis: Analysis) -> None:
    assert fold_count_metric(compared(simulated_folds(analysis)[:1], analysis), analysis).judgement is DISAGREES


def test_a_fold_that_cannot_be_flown_is_compared_on_the_curve(analysis: Analysis) -> None:
    folds = simulated_folds(analysis)
    metrics = fold_metrics(compare_folds(folds, [], analysis), analysis, TOLERANCES)
    assert [metric.name.rpartition(": ")[2] for metric in metrics] == ["elevator, equilibrium curve"] * 2
    assert {metric.judgement for metric in metrics} == {AGREES}
    moved = [replace(folds[0], elevator_rad=folds[0].elevator_rad - 2.0 * TOLERANCE.value), folds[1]]
    metrics = fold_metrics(compare_folds(moved, [], analysis), analysis, TOLERANCES)
    assert [metric.judgement for metric in metrics] == [DISAGREES, AGREES]


def test_a_flown_fold_is_paired_with_its_own(analysis: Analysis) -> None:
    folds = simulated_folds(analysis)
    late = FlownFold(hold=held(folds[1]), ramp=ramped(folds[1]))
    first, second = compare_folds(folds, [late], analysis)
    assert (first.flown, second.flown) == ((), (late,))
    assert (first.predicted, second.predicted) == ((0,), (1,))


def test_extrapolated_folds_are_not_counted_and_say_so(paper_model: PolynomialModel) -> None:
    narrow = analyzed(paper_model, low=-0.19, high=0.38)
    folds = simulated_folds(narrow)
    assert len(folds) == 2
    metrics = fold_metrics(compared(folds, narrow), narrow, TOLERANCES)
    assert not any(metric.counted for metric in metrics)
    assert all("outside the fitted domain, alpha -10.89 to 21.77 deg" in metric.note for metric in metrics)
    count = fold_count_metric(compared(folds, narrow), narrow)
    assert (count.simulated, count.predicted) == (0.0, 0.0)
    notes = fold_notes(compared(folds, narrow), narrow)
    assert [("left out of the verdict" in note) for note in notes] == [True, True]


def test_a_fold_outside_the_analyzed_range_is_not_held_against_the_model(analysis: Analysis) -> None:
    folds = simulated_folds(analysis)
    half = replace(
        analysis, folds=analysis.folds[:1], options=replace(OPTIONS, alpha_range_rad=(OPTIONS.alpha_range_rad[0], 0.2))
    )
    metrics = fold_metrics(compared(folds, half), half, TOLERANCES)
    assert [metric.counted for metric in metrics] == [True] * 3 + [False] * 3
    assert fold_count_metric(compared(folds, half), half).judgement is AGREES


def test_folds_near_zero_have_no_sign_and_folds_near_each_other_have_names_of_their_own(analysis: Analysis) -> None:
    first, second = simulated_folds(analysis)
    near = [replace(first, alpha_rad=-1e-5), replace(second, alpha_rad=to_si(0.03, "deg"))]
    names = {metric.name.partition(":")[0] for metric in fold_metrics(compared(near, analysis), analysis, TOLERANCES)}
    assert names == {"fold at alpha 0.00 deg", "fold at alpha 0.03 deg"}
    (only,) = {
        metric.name.partition(":")[0] for metric in fold_metrics(compared(near[:1], analysis), analysis, TOLERANCES)
    }
    assert only == "fold at alpha 0.0 deg"
    twins = fold_metrics(compare_folds([first, first], [], analysis), analysis, TOLERANCES)
    assert len({metric.name for metric in twins}) == 2


def test_a_fold_that_may_lie_on_either_side_of_the_edge_leaves_the_number_open(paper_model: PolynomialModel) -> None:
    truth = simulated_folds(analyzed(paper_model))
    edge = truth[0].alpha_rad + 1e-4
    unsure, sure = analyzed(paper_model, low=edge, spread=1e-3), analyzed(paper_model, low=edge, spread=1e-6)
    shifted = [replace(truth[0], alpha_rad=edge + 1e-4), truth[1]]
    assert fold_count_metric(compared(shifted, unsure), unsure).judgement is INCONCLUSIVE
    assert fold_count_metric(compared(shifted, sure), sure).judgement is DISAGREES


def test_a_fold_that_no_ramp_showed_is_inconclusive(analysis: Analysis) -> None:
    folds = simulated_folds(analysis)
    metrics = fold_metrics(compared(folds, analysis, ramp_u95_rad=math.inf), analysis, TOLERANCES)
    assert [metric.judgement for metric in metrics] == 2 * [AGREES, AGREES, INCONCLUSIVE]


def test_ramps_that_the_elevator_limit_ends_are_not_counted(analysis: Analysis) -> None:
    fold = simulated_folds(analysis)[0]
    for ramp, counted in ((ramped(fold, math.inf), False), (ramped(fold), True)):
        flown = FlownFold(hold=held(fold), ramp=replace(ramp, at_limit=True))
        *_, metric = fold_metrics(compare_folds([fold], [flown], analysis), analysis, TOLERANCES)
        assert (metric.counted, "elevator limit is too near" in metric.note) == (counted, not counted)


def simulated_equilibria(analysis: Analysis) -> list[SimulatedEquilibrium]:
    return [
        SimulatedEquilibrium(
            elevator_rad=elevator,
            alpha_rad=point.alpha_rad,
            q_rad_s=point.q_rad_s,
            stable=point.kind.stable,
            residual=0.0,
        )
        for elevator in ELEVATORS
        for point in equilibria(analysis.system, elevator)
    ]


def test_equilibria_where_they_were_predicted_agree(analysis: Analysis) -> None:
    metric = equilibrium_metric(simulated_equilibria(analysis), analysis, ELEVATORS, TOLERANCE)
    assert metric.judgement is AGREES
    assert metric.error == 0.0
    # Nine points less the left saddle at -30 deg: at -31.8 deg it is outside the domain that begins at -31.5.
    assert "the worst of 8" in metric.note
    assert "1 outside the fitted domain left out" in metric.note


@pytest.mark.parametrize("index", [1, 2, 3, 4, 5, 6, 7, 8])
def test_the_worst_equilibrium_is_named(analysis: Analysis, index: int) -> None:
    points = simulated_equilibria(analysis)
    points[index] = replace(points[index], alpha_rad=points[index].alpha_rad - 3.0 * TOLERANCE.value)
    metric = equilibrium_metric(points, analysis, ELEVATORS, TOLERANCE)
    assert metric.judgement is DISAGREES
    assert metric.error == pytest.approx(-3.0 * TOLERANCE.value, rel=1e-9)


@pytest.mark.parametrize("index", [1, 2, 3, 4, 5, 6, 7, 8])
def test_an_equilibrium_too_many_or_too_few_disagrees(analysis: Analysis, index: int) -> None:
    points = simulated_equilibria(analysis)
    fewer = equilibrium_metric([*points[:index], *points[index + 1 :]], analysis, ELEVATORS, TOLERANCE)
    assert (fewer.judgement, math.isnan(fewer.simulated)) == (DISAGREES, True)
    more = [*points, replace(points[index], alpha_rad=points[index].alpha_rad + 0.01)]
    other = equilibrium_metric(sorted(more, key=lambda p: p.alpha_rad), analysis, ELEVATORS, TOLERANCE)
    assert (other.judgement, math.isnan(other.predicted)) == (DISAGREES, True)


def test_an_equilibrium_at_the_edge_needs_no_partner(paper_model: PolynomialModel) -> None:
    """Whether it lies just inside or just outside the fitted domain decides nothing."""
    edge = simulated_equilibria(analyzed(paper_model))[0].alpha_rad
    for low in (edge - 0.5 * TOLERANCE.value, edge + 0.5 * TOLERANCE.value):
        analysis = analyzed(paper_model, low=low, spread=1e-5)
        points = simulated_equilibria(analysis)
        assert equilibrium_metric(points, analysis, ELEVATORS, TOLERANCE).judgement is AGREES
        assert equilibrium_metric(points[1:], analysis, ELEVATORS, TOLERANCE).judgement is AGREES


def test_without_any_equilibrium_in_the_domain_nothing_is_counted(paper_model: PolynomialModel) -> None:
    analysis = analyzed(paper_model, low=-0.05, high=-0.04)
    metric = equilibrium_metric(simulated_equilibria(analysis), analysis, ELEVATORS, TOLERANCE)
    assert not metric.counted
    assert metric.judgement is INCONCLUSIVE
