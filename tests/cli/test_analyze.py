"""``finback analyze`` for runs and for models from files: what it says, keeps and refuses; Python says the same."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from finback.cli.application import app
from finback.dynamics.analysis import Analysis, AnalysisOptions, analyze
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.located import located
from finback.dynamics.located_planar import located_planar
from finback.dynamics.planar.analysis import PlanarAnalysis, PlanarAnalysisOptions, analyze_planar
from finback.dynamics.planar.system import PlanarSystem
from finback.store import load_analysis, read_analysis_alone, read_model_file
from finback.store.codec import to_tree
from finback.units import to_si

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = ROOT / "aircraft" / "f8ii" / "published.toml"
OSCILLATOR = ROOT / "docs" / "examples" / "van-der-pol.toml"
CRUSADER = ROOT / "docs" / "examples" / "f8-crusader.toml"
RUNNER = CliRunner()


def said(*arguments: object) -> str:
    result = RUNNER.invoke(app, ["analyze", *map(str, arguments), "--quiet"])
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    return result.stdout


def document(*arguments: object) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(said(*arguments, "--json"))
    return found


def refused(code: int, *arguments: object) -> str:
    result = RUNNER.invoke(app, ["analyze", *map(str, arguments), "--quiet"])
    assert (result.exit_code, result.stdout) == (code, "")
    return result.stderr


def plain(value: object) -> Any:
    """What a value is after it has been JSON: numbers are written so that they come back bit for bit."""
    return json.loads(json.dumps(to_tree(value)))


# the numbers are those of Python


def test_a_published_model_by_command_and_by_python() -> None:
    found = document(PUBLISHED, "--elevator-range", -40, 20, "--elevator-step", 4, "--alpha-range", -45, 55)
    system = read_model_file(PUBLISHED).system()
    assert isinstance(system, LienardSystem)
    options = AnalysisOptions(
        elevator_range_rad=(to_si(-40.0, "deg"), to_si(20.0, "deg")),
        elevator_step_rad=to_si(4.0, "deg"),
        alpha_range_rad=(to_si(-45.0, "deg"), to_si(55.0, "deg")),
    )
    analysis = analyze(system, options)
    assert found["located"] == plain(located(analysis))
    assert found["options"] == plain(options)
    assert found["notes"] == list(analysis.notes)
    assert [region["area_rad2_s"] for region in found["regions"]] == [region.area_rad2_s for region in analysis.regions]
    assert (found["schema"], found["model"]) == ("finback/analysis-summary/3", str(PUBLISHED))
    assert (found["form"], found["stored"]) == ("lienard", "")


def test_a_planar_model_by_command_and_by_python() -> None:
    found = document(
        *(OSCILLATOR, "--parameter-range", -0.5, 1, "--parameter-step", 0.1),
        *("--state-range", "x_1=-3:3", "--state-range", "y_1 = -2 : 2.5"),
    )
    system = read_model_file(OSCILLATOR).system()
    assert isinstance(system, PlanarSystem)
    options = PlanarAnalysisOptions(
        parameter_range=(-0.5, 1.0), parameter_step=0.1, first_range=(-3.0, 3.0), second_range=(-2.0, 2.5)
    )
    assert found["located"] == plain(located_planar(analyze_planar(system, options)))
    assert found["options"] == plain(options)
    (region,) = found["regions"]  # at mu = -0.25, halfway to the Hopf point
    assert (region["parameter"], region["boundary"]) == (-0.25, [])
    (family,) = found["cycle_families"]
    assert family["ends"][0] == "hopf"
    assert len(family["parameter"]) == len(family["period"])
    assert found["cycle_absence"]["verdict"] == "found"
    assert found["cycle_absence"]["statement"] in found["notes"]
    assert found["form"] == "planar: the states are not alpha and q over the elevator"


def test_every_object_states_all_that_the_layout_asks() -> None:
    objects = [*document(PUBLISHED)["located"], *document(CRUSADER)["located"]]
    kinds = {one["kind"] for one in objects}
    assert {"equilibrium", "fold", "hopf", "heteroclinic"} <= kinds
    for one in objects:
        assert set(one) == {"kind", "parameter", "state", "properties", "words", "residual", "brackets", "in_domain"}
        assert set(one["parameter"]) == {"name", "value", "unit", "interval"}
        assert one["state"]
        assert one["residual"]
        for number in (*one["state"].values(), *one["properties"].values(), *one["residual"].values()):
            assert isinstance(number["value"], float)
            assert number["unit"]
        assert isinstance(one["in_domain"], bool)


def test_the_ranges_of_the_file_come_before_natural_ones_and_after_the_commands() -> None:
    assert document(OSCILLATOR)["options"]["parameter_range"] == [-1.0, 2.0]
    assert document(OSCILLATOR, "--parameter-range", 0.5, 1)["options"]["parameter_range"] == [0.5, 1.0]
    # In pitch, with terms that the Liénard form cannot hold: the same options in degrees, and any state by its name.
    found = document(CRUSADER, "--elevator-range", -5, 5, "--state-range", "q_deg_s=-60:60", "--parameter-step", 0.05)
    assert found["options"]["parameter_range"] == [to_si(-5.0, "deg"), to_si(5.0, "deg")]
    assert found["options"]["second_range"] == [to_si(-60.0, "deg"), to_si(60.0, "deg")]
    assert found["options"]["first_range"] == [-0.6, 0.6]
    assert found["options"]["parameter_step"] == 0.05
    assert "alpha^2*q in alpha_dot" in found["form"]


def test_a_held_input_moves_the_folds(tmp_path: Path) -> None:
    path = tmp_path / "with-canard.toml"
    text = PUBLISHED.read_text(encoding="utf-8")
    path.write_text(text.replace("elevator = -4.67496672860152", "elevator = -4.67496672860152\ncanard = 1.0"), "utf-8")
    folds = {}
    for canard in (0.0, 2.0):
        found = document(path, "--hold", f"canard_deg={canard}")["located"]
        folds[canard] = [one["parameter"]["value"] for one in found if one["kind"] == "fold"]
    # g gains 0.98471 * 1.0 * 2 deg/s², which c₁ = -4.61986 turns into 0.42629 deg of elevator.
    shift = to_si(0.98471492754086 * 2.0 / 4.61985706111, "deg")
    assert [b - a for a, b in zip(folds[0.0], folds[2.0], strict=True)] == pytest.approx([shift, shift], rel=1e-10)


def test_an_input_held_outside_its_data_is_said_once(tmp_path: Path) -> None:
    path = tmp_path / "with-canard.toml"
    text = PUBLISHED.read_text(encoding="utf-8")
    text = text.replace("elevator = -4.67496672860152", "elevator = -4.67496672860152\ncanard = 1.0")
    path.write_text(f"{text}[domain]\ncanard_deg = [-5.0, 5.0]\n", "utf-8")
    inside, outside = (document(path, "--hold", f"canard_deg={canard}") for canard in (5, 5.5))
    assert all(one["in_domain"] for one in inside["located"])
    assert not any(one["in_domain"] for one in outside["located"])
    said_so = [note for note in outside["notes"] if "held where no data" in note]
    assert len(said_so) == 1
    assert not any("inf" in note for note in outside["notes"])


# what is kept


def test_an_analysis_is_kept_where_the_user_says(tmp_path: Path) -> None:
    path = tmp_path / "analysis.json"
    found = document(PUBLISHED, "--output", path)
    assert found["stored"] == str(path)
    tree = json.loads(path.read_text(encoding="utf-8"))
    assert tree["schema"] == "finback/analysis/3"
    assert tree["located"] == found["located"]
    assert list(tree["provenance"]["inputs"]) == ["published.toml"]
    analysis = read_analysis_alone(path)
    assert isinstance(analysis, Analysis)
    assert plain(located(analysis)) == found["located"]
    planar = document(OSCILLATOR, "--output", path)
    again = read_analysis_alone(path)
    assert isinstance(again, PlanarAnalysis)
    assert plain(located_planar(again)) == planar["located"]
    assert json.loads(path.read_text(encoding="utf-8"))["schema"] == "finback/planar-analysis/2"


def test_a_run_keeps_its_own_analysis_only(own_run: Path, tmp_path: Path) -> None:
    path = own_run / "analysis.json"
    before = path.read_bytes()
    own = document(own_run)
    assert own["stored"] == str(path)
    assert own["located"] == json.loads(path.read_text(encoding="utf-8"))["located"]
    other = tmp_path / "wide.json"
    text = said(own_run, "--elevator-step", 10, "--output", other)
    assert f"stored   {other}" in text
    assert path.read_bytes() == before
    wide = read_analysis_alone(other)
    assert isinstance(wide, Analysis)
    assert wide.options.elevator_step_rad == to_si(10.0, "deg")
    assert wide.options.alpha_range_rad == load_analysis(own_run).options.alpha_range_rad
    assert "stored   nowhere" in said(own_run, "--alpha-range", -20, 40)
    # The model alone is analyzed where its data lie.
    alone = document(own_run / "model.json")
    assert alone["stored"] == ""
    domain = load_analysis(own_run).system.domain
    assert alone["options"]["alpha_range_rad"] == domain[0].tolist()
    assert all(one["in_domain"] for one in alone["located"] if one["kind"] == "fold")


# tables


def test_tables_of_any_model() -> None:
    text = said(PUBLISHED)
    for words in (
        "14.72521538",
        "-35.12932391",
        "heteroclinic",
        "neutral-saddle",
        "stability region",
        "form     lienard",
    ):
        assert words in text
    text = said(CRUSADER)
    assert "alpha [deg]" in text
    assert "subcritical" in text
    assert "form     planar: the Liénard form cannot hold alpha*q in alpha_dot" in text
    text = said(OSCILLATOR)
    assert "mu" in text
    assert "-0.125" in text
    assert "supercritical" in text


def test_help_teaches() -> None:
    text = RUNNER.invoke(app, ["analyze", "--help"], env={"COLUMNS": "120"}).stdout
    for words in (
        "--elevator-range",
        "--parameter-range",
        "--state-range",
        "--hold",
        "docs/model.md",
        "published.toml",
    ):
        assert words in text


# mistakes


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        ((PUBLISHED, "--elevator-range", 20, -40), 2, "is empty"),
        ((PUBLISHED, "--elevator-step", 0), 2, "is not a step"),
        (
            (OSCILLATOR, "--elevator-range", -1, 1),
            2,
            "the model has no 'elevator_deg'; expected one of: x_1, y_1, mu_1",
        ),
        ((OSCILLATOR, "--state-range", "x=1:2"), 2, "'x' names no unit"),
        ((OSCILLATOR, "--state-range", "z_1=1:2"), 2, "the model has no 'z_1'"),
        ((OSCILLATOR, "--state-range", "x_1=12"), 2, "--state-range x_1=12: expected NAME=LOW:HIGH"),
        ((OSCILLATOR, "--state-range", "x_1=a:2"), 2, "'a' in 'x_1=a:2' is no number"),
        ((OSCILLATOR, "--state-range", "x_1=2:1"), 2, "is no range"),
        ((OSCILLATOR, "--hold", "canard_deg"), 2, "--hold canard_deg: expected NAME=VALUE"),
        ((OSCILLATOR, "--hold", "k_1=2"), 2, "no input 'k_1' can be held"),
        ((ROOT / "docs" / "examples" / "no.toml",), 2, "file: not found"),
        ((ROOT / "docs",), 2, "model.json is missing"),
        ((PUBLISHED, "--output", ROOT), 2, "with a MODEL, --output names the file to write"),
    ],
)
def test_a_mistake_is_2_and_says_what_to_mend(arguments: tuple[object, ...], code: int, says: str) -> None:
    assert says in refused(code, *arguments)


def test_all_faults_of_a_file_are_said_at_once(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text(OSCILLATOR.read_text(encoding="utf-8").replace("x = -1.0", "xx = -1.0\nz = 1"), encoding="utf-8")
    text = refused(2, path)
    assert "2 faults" in text
    assert "y_dot_1.xx: unknown variable 'xx'; did you mean 'x'?" in text
    assert "y_dot_1.z: unknown variable 'z'" in text


def test_what_mathematics_refuses_is_3(tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    text = OSCILLATOR.read_text(encoding="utf-8").partition("[y_dot_1]")
    path.write_text(f'{text[0]}[y_dot_1]\n"x*y" = 1.0\n[range]{text[2].partition("[range]")[2]}', encoding="utf-8")
    assert "equilibria are not isolated" in refused(3, path)
