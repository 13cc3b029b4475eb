"""``finback design``: candidates from a study, a model's own flights, bounds, and a sweep that can be flown."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import pytest
from typer.testing import CliRunner

from finback.cli.application import app
from finback.study import read_study

PUBLISHED = Path(__file__).resolve().parents[2] / "aircraft" / "f8ii" / "published.toml"
RUNNER = CliRunner()
WRITTEN = 1e-11  # relative: twelve digits in degrees
SWEEP = """
[[sweep]]
kind = "three-two-one-one"
elevator_deg = [0.0, -8.0, -20.0]
amplitude_deg = [1.0, 4.0]
unit_s = 0.7
lead_s = 0.5
duration_s = 6.0

[[sweep]]
kind = "multisine"
elevator_deg = [-5.0, -60.0]
amplitude_deg = 2.0
lowest_hz = 0.2
highest_hz = 1.5
period_s = 5.0
lead_s = 0.5
duration_s = 6.0
"""


def candidates(study: Path, sweep: str = SWEEP) -> Path:
    """The small study with another sweep."""
    text = study.read_text(encoding="utf-8")
    head, _, rest = text.partition("[[sweep]]")
    study.write_text(f"{head}{sweep}\n[identification]{rest.partition('[identification]')[2]}", encoding="utf-8")
    return study


def test_a_design_is_a_sweep_that_a_study_can_hold(small_study: Path, tmp_path: Path) -> None:
    study, chosen = candidates(small_study, SWEEP.replace(", -60.0", "")), tmp_path / "chosen.toml"
    arguments = ["design", str(study), "--model", str(PUBLISHED), "--count", "3", "--output", str(chosen)]
    result = RUNNER.invoke(app, [*arguments, "--json"])
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)
    assert len(document["flights"]) == 3
    assert 0.5 < document["efficiency"] <= 1.0
    assert len(document["coefficients"]) == 12
    assert all(item["of_all_candidates"] < item["standard_error"] for item in document["coefficients"])
    before = read_study(study).maneuvers
    after = read_study(candidates(study, chosen.read_text(encoding="utf-8"))).maneuvers
    assert len(after) == 3
    for maneuver in after:
        assert any(
            type(maneuver) is type(other)
            and all(
                getattr(maneuver, part.name) == pytest.approx(getattr(other, part.name), rel=WRITTEN)
                for part in fields(maneuver)
            )
            for other in before
        )


def test_it_says_what_it_chose_and_what_it_left_out(small_study: Path) -> None:
    wild = SWEEP.replace("4.0]", "15.0]").replace(", -60.0", "")
    result = RUNNER.invoke(
        app, ["design", str(candidates(small_study, wild)), "--model", str(PUBLISHED), "--count", "2"]
    )
    assert result.exit_code == 0, result.stderr
    assert "Cramér-Rao" in result.stdout
    assert "no candidate, left out: flight 'three-two-one-one" in result.stderr


def test_every_number_of_a_chosen_maneuver_is_shown(small_study: Path) -> None:
    released = """
[[sweep]]
kind = "three-two-one-one"
elevator_deg = -5.0
amplitude_deg = 2.0
unit_s = 0.7
lead_s = 0.5
duration_s = 6.0

[[sweep]]
kind = "release"
elevator_deg = -4.0
alpha_deg = 11.0
q_deg_s = 13.0
duration_s = 5.0
"""
    arguments = ["design", str(candidates(small_study, released)), "--model", str(PUBLISHED), "--count", "2"]
    result = RUNNER.invoke(app, arguments)
    assert result.exit_code == 0, result.stderr
    lines = [line.split() for line in result.stdout.splitlines()]
    (heads,) = (line for line in lines if line[:1] == ["flight"])
    for words in ("elevator [deg]", "amplitude [deg]", "unit [s]", "alpha [deg]", "q [deg/s]", "duration [s]"):
        assert words in " ".join(heads)
    rows = {line[0]: {float(cell) for cell in line[1:]} for line in lines if line and line[0].endswith("-01")}
    assert rows["release-01"] == {-4.0, 11.0, 13.0, 5.0}
    assert rows["three-two-one-one-01"] >= {-5.0, 2.0, 0.7, 6.0}


def test_what_cannot_be_chosen_is_an_error(small_study: Path) -> None:
    study = candidates(small_study, SWEEP.replace(", -60.0", ""))
    result = RUNNER.invoke(app, ["design", str(study), "--model", str(PUBLISHED), "--count", "9"])
    assert (result.exit_code, "9 flights cannot be chosen from 7" in result.stderr) == (2, True)
