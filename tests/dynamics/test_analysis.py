"""The analysis as a whole: consistency, what its notes say, and its behavior under exchanged parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.analysis import Analysis, AnalysisOptions, analyze, analyze_model
from finback.dynamics.connection.search import connections
from finback.dynamics.fold import folds
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError
from finback.units import si_factor, to_si

Check = Callable[[Analysis], None]


def _options(
    elevator: tuple[float, float] = (-40.0, 20.0), alpha: tuple[float, float] = (-34.0, 46.0)
) -> AnalysisOptions:
    degree = si_factor("deg")
    return AnalysisOptions(
        elevator_range_rad=(elevator[0] * degree, elevator[1] * degree),
        elevator_step_rad=degree,
        alpha_range_rad=(alpha[0] * degree, alpha[1] * degree),
    )


def _within(model: PolynomialModel, alpha_deg: tuple[float, float]) -> PolynomialModel:
    domain = to_si(np.array([alpha_deg, (-60.0, 60.0), (-36.0, 16.0)]), "deg")
    return replace(model, alpha_dot=replace(model.alpha_dot, domain=domain), q_dot=replace(model.q_dot, domain=domain))


def test_the_whole_analysis_of_the_paper(paper_model: PolynomialModel, assert_consistent: Check) -> None:
    analysis = analyze_model(paper_model, _options())
    assert_consistent(analysis)
    assert len(analysis.folds) == 2
    assert not analysis.hopf_points
    assert len(analysis.neutral_saddles) == 2
    elevators = sorted({point.elevator_rad for point in analysis.equilibria})
    np.testing.assert_allclose(elevators, to_si(np.arange(-40.0, 21.0), "deg"), atol=1e-15)
    between = [e for e in elevators if analysis.folds[1].elevator_rad < e < analysis.folds[0].elevator_rad]
    for elevator in elevators:
        stable = [p for p in analysis.equilibria if p.elevator_rad == elevator and p.kind.stable]
        assert len(stable) == (1 if elevator in between else 0)
    # Nothing is extrapolated and no range is left: what is listed is not told again.
    (cycles,) = analysis.notes
    assert cycles == analysis.limit_cycles.absence.statement
    assert cycles.startswith("There is no limit cycle between elevator -40.000° and 20.000°: proved")


def test_extrapolated_folds_are_said_in_words(paper_model: PolynomialModel, assert_consistent: Check) -> None:
    analysis = analyze_model(_within(paper_model, (-10.0, 30.0)), _options())
    assert_consistent(analysis)
    assert [fold.in_domain for fold in analysis.folds] == [False, True]
    (note,) = [note for note in analysis.notes if note.startswith("The fold")]
    assert "alpha -13.542°" in note
    assert "extrapolated: the data hold alpha from -10.000° to 30.000°" in note
    assert any(note.startswith("The data hold elevators from -36.000° to 16.000°") for note in analysis.notes)
    outside = sum(not point.in_domain for point in analysis.equilibria)
    assert outside > 0
    assert f"Equilibria listed outside the alpha range of the data, extrapolated: {outside}." in analysis.notes


def test_what_lies_outside_the_alpha_range_is_counted(paper_model: PolynomialModel, assert_consistent: Check) -> None:
    everything = analyze_model(paper_model, _options(alpha=(-90.0, 90.0)))
    analysis = analyze_model(paper_model, _options(alpha=(0.0, 46.0)))
    assert_consistent(analysis)
    assert len(analysis.folds) == 1
    assert "Folds outside the alpha range, not listed: 1." in analysis.notes
    left_out = len(everything.equilibria) - len(analysis.equilibria)
    assert f"Equilibria outside the alpha range, not listed: {left_out}." in analysis.notes
    without = analyze_model(paper_model, _options(alpha=(0.0, 20.0)))
    assert "There is no fold in the alpha range." in without.notes


def test_intervals_that_reach_past_a_fold_are_noted(paper_model: PolynomialModel, assert_consistent: Check) -> None:
    vague = replace(paper_model, covariance=np.diag((0.01 * paper_model.coefficients) ** 2))
    analysis = analyze_model(vague, _options())
    assert_consistent(analysis)
    assert any(note.startswith("Equilibria so near a fold") for note in analysis.notes)


def test_exchanged_force_and_damping_still_give_an_analysis(
    paper_model: PolynomialModel, assert_consistent: Check
) -> None:
    right = analyze_model(replace(paper_model, covariance=1e-8 * np.eye(12)), _options())
    system = right.system
    wrong = analyze(replace(system, damping=system.force, force=system.damping), right.options)
    assert_consistent(wrong)
    assert [fold.alpha_rad for fold in wrong.folds] != [fold.alpha_rad for fold in right.folds]
    assert len(wrong.folds) == 1


def test_a_flipped_elevator_mirrors_the_folds(printed_system: LienardSystem, assert_consistent: Check) -> None:
    flipped = analyze(replace(printed_system, elevator_gain=-printed_system.elevator_gain), _options())
    assert_consistent(flipped)
    assert [f.elevator_rad for f in flipped.folds] == [-f.elevator_rad for f in folds(printed_system)]


def test_an_idle_elevator_is_said(printed_system: LienardSystem, assert_consistent: Check) -> None:
    idle = analyze(replace(printed_system, elevator_gain=0.0), _options())
    assert_consistent(idle)
    assert idle.folds == ()
    assert idle.branch.alpha_rad.size == 0
    assert idle.notes[0].startswith("The elevator has no effect")
    assert not any("no fold in" in note for note in idle.notes)


def test_a_conservative_system_is_said(printed_system: LienardSystem, assert_consistent: Check) -> None:
    polynomial = replace(printed_system.damping.polynomial, coefficients=np.zeros(3))
    still = analyze(replace(printed_system, damping=replace(printed_system.damping, polynomial=polynomial)), _options())
    assert_consistent(still)
    assert any("conservative" in note for note in still.notes)


def test_degrees_taken_for_radians_still_give_an_analysis(
    paper_model: PolynomialModel, assert_consistent: Check
) -> None:
    """A model whose angles are 57 times too large: its folds and connections lie where no elevator goes."""
    degree = si_factor("deg")

    def wrong(polynomial: Polynomial) -> Polynomial:
        factors = degree ** (polynomial.powers.sum(axis=1) - 1)
        return replace(polynomial, coefficients=polynomial.coefficients * factors)

    right = analyze_model(paper_model, _options())
    model = replace(paper_model, alpha_dot=wrong(paper_model.alpha_dot), q_dot=wrong(paper_model.q_dot))
    analysis = analyze_model(model, _options())
    assert_consistent(analysis)
    assert analysis.connections.heteroclinics == ()
    assert "Saddle connections with saddles outside the alpha range, not listed: 2." in analysis.notes
    assert all(region.escape_distance_rad > 5.0 for region in analysis.regions)  # rad: 57 times too large as well
    found = connections(analysis.system, analysis.options.elevator_range_rad).heteroclinics
    for one, other in zip(found, right.connections.heteroclinics, strict=True):
        assert one.elevator_rad * degree == pytest.approx(other.elevator_rad, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"elevator_range_rad": (0.1, 0.1)}, "elevator_range_rad"),
        ({"alpha_range_rad": (0.2, -0.1)}, "alpha_range_rad"),
        ({"region_alpha_rad": (1.0, -1.0)}, "region_alpha_rad"),
        ({"elevator_step_rad": 0.0}, "elevator_step_rad"),
        ({"branch_points": 1}, "branch_points"),
    ],
)
def test_options_that_make_no_sense(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(_options(), **change)
