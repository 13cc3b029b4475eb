"""Figures: well-formed, labeled, the same each time, and made without touching anything."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest

from finback.dynamics.analysis import analyze
from finback.dynamics.branch import Branch
from finback.dynamics.connection.connection import Direction, Homoclinic
from finback.dynamics.connection.search import Connections
from finback.dynamics.hopf import Criticality, Hopf
from finback.dynamics.lienard import Curve
from finback.dynamics.polynomial import Polynomial
from finback.units import from_si
from finback.views.bifurcation_figure import bifurcation_diagram, stretches
from finback.views.coverage_figure import sweep_coverage
from finback.views.cycle_rows import family_row, regime_row
from finback.views.figures import draw_figures, save_figures
from finback.views.fold_figure import fold_cases, fold_close_up
from finback.views.holdout_figure import holdout_history
from finback.views.stability_figure import bounded, stability_regions
from finback.views.stability_rows import connection_row, connections_of, region_row
from finback.views.style import THEME, Drawing
from finback.views.trace_figure import trace_over_elevator

ALPHA, Q, ELEVATOR, TIME = "α [deg]", "q [deg/s]", "δe [deg]", "t [s]"


@pytest.fixture(scope="module")
def drawings(results: Any) -> dict[str, Drawing]:
    return {drawing.name: drawing for drawing in draw_figures(**vars(results))}


def texts(drawing: Drawing) -> list[str]:
    """Return every text of a figure; parsing it shows that it is well-formed."""
    root = ET.fromstring(drawing.svg)  # noqa: S314 - our own picture
    return ["".join(node.itertext()).strip() for node in root.iter("{http://www.w3.org/2000/svg}text")]


def colored(drawing: Drawing, color: str) -> int:
    return drawing.svg.count(color)


def test_every_subject_has_its_figure(drawings: dict[str, Drawing], results: Any) -> None:
    expected = {"bifurcation", "trace", "coverage", "stability"}
    expected |= {f"fold-{number}" for number in range(1, len(results.validation.folds) + 1)}
    expected |= {holdout.record.name for holdout in results.validation.holdouts}
    assert set(drawings) == expected
    assert len(results.validation.folds) == 2


def test_axes_name_symbol_and_unit(drawings: dict[str, Drawing]) -> None:
    wanted = {
        "bifurcation": {ALPHA, ELEVATOR},
        "coverage": {ALPHA, Q},
        "trace": {"a₀ = trace [1/s]", ELEVATOR},
        "fold-1": {ALPHA, ELEVATOR, "δe at the crossing [deg]"},
        "holdout-": {ALPHA, Q, ELEVATOR, TIME, "Δα [deg]", "Δq [deg/s]"},
    }
    for prefix, labels in wanted.items():
        found = [drawing for name, drawing in drawings.items() if name.startswith(prefix)]
        assert found
        for drawing in found:
            assert labels <= set(texts(drawing)), drawing.name


def test_the_same_results_give_the_same_bytes(results: Any, drawings: dict[str, Drawing]) -> None:
    again = draw_figures(**vars(results))
    assert {drawing.name: drawing.svg for drawing in again} == {name: d.svg for name, d in drawings.items()}


def test_a_figure_says_nothing_of_when_and_by_whom(drawings: dict[str, Drawing]) -> None:
    for drawing in drawings.values():
        assert "<dc:date>" not in drawing.svg
        assert "matplotlib.org" not in drawing.svg


def test_matplotlib_is_left_as_it_was(results: Any) -> None:
    before = mpl.rcParams.copy()
    trace_over_elevator(results.analysis)
    assert dict.items(mpl.rcParams) == dict.items(before)


def test_pyplot_is_never_loaded() -> None:
    code = (
        "import sys; from finback.views import style, figures, report\n"
        "with style.styled('x'):\n"
        "    figure = style.new_figure(2.0); axes = figure.add_subplot(); axes.plot([0, 1], label='a')\n"
        "    style.legend(axes); style.svg(figure)\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    environment = {**os.environ, "MPLBACKEND": "module://no_such_backend"}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)


def test_words_stand_for_every_picture(drawings: dict[str, Drawing]) -> None:
    for drawing in drawings.values():
        assert drawing.title
        assert len(drawing.alt) > 40
        assert len(drawing.caption) > 40


def test_the_diagram_shows_what_was_found(results: Any, drawings: dict[str, Drawing]) -> None:
    written = " ".join(texts(drawings["bifurcation"]))
    for fold in results.analysis.folds:
        assert f"α = {from_si(fold.alpha_rad, 'deg'):.2f}°".replace("-", "−") in written
    for label in ("predicted, stable", "predicted, unstable", "simulated, stable", "simulated, unstable"):
        assert label in written
    without = bifurcation_diagram(results.analysis, replace(results.validation, equilibria=()))
    marks = colored(drawings["bifurcation"], "#d55e00") - colored(without, "#d55e00")
    assert marks >= len(results.validation.equilibria)


def test_a_hopf_point_is_marked_and_a_neutral_saddle_is_not(results: Any) -> None:
    neutral = results.analysis.neutral_saddles
    assert neutral, "the example has zeros of the trace, all on saddles"
    assert "predicted, Hopf point" not in texts(bifurcation_diagram(results.analysis, results.validation))
    hopf = Hopf(
        **{item.name: getattr(neutral[0], item.name) for item in fields(neutral[0]) if item.name != "eigenvalue_1_s"},
        frequency_rad_s=2.0,
        lyapunov_1_s=-1.0,
        criticality=Criticality.SUPERCRITICAL,
        crossing_speed_1_s=1.0,
        lyapunov_interval_1_s=np.zeros(2),
    )
    changed = replace(results.analysis, hopf_points=(hopf,))
    assert "predicted, Hopf point" in texts(bifurcation_diagram(changed, results.validation))
    assert "Hopf point" in texts(trace_over_elevator(changed))


def test_connections_and_regions_are_shown(results: Any, drawings: dict[str, Drawing]) -> None:
    analysis = results.analysis
    assert analysis.regions, "the example has stability regions"
    written = texts(drawings["stability"])
    for region in analysis.regions:
        assert f"δe = {from_si(region.elevator_rad, 'deg'):.2f}°".replace("-", "−") in written
    assert f"{len(analysis.regions)}" == f"{drawings['stability'].alt.count('at elevator')}"
    assert analysis.connections.heteroclinics, "the example has saddle connections"
    assert "predicted, saddle connection" in texts(drawings["bifurcation"])
    nothing = Connections(heteroclinics=(), homoclinics=(), stretches=())
    without = bifurcation_diagram(replace(analysis, connections=nothing), results.validation)
    assert "predicted, saddle connection" not in texts(without)


def test_a_fold_that_is_not_determined_is_said_so(results: Any) -> None:
    nowhere = np.array([-np.inf, np.inf])
    vague = tuple(
        replace(fold, elevator_interval_rad=nowhere, alpha_interval_rad=nowhere) for fold in results.analysis.folds
    )
    shown = "; ".join(texts(bifurcation_diagram(replace(results.analysis, folds=vague), results.validation)))
    assert "fold at δe not determined; α not determined" in shown
    assert "fold at δe =" not in shown


def test_rows_of_connections_and_regions(results: Any) -> None:
    analysis = results.analysis
    rows = [connection_row(found) for found in connections_of(analysis)]
    assert [row.name for row in rows] == ["heteroclinic, α rising", "heteroclinic, α falling"]
    assert all("±" in row.elevator for row in rows)
    loop = Homoclinic(
        elevator_rad=0.1,
        alpha_rad=0.2,
        turn_alpha_rad=0.4,
        turns_alpha_rad=np.array([0.4]),
        direction=Direction.RISING,
        divergence_1_s=-1.0,
        elevator_interval_rad=np.array([-np.inf, np.inf]),
        bracket_rad=np.array([0.1, 0.1]),
        residual_rad=0.0,
        resolved=True,
        in_domain=False,
    )
    row = connection_row(loop)
    assert (row.name, row.start, row.end) == ("homoclinic, α rising", "11.46", "11.46")
    assert row.elevator == "not determined"
    assert row.remark.startswith("extrapolated")
    for region, shown in zip(analysis.regions, map(region_row, analysis.regions), strict=True):
        assert len(shown.saddles.split(",")) == len(region.boundary) // 2
        area, error = map(float, shown.area.split(" ± "))  # the last digit of the area is one of its error
        assert area == pytest.approx(from_si(from_si(region.area_rad2_s, "deg"), "deg"), abs=0.1 * error)
        half = 0.5 * np.ptp(from_si(from_si(region.area_interval_rad2_s, "deg"), "deg"))
        assert error == pytest.approx(half, rel=0.05)
        assert "±" in shown.escape
        proved = any(not tongue.obstacle for tongue in region.tongues)
        assert ("proved unbounded" in shown.beyond and "not proved" not in shown.beyond) == proved


@pytest.fixture(scope="module")
def circling(results: Any) -> Any:
    """The example, and a field with a family of cycles from a Hopf point to a loop: x" = (0.1 + x) x' − x + x² + δ."""
    system = results.analysis.system
    width = system.elevator_gain_sensitivity.size

    def curve(like: Curve, *row: float) -> Curve:
        unit = like.polynomial.value_unit
        terms = {(k,): value for k, value in enumerate(row)}
        polynomial = Polynomial.build(terms, variables=("alpha_rad",), value_unit=unit)
        return replace(like, polynomial=polynomial, sensitivity=np.zeros((len(row), width)))

    turning = replace(
        system,
        damping=curve(system.damping, 0.1, 1.0),
        force=curve(system.force, 0.0, -1.0, 1.0),
        elevator_gain=1.0,
        elevator_gain_sensitivity=np.zeros(width),
    )
    options = replace(
        results.analysis.options, elevator_range_rad=(-0.5, 0.5), elevator_step_rad=0.1, alpha_range_rad=(-2.0, 2.0)
    )
    return replace(results, analysis=analyze(turning, options))


def test_cycles_and_regimes_are_shown(results: Any, circling: Any) -> None:
    name = "predicted, limit cycle: least and greatest α"
    assert name in texts(bifurcation_diagram(circling.analysis, circling.validation))
    assert name not in texts(bifurcation_diagram(results.analysis, results.validation))
    (row,) = map(family_row, circling.analysis.limit_cycles.families)
    assert row.begin.startswith("hopf at −6.303")  # -0.11 rad
    assert row.end.startswith("loop at −23.534")
    assert row.stable.startswith("0 of ")
    said = [regime_row(regime) for regime in circling.analysis.regimes]
    assert [one.bounds for one in said] == ["1 saddle", "an unstable limit cycle", *["no stable equilibrium"] * 2]
    assert said[0].elevator.endswith("(homoclinic)")
    assert "a limit cycle" in stability_regions(circling.analysis).alt
    assert [region_row(region).saddles for region in circling.analysis.regions][1] == "a limit cycle"


def test_many_regions_stand_in_rows(circling: Any) -> None:
    crowded = replace(circling.analysis, regions=circling.analysis.regions * 3)
    drawing = stability_regions(crowded)
    assert drawing.alt.count("at elevator") == 6
    none = [replace(region, boundary=(), cycles=()) for region in crowded.regions]
    assert bounded(replace(crowded, regions=tuple(none))) == ()


def test_a_fold_far_from_its_prediction_is_shown_in_degrees(results: Any) -> None:
    case = fold_cases(results.analysis, results.validation)[0]
    near = fold_close_up(case, results.analysis, results.validation)
    moved = replace(case.predicted[0], elevator_rad=case.predicted[0].elevator_rad + 0.5)
    far = fold_close_up(replace(case, predicted=(moved,)), results.analysis, results.validation)
    label = "δe − δe of the simulator's equilibrium curve"
    assert f"{label} [0.001 deg]" in texts(near)
    assert f"{label} [deg]" in texts(far)


def test_stretches_cover_the_branch_once_and_are_pure(results: Any) -> None:
    branch = results.analysis.branch
    seen = np.zeros(branch.alpha_rad.size, dtype=int)
    for kind, rows in stretches(branch):
        own = slice(rows.start, rows.stop - 1 if rows.stop < branch.alpha_rad.size else rows.stop)
        seen[own] += 1
        assert (branch.in_domain[own] == (kind != 2)).all()
        assert kind == 2 or (branch.stable[own] == (kind == 0)).all()
    assert (seen == 1).all()


def test_an_empty_branch_has_no_stretches() -> None:
    empty = {name: np.empty(0) for name in ("alpha_rad", "elevator_rad", "q_rad_s", "divergence_1_s")}
    flags = {name: np.empty(0, dtype=bool) for name in ("stable", "in_domain")}
    assert not list(stretches(Branch(**empty, determinant_1_s2=np.empty(0), **flags)))


def test_folds_are_paired_as_the_validation_pairs_them(results: Any) -> None:
    for case in fold_cases(results.analysis, results.validation):
        assert len(case.predicted) == 1
        assert abs(case.predicted[0].alpha_rad - case.hold.table_alpha_rad) < 0.02


def every_figure(results: Any) -> Iterator[Drawing]:
    yield bifurcation_diagram(results.analysis, results.validation)
    yield trace_over_elevator(results.analysis)
    yield sweep_coverage(results.sweep, results.identification)
    for case in fold_cases(results.analysis, results.validation):
        yield fold_close_up(case, results.analysis, results.validation)
    for holdout in results.validation.holdouts:
        yield holdout_history(holdout)


def test_figures_survive_results_with_hardly_anything(bare: Any) -> None:
    drawings = list(every_figure(bare))
    assert len(drawings) == 5
    for drawing in drawings:
        assert texts(drawing)
    assert "none" in next(drawing for drawing in drawings if drawing.name == "fold-1").alt


def test_a_blown_up_prediction_does_not_flatten_the_flight(bare: Any, results: Any) -> None:
    blown = holdout_history(bare.validation.holdouts[0])
    assert "extrapolation" in blown.caption
    ticks = [text for text in texts(blown) if re.fullmatch(r"−?[0-9.]+", text)]
    record = results.validation.holdouts[0].record
    assert (
        max(abs(float(text.replace("−", "-"))) for text in ticks)
        < 100 * np.abs(from_si(record["q_rad_s"], "deg_s")).max()
    )


def test_figures_become_files(tmp_path: Path, drawings: dict[str, Drawing]) -> None:
    save_figures(tmp_path / "new" / "figures", drawings.values())
    found = {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "new" / "figures").iterdir()}
    assert found == {f"{name}.svg": drawing.svg for name, drawing in drawings.items()}


def test_every_color_of_a_figure_is_one_of_the_style(drawings: dict[str, Drawing]) -> None:
    for drawing in drawings.values():
        used = set(re.findall(r"#[0-9a-f]{6}\b", drawing.svg))
        assert used <= {*THEME, "#000000"}, drawing.name
