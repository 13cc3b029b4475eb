"""A fleet on an existing Dask cluster: every Dask worker drives processes of its own that fly.

JSBSim bears no threads, and Dask runs its tasks in threads: so a task hands its chunk to a process that it keeps for
the next task of the campaign. The Dask workers need the same Finback and JSBSim, and the aircraft at the same path.
"""

from __future__ import annotations

import os
import threading
import uuid
from collections import Counter
from types import TracebackType
from typing import Any, Final, Self, final

from finback.errors import FinbackError, InputError, RefusedError
from finback.flight.campaign.crew import Flown
from finback.flight.campaign.message import Chunk
from finback.flight.campaign.plan import Campaign
from finback.flight.campaign.process import Worker

try:
    from distributed import Client, Future, as_completed
except ImportError as error:
    raise InputError(
        "flying on a Dask cluster needs Dask, which is not installed", hint="pip install 'finback[cluster]'"
    ) from error

_CONNECT_S: Final = 10.0
_TRIES: Final = 3  # at one chunk, whatever happens to those who fly it
_DEEP: Final = 2  # chunks for each thread of the cluster: one it flies, one it need not wait for

_idle: dict[str, list[Worker]] = {}  # plan -> processes of this Dask worker that wait for a chunk
_idle_lock: Final = threading.Lock()


def fly_on_worker(
    campaign: Campaign, chunk: Chunk, expected: dict[str, dict[str, str]]
) -> tuple[dict[str, dict[str, str]], tuple[Flown, ...]]:
    """Fly a chunk in a process of this Dask worker; return what flew, and the flights.

    Args:
        campaign: the plan.
        chunk: none of its flights, if it is empty: then a process is only made ready.
        expected: what shall fly; empty if anything may.

    Raises:
        InputError: here something else would fly.
        WorkerDiedError: the process died; the chunk can be flown again.
    """
    with _idle_lock:
        waiting = _idle.setdefault(campaign.sha256, [])
        worker = waiting.pop() if waiting else Worker(campaign, environment=os.environ)
    try:
        flights = _fly(worker, chunk, expected)
    except BaseException:
        worker.close()
        raise
    with _idle_lock:
        _idle.setdefault(campaign.sha256, []).append(worker)
    return worker.provenance, flights


def _fly(worker: Worker, chunk: Chunk, expected: dict[str, dict[str, str]]) -> tuple[Flown, ...]:
    if not worker.provenance:
        worker.receive()
    if expected and worker.provenance != expected:
        raise InputError(
            f"a worker of the cluster would fly {worker.provenance}, not {expected}",
            hint="install the same versions on all of them",
        )
    flights: tuple[Flown, ...] = ()
    if chunk.count:
        worker.give(chunk)
        while worker.waiting:
            answer = worker.receive()
            flights = answer[1] if answer else flights
    return flights


def dismiss(plan_sha256: str) -> None:
    """End the idle processes that this Dask worker keeps for a campaign."""
    with _idle_lock:
        workers = _idle.pop(plan_sha256, [])
    for worker in workers:
        worker.close()


@final
class DaskFleet:
    """A Dask cluster; a context manager.

    Args:
        campaign: the plan.
        address: of the scheduler.

    Raises:
        InputError: nobody answers there, or it has no workers.
    """

    def __init__(self, campaign: Campaign, *, address: str) -> None:
        self._campaign = campaign
        self._tries: Counter[int] = Counter()
        self._chunks: dict[str, Chunk] = {}
        self._provenance: dict[str, dict[str, str]] = {}
        self._ask = f"finback-{campaign.sha256[:12]}-{uuid.uuid4().hex}"  # the answers of another client are not ours
        try:
            self._client = Client(address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:  # a TimeoutError is an OSError
            raise InputError(
                f"no Dask scheduler answers at '{address}': {error}", hint="start one with: dask scheduler"
            ) from error
        self._flown: Any = as_completed([], loop=self._client.loop)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._client.cancel([Future(key, self._client) for key in self._chunks], force=True)
            self._client.run(dismiss, self._campaign.sha256, on_error="ignore")
        finally:
            self._client.close()

    @property
    def provenance(self) -> dict[str, dict[str, str]]:
        """Fidelity -> what is flown, with versions; waits for the first worker."""
        if not self._provenance:
            future = self._submit(Chunk(first=0, count=0))
            try:
                self._provenance = future.result()[0]
            finally:
                self._chunks.pop(future.key, None)
        return self._provenance

    @property
    def depth(self) -> int:
        """How many chunks keep it busy."""
        threads: int = sum(self._client.nthreads().values())
        return _DEEP * max(1, threads)

    def give(self, chunk: Chunk) -> None:
        """Let a chunk be flown."""
        self._flown.add(self._submit(chunk))

    def take(self) -> tuple[Chunk, tuple[Flown, ...]]:
        """Return a chunk that is flown; waits for it. What a lost worker had is flown again by the others.

        Raises:
            FinbackError: what the cluster cannot do.
        """
        while True:
            future = next(self._flown)
            chunk = self._chunks.pop(future.key)
            if future.status == "finished":
                flights: tuple[Flown, ...] = future.result()[1]
                future.release()
                return chunk, flights
            error = RuntimeError("it was canceled") if future.cancelled() else future.exception()
            if isinstance(error, FinbackError):
                raise error
            self._tries[chunk.first] += 1
            if self._tries[chunk.first] >= _TRIES:
                last = chunk.first + chunk.count - 1
                raise RefusedError(
                    f"the cluster failed {_TRIES} times at flights {chunk.first} to {last}: {error}",
                    hint="are its workers alive?",
                )
            self.give(chunk)

    def _submit(self, chunk: Chunk) -> Any:
        key = f"{self._ask}-{chunk.first}-{chunk.count}-{self._tries[chunk.first]}"
        self._chunks[key] = chunk
        return self._client.submit(fly_on_worker, self._campaign, chunk, self._provenance, key=key, pure=False)
