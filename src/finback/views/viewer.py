"""The Rerun viewer that comes with the package: where its program is, and how to start it without any network."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Final

import rerun_cli

from finback.errors import InputError

_NOWHERE: Final = "http://127.0.0.1:9"


def viewer_program() -> Path:
    """Return the viewer's own program. The wrapper on PATH would leave it running when stopped.

    Raises:
        InputError: the package came without it.
    """
    program = Path(str(rerun_cli.__file__)).with_name("rerun")
    for candidate in (program, program.with_suffix(".exe"), program.parent / "Rerun.app/Contents/MacOS/Rerun"):
        if candidate.is_file():
            return candidate
    raise InputError(f"the Rerun viewer is not at {program}", hint="install rerun-sdk again")


def viewer_environment() -> dict[str, str]:
    """Return an environment in which the viewer sends nothing: no usage statistics, no look for new versions."""
    silent = {"CI": "1", "RUST_LOG": "error", "HTTP_PROXY": _NOWHERE, "HTTPS_PROXY": _NOWHERE, "ALL_PROXY": _NOWHERE}
    runtime = os.environ.get("XDG_RUNTIME_DIR", tempfile.gettempdir())
    return {**os.environ, **silent, "XDG_RUNTIME_DIR": runtime, "NO_PROXY": "127.0.0.1,localhost"}
