"""Selection by the command line and by a study: the road from a library to model.json and the terminal."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from finback.cli.application import app
from finback.errors import StudyError
from finback.store import load_identification
from finback.study import read_study

RUNNER = CliRunner()
SELECT = """
[identification.select]
variables = ["alpha", "q", "elevator"]
degree = 3
terms = ["alpha^4"]
q_dot_terms = ["alpha_dot"]
false_alarm = 0.05
bootstraps = 0
prediction = ["release-01"]
"""


def with_select(study: Path, table: str = SELECT) -> Path:
    text = study.read_text(encoding="utf-8")
    study.write_text(text.replace("\n[analysis]", f"{table}\n[analysis]"), encoding="utf-8")
    return study


def test_identify_select_keeps_the_selection_with_the_model(own_run: Path) -> None:
    result = RUNNER.invoke(app, ["identify", str(own_run), "--select", "--quiet"])
    assert result.exit_code == 0, result.stderr
    assert "PRESS" in result.stdout
    assert "of 40 terms" in result.stdout
    kept = load_identification(own_run)
    (selection,) = kept.selection
    assert selection.options.library.sizes == (20, 20)
    assert set(kept.model.alpha_dot.labels()) == {term.label for term in selection.form.alpha_dot}
    assert {"alpha", "q", "elevator"} <= set(kept.model.q_dot.labels())


def test_a_study_asks_for_a_selection(small_study: Path) -> None:
    (selection,) = read_study(with_select(small_study)).identification.selection
    assert selection.library.sizes == (21, 22)
    assert (selection.false_alarm, selection.bootstraps, selection.prediction) == (0.05, 0, ("release-01",))


@pytest.mark.parametrize(
    ("table", "fault"),
    [
        ("degre = 2", r"identification\.select\.degre: unknown key; did you mean 'degree'"),
        ("variables = ['alfa']", "unknown variable 'alfa'"),
    ],
)
def test_slips_in_its_keys_are_named(small_study: Path, table: str, fault: str) -> None:
    with pytest.raises(StudyError, match=fault) as caught:
        read_study(with_select(small_study, f"\n[identification.select]\n{table}\n"))
    assert len(caught.value.faults) == 1


def test_a_selection_as_json(own_run: Path) -> None:
    result = RUNNER.invoke(app, ["identify", str(own_run), "--select", "--quiet", "--json"])
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)
    assert len(document["selection"]) == 1
    assert len(document["selection"][0]["candidates"]) == 40
