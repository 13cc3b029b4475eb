"""The program ``finback``."""

from __future__ import annotations

import os
import sys

from finback.cli.signals import ignore, listen, stopped_by
from finback.cli.streams import discard, prepare


def main() -> None:
    """Run the program with the arguments of the process, and exit with its code."""
    # Our matrices are small: BLAS threads only wait for each other, up to ten times longer than one works. A thread
    # pool is made when numpy is imported; nothing above imports it. Child processes inherit this.
    for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(threads, "1")
    try:
        listen()
        prepare()
        os.environ.setdefault("RUST_LOG", "off")  # the recorder's own log: what it says comes as an exception too
        from finback.cli.application import app

        app()
    except BaseException:  # whatever an interrupted import or library made of the interrupt
        ignore()
        if not stopped_by():
            raise
        try:
            print("finback: interrupted; nothing is half-written", file=sys.stderr)  # noqa: T201 - the place for it
        except OSError:  # the terminal is gone
            discard(2)
        # CPython remembers an interrupt that passed through exec() of a text (so are dataclasses made), even if caught,
        # and dies of SIGINT in place of exiting; another text makes it forget.
        exec("")  # noqa: S102 - it does nothing
        sys.exit(128 + stopped_by())
