"""The layout that all located objects share says what their own classes say, for every kind there is."""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
from pathlib import Path

import numpy as np
import pytest

import finback.dynamics
from finback.arrays import FloatArray
from finback.dynamics import located as one, located_planar as other
from finback.dynamics.analysis import Analysis, AnalysisOptions, analyze
from finback.dynamics.analysis_range import STEPS, options_for, planar_options_for
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.planar.analysis import PlanarAnalysis, PlanarAnalysisOptions, analyze_planar
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import reduce
from finback.errors import InputError
from finback.units import quotient, to_si


@pytest.fixture(scope="module")
def analysis(printed_system: LienardSystem) -> Analysis:
    options = AnalysisOptions(
        elevator_range_rad=(to_si(-40.0, "deg"), to_si(20.0, "deg")),
        elevator_step_rad=to_si(4.0, "deg"),
        alpha_range_rad=(to_si(-45.0, "deg"), to_si(55.0, "deg")),
        branch_points=11,
    )
    return analyze(printed_system, options)


def test_every_object_of_an_analysis_is_there_in_order(analysis: Analysis) -> None:
    found = one.located(analysis)
    kinds = list(dict.fromkeys(item.kind for item in found))
    assert kinds == ["equilibrium", "fold", "neutral-saddle", "heteroclinic"]
    counts = [sum(item.kind == kind for item in found) for kind in kinds]
    assert counts == [len(analysis.equilibria), 2, 2, 2]
    for item, fold in zip((i for i in found if i.kind == "fold"), analysis.folds, strict=True):
        assert (item.parameter.name, item.parameter.unit, item.parameter.value) == (
            "elevator",
            "rad",
            fold.elevator_rad,
        )
        assert item.state["alpha"].value == fold.alpha_rad
        assert item.state["q"].value == fold.q_rad_s
        assert item.residual["force_slope"].value == fold.residual
        assert item.brackets == (
            one.Bracket(name="alpha", unit="rad", low=fold.bracket_rad[0], high=fold.bracket_rad[1]),
        )
        np.testing.assert_array_equal(item.parameter.interval, fold.elevator_interval_rad)
    for item, orbit in zip(
        (i for i in found if i.kind == "heteroclinic"), analysis.connections.heteroclinics, strict=True
    ):
        assert item.state["from_alpha"].value == orbit.from_alpha_rad
        assert item.words == {"direction": orbit.direction.value, "resolved": "resolved"}
        assert item.properties["turns"].value == 0
        assert item.brackets[0].low <= item.parameter.value <= item.brackets[0].high


def test_an_equilibrium_lies_in_its_bracket(analysis: Analysis) -> None:
    system = analysis.system
    for point in analysis.equilibria:
        low, high = point.bracket_rad
        assert low <= point.alpha_rad <= high
        ends = [float(system.force(end)) + system.elevator_gain * point.elevator_rad for end in (low, high)]
        assert ends[0] * ends[1] < 0.0


def planar(first: dict[tuple[int, int, int], float], second: dict[tuple[int, int, int], float]) -> PlanarSystem:
    names = ("x_1", "y_1", "mu_1")
    return PlanarSystem.from_polynomials(
        Polynomial.build(first, variables=names, value_unit="1"),
        Polynomial.build(second, variables=names, value_unit="1"),
    )


def test_a_planar_field_without_time() -> None:
    """Van der Pol: x" = (mu − x²) x' − x has a Hopf point at 0, ω = 1, a = −1/8 (Guckenheimer & Holmes 3.4.11)."""
    system = planar({(0, 1, 0): 1.0}, {(1, 0, 0): -1.0, (0, 1, 1): 1.0, (2, 1, 0): -1.0})
    options = PlanarAnalysisOptions(
        parameter_range=(-1.0, 1.3), parameter_step=0.1, first_range=(-3.0, 3.0), second_range=(-3.0, 3.0)
    )
    found = other.located_planar(analyze_planar(system, options))
    (hopf,) = (item for item in found if item.kind == "hopf")
    assert (hopf.parameter.name, hopf.parameter.unit, set(hopf.state)) == ("mu", "1", {"x", "y"})
    assert hopf.parameter.value == pytest.approx(0.0, abs=1e-14)
    frequency = hopf.properties["frequency"]
    assert (frequency.value, frequency.unit) == (pytest.approx(1.0, rel=1e-12), "1")
    np.testing.assert_allclose(frequency.interval, 1.0, rtol=1e-12)  # an exact model: of no width
    assert hopf.properties["first_lyapunov_coefficient"].value == pytest.approx(-0.125, rel=1e-12)
    assert hopf.words == {"criticality": "supercritical"}
    assert [bracket.name for bracket in hopf.brackets] == ["x", "y", "mu"]
    assert all(bracket.low <= bracket.high for bracket in hopf.brackets)
    equilibria = [item for item in found if item.kind == "equilibrium"]
    assert set(equilibria[0].residual) == {"x_dot", "y_dot"}
    assert {item.properties["eigenvalue_1_real"].unit for item in equilibria} == {"1"}


def test_a_fold_says_on_which_side_its_equilibria_are() -> None:
    system = planar({(0, 0, 1): 1.0, (2, 0, 0): -1.0}, {(0, 1, 0): -1.0})  # x = ±√mu
    options = PlanarAnalysisOptions(
        parameter_range=(-1.0, 1.3), parameter_step=0.1, first_range=(-2.0, 2.0), second_range=(-1.0, 1.0)
    )
    found = other.located_planar(analyze_planar(system, options))
    (fold,) = (item for item in found if item.kind == "fold")
    assert fold.words == {"equilibria": "above"}
    assert fold.properties["other_eigenvalue"].value == pytest.approx(-1.0)


def test_units_of_a_planar_field_in_pitch(paper_model: PolynomialModel) -> None:
    system = PlanarSystem.from_model(paper_model)
    options = PlanarAnalysisOptions(
        parameter_range=(to_si(-40.0, "deg"), to_si(20.0, "deg")),
        parameter_step=to_si(4.0, "deg"),
        first_range=(-0.8, 1.0),
        second_range=(-1.0, 1.0),
    )
    found = other.located_planar(analyze_planar(system, options))
    folds = [item for item in found if item.kind == "fold"]
    exact = sorted(fold.elevator_rad for fold in analyze(reduce(paper_model), _wide()).folds)
    # Two roads: the planar branch, and the roots of g' of the reduced equation.
    np.testing.assert_allclose(sorted(item.parameter.value for item in folds), exact, rtol=0, atol=1e-12)
    assert folds[0].residual["determinant"].unit == "1_s2"
    assert folds[0].properties["other_eigenvalue"].unit == "1_s"
    assert {item.residual["q_dot"].unit for item in found if item.kind == "equilibrium"} == {"rad_s2"}


def _wide() -> AnalysisOptions:
    return AnalysisOptions(
        elevator_range_rad=(-1.0, 0.5), elevator_step_rad=0.5, alpha_range_rad=(-1.0, 1.0), branch_points=3
    )


def test_every_class_with_a_domain_is_described_or_known_not_to_be() -> None:
    """A new kind of object needs a function in one of both tables, or a reason here."""
    described = {*one.DESCRIPTIONS, *other.DESCRIPTIONS}
    results: list[type] = []
    pending: list[type] = [Analysis, PlanarAnalysis]
    classes = _dataclasses()
    while pending:
        kind = pending.pop()
        results.append(kind)
        for member in dataclasses.fields(kind):
            names = str(member.type)
            pending += [c for name, c in classes.items() if name in _words(names) and c not in (*results, *pending)]
    not_points = {
        "Branch",  # a curve
        "PlanarBranch",  # a curve
        "PlanarCycleFamily",  # a curve
        "StabilityRegion",  # a region at a held elevator
        "PlanarRegion",  # the same
    }
    with_domain = {c for c in results if any(member.name == "in_domain" for member in dataclasses.fields(c))}
    assert {c.__name__ for c in with_domain - described} <= not_points
    assert {c.__name__ for c in described} <= {c.__name__ for c in with_domain}


def _words(text: str) -> set[str]:
    return set("".join(c if c.isalnum() or c == "_" else " " for c in text).split())


def _dataclasses() -> dict[str, type]:
    found = pkgutil.walk_packages([str(Path(finback.dynamics.__file__).parent)], prefix="finback.dynamics.")
    modules = [importlib.import_module(module.name) for module in found]
    return {
        name: value
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, type) and dataclasses.is_dataclass(value)
    }


@pytest.mark.parametrize(
    ("unit", "divisor", "expected"),
    [
        ("1_s", "rad", "1_s_rad"),
        ("1_s_rad", "rad", "1_s_rad2"),
        ("1_s", "rad_s", "1_rad"),
        ("rad_s2", "rad_s", "1_s"),
        ("1", "1", "1"),
        ("1_s", "1", "1_s"),
        ("rad_s", "rad_s", "1"),
        ("1_rad", "1_s", "s_rad"),
    ],
)
def test_the_unit_of_a_quotient(unit: str, divisor: str, expected: str) -> None:
    assert quotient(unit, divisor) == expected


# where to look


def test_the_natural_range_shows_every_fold_and_falls_on_none(printed_system: LienardSystem) -> None:
    options = options_for(printed_system, {}, {})
    low, high = options.elevator_range_rad
    found = analyze(printed_system, dataclasses.replace(options, branch_points=3))
    assert all(low < fold.elevator_rad < high for fold in found.folds)
    assert len(found.folds) == 2
    assert options.elevator_step_rad == (high - low) / STEPS
    assert "degenerate" not in {point.kind.value for point in found.equilibria}
    assert not any(note.startswith("Equilibria outside") for note in found.notes)


def test_what_is_given_and_what_the_data_hold_come_first(printed_system: LienardSystem) -> None:
    domain = np.array([[-0.3, 0.4], [-0.2, 0.1]])
    system = dataclasses.replace(printed_system, domain=domain)
    options = options_for(system, {"alpha_rad": (-0.1, 0.1)}, {"elevator_rad": 0.05})
    assert (options.elevator_range_rad, options.alpha_range_rad) == ((-0.2, 0.1), (-0.1, 0.1))
    assert options.elevator_step_rad == 0.05
    assert options_for(system, {}, {}).alpha_range_rad == (-0.3, 0.4)


def straight(system: LienardSystem, force: FloatArray) -> LienardSystem:
    terms = {(k,): value for k, value in enumerate(force.tolist())}
    curve = dataclasses.replace(
        system.force,
        polynomial=Polynomial.build(terms, variables=("alpha_rad",), value_unit="rad_s2"),
        sensitivity=np.zeros((len(terms), 1)),
    )
    return dataclasses.replace(system, force=curve)


def test_without_folds_and_data_nothing_says_where_to_look(printed_system: LienardSystem) -> None:
    plain = straight(printed_system, np.array([0.0, -8.0]))
    damping = dataclasses.replace(
        plain.damping,
        polynomial=Polynomial.build({(0,): -1.0}, variables=("alpha_rad",), value_unit="1_s"),
        sensitivity=np.zeros((1, 1)),
    )
    plain = dataclasses.replace(plain, damping=damping)
    with pytest.raises(InputError, match="which elevators") as caught:
        options_for(plain, {}, {})
    assert "--elevator-range" in caught.value.hint
    assert options_for(plain, {"elevator_rad": (-0.1, 0.1)}, {}).alpha_range_rad[0] < 0.0
    with pytest.raises(InputError, match="which angles") as caught:
        options_for(straight(plain, np.array([1.0])), {"elevator_rad": (-0.1, 0.1)}, {})
    assert "--alpha-range" in caught.value.hint


def test_a_planar_field_needs_a_range_of_its_parameter() -> None:
    system = planar({(0, 0, 1): 1.0, (2, 0, 0): -1.0}, {(0, 1, 0): -1.0, (1, 0, 0): 1.0})  # x = ±√mu, y = x
    with pytest.raises(InputError, match="which mu") as caught:
        planar_options_for(system, {}, {})
    assert "--parameter-range" in caught.value.hint
    options = planar_options_for(system, {"mu_1": (-1.0, 1.0)}, {"mu_1": 0.5})
    assert options.parameter_step == 0.5
    assert options.first_range == pytest.approx((-1.2, 1.2))
    assert options.second_range == pytest.approx((-1.2, 1.2))
    flat = planar({(0, 0, 1): 1.0, (2, 0, 0): -1.0}, {(0, 1, 0): -1.0})
    with pytest.raises(InputError, match="which y") as caught:
        planar_options_for(flat, {"mu_1": (-1.0, 1.0)}, {})
    assert "--state-range y_1=LOW:HIGH" in caught.value.hint
