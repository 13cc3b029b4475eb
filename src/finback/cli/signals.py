"""Signals that ask the program to stop. Imports next to nothing, so that it listens from the first moment."""

from __future__ import annotations

import signal
import sys
import time
from types import FrameType

_NUMBERS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
_IMPATIENT_S = 2.0  # a second Ctrl-C this soon does not interrupt the cleaning up
_received: list[tuple[int, float]] = []  # number and time of each


def listen() -> None:
    """Turn SIGINT, SIGTERM and SIGHUP into KeyboardInterrupt, so that everything on the way out is cleaned up."""
    for number in _NUMBERS:
        if number in (signal.SIGINT, signal.SIGTERM) or signal.getsignal(number) != signal.SIG_IGN:  # nohup
            signal.signal(number, _stop)


def ignore() -> None:
    """Take no notice of signals any more: all is done or cleaned up, and the program is about to end."""
    for number in _NUMBERS:
        signal.signal(number, signal.SIG_IGN)


def stopped_by() -> int:
    """Return the number of the first signal that asked to stop, 0 if none did."""
    return _received[0][0] if _received else 0


def raise_if_stopped() -> None:
    """Raise KeyboardInterrupt if a signal asked to stop and something on the way swallowed the exception."""
    if _received:
        raise KeyboardInterrupt


def _say_nothing(_: sys.UnraisableHookArgs) -> None:
    pass


def _stop(number: int, _: FrameType | None) -> None:
    sys.unraisablehook = (
        _say_nothing  # an interrupt in a destructor cannot go on, and shall not be shown as a traceback
    )
    now = time.monotonic()
    again = bool(_received) and now - _received[-1][1] < _IMPATIENT_S
    _received.append((number, now))
    if not again:
        raise KeyboardInterrupt
