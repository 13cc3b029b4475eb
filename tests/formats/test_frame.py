"""Records of tables: units, names, signs, and what every fault says."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from finback.errors import InputError
from finback.formats.frame import increasing, record_from_frame
from finback.records import Condition, FlightRecord, Hold

CONDITION = Condition(airspeed_m_s=100.0, density_kg_m3=1.0, gravity_m_s2=9.8, altitude_m=0.0)


def _record(frame: pd.DataFrame, **more: object) -> FlightRecord:
    return record_from_frame(frame, name="it", condition=CONDITION, hold=Hold.FOH, **more)  # type: ignore[arg-type]


def _frame() -> pd.DataFrame:
    return pd.DataFrame(
        {"time_s": [0.0, 1.0], "alpha_deg": [0.0, 180.0], "airspeed_kt": [1.0, 2.0], "elevator_deg": [0, 9]}
    )


def test_columns_become_channels_in_si() -> None:
    record = _record(_frame())
    np.testing.assert_allclose(record["alpha_rad"], [0.0, math.pi])
    np.testing.assert_allclose(record["airspeed_m_s"], [1852 / 3600, 2 * 1852 / 3600])
    assert record.hold is Hold.FOH


def test_foreign_names_and_signs_are_mapped() -> None:
    frame = _frame().rename(columns={"alpha_deg": "AoA", "elevator_deg": "stab"}).assign(rubbish="x")
    columns = {"time_s": "time_s", "AoA": "alpha_deg", "stab": "elevator_deg"}
    record = _record(frame, columns=columns, factors={"elevator": -1.0})
    assert list(record.columns) == ["time_s", "alpha_rad", "elevator_rad"]
    np.testing.assert_allclose(record["elevator_rad"], [0.0, -math.radians(9.0)])


def test_a_missing_number_stays_missing() -> None:
    assert np.isnan(_record(_frame().assign(alpha_deg=[np.nan, 1.0]))["alpha_rad"][0])


@pytest.mark.parametrize(
    ("frame", "more", "said"),
    [
        (_frame().rename(columns={"alpha_deg": "alpha"}), {}, "'alpha' names no unit"),
        (_frame().rename(columns={"alpha_deg": "alfa_deg"}), {}, "'alfa_deg' is no channel .did you mean 'alpha_rad'"),
        (_frame().assign(alpha_rad=0.0), {}, "'alpha_rad' is given twice"),
        (_frame().drop(columns="elevator_deg"), {}, "there is no 'elevator_rad'"),
        (_frame().assign(alpha_deg=["x", "1"]), {}, "'alpha_deg': 1 cells are no numbers"),
        (_frame(), {"columns": {"tme_s": "time_s"}}, "no column 'tme_s' .did you mean 'time_s'"),
        (_frame(), {"factors": {"rudder": -1.0}}, "factors name 'rudder'"),
        (_frame().assign(time_s=[1.0, 0.0]), {}, "time does not increase at 1 of 2 rows; the first is row 1"),
    ],
)
def test_faults_name_the_column(frame: pd.DataFrame, more: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        _record(frame, **more)


def test_a_row_that_was_written_twice_is_left_out_and_a_clock_set_back_is_not() -> None:
    frame = pd.DataFrame({"t": np.arange(200.0), "x": 1.0})
    twice = pd.concat([frame.iloc[:50], frame.iloc[49:]], ignore_index=True)
    found, said = increasing(twice, "t")
    assert len(found) == 200
    assert said == ("1 of 201 rows left out, whose time does not go on, the first at row 50",)
    assert increasing(frame, "t") == (frame, ())
    with pytest.raises(InputError, match="does not increase at 100 of 200"):
        increasing(frame.assign(t=np.arange(200.0) % 100), "t")
    with pytest.raises(InputError, match="no column 'time'"):
        increasing(frame, "time")
