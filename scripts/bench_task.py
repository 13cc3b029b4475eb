"""What is measured: a task, two sides that do it, and what a side took."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Any, final


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """What a side achieved.

    Attributes:
        points: how many located points, orbits or states it gave.
        error: largest difference from the reference, in the unit of the task.
        remark: what must be known besides; empty if nothing.
    """

    points: int
    error: float
    remark: str = ""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """One way to do a task.

    Attributes:
        name: whose.
        run: does it once, all of it but compilation; what it returns goes to ``score``.
        score: judges what was returned; not timed.
        share: part of the task that ``run`` does; its time is divided by it.
        call_ms: wall time of the first call with everything that a user waits for; nan if not told apart.
    """

    name: str
    run: Callable[[], Any]
    score: Callable[[Any], Score]
    share: float = 1.0
    call_ms: float = float("nan")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What is to be done.

    Attributes:
        name: key on the command line.
        what: in words.
        unit: of the error.
        bar_ms: what is promised for Finback; infinite where nothing is.
        finback: Finback's side.
        rivals: make the other sides, ready to run.
    """

    name: str
    what: str
    unit: str
    bar_ms: float
    finback: Side
    rivals: tuple[Callable[[], Side], ...] = ()


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Took:
    """Times of one side over all repeats, in ms.

    Attributes:
        name: whose.
        cpu_median_ms: CPU time, own and of children: what a quiet machine would take, on a shared one too.
        cpu_least_ms: the least of it.
        wall_median_ms: time by the clock.
        wall_least_ms: the least of it.
        call_ms: see ``Side``.
        score: of the last repeat.
    """

    name: str
    cpu_median_ms: float
    cpu_least_ms: float
    wall_median_ms: float
    wall_least_ms: float
    call_ms: float
    score: Score


def clocks() -> tuple[float, float]:
    """Return CPU time of this process and of its ended children, and time by the clock, in s."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime, time.perf_counter()


def measured(sides: tuple[Side, ...], repeats: int) -> tuple[Took, ...]:
    """Let the sides take turns; what is loaded or compiled at first is done before the first turn."""
    results = [side.run() for side in sides]
    times: list[list[tuple[float, float]]] = [[] for _ in sides]
    for _ in range(repeats):
        for k, side in enumerate(sides):
            cpu, wall = clocks()
            results[k] = side.run()
            cpu_after, wall_after = clocks()
            each = 1e3 / side.share
            times[k].append(((cpu_after - cpu) * each, (wall_after - wall) * each))
    return tuple(
        Took(
            name=side.name,
            cpu_median_ms=median(cpu for cpu, _ in row),
            cpu_least_ms=min(cpu for cpu, _ in row),
            wall_median_ms=median(wall for _, wall in row),
            wall_least_ms=min(wall for _, wall in row),
            call_ms=side.call_ms,
            score=side.score(result),
        )
        for side, row, result in zip(sides, times, results, strict=True)
    )
