"""A process that flies parts of a campaign: ``python -m finback.flight.campaign.worker DESCRIPTOR``.

A process of its own, not a thread, because JSBSim bears no threads; and an interpreter started anew, not a fork, so
that it holds nothing but its own simulator and may be started by any program, a worker of a cluster included.

Over the connection it gets the campaign and answers ``Ready``; then it gets ``Chunk``s and answers with the flights
of each. When the connection closes it ends. A mistake is answered as ``Failed``, and ends it too.
"""

from __future__ import annotations

import signal
import sys
import tempfile
import traceback
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from finback.errors import FinbackError, InputError
from finback.flight.campaign.message import FOLDER, Chunk, Failed, Ready

_INTERRUPTS: Final = ("SIGINT", "SIGHUP")  # meant for whoever started us; if that ends, the connection closes


def main() -> None:
    """Fly what comes over the connection until it closes."""
    for name in _INTERRUPTS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    connection = Connection(int(sys.argv[1]))
    try:
        _serve(connection)
    except (EOFError, BrokenPipeError, ConnectionResetError):  # nobody waits for an answer any more
        _leave()


def _leave() -> None:
    """Remove the folder that a fleet which was killed could not remove, if nobody else uses it."""
    folder = Path(tempfile.gettempdir())
    if folder.name.startswith(FOLDER):
        with suppress(OSError):
            folder.rmdir()


def _serve(connection: Connection) -> None:
    from finback.flight.campaign.crew import Crew  # noqa: PLC0415 - what fails in here is answered

    try:
        with Crew(connection.recv()) as crew:
            connection.send(Ready(provenance=crew.provenance))
            while True:
                chunk: Chunk = connection.recv()
                flights = tuple(crew.fly(index) for index in range(chunk.first, chunk.first + chunk.count))
                connection.send(flights)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        raise
    except OSError as error:  # not of the connection: a copy of the aircraft could not be written
        message = f"a worker cannot use its temporary folder: {error}"
        connection.send(Failed(error=InputError(message, hint="is it full? TMPDIR names another")))
    except FinbackError as error:
        connection.send(Failed(error=error))
    except Exception:  # noqa: BLE001 - a bug of ours must reach whoever can report it
        connection.send(Failed(error=RuntimeError(f"a worker failed:\n{traceback.format_exc()}")))


if __name__ == "__main__":
    main()
