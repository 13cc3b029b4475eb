"""Flights for the tests of recordings: short, exact, with what real ones have."""

from __future__ import annotations

import numpy as np
import pytest

from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule


@pytest.fixture
def flight() -> FlightRecord:
    """Return two seconds of a damped pitch oscillation at 50 Hz, in numbers that no unit conversion keeps."""
    time = np.arange(100) / 50
    decay = np.exp(-0.6 * time)
    alpha = 0.1 + 0.2 * decay * np.cos(3.0 * time)
    q = np.gradient(alpha, time)
    return FlightRecord(
        name="doublet-01",
        columns={
            "time_s": time,
            "alpha_rad": alpha,
            "q_rad_s": q,
            "theta_rad": alpha + 0.05 * time,
            "airspeed_m_s": np.full(100, 250.0),
            "altitude_m": np.full(100, 9000.0),
            "elevator_rad": np.where(time < 0.5, -0.1, 0.05),
        },
        outcome=Outcome.COMPLETED,
        note="flew its 2 s",
        condition=Condition(airspeed_m_s=250.0, density_kg_m3=0.5, gravity_m_s2=9.80665, altitude_m=9000.0),
        schedule=Schedule(time_s=np.array([0.0, 0.5, 0.5]), elevator_rad=np.array([-0.1, -0.1, 0.05])),
        hold=Hold.ZOH,
        provenance={"aircraft": "test", "note|with": "a | bar\nand a line"},
    )
