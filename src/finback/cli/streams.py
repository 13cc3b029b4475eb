"""Standard streams that are closed, full, or read by nobody. Imports next to nothing, as it is needed at once."""

from __future__ import annotations

import os
import sys
from io import BufferedWriter, FileIO, TextIOWrapper

STANDARD_OUTPUT = "standard output"


class _Named(FileIO):
    """A file whose errors say that it is the standard output; the system's own name no file."""

    def write(self, data: object, /) -> int:
        try:
            return super().write(data)  # type: ignore[arg-type]  # whatever a buffer hands down
        except OSError as error:
            error.filename = STANDARD_OUTPUT
            raise


def prepare() -> None:
    """Make standard output and error such that a result can always be written, or a message says why it cannot."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:  # closed (finback run STUDY >&-): no file shall be opened in its place
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free descriptor: this one
    # Python has no object for a stream that was closed; libraries expect one.
    if sys.stdout is None:
        sys.stdout = _around(1)
    if sys.stderr is None:
        sys.stderr = _around(2)
    out = sys.stdout
    if out is sys.__stdout__ and isinstance(out, TextIOWrapper):
        named = BufferedWriter(_Named(out.fileno(), "w", closefd=False))
        sys.stdout = TextIOWrapper(named, encoding=out.encoding, line_buffering=out.isatty())
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without ± shall not stop a result


def _around(descriptor: int) -> TextIOWrapper:
    return TextIOWrapper(BufferedWriter(FileIO(descriptor, "w", closefd=False)), encoding="utf-8")


def discard(descriptor: int) -> None:
    """Let what is still buffered, and all that follows, go nowhere: the interpreter shall not stumble over it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), descriptor)
