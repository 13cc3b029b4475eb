"""The estimator by the command line: the road to model.json and the terminal."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from finback.cli.application import app
from finback.cli.identification_tables import show_nuisances
from finback.identification.method import Method
from finback.identification.nuisance import Nuisances, flight_nuisances
from finback.store import load_identification

RUNNER = CliRunner()


@pytest.mark.parametrize("method", [Method.OUTPUT_ERROR, Method.FREQUENCY])
def test_identify_takes_another_estimator(own_run: Path, method: Method) -> None:
    before = load_identification(own_run)
    result = RUNNER.invoke(app, ["identify", str(own_run), "--method", str(method), "--quiet"])
    assert result.exit_code == 0, result.stderr
    assert f"method   {method}" in result.stdout
    kept = load_identification(own_run)
    assert kept.options.method is method
    assert before.options.method is Method.WEAK_FORM
    apart = np.abs(kept.model.coefficients - before.model.coefficients)
    assert (apart < 5.0 * (kept.standard_errors + before.standard_errors)).all()


def test_the_method_stands_in_the_document(own_run: Path) -> None:
    result = RUNNER.invoke(app, ["identify", str(own_run), "--quiet", "--json"])
    assert json.loads(result.stdout)["method"] == "weak-form"


def test_an_unknown_method_is_named(own_run: Path) -> None:
    result = RUNNER.invoke(app, ["identify", str(own_run), "--method", "newton"])
    assert result.exit_code == 2
    assert "weak-form, output-error, frequency, filter-error" in result.stderr


def test_derived_numbers_are_told(own_run: Path) -> None:
    shown = RUNNER.invoke(app, ["identify", str(own_run), "--quiet"])
    assert shown.exit_code == 0, shown.stderr
    assert "derived number" in shown.stdout
    assert "fold 1 elevator [deg]" in shown.stdout
    assert "equilibrium 1 alpha [deg]" in shown.stdout
    result = RUNNER.invoke(app, ["identify", str(own_run), "--quiet", "--json"])
    document = json.loads(result.stdout)
    assert {suspicion["suspect"] for suspicion in document["suspicions"]} == {"turbulence", "hysteresis", "input"}
    folds = [number for number in document["derived"] if number["name"].endswith("elevator_rad")]
    assert folds
    for number in folds:
        low, high = number["sampled_interval"]
        assert not number["determined"] or low < number["value"] < high


def test_biases_of_flights_are_told(own_run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = load_identification(own_run)
    flight = flight_nuisances("low", 0.0, np.array([0.01, 0.0, 0.0, 0.0]), np.array([0.001, 0.0, 0.0, 0.0]))
    show_nuisances(found)
    assert not capsys.readouterr().out
    asked = replace(found.options, nuisances=Nuisances(alpha_bias_rad=0.01))
    show_nuisances(replace(found, options=asked, nuisances=(flight,)))
    out = capsys.readouterr().out
    assert "alpha bias [deg]" in out
    assert "0.573 ± 0.057" in out
    assert "delay" not in out
