"""Progress of long work: bars on a terminal, one line a stage elsewhere, nothing if asked."""

# ruff: noqa: ARG002 - whoever shows less takes no notice of what it is told

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress as Bars, SpinnerColumn, TextColumn, TimeElapsedColumn

from finback.cli.exits import say
from finback.cli.signals import raise_if_stopped
from finback.pipeline import Progress


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
