"""Whoever flies a campaign's chunks: a pool of processes on this machine, replaced when they die."""

from __future__ import annotations

import os
import tempfile
from collections import Counter, deque
from multiprocessing.connection import wait
from pathlib import Path
from types import TracebackType
from typing import Final, Protocol, Self, final

from finback.errors import InputError, RefusedError
from finback.flight.campaign.crew import Flown
from finback.flight.campaign.message import FOLDER, Chunk
from finback.flight.campaign.plan import Campaign
from finback.flight.campaign.process import Worker, WorkerDiedError, one_thread

_DEEP: Final = 2  # chunks a worker has at a time: one it flies, one it need not wait for
_DEATHS: Final = 3  # of workers at one chunk, or of all that start while nobody gets anywhere: no accident
_STARTING: Final = -1  # stands for the chunk of a worker that was not ready


class Fleet(Protocol):
    """Flies chunks in any order; each is returned once, whatever becomes of those who fly it."""

    @property
    def provenance(self) -> dict[str, dict[str, str]]:
        """Fidelity -> what is flown, with versions; waits for the first worker."""

    @property
    def depth(self) -> int:
        """How many chunks keep it busy."""

    def give(self, chunk: Chunk) -> None:
        """Let a chunk be flown."""

    def take(self) -> tuple[Chunk, tuple[Flown, ...]]:
        """Return a chunk that is flown; waits for it."""


@final
class LocalFleet:
    """Worker processes on this machine; a context manager.

    Args:
        campaign: the plan.
        workers: how many, >= 1.

    Raises:
        InputError: no number of workers.
    """

    def __init__(self, campaign: Campaign, *, workers: int) -> None:
        if workers < 1:
            raise InputError(f"a campaign needs at least one worker, got {workers}")
        self._campaign = campaign
        self._waiting: deque[Chunk] = deque()
        self._flown: deque[tuple[Chunk, tuple[Flown, ...]]] = deque()
        self._deaths: Counter[int] = Counter()
        self._folder = tempfile.TemporaryDirectory(prefix=FOLDER, ignore_cleanup_errors=True)
        # The folders of a worker that is killed go with ours.
        self._environment = {**one_thread(os.environ), "TMPDIR": str(Path(self._folder.name))}
        self._workers: list[Worker] = []
        try:
            for _ in range(workers):
                self._workers.append(self._start())
        except BaseException:
            self._end()
            raise

    def _start(self) -> Worker:
        return Worker(self._campaign, environment=self._environment)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def _end(self) -> None:
        for worker in self._workers:
            worker.process.kill()  # all at once; then each is waited for
        for worker in self._workers:
            worker.close()
        self._folder.cleanup()

    @property
    def provenance(self) -> dict[str, dict[str, str]]:
        """Fidelity -> what is flown, with versions; waits for the first worker."""
        while True:
            for worker in self._workers:
                if worker.provenance:
                    return worker.provenance
            self._listen()

    def wait_for_all(self) -> None:
        """Wait until every worker can fly."""
        while not all(worker.provenance for worker in self._workers):
            self._listen()

    @property
    def depth(self) -> int:
        """How many chunks keep it busy."""
        return _DEEP * len(self._workers)

    @property
    def pids(self) -> tuple[int, ...]:
        """The workers' processes."""
        return tuple(worker.process.pid for worker in self._workers)

    def give(self, chunk: Chunk) -> None:
        """Let a chunk be flown."""
        self._waiting.append(chunk)
        self._share()

    def take(self) -> tuple[Chunk, tuple[Flown, ...]]:
        """Return a chunk that is flown; waits for it."""
        while not self._flown:
            self._listen()
        return self._flown.popleft()

    def _share(self) -> None:
        """Give what waits to those who have least, and nothing beyond what they need."""
        while self._waiting:
            worker = min(self._workers, key=lambda one: len(one.waiting))
            if len(worker.waiting) >= _DEEP:
                return
            worker.give(self._waiting.popleft())

    def _listen(self) -> None:
        """Wait for something to happen, and take note of it."""
        ready = wait([worker.connection for worker in self._workers])
        for number, worker in enumerate(self._workers):
            if worker.connection not in ready:
                continue
            try:
                answer = worker.receive()
            except WorkerDiedError as death:
                self._replace(number, death)
                continue
            self._deaths.pop(_STARTING, None)  # one is ready, or has flown: workers can live here
            if answer is not None:
                self._deaths.pop(answer[0].first, None)
                self._flown.append(answer)
        self._share()

    def _replace(self, number: int, death: WorkerDiedError) -> None:
        """Start another worker; what the dead one had not answered waits again, in its old order, before the rest."""
        dead = self._workers[number]
        blamed = dead.waiting[0] if dead.provenance and dead.waiting else Chunk(first=_STARTING, count=0)
        if blamed.count or not dead.provenance:  # who dies idle had no flight that could be the cause
            self._deaths[blamed.first] += 1
        self._waiting.extendleft(reversed(dead.waiting))
        if self._deaths[blamed.first] >= _DEATHS:
            last = blamed.first + blamed.count - 1
            where = f"at flights {blamed.first} to {last}" if blamed.count else "before they flew"
            raise RefusedError(f"{_DEATHS} workers died {where}: {death}", hint="is there enough memory?")
        dead.close()
        self._workers[number] = self._start()
