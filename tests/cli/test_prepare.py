"""``finback prepare`` and what follows: a logger's table to a model and its analysis, and every way to break one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from finback.cli.application import app
from finback.dynamics.trajectory import free_run
from finback.errors import StudyError
from finback.pipeline import recording_of
from finback.pipeline.prepare import _names
from finback.pipeline.recorded import identification_of_records
from finback.store import load_identification, load_sweep, read_model_file
from finback.study.recorded import SECTIONS, read_recorded_study
from finback.units import from_si, to_si
from finback.views.recording import read_state

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = ROOT / "aircraft" / "f8ii" / "published.toml"
AIRSPEED_M_S = 295.07
MAP = """
schema = 1
name = "foreign"

[condition]
airspeed_m_s = 295.07
density_kg_m3 = 0.26548
gravity_m_s2 = 9.80665
altitude_m = 13026.6

[table]
hold = "zoh"
skip_lines = 1

[columns]
t = "time_ms"
AoA = "alpha_deg"
q = "q_deg_s"
stick = "elevator_deg"
pitch = "theta_deg"
TAS = "airspeed_kt"

[factors]
elevator = -1.0
"""
FLIGHTS = {"low": (-3.5, 2.0, 3.0), "middle": (-16.0, 9.0, 3.0), "high": (-27.0, 16.0, 1.5)}


def _frame(seed: int, trim_deg: float, alpha_deg: float, amplitude_deg: float) -> pd.DataFrame:
    """Fly the published model, with alpha at a vane 6 m ahead, in the units and names of somebody else."""
    truth, random = read_model_file(PUBLISHED).model(), np.random.default_rng(seed)
    time = 0.01 * np.arange(1501)
    piece = np.searchsorted(1.0 + 0.7 * np.array([0, 3, 5, 6, 7]), time + 1e-9, side="right")
    elevator = to_si(trim_deg + amplitude_deg * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[piece], "deg")
    state = free_run(
        truth, time_s=time, elevator_rad=elevator, hold="zoh", alpha_rad=to_si(alpha_deg, "deg"), q_rad_s=0.0
    )
    alpha, q = state.T
    theta = alpha[0] + np.concatenate([[0.0], np.cumsum(0.005 * (q[1:] + q[:-1]))])
    vane = np.arctan2(AIRSPEED_M_S * np.sin(alpha) - 6.0 * q, AIRSPEED_M_S * np.cos(alpha))
    noise = random.standard_normal((4, time.size))
    return pd.DataFrame(
        {
            "t": 1000.0 * time,
            "AoA": from_si(vane, "deg") + 0.1 * noise[0],
            "q": from_si(q, "deg_s") + 0.1 * noise[1],
            "stick": -from_si(elevator, "deg"),
            "pitch": from_si(theta, "deg") + 0.05 * noise[2],
            "TAS": from_si(AIRSPEED_M_S, "kt") + 0.5 * noise[3],
        }
    )


def _written(frame: pd.DataFrame, path: Path) -> str:
    with path.open("w") as file:
        file.write("logger 3.1\n")
        frame.to_csv(file, index=False)
    return str(path)


def _run(*words: str) -> tuple[int, str, str]:
    found = CliRunner().invoke(app, [*words])
    return found.exit_code, found.stdout, found.stderr


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "map.toml").write_text(MAP + "[places]\nvane_m = [6.0, 0.0, 0.0]\n")
    return tmp_path


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    return _frame(0, *FLIGHTS["low"])


def test_a_loggers_table_becomes_a_model_and_its_analysis(folder: Path) -> None:
    """The vane stands 6 m ahead: q·6/V; without moving it back the coefficient of q in dα/dt is 2 % off, 15 errors."""
    files = [
        _written(_frame(seed, *flight), folder / f"{name}.csv") for seed, (name, flight) in enumerate(FLIGHTS.items())
    ]
    code, said, _ = _run("prepare", *files, "--map", "map.toml", "--json", "--quiet")
    assert code == 0
    document = json.loads(said)
    assert document["schema"] == "finback/preparation/1"
    assert [flight["name"] for flight in document["flights"]] == list(FLIGHTS)
    assert any("moved from the vane" in line for line in document["flights"][0]["changed"])
    run = Path(document["run"])
    assert "moved from the vane" in load_sweep(run)["low"].provenance["changed"]
    assert _run("identify", str(run), "--method", "output-error", "--json")[0] == 0
    found = load_identification(run)
    truth = read_model_file(PUBLISHED).model()
    errors = found.model.with_coefficients(found.standard_errors)
    for polynomial, exact, error in (
        (found.model.alpha_dot, truth.alpha_dot, errors.alpha_dot),
        (found.model.q_dot, truth.q_dot, errors.q_dot),
    ):
        for powers in ({"q_rad_s": 1}, {"alpha_rad": 1}, {"alpha_rad": 3}, {"elevator_rad": 1}):
            off = polynomial.coefficient(**powers) - exact.coefficient(**powers)
            assert abs(off) < 4.5 * error.coefficient(**powers), powers
    code, said, _ = _run("analyze", str(run), "--json")
    assert code == 0
    assert json.loads(said)
    code, _, complaint = _run("validate", str(run))
    assert code == 3
    assert "were recorded: there is no simulator" in complaint
    (run / "analysis.json").write_text("{}")  # of an older version: to renew it would be in vain
    code, _, complaint = _run("validate", str(run))
    assert code == 3
    assert "were recorded: there is no simulator" in complaint
    code, _, complaint = _run("report", str(run))
    assert code == 3  # not "make it with finback validate", which would refuse
    assert "were recorded: there is no simulator" in complaint


def test_files_of_one_name_in_several_folders_have_names_of_their_own() -> None:
    paths = [Path(name) for name in ("a.csv", "b/a.csv", "a-2.csv", "c/a.csv", "b/a-2.csv", "d.csv")]
    assert _names(paths) == ["a", "a-3", "a-2", "a-4", "a-2-2", "d"]


def test_what_a_logger_does_to_a_table_is_said_and_mended(folder: Path, frame: pd.DataFrame) -> None:
    spoiled = frame.copy()
    spoiled.loc[300, "AoA"] = 80.0
    spoiled.loc[500:503, "q"] = np.nan
    spoiled["pitch"] = frame["pitch"].iloc[np.arange(len(frame)) // 4 * 4].to_numpy()  # 25 Hz, written again
    spoiled = pd.concat([spoiled.iloc[:700], spoiled.iloc[699:]])
    code, said, _ = _run("prepare", _written(spoiled, folder / "a.csv"), "--map", "map.toml", "--json", "--quiet")
    assert code == 0
    changed = " | ".join(json.loads(said)["flights"][0]["changed"])
    for expected in (
        "1 of 1502 rows left out, whose time does not go on, the first at row 700",
        "alpha_rad: 1 outliers of 1501 samples left out, the first at 3 s",
        "theta_rad: one new value in 4 rows; the repeats left out",
        "q_rad_s: 0 of 1501 rows interpolated, 4 left missing",
    ):
        assert expected in changed


def test_a_parquet_table_is_read_too(folder: Path, frame: pd.DataFrame) -> None:
    frame.to_parquet(folder / "a.parquet")
    code, said, _ = _run("prepare", "a.parquet", "--map", "map.toml", "--quiet")
    assert code == 0
    assert "a: 1501 rows, 15 s" in said
    assert "finback identify" in said


def test_prepared_flights_have_recordings_of_their_numbers(folder: Path, frame: pd.DataFrame) -> None:
    spoiled = frame.copy()
    spoiled.loc[500:520, "q"] = np.nan  # a gap stays one
    files = [_written(spoiled, folder / name) for name in ("a.csv", "b c.csv")]
    code, _, _ = _run("prepare", *files, "--map", "map.toml", "--json", "--quiet")
    assert code == 0
    run = next(folder.glob("logs/*/*"))
    for record in load_sweep(run).records:
        path, made = recording_of(run, record.name)
        assert not made
        state = read_state(path)
        assert {name: values.tobytes() for name, values in state.items()} == {
            name: values.tobytes() for name, values in record.columns.items()
        }
    code, _, complaint = _run("replay", "d", str(run))
    assert code == 2
    assert "recorded flights: a, b c" in complaint


def test_faults_of_the_map_and_of_every_table_come_together(folder: Path, frame: pd.DataFrame) -> None:
    files = [
        _written(frame.drop(columns="stick").assign(q="x"), folder / "a.csv"),
        _written(frame.drop(columns=["pitch", "AoA"]), folder / "b.csv"),
    ]
    lacking = [f"the table has no column '{name}'" for name in ("stick", "pitch", "AoA")]
    code, _, said = _run("prepare", *files, str(folder / "none.csv"), "--map", "map.toml", "--quiet")
    assert code == 2
    for line in (*lacking, "a.csv, line 3, column 'q': 'x' is no number", "none.csv is not there"):
        assert line in said
    (folder / "map.toml").write_text(MAP.replace('"theta_deg"', '"theta_degg"'))
    code, _, said = _run("prepare", *files, "--map", "map.toml", "--quiet")
    assert code == 2
    for line in ("columns.pitch:", *lacking):
        assert line in said
    assert not list(folder.glob("logs/*/*"))


def test_the_map_of_the_documents_is_one(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "data.md").read_text(encoding="utf-8")
    (tmp_path / "records.toml").write_text(text.split("```toml\n")[1].split("```")[0], encoding="utf-8")
    study = read_recorded_study(tmp_path / "records.toml")
    assert study.columns["nz"] == "az_g"
    assert study.preparation.compatibility.sizes["theta bias"] == pytest.approx(to_si(0.1, "deg"))
    assert study.preparation.places.vane_upwash == 1.1
    assert study.identification[0].nuisances.alpha_bias_rad == pytest.approx(to_si(0.2, "deg"))
    assert study.analysis[0].elevator_step_rad == pytest.approx(to_si(0.5, "deg"))
    for section in SECTIONS:
        assert f"[{section}]" in text


def _jumped(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(t=np.where(np.arange(len(frame)) < 700, frame["t"], frame["t"] - 5000.0))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda frame: frame.iloc[:0], "has names of columns and no row"),
        (lambda frame: frame.iloc[:1], "has 1 samples"),
        (lambda frame: frame.drop(columns="stick"), "no column 'stick'"),
        (lambda frame: frame.assign(AoA="x"), "line 3, column 'AoA': 'x' is no number"),
        (_jumped, "a clock that was set back"),
        (lambda frame: frame.assign(t=np.nan), "time does not increase"),
        (lambda frame: frame.assign(stick=np.nan), "the elevator has no number at all"),
    ],
)
def test_what_cannot_be_read_is_named_with_its_file(
    folder: Path, frame: pd.DataFrame, spoil: Callable[[pd.DataFrame], pd.DataFrame], said: str
) -> None:
    code, _, complaint = _run("prepare", _written(spoil(frame), folder / "a.csv"), "--map", "map.toml", "--quiet")
    assert code in {2, 3}
    assert said in complaint
    assert not list(folder.glob("logs/*/*"))


def test_all_faults_of_a_map_come_together(folder: Path) -> None:
    (folder / "map.toml").write_text(
        MAP.replace('hold = "zoh"', 'hold = "zho"')
        .replace("elevator = -1.0", 'elevator = "x"')
        .replace("gravity_m_s2 = 9.8", "gravity_m_s2 = -9.8")
        .replace('"theta_deg"', '"theta_degg"')
        .replace('"airspeed_kt"', '"alpha_rad"')
        + '[instruments]\nteta_bias_deg = 1.0\nalpha_bias_m = 1.0\n[prepar]\n[identification]\nmethod = "best"\n'
    )
    code, _, said = _run("prepare", "a.csv", "--map", "map.toml")
    assert code == 2
    for place in ("table.hold", "factors.elevator", "instruments.teta_bias_deg", "instruments.alpha_bias_m", "prepar:",
                  "identification.method", "condition.gravity_m_s2", "columns.pitch:", "columns.TAS:"):  # fmt: skip
        assert place in said


@pytest.mark.parametrize("line", ['separator = "."', 'thousands = "."', 'decimal = ","\nseparator = ","'])
def test_a_decimal_sign_that_separates_cells_is_refused(folder: Path, line: str) -> None:
    """As in a map of ``finback compare``; such a table could not be read."""
    (folder / "map.toml").write_text(MAP.replace("skip_lines = 1", line))
    with pytest.raises(StudyError, match=r"table\.decimal: cannot separate cells or groups and be the decimal sign"):
        read_recorded_study(folder / "map.toml")


def test_what_is_known_of_instruments_is_used_and_faults_are_taken_out_on_request(
    folder: Path, frame: pd.DataFrame
) -> None:
    late = frame.assign(pitch=np.interp(frame["t"] - 50.0, frame["t"], frame["pitch"]))
    file = _written(late, folder / "a.csv")
    (folder / "map.toml").write_text(MAP + "[instruments]\nq_scale_1 = 0.0\ntheta_bias_deg = 0\n")
    code, said, _ = _run("prepare", file, "--map", "map.toml", "--json", "--quiet")
    assert code == 0
    (flight,) = json.loads(said)["flights"]
    faults = {error["name"]: error for error in flight["instruments"]}
    assert "q scale" not in faults
    assert faults["theta delay"]["value"] == pytest.approx(0.05, abs=4.0 * faults["theta delay"]["standard_error"])
    assert any(line.startswith("theta delay") and line.endswith("left in") for line in flight["found"])
    _, said, _ = _run("prepare", file, "--map", "map.toml", "--correct", "--json", "--quiet")
    (flight,) = json.loads(said)["flights"]
    assert any(line.startswith("theta delay") and line.endswith("taken out") for line in flight["changed"])


def test_an_airspeed_against_the_maps_condition_is_said_by_prepare_and_identify(
    folder: Path, frame: pd.DataFrame
) -> None:
    files = [_written(frame, folder / name) for name in ("a.csv", "b.csv")]
    (folder / "map.toml").write_text(
        MAP.replace('TAS = "airspeed_kt"', 'TAS = "airspeed_m_s"') + "[prepare]\nsame_instruments = true\n"
    )
    code, said, _ = _run("prepare", *files, "--map", "map.toml", "--quiet")
    assert code == 0
    # What holds for both flights stands there once.
    assert said.count("numbers in kt taken for m/s?") == 1
    lines = [line for line in said.splitlines() if line.startswith("  found")]
    assert len(lines) == len(set(lines)) > 2
    assert said.count("fault ± 95 %") == 1
    assert "all 2 flights" in said
    code, _, warned = _run("identify", "--quiet")
    assert code == 0
    assert warned.count("the map's condition says 295.1 m/s (numbers in kt taken for m/s?)") == 1
    assert "no interval holds what the check of the instruments does not tell: alpha bias" in warned
    (folder / "map.toml").write_text(MAP)
    _, said, _ = _run("prepare", files[0], "--map", "map.toml", "--quiet")
    assert "the map's condition" not in said


def test_faults_are_read_in_degrees(folder: Path, frame: pd.DataFrame) -> None:
    file = _written(frame.assign(q=frame["q"] + 1.0), folder / "a.csv")
    (folder / "map.toml").write_text(MAP + "[instruments]\nq_scale_1 = 0.0\ntheta_scale_1 = 0\n")
    code, said, _ = _run("prepare", file, "--map", "map.toml", "--quiet")
    assert code == 0
    (line,) = [line for line in said.splitlines() if line.strip().startswith("found    q bias")]
    assert line.endswith("deg/s left in")
    assert float(line.split("q bias: ")[1].split(" ")[0]) == pytest.approx(1.0, abs=0.05)


def test_what_a_map_leaves_out_follows_from_the_flights(folder: Path) -> None:
    """At 25 Hz test functions of the usual width are refused: here nobody asked for that width."""
    file = _written(_frame(0, *FLIGHTS["low"]).iloc[::4], folder / "slow.csv")
    narrow = "[analysis]\nelevator_range_deg = [-8.0, 0.0]\nelevator_step_deg = 0.5\nalpha_range_deg = [-3.0, 5.0]\n"
    asked = "[identification]\nalpha_dot_order = 1\nq_dot_order = 1\n"
    for added, window_deg, order in (("", None, 3), ("[identification]\n", None, 3), (narrow + asked, (-3.0, 5.0), 1)):
        (folder / "map.toml").write_text(MAP + added)
        code, said, _ = _run("prepare", file, "--map", "map.toml", "--json", "--quiet")
        assert code == 0
        run = Path(json.loads(said)["run"])
        options = identification_of_records(run, load_sweep(run))
        assert options.alpha_order == (order, order)
        assert 0.32 <= options.half_width_s < 0.33
        assert options.spacing_s <= 0.25 * options.half_width_s
        alpha = load_sweep(run)["slow"]["alpha_rad"]
        flown = (float(np.nanmin(alpha)), float(np.nanmax(alpha)))
        low, high = (to_si(edge, "deg") for edge in window_deg or (-180.0, 180.0))
        margin = to_si(0.5, "deg")
        assert options.alpha_window_rad == pytest.approx((max(flown[0] - margin, low), min(flown[1] + margin, high)))
