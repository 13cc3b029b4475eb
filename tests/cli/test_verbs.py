"""The verbs within one process: what each prints for a person, and what for a program."""

from __future__ import annotations

import errno
import json
import re
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from finback.cli.application import app
from finback.files import replacing

RUNNER = CliRunner()


def said(*arguments: object) -> str:
    result = RUNNER.invoke(app, [*map(str, arguments), "--quiet"])
    assert result.exit_code == 0, result.stderr
    assert all(line.startswith("finback: warning: ") for line in result.stderr.splitlines()), result.stderr
    return result.stdout


def test_a_sweep(small_study: Path, tmp_path: Path) -> None:
    document = json.loads(said("sweep", small_study, "--output", tmp_path, "--json"))
    assert [flight["name"] for flight in document["flights"]] == [
        *("three-two-one-one-01", "three-two-one-one-02"),
        *("release-01", "release-02", "release-03", "release-04"),
    ]
    text = said("sweep", small_study, "--output", tmp_path)
    assert all(flight["name"] in text for flight in document["flights"])
    assert len(list((tmp_path / "logs" / "small").iterdir())) == 2


def test_identify_and_analyze(own_run: Path) -> None:
    assert "coefficient" in said("identify", own_run)
    assert "elevator [deg]" in said("analyze", own_run)


def test_a_report(own_run: Path, finished_run: Path) -> None:
    path = own_run / "report.html"
    before = path.read_text(encoding="utf-8")
    path.unlink()
    assert said("report", own_run) == f"{path}\n"
    assert path.read_text(encoding="utf-8") == before.replace(str(finished_run), str(own_run))
    assert json.loads(said("report", own_run, "--json")) == {"run": str(own_run), "report": str(path)}


def test_a_replay_without_a_screen_says_so(finished_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    for arguments in (("release-01", finished_run), (finished_run / "recordings" / "release-01.rrd",)):
        result = RUNNER.invoke(app, ["replay", *map(str, arguments)])
        assert (result.exit_code, result.stdout) == (2, "")
        assert "there is no screen" in result.stderr


def test_check(small_study: Path) -> None:
    result = RUNNER.invoke(app, ["check", str(small_study), "--quiet"])
    assert (result.exit_code, result.stdout, result.stderr) == (0, f"{small_study}: no fault\n", "")
    small_study.write_text("schema = 2", encoding="utf-8")
    result = RUNNER.invoke(app, ["check", str(small_study)])
    assert (result.exit_code, result.stdout) == (2, "")
    assert f"finback: {small_study}: schema: must be 1, got 2" in result.stderr


def test_check_looks_for_the_trims(small_study: Path) -> None:
    """At -39 deg, beyond the fold at -35.1 deg, the aircraft has no stable equilibrium (Shi & Fan 2013, Fig. 5)."""
    text = small_study.read_text(encoding="utf-8")
    small_study.write_text(
        text.replace(
            "elevator_deg = [4.0, -5.0]\namplitude_deg = 8.0", "elevator_deg = [4.0, -39.0]\namplitude_deg = 1.0"
        ),
        encoding="utf-8",
    )
    result = RUNNER.invoke(app, ["check", str(small_study), "--quiet"])
    assert (result.exit_code, result.stdout) == (
        0,
        f"{small_study}: no fault, 1 of its maneuvers would not be flown\n",
    )
    assert result.stderr.startswith("finback: warning: sweep: 'three-two-one-one-02' is not flown")
    small_study.write_text(
        text.replace("elevator_deg = -2.0\namplitude", "elevator_deg = -39.0\namplitude").replace(
            "amplitude_deg = 3.0", "amplitude_deg = 1.0"
        ),
        encoding="utf-8",
    )
    result = RUNNER.invoke(app, ["check", str(small_study), "--json", "--quiet"])
    assert result.exit_code == 2
    (fault,) = json.loads(result.stdout)["faults"]
    assert fault.startswith(f"{small_study}: validation.holdout: ")


@pytest.mark.parametrize("verb", ["identify", "analyze", "validate", "report"])
def test_a_folder_that_is_no_run_is_told_so_and_what_to_make_first(verb: str, small_study: Path) -> None:
    empty = small_study.parent / "empty"
    empty.mkdir()
    result = RUNNER.invoke(app, [verb, str(empty), "--quiet"])
    assert result.exit_code == 2
    assert f"{empty} is no run" in result.stderr
    begun = RUNNER.invoke(app, [verb, str(small_study.parent), "--quiet"])
    assert begun.exit_code == 2
    assert begun.stderr.splitlines()[1].strip() == f"make it with: finback sweep {small_study}"


def test_check_finds_what_only_the_rig_refuses(small_study: Path, tmp_path: Path) -> None:
    text = small_study.read_text(encoding="utf-8")
    found = re.search(r'aircraft = "(.*)"', text)
    assert found is not None
    copy = tmp_path / "mine" / "f8ii"
    shutil.copytree(found[1], copy)
    model = copy / "f8ii.xml"
    model.write_text(
        model.read_text(encoding="utf-8").replace("fcs/elevator-pos-rad", "fcs/elevator-pos-radx"), encoding="utf-8"
    )
    small_study.write_text(text.replace(found[1], str(copy)), encoding="utf-8")
    result = RUNNER.invoke(app, ["check", str(small_study)])
    assert (result.exit_code, result.stdout) == (2, "")
    assert "do not read 'fcs/elevator-pos-rad'" in result.stderr


def test_a_disk_without_room_is_said_with_the_file(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"model\.json") as full, replacing(tmp_path / "model.json"):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert full.value.filename == str(tmp_path / "model.json")
