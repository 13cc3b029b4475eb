"""What docs/model.md and docs/analysis.md print is what the program gives."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from finback.cli.application import app
from finback.dynamics.equilibrium import equilibria
from finback.dynamics.lienard import LienardSystem
from finback.store import read_model_file

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = ("model.md", "analysis.md")
PRINTED = 1e-6  # relative: the documents print ten digits at most, and another machine rounds otherwise
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]\d+)?")


def blocks(name: str, language: str) -> list[str]:
    """Return the fenced blocks of a document in one language."""
    text = (ROOT / "docs" / name).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the shipped files and the files that the documents name."""
    for folder in ("docs", "aircraft"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    for name in DOCUMENTS:
        for block in blocks(name, "toml"):
            if title := re.match(r"# (\S+\.toml)\n", block):
                (tmp_path / title[1]).write_text(block, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def output(command: str) -> str:
    program, *arguments = command.split()
    assert program == "finback"
    result = CliRunner().invoke(app, [*arguments, "--quiet"])
    assert result.exit_code == 0, result.stderr
    return result.stdout


def alike(printed: str, given: str) -> bool:
    """Tell whether two lines say the same, numbers within rounding."""
    if NUMBER.sub("#", printed).split() != NUMBER.sub("#", given).split():
        return False
    pairs = zip(NUMBER.findall(printed), NUMBER.findall(given), strict=True)
    return all(float(a) == pytest.approx(float(b), rel=PRINTED, abs=1e-12) for a, b in pairs)


@pytest.mark.parametrize("name", DOCUMENTS)
@pytest.mark.usefixtures("here")
def test_every_line_that_a_document_prints_is_given_in_that_order(name: str) -> None:
    """More may be given than a document prints."""
    consoles = blocks(name, "console")
    assert consoles
    for block in consoles:
        command, *lines = block.splitlines()
        given = iter(output(command.removeprefix("$ ")).splitlines())
        for line in lines:
            if set(line) - set(" ─"):
                assert any(alike(line, candidate) for candidate in given), line


def close(printed: Any, given: Any) -> bool:
    """Tell whether two JSON values are the same, numbers within rounding."""
    if isinstance(printed, dict):
        return set(printed) == set(given) and all(close(value, given[key]) for key, value in printed.items())
    if isinstance(printed, list):
        return len(printed) == len(given) and all(close(a, b) for a, b in zip(printed, given, strict=True))
    if isinstance(printed, float):
        return bool(given == pytest.approx(printed, rel=1e-9, abs=1e-12))
    return bool(printed == given)


@pytest.mark.usefixtures("here")
def test_the_object_that_is_printed_in_full() -> None:
    (block,) = blocks("analysis.md", "json")
    printed = json.loads(block)
    command = next(line for line in blocks("analysis.md", "console") if "published.toml" in line).splitlines()[0]
    given = json.loads(output(f"{command.removeprefix('$ ')} --json"))["located"]
    assert close(printed, next(one for one in given if one["kind"] == printed["kind"]))


def test_every_kind_that_is_found_is_described(here: Path) -> None:
    text = (ROOT / "docs" / "analysis.md").read_text(encoding="utf-8")
    described = set(re.findall(r"^\| `([a-z-]+)`(?: \(planar\))? \|", text, flags=re.MULTILINE))
    for model in (*sorted((here / "docs" / "examples").glob("*.toml")), here / "aircraft" / "f8ii" / "published.toml"):
        found = {one["kind"] for one in json.loads(output(f"finback analyze {model} --json"))["located"]}
        assert found <= described
    assert {"equilibrium", "fold", "hopf", "heteroclinic", "branch-point"} <= described


def test_the_model_json_that_is_printed_is_a_model(tmp_path: Path) -> None:
    (block,) = blocks("model.md", "json")
    path = tmp_path / "model.json"
    path.write_text(block, encoding="utf-8")
    system = read_model_file(path).system()
    assert isinstance(system, LienardSystem)
    (point,) = equilibria(system, 0.1)
    assert point.alpha_rad == pytest.approx(-0.05, rel=1e-14)
    assert system.damping(0.0) == -0.5


def test_the_covariance_that_is_printed_can_be_read(tmp_path: Path) -> None:
    (block,) = (block for block in blocks("model.md", "toml") if block.startswith("[covariance]"))
    path = tmp_path / "model.toml"
    path.write_text(
        'schema = "finback/polynomials/1"\nstate = ["alpha_deg", "q_deg_s"]\nparameter = "elevator_deg"\n'
        '[alpha_dot_deg_s]\nq = 1.0\nalpha = -0.5\n[q_dot_deg_s2]\n"alpha^2" = 0.1\nelevator = -4.0\n' + block,
        encoding="utf-8",
    )
    covariance = read_model_file(path).covariance
    assert covariance[1, 1] == pytest.approx(4e-4)
    assert (covariance != 0.0).sum() == 4


@pytest.mark.usefixtures("here")
def test_the_python_that_is_printed_runs() -> None:
    (block,) = blocks("model.md", "python")
    names: dict[str, Any] = {}
    exec(block, names)  # noqa: S102 - the documents are ours
    assert names["model"].inputs == ("canard_rad",)
    assert isinstance(names["system"], LienardSystem)
    (block,) = blocks("analysis.md", "python")
    *lines, last = block.strip().splitlines()
    exec("\n".join(lines), names)  # noqa: S102 - the documents are ours
    # 14.7252 and -35.1293 deg, in rad: Shi & Fan (2013), section 5.
    assert eval(last, names) == pytest.approx([0.2570035, -0.6131224], abs=1e-7)  # noqa: S307 - ours
