"""The loop of flights against the same written plainly, and a rig's rows however many are asked for."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.flight.aircraft import find_aircraft
from finback.flight.ending import RATE_LIMIT_RAD_S
from finback.flight.plan import FlightPlan
from finback.flight.recorder import Recorder
from finback.flight.rig import Rig
from finback.flight.steps import NOWHERE, Steps, Stop
from finback.records import Condition, FlightRecord, Hold, Schedule

ROOT = Path(__file__).resolve().parents[2]
CONDITION = Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)
LIMITS_RAD = (-0.5, 0.8)
_States = list[tuple[float, float, float]]  # alpha, q, altitude of each step
_STATE = st.tuples(
    st.sampled_from([0.1, 0.2, 0.79, 0.8, -0.5, math.nan]),
    st.sampled_from([0.0, 1.0, 20.0, -20.0, math.nan]),
    st.sampled_from([1.0, 2.0, 0.0, -1.0, math.inf]),
)
_GOOD = st.tuples(st.floats(-0.4, 0.7), st.floats(-19.0, 19.0), st.floats(1.0, 9.0))


def _plainly(states: _States, stride: int, altitude: int) -> tuple[Stop, int, _States]:
    rows: _States = []
    for step, (alpha, q, height) in enumerate(states, start=1):
        if not (LIMITS_RAD[0] < alpha < LIMITS_RAD[1] and abs(q) < RATE_LIMIT_RAD_S):
            return Stop.LIMITS, step, rows
        if step % stride:
            continue
        if not math.isfinite(alpha + q + height):
            return Stop.NOT_FINITE, step, rows
        if altitude != NOWHERE and height <= 0.0:
            return Stop.GROUND, step, rows
        rows.append((alpha, q, height))
    return Stop.COMMANDS, len(states), rows


@given(
    states=st.lists(st.one_of(_GOOD, _GOOD, _GOOD, _STATE), max_size=20),
    stride=st.integers(1, 4),
    altitude=st.sampled_from([NOWHERE, 2]),
)
def test_rows_and_ends_are_those_of_the_loop_written_plainly(states: _States, stride: int, altitude: int) -> None:
    commands = [float(number) for number in range(len(states))]
    driven: list[float] = []
    ran: list[bool] = []
    readers = [lambda index=index: states[len(ran) - 1][index] for index in range(3)]

    def run() -> bool:
        assert len(driven) == len(ran) + 1  # a command before each step
        ran.append(True)
        return True

    steps = Steps(drive=driven.append, run=run, alpha=readers[0], q=readers[1])
    recorder = Recorder(readers, ["1"] * 3)
    stop, flown = steps.record(commands, LIMITS_RAD, recorder, stride=stride, altitude=altitude)
    wanted = _plainly(states, stride, altitude)
    assert (stop, flown) == wanted[:2]
    assert recorder.table().tolist() == [list(row) for row in wanted[2]]
    assert driven == commands[:flown]
    driven.clear()
    ran.clear()
    left = next((n for n in range(1, len(states) + 1) if _plainly(states[:n], n + 1, NOWHERE)[0] is Stop.LIMITS), 0)
    assert steps.advance(commands, LIMITS_RAD) == left


@pytest.mark.parametrize("alpha_rad", [0.3, 0.75])
def test_fewer_rows_are_some_of_all_rows_bit_for_bit(alpha_rad: float) -> None:
    plan = FlightPlan(
        name="every",
        kind="release",
        alpha_rad=alpha_rad,
        q_rad_s=0.5,
        schedule=Schedule(time_s=np.array([0.0, 0.2, 0.3]), elevator_rad=np.array([-0.1, -0.1, -0.2])),
        hold=Hold.FOH,
        duration_s=1.0,
        sample_interval_s=1 / 400,
        alpha_limits_rad=(-0.5, 0.8),
    )
    with Rig(find_aircraft("f8ii", near=ROOT), CONDITION, step_s=1 / 400) as rig:
        every: FlightRecord = rig.fly(plan)
        for stride in (4, 7):
            fewer = rig.fly(replace(plan, sample_interval_s=stride / 400))
            assert (fewer.outcome, len(fewer)) == (every.outcome, 1 + (len(every) - 1) // stride)
            for name in set(every.columns) - {"time_s", "elevator_rad"}:  # asked for at the rows' own times
                assert fewer[name].tobytes() == every[name][::stride][: len(fewer)].tobytes()
