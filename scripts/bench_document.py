"""The benchmarks as a page of the documentation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from bench_compile import BAR_S, Start
from bench_task import Task, Took

HEAD: Final = """\
# Benchmarks

Written by `scripts/bench --write`: Finback beside AUTO-07p (its engine, through bifpy) in one run, on one core. CPU
time is what a quiet machine takes by the clock; both are medians. Of AUTO only its own program is timed, input ready
and output off; a user of bifpy waits for the call as well, in which the model is translated and compiled. The error is
the largest difference from values that `scripts/bench_reference.py` computes by a road of its own (Taylor series in 34
digits), for the map the share of states that scipy's DOP853 puts elsewhere. Finback's kernels are compiled before the
first turn (`scripts/bench` prints what that costs a new process). A machine under other load takes longer by the clock.

| task | by | CPU ms | clock ms | call ms | bar ms | points | error |
|---|---|--:|--:|--:|--:|--:|--:|
"""


def document(found: Mapping[str, tuple[Task, Sequence[Took]]], starts: Sequence[Start]) -> str:
    """Return the page."""
    rows, remarks = [], []
    for name, (task, sides) in found.items():
        for side in sides:
            ours = side is sides[0]
            times = f"{_time(side.cpu_median_ms)} | {_time(side.wall_median_ms)} | {_time(side.call_ms)}"
            bar = _time(task.bar_ms) if ours else ""
            error = f"{side.score.error:.1e} {task.unit}"
            rows.append(f"| {name if ours else ''} | {side.name} | {times} | {bar} | {side.score.points} | {error} |")
        said = "; ".join(f"{side.name}: {side.score.remark}" for side in sides if side.score.remark)
        remarks.append(f"- **{name}**: {task.what}." + (f" {said}." if said else ""))
    parts = [HEAD + "\n".join(rows), "\n".join(remarks)]
    if starts:
        lines = [
            "What a new process takes without compiled code and with it, in s:",
            "",
            "| work | CPU without | CPU with | difference | bar |",
            "|---|--:|--:|--:|--:|",
        ]
        for start in starts:
            costs = start.cold_cpu_s, start.warm_cpu_s, start.cold_cpu_s - start.warm_cpu_s, BAR_S
            lines.append(f"| {start.name} | " + " | ".join(f"{each:.2f}" for each in costs) + " |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def _time(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) and value < 1e3 else f"{value:.0f}" if math.isfinite(value) else ""
