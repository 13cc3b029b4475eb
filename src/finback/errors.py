"""The mistakes Finback names. Outcomes of flights and fits are values; only mistakes are exceptions.

Each class carries the exit code that the command line gives for it.
"""

from __future__ import annotations

from typing import ClassVar, final


class FinbackError(Exception):
    """A mistake with a place and a way out.

    Args:
        message: what is wrong, and where (path, key, channel, value).
        hint: what to do about it, a sentence or a command; may be empty.
    """

    exit_code: ClassVar[int] = 2

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message}\n  {self.hint}" if self.hint else self.message


class InputError(FinbackError):
    """Something that the user gave is wrong, and the user can mend it (exit code 2)."""


class FaultyFileError(InputError):
    """A file with faults; all of them at once.

    Args:
        path: the file.
        faults: one line each, beginning with the path of the faulty key.
    """

    def __init__(self, path: str, faults: tuple[str, ...]) -> None:
        lines = "\n".join(f"  {fault}" for fault in faults)
        super().__init__(f"{path}: {len(faults)} fault{'s' if len(faults) != 1 else ''}\n{lines}")
        self.faults = faults


@final
class StudyError(FaultyFileError):
    """A study file with faults."""


@final
class ModelFileError(FaultyFileError):
    """A file of a model with faults."""


@final
class AircraftError(InputError):
    """An aircraft that is missing or that JSBSim does not load without a warning."""


@final
class MissingResultError(InputError):
    """The result of an earlier stage is missing or stale; the hint is the command that makes it."""


@final
class RefusedError(FinbackError):
    """Physics or numerics forbid what was asked, however well it was asked (exit code 3)."""

    exit_code: ClassVar[int] = 3
