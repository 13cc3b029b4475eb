"""A worker as its owner sees it: a child process at the other end of a connection."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from multiprocessing import Pipe
from typing import Final, final

from finback.flight.campaign.crew import Flown
from finback.flight.campaign.message import Chunk, Failed, Ready
from finback.flight.campaign.plan import Campaign

_PATIENCE_S: Final = 5.0  # for a process that was told to end
_LAST_WORDS: Final = 2000  # characters
_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def one_thread(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment in which libraries start no threads of their own: the workers are many already."""
    return {**environment, **dict.fromkeys(_THREADS, "1")}


class WorkerDiedError(Exception):
    """A worker's process ended by itself, or was killed; what it has not answered must be flown again."""


@final
class Worker:
    """A child process that flies chunks, one after the other; starts at once, gets ready meanwhile.

    Args:
        campaign: the plan.
        environment: of the process.

    Attributes:
        connection: for ``multiprocessing.connection.wait``; readable when ``receive`` has something to give.
        process: the child.
        waiting: chunks it was given and has not answered, oldest first.
        provenance: what it flies; empty until it is ready.
    """

    def __init__(self, campaign: Campaign, *, environment: Mapping[str, str]) -> None:
        self.waiting: list[Chunk] = []
        self.provenance: dict[str, dict[str, str]] = {}
        self._words = tempfile.TemporaryFile("w+b")  # noqa: SIM115 - as long as the worker
        self.connection, theirs = Pipe()
        try:
            self.process = subprocess.Popen(  # noqa: S603 - our own interpreter and module
                [sys.executable, "-m", "finback.flight.campaign.worker", str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=self._words,
                stderr=self._words,
                pass_fds=(theirs.fileno(),),
                env=environment,
                process_group=0,  # Ctrl-C at the terminal is for the owner, who ends us in good order
            )
        finally:
            theirs.close()
        with suppress(OSError):  # it is dead; ``receive`` will say so
            self.connection.send(campaign)

    def give(self, chunk: Chunk) -> None:
        """Let it fly a chunk, after those that it was given before."""
        self.waiting.append(chunk)
        with suppress(OSError):  # as above
            self.connection.send(chunk)

    def receive(self) -> tuple[Chunk, tuple[Flown, ...]] | None:
        """Return the next chunk that is flown, or None if the worker has only become ready; waits for it.

        Raises:
            WorkerDiedError: it is no more.
            FinbackError: what the worker cannot do for a reason that Finback names.
        """
        try:
            answer: object = self.connection.recv()
        except (EOFError, OSError) as error:
            raise WorkerDiedError(self._epitaph()) from error
        if isinstance(answer, Ready):
            self.provenance = answer.provenance
            return None
        if isinstance(answer, Failed):
            raise answer.error
        if not isinstance(answer, tuple):
            raise TypeError(f"a worker answered {type(answer).__name__}")
        return self.waiting.pop(0), answer

    def close(self) -> None:
        """End it, at once."""
        self.connection.close()
        self.process.kill()
        self.process.wait(_PATIENCE_S)
        self._words.close()

    def _epitaph(self) -> str:
        with suppress(subprocess.TimeoutExpired):  # it has closed its end, and should be about to go
            self.process.wait(_PATIENCE_S)
        self.process.kill()
        code = self.process.wait(_PATIENCE_S)
        self._words.seek(0)
        words = self._words.read().decode(errors="replace").strip()[-_LAST_WORDS:]
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        return f"a worker ended by {how}{f', saying: {words}' if words else ''}"
