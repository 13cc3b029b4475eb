"""Files and sockets that aircraft and scripts would open: taken out, and nothing else."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from finback.errors import AircraftError
from finback.flight.case import Case
from finback.flight.case_flight import fly_case
from finback.flight.quiet_copy import quiet_aircraft, quiet_text
from finback.flight.simulator import Simulator
from finback.flight.trial import fly_trial

BRICK = Path(__file__).parent / "data" / "aircraft" / "brick" / "brick.xml"
SPEAKING = (
    '<output name="{folder}/absolute.csv" type="CSV" rate="10"><rates>ON</rates></output>',
    '<output name="../beside.csv" type="TABULAR" rate="10"/>',
    '<output name="a>b.csv" type="CSV"\n rate="10"/>',
    '<output file="no-such-file"/>',
    '<output name="localhost" type="SOCKET" port="1139" protocol="TCP"/>',
    '<output name="localhost" type="FLIGHTGEAR" port="5500" protocol="UDP" rate="60"/>',
    '<input port="1138"/>',
    '<input type="QTJSBSIM" port="1137"><!-- <output/> --></input>',
)


def _speaking(folder: Path, *elements: str) -> Path:
    path = folder / "aircraft" / "brick" / "brick.xml"
    path.parent.mkdir(parents=True, exist_ok=True)
    text = BRICK.read_text(encoding="utf-8")
    added = "\n".join(elements).replace("{folder}", str(folder))
    path.write_text(text.replace("</fdm_config>", f"{added}\n</fdm_config>"), encoding="utf-8")
    return path


@given(st.lists(st.sampled_from(SPEAKING)), st.sampled_from(["", "\n", " <!-- x --> ", "<autopilot/>"]))
def test_all_of_them_go_and_the_rest_stays(
    tmp_path_factory: pytest.TempPathFactory, chosen: list[str], gap: str
) -> None:
    plain = "<fdm_config name='ü'>" + gap + "<axis><output>kept: deeper</output></axis>\n</fdm_config>\n"
    path = tmp_path_factory.mktemp("quiet") / "it.xml"
    for text in (
        plain.replace("</fdm_config>", gap.join(chosen) + "</fdm_config>"),
        plain.replace("<axis>", gap.join(chosen) + "<axis>"),
    ):
        path.write_text(text, encoding="utf-8")
        quiet = quiet_text(path)
        assert len(quiet.left_out) == len(chosen)
        assert quiet.content.count(b"\n") == text.count("\n")
        assert b"kept: deeper" in quiet.content
        assert quiet.content.count(b"put") == 2  # of the one that is deeper
        path.write_bytes(quiet.content)
        assert not quiet_text(path).left_out


def test_a_stand_in_has_the_number_of_the_output(tmp_path: Path) -> None:
    path = _speaking(tmp_path, *SPEAKING)
    text = quiet_text(path, stand_in='<output name="{}"/>').content.decode()
    assert [text.count(f'<output name="{number}"/>') for number in range(7)] == [1] * 6 + [0]


def test_what_lies_beside_is_found_beside_the_copy(tmp_path: Path) -> None:
    path = _speaking(tmp_path, SPEAKING[0])
    (path.parent / "Engines").mkdir()
    (tmp_path / "engine").mkdir()
    (tmp_path / "aircraft" / "other").mkdir()
    with quiet_aircraft(path) as quiet:
        assert quiet.path != path
        assert (quiet.path.parent / "Engines").is_dir()
        assert (quiet.path.parent / ".." / "other").is_dir()
        assert (quiet.path.parent / ".." / ".." / "engine").is_dir()
        copy = quiet.path
    assert not copy.exists()
    assert path.is_file()
    with quiet_aircraft(BRICK) as quiet:
        assert quiet.path == BRICK  # nothing to take out, no copy


@pytest.mark.parametrize("place", ["{own}", "{root}", "../other/it", "{folder}/it"])
def test_systems_are_found_from_the_copy_as_from_the_original(tmp_path: Path, place: str) -> None:
    """Beside the aircraft, in the folder ``systems``, and by relative and absolute paths."""
    gain = '<pure_gain name="it/gain"><input>aero/alpha-rad</input><gain>2</gain></pure_gain>'
    system = f'<system name="it"><channel name="c">{gain}</channel></system>'
    path = _speaking(tmp_path, SPEAKING[0], f'<system file="{place.format(own="it", root="it", folder=tmp_path)}"/>')
    folder = {
        "{own}": path.parent / "Systems",
        "{root}": tmp_path / "systems",
        "{folder}/it": tmp_path,
    }.get(place, tmp_path / "aircraft" / "other")
    folder.mkdir(exist_ok=True)
    (folder / "it.xml").write_text(system)
    assert Simulator(path, step_s=0.01, freeze_position=True).has("it/gain")


def test_a_simulator_and_a_trial_open_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = _speaking(tmp_path, *SPEAKING)
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    simulator = Simulator(path, step_s=0.01, freeze_position=True)
    simulator.start()
    simulator.run()
    assert fly_trial(path, initial={"ic/h-sl-ft": 1000.0}).faults == ()
    assert sorted(tmp_path.rglob("*")) == before


def test_what_is_no_xml_is_said_to_be_none(tmp_path: Path) -> None:
    path = tmp_path / "it.xml"
    for content in (b"", b"<a>", b"\xff\x00", b"<a></b>"):
        path.write_bytes(content)
        with pytest.raises(AircraftError, match="cannot be read as XML"):
            quiet_text(path)
    with pytest.raises(AircraftError, match="cannot be read as XML"):
        quiet_text(tmp_path / "missing.xml")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_any_encoding(tmp_path: Path, encoding: str) -> None:
    declared = encoding.removesuffix("-sig")
    text = f'<?xml version="1.0" encoding="{declared}"?>\n<a name="größe">\n<output name="ä.csv"/>\n<b/></a>\n'
    path = tmp_path / "it.xml"
    path.write_bytes(text.encode(encoding))
    quiet = quiet_text(path)
    assert quiet.left_out == ('<output name="ä.csv">',)
    path.write_bytes(quiet.content)
    root = ET.parse(path).getroot()  # noqa: S314 - written here
    assert (root.get("name"), [child.tag for child in root]) == ("größe", ["b"])


def test_an_entity_may_hide_an_output_and_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "it.xml"
    path.write_text("<!DOCTYPE a [<!ENTITY it '<output name=\"x.csv\"/>'>]><a>&it;</a>")
    with pytest.raises(AircraftError, match="declares the entity 'it'"):
        quiet_text(path)


def test_what_jsbsim_says_of_the_copy_is_said_of_the_original(tmp_path: Path) -> None:
    path = _speaking(tmp_path, SPEAKING[0], '<system file="gone"/>')
    case = Case(source=path, duration_s=0.1, step_s=0.01)
    for load in (lambda: Simulator(path, step_s=0.01, freeze_position=True), lambda: fly_case(case)):
        with pytest.raises(AircraftError) as caught:
            load()
        assert "gone" in caught.value.message
        assert "finback-quiet" not in caught.value.message
