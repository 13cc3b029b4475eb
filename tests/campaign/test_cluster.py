"""A real Dask cluster on this machine: a scheduler and two workers, one of which is killed midway."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from finback import campaign as stage
from finback.campaign import Cluster, begin_campaign, fly
from finback.errors import InputError
from finback.files import sha256
from finback.study import read_campaign_study

PATIENCE_S = 120.0
QUIET = ["--no-dashboard"]


def start(log: Path, *arguments: str) -> subprocess.Popen[bytes]:
    """Start a program of Dask; its temporary files are below ``temporary`` beside the log."""
    folder = log.with_name("temporary")
    folder.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]]
    with log.open("wb") as file:
        return subprocess.Popen(command, stderr=file, env={**os.environ, "TMPDIR": str(folder)})


def wait_for(log: Path, pattern: str) -> str:
    """Return what a program says as soon as it says it."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        if found := re.search(pattern, log.read_text(encoding="utf-8")):
            return found.group(1)
        time.sleep(0.02)
    raise AssertionError(f"{log.name} never said {pattern}: {log.read_text()}")


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """The address of a scheduler, and its two workers."""
    log = tmp_path / "scheduler.log"
    programs = [start(log, "dask_scheduler", "--host", "127.0.0.1", "--port", "0", *QUIET)]
    try:
        address = wait_for(log, r"Scheduler at:\s+(tcp://\S+)")
        for number in range(2):
            file = tmp_path / f"worker-{number}.log"
            options = ["--nthreads", "1", "--no-nanny", "--local-directory", str(tmp_path), *QUIET]
            programs.append(start(file, "dask_worker", address, *options))
        for number in range(2):
            wait_for(tmp_path / f"worker-{number}.log", r"(Registered to)")
        yield address, programs[1:]
    finally:
        for program in programs:
            program.kill()
            program.wait()


class Killing:
    """Kills a worker of the cluster as soon as a partition is written."""

    def __init__(self, doomed: subprocess.Popen[bytes], run: Path) -> None:
        self.doomed = doomed
        self.summaries = run / "sweep.parquet" / "summary"
        self.flights = 0

    def begin(self, stage: str, steps: int) -> None:
        """Take no notice."""

    def step(self, what: str) -> None:
        """Count, and kill once."""
        assert what == f"release-{self.flights:07d}"  # in order, each once
        self.flights += 1
        if self.doomed.poll() is None and list(self.summaries.glob("part-*")):
            self.doomed.send_signal(signal.SIGKILL)
            self.doomed.wait()


def test_a_worker_of_the_cluster_is_killed_and_every_flight_is_there_once(
    cluster: tuple[str, list[subprocess.Popen[bytes]]],
    finished_campaign: Path,
    campaign_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(stage, "_resolution", lambda *_: ())
    address, (doomed, other) = cluster
    opened = begin_campaign(campaign_file, output=tmp_path / "output")
    killing = Killing(doomed, opened.run)
    fly(opened, Cluster(address=address), killing)
    assert doomed.poll() == -signal.SIGKILL
    assert killing.flights == 90
    theirs, ours = (
        {path.relative_to(folder).as_posix(): sha256(path) for path in folder.rglob("*.parquet") if path.is_file()}
        for folder in (finished_campaign / "sweep.parquet", opened.run / "sweep.parquet")
    )
    assert ours == theirs
    assert other.poll() is None
    flying = [int(pid) for task in Path(f"/proc/{other.pid}/task").iterdir() for pid in children(task)]
    assert not flying, "the processes that flew end with the campaign"
    end = time.monotonic() + PATIENCE_S
    while left := list((tmp_path / "temporary").glob("finback-*")):  # those of the killed worker end by themselves
        assert time.monotonic() < end, f"temporary files are left: {left}"
        time.sleep(0.02)


def children(task: Path) -> list[str]:
    """Return the processes that a thread has started."""
    return (task / "children").read_text(encoding="utf-8").split()


def test_a_cluster_that_is_not_there_is_said_so(campaign_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from finback.flight.campaign import cluster as dask

    monkeypatch.setattr(dask, "_CONNECT_S", 0.2)
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        dask.DaskFleet(read_campaign_study(campaign_file).campaign, address="tcp://127.0.0.1:9")


def test_a_cluster_without_workers_is_said_so(
    campaign_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from finback.flight.campaign import cluster as dask

    monkeypatch.setattr(dask, "_CONNECT_S", 2.0)
    log = tmp_path / "scheduler.log"
    program = start(log, "dask_scheduler", "--host", "127.0.0.1", "--port", "0", *QUIET)
    try:
        address = wait_for(log, r"Scheduler at:\s+(tcp://\S+)")
        with pytest.raises(InputError, match="has no workers"):
            dask.DaskFleet(read_campaign_study(campaign_file).campaign, address=address)
    finally:
        program.kill()
        program.wait()
