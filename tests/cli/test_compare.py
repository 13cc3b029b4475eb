"""``finback compare``: exit codes, output, faults of the map."""

from __future__ import annotations

import json
import math
import re
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
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
        "channel[0].tolerance.worst: must be greater than or equal to 0",
        "channel[0].tolerance.source: missing",
        "channel[1]: 'm' does not measure what 'q_rad_s' is in",
    ):
        assert said in found.stderr


BROKEN = """
schema = 1
{top}
[time]
reference = "t"
{time}
[[channel]]
name = "alpha_rad"
reference = "AoA"
unit = "{unit}"
{more}
tolerance = {{ {bound}, source = "this test" }}
"""
TIMES = np.arange(11) / 10


def _reference(values: np.ndarray, time: np.ndarray = TIMES, *, separator: str = ",", decimal: str = ".") -> str:
    rows = [f"{a!r}{separator}{b!r}".replace(".", decimal) for a, b in zip(time.tolist(), values.tolist(), strict=True)]
    return f"t{separator}AoA\n" + "\n".join(rows) + "\n"


DEGREES = np.degrees(np.sin(TIMES))
GOOD = _reference(DEGREES)
HOLES = np.where(TIMES == 0.3, math.nan, DEGREES)


@pytest.mark.parametrize(
    ("text", "asked", "code", "said"),
    [
        (GOOD, {}, 0, "AGREES"),
        (GOOD, {"bound": "relative = 1e-9"}, 0, "relative"),
        (_reference(DEGREES * 1.01), {"bound": "relative = 0.011"}, 0, "AGREES"),
        (_reference(DEGREES * 1.01), {"bound": "relative = 0.009"}, 1, "DISAGREES"),
        (_reference(DEGREES + 1.0), {}, 1, "DISAGREES"),
        (_reference(np.sin(TIMES)), {}, 1, "would agree to 2% in 'rad'"),
        (_reference(-DEGREES), {}, 1, "with the other sign"),
        (_reference(HOLES), {}, 0, "1 rows of the reference hold no number"),
        (_reference(DEGREES, TIMES + 0.5), {}, 1, "DISAGREES"),
        (_reference(np.degrees(np.sin(TIMES + 0.5)), TIMES + 0.5), {"bound": "worst = 1e-3"}, 1, "INCONCLUSIVE"),
        (_reference(DEGREES, TIMES + 5.0), {}, 3, "nothing in common"),
        (_reference(DEGREES, TIMES + 5.0), {"time": "offset_s = -5.0"}, 0, "AGREES"),
        (_reference(DEGREES, TIMES * 1e3), {"time": 'unit = "ms"'}, 0, "AGREES"),
        (_reference(DEGREES[:1], TIMES[:1]), {}, 3, "in common"),
        (_reference(DEGREES, np.where(TIMES == 0.3, 0.2, TIMES)), {}, 2, "time does not increase from row 3 (0.2 s)"),
        (_reference(DEGREES, TIMES[::-1]), {}, 2, "time does not increase"),
        (_reference(DEGREES, np.where(TIMES == 0.3, math.nan, TIMES)), {}, 2, "time is no number in row 4"),
        (_reference(DEGREES, separator=";", decimal=","), {}, 2, "decimal = ','"),
        (_reference(DEGREES, separator=";", decimal=","), {"top": 'decimal = ","'}, 0, "AGREES"),
        (GOOD.replace("AoA\n", "AoA\ns,deg\n"), {}, 2, "skip_rows = 1"),
        (GOOD.replace("AoA\n", "AoA\ns,deg\n"), {"top": "skip_rows = 1"}, 0, "AGREES"),
        (GOOD.replace("AoA", "Aoa"), {}, 2, "has no 'AoA' (but Aoa)"),
        (GOOD.replace("t,", "time,", 1), {}, 2, "has no column 't'"),
        (GOOD, {"unit": "slug"}, 2, "'slug' does not measure what 'alpha_rad' is in"),
        (GOOD, {"unit": "Degrees"}, 0, "AGREES"),
        (GOOD, {"bound": "worst = inf"}, 2, "finite"),
        (GOOD, {"bound": "worst = -1.0"}, 2, "greater than or equal to 0"),
        (GOOD, {"top": 'decimal = ","\nseparator = ","'}, 2, "cannot separate cells"),
        ("", {}, 2, "no names of columns"),
        ("t,AoA\n", {}, 2, "no row"),
    ],
)
def test_what_a_reference_may_be(files: Path, text: str, asked: dict[str, str], code: int, said: str) -> None:
    """In turn: what agrees, what does not, what nobody can tell, what must be mended."""
    pd.DataFrame({"time_s": TIMES, "alpha_rad": np.sin(TIMES)}).to_csv(files / "ours.csv", index=False)
    (files / "theirs.csv").write_text(text)
    words = {"top": "", "time": "", "unit": "deg", "more": "", "bound": "worst = 1e-9", **asked}
    (files / "map.toml").write_text(BROKEN.format(**words))
    found = CliRunner().invoke(
        app, ["compare", str(files / "ours.csv"), str(files / "theirs.csv"), "--map", str(files / "map.toml")]
    )
    assert (found.exit_code, said in found.output) == (code, True), found.output


def test_the_check_case_of_the_documents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = Path(__file__).parents[2]
    text = (root / "docs" / "compare.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```sh\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)
    (tmp_path / "docs").symlink_to(root / "docs")
    monkeypatch.chdir(tmp_path)
    fly, beside = (shlex.split(line) for line in block.replace("\\\n", " ").splitlines())
    assert CliRunner().invoke(app, fly[1:]).exit_code == 0
    found = CliRunner().invoke(app, [*beside[1:], "--json"])
    document = json.loads(found.stdout)
    assert (found.exit_code, document["verdict"], len(document["channels"])) == (0, "agrees", 30)
    worst = {channel["name"]: channel["worst"] for channel in document["channels"]}
    assert worst["geodetic_altitude_m"] == pytest.approx(1.1e-3, rel=0.05)  # as the page says
    assert worst["velocity_down_m_s"] == pytest.approx(1.5e-4, rel=0.05)


UNITS = """
schema = 1
[[channel]]
name = "airspeed_m_s"
reference = "TAS"
unit = "kt"
tolerance = { worst = 0.25, rmse = 0.125, source = "me" }
[[channel]]
name = "dynamic_pressure_pa"
reference = "qbar"
unit = "Pa"
"""


def test_the_table_keeps_the_units_of_the_map_and_says_nothing_twice(files: Path) -> None:
    between = TIMES[:-1] + 0.05
    pd.DataFrame({"time_s": TIMES, "airspeed_m_s": 100.0, "dynamic_pressure_pa": 6e3}).to_csv(
        files / "ours.csv", index=False
    )
    theirs = pd.DataFrame({"time_s": between, "TAS": (100.0 * 3600 / 1852) + 0.0625, "qbar": 6e3})
    theirs.to_csv(files / "theirs.csv", index=False)
    (files / "map.toml").write_text(UNITS)
    names = [str(files / name) for name in ("ours.csv", "theirs.csv", "map.toml")]
    found = CliRunner().invoke(app, ["compare", *names[:2], "--map", names[2]])
    assert found.exit_code == 0, found.output
    (row,) = (line for line in found.stdout.splitlines() if line.strip().startswith("airspeed"))
    assert row.split()[1:3] == ["kt", "0.0625"]
    assert "worst 0.25 (1), rmse 0.125" in row
    assert " Pa " in found.stdout
    assert found.stdout.count("10 of 10 times lie between our samples") == 1


def test_many_names_are_told_in_lines(files: Path) -> None:
    columns = {"time_s": TIMES, **{f"quantity_{number}_m": TIMES for number in range(105)}}
    pd.DataFrame(columns).to_csv(files / "ours.csv", index=False)
    (files / "theirs.csv").write_text(GOOD)
    (files / "map.toml").write_text(MAP.format(worst=1.0))
    names = [str(files / name) for name in ("ours.csv", "theirs.csv", "map.toml")]
    found = CliRunner().invoke(app, ["compare", *names[:2], "--map", names[2]])
    said = next(line for line in found.stderr.splitlines() if "quantity_0_m" in line and "has:" in line)
    assert len(said) <= 110
    assert "quantity_104_m" in found.stderr
