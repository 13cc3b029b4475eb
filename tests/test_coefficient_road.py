"""The documents' road: JSBSim's 737 flown in six degrees of freedom, identified, exported, flown and found again."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from finback.cli.application import app

EXAMPLE = Path(__file__).resolve().parents[1] / "docs" / "examples" / "737"
CLOSE = 4.0  # standard errors, of thirty numbers
# Of aircraft/737/737.xml: lift over alpha goes from 0.20 at 0 to 1.20 at 0.23 rad, drag grows by 0.059 |elevator|.
KNOWN = {
    "CL 1": 0.2,
    "CL alpha": 1.0 / 0.23,
    "CL elevator": 0.2,
    "CD elevator": -0.059,
    "Cm 1": 0.0,
    "Cm alpha": -0.6,
    "Cm pitch_rate": -27.0,
    "Cm alpha_rate": -16.0,
    "Cm elevator": -1.2,
}


def said(*arguments: object) -> str:
    result = CliRunner().invoke(app, list(map(str, arguments)))
    assert result.exit_code == 0, result.stderr
    return result.stdout


def numbers(document: str) -> dict[str, tuple[float, float]]:
    return {
        f"{item['coefficient']} {item['term']}": (item["value"], item["standard_error"])
        for item in json.loads(document)["coefficients"]
    }


def agree(found: dict[str, tuple[float, float]], truth: dict[str, float]) -> None:
    for label, known in truth.items():
        value, error = found[label]
        assert abs(value - known) <= CLOSE * error, (label, value, error)


def test_the_737_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    study = (EXAMPLE / "study.toml").read_text(encoding="utf-8").replace("duration_s = 10.0", "duration_s = 7.0")
    (tmp_path / "study.toml").write_text(study, encoding="utf-8")
    run = json.loads(said("sweep", "study.toml", "--json"))["run"]
    agree(numbers(said("coefficients", EXAMPLE / "setup.toml", run, "--method", "equation-error", "--json")), KNOWN)
    # The setup has the airframe as the run says it.
    facts = json.loads((Path(run) / "sweep.json").read_text(encoding="utf-8"))["content"]["provenance"]
    for key, value in tomllib.loads((EXAMPLE / "setup.toml").read_text(encoding="utf-8"))["airframe"].items():
        assert float(facts[key]) == pytest.approx(value, rel=1e-5), key


@pytest.mark.slow
def test_its_export_is_flown_and_found_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run = json.loads(said("sweep", EXAMPLE / "study.toml", "--json"))["run"]
    found = numbers(said("coefficients", EXAMPLE / "setup.toml", run, "--json"))
    agree(found, KNOWN)
    said("export", "coefficients.json", "--to", "jsbsim", "--output", "aircraft/found")
    study = (EXAMPLE / "study.toml").read_text(encoding="utf-8")
    # Its thrust is its own; the setup says it.
    study = study.replace('"737"', '"found"').replace("thrust_kn = 40.0\n", "").replace("737-free", "found-free")
    (tmp_path / "study.toml").write_text(study, encoding="utf-8")
    setup = (EXAMPLE / "setup.toml").read_text(encoding="utf-8")
    (tmp_path / "setup.toml").write_text(setup.replace("[airframe]", "[airframe]\nthrust_kn = 40.0"), encoding="utf-8")
    run = json.loads(said("sweep", "study.toml", "--json"))["run"]
    again = numbers(said("coefficients", "setup.toml", run, "--output", "again.json", "--json"))
    agree(again, {label: value for label, (value, _) in found.items()})
