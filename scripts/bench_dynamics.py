"""Finback and AUTO-07p in one run: times in turns, accuracy beside time, and what compilation costs.

CPU time is what a quiet machine takes by the clock, since nothing here runs in parallel; on a shared machine only it
can be compared. Of AUTO only its own program is timed, with input ready and output off; `call` is what a user of bifpy
waits for, translation and compilation of the model included. Nothing here fails because of a time.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import sys
from dataclasses import asdict
from typing import Any

from bench_compile import BAR_S, COMMANDS, ROOT, Start, kernels, started
from bench_document import document as page
from bench_task import Task, Took, measured
from bench_tasks import TASKS
from rich.console import Console
from rich.table import Table

FEW = 3
OTHERS = "\n<!-- identification -->"  # what other benchmarks write begins here, and stays
SLOW = ("diagram", "wells", "damped-wells", "map")


def arguments() -> argparse.Namespace:
    """Return what was asked for."""
    parser = argparse.ArgumentParser(prog="scripts/bench", description=__doc__.split("\n", 1)[0])
    parser.add_argument("tasks", nargs="*", metavar="TASK", help=f"of {', '.join([*TASKS, 'compile'])}; default: all")
    parser.add_argument("--repeats", type=int, default=9, help="turns of each side (default 9); medians are given")
    parser.add_argument("--alone", action="store_true", help="Finback only")
    parser.add_argument("--write", action="store_true", help="write docs/benchmarks.md too")
    parser.add_argument("--json", action="store_true", help="only JSON on stdout")
    asked = parser.parse_args()
    if unknown := set(asked.tasks) - {*TASKS, "compile"}:
        parser.error(f"no task is named {', '.join(sorted(unknown))}: there are {', '.join([*TASKS, 'compile'])}")
    if asked.repeats < 1:
        parser.error("--repeats: 1 or more")
    return asked


def compared(task: Task, repeats: int, *, alone: bool) -> tuple[Took, ...]:
    """Measure both sides of a task, or Finback's only."""
    sides = (task.finback, *(() if alone else (rival() for rival in task.rivals)))
    return measured(sides, min(repeats, FEW) if task.name in SLOW else repeats)


def document(found: dict[str, tuple[Task, tuple[Took, ...]]], starts: list[Start], costs: dict[str, float]) -> Any:
    """Return everything as JSON has it: milliseconds, and null where there is nothing."""
    tasks = [
        {
            "name": name,
            "what": task.what,
            "unit_of_error": task.unit,
            "bar_ms": task.bar_ms,
            "sides": [asdict(side) for side in sides],
            "cpu_ratio": sides[1].cpu_median_ms / sides[0].cpu_median_ms if len(sides) > 1 else math.nan,
        }
        for name, (task, sides) in found.items()
    ]
    compilation = {"bar_s": BAR_S, "starts": [asdict(start) for start in starts], "kernels_cpu_s": costs}
    machine = {"processors": os.cpu_count(), "machine": platform.machine(), "python": platform.python_version()}
    return plain({"schema": "finback/bench/1", "machine": machine, "tasks": tasks, "compilation": compilation})


def plain(value: Any) -> Any:
    """Replace what JSON cannot say by null."""
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, list):
        return [plain(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def report(found: dict[str, tuple[Task, tuple[Took, ...]]], starts: list[Start], costs: dict[str, float]) -> None:
    """Print the tables."""
    console = Console(width=120)
    if found:
        table = Table("task", "by", "CPU ms", "least", "clock ms", "least", "call ms", "points", "error", "bar ms")
        for column in table.columns[2:]:
            column.justify = "right"
        for name, (task, sides) in found.items():
            for side in sides:
                clock = (side.cpu_median_ms, side.cpu_least_ms, side.wall_median_ms, side.wall_least_ms)
                call = f"{side.call_ms:.0f}" if math.isfinite(side.call_ms) else ""
                ours = side is sides[0]
                bar = f"{task.bar_ms:.0f}" if ours and math.isfinite(task.bar_ms) else ""
                error = f"{side.score.error:.1e} {task.unit}"
                row = (f"{time:.4g}" if time < 1e4 else f"{time:.0f}" for time in clock)
                table.add_row(name if ours else "", side.name, *row, call, str(side.score.points), error, bar)
            table.add_section()
        console.print(table)
        for name, (task, sides) in found.items():
            ratio = f"ratio {sides[1].cpu_median_ms / sides[0].cpu_median_ms:.3g}; " if len(sides) > 1 else ""
            remarks = "; ".join(f"{side.name}: {side.score.remark}" for side in sides if side.score.remark)
            console.print(f"{name}: {ratio}{task.what}. {remarks}", highlight=False)
    if starts:
        table = Table("new process", "CPU s cold", "warm", "difference", "clock s cold", "warm", "difference", "bar s")
        for start in starts:
            cpu, wall = start.cold_cpu_s - start.warm_cpu_s, start.cold_wall_s - start.warm_wall_s
            times = (start.cold_cpu_s, start.warm_cpu_s, cpu, start.cold_wall_s, start.warm_wall_s, wall, BAR_S)
            table.add_row(start.name, *(f"{time:.2f}" for time in times))
        console.print(table)
        shares = ", ".join(f"{name} {cost:.2f}" for name, cost in costs.items())
        console.print(f"CPU s of each kernel, once: {shares}; together {sum(costs.values()):.2f}", highlight=False)


def main() -> int:
    """Measure what was asked for and print it."""
    asked = arguments()
    names = asked.tasks or [*TASKS, "compile"]
    found = {}
    for name in names:
        if name in TASKS:
            print(f"finback: {name} ...", file=sys.stderr)
            task = TASKS[name]()
            found[name] = task, compared(task, asked.repeats, alone=asked.alone)
    starts, costs = [], {}
    if "compile" in names:
        print("finback: compile ...", file=sys.stderr)
        starts = [started(name, min(asked.repeats, FEW)) for name in COMMANDS]
        costs = kernels()
    if asked.write:
        place = ROOT / "docs" / "benchmarks.md"
        _, mark, further = place.read_text(encoding="utf-8").partition(OTHERS)
        place.write_text(f"{page(found, starts)}{mark}{further}", encoding="utf-8")
    if asked.json:
        print(json.dumps(document(found, starts, costs), indent=2))
    else:
        report(found, starts, costs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
