"""How a command ends: the one place where mistakes become messages and exit codes.

0 done, or the model agrees; 1 it disagrees, or nobody can tell; 2 the user can mend it; 3 physics or numerics refuse;
4 a bug of ours; 128 + the signal's number when stopped by one (Ctrl-C: 130, see ``main``) or when nobody reads the
output (141).
"""

from __future__ import annotations

import functools
import os
import platform
import sys
import tempfile
import traceback
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Final, ParamSpec

import typer

from finback import __version__
from finback.cli.signals import stopped_by
from finback.cli.streams import STANDARD_OUTPUT, discard
from finback.errors import FinbackError

DONE: Final = 0
UNCONVINCED: Final = 1
MENDABLE: Final = 2
BUG: Final = 4
_SIGNALLED: Final = 128

P = ParamSpec("P")


def verb(function: Callable[P, int]) -> Callable[P, None]:
    """Make a command of a function that returns an exit code: no traceback leaves it."""

    @functools.wraps(function)
    def command(*args: P.args, **kwargs: P.kwargs) -> None:
        try:
            code = function(*args, **kwargs)
            sys.stdout.flush()
        except (typer.Exit, SystemExit, KeyboardInterrupt):
            raise
        except BaseException as error:
            if stopped_by():  # an import or a library that is interrupted raises what it likes
                raise
            code = _report(error)
        raise typer.Exit(code)

    return command


def say(message: str) -> None:
    """Write a line to stderr; if nobody can read it, nobody does."""
    with suppress(OSError):
        print(message, file=sys.stderr, flush=True)  # noqa: T201 - this is where messages go


def _report(error: BaseException) -> int:
    """Say what went wrong and return the exit code."""
    if isinstance(error, FinbackError):
        say(f"finback: {error}")
        return error.exit_code
    if isinstance(error, BrokenPipeError):
        discard(1)
        return _SIGNALLED + 13
    if isinstance(error, OSError):
        places = [str(name) for name in (error.filename, error.filename2) if name is not None]
        reason = error.strerror or str(error)
        say(f"finback: {': '.join([*places, reason])}")
        if error.filename == STANDARD_OUTPUT:
            discard(1)
            return MENDABLE
        say("  is the folder there, writable, and not full? --output names another")
        return MENDABLE
    say(f"finback: this is a bug: {type(error).__name__}: {error}")
    say(f"  {_write_crash_log(error)}")
    return BUG


def _write_crash_log(error: BaseException) -> str:
    """Write traceback and versions to a file of its own and say where it is; without one, say it all."""
    text = "".join(traceback.format_exception(error))
    packages = ("numpy", "scipy", "pandas", "jsbsim", "pyarrow", "rerun-sdk", "matplotlib", "pydantic", "cattrs")
    lines = [
        f"finback {__version__}, Python {platform.python_version()}, {platform.platform()}",
        datetime.now(UTC).isoformat(timespec="seconds"),
        f"command: {sys.argv}",
        *(f"{name} {_version(name)}" for name in packages),
        text,
    ]
    try:
        descriptor, name = tempfile.mkstemp(prefix="finback-crash-", suffix=".log")
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write("\n".join(lines))
    except OSError:
        return "\n".join(lines)
    return f"please report it with {Path(name)}"


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
