"""``finback analyze`` for runs and for models from files: what it says, keeps and refuses; Python says the same."""

from __future__ import annotations

import errno
import json
from functools import cache
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
_PITCH = """schema = "finback/polynomials/1"
state = ["alpha_deg", "q_deg_s"]
parameter = "elevator_deg"
[alpha_dot_deg_s]
q = 1.0
"""
TWO_SINKS = f"""{_PITCH}[q_dot_deg_s2]
q = -1.0
alpha = 5.0
"alpha^3" = -0.01
elevator = 4.0
[range]
elevator_deg = [-20.0, 20.0]
alpha_deg = [-40.0, 40.0]
"""
UNCERTAIN = TWO_SINKS.replace("alpha = 5.0", "alpha = {{ value = 5.0, standard_error = 0.1 }}".format())


def said(*arguments: object) -> str:
    words = tuple(map(str, arguments))
    shipped = arguments[0] in {PUBLISHED, OSCILLATOR, CRUSADER} and "--output" not in words
    return _once(words) if shipped else _given(words)


@cache
def _once(words: tuple[str, ...]) -> str:
    """The same command on a file that nobody changes says the same."""
    return _given(words)


def _given(words: tuple[str, ...]) -> str:
    result = RUNNER.invoke(app, ["analyze", *words, "--quiet"])
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
    assert (found["schema"], found["model"]) == ("finback/analysis-summary/4", str(PUBLISHED))
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


@pytest.mark.parametrize(
    "term", ["", pytest.param('"alpha*q" = 0.01\n"alpha*elevator" = 0.02\n', marks=pytest.mark.slow)]
)
def test_numbers_of_points_come_by_both_roads_where_they_are_asked_for(tmp_path: Path, term: str) -> None:
    """Of a model in Liénard form, and of one that no Liénard form holds; linear intervals are those of the folds."""
    path = tmp_path / "uncertain.toml"
    path.write_text(UNCERTAIN.replace("q = -1.0\n", f"q = -1.0\n{term}"), "utf-8")
    asked = ("--state-range", "q_deg_s=-40:40") if term else ()
    found = document(path, "--sampled", *asked)
    assert found["form"].startswith("planar") == bool(term)
    numbers = {number["name"]: number for number in found["derived"]}
    folds = sorted(
        (one for one in found["located"] if one["kind"] == "fold"), key=lambda one: one["state"]["alpha"]["value"]
    )
    assert len(folds) == 2
    for place, fold in enumerate(folds, start=1):
        number = numbers[f"fold {place} elevator_rad"]
        assert number["determined"]
        assert number["linear_interval"] == pytest.approx(fold["parameter"]["interval"], rel=1e-5)
        assert number["sampled_interval"] == pytest.approx(fold["parameter"]["interval"], rel=0.1)
    assert "derived number" in said(path, "--sampled", *asked)
    assert "derived" not in document(path, *asked)
    assert "longitudinal motion" in refused(2, OSCILLATOR, "--sampled")


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
    assert json.loads(path.read_text(encoding="utf-8"))["schema"] == "finback/planar-analysis/3"


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


def test_an_interval_is_explained_where_one_is_shown(tmp_path: Path) -> None:
    assert "±" not in said(PUBLISHED)
    path = tmp_path / "known.toml"
    path.write_text(UNCERTAIN, encoding="utf-8")
    assert "± is a 95 % interval" in said(path)


def test_every_sink_has_its_region_and_nothing_is_told_twice(tmp_path: Path) -> None:
    """x" = −x' + 5x − x³/100 + 4δ (deg): two sinks between the folds, each with its own region."""
    path = tmp_path / "two.toml"
    path.write_text(TWO_SINKS, encoding="utf-8")
    found = document(path)
    folds = sorted(one["parameter"]["value"] for one in found["located"] if one["kind"] == "fold")
    inside = [region for region in found["regions"] if folds[0] < region["elevator_rad"] < folds[1]]
    sinks = {
        (regime["elevator_seen_rad"], bounds["alpha_rad"]) for regime in found["regimes"] for bounds in regime["bounds"]
    }
    assert {(region["elevator_rad"], region["alpha_rad"]) for region in found["regions"]} == sinks
    assert len(inside) == 2
    assert not any("one sink" in note for note in found["notes"])
    notes = document(PUBLISHED)["notes"]
    assert not any("damping changes its sign" in note for note in notes)  # both are listed as neutral saddles


def test_the_reduced_equation_is_said() -> None:
    """Coefficients of Shi & Fan (2013), Eq. (37), to their printed digits; c₂ with the elevator's rate."""
    found = document(PUBLISHED)["equation"]
    assert found["elevator_gain"]["value"] == pytest.approx(-4.61985706, rel=1e-8)
    assert found["elevator_rate_gain"]["value"] == pytest.approx(-0.0376849006, rel=1e-8)
    assert [one["unit"] for one in found["damping"]] == ["1_s", "1_s_rad", "1_s_rad2"]
    assert [one["unit"] for one in found["force"]] == ["rad_s2", "1_s2", "1_s2_rad", "1_s2_rad2"]
    assert document(OSCILLATOR)["equation"] == {}
    assert "c₂ [1/s]" in said(PUBLISHED)


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
        ((PUBLISHED, "--elevator-range", 20, -40), 2, "--elevator-range 20 -40: the lower end comes first"),
        ((PUBLISHED, "--elevator-range", "nan", 20), 2, "--elevator-range nan 20: a range is two finite numbers"),
        ((PUBLISHED, "--elevator-step", 0), 2, "--elevator-step 0: a step is a finite number > 0"),
        (
            (PUBLISHED, "--elevator-range", -40, 20, "--elevator-step", 1e-5),
            2,
            "the range of the parameter has 6000000",
        ),
        ((PUBLISHED, "--elevator-range", -40, 20, "--parameter-range", -1, 1), 2, "'elevator_deg' is given twice"),
        ((PUBLISHED, "--alpha-range", -4, 2, "--state-range", "alpha_rad=-1:1"), 2, "'alpha_rad': its range is given"),
        ((PUBLISHED, "--state-range", "q_deg_s=-9:9"), 2, "the Liénard form of the model is analyzed at every q_deg_s"),
        (
            (OSCILLATOR, "--elevator-range", -1, 1),
            2,
            "the model has no 'elevator_deg'; expected one of: x_1, y_1, mu_1",
        ),
        ((OSCILLATOR, "--state-range", "x=1:2"), 2, "the model has no 'x'; did you mean 'x_1'?"),
        ((OSCILLATOR, "--state-range", "x_1=1:2", "--state-range", "x_1=1:3"), 2, "'x_1' is given twice"),
        ((OSCILLATOR, "--state-range", "z_1=1:2"), 2, "the model has no 'z_1'"),
        ((OSCILLATOR, "--state-range", "x_1=12"), 2, "--state-range x_1=12: expected NAME=LOW:HIGH"),
        ((OSCILLATOR, "--state-range", "x_1=a:2"), 2, "'a' in 'x_1=a:2' is no number"),
        ((OSCILLATOR, "--state-range", "x_1=2:1"), 2, "--state-range x_1=2:1: the lower end comes first"),
        ((OSCILLATOR, "--hold", "canard_deg"), 2, "--hold canard_deg: expected NAME=VALUE"),
        ((OSCILLATOR, "--hold", "k_1=2"), 2, "no input 'k_1' can be held"),
        ((OSCILLATOR, "--hold", "k=2"), 2, "no input 'k' can be held"),
        ((OSCILLATOR, "--hold", "k_1=inf"), 2, "--hold k_1=inf: a value is a finite number"),
        ((ROOT / "docs" / "examples" / "no.toml",), 2, "file: not found"),
        ((ROOT / "docs",), 2, "docs is no run: it holds neither a study nor a sweep"),
        ((ROOT / "docs" / "examples",), 2, "name a file in it: f8-crusader.toml, f8ii-printed.toml"),
        ((PUBLISHED, "--output", ROOT / "no" / "a.json"), 2, "there is no folder"),
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


def test_a_wrong_schema_does_not_hide_the_other_faults(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    text = OSCILLATOR.read_text(encoding="utf-8")
    path.write_text(text.replace("polynomials/1", "polynomial/1").replace("x = -1.0", "xx = -1.0"), encoding="utf-8")
    said_once = refused(2, path)
    assert "2 faults" in said_once
    assert "schema: 'finback/polynomial/1' is none that this version reads; did you mean" in said_once
    assert "y_dot_1.xx: unknown variable 'xx'" in said_once
    path.write_text("[pitch]\nname = 'a study'\n", encoding="utf-8")  # no model at all: one fault, not one a key
    assert "schema: missing" in refused(2, path)
    assert "pitch" not in refused(2, path)


def test_a_folder_without_a_run_says_what_can_be_analyzed(tmp_path: Path, own_run: Path) -> None:
    alone = tmp_path / "only a model"
    alone.mkdir()
    (alone / "model.json").write_bytes((own_run / "model.json").read_bytes())
    assert f"finback analyze '{alone / 'model.json'}'" in refused(2, alone)
    above = refused(2, own_run.parent)
    assert f"the newest run in it is {own_run}" in above
    assert "name a run" in refused(2, tmp_path)


def test_an_unwritable_output_is_named_as_the_user_named_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(self: Path, *_: object, **__: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device", str(self))

    monkeypatch.setattr(Path, "write_text", full)
    text = refused(2, OSCILLATOR, "--parameter-range", -1, -0.5, "--output", tmp_path / "a.json")
    assert f"{tmp_path / 'a.json'}: No space left on device" in text
    assert ".part" not in text


def test_what_mathematics_refuses_is_3(tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    text = OSCILLATOR.read_text(encoding="utf-8").partition("[y_dot_1]")
    path.write_text(f'{text[0]}[y_dot_1]\n"x*y" = 1.0\n[range]{text[2].partition("[range]")[2]}', encoding="utf-8")
    assert "equilibria are not isolated" in refused(3, path)


@pytest.mark.parametrize("gain", ["1e-250", "1e-300", "{ value = 1e-250, standard_error = 1e-252 }"])
def test_an_elevator_of_next_to_no_effect_is_analyzed_in_silence(gain: str, tmp_path: Path) -> None:
    """Elevators beyond 1e200 rad hold the folds; their intervals overflow. Warnings are errors here."""
    path = tmp_path / "model.toml"
    path.write_text(TWO_SINKS.replace("elevator = 4.0", f"elevator = {gain}"), encoding="utf-8")
    found = document(path)
    folds = [one for one in found["located"] if one["kind"] == "fold"]
    assert len(folds) == 2
    assert all(abs(fold["parameter"]["value"]) > 1e200 for fold in folds)
