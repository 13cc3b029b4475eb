"""What is moved while a case is flown: by name and by property, held either way, and what the model takes back."""

from __future__ import annotations

from pathlib import Path

import jsbsim
import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.errors import FaultyFileError, InputError
from finback.flight.case import Case, FlownCase
from finback.flight.case_drive import Drive, named_drive
from finback.flight.case_flight import fly_case
from finback.flight.case_start import case_start
from finback.flight.case_wind import WindProfile
from finback.records import Hold
from finback.study.schedules import read_schedules

DATA = Path(__file__).parent / "data" / "aircraft"
AIRLINER = Path(jsbsim.get_default_root_dir()) / "aircraft" / "737" / "737.xml"


def _drive(name: str, *points: tuple[float, float], hold: Hold = Hold.FOH) -> Drive:
    time, values = zip(*points, strict=True)
    return named_drive(name, np.array(time), np.array(values), hold)


def _fly(source: Path, *drives: Drive, **more: object) -> FlownCase:
    start = case_start([("altitude_ft", 20_000.0), ("airspeed_kt", 300.0)])
    asked = {"start": start, "duration_s": 1.0, "step_s": 0.01, **more}
    return fly_case(Case(source=source, drives=drives, **asked))  # type: ignore[arg-type] # fields of Case


def test_surfaces_and_every_engine_follow_their_names() -> None:
    names = ("elevator", "aileron", "rudder")
    flown = _fly(AIRLINER, *(_drive(name, (0.0, 0.0), (1.0, 0.1 * (k + 1))) for k, name in enumerate(names)),
                 _drive("throttle", (0.0, 0.3), (0.5, 0.3), (0.5, 0.8)))  # fmt: skip
    time = flown.columns["time_s"]
    for k, name in enumerate(names):
        np.testing.assert_allclose(flown.columns[f"{name}_command_1"], 0.1 * (k + 1) * time, atol=1e-12)
    np.testing.assert_allclose(flown.columns["throttle_command_1"][[0, 49, 51, 100]], [0.3, 0.3, 0.8, 0.8])
    assert flown.provenance["schedule fcs/throttle-cmd-norm"] == "foh: 0:0.3, 0.5:0.3, 0.5:0.8"
    idle = _fly(AIRLINER, _drive("throttle", (0.0, 0.0)), settings=(("propulsion/set-running", -1.0),), duration_s=5.0)
    full = _fly(AIRLINER, _drive("throttle", (0.0, 1.0)), settings=(("propulsion/set-running", -1.0),), duration_s=5.0)
    assert full.columns["u_m_s"][-1] - idle.columns["u_m_s"][-1] > 0.5
    assert abs(full.columns["psi_rad"][-1]) < 1e-3  # one engine alone would yaw it


@given(st.lists(st.floats(0.0, 9.0), min_size=1, max_size=6), st.floats(0.0, 9.0))
def test_a_held_value_lasts_until_the_next_point(times: list[float], at: float) -> None:
    times.sort()
    values = np.arange(len(times), dtype=np.float64)
    drive = Drive(jsbsim_property="a/b", time_s=np.array(times), values=values, hold=Hold.ZOH)
    found = float(drive.at(np.array([at]))[0])
    if at in times:
        sides = [
            max([0, *(k for k, time in enumerate(times) if time < at)]),
            int(np.searchsorted(times, at, "right")) - 1,
        ]
        assert found == np.mean(sides)
    else:
        assert found == max([0, *(k for k, time in enumerate(times) if time < at)])


def test_the_model_may_not_take_a_schedule_back() -> None:
    """The 737's flight control moves its elevator; a body without one lets it be moved."""
    with pytest.raises(InputError, match="sets 'fcs/elevator-pos-rad' itself"):
        _fly(AIRLINER, _drive("elevator_deg", (0.0, -3.0)))
    raw = Drive(jsbsim_property="fcs/elevator-pos-rad", time_s=np.zeros(1), values=np.array([0.1]))
    assert any("the schedule of it is not flown" in word for word in _fly(AIRLINER, raw).warnings)
    flown = _fly(DATA / "brick" / "brick.xml", _drive("elevator_deg", (0.0, -3.0), (1.0, -1.0)))
    assert np.degrees(flown.columns["elevator_rad"][[0, 100]]) == pytest.approx([-3.0, -1.0])
    with pytest.raises(InputError, match="reads before the flight only"):
        _fly(AIRLINER, _drive("ic/alpha-rad", (0.0, 0.1)))


def test_a_jump_between_two_steps_is_told() -> None:
    brick = DATA / "brick" / "brick.xml"
    for points, hold, told in (
        (((0.0, 0.0), (0.5, 0.0), (0.5, 1.0)), Hold.FOH, False),
        (((0.0, 0.0), (0.505, 0.0), (0.505, 1.0)), Hold.FOH, True),
        (((0.0, 0.0), (0.505, 1.0)), Hold.FOH, False),
        (((0.0, 0.0), (0.505, 1.0)), Hold.ZOH, True),
        (((0.0, 0.0), (0.3, 1.0)), Hold.ZOH, False),
        (((0.0, 1.0), (0.505, 1.0)), Hold.ZOH, False),
    ):
        flown = _fly(brick, _drive("elevator", *points, hold=hold))
        assert any("jumps at 0.505 s, between two steps" in word for word in flown.warnings) is told


def test_winds_over_time_and_altitude_blow_from_the_first_row() -> None:
    brick = DATA / "brick" / "brick.xml"
    gust = _fly(brick, _drive("wind_east_m_s", (0.0, 5.0), (1.0, 15.0)))
    np.testing.assert_allclose(gust.columns["wind_east_m_s"], 5.0 + 10.0 * gust.columns["time_s"], rtol=1e-9)
    assert gust.columns["airspeed_m_s"][0] == pytest.approx(300 * 1852 / 3600)
    shear = WindProfile(
        altitude_m=np.array([0.0, 10_000.0]), north_m_s=np.array([0.0, 50.0]), east_m_s=np.array([10.0, 10.0])
    )
    fall = _fly(brick, wind=(shear,), start=case_start([("altitude_m", 9000.0), ("velocity_down_m_s", 100.0)]))
    # the altitude of each row is met by a straight line over the step: h² of 0.01 s times 9.8 m/s², and its slope
    np.testing.assert_allclose(fall.columns["wind_north_m_s"], fall.columns["altitude_m"] * 5e-3, atol=1e-5)
    assert fall.columns["airspeed_m_s"][0] == pytest.approx(np.sqrt(100.0**2 + 45.0**2 + 10.0**2), rel=1e-9)
    with pytest.raises(InputError, match="another one over time"):
        _fly(brick, wind=(shear,), start=case_start([("altitude_m", 9000.0), ("wind_east_m_s", 1.0)]))


@given(st.floats(-2e3, 2e4))
def test_a_profile_is_straight_between_and_held_beyond(altitude_m: float) -> None:
    heights, east = np.array([0.0, 1000.0, 12_000.0]), np.array([3.0, -4.0, 30.0])
    found = WindProfile(altitude_m=heights, north_m_s=np.zeros(3), east_m_s=east).native()(altitude_m / 0.3048)
    assert found[1] * 0.3048 == pytest.approx(float(np.interp(altitude_m, heights, east)), abs=1e-9)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("elevater", "did you mean elevator"),
        ("elevator_ft", "'ft' does not measure elevator"),
        ("x", "known: elevator"),
        ("wind_east", "did you mean wind_east_ft_s"),
    ],
)
def test_unknown_names_are_answered(name: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        _drive(name, (0.0, 0.0))
    assert said in str(caught.value)


def test_a_file_of_schedules(tmp_path: Path) -> None:
    path = tmp_path / "it.toml"
    path.write_text(
        'schema = 1\n[[schedule]]\nname = "elevator"\nhold = "zoh"\ntime_s = [0, 1.5]\nvalue = [0.0, -0.2]\n'
        '[[schedule]]\nname = "fcs/flap-cmd-norm"\ntime_s = [0.0]\nvalue = [1]\n'
    )
    one, two = read_schedules(path)
    assert (one.jsbsim_property, one.hold, two.hold) == ("fcs/elevator-cmd-norm", Hold.ZOH, Hold.FOH)
    assert one.at(np.array([1.4, 1.6])).tolist() == [0.0, -0.2]
    path.write_text('schema = 2\n[[schedule]]\nname = "elevator"\nhold = "z"\ntime_s = [nan]\n')
    with pytest.raises(FaultyFileError) as caught:
        read_schedules(path)
    assert len(caught.value.faults) == 4
    path.write_text('schema = 1\n[[schedule]]\nname = "elevatr"\ntime_s = [1.0]\nvalue = [1.0]\n')
    with pytest.raises(FaultyFileError, match=r"schedule\[0\]: nothing .* 'elevatr'; did you mean elevator"):
        read_schedules(path)


def test_multisines_of_a_file_are_orthogonal_about_their_trims(tmp_path: Path) -> None:
    """Two controls moved at once over whole periods: neither has a part in what the other does."""
    path = tmp_path / "it.toml"
    text = (
        'schema = 1\n[[multisine]]\nnames = ["elevator", "fcs/canard-cmd-norm"]\naround = [-0.1, 0.3]\n'
        "amplitude = [0.05, 0.2]\nlowest_hz = 0.1\nhighest_hz = 1.5\nperiod_s = 20\nperiods = 2\nlead_s = 1\n"
    )
    path.write_text(text)
    one, two = read_schedules(path)
    assert [drive.jsbsim_property for drive in (one, two)] == ["fcs/elevator-cmd-norm", "fcs/canard-cmd-norm"]
    time = 1.0 + np.arange(4000) * 0.01
    values = np.array([one.at(time) + 0.1, two.at(time) - 0.3])
    gram = values @ values.T
    assert abs(gram[0, 1]) < 1e-3 * np.sqrt(gram[0, 0] * gram[1, 1])  # straight lines between points
    np.testing.assert_allclose(np.abs(values).max(axis=1), [0.05, 0.2], rtol=0.01)
    still = np.array([0.0, 0.5, 41.0, 50.0])
    np.testing.assert_allclose([one.at(still), two.at(still)], [[-0.1] * 4, [0.3] * 4], atol=1e-9)
    for wrong, said in (
        ("around = [-0.1]", r"multisine\[0\]: 2 names, 1 values"),
        ("around = [-0.1, 0.3]\nlowest_h = 1", "lowest_h"),
    ):
        path.write_text(text.replace("around = [-0.1, 0.3]", wrong))
        with pytest.raises(FaultyFileError, match=said):
            read_schedules(path)
    path.write_text(text.replace("period_s = 20", "period_s = 0.7"))
    with pytest.raises(FaultyFileError, match="too few for 2 inputs"):
        read_schedules(path)
    path.write_text("schema = 1\n")
    with pytest.raises(FaultyFileError, match="missing; add a table"):
        read_schedules(path)
