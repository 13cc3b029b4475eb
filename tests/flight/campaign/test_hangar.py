"""What a Dask worker keeps for campaigns: nothing outlives the fleet it is for."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from finback.errors import RefusedError
from finback.flight.campaign import hangar
from finback.flight.campaign.message import Chunk
from finback.flight.campaign.plan import Campaign, Varied
from finback.flight.campaign.process import WorkerDiedError
from finback.flight.campaign.spread import Fixed

Planner = Callable[..., Campaign]
NOTHING = Chunk(first=-1, count=0)
PATIENCE_S = 30.0


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of temporary files."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


@pytest.fixture
def long(plan: Planner) -> Iterator[Campaign]:
    """A campaign whose first chunk takes minutes."""
    hours = Varied(name="duration_s", spread=Fixed(value=3600.0))
    yield plan(varied=(*plan().varied[:3], hours))
    for fleet in tuple(hangar._stands):
        hangar.dismiss(fleet)


def kept(fleet: str) -> list[int]:
    """Return the processes that are kept for a fleet."""
    stand = hangar._stands.get(fleet)
    if stand is None:
        return []
    return [worker.process.pid for worker in (*stand.busy, *(worker for worker, _ in stand.idle))]


def runs(pid: int) -> bool:
    return Path(f"/proc/{pid}").exists()


def test_a_process_waits_with_one_thread_for_its_fleet_and_one_that_flies_ends_with_it(
    long: Campaign, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    provenance, flights = hangar.fly_on_worker("mine", long, NOTHING, {})
    assert (list(provenance), flights) == (["rig"], ())
    (pid,) = kept("mine")
    assert b"OMP_NUM_THREADS=1" in Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    ended: list[BaseException] = []

    def fly() -> None:
        try:
            hangar.fly_on_worker("mine", long, Chunk(first=0, count=1), provenance)
        except WorkerDiedError as error:
            ended.append(error)

    assert list(elsewhere.rglob("finback-rig-*"))
    task = threading.Thread(target=fly)
    task.start()
    end = time.monotonic() + PATIENCE_S
    while not hangar._stands["mine"].busy:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert kept("mine") == [pid], "the same process flies"
    hangar.dismiss("mine")
    task.join(PATIENCE_S)
    assert ended
    assert not runs(pid)
    assert not list(elsewhere.iterdir()), "its temporary files went with it"
    with pytest.raises(RefusedError, match="is over"):
        hangar.fly_on_worker("mine", long, NOTHING, {})


def test_a_process_of_a_fleet_that_was_killed_does_not_wait_for_ever(
    long: Campaign, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hangar, "_IDLE_S", 0.2)
    hangar.fly_on_worker("killed", long, NOTHING, {})
    end = time.monotonic() + PATIENCE_S
    while kept("killed") or list(elsewhere.iterdir()):
        assert time.monotonic() < end
        time.sleep(0.01)
