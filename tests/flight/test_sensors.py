"""Noise: its size, its seed, what it leaves alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from finback.errors import InputError
from finback.flight.sensors import Sensors, measure
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule

ROWS = 20_000
SENSORS = Sensors(alpha_noise_rad=0.002, q_noise_rad_s=0.003)


@pytest.fixture
def record(condition: Condition) -> FlightRecord:
    time = np.arange(ROWS) * 0.01
    names = ("alpha_rad", "q_rad_s", "theta_rad", "elevator_rad", "alpha_dot_rad_s", "q_dot_rad_s2")
    return FlightRecord(
        name="hold-01",
        columns={"time_s": time, **{name: np.sin(time) for name in names}},
        outcome=Outcome.COMPLETED,
        note="",
        condition=condition,
        schedule=Schedule(time_s=[0.0], elevator_rad=[0.0]),
        hold=Hold.FOH,
    )


def test_noise_is_white_of_the_stated_size_and_of_alpha_and_q_only(record: FlightRecord) -> None:
    seen = measure(record, SENSORS, seed=7, index=0)
    alpha = seen["alpha_rad"] - record["alpha_rad"]
    q = seen["q_rad_s"] - record["q_rad_s"]
    five_sigma = 5 / math.sqrt(ROWS)  # of a correlation, and about of a relative standard deviation
    assert alpha.std() == pytest.approx(0.002, rel=five_sigma)
    assert q.std() == pytest.approx(0.003, rel=five_sigma)
    for one, other in ((alpha, q), (alpha[1:], alpha[:-1]), (q[1:], q[:-1])):
        assert abs(np.corrcoef(one, other)[0, 1]) < five_sigma
    for name in ("time_s", "theta_rad", "elevator_rad"):
        assert (seen[name] == record[name]).all()
    assert not {"alpha_dot_rad_s", "q_dot_rad_s2"} & set(seen.columns)
    assert seen.provenance["seed"] == "7"
    assert float(seen.provenance["alpha_noise_rad"]) == 0.002


def test_seed_and_index_fix_every_bit(record: FlightRecord) -> None:
    first = measure(record, SENSORS, seed=7, index=3)
    assert (measure(record, SENSORS, seed=7, index=3)["alpha_rad"] == first["alpha_rad"]).all()
    assert (measure(record, SENSORS, seed=7, index=4)["alpha_rad"] != first["alpha_rad"]).any()
    assert (measure(record, SENSORS, seed=8, index=3)["alpha_rad"] != first["alpha_rad"]).any()


def test_silent_sensors_change_nothing(record: FlightRecord) -> None:
    seen = measure(record, Sensors(alpha_noise_rad=0.0, q_noise_rad_s=0.0), seed=1, index=0)
    assert (seen["alpha_rad"] == record["alpha_rad"]).all()


def test_impossible_sensors_and_seeds_are_refused(record: FlightRecord) -> None:
    with pytest.raises(InputError, match="alpha_noise_rad"):
        Sensors(alpha_noise_rad=-0.1, q_noise_rad_s=0.0)
    with pytest.raises(InputError, match="negative"):
        measure(record, SENSORS, seed=-1, index=0)
