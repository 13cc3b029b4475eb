"""A first flight in a child process: what JSBSim says of an aircraft, and what it makes of it.

JSBSim may end the whole interpreter over a faulty file (SIGABRT, SIGSEGV); here that interpreter is a child.
Run as ``python -m finback.flight.trial`` with the request as JSON on standard input; the answer is JSON on the last
line of standard output.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final, final

from finback.errors import AircraftError

TIMEOUT_S: Final = 60.0
_STEP_S: Final = 1 / 400
_REMEMBERED: Final = 64  # trials without a fault


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What a first flight gave.

    Attributes:
        faults: what is wrong, one sentence each; empty if the aircraft loads and starts without a warning.
        values: the properties asked for, in JSBSim's units, after the start; those that do not exist are missing.
    """

    faults: tuple[str, ...]
    values: Mapping[str, float]


_passed: Final[OrderedDict[str, Trial]] = OrderedDict()
"""What was asked, the contents of all files among it -> what came of it."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What a child is asked; in JSBSim's units.

    Attributes:
        path: the model's XML file.
        initial: property -> value written before the start.
        read: properties to read after it.
        density_slug_ft3: density to hold; 0 leaves the atmosphere alone.
    """

    path: str
    initial: Mapping[str, float]
    read: Sequence[str]
    density_slug_ft3: float


def fly_trial(
    path: Path,
    *,
    initial: Mapping[str, float],
    read: Sequence[str] = (),
    density_slug_ft3: float = 0.0,
    timeout_s: float = TIMEOUT_S,
) -> Trial:
    """Load a model and start it in a child process; the same files are tried once, wherever they lie.

    Args:
        path: the model's XML file.
        initial: property -> value written before the start, in JSBSim's units.
        read: properties to read after it.
        density_slug_ft3: density to hold; 0 leaves the atmosphere alone.
        timeout_s: a child that takes longer is ended, which is a fault.
    """
    request = Request(path=str(path), initial=dict(initial), read=tuple(read), density_slug_ft3=float(density_slug_ft3))
    key = _fingerprint(request)
    if key not in _passed:
        trial = run_child(
            [sys.executable, "-m", "finback.flight.trial"], json.dumps(asdict(request)), timeout_s=timeout_s
        )
        if trial.faults:
            return trial
        _passed[key] = trial
        if len(_passed) > _REMEMBERED:
            _passed.popitem(last=False)
    return _passed[key]


def _fingerprint(request: Request) -> str:
    """Return the SHA-256 of a request and of every file that JSBSim may read for it."""
    path = Path(request.path)
    asked = [path.name, request.density_slug_ft3, list(request.read), sorted(request.initial.items())]
    digest = hashlib.sha256(json.dumps(asked).encode())
    for name, content in _files(path):
        digest.update(f"\n{name}\n{len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def _files(path: Path) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of the XML files in the places where JSBSim looks for what a model includes."""
    shared = path.parent.parent.parent
    for folder in (path.parent, shared / "engine", shared / "systems"):
        if not folder.is_dir():
            continue
        links = [entry for entry in folder.iterdir() if entry.is_symlink() and entry.is_dir()]  # of a derived copy
        for file in sorted(file for top in (folder, *links) for file in top.rglob("*.xml")):
            if file.is_file():  # a link may lead nowhere
                yield file.relative_to(folder.parent).as_posix(), file.read_bytes()


def run_child(command: Sequence[str], request: str, *, timeout_s: float) -> Trial:
    """Run a child that answers with a trial; its death or silence is a fault, never an exception."""
    with tempfile.TemporaryDirectory(prefix="finback-trial-") as folder:  # JSBSim writes its output files to the cwd
        try:
            done = subprocess.run(  # noqa: S603 - our own interpreter and module
                command, input=request, capture_output=True, text=True, timeout=timeout_s, cwd=folder, check=False
            )
        except subprocess.TimeoutExpired:
            return Trial(faults=(f"JSBSim did not finish loading it within {timeout_s:g} s",), values={})
    faults: list[str] = []
    values: dict[str, float] = {}
    lines = done.stdout.strip().splitlines()
    try:
        answer = json.loads(lines[-1])
        faults, values = list(answer["faults"]), dict(answer["values"])
    except (IndexError, KeyError, TypeError, ValueError):
        faults = [] if done.returncode else ["the trial gave no answer"]
    if done.returncode < 0:
        faults.append(f"JSBSim ended its process by {signal.Signals(-done.returncode).name}")
    elif done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        faults.append(f"the trial ended with exit code {done.returncode}: {last}")
    return Trial(faults=tuple(faults), values=values)


def _answer(request: Request) -> dict[str, object]:
    from finback.flight.simulator import Simulator  # noqa: PLC0415 - the parent needs no JSBSim to ask

    try:
        simulator = Simulator(Path(request.path), step_s=_STEP_S, freeze_position=True, debug_level=1)
        simulator.write(request.initial)
        if request.density_slug_ft3:
            simulator.override_density(request.density_slug_ft3)
        simulator.start(passes=1)
        values = simulator.read(name for name in request.read if simulator.has(name))
    except AircraftError as error:
        return {"faults": [error.message.removeprefix(f"{request.path}: ")], "values": {}}
    return {"faults": list(simulator.faults), "values": values}


def leave_no_core() -> None:
    """See to it that this process, should it be aborted, leaves no core file."""
    if sys.platform != "win32":
        import resource  # noqa: PLC0415 - not on every system

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


if __name__ == "__main__":
    leave_no_core()
    os.environ.pop("JSBSIM_DEBUG", None)  # it would silence warnings
    print(json.dumps(_answer(Request(**json.load(sys.stdin)))), flush=True)  # noqa: T201 - this is a program
