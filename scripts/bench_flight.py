"""How fast flights are, both sides of every comparison in one run: recording, processes, campaigns, start-up.

Times are CPU times of the processes that work, which other work on the machine hardly changes; wall-clock times stand
beside them, and are judged where the machine was idle at the start. Limits are those of the project's plan; the exit
code is 1 if one is missed.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from bench_campaigns import STUDY, flatness, memory, processes, start_up
from bench_row import Row, show

from finback.flight.airborne import Airborne
from finback.flight.aircraft import find_aircraft
from finback.flight.case import Case, FlownCase
from finback.flight.case_column import CASE_COLUMNS
from finback.flight.case_flight import fly_case
from finback.flight.plan import FIDELITIES, FlightOptions, FlightPlan
from finback.flight.recorder import Recorder
from finback.flight.rig import Rig
from finback.flight.simulator import Simulator
from finback.flight.steps import Steps, Stop
from finback.records import Condition, FlightRecord, Hold, Schedule
from finback.study import read_campaign_study

ROOT: Final = Path(__file__).resolve().parents[1]
CHANNELS: Final = 30
STEP_S: Final = 1 / 400
START: Final = {"ic/h-sl-ft": 30000.0, "ic/u-fps": 900.0}
CONDITION: Final = Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)
ANY_ALPHA_RAD: Final = (-3.1, 3.1)
ALPHA_RAD: Final = 0.05
ELEVATOR_RAD: Final = -0.05
RECORDING_LIMIT: Final = 1.7
IDLE_LOAD: Final = 0.3  # of each core, over the last minute: below, the wall clock tells of us alone


def paired(one: Callable[[], None], two: Callable[[], None], rounds: int) -> tuple[float, float, float]:
    """Return the medians of two CPU times measured in turn, in s, and the median of their ratios."""
    first: list[float] = []
    second: list[float] = []
    for _ in range(rounds):
        for work, times in ((one, first), (two, second)):
            start = time.process_time()
            work()
            times.append(time.process_time() - start)
    ratios = [late / early for early, late in zip(first, second, strict=True)]
    return statistics.median(first), statistics.median(second), statistics.median(ratios)


def recording(name: str, steps: int, rounds: int) -> list[Row]:
    """Measure the bare ``run()`` loop of an aircraft against the same with 30 channels at every step."""
    aircraft = find_aircraft(name, near=ROOT)
    simulator = Simulator(aircraft.path, step_s=STEP_S, freeze_position=False)
    simulator.write(START)
    known = [column for column in CASE_COLUMNS if simulator.has(column.jsbsim_property)][:CHANNELS]
    assert len(known) == CHANNELS
    getters = [simulator.getter(column.jsbsim_property) for column in known]

    def bare() -> None:
        simulator.reset()
        simulator.start()
        run = simulator.run
        for _ in range(steps):
            run()

    elevator = simulator.setter("fcs/elevator-cmd-norm")
    alpha, q = simulator.getter("aero/alpha-rad"), simulator.getter("velocities/q-rad_sec")
    loop = Steps(drive=elevator, run=simulator.run, alpha=alpha, q=q)
    commands = [0.0] * steps

    def recorded() -> None:
        simulator.reset()
        simulator.start()
        recorder = Recorder(getters, [column.jsbsim_unit for column in known])
        flown = loop.record(commands, ANY_ALPHA_RAD, recorder, stride=1)
        assert flown == (Stop.COMMANDS, steps)
        assert recorder.table().shape == (steps, CHANNELS)

    bare()
    alone, together, ratio = paired(bare, recorded, rounds)
    scale = 1e6 / steps
    return [
        Row(what=f"{name}: run() alone", value=alone * scale, unit="µs a step"),
        Row(
            what=f"{name}: the vehicles' loop, {CHANNELS} channels at every step",
            value=together * scale,
            unit="µs a step",
        ),
        Row(
            what=f"{name}: flying with {CHANNELS} channels over bare",
            value=ratio,
            unit="",
            limit=f"<= {RECORDING_LIMIT}",
            holds=ratio <= RECORDING_LIMIT,
        ),
        Row(
            what=f"{name}: finback fly, all columns, over bare", value=_fly_ratio(aircraft.path, steps, alone), unit=""
        ),
        *(_vehicle(name, fidelity, steps, rounds) for fidelity in FIDELITIES),
    ]


def _vehicle(name: str, fidelity: str, steps: int, rounds: int) -> Row:
    """Measure a vehicle's own ``fly`` with a row at every step, from plan to record, over ``run()`` of its copy."""
    options = FlightOptions(
        fidelity=fidelity,
        step_s=STEP_S,
        sample_interval_s=STEP_S,
        alpha_limits_rad=ANY_ALPHA_RAD,
        elevator_limits_rad=(-1.0, 1.0),
        elevator_rate_rad_s=1.0,
    )
    plan = FlightPlan(
        name="bench",
        kind="release",
        alpha_rad=ALPHA_RAD,
        q_rad_s=0.0,
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.array([ELEVATOR_RAD])),
        hold=Hold.FOH,
        duration_s=steps * STEP_S,
        sample_interval_s=STEP_S,
        alpha_limits_rad=ANY_ALPHA_RAD,
    )
    aircraft = find_aircraft(name, near=ROOT)
    made = Rig(aircraft, CONDITION, step_s=STEP_S) if fidelity == "rig" else Airborne(aircraft, CONDITION, options)
    with made as vehicle:
        simulator = Simulator(vehicle.model, step_s=STEP_S, freeze_position=fidelity == "rig")
        simulator.write(START)
        rows = len(vehicle.fly(plan))
        columns = len(vehicle.fly(plan).columns)

        def bare() -> None:
            simulator.reset()
            simulator.start()
            run = simulator.run
            for _ in range(rows - 1):
                run()

        _, _, ratio = paired(bare, lambda: check_rows(vehicle.fly(plan), rows), rounds)
    return Row(
        what=f"{name}: {fidelity}, fly, {columns} columns, over bare",
        value=ratio,
        unit="",
        limit=f"<= {RECORDING_LIMIT}",
        holds=ratio <= RECORDING_LIMIT,
    )


def check_rows(record: FlightRecord, rows: int) -> None:
    """Raise unless a flight is as long as it should be."""
    assert len(record) == rows, record.note


def _fly_ratio(path: Path, steps: int, bare_s: float) -> float:
    """Return what ``finback fly`` costs with all its columns, loading included, over the bare loop."""
    case = Case(source=path, settings=tuple(START.items()), duration_s=steps * STEP_S, step_s=STEP_S)
    start = time.process_time()
    flown: FlownCase = fly_case(case)
    assert flown.columns["time_s"].size > 1
    return (time.process_time() - start) / bare_s


def main() -> int:
    """Measure, print a table, and tell whether all limits hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7, help="repetitions of short measurements")
    parser.add_argument("--flights", type=int, default=10_000, help="the longest campaign of the flatness")
    parser.add_argument("--memory", type=int, default=10_000, help="the longest campaign of the memory; 0: none")
    parser.add_argument("--recording", action="store_true", help="measure the recording only")
    asked = parser.parse_args()
    idle = os.getloadavg()[0] < IDLE_LOAD * len(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory(prefix="finback-bench-") as name:
        study = Path(name) / "study.toml"
        study.write_text(STUDY.replace("AIRCRAFT", str(ROOT / "aircraft" / "f8ii")), encoding="utf-8")
        campaign = read_campaign_study(study).campaign
        rows = show(recording("f8ii", 8000, asked.rounds))
        rows += show(recording("f16", 4000, asked.rounds))
        if not asked.recording:
            rows += show(start_up(study, asked.rounds, idle=idle))
            rows += show(processes(campaign, 1000, 3, idle=idle))
            rows += show(flatness(campaign, asked.flights, idle=idle))
            rows += show(memory(study, Path(name), asked.memory)) if asked.memory else []
    print("\nlimits of the plan:")
    show([row for row in rows if row.limit])
    print(f"the machine was {'idle' if idle else 'busy'}; load at the end {os.getloadavg()[0]:.1f}")
    return 0 if all(row.holds for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
