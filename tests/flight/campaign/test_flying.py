"""Flights come in order, each once, and never more ahead of the disk than a partition."""

from __future__ import annotations

import errno
import os
import random
import signal
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import closing
from multiprocessing import Pipe
from pathlib import Path
from unittest.mock import Mock

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from finback.errors import AircraftError, InputError, RefusedError
from finback.flight.campaign import worker
from finback.flight.campaign.crew import Crew, Flown
from finback.flight.campaign.fleet import LocalFleet
from finback.flight.campaign.flying import chunks_of, fly_campaign
from finback.flight.campaign.message import FOLDER, Chunk
from finback.flight.campaign.plan import Campaign
from finback.flight.campaign.process import Worker, WorkerDiedError
from finback.records import Schedule

Planner = Callable[..., Campaign]
PATIENCE_S = 30.0


class Shuffled:
    """A fleet that flies nothing and returns what it was given in any order."""

    def __init__(self, campaign: Campaign, seed: int, depth: int) -> None:
        self.campaign = campaign
        self.depth = depth
        self.provenance: dict[str, dict[str, str]] = {}
        self.waiting: list[Chunk] = []
        self.most = 0
        self._random = random.Random(seed)  # noqa: S311 - an order, no secret

    def give(self, chunk: Chunk) -> None:
        """Keep it."""
        self.waiting.append(chunk)
        assert len(self.waiting) <= self.depth

    def take(self) -> tuple[Chunk, tuple[Flown, ...]]:
        """Return any."""
        chunk = self.waiting.pop(self._random.randrange(len(self.waiting)))
        still = Schedule(time_s=[0.0], elevator_rad=[0.0])  # type: ignore[arg-type] # made an array
        return chunk, tuple(
            Flown(
                sample=self.campaign.sample(index),
                outcome="completed",
                note="",
                measures=(),
                schedule=still,
            )
            for index in range(chunk.first, chunk.first + chunk.count)
        )


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])  # the fixture is a value, no state
@given(
    seed=st.integers(0, 1000),
    depth=st.integers(1, 9),
    draws=st.integers(1, 40),
    partition_flights=st.integers(1, 60),
    first=st.integers(0, 3),
)
def test_whoever_is_faster_the_order_is_the_same(
    plan: Planner, seed: int, depth: int, draws: int, partition_flights: int, first: int
) -> None:
    campaign = plan(draws=draws, partition_flights=partition_flights)
    begin = min(first, campaign.partitions)
    fleet = Shuffled(campaign, seed, depth)
    seen = [flown.sample.index for flights in fly_campaign(campaign, fleet, partition=begin) for flown in flights]
    assert seen == list(range(begin * partition_flights, campaign.flights))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 1000), depth=st.integers(1, 9), partition_flights=st.integers(1, 60))
def test_at_most_a_partition_is_flown_and_not_written(
    plan: Planner, seed: int, depth: int, partition_flights: int
) -> None:
    campaign = plan(draws=20, partition_flights=partition_flights)
    done, written = 0, 0

    class Counting(Shuffled):
        def take(self) -> tuple[Chunk, tuple[Flown, ...]]:
            nonlocal done
            assert done - written <= partition_flights
            chunk, flights = super().take()
            done += chunk.count
            return chunk, flights

    seen = 0
    with closing(fly_campaign(campaign, Counting(campaign, seed, depth))) as flights:  # type: ignore[type-var]
        for chunk in flights:
            seen += len(chunk)
            written = seen - seen % partition_flights


def test_chunks_cover_every_partition_and_none_is_in_two(plan: Planner) -> None:
    campaign = plan(draws=37, partition_flights=50)
    numbers: list[int] = []
    for partition in range(campaign.partitions):
        mine = [number for one in chunks_of(campaign, partition) for number in range(one.first, one.first + one.count)]
        assert {number // 50 for number in mine} == {partition}
        numbers += mine
    assert numbers == list(range(campaign.flights))


def test_processes_fly_what_one_process_flies_though_workers_are_killed(plan: Planner) -> None:
    campaign = plan(draws=20, partition_flights=40)  # 120 flights of 5 chunks
    with Crew(campaign) as crew:
        alone = [crew.fly(index) for index in range(campaign.flights)]
        provenance = crew.provenance
    killed: set[int] = set()
    flown: list[Flown] = []
    with LocalFleet(campaign, workers=2) as fleet:
        assert fleet.provenance == provenance
        for flights in fly_campaign(campaign, fleet):
            flown += flights
            if not killed:
                killed.add(fleet.pids[0])
                os.kill(fleet.pids[0], signal.SIGKILL)
        pids = (*killed, *fleet.pids)
    assert killed
    assert [one.sample.index for one in flown] == list(range(campaign.flights))
    for one, two in zip(flown, alone, strict=True):
        assert one.measures == two.measures
        assert all(one.history[name].tobytes() == two.history[name].tobytes() for name in two.history)
    for pid in pids:
        with pytest.raises(ProcessLookupError):  # not even a zombie is left
            os.kill(pid, 0)


def test_a_worker_whose_owner_is_killed_ends_and_leaves_no_folder(plan: Planner, tmp_path: Path) -> None:
    folder = tmp_path / f"{FOLDER}shared"
    folder.mkdir()
    orphan = Worker(plan(), environment={**os.environ, "TMPDIR": str(folder)})
    orphan.receive()
    assert list(folder.iterdir())
    orphan.connection.close()
    try:
        assert orphan.process.wait(PATIENCE_S) == 0
    finally:
        orphan.close()
    assert not folder.exists()


def test_a_temporary_folder_that_is_full_is_told(campaign: Campaign, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Crew, "__init__", fail)
    ours, theirs = Pipe()
    ours.send(campaign)
    worker._serve(theirs)
    answer = ours.recv()
    assert isinstance(answer.error, InputError)
    assert "cannot use its temporary folder: [Errno 28] No space left" in answer.error.message


def test_a_mistake_in_a_worker_reaches_its_owner(plan: Planner) -> None:
    aircraft = plan().aircraft
    stolen = plan(aircraft=type(aircraft)(name=aircraft.name, path=aircraft.path, sha256="0" * 64))
    with LocalFleet(stolen, workers=1) as fleet, pytest.raises(AircraftError, match="have changed"):
        _ = fleet.provenance


def test_workers_that_die_again_and_again_are_no_accident(campaign: Campaign, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONHOME", "/nowhere")  # no interpreter starts with it
    with LocalFleet(campaign, workers=1) as fleet, pytest.raises(RefusedError, match="3 workers died before they flew"):
        _ = fleet.provenance


class Scripted:
    """A worker that becomes ready, or dies while it starts or has nothing to fly, as its turn says."""

    def __init__(self, turns: Iterator[str]) -> None:
        self.provenance: dict[str, dict[str, str]] = {}
        self.waiting: deque[Chunk] = deque()
        self.process = Mock()
        self.connection, self._far = Pipe()
        self._turns = turns
        self._far.send("there is something to hear, always")

    def receive(self) -> None:
        """Do what comes next."""
        if next(self._turns) == "dies":
            raise WorkerDiedError("killed")
        self.provenance = {"rig": {}}

    def close(self) -> None:
        """Close the connections."""
        self.connection.close()
        self._far.close()


@pytest.mark.parametrize(
    "turns",
    [["ready", "dies"] * 4 + ["ready"], ["dies", "dies", "ready", "dies"] * 2 + ["dies", "ready"]],
    ids=["idle", "starting"],
)
def test_workers_that_die_with_others_well_between_are_replaced(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch, turns: list[str]
) -> None:
    coming = iter(turns)
    monkeypatch.setattr(LocalFleet, "_start", lambda _: Scripted(coming))
    with LocalFleet(campaign, workers=1) as fleet:
        for _ in turns:
            fleet._listen()
        assert fleet.provenance == {"rig": {}}


def test_no_workers_fly_nothing(campaign: Campaign) -> None:
    with pytest.raises(InputError, match="at least one worker"):
        LocalFleet(campaign, workers=0)
