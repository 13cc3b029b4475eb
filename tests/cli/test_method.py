"""The estimator by the command line: the road to model.json and the terminal."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from finback.cli.application import app
from finback.identification.method import Method
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
