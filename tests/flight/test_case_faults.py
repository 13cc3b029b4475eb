"""What is wrong with a script, an aircraft or a start is said; nothing is written, nothing hangs, no process dies."""

from __future__ import annotations

import resource
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from finback.errors import AircraftError, InputError
from finback.flight.case import Case, FlownCase
from finback.flight.case_flight import fly_case
from finback.flight.case_process import fly_apart, fly_apart_checked
from finback.flight.case_resolution import with_step_error
from finback.flight.case_start import case_start
from finback.records import Outcome

DATA = Path(__file__).parent / "data" / "aircraft"
BRICK = DATA / "brick" / "brick.xml"
START = '<initialize name="reset00"><altitude unit="FT">30000</altitude></initialize>'
AT_HALF = '<event name="it"><condition>simulation/sim-time-sec ge 0.5</condition>{}</event>'
SET = '<set name="{}" value="{}"/>'

MakeScript = Callable[..., Path]


@pytest.fixture
def make_script(tmp_path: Path) -> MakeScript:
    """A script beside a brick of its own."""
    folder = tmp_path / "aircraft" / "brick"
    folder.mkdir(parents=True)
    (folder / "brick.xml").write_bytes(BRICK.read_bytes())
    (folder / "reset00.xml").write_text(START)

    def make(run: str = 'start="0" end="1" dt="0.01"', body: str = "", use: str = 'aircraft="brick"') -> Path:
        path = tmp_path / "it.xml"
        path.write_text(f'<runscript name="it"><use {use} initialize="reset00"/><run {run}>{body}</run></runscript>')
        return path

    return make


def test_a_script_ends_at_its_end_from_its_beginning(make_script: MakeScript) -> None:
    body = AT_HALF.format(SET.format("atmosphere/wind-east-fps", 10.0))
    flown = fly_case(Case(source=make_script(body=body)))
    time = flown.columns["time_s"]
    assert (time[0], len(time)) == (0.0, 101)
    assert time[-1] == pytest.approx(1.0)
    np.testing.assert_allclose(flown.columns["wind_east_m_s"], np.where(time > 0.495, 3.048, 0.0))
    late = fly_case(Case(source=make_script('start="100" end="100.5" dt="0.01"'), sample_interval_s=0.1))
    assert late.columns["time_s"] == pytest.approx(100.0 + 0.1 * np.arange(6))


def test_a_script_without_an_end_needs_a_duration(make_script: MakeScript) -> None:
    case = Case(source=make_script('start="0" dt="0.01"'))
    with pytest.raises(InputError, match="a script without an end needs a duration"):
        fly_case(case)
    assert fly_case(replace(case, duration_s=0.3)).columns["time_s"][-1] == pytest.approx(0.3)
    with pytest.raises(InputError, match="more than the 200000000 that one record holds"):
        fly_case(Case(source=make_script('end="1e6" dt="0.001"')))


@pytest.mark.parametrize("name", ["simulation/reset", "simulation/pause"])
def test_a_script_that_stops_the_clock_ends_there(make_script: MakeScript, name: str) -> None:
    case = Case(source=make_script(body=AT_HALF.format(SET.format(name, 1))))
    flown = fly_case(case)
    assert 0.48 < flown.columns["time_s"][-1] < 0.52
    coarse = fly_case(replace(case, sample_interval_s=0.4))
    assert coarse.columns["time_s"] == pytest.approx([0.0, 0.4])
    assert (np.diff(flown.columns["time_s"]) > 0.0).all()
    assert "stops or sets its clock" in " ".join(flown.warnings)


def test_an_integrator_that_an_event_sets_is_told(make_script: MakeScript) -> None:
    body = AT_HALF.format(SET.format("simulation/integrator/rate/rotational", 1))
    assert "'simulation/integrator/rate/rotational' has become 1" in " ".join(
        fly_case(Case(source=make_script(body=body))).warnings
    )


@pytest.mark.parametrize(
    ("made", "said"),
    [
        ({"run": 'start="0" end="-1" dt="0.01"'}, "begins at 0 s and ends at -1 s"),
        ({"run": 'start="0" end="soon" dt="0.01"'}, "end is 'soon'"),
        ({"run": 'start="0" end="1" dt="-0.01"'}, "its step is -0.01 s"),
        ({"use": 'aircraft="brik"'}, "(?s)no aircraft 'brik' in .*did you mean 'brick'"),
        ({"use": ""}, "uses no aircraft"),
        ({"body": AT_HALF.format(SET.format("no/such", 1))}, "JSBSim stops at 0.5 s: No property"),
        ({"body": "<event><condition>no/such gt 1</condition></event>"}, "no/such"),
    ],
)
def test_faults_of_a_script(make_script: MakeScript, made: dict[str, str], said: str) -> None:
    with pytest.raises((InputError, AircraftError), match=said):
        fly_case(Case(source=make_script(**made)))


def test_a_script_may_set_the_rate_of_an_output_that_is_left_out(make_script: MakeScript, tmp_path: Path) -> None:
    """As JSBSim's own c1723 does."""
    path = make_script(body=AT_HALF.format(SET.format("simulation/output/log_rate_hz", 50)))
    target = tmp_path / "log.csv"
    path.write_text(path.read_text().replace("<run ", f'<output name="{target}" type="CSV" rate="1"/><run '))
    flown = fly_case(Case(source=path))
    assert flown.columns["time_s"][-1] == pytest.approx(1.0)
    assert any(f'left out: <output name="{target}" type="CSV">' in word for word in flown.warnings)
    assert not target.exists()


def test_a_file_that_ends_jsbsim_ends_its_own_process_only(tmp_path: Path) -> None:
    """An altitude that is no number makes JSBSim abort the interpreter."""
    start = tmp_path / "start.xml"
    start.write_text(START.replace("30000", "nan"))
    with pytest.raises(AircraftError, match=r"start.xml: JSBSim ended its process by SIGABRT: .*nan"):
        fly_apart(Case(source=BRICK, initial_file=str(start), duration_s=0.1, step_s=0.01))


def test_a_temporary_folder_without_room_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (64, hard))  # bytes in any file of a child
    try:
        with pytest.raises(InputError, match=f"the temporary folder {tmp_path} cannot be used: File too large") as told:
            fly_apart(Case(source=BRICK, duration_s=0.1, step_s=0.01))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "TMPDIR" in told.value.hint
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "said"),
    [("<initialize", "cannot be read as XML"), ("<planet/>", "begins with <planet>")],
)
def test_an_initialization_file_is_one(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "start.xml"
    file.write_text(text)
    with pytest.raises(AircraftError, match=said):
        fly_case(Case(source=BRICK, initial_file=str(file), duration_s=0.1, step_s=0.01))


def test_what_jsbsim_passes_over_is_told(tmp_path: Path) -> None:
    start, planet = tmp_path / "start.xml", tmp_path / "planet.xml"
    start.write_text(START.replace("</init", "<altitud>1</altitud></init"))
    planet.write_text("<planet><radius>1</radius></planet>")
    flown = fly_case(Case(source=BRICK, initial_file=str(start), planet_file=str(planet), duration_s=0.1, step_s=0.01))
    assert sum("passes over it" in word for word in flown.warnings) == 2


def test_a_process_of_its_own_flies_the_same_flight_and_knows_its_error() -> None:
    """The tumble's error at 100 Hz is known from the same flight at a sixteenth of the step."""
    start = case_start([("altitude_m", 1e4), ("p_deg_s", 30.0), ("q_deg_s", 5.0), ("r_deg_s", 40.0)])
    case = Case(source=BRICK, start=start, duration_s=5.0, step_s=0.01)
    found, here = fly_apart_checked(case), fly_case(case)
    fine = fly_case(replace(case, step_s=0.01 / 16, sample_interval_s=0.01))
    assert found.outcome is Outcome.COMPLETED
    for name, values in here.columns.items():
        assert np.array_equal(found.columns[name], values)
    for name in ("p_rad_s", "q_rad_s", "r_rad_s", "psi_rad", "altitude_m"):
        off = fine.columns[name] - here.columns[name]
        error = np.abs(np.angle(np.exp(1j * off)) if name == "psi_rad" else off).max()
        assert (
            error <= found.step_error[name] < 3.0 * error
        )  # of a smooth motion: 1.5 at second order, 2.3 measured where both orders meet
    assert "flown again at 0.005 s" in found.provenance["step_check"]
    assert not fly_apart(replace(case, duration_s=0.1)).step_error


def test_an_error_that_cannot_be_known_is_no_error_of_the_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    case = Case(source=BRICK, duration_s=0.1, step_s=0.01)
    flown = fly_case(case)

    def refuse(_: Case) -> FlownCase:
        raise InputError("it does not fly at half the step")

    monkeypatch.setattr("finback.flight.case_resolution.fly_case", refuse)
    found = with_step_error(case, flown)
    assert not found.step_error
    assert "not known: at half the step, it does not fly at half the step" in found.warnings[-1]


def test_a_flight_of_one_step_knows_no_error_of_its_step() -> None:
    case = Case(source=BRICK, duration_s=1e-9, step_s=0.01)
    found = with_step_error(case, fly_case(case))
    assert not found.step_error
    assert "not known: the flight at half the step has no row beside its start" in found.warnings[-1]


@pytest.mark.parametrize("height_ft", [10.0, 1000.0])
def test_an_aircraft_that_falls_through_the_ground_is_told(height_ft: float) -> None:
    start = case_start([("altitude_ft", height_ft)])
    found = fly_case(Case(source=BRICK, start=start, duration_s=2.0, step_s=0.01))
    assert any("below the ground" in word for word in found.warnings) == (height_ft < 50.0)
