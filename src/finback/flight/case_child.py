"""The child of ``case_process``: ``python -m finback.flight.case_child ANSWER``.

It reads the pickled order from standard input and writes the pickled answer into the file ``ANSWER``.
"""

from __future__ import annotations

import os
import pickle
import sys
from dataclasses import fields
from pathlib import Path

from finback.errors import FinbackError
from finback.flight.case_flight import fly_case
from finback.flight.case_process import NO_FILE, Mistake, Order
from finback.flight.case_resolution import with_step_error
from finback.flight.trial import leave_no_core


def _answer(order: Order) -> object:
    try:
        flown = fly_case(order.case)
        if order.check_step:
            flown = with_step_error(order.case, flown)
    except FinbackError as error:
        return Mistake(kind=type(error).__name__, message=error.message, hint=error.hint)
    plain = {one.name: getattr(flown, one.name) for one in fields(flown)}
    return {name: dict(value) if hasattr(value, "keys") else value for name, value in plain.items()}


if __name__ == "__main__":
    leave_no_core()
    os.environ.pop("JSBSIM_DEBUG", None)  # it would silence warnings
    order = pickle.load(sys.stdin.buffer)  # noqa: S301 - from our own parent
    try:
        found = _answer(order)
        Path(sys.argv[1]).write_bytes(pickle.dumps(found))
    except OSError as error:  # a copy of the aircraft or the answer; a full disk does not say which
        sys.stderr.write(f"\n{error.strerror or error}")
        sys.exit(NO_FILE)
