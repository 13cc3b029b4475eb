"""The folder of a run: ``logs/<study>/<UTC time>``, begun with a copy of the study file."""

from __future__ import annotations

import shutil
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from finback.files import write_text
from finback.store.envelope import STUDY_FILE

LOGS: Final = "logs"
RECORDINGS: Final = "recordings"
_STAMP: Final = "%Y%m%dT%H%M%SZ"


def new_run(study: str, text: str, output: Path) -> Path:
    """Make the folder of a new run, with the study in it.

    Args:
        study: the study's name.
        text: its file's content.
        output: the folder of ``logs``.

    Raises:
        OSError: ``output`` cannot be written to.
    """
    parent = output / LOGS / study
    parent.mkdir(parents=True, exist_ok=True)
    stamp = datetime.now(UTC).strftime(_STAMP)
    name, number = stamp, 1
    while True:
        try:
            (parent / name).mkdir()
            break
        except FileExistsError:
            number += 1
            name = f"{stamp}-{number}"
    run = parent / name
    try:
        write_text(run / STUDY_FILE, text)
        (run / RECORDINGS).mkdir()
    except BaseException:
        discard(run)
        raise
    return run


def discard(run: Path) -> None:
    """Remove a run that never came to have a sweep, and its study's folder if that is empty without it."""
    shutil.rmtree(run, ignore_errors=True)
    with suppress(OSError):
        run.parent.rmdir()
