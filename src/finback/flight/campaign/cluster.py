"""A fleet on an existing Dask cluster: every Dask worker drives processes of its own that fly (``hangar``).

The Dask workers need the same Finback and JSBSim, and the aircraft at the same path.
"""

from __future__ import annotations

import time
import uuid
from collections import Counter
from contextlib import suppress
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any, Final, Self, final

from finback.errors import FinbackError, InputError, RefusedError
from finback.flight.campaign.crew import Flown
from finback.flight.campaign.hangar import dismiss, fly_on_worker
from finback.flight.campaign.message import Chunk
from finback.flight.campaign.plan import Campaign

try:
    from distributed import Client
except ImportError as error:
    raise InputError(
        "flying on a Dask cluster needs Dask, which is not installed", hint="pip install 'finback[cluster]'"
    ) from error

_CONNECT_S: Final = 10.0  # for the scheduler to answer, and to have a worker
_LOOK_S: Final = 2.0  # between two looks at a cluster that gives no answer
_LONELY_S: Final = 60.0  # that a campaign waits for a worker when all are lost; who restarts them needs a while
_TRIES: Final = 3  # at one chunk, whatever happens to those who fly it
_DEEP: Final = 2  # chunks for each thread of the cluster: one it flies, one it need not wait for
_LOST: Final = (OSError, RuntimeError)  # what Dask raises of a scheduler that is gone: also when it closes meanwhile


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
        self._address = address
        self._tries: Counter[int] = Counter()
        self._given: dict[str, tuple[Any, Chunk]] = {}  # key -> what Dask promises, and of what
        self._over: SimpleQueue[str] = SimpleQueue()  # keys of what ended, one way or the other
        self._provenance: dict[str, dict[str, str]] = {}
        self._name = f"finback-{campaign.sha256[:12]}-{uuid.uuid4().hex}"  # the answers of another fleet are not ours
        try:
            self._client = Client(address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:  # a TimeoutError is an OSError
            raise InputError(
                f"no Dask scheduler answers at '{address}': {error}", hint="start one with: dask scheduler"
            ) from error
        try:
            self._client.wait_for_workers(1, timeout=_CONNECT_S)
        except TimeoutError as error:
            self._client.close()
            raise InputError(
                f"the Dask scheduler at '{address}' has no workers", hint=f"start one with: dask worker {address}"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            with suppress(*_LOST):  # a scheduler that is gone has nothing that could be canceled
                self._client.cancel([future for future, _ in self._given.values()], force=True)
                self._client.run(dismiss, self._name, on_error="ignore")
        finally:
            self._client.close()

    @property
    def provenance(self) -> dict[str, dict[str, str]]:
        """Fidelity -> what is flown, with versions; waits for the first worker."""
        if not self._provenance:
            self.give(Chunk(first=-1, count=0))
            _, (self._provenance, _) = self._wait()
        return self._provenance

    @property
    def depth(self) -> int:
        """How many chunks keep it busy."""
        return _DEEP * max(1, self._threads())

    def give(self, chunk: Chunk) -> None:
        """Let a chunk be flown."""
        key = f"{self._name}-{chunk.first}-{chunk.count}-{self._tries[chunk.first]}"
        try:
            future = self._client.submit(
                fly_on_worker, self._name, self._campaign, chunk, self._provenance, key=key, pure=False
            )
            self._given[key] = (future, chunk)
            future.add_done_callback(lambda _: self._over.put(key))
        except _LOST as error:
            raise self._gone(error) from error

    def take(self) -> tuple[Chunk, tuple[Flown, ...]]:
        """Return a chunk that is flown; waits for it. What a lost worker had is flown again by the others.

        Raises:
            FinbackError: what the cluster cannot do.
        """
        chunk, (_, flights) = self._wait()
        return chunk, flights

    def _wait(self) -> tuple[Chunk, tuple[dict[str, dict[str, str]], tuple[Flown, ...]]]:
        """Return the next chunk that is done, and the answer of whoever flew it."""
        while True:
            future, chunk = self._given.pop(self._next())
            if future.status == "finished":
                answer: tuple[dict[str, dict[str, str]], tuple[Flown, ...]] = future.result()
                future.release()
                return chunk, answer
            self._threads()  # a scheduler that is gone cancels all
            error = RuntimeError("it was canceled") if future.cancelled() else future.exception()
            if isinstance(error, FinbackError):
                raise error
            self._tries[chunk.first] += 1
            if self._tries[chunk.first] >= _TRIES:
                last = chunk.first + chunk.count - 1
                where = f"at flights {chunk.first} to {last}" if chunk.count else "before it flew"
                raise RefusedError(f"the cluster failed {_TRIES} times {where}: {error}", hint="are its workers alive?")
            self.give(chunk)

    def _next(self) -> str:
        """Return the key of the next chunk that ended; waits for it, as long as there is somebody who flies."""
        seen = time.monotonic()
        while True:
            try:
                return self._over.get(timeout=_LOOK_S)
            except Empty:
                now = time.monotonic()
                if self._threads():
                    seen = now
                if now - seen > _LONELY_S:
                    raise RefusedError(
                        f"the Dask scheduler at '{self._address}' has had no workers for {_LONELY_S:g} s",
                        hint=f"start some with: dask worker {self._address}, and go on with the campaign",
                    ) from None

    def _threads(self) -> int:
        """Return how many threads the cluster has; 0 if all workers are lost."""
        try:
            return sum(self._client.nthreads().values())
        except _LOST as error:
            raise self._gone(error) from error

    def _gone(self, error: BaseException) -> RefusedError:
        return RefusedError(
            f"the Dask scheduler at '{self._address}' is gone: {error}",
            hint="start it and its workers again, and go on with the campaign",
        )
