"""Finding aircraft, and finding out what is wrong with one without dying of it."""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from finback.errors import AircraftError
from finback.flight.aircraft import Aircraft, find_aircraft, fingerprint, try_aircraft
from finback.flight.mounting import try_mounting
from finback.flight.rig import Rig
from finback.flight.trial import run_child
from finback.records import Condition

Writer = Callable[..., Aircraft]

FAULTS = {
    "unknown property in an aero function": (
        {"<property>aero/beta-rad</property>": "<property>aero/no-such-thing</property>"},
        "aero/no-such-thing",
    ),
    "unknown property as a table's key": ({"aero/alpha-deg</indep": "aero/alfa-deg</indep"}, "aero/alfa-deg"),
    "non-monotonic table": ({"25 0.4": "-5 0.4"}, "monotonically"),
    "ragged table": ({"25 0.4": "25"}, "Invalid number of columns"),
    "malformed XML": ({"</metrics>": "</metric>"}, ""),
    "missing engine": ({"<!--engine-->": '<engine file="nowhere"><thruster file="direct"/></engine>'}, "nowhere"),
    "unknown element in a product": (
        {"<value>-0.8</value></product></function></axis>": "<foo/></product></function></axis>"},
        "foo",
    ),
    "unknown unit": ({'wingarea unit="FT2"': 'wingarea unit="FT9"'}, "FT9"),
    "unknown axis": ({'axis name="SIDE"': 'axis name="SIDEWAYS"'}, "SIDEWAYS"),
    "no metrics": ({"metrics>": "metricks>"}, "metrics"),
}


def test_a_name_is_found_in_an_ancestor_of_the_study_and_its_fingerprint_is_of_all_its_xml(
    write_mini: Writer, tmp_path: Path
) -> None:
    written = write_mini()
    deep = tmp_path / "aircraft" / "mini" / "studies"
    deep.mkdir()
    found = find_aircraft("mini", near=deep / "study.toml")
    assert found == written
    assert find_aircraft("aircraft/mini", near=tmp_path) == written
    (deep.parent / "notes.txt").write_text("not read by JSBSim")
    assert fingerprint(deep.parent) == written.sha256
    (deep.parent / "engine.xml").write_text("<engine/>")
    assert fingerprint(deep.parent) != written.sha256


def test_jsbsims_own_aircraft_are_found_last(tmp_path: Path, f16: Aircraft) -> None:
    assert find_aircraft("f16", near=tmp_path).path == f16.path
    mine = tmp_path / "aircraft" / "f16" / "f16.xml"
    mine.parent.mkdir(parents=True)
    mine.write_text("<fdm_config/>")
    assert find_aircraft("f16", near=tmp_path).path == mine


def test_a_missing_aircraft_names_the_nearest_one_and_where_was_looked(tmp_path: Path, write_mini: Writer) -> None:
    write_mini()
    with pytest.raises(AircraftError, match="did you mean 'mini'") as caught:
        find_aircraft("mimi", near=tmp_path)
    assert str(tmp_path / "aircraft") in caught.value.message
    with pytest.raises(AircraftError, match="no aircraft file at"):
        find_aircraft("./nowhere.xml", near=tmp_path)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("F16", "did you mean 'f16'?"),
        ("f16 ", "did you mean 'f16'?"),
        ("c172", "did you mean 'c172p' or 'c172r' or 'c172x'?"),
        ("Concorde2", "did you mean 'Concorde'?"),
        ("zzz", "give the path of its XML file"),
    ],
)
def test_a_wrong_name_is_answered_sensibly(name: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(AircraftError) as caught:
        find_aircraft(name, near=tmp_path)
    assert said in str(caught.value)
    assert f"no folder 'aircraft' is in {tmp_path}" in caught.value.message


def test_a_folder_whose_file_is_named_otherwise_is_answered(tmp_path: Path) -> None:
    file = tmp_path / "outer" / "inner.xml"
    file.parent.mkdir()
    file.write_text("<fdm_config/>")
    with pytest.raises(AircraftError) as caught:
        find_aircraft(str(file.parent), near=tmp_path)
    assert "holds no outer.xml" in caught.value.message
    assert str(file) in caught.value.hint
    assert find_aircraft(str(file), near=tmp_path).path == file


def test_a_folder_beside_the_study_is_told_how_to_be_named(tmp_path: Path, write_mini: Writer) -> None:
    folder = write_mini(name="mine").path.parent.parent.rename(tmp_path / "studies")
    with pytest.raises(AircraftError) as refused:
        find_aircraft("mine", near=folder)
    assert refused.value.hint == f"for the folder {folder / 'mine'} write './mine'"
    assert find_aircraft("./mine", near=folder).path == folder / "mine" / "mine.xml"


def test_a_missing_absolute_path_is_named_once(tmp_path: Path) -> None:
    path = str(tmp_path / "gone.xml")
    with pytest.raises(AircraftError) as caught:
        find_aircraft(path, near=tmp_path)
    assert str(caught.value).count(path) == 1


@pytest.mark.parametrize("name", ["x" * 5000, f"{'x' * 5000}/y.xml"])
def test_a_name_too_long_for_the_system_is_no_aircraft(name: str, tmp_path: Path) -> None:
    with pytest.raises(AircraftError, match="cannot be read") as caught:
        find_aircraft(name, near=tmp_path)
    assert len(caught.value.message) < 200


def test_good_aircraft_have_no_faults(f8ii: Aircraft, f16: Aircraft, write_mini: Writer) -> None:
    assert try_aircraft(f8ii) == ()
    assert try_aircraft(f16) == ()
    assert try_aircraft(write_mini()) == ()


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_aircraft_is_an_error_with_jsbsims_words_and_nobody_dies(
    fault: str, write_mini: Writer, condition: Condition, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "scratch").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "scratch"))
    changes, word = FAULTS[fault]
    aircraft = write_mini(changes)
    faults = try_aircraft(aircraft)
    assert faults
    assert word in " ".join(faults)
    with pytest.raises(AircraftError, match="mini"):
        Rig(aircraft, condition, step_s=1 / 400)
    assert not list((tmp_path / "scratch").iterdir()), "nothing is left behind"


@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("import os; os.abort()", "SIGABRT"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "SIGSEGV"),
        ("import time; time.sleep(60)", "did not finish"),
        ("raise ValueError('oh')", "ValueError: oh"),
        ("print('{}')", "no answer"),
        ("pass", "no answer"),
        ('print(\'{"faults": ["first"], "values": {}}\', flush=True); import os; os.abort()', "first"),
    ],
)
def test_a_child_that_dies_or_hangs_is_a_fault(program: str, words: str) -> None:
    trial = run_child([sys.executable, "-c", program], "", timeout_s=0.5 if "sleep" in program else 30.0)
    assert words in " ".join(trial.faults)
    assert not trial.values


@pytest.mark.parametrize("fidelity", ["rig", "symmetric", "free"])
@pytest.mark.parametrize(
    ("fault", "line"),
    [
        ("unknown property in an aero function", r"mini\.xml:\d+: .*aero/no-such-thing"),
        ("non-monotonic table", r"mini\.xml:\d+: .*monotonically increasing in row 3 of table in aero/CD"),
    ],
)
def test_a_fault_is_told_once_with_file_line_and_place(
    fault: str, line: str, fidelity: str, write_mini: Writer, condition: Condition
) -> None:
    aircraft = write_mini(FAULTS[fault][0])
    (said,) = try_mounting(aircraft, condition, fidelity)
    assert said.startswith(f"{aircraft.path}: ")
    assert re.search(line, said)
    if "property" in fault:
        assert said.count("aero/no-such-thing") == 1


def test_a_table_with_a_number_that_is_none_is_refused(write_mini: Writer, condition: Condition) -> None:
    (said,) = try_mounting(write_mini({"25 0.4": "25 nan"}), condition, "symmetric")
    assert re.search(r"mini\.xml:\d+: .*25 nan", said)
