"""``finback fly``: files, exit codes, and the way on to ``compare``."""

from __future__ import annotations

import io
import json
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from finback.cli.application import app
from finback.cli.case_request import show
from finback.flight.case import FlownCase
from finback.records import Outcome

MAP = """
schema = 1
[[channel]]
name = "altitude_m"
reference = "altitude_m"
unit = "m"
tolerance = { worst = 1e-9, source = "the same flight, kept in two formats" }
"""


def _fly(*arguments: str) -> tuple[int, str, str]:
    found = CliRunner().invoke(app, ["fly", *arguments])
    return found.exit_code, found.stdout, found.stderr


def test_one_flight_in_every_format_is_the_same_flight(tmp_path: Path) -> None:
    files = [tmp_path / f"ball.{kind}" for kind in ("csv", "parquet", "rrd")]
    outputs = [word for file in files for word in ("--output", str(file))]
    code, said, _ = _fly("ball", "--ic", "altitude_ft=30000", "--duration", "2", "--step-hz", "100", *outputs, "--json")
    assert code == 0
    assert json.loads(said)["rows"] == 201
    csv, parquet = pd.read_csv(files[0]), pd.read_parquet(files[1])
    assert list(csv.columns) == list(parquet.columns)
    assert np.array_equal(csv.to_numpy(), parquet.to_numpy())
    assert files[2].stat().st_size > 0
    (tmp_path / "map.toml").write_text(MAP)
    found = CliRunner().invoke(app, ["compare", str(files[1]), str(files[0]), "--map", str(tmp_path / "map.toml")])
    assert found.exit_code == 0, found.output


def test_a_schedule_moves_the_aircraft(tmp_path: Path) -> None:
    ends = []
    for command in ("0:0", "0:0,0.5:0,0.5:-0.3"):
        file = tmp_path / "f16.csv"
        code, _, said = _fly(
            "f16", "--ic", "altitude_ft=20000", "--ic", "airspeed_kt=400", "--ic", "alpha_deg=3", "--duration", "1.5",
            "--schedule", f"fcs/elevator-cmd-norm={command}", "--sample-hz", "100", "--output", str(file),
        )  # fmt: skip
        assert code == 0, said
        ends.append(pd.read_csv(file)["q_rad_s"].iloc[-1])
    assert ends[1] - ends[0] > 0.01  # pulled: the nose goes up


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["no-such-thing", "--duration", "1"], "no aircraft 'no-such-thing'"),
        (["ball", "--duration", "1", "--ic", "alpa_deg=1"], "no initial condition is called 'alpa'"),
        (["ball", "--duration", "1", "--ic", "alpha_deg=x"], "'x' is no number"),
        (["ball", "--duration", "1", "--ic", "reset99.xml"], "there is no such file"),
        (["ball", "--duration", "1", "--set", "simulation/no=1"], "no property 'simulation/no'"),
        (["ball", "--duration", "1", "--schedule", "a=0:0,1"], "cannot be read"),
        (["ball", "--duration", "1", "--record", "a=b"], "cannot be read"),
        (["ball", "--duration", "1", "--output", "it.txt"], "ends in none of"),
        (["ball", "--duration", "-1"], "--duration is -1.0"),
        (["ball", "--duration", "1", "--attitude", "euler"], "one of: buss2, ab4"),
        (["ball"], "needs a duration"),
    ],
)
def test_faults_name_the_option(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, errors = _fly(*arguments)
    assert code == 2
    assert said in errors
    assert list(tmp_path.iterdir()) == []


def test_options_reach_the_flight(tmp_path: Path) -> None:
    """A start of the aircraft's own folder, schedules in one option and in a file, a wind over altitude, a record."""
    (tmp_path / "wind.csv").write_text("altitude_ft,wind_east_kt\n0,10\n40000,10\n")
    (tmp_path / "it.csv").write_text("time_s,rudder\n0,0\n1,0.5\n")
    code, said, errors = _fly(
        "c172x", "--ic", "reset01", "--ic", "airspeed_kt=110",
        "--duration", "1", "--step-hz", "100", "--sample-hz", "10",
        "--schedule", "elevator=0:0,1:-0.1,throttle=0:0.5", "--schedule", str(tmp_path / "it.csv"), "--hold", "zoh",
        "--wind", str(tmp_path / "wind.csv"), "--record", "aero/qbar-psf:lbf/ft^2=push_pa", "--json",
        "--output", str(tmp_path / "it.parquet"),
    )  # fmt: skip
    assert code == 0, errors
    document = json.loads(said)
    assert document["provenance"]["schedule fcs/elevator-cmd-norm"] == "zoh: 0:0, 1:-0.1"
    assert "left out: <output" in errors
    table = pq.read_table(tmp_path / "it.parquet")
    flown = table.to_pandas()
    assert flown["airspeed_m_s"][0] == pytest.approx(110 * 1852 / 3600)
    assert flown["elevator_command_1"].tolist() == [0.0] * 10 + [-0.05]  # at the jump the mean of both sides
    assert flown["throttle_command_1"].tolist() == [0.5] * 11
    np.testing.assert_allclose(flown["wind_east_m_s"], 10 * 1852 / 3600)
    np.testing.assert_allclose(flown["push_pa"], flown["dynamic_pressure_pa"])
    facts = table.schema.field("altitude_m").metadata
    assert float(facts[b"step_error"]) == document["step_error"]["altitude_m"] > 0.0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--hold", "cubic"], "one of: foh, zoh"),
        (["--schedule", "elevater=0:0"], "did you mean elevator"),
        (["--schedule", "elevator=0:0,elevator=1:1"], "'elevator' is given twice"),
        (["--schedule", "elevator=0:0", "--schedule", "elevator=1:1"], "has two schedules"),
        (["--schedule", "elevator=1:0,0:0"], "times must not decrease"),
        (["--schedule", "elevator=0:nan"], "only finite numbers"),
        (["--schedule", "it.toml"], "it.toml"),
        (["--wind", "it.csv"], "it.csv is not there"),
        (["--ic", "airspeed_kt=-100"], "airspeed = -51.4444444 m_s"),
        (["--ic", "ic/alpha-deg=1", "--ic", "ic/alpha-deg=2"], "'ic/alpha-deg' is given twice"),
    ],
)
def test_faults_of_starts_schedules_and_winds(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, errors = _fly("ball", "--duration", "1", *arguments)
    assert (code, said in errors) == (2, True), errors
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_nobody_named_is_not_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    flight = ("ball", "--ic", "altitude_ft=30000", "--duration", "0.1", "--no-check-step")
    assert _fly(*flight)[0] == 0
    Path("ball.parquet").write_text("mine")
    code, _, errors = _fly(*flight)
    assert (code, "ball.parquet exists, and --output does not name it" in errors) == (2, True), errors
    assert Path("ball.parquet").read_text() == "mine"
    assert _fly(*flight, "--output", "ball.parquet")[0] == 0
    assert pd.read_parquet("ball.parquet")["altitude_m"][0] > 0.0


def test_engines_are_started_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    flight = ("c310", "--ic", "altitude_ft=5000", "--ic", "airspeed_kt=150", "--duration", "0.1", "--step-hz", "100",
              "--schedule", "throttle=0:0.6", "--no-check-step", "--output", "it.csv")  # fmt: skip
    assert "no engine runs: --engines running" in _fly(*flight)[2]
    assert "no engine runs" not in _fly(*flight, "--engines", "running")[2]
    assert "one of: as-loaded, running" in _fly(*flight, "--engines", "on")[2]


def test_the_table_shows_what_the_step_supports_and_no_rounding() -> None:
    """Angles in rad: one of rounding, one within its error, one far beyond it."""
    columns = {
        "time_s": np.array([0.0, 1.0]),
        "phi_rad": np.array([-7e-17, 7e-17]),
        "beta_rad": np.radians([5.0, 1e-3]),
        "alpha_rad": np.radians([1.23456, 118.8512]),
        "theta_rad": np.radians([0.0, 12.3456]),
    }
    errors = {
        "phi_rad": 0.0,
        "beta_rad": np.radians(0.1),
        "alpha_rad": np.radians(27.0),
        "theta_rad": np.radians(0.011),
    }
    flown = FlownCase(
        name="it", columns=columns, outcome=Outcome.COMPLETED, note="", warnings=(), provenance={}, step_error=errors
    )
    with redirect_stdout(io.StringIO()) as said:
        show(flown, [])
    rows = {line.split()[0]: line.split()[2:4] for line in said.getvalue().splitlines() if " deg " in line}
    assert rows == {"phi": ["0", "0"], "beta": ["5", "0"], "alpha": ["1.2346", "119"], "theta": ["0", "12.346"]}
