"""What the documents print is what the program gives."""

from __future__ import annotations

import contextlib
import io
import json
import math
import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from finback.cli.application import app
from finback.dynamics.equilibrium import equilibria
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.response import ElevatorSchedule, respond
from finback.store import read_model_file

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = ("model.md", "analysis.md", "paper-errata.md")
CUT = "…"
PRINTED = 1e-6  # relative: the documents print ten digits at most, and another machine rounds otherwise
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]\d+)?")
SNIPPET = re.compile(r"^```python\n(.*?)^```\n\n^```text\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)


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


@cache
def output(command: str) -> str:
    """Run a command; each only once, for the files it reads are the same in every test."""
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


def speaks(line: str) -> bool:
    """Tell whether a line is more than blanks and a rule."""
    return bool(set(line) - set(" ─"))


def mismatch(printed: list[str], given: list[str]) -> str:
    """Return the first printed line that is not the next one given, or may not be the last; … stands for any number."""
    rest, skipping = list(given), False
    for line in printed:
        if line == CUT:
            skipping = True
            continue
        while rest and skipping and not alike(line, rest[0]):
            rest.pop(0)
        if not rest or not alike(line, rest.pop(0)):
            return line
        skipping = False
    return "" if skipping or not rest else f"{rest[0]} (given, not printed)"


@pytest.mark.parametrize("name", DOCUMENTS)
@pytest.mark.usefixtures("here")
def test_what_a_document_prints_is_given_line_by_line(name: str) -> None:
    """What is left out is marked."""
    consoles = blocks(name, "console")
    assert consoles
    for block in consoles:
        command, *lines = block.splitlines()
        given = output(command.removeprefix("$ ")).splitlines()
        assert not mismatch([*filter(speaks, lines)], [*filter(speaks, given)])


def test_a_line_left_out_is_seen() -> None:
    given = ["a 1.0", "b 2.0", "c 3.0"]
    assert not mismatch(given, given)
    assert not mismatch(["a 1.0", CUT], given)
    assert not mismatch([CUT, "b 2.0000001", CUT], given)
    for printed in (given[:2], given[1:], given[::2], ["a 1.0", "b 2.1", "c 3.0"], [CUT, "d", CUT], [*given, "d"]):
        assert mismatch(printed, given)


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
    models = [here / "aircraft" / "f8ii" / "published.toml", *sorted((here / "docs" / "examples").glob("*.toml"))]
    for model in (path.relative_to(here) for path in models):
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
    first, second = blocks("analysis.md", "python")
    # 14.7252 and -35.1293 deg, in rad: Shi & Fan (2013), section 5.
    folds = [0.2570035, -0.6131224]
    assert last_of(first, names) == pytest.approx(folds, abs=1e-7)
    assert sorted(last_of(second, names)) == pytest.approx(sorted(folds), abs=1e-7)
    assert f"{names['history'].alpha_rad[-1]:.5f}" in second
    jump = respond(
        names["system"],
        ElevatorSchedule.stepped(0.0, before_rad=0.0, after_rad=-0.1),
        time_s=[0.0],
        alpha_rad=0.0,
        alpha_dot_rad_s=0.0,
    ).alpha_dot_rad_s[0]
    assert jump == -0.1 * names["system"].elevator_rate_gain


@pytest.mark.usefixtures("here")
def test_the_page_on_identification_does_what_it_says() -> None:
    names: dict[str, Any] = {}
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        for block in blocks("identification.md", "python"):
            exec(block, names)  # noqa: S102 - the documents are ours
    slope = names["truth"].q_dot.coefficient(alpha_rad=1)
    assert names["found"].model.q_dot.coefficient(alpha_rad=1) == pytest.approx(slope, rel=0.05)
    assert "not checked" in out.getvalue()
    assert "calm air" in out.getvalue()
    assert "fold 2 elevator_rad" in out.getvalue()
    assert "alpha" in names["implicit"].model.alpha_dot.labels()


def last_of(block: str, names: dict[str, Any]) -> Any:
    """Run a block and return the value of its last line."""
    *lines, last = block.strip().splitlines()
    exec("\n".join(lines), names)  # noqa: S102 - the documents are ours
    return eval(last, names)  # noqa: S307 - ours


def sections() -> dict[str, str]:
    """Return heading -> text of the numbered sections of the errata."""
    text = (ROOT / "docs" / "paper-errata.md").read_text(encoding="utf-8")
    parts = re.split(r"^## (\d+\. .*)$", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def last_digit(number: str) -> float:
    """Return a unit of the last digit of a printed number; 0 for a whole one, which must be met."""
    mantissa, _, exponent = number.partition("e")
    digits = len(mantissa.partition(".")[2])
    return math.pow(10.0, int(exponent or 0) - digits) if digits else 0.0


@cache
def snippets() -> tuple[tuple[str, str, str], ...]:
    """Return heading, code and printed output of every snippet of the errata."""
    return tuple((title, *found) for title, text in sections().items() for found in SNIPPET.findall(text))


@pytest.mark.parametrize(("code", "printed"), [pytest.param(*found, id=title) for title, *found in snippets()])
@pytest.mark.usefixtures("here")
def test_every_snippet_of_the_errata_prints_what_stands_below_it(code: str, printed: str) -> None:
    """To a unit of the last printed digit: a number at a tie may be rounded otherwise on another machine."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(code, {})  # noqa: S102 - the documents are ours
    given = out.getvalue()
    assert NUMBER.sub("#", given).split() == NUMBER.sub("#", printed).split()
    for mine, theirs in zip(NUMBER.findall(given), NUMBER.findall(printed), strict=True):
        assert float(mine) == pytest.approx(float(theirs), rel=1e-15, abs=1.001 * last_digit(theirs))


def test_every_erratum_stands_in_the_table_and_has_a_command() -> None:
    text = (ROOT / "docs" / "paper-errata.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \[(\d+)\]\(#(\S+)\) \|", text, flags=re.MULTILINE)
    slugs = [re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in sections()]
    assert [anchor for _, anchor in rows] == slugs
    assert [int(number) for number, _ in rows] == list(range(1, len(rows) + 1))
    assert {title for title, *_ in snippets()} == set(sections())
    assert len(snippets()) == text.count("```python") == text.count("```text")


@pytest.mark.usefixtures("here")
def test_the_printed_equation_of_the_f8ii_gives_the_reference_values() -> None:
    """Reference: three methods in 130-bit arithmetic on the printed digits of Shi & Fan (2013), Eq. (37)."""
    given = json.loads(output("finback analyze docs/examples/f8ii-printed.toml --json"))["located"]

    def elevators(kind: str) -> list[float]:
        return sorted(math.degrees(one["parameter"]["value"]) for one in given if one["kind"] == kind)

    assert elevators("fold") == pytest.approx([-35.1293238979, 14.7252153801], rel=0, abs=1e-10)
    # double precision keeps 1e-13 of the sum of the terms
    assert elevators("heteroclinic") == pytest.approx([-18.3068198203387, -2.11863437866778], rel=0, abs=1e-12)
