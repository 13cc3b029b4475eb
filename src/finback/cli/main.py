"""The program ``finback``."""

from __future__ import annotations

import sys
from io import TextIOWrapper

from finback.cli.signals import ignore, listen, stopped_by


def main() -> None:
    """Run the program with the arguments of the process, and exit with its code."""
    try:
        listen()
        from finback.cli.application import app

        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, TextIOWrapper):
                stream.reconfigure(errors="replace")  # a terminal without ± shall not stop a result
        app()
    except BaseException:  # whatever an interrupted import or library made of the interrupt
        ignore()
        if not stopped_by():
            raise
        print("finback: interrupted; nothing is half-written", file=sys.stderr)  # noqa: T201 - the place for messages
        # CPython remembers an interrupt that passed through exec() of a text (so are dataclasses made), even if caught,
        # and dies of SIGINT in place of exiting; another text makes it forget.
        exec("")  # noqa: S102 - it does nothing
        sys.exit(128 + stopped_by())
