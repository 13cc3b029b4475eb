"""Records, schedules and channels."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from finback.channels import CHANNELS, channel
from finback.errors import InputError
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.units import SI_FACTORS

CONDITION = Condition(airspeed_m_s=200.0, density_kg_m3=0.5, gravity_m_s2=9.8, altitude_m=8000.0)
HELD = Schedule(time_s=np.array([0.0]), elevator_rad=np.array([0.1]))


def record(name: str = "flight", **columns: object) -> FlightRecord:
    values = {"time_s": [0.0, 0.01, 0.02], "alpha_rad": [0.0, 0.1, 0.2], **columns}
    return FlightRecord(
        name=name,
        columns=values,  # type: ignore[arg-type]
        outcome=Outcome.COMPLETED,
        note="",
        condition=CONDITION,
        schedule=HELD,
        hold=Hold.FOH,
    )


def test_every_channel_is_in_si_and_its_plot_unit_has_the_same_dimension() -> None:
    for name, item in CHANNELS.items():
        assert item.name == name
        assert SI_FACTORS[item.unit][1] == 1.0
        assert SI_FACTORS[item.display_unit][0] == item.unit
        assert SI_FACTORS[item.jsbsim_unit][0] == item.unit or not item.jsbsim_property


def test_a_wrong_channel_is_told_the_right_one() -> None:
    with pytest.raises(InputError, match="alpha_rad"):
        channel("alpha_deg")
    with pytest.raises(InputError, match="unknown channel"):
        record(alpha_deg=[0.0, 1.0, 2.0])


def test_columns_are_read_only_copies() -> None:
    mine = np.array([0.0, 0.1, 0.2])
    flight = record(alpha_rad=mine)
    mine[0] = 9.0
    assert flight["alpha_rad"][0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        flight["alpha_rad"][0] = 1.0


def test_with_columns_leaves_the_original_alone() -> None:
    flight = record()
    other = flight.with_columns(alpha_rad=-flight["alpha_rad"])
    assert other["alpha_rad"][2] == -0.2
    assert flight["alpha_rad"][2] == 0.2
    assert list(flight.frame().columns) == ["time_s", "alpha_rad"]
    assert flight.duration_s == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"q_rad_s": [0.0]}, "different lengths"),
        ({"time_s": [0.0, 0.0, 0.1]}, "must increase"),
        ({"time_s": [0.0, np.nan, 0.1]}, "be finite"),
        ({"time_s": [0.0, 0.1, np.inf]}, "be finite"),
        ({"q_rad_s": [[0.0, 1.0, 2.0]]}, "shape"),
    ],
)
def test_impossible_records_are_refused(columns: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says):
        record(**columns)


def test_a_missing_column_names_those_there() -> None:
    with pytest.raises(InputError, match="time_s, alpha_rad"):
        record()["q_rad_s"]


def test_a_sweep_has_each_name_once() -> None:
    with pytest.raises(InputError, match="same name: a"):
        Sweep(study="s", records=(record("a"), record("a")))
    sweep = Sweep(study="s", records=(record("a"), record("b")))
    assert sweep["b"].name == "b"
    with pytest.raises(InputError, match="flights: a, b"):
        sweep["c"]


def test_a_jump_is_the_new_value_and_its_drive_the_mean() -> None:
    schedule = Schedule(time_s=np.array([0.0, 1.0, 1.0, 2.0]), elevator_rad=np.array([0.0, 0.0, 0.4, 0.6]))
    assert schedule.value([0.5, 1.0, 1.5, 3.0]) == pytest.approx([0.0, 0.4, 0.5, 0.6])
    assert schedule.drive([0.5, 1.0, 1.5, 3.0]) == pytest.approx([0.0, 0.2, 0.5, 0.6])


@given(
    arrays(np.float64, st.integers(1, 8), elements=st.floats(-1, 1)),
    st.floats(0, 10),
)
def test_without_jumps_value_and_drive_are_linear_interpolation(values: np.ndarray, time: float) -> None:
    knots = np.arange(values.size, dtype=float)
    schedule = Schedule(time_s=knots, elevator_rad=values)
    expected = np.interp(time, knots, values)
    rounding = 1e-15  # values are of order one
    assert schedule.value(time) == pytest.approx(expected, abs=rounding)
    assert schedule.drive(time) == pytest.approx(expected, abs=rounding)


@pytest.mark.parametrize(
    ("time", "elevator"),
    [([], []), ([0.0, 1.0], [0.0]), ([1.0, 0.0], [0.0, 0.0]), ([0.0, 0.0, 0.0], [0.0] * 3), ([0.0], [np.nan])],
)
def test_impossible_schedules_are_refused(time: list[float], elevator: list[float]) -> None:
    with pytest.raises(InputError):
        Schedule(time_s=np.array(time), elevator_rad=np.array(elevator))


def test_what_is_pickled_comes_back_checked_and_read_only() -> None:
    """A campaign's flights cross a process boundary; an array unpickled by itself could be written to."""
    sweep = Sweep(study="s", records=(record("a"), record("b")), provenance={"seed": "3"})
    back = pickle.loads(pickle.dumps(sweep))  # noqa: S301 - our own bytes
    assert dict(back.provenance) == {"seed": "3"}
    assert [flight.name for flight in back.records] == ["a", "b"]
    for name, values in sweep["a"].columns.items():
        assert back["a"][name].tobytes() == values.tobytes()
        assert not back["a"][name].flags.writeable
    assert not back["a"].schedule.time_s.flags.writeable
    with pytest.raises(TypeError):
        back["a"].columns["q_rad_s"] = values  # type: ignore[index]
