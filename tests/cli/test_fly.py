"""``finback fly``: files, exit codes, and the way on to ``compare``."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from finback.cli.application import app

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
