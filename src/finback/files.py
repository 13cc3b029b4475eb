"""Files that are either complete or not there, and their fingerprints."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary name beside ``path`` to write to; on success it becomes ``path``, on any exception it is gone.

    Raises:
        OSError: the folder is missing, not writable or full; what stood at ``path`` before still does.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        # A full disk does not say which file; nobody has asked for the temporary one.
        if error.errno is not None and error.filename in {None, str(part)}:
            error.filename = str(path)
            del error.filename2  # None would be shown: 'a' -> None
        raise
    finally:
        part.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8, the same bytes on every system) so that it is never seen half-written."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8", newline="\n")


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file's content, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
