"""How fast flights are, both sides of every comparison in one run: recording, processes, campaigns, start-up.

Times are CPU times of the processes that work, which other work on the machine hardly changes; wall-clock times stand
beside them. Limits are those of the project's plan; the exit code is 1 if one is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final

import numpy as np

from finback.flight.airborne import Airborne
from finback.flight.aircraft import find_aircraft
from finback.flight.campaign.fleet import LocalFleet
from finback.flight.campaign.flying import fly_campaign
from finback.flight.campaign.plan import Campaign, History
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
SCALING_LIMIT: Final = 1.8
FLATNESS_LIMIT: Final = 0.10
START_LIMIT_S: Final = 1.5
_WIDTH: Final = 56  # characters of a row's name
_COST: Final = "ms a flight, CPU"
STUDY: Final = """
schema = 1
name = "bench"
aircraft = "AIRCRAFT"
seed = 1
[condition]
airspeed_m_s = 295.07
density_kg_m3 = 0.26548
gravity_m_s2 = 9.80665
altitude_m = 13026.6
[flight]
fidelity = "rig"
step_hz = 400
sample_hz = 100
alpha_limits_deg = [-33.0, 46.0]
elevator_limits_deg = [-40.0, 20.0]
elevator_rate_deg_s = 60.0
[sensors]
alpha_noise_deg = 0.1
q_noise_deg_s = 0.1
[campaign]
[campaign.maneuver]
kind = "release"
elevator_deg = { uniform = [-35.0, 10.0] }
alpha_deg = { normal = [5.0, 12.0], limits = [-30.0, 44.0] }
q_deg_s = { uniform = [-30.0, 30.0] }
duration_s = 2.0
"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of the result: what was measured, and whether a limit holds."""

    what: str
    value: float
    unit: str
    limit: str = ""
    holds: bool = True


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


def children_s() -> float:
    """Return the CPU time of child processes that ended, in s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """A campaign that was flown: times in s once the workers were up, and of the parent alone."""

    flights: int
    wall_s: float
    workers_s: float
    parent_s: float


def cpu_s(pids: Sequence[int]) -> float:
    """Return the CPU time that running processes have used so far, in s."""
    ticks = 0
    for pid in pids:
        words = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        ticks += int(words[11]) + int(words[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def fly(campaign: Campaign, workers: int) -> Flown:
    """Fly a campaign without writing it; the clocks start when all workers can fly."""
    with LocalFleet(campaign, workers=workers) as fleet:
        fleet.wait_for_all()
        before = cpu_s(fleet.pids)
        wall, own = time.perf_counter(), time.process_time()
        count = sum(len(flights) for flights in fly_campaign(campaign, fleet))
        wall, own = time.perf_counter() - wall, time.process_time() - own
        used = cpu_s(fleet.pids) - before
    assert count == campaign.flights
    return Flown(flights=count, wall_s=wall, workers_s=used, parent_s=own)


def processes(campaign: Campaign, flights: int, rounds: int) -> list[Row]:
    """Measure two processes against one, in turn."""
    small = replace(campaign, draws=flights, partition_flights=flights)
    pairs = [(fly(small, 1), fly(small, 2)) for _ in range(rounds)]
    wall = statistics.median(one.wall_s / two.wall_s for one, two in pairs)
    # Alone on two cores the wall clock would show the busiest process; each worker has half of the work.
    alone = statistics.median((one.workers_s + one.parent_s) / (two.workers_s / 2 + two.parent_s) for one, two in pairs)
    scale = 1e3 / flights
    return [
        Row(what="1 process", value=scale * statistics.median(one.workers_s for one, _ in pairs), unit=_COST),
        Row(
            what="2 processes, together", value=scale * statistics.median(two.workers_s for _, two in pairs), unit=_COST
        ),
        Row(what="of it the parent", value=scale * statistics.median(two.parent_s for _, two in pairs), unit=_COST),
        Row(what="2 processes over 1, wall clock (of an idle machine)", value=wall, unit=""),
        Row(
            what="2 processes over 1, by CPU time",
            value=alone,
            unit="",
            limit=f">= {SCALING_LIMIT}",
            holds=alone >= SCALING_LIMIT,
        ),
    ]


def flatness(campaign: Campaign, counts: Sequence[int]) -> list[Row]:
    """Measure what a flight costs in campaigns of growing length, once the worker is up."""
    rows, costs = [], []
    for count in counts:
        # A short campaign is flown often enough for its clock, which ticks in hundredths of a second.
        longer = replace(campaign, draws=count)
        repeats = max(1, 1000 // count)
        flown = [fly(longer, 1) for _ in range(repeats)]
        cost = sum(one.workers_s + one.parent_s for one in flown) / (count * repeats)
        costs.append(cost)
        rows.append(Row(what=f"campaign of {count}", value=cost * 1e3, unit=_COST))
    spread = max(abs(cost / costs[0] - 1) for cost in costs)
    limit = f"<= ±{FLATNESS_LIMIT:.0%}"
    rows.append(
        Row(
            what="change with the number of flights", value=spread, unit="", limit=limit, holds=spread <= FLATNESS_LIMIT
        )
    )
    return rows  # fmt: skip


def memory(study: Path, folder: Path, counts: Sequence[int]) -> list[Row]:
    """Measure the largest memory of the program and of a worker for campaigns of growing length."""
    rows = []
    for count in counts:
        text = study.read_text(encoding="utf-8").replace("[campaign]", f"[campaign]\ndraws = {count}", 1)
        text = text.replace("duration_s = 2.0", "duration_s = 0.1")
        path = folder / f"memory-{count}.toml"
        path.write_text(text, encoding="utf-8")
        code = (
            "import resource, sys; from finback.cli.main import main\n"
            "try: main()\n"
            "finally: print(*(resource.getrusage(who).ru_maxrss for who in"
            " (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)), file=sys.stderr)"
        )
        command = [sys.executable, "-c", code, "sweep", str(path), "--output", str(folder), "--json"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 - our own program
        assert json.loads(done.stdout)["flights"] == count
        own, worker = (int(word) / 1024 for word in done.stderr.split()[-2:])
        rows.append(Row(what=f"memory, {count} flights: program", value=own, unit="MB"))
        rows.append(Row(what=f"memory, {count} flights: a worker", value=worker, unit="MB"))
    return rows


def start_up(study: Path, rounds: int) -> list[Row]:
    """Measure from the start of the program to its first flight: the time that passes, and the CPU time on its way."""
    code = (
        "import sys, time; from pathlib import Path; start = time.perf_counter()\n"
        "from finback.flight.campaign.fleet import LocalFleet\n"
        "from finback.flight.campaign.message import Chunk\n"
        "from finback.study import read_campaign_study\n"
        "campaign = read_campaign_study(Path(sys.argv[1])).campaign\n"
        "with LocalFleet(campaign, workers=1) as fleet:\n"
        "    import finback.campaign\n"
        "    fleet.give(Chunk(first=0, count=1)); fleet.take()\n"
        "    print(time.perf_counter() - start)\n"
    )
    wall, used = [], []
    for _ in range(rounds):
        before, begun = children_s(), time.perf_counter()
        subprocess.run([sys.executable, "-c", code, str(study)], check=True, capture_output=True)  # noqa: S603 - as above
        wall.append(time.perf_counter() - begun)
        used.append(children_s() - before)
    cpu = statistics.median(used)
    return [
        # All processes together: on an idle machine less time passes than this.
        Row(
            what="start-up to the first flight, all CPU time",
            value=cpu,
            unit="s",
            limit=f"<= {START_LIMIT_S} s",
            holds=cpu <= START_LIMIT_S,
        ),
        Row(what="start-up to the first flight, wall clock, median", value=statistics.median(wall), unit="s"),
        Row(what="start-up to the first flight, wall clock, best", value=min(wall), unit="s"),
    ]


def show(rows: list[Row]) -> list[Row]:
    """Print what was measured, and return it."""
    for row in rows:
        verdict = "" if not row.limit else f"  {row.limit}: {'holds' if row.holds else 'MISSED'}"
        print(f"{row.what:<{_WIDTH}}  {row.value:9.3f} {row.unit}{verdict}", flush=True)
    return rows


def main() -> int:
    """Measure, print a table, and tell whether all limits hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7, help="repetitions of short measurements")
    parser.add_argument("--flights", type=int, default=10_000, help="the longest campaign of the flatness")
    parser.add_argument("--memory", type=int, default=10_000, help="the longest campaign of the memory; 0: none")
    parser.add_argument("--recording", action="store_true", help="measure the recording only")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="finback-bench-") as name:
        study = Path(name) / "study.toml"
        study.write_text(STUDY.replace("AIRCRAFT", str(ROOT / "aircraft" / "f8ii")), encoding="utf-8")
        campaign = replace(read_campaign_study(study).campaign, history=History())
        rows = show(recording("f8ii", 8000, asked.rounds))
        rows += show(recording("f16", 4000, asked.rounds))
        if asked.recording:
            return 0 if all(row.holds for row in rows) else 1
        rows += show(start_up(study, asked.rounds))
        rows += show(processes(campaign, 400, 3))
        rows += show(flatness(campaign, [count for count in (100, 1000, 10_000) if count <= asked.flights]))
        if asked.memory:
            counts = [count for count in (100, 1000, 10_000, 100_000) if count <= asked.memory]
            rows += show(memory(study, Path(name), counts))
    print(f"load of the machine at the end: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    return 0 if all(row.holds for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
