"""A case flown in a process of its own, which JSBSim may end without ending ours.

Order and answer are pickled: both ends are this program (``case_child``).
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NoReturn, final

from finback.errors import AircraftError, FinbackError, InputError, RefusedError
from finback.flight.case import Case, FlownCase
from finback.flight.jsbsim_log import one_line

_KINDS: Final[dict[str, type[FinbackError]]] = {kind.__name__: kind for kind in (AircraftError, RefusedError)}
_SHOWN: Final = 500  # characters of what a dying child says
NO_FILE: Final = 74
"""Exit code of a child that could not write a file (EX_IOERR); the last line it says is why."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What a child is asked.

    Attributes:
        case: with absolute paths.
        check_step: fly it again at half the step.
    """

    case: Case
    check_step: bool


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Mistake:
    """An exception of ours, as it is sent.

    Attributes:
        kind: name of its class.
        message: of it.
        hint: of it.
    """

    kind: str
    message: str
    hint: str


def fly_apart(case: Case) -> FlownCase:
    """Fly a case in a child process, as ``fly_case`` does; its death is an error, not ours.

    Raises:
        AircraftError: as ``fly_case``, or JSBSim has ended the process.
        InputError: as ``fly_case``.
    """
    return _ask(Order(case=_absolute(case), check_step=False))


def fly_apart_checked(case: Case) -> FlownCase:
    """Fly a case in a child process and again at half the step (``with_step_error``).

    Raises:
        AircraftError: as ``fly_apart``.
        InputError: as ``fly_apart``.
    """
    return _ask(Order(case=_absolute(case), check_step=True))


def _absolute(case: Case) -> Case:
    """Return the case with paths that hold in any working directory."""
    return replace(
        case,
        source=case.source.resolve(),
        initial_file=str(Path(case.initial_file).resolve()) if case.initial_file else "",
        planet_file=str(Path(case.planet_file).resolve()) if case.planet_file else "",
    )


def _ask(order: Order) -> FlownCase:
    with tempfile.TemporaryDirectory(prefix="finback-apart-") as folder:
        answer = Path(folder) / "answer"
        done = subprocess.run(  # noqa: S603 - our own interpreter and module
            [sys.executable, "-m", "finback.flight.case_child", str(answer)],
            input=pickle.dumps(order),
            capture_output=True,
            cwd=folder,
            env={**os.environ, "TMPDIR": folder},  # should it die, what it leaves lies where all is removed
            check=False,
        )
        said = done.stderr.decode(errors="replace")
        if done.returncode:
            _died(order.case, done.returncode, said)
        given = pickle.loads(answer.read_bytes())  # noqa: S301 - as above
    if isinstance(given, Mistake):
        raise _KINDS.get(given.kind, InputError)(given.message, hint=given.hint)
    return FlownCase(**given)


def _died(case: Case, code: int, said: str) -> NoReturn:
    if code == NO_FILE:
        raise InputError(
            f"the temporary folder {tempfile.gettempdir()} cannot be used: {said.splitlines()[-1][-_SHOWN:]}",
            hint="is it full? TMPDIR names another",
        )
    if code > 0:  # an exception that is no mistake of the user's
        raise RuntimeError(f"the process that flew {case.source} ended with exit code {code}:\n{said}")
    files = ", ".join(str(file) for file in (case.source, case.initial_file, case.planet_file) if str(file))
    raise AircraftError(
        f"{files}: JSBSim ended its process by {signal.Signals(-code).name}: "
        f"{one_line(said)[-_SHOWN:] or 'it says nothing'}",
        hint="a number that is none, an unknown name or a broken file are the usual reasons",
    )
