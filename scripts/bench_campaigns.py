"""What campaigns cost: start-up, processes, growing numbers of flights, memory."""

from __future__ import annotations

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final

from bench_row import Row

from finback.flight.campaign.fleet import LocalFleet
from finback.flight.campaign.flying import fly_campaign
from finback.flight.campaign.plan import Campaign
from finback.store.campaign import write_partitions

SCALING_LIMIT: Final = 1.8
FLATNESS_LIMIT: Final = 0.10
START_LIMIT_S: Final = 1.5
_CORES: Final = 2
_COST: Final = "ms a flight, CPU"
_COST_WALL: Final = "ms a flight, wall"
_SHORTEST: Final = 100  # flights of the shortest campaign
_REPEATS: Final = 5  # of it before, and after the longer ones: a machine that slows down meanwhile is no growth
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
class Flown:
    """A campaign that was flown and written: times in s once the workers were up, and the largest worker's memory."""

    flights: int
    wall_s: float
    workers_s: float
    parent_s: float
    worker_mb: float

    @property
    def cost_s(self) -> float:
        """CPU time of a flight."""
        return (self.workers_s + self.parent_s) / self.flights


def cpu_s(pids: Sequence[int]) -> float:
    """Return the CPU time that running processes have used so far, in s."""
    ticks = 0
    for pid in pids:
        words = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        ticks += int(words[11]) + int(words[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def largest_mb(pids: Sequence[int]) -> float:
    """Return the most memory that one of some running processes has had so far, in MB."""
    status = [Path(f"/proc/{pid}/status").read_text(encoding="utf-8") for pid in pids]
    return max(float(text.partition("VmHWM:")[2].split()[0]) / 1024 for text in status)


def children_s() -> float:
    """Return the CPU time of child processes that ended, in s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def fly(campaign: Campaign, workers: int) -> Flown:
    """Fly a campaign, and write all of it; the clocks start when all workers can fly."""
    with tempfile.TemporaryDirectory(prefix="finback-bench-") as name, LocalFleet(campaign, workers=workers) as fleet:
        fleet.wait_for_all()
        before = cpu_s(fleet.pids)
        wall, own = time.perf_counter(), time.process_time()
        flights = write_partitions(Path(name), campaign, fly_campaign(campaign, fleet), first=0)
        count = sum(len(chunk) for chunk in flights)
        wall, own = time.perf_counter() - wall, time.process_time() - own
        used, most = cpu_s(fleet.pids) - before, largest_mb(fleet.pids)
    assert count == campaign.flights
    return Flown(flights=count, wall_s=wall, workers_s=used, parent_s=own, worker_mb=most)


def processes(campaign: Campaign, flights: int, rounds: int, *, idle: bool) -> list[Row]:
    """Measure two processes against one, in turn."""
    small = replace(campaign, draws=flights, partition_flights=flights)
    pairs = [(fly(small, 1), fly(small, 2)) for _ in range(rounds)]
    wall = statistics.median(one.wall_s / two.wall_s for one, two in pairs)
    # Alone on two cores one worker is busy all the time, the owner beside it; two workers and the owner share them.
    alone = statistics.median(_CORES * one.workers_s / (two.workers_s + two.parent_s) for one, two in pairs)
    scale = 1e3 / flights
    workers, both, parent = (
        scale * statistics.median(times)
        for times in (
            [one.workers_s for one, _ in pairs],
            [two.workers_s for _, two in pairs],
            [two.parent_s for _, two in pairs],
        )
    )
    limit = f">= {SCALING_LIMIT}"
    return [
        Row(what="1 process", value=workers, unit=_COST),
        Row(what="2 processes, together", value=both, unit=_COST),
        Row(what="their owner, who writes", value=parent, unit=_COST),
        Row(what="2 processes over 1, by CPU time", value=alone, unit="", limit=limit, holds=alone >= SCALING_LIMIT),
        Row(
            what="2 processes over 1, wall clock",
            value=wall,
            unit="",
            limit=limit if idle else "",
            holds=wall >= SCALING_LIMIT or not idle,
        ),
    ]


def flatness(campaign: Campaign, longest: int, *, idle: bool) -> list[Row]:
    """Measure what a flight costs in campaigns of growing length, once the worker is up."""
    counts = [count for count in (_SHORTEST, 1000, 10_000, 100_000) if count <= longest]
    shortest = [fly(replace(campaign, draws=_SHORTEST), 1) for _ in range(_REPEATS)]
    longer = {count: [fly(replace(campaign, draws=count), 1)] for count in counts[1:]}
    shortest += [fly(replace(campaign, draws=_SHORTEST), 1) for _ in range(_REPEATS)]
    rows, changes = [], {}
    for unit, judged in ((_COST, True), (_COST_WALL, idle)):
        costs = {
            count: 1e3 * statistics.mean(one.cost_s if unit == _COST else one.wall_s / one.flights for one in flown)
            for count, flown in ({_SHORTEST: shortest} | longer).items()
        }
        rows += [Row(what=f"campaign of {count}", value=cost, unit=unit) for count, cost in costs.items()]
        changes[unit] = max(abs(cost / costs[_SHORTEST] - 1) for cost in costs.values()), judged
    rows += [
        Row(what=f"campaign of {count}, memory of its worker", value=max(one.worker_mb for one in flown), unit="MB")
        for count, flown in ({_SHORTEST: shortest} | longer).items()
    ]
    for unit, (change, judged) in changes.items():
        clock = "CPU time" if unit == _COST else "wall clock"
        rows.append(
            Row(
                what=f"change of it from {_SHORTEST} to {counts[-1]} flights, {clock}",
                value=change,
                unit="",
                limit=f"<= ±{FLATNESS_LIMIT:.0%}" if judged else "",
                holds=change <= FLATNESS_LIMIT or not judged,
            )
        )
    return rows


def memory(study: Path, folder: Path, longest: int) -> list[Row]:
    """Measure the largest memory of the program for campaigns of growing length."""
    rows = []
    for count in [count for count in (1000, 10_000, 100_000) if count <= longest]:
        text = study.read_text(encoding="utf-8").replace("[campaign]", f"[campaign]\ndraws = {count}", 1)
        text = text.replace("duration_s = 2.0", "duration_s = 0.1")
        path = folder / f"memory-{count}.toml"
        path.write_text(text, encoding="utf-8")
        code = (
            "import resource, sys; from finback.cli.main import main\n"
            "try: main()\n"
            "finally: print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, file=sys.stderr)"
        )
        command = [sys.executable, "-c", code, "sweep", str(path), "--output", str(folder), "--json"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 - our own program
        assert json.loads(done.stdout)["flights"] == count
        rows.append(
            Row(what=f"memory of the program, {count} flights", value=int(done.stderr.split()[-1]) / 1024, unit="MB")
        )
    return rows


def start_up(study: Path, rounds: int, *, idle: bool) -> list[Row]:
    """Measure ``finback sweep`` from its start to its first flight: time that passes, and CPU time of all processes."""
    code = (
        "import sys, time; import finback.cli.progress as progress\n"
        "def step(self, what): sys.stderr.write(f'first {time.time()}\\n'); raise KeyboardInterrupt\n"
        "progress._Lines.step = step\n"
        "from finback.cli.main import main; main()\n"
    )
    wall, used = [], []
    for _ in range(rounds):
        before, begun = children_s(), time.time()
        command = [sys.executable, "-c", code, "sweep", str(study), "--output", str(study.parent), "--workers", "1"]
        done = subprocess.run(command, check=False, capture_output=True, text=True)  # noqa: S603 - as above
        (first,) = (line for line in done.stderr.splitlines() if line.startswith("first "))
        wall.append(float(first.split()[1]) - begun)
        used.append(children_s() - before)
    cpu, best = statistics.median(used), min(wall)
    limit = f"<= {START_LIMIT_S} s"
    return [
        # All processes together, one after the other: on an idle machine less time passes than this.
        Row(
            what="start-up to the first flight, CPU time of all processes",
            value=cpu,
            unit="s",
            limit="" if idle else limit,
            holds=idle or cpu <= START_LIMIT_S,
        ),
        Row(
            what="start-up to the first flight, wall clock, median",
            value=statistics.median(wall),
            unit="s",
            limit=limit if idle else "",
            holds=not idle or statistics.median(wall) <= START_LIMIT_S,
        ),
        Row(what="start-up to the first flight, wall clock, best", value=best, unit="s"),
    ]
