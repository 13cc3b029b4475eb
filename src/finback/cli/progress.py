"""Progress of long work: bars on a terminal, one line a stage elsewhere, nothing if asked."""

# ruff: noqa: ARG002 - whoever shows less takes no notice of what it is told

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING, Final, final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress as Bars, SpinnerColumn, TextColumn, TimeElapsedColumn

from finback.cli.exits import say
from finback.cli.signals import raise_if_stopped

if TYPE_CHECKING:
    from finback.pipeline import Progress  # which imports every stage: seconds that a campaign does not need

_REFRESH_S: Final = 0.2
_RECENT_S: Final = 30.0


@contextmanager
def watching(*, quiet: bool) -> Iterator[Progress]:
    """Give a progress that fits to where stderr goes; bars are gone when the block ends."""
    console = Console(stderr=True)
    if quiet:
        yield _Quiet()
    elif not console.is_terminal:
        yield _Lines()
    else:
        columns = (
            SpinnerColumn(),
            TextColumn("{task.fields[stage]}", style="bold"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[what]}"),
        )
        with Bars(*columns, console=console, transient=True) as bars:
            yield _Bars(bars)


@contextmanager
def watching_flights(*, quiet: bool, written: int) -> Iterator[Progress]:
    """Give a progress of very many flights: on a terminal with flights a second and the time left.

    Args:
        quiet: show nothing.
        written: flights that were there before; they count as done, and not for the speed.
    """
    console = Console(stderr=True)
    if quiet:
        yield _Quiet()
    elif not console.is_terminal:
        yield _Lines()
    else:
        columns = (
            SpinnerColumn(),
            TextColumn("{task.fields[stage]}", style="bold"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[speed]}"),
            TextColumn("{task.fields[left]}"),
        )
        with Bars(*columns, console=console, transient=True) as bars:
            yield _Flights(bars, written)


@final
class _Flights:
    """A bar that says how fast flights come, over the last half minute, and when the last one will."""

    def __init__(self, bars: Bars, written: int) -> None:
        self._bars = bars
        self._written = written
        self._total = 0
        self._times: deque[tuple[float, int]] = deque()
        self._task = bars.add_task("", stage="", speed="", left="", visible=False)

    def begin(self, stage: str, steps: int) -> None:
        raise_if_stopped()
        self._total = self._written + steps
        self._times.append((time.monotonic(), self._written))
        self._bars.reset(
            self._task, total=self._total, completed=self._written, stage=stage, speed="", left="", visible=True
        )

    def step(self, what: str) -> None:
        raise_if_stopped()
        self._written += 1
        now = time.monotonic()
        if now - self._times[-1][0] < _REFRESH_S and self._written < self._total:
            return
        self._times.append((now, self._written))
        while len(self._times) > 2 and now - self._times[0][0] > _RECENT_S:
            self._times.popleft()
        then, before = self._times[0]
        speed = (self._written - before) / max(now - then, _REFRESH_S)
        left = timedelta(seconds=round((self._total - self._written) / speed)) if speed else ""
        self._bars.update(self._task, completed=self._written, speed=f"{speed:.3g} flights/s", left=f"{left} left")


@final
class _Quiet:
    def begin(self, stage: str, steps: int) -> None:
        raise_if_stopped()

    def step(self, what: str) -> None:
        raise_if_stopped()


@final
class _Lines:
    def begin(self, stage: str, steps: int) -> None:
        raise_if_stopped()
        say(f"finback: {stage}{f', {steps} flights' if steps else ''}")

    def step(self, what: str) -> None:
        raise_if_stopped()


@final
class _Bars:
    def __init__(self, bars: Bars) -> None:
        self._bars = bars
        self._task = bars.add_task("", stage="", what="", visible=False)

    def begin(self, stage: str, steps: int) -> None:
        raise_if_stopped()
        self._bars.reset(self._task, total=steps or None, stage=stage, what="", visible=True)

    def step(self, what: str) -> None:
        raise_if_stopped()
        self._bars.update(self._task, advance=1, what=what)
