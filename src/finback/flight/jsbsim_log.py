"""What JSBSim says, and two of its traps that every object of it shares."""

from __future__ import annotations

import ctypes
import threading
from pathlib import Path
from typing import final

import jsbsim

from finback.errors import InputError


@final
class Log(jsbsim.FGLogger):
    """Keeps warnings and worse; JSBSim sends a message in pieces between set_level and flush.

    Attributes:
        texts: the messages, each in one line.
        faults: the same, with file and line before them where JSBSim names these.
        worse: whether one was more than a warning.
    """

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.faults: list[str] = []
        self.worse = False
        self._level = 0
        self._text = ""
        self._place = ""

    def set_level(self, level: int) -> None:
        """Begin a message."""
        self._level, self._text, self._place = int(level), "", ""

    def file_location(self, filename: str, line: int) -> None:
        """Learn where the message comes from."""
        self._place = f"{Path(filename).name}:{line}: "

    def message(self, message: str) -> None:
        """Take a piece of the message."""
        self._text += message

    def flush(self) -> None:
        """End the message, and keep it if it is a warning or worse."""
        if jsbsim.LogLevel.WARN <= self._level <= jsbsim.LogLevel.FATAL and self._text.strip():
            self.texts.append(one_line(self._text))
            self.faults.append(self._place + self.texts[-1])
            self.worse |= self._level > jsbsim.LogLevel.WARN
        self._text = ""


def one_line(text: str) -> str:
    """Return a text without line breaks and runs of blanks."""
    return " ".join(text.split())


def keep_alive(fdm: jsbsim.FGFDMExec) -> None:
    """Keep an object for ever: JSBSim aborts the interpreter when one whose start failed is destroyed."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(fdm))


def refuse_threads() -> None:
    """Raise InputError outside of the main thread."""
    if threading.current_thread() is not threading.main_thread():
        raise InputError(
            "JSBSim cannot run in a thread: it would end the interpreter", hint="use a process for each simulator"
        )
