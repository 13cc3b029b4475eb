"""A real Dask cluster on this machine: a scheduler and two workers, one of which is killed midway."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from finback.files import sha256

PATIENCE_S = 120.0
QUIET = ["--no-dashboard"]


def start(log: Path, *arguments: str) -> subprocess.Popen[bytes]:
    with log.open("wb") as file:
        return subprocess.Popen([sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]], stderr=file)


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


def test_a_worker_of_the_cluster_is_killed_and_every_flight_is_there_once(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], finished_campaign: Path, campaign_file: Path, tmp_path: Path
) -> None:
    address, (doomed, other) = cluster
    output = tmp_path / "output"
    program = subprocess.Popen(
        [sys.executable, "-m", "finback.cli", "sweep", str(campaign_file), "--output", str(output), "--dask", address],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    end = time.monotonic() + PATIENCE_S
    while not list(output.glob("logs/*/*/sweep.parquet/summary/part-*")):
        assert time.monotonic() < end
        assert program.poll() is None, program.communicate()
        time.sleep(0.005)
    assert program.poll() is None, "the campaign was over before a worker could be killed"
    doomed.send_signal(signal.SIGKILL)
    said = program.communicate(timeout=PATIENCE_S)
    assert program.returncode == 0, said
    assert other.poll() is None
    (run,) = output.glob("logs/*/*")
    theirs, ours = (
        {path.relative_to(folder).as_posix(): sha256(path) for path in folder.rglob("*.parquet") if path.is_file()}
        for folder in (finished_campaign / "sweep.parquet", run / "sweep.parquet")
    )
    assert ours == theirs


def test_a_cluster_that_is_not_there_is_said_so(campaign_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from finback.errors import InputError
    from finback.flight.campaign import cluster as dask
    from finback.study import read_campaign_study

    monkeypatch.setattr(dask, "_CONNECT_S", 0.2)
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        dask.DaskFleet(read_campaign_study(campaign_file).campaign, address="tcp://127.0.0.1:9")
