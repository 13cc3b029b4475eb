"""What a run without compiled code costs: the same work with an empty cache and with a full one."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Final, final

ROOT: Final = Path(__file__).resolve().parent.parent
BAR_S: Final = 3.0

# Every kernel that a study of the F-8 II and of the paper's normal forms comes to.
EVERYTHING: Final = """
import numpy as np
from pathlib import Path
from finback.dynamics.analysis import AnalysisOptions, analyze
from finback.dynamics.normal_form.cubic import Cubic
from finback.dynamics.cycle.branch import cycle_branches
from finback.dynamics.diagram.diagram import diagram
from finback.dynamics.reduction import reduce
from finback.dynamics.stability.map import stability_map
from finback.store import read_model_file

system = reduce(read_model_file(Path("aircraft/f8ii/published.toml")).model())
analyze(system, AnalysisOptions(elevator_range_rad=(-0.7, 0.35), elevator_step_rad=0.02, alpha_range_rad=(-1.0, 1.0)))
stability_map(system, 0.0, *np.meshgrid(np.linspace(-0.8, 1.0, 50), np.linspace(-3.5, 3.5, 50)))
family = Cubic(a1=0.5, a0=0.0, b1=0.5, b0=-0.35).family()
diagram(family, (-2.0, -0.01))
cycle_branches(family, -0.35)
"""

# The same work, and what numba compiled in it: the time of each kernel without that of the kernels it calls.
COUNTED: Final = """
import json, os, time
from numba.core import event

class Listener(event.Listener):
    def __init__(self):
        self.open, self.closed = [], {}
    def on_start(self, happened):
        self.open.append([time.process_time(), 0.0, happened.data["dispatcher"].py_func])
    def on_end(self, happened):
        begun, inner, function = self.open.pop()
        whole = time.process_time() - begun
        home = function.__module__
        name = function.__name__ if home.startswith("finback") else "of numba itself"
        self.closed[name] = self.closed.get(name, 0.0) + whole - inner
        if self.open:
            self.open[-1][1] += whole

listener = Listener()
event.register("numba:compile", listener)
exec(os.environ["FINBACK_BENCH_WORK"])
print(json.dumps(listener.closed))
"""

COMMANDS: Final = {
    "analyze": (
        *("-c", "import finback.cli.main as program; program.main()", "analyze", "aircraft/f8ii/published.toml"),
        *("--elevator-range", "-40", "20", "--json"),
    ),
    "everything": ("-c", EVERYTHING),
}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Times of a new process, in s: medians over the repeats.

    Attributes:
        name: what it did.
        cold_cpu_s: CPU time with an empty cache.
        warm_cpu_s: the same with a full one.
        cold_wall_s: time by the clock with an empty cache.
        warm_wall_s: the same with a full one.
    """

    name: str
    cold_cpu_s: float
    warm_cpu_s: float
    cold_wall_s: float
    warm_wall_s: float


def timed(command: tuple[str, ...], cache: str) -> tuple[float, float]:
    """Run Python once with the cache of compiled code in a folder; return CPU time and time by the clock, in s."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(  # noqa: S603 - this interpreter
        [sys.executable, *command],
        cwd=ROOT,
        env={**os.environ, "NUMBA_CACHE_DIR": cache},
        stdout=subprocess.DEVNULL,
        check=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, time.perf_counter() - begun


def started(name: str, repeats: int) -> Start:
    """Measure one of the commands, cold and warm in turns."""
    cold, warm = [], []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as cache:
            cold.append(timed(COMMANDS[name], cache))
            warm.append(timed(COMMANDS[name], cache))
    (cold_cpu, cold_wall), (warm_cpu, warm_wall) = (
        tuple(median(column) for column in zip(*rows, strict=True)) for rows in (cold, warm)
    )
    return Start(name=name, cold_cpu_s=cold_cpu, warm_cpu_s=warm_cpu, cold_wall_s=cold_wall, warm_wall_s=warm_wall)


def kernels() -> dict[str, float]:
    """Return what each kernel costs to compile, in s of CPU time."""
    with tempfile.TemporaryDirectory() as cache:
        answer = subprocess.run(  # noqa: S603 - this interpreter
            [sys.executable, "-c", COUNTED],
            cwd=ROOT,
            env={**os.environ, "NUMBA_CACHE_DIR": cache, "FINBACK_BENCH_WORK": EVERYTHING},
            capture_output=True,
            text=True,
            check=True,
        )
    costs: dict[str, float] = json.loads(answer.stdout)
    return dict(sorted(costs.items(), key=lambda item: -item[1]))
