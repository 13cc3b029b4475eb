"""A run whose model no Liénard form holds: pitch damping that changes with alpha, found by the selection."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from finback import pipeline
from finback.cli import documents, tables
from finback.cli.application import app
from finback.dynamics.analysis import Analysis
from finback.dynamics.any_form import analyze_any
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.flight.equilibrium import equilibria
from finback.flight.vehicle import make_vehicle
from finback.identification.identify import identify
from finback.pipeline import Run
from finback.store import load_analysis
from finback.store.codec import to_tree
from finback.study import read_study
from finback.units import to_si
from finback.validation.comparison import paired_equilibria
from finback.validation.linearization import linear_metrics
from finback.validation.metric import Judgement
from finback.validation.prediction import prediction

AIRCRAFT = Path(__file__).resolve().parents[1] / "aircraft" / "f8ii"
PER_DEG = 0.03
"""Of the published pitch damping, gained for each degree of alpha: at alpha 20 deg it is 1.6 times as strong."""
FAR_RAD = (to_si(-30.0, "deg"), to_si(10.0, "deg"))
"""Elevators of the negative control, at which the stable alpha is 17 and -6 deg."""
_TABLE = re.compile(r'(<table name="aero/table/Cm_q">.*?<tableData>)(.*?)(</tableData>)', re.DOTALL)
_SELECT = '[identification.select]\nvariables = ["alpha", "q", "elevator"]\ndegree = 3\nbootstraps = 0\n\n[analysis]'


def damped_with_alpha(folder: Path) -> Path:
    """Return a copy of the F-8 II whose pitch damping is linear in alpha, from -40 to 60 deg."""
    aircraft = folder / "f8ii"
    shutil.copytree(AIRCRAFT, aircraft)
    path = aircraft / "f8ii.xml"
    text = path.read_text(encoding="utf-8")
    published = float(_TABLE.findall(text)[0][1].split()[1])
    rows = {-180.0: 1.0, -40.0: 1.0 - 40.0 * PER_DEG, 60.0: 1.0 + 60.0 * PER_DEG, 180.0: 1.0}
    inside = "\n".join(f"{alpha} {share * published!r}" for alpha, share in rows.items())
    path.write_text(_TABLE.sub(lambda found: f"{found[1]}{inside}{found[3]}", text), encoding="utf-8")
    return aircraft


@pytest.fixture(scope="module")
def study(small_study_text: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("planar")
    text = small_study_text.replace(str(AIRCRAFT), str(damped_with_alpha(folder)))
    path = folder / "study.toml"
    path.write_text(text.replace("[analysis]", _SELECT), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def run(study: Path) -> Run:
    return pipeline.run(study, output=study.parent)


def test_the_selection_finds_the_term_and_nothing_else(run: Run) -> None:
    model = run.identification.model
    assert set(model.q_dot.labels()) == {"1", "alpha", "alpha^2", "alpha^3", "q", "alpha*q", "elevator"}
    assert set(model.alpha_dot.labels()) == {"1", "alpha", "alpha^2", "alpha^3", "q", "elevator"}


def test_the_model_is_analyzed_and_judged_as_a_planar_field(run: Run) -> None:
    assert isinstance(run.analysis, PlanarAnalysis)
    assert len(run.analysis.found.folds) == 2
    assert len(run.analysis.connections.heteroclinics) == 2
    assert run.validation.verdict is Judgement.AGREES
    judged = {metric.name for metric in run.validation.metrics if metric.counted}
    assert sum("fold at alpha" in name for name in judged) == 6
    assert {
        "number of folds",
        "equilibria: alpha",
        "equilibria: damping ratio",
        "equilibria: undamped period",
    } <= judged


def test_every_result_comes_back_from_its_file(run: Run) -> None:
    assert to_tree(load_analysis(run.folder)) == to_tree(run.analysis)
    assert (
        json.loads((run.folder / "analysis.json").read_text(encoding="utf-8"))["schema"] == "finback/planar-analysis/3"
    )


def test_the_report_shows_it(run: Run) -> None:
    page = run.report.read_text(encoding="utf-8")
    assert "planar field" in page
    assert "heteroclinic" in page
    assert "damping of the Liénard form" not in page
    assert "Not drawn by samples" not in page
    assert "fold 2 elevator [deg]" in page
    assert "How the terms were found" in page
    assert "alpha*q in dq/dt" in page
    for name in ("bifurcation", "trace", "stability", "fold-1", "fold-2"):
        assert (run.folder / "figures" / f"{name}.svg").is_file()


def test_without_the_term_the_damping_does_not_agree(run: Run, study: Path) -> None:
    """The negative control: the paper's own form, fitted to the same flights, is wrong where alpha is large."""
    asked = read_study(study)
    plain = replace(asked.identification, selection=())
    analysis = analyze_any(identify(run.sweep, plain).model, asked.analysis)
    assert isinstance(analysis, Analysis)
    with make_vehicle(asked.aircraft, asked.condition, asked.flight) as rig:
        limits = asked.flight.alpha_limits_rad
        simulated = [
            point
            for elevator in FAR_RAD
            for point in equilibria(rig.derivatives, elevator_rad=elevator, alpha_limits_rad=limits)
        ]
        metrics = [
            linear_metrics(
                paired_equilibria(simulated, one, FAR_RAD), rig.derivatives, asked.validation.tolerances.q_rmse
            )[-1]
            for one in (analysis, run.analysis)
        ]
    assert [metric.name for metric in metrics] == ["equilibria: damping ratio"] * 2
    assert metrics[0].judgement is not Judgement.AGREES  # the fit knows that it is poor: its errors are widened
    assert metrics[1].judgement is Judgement.AGREES


def test_a_run_can_be_analyzed_in_other_ranges(run: Run) -> None:
    words = ["analyze", str(run.folder), "--elevator-range", "-10", "10", "--state-range", "q_deg_s=-60:60"]
    result = CliRunner().invoke(app, [*words, "--json", "--quiet"])
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["form"].startswith("planar: the Liénard form cannot hold alpha*q in q_dot")
    assert found["options"]["parameter_range"] == pytest.approx(np.deg2rad([-10.0, 10.0]).tolist())
    assert found["options"]["second_range"] == pytest.approx(np.deg2rad([-60.0, 60.0]).tolist())
    assert [one for one in found["located"] if one["kind"] == "fold"] == []


def test_verbs_say_what_was_found(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    predicted = documents.of_validation(run.folder, run.analysis, run.validation)["folds"]["predicted"]
    assert [fold["elevator_rad"] for fold in predicted] == [
        fold.elevator_rad for fold in prediction(run.analysis).folds
    ]
    tables.show_run(run)
    said = capsys.readouterr().out
    assert "not predicted" not in said
    assert len(re.findall(r"14\.67\d\d ± 0\.00\d\d", said)) == 1
