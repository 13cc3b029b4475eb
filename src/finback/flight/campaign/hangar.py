"""The processes that a Dask worker keeps for the campaigns of others.

JSBSim bears no threads, and Dask runs its tasks in threads: so a task hands its chunk to a process that stays for the
next task of the same fleet, until the fleet dismisses it, or nobody asks for it any more.
"""

from __future__ import annotations

import os
import tempfile
import threading
from collections import deque
from dataclasses import dataclass, field
from typing import Final, final

from finback.errors import InputError, RefusedError
from finback.flight.campaign.crew import Flown
from finback.flight.campaign.message import FOLDER, Chunk
from finback.flight.campaign.plan import Campaign
from finback.flight.campaign.process import Worker, one_thread

_IDLE_S: Final = 60.0  # then a process ends: its fleet was killed and dismisses nobody
_REMEMBERED: Final = 1000  # fleets that are over, whose last tasks may still come


@final
@dataclass(frozen=True, slots=True)
class _Stand:
    """What is kept for a fleet.

    Attributes:
        folder: for temporary files of its processes: killed, they remove none. It goes with the last of them.
        idle: processes that wait for a chunk, with the clock that ends them.
        busy: processes that fly.
    """

    folder: tempfile.TemporaryDirectory[str] = field(
        default_factory=lambda: tempfile.TemporaryDirectory(prefix=FOLDER, ignore_cleanup_errors=True)
    )
    idle: list[tuple[Worker, threading.Timer]] = field(default_factory=list)
    busy: list[Worker] = field(default_factory=list)


_stands: Final[dict[str, _Stand]] = {}
_dismissed: Final[deque[str]] = deque(maxlen=_REMEMBERED)
_lock: Final = threading.Lock()  # of both


def fly_on_worker(
    fleet: str, campaign: Campaign, chunk: Chunk, expected: dict[str, dict[str, str]]
) -> tuple[dict[str, dict[str, str]], tuple[Flown, ...]]:
    """Fly a chunk in a process of this Dask worker; return what flew, and the flights.

    Args:
        fleet: who asks.
        campaign: the plan.
        chunk: none of its flights, if it is empty: then a process is only made ready.
        expected: what shall fly; empty if anything may.

    Raises:
        InputError: here something else would fly.
        RefusedError: the fleet is over.
        WorkerDiedError: the process died; the chunk can be flown again.
    """
    worker = _take(fleet, campaign)
    try:
        flights = _fly(worker, chunk, expected)
    except BaseException:
        _drop(fleet, worker)
        raise
    _keep(fleet, worker)
    return worker.provenance, flights


def dismiss(fleet: str) -> None:
    """End all processes that this Dask worker keeps for a fleet, those that fly among them."""
    with _lock:
        _dismissed.append(fleet)
        stand = _stands.pop(fleet, None)
    if stand is None:
        return
    for worker, clock in stand.idle:
        clock.cancel()
        worker.close()
    for worker in stand.busy:
        worker.process.kill()  # whoever waits for its answer closes it
        worker.process.wait()  # it writes nothing more
    stand.folder.cleanup()


def _take(fleet: str, campaign: Campaign) -> Worker:
    with _lock:
        if fleet in _dismissed:
            raise RefusedError("this campaign's fleet is over")
        if fleet not in _stands:
            _stands[fleet] = _Stand()
        stand = _stands[fleet]
        if stand.idle:
            worker, clock = stand.idle.pop()
            clock.cancel()
        else:
            try:
                worker = Worker(campaign, environment={**one_thread(os.environ), "TMPDIR": stand.folder.name})
            except BaseException:
                _leave(fleet, stand)
                raise
        stand.busy.append(worker)
    return worker


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


def _keep(fleet: str, worker: Worker) -> None:
    """Let a process wait for the fleet's next chunk, but not for ever."""
    clock = threading.Timer(_IDLE_S, _retire, (fleet, worker))
    clock.daemon = True
    with _lock:
        over = fleet in _dismissed
        if not over:
            stand = _stands[fleet]
            stand.busy.remove(worker)
            stand.idle.append((worker, clock))
            clock.start()
    if over:
        worker.close()


def _drop(fleet: str, worker: Worker) -> None:
    """End a process that flew."""
    worker.close()
    with _lock:
        stand = _stands.get(fleet)
        if stand is not None:
            stand.busy.remove(worker)
            _leave(fleet, stand)


def _retire(fleet: str, worker: Worker) -> None:
    """End a process if it still waits."""
    with _lock:
        stand = _stands.get(fleet)
        mine = [pair for pair in stand.idle if pair[0] is worker] if stand is not None else []
        if stand is None or not mine:
            return
        for pair in mine:
            stand.idle.remove(pair)
        worker.close()
        _leave(fleet, stand)


def _leave(fleet: str, stand: _Stand) -> None:
    """Remove what is kept for a fleet if no process uses it; the next one makes it anew. The caller has the lock."""
    if not stand.idle and not stand.busy:
        del _stands[fleet]
        stand.folder.cleanup()
