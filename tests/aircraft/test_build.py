"""The committed XML is what the script makes of its sources; bad sources are named, and nothing is written."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

BUILT = ("f8ii.xml", "Engines/wp-13a-ii.xml", "Engines/wp-13a-ii-nozzle.xml")


def source_copy(aircraft_folder: Path, target: Path) -> Path:
    shutil.copytree(aircraft_folder, target, ignore=shutil.ignore_patterns("studies"))
    return target


def test_rebuilding_gives_the_committed_files_byte_for_byte(
    builder: ModuleType, aircraft_folder: Path, tmp_path: Path
) -> None:
    assert builder.main(["--output", str(tmp_path)]) == 0
    for name in BUILT:
        assert (tmp_path / name).read_bytes() == (aircraft_folder / name).read_bytes()
    written = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert written == set(BUILT)


def test_check_finds_one_changed_digit(
    builder: ModuleType, aircraft_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = source_copy(aircraft_folder, tmp_path / "f8ii")
    assert builder.main(["--source", str(folder), "--check"]) == 0
    xml = folder / "f8ii.xml"
    changed = xml.read_text().replace("0.274", "0.275", 1)
    xml.write_text(changed)
    assert builder.main(["--source", str(folder), "--check"]) == 1
    assert str(xml) in capsys.readouterr().err
    assert xml.read_text() == changed  # a check mends nothing


def test_the_script_runs_as_a_program() -> None:
    script = Path(__file__).parents[2] / "scripts" / "build_f8ii.py"
    done = subprocess.run([sys.executable, str(script), "--check"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


MISTAKES = {
    "a missing coefficient": (
        "published.toml",
        "alpha2 = -0.00996132996307\n",
        "",
        "'alpha_dot_deg_s.alpha2' is missing",
    ),
    "an unknown term": ("published.toml", "alpha3 = 0.000683555761819", "alfa3 = 1.0", "'alpha_dot_deg_s.alfa3'"),
    "a coefficient that is text": ("published.toml", "= 2.032347041", '= "2.03"', "'q_dot_deg_s2.constant'"),
    "a coefficient that is not finite": ("published.toml", "= 2.032347041", "= nan", "'q_dot_deg_s2.constant'"),
    "no section": ("published.toml", "[q_dot_deg_s2]", "[q_dot]", "'q_dot_deg_s2' is missing"),
    "no TOML": ("published.toml", "[alpha_dot_deg_s]", "[alpha_dot_deg_s", "published.toml: "),
    "a negative mass": ("reference.toml", "total_kg = 14300.0", "total_kg = -1.0", "'mass.total_kg' must be above 0"),
    "more fuel than mass": ("reference.toml", "fuel_kg = 4200.0", "fuel_kg = 14301.0", "'mass.fuel_kg'"),
    "limits in disorder": (
        "reference.toml",
        "[-19.0, 16.5]",
        "[16.5, -19.0]",
        "'stabilator.normal.limits_deg' must rise",
    ),
    "a blend inside the model": ("reference.toml", "[-45.0, 66.0]", "[-30.0, 66.0]", "'extension.blended_deg'"),
    "steps that do not fit": (
        "reference.toml",
        "paper_step_deg = 0.1",
        "paper_step_deg = 0.3",
        "'extension.paper_step_deg'",
    ),
    "breakpoints that fall": ("data/longitudinal.csv", "\n-170,", "\n-176,", "alpha_deg must rise, but -176.0"),
    "an open circle": ("data/longitudinal.csv", "\n180,0.16162,", "\n180,0.2,", "CL must be the same at -180 and 180"),
    "a value that is no number": ("data/lateral.csv", "\n-40,-0.5500", "\n-40,x", "row 1, column CY_beta_per_rad: 'x'"),
    "a row too short": ("data/lateral.csv", "\n-40,-0.5500", "\n-40", "row 1 has 14 values, the header has 15"),
    "a missing column": ("data/lateral.csv", "Cn_rudder_per_rad", "Cn_dr", "no column Cn_rudder_per_rad"),
    "Mach numbers that fall": ("data/thrust_dry.csv", "mach_0.2", "mach_0.7", "rising"),
    "a placeholder without a value": ("f8ii.xml.in", "${table_CD}", "${table_CX}", "table_CD, table_CX"),
}


@pytest.mark.parametrize("mistake", MISTAKES.values(), ids=MISTAKES.keys())
def test_a_bad_source_is_named_and_nothing_is_written(
    builder: ModuleType,
    aircraft_folder: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    mistake: tuple[str, str, str, str],
) -> None:
    name, old, new, expected = mistake
    folder = source_copy(aircraft_folder, tmp_path / "f8ii")
    text = (folder / name).read_text(encoding="utf-8")
    assert old in text
    (folder / name).write_text(text.replace(old, new, 1), encoding="utf-8")
    output = tmp_path / "output"
    output.mkdir()
    assert builder.main(["--source", str(folder), "--output", str(output)]) == 2
    said = capsys.readouterr().err
    assert expected in said
    assert str(folder / name) in said
    assert list(output.iterdir()) == []


def test_a_missing_file_is_named(builder: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = tmp_path / "nowhere.toml"
    assert builder.main(["--published", str(missing), "--output", str(tmp_path / "output")]) == 2
    assert f"cannot read {missing}" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_old_file(
    builder: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "f8ii.xml"
    target.write_text("old")

    def refuse(_: Path, other: Path) -> None:
        raise OSError(28, "No space left on device", str(other))

    monkeypatch.setattr(Path, "replace", refuse)
    assert builder.main(["--output", str(tmp_path)]) == 2
    assert target.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["f8ii.xml"]
