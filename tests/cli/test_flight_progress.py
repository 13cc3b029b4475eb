"""The bar of very many flights: how fast they come, and the time that is left."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from finback.cli import progress
from finback.cli.progress import watching_flights


def test_a_terminal_shows_flights_a_second_and_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=120)
    monkeypatch.setattr(progress, "Console", lambda **_: console)
    monkeypatch.setattr("finback.cli.progress.time.monotonic", lambda: now[0])
    with watching_flights(quiet=False, written=100) as watcher:
        watcher.begin("sweep", 300)
        for number in range(150):
            now[0] += 0.1
            watcher.step(f"release-{number:07d}")
        (task,) = watcher._bars.tasks  # type: ignore[attr-defined] # the bar on the screen
        assert (task.completed, task.total) == (250, 400)
        assert task.fields["speed"] == "10 flights/s"
        assert task.fields["left"] == "0:00:15 left"


@pytest.mark.parametrize("quiet", [True, False])
def test_elsewhere_there_is_no_bar(capfd: pytest.CaptureFixture[str], quiet: bool) -> None:  # noqa: FBT001 - a case
    with watching_flights(quiet=quiet, written=0) as watcher:
        watcher.begin("sweep", 300)
        watcher.step("release-0000000")
    said = capfd.readouterr()
    assert said.out == ""
    assert said.err == ("" if quiet else "finback: sweep, 300 flights\n")
