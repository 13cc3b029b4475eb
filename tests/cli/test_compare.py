"""``finback compare``: exit codes, output, faults of the map."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from finback.cli.application import app

MAP = """
schema = 1
time = {{ reference = "t" }}
[[channel]]
name = "alpha_rad"
reference = "AoA"
unit = "deg"
tolerance = {{ worst = {worst}, source = "this test" }}
[[channel]]
name = "q_rad_s"
reference = "Q"
unit = "deg_s"
"""


@pytest.fixture
def files(tmp_path: Path) -> Path:
    time = np.arange(0.0, 3.0, 0.01)
    np.savetxt(
        tmp_path / "ours.csv", np.column_stack([time, np.sin(time), np.cos(time)]), "%.17g", ",",
        header="time_s,alpha_rad,q_rad_s", comments="",
    )  # fmt: skip
    np.savetxt(
        tmp_path / "theirs.csv", np.column_stack([time, np.degrees(np.sin(time) + 1e-4), np.degrees(np.cos(time))]),
        "%.12f", ",", header="t,AoA,Q", comments="",
    )  # fmt: skip
    return tmp_path


def _run(files: Path, worst: float, *more: str) -> tuple[int, str]:
    (files / "map.toml").write_text(MAP.format(worst=worst))
    found = CliRunner().invoke(
        app, ["compare", str(files / "ours.csv"), str(files / "theirs.csv"), "--map", str(files / "map.toml"), *more]
    )
    return found.exit_code, found.stdout


def test_within_and_beyond_the_tolerance(files: Path) -> None:
    assert _run(files, 0.006) == (0, _run(files, 0.006)[1])  # 1e-4 rad are 0.00573 deg
    code, said = _run(files, 0.005)
    assert code == 1
    assert "DISAGREES" in said
    assert "this test" in said


def test_json_is_only_json_and_says_the_same(files: Path) -> None:
    code, said = _run(files, 0.006, "--json")
    document = json.loads(said)
    assert code == 0
    assert document["verdict"] == "agrees"
    assert document["channels"][0]["worst"] == pytest.approx(1e-4, rel=1e-6)


def test_the_figure_shows_both(files: Path) -> None:
    _run(files, 0.006, "--figure", str(files / "both.svg"))
    assert "<svg" in (files / "both.svg").read_text()


def test_every_fault_of_the_map_at_once(files: Path) -> None:
    (files / "map.toml").write_text(
        'schema = 2\ntme = 1\ntime = { unit = "deg" }\n[[channel]]\nname = "alpha_deg"\nreference = "AoA"\n'
        'unit = "degg"\ntolerance = { worst = -1.0 }\n[[channel]]\nname = "q_rad_s"\nreference = "Q"\nunit = "m"\n'
    )
    found = CliRunner().invoke(
        app, ["compare", str(files / "ours.csv"), str(files / "theirs.csv"), "--map", str(files / "map.toml")]
    )
    assert found.exit_code == 2
    for said in (
        "schema: must be 1",
        "tme: unknown key",
        "time.unit: must be a unit of time",
        "channel[0].name: is ours",
        "channel[0].unit: unknown unit 'degg'",
        "channel[0].tolerance.worst: must be greater than 0",
        "channel[0].tolerance.source: missing",
        "channel[1]: 'm' does not measure what 'q_rad_s' is in",
    ):
        assert said in found.stderr
