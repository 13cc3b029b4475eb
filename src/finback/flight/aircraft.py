"""A JSBSim aircraft: where it is, what it is exactly, and whether it loads."""

from __future__ import annotations

import hashlib
import importlib.util
import os
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Final, final

from finback.errors import AircraftError
from finback.flight.trial import fly_trial

_MOST_MEANT: Final = 3
_SHOWN: Final = 100  # characters of a wrong name that a message repeats
_GENTLE_FLIGHT: Final = {"ic/h-sl-ft": 30000.0, "ic/u-fps": 600.0}  # any aircraft can be evaluated there


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Aircraft:
    """An aircraft's file and its fingerprint.

    Attributes:
        name: its JSBSim name.
        path: its XML file, ``<folder>/<name>/<name>.xml``.
        sha256: fingerprint of every XML file in the aircraft's folder (names and contents).
    """

    name: str
    path: Path
    sha256: str


def find_aircraft(name: str, *, near: Path) -> Aircraft:
    """Find an aircraft by its name, or by the path of its folder or file.

    Args:
        name: a path (absolute, or relative to ``near`` or the working directory), or a name, looked up in the folder
            ``aircraft`` of ``near`` and its ancestors, of the working directory, and among JSBSim's own.
        near: the study's file or folder.

    Raises:
        AircraftError: there is none, or its files cannot be read; the message says where was looked and the nearest
            name.
    """
    try:
        return _find(name, near=near.resolve())
    except OSError as error:  # a name too long for the system, a folder that may not be read
        shown = name if len(name) <= _SHOWN else f"{name[:_SHOWN]}…"
        raise AircraftError(
            f"aircraft '{shown}' cannot be read: {error.strerror}", hint="give its name, or the path of its XML file"
        ) from error


def _find(name: str, *, near: Path) -> Aircraft:
    if os.sep in name or name.endswith(".xml"):
        return _at_path(name, near=near)
    folders = _folders(near)
    for folder in folders:
        path = folder / name / f"{name}.xml"
        if path.is_file():
            return Aircraft(name=name, path=path, sha256=fingerprint(path.parent))
    known = sorted(
        {path.stem for folder in folders for path in folder.glob("*/*.xml") if path.stem == path.parent.name}
    )
    looked = [str(folder) for folder in folders]
    without = [str(start) for start in (near, Path.cwd()) if start.is_dir() and not (start / "aircraft").is_dir()]
    if without:
        looked.append(f"and no folder 'aircraft' is in {' or '.join(dict.fromkeys(without))}")
    close = _alike(name, known)
    # A word is a name, never a path: what stands in plain sight beside the study needs a separator.
    beside = [start for start in dict.fromkeys((near, near.parent, Path.cwd())) if (start / name).is_dir()]
    if beside:
        raise AircraftError(
            f"no aircraft '{name}' in {', '.join(looked)}", hint=f"for the folder {beside[0] / name} write './{name}'"
        )
    raise AircraftError(
        f"no aircraft '{name}' in {', '.join(looked)}",
        hint=f"did you mean {' or '.join(map(repr, close))}?" if close else "give the path of its XML file",
    )


def _alike(name: str, known: list[str]) -> list[str]:
    """Return the names that may have been meant: written otherwise, begun alike, or nearly the same."""
    plain = name.strip().casefold()
    same = [other for other in known if other.casefold() == plain]
    longer = [other for other in known if plain and plain in other.casefold()]
    near = get_close_matches(plain, {other.casefold(): other for other in known}, n=_MOST_MEANT, cutoff=0.6)
    meant = [other for close in near for other in known if other.casefold() == close]
    return same or list(dict.fromkeys([*longer, *meant]))[:_MOST_MEANT]


def fingerprint(folder: Path) -> str:
    """Return the sha256 of all XML files below a folder: relative names, lengths and contents, in sorted order."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.xml")):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(folder).as_posix()}\n{len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def try_aircraft(aircraft: Aircraft) -> tuple[str, ...]:
    """Load and start an aircraft in a child process and return every fault found; empty if it is fine.

    Each warning and error of JSBSim's log counts; a child that aborts, crashes or hangs is a fault like others.
    """
    return fly_trial(aircraft.path, initial=_GENTLE_FLIGHT).faults


def _at_path(name: str, *, near: Path) -> Aircraft:
    base = near if near.is_dir() else near.parent
    looked = []
    for start in (base, Path.cwd()):
        path = start / name
        if path.is_dir():
            folder, path = path, path / f"{path.name}.xml"
            inside = sorted(one.name for one in folder.glob("*.xml"))
            if not path.is_file() and inside:
                raise AircraftError(
                    f"{folder} holds no {path.name}, as a folder of JSBSim does, but {', '.join(inside)}",
                    hint=f"give the path of the file: {folder / inside[0]}",
                )
        if path.is_file():
            path = path.resolve()
            return Aircraft(name=path.stem, path=path, sha256=fingerprint(path.parent))
        looked.append(str(path))
    raise AircraftError(
        f"no aircraft file at {' or '.join(dict.fromkeys(looked))}",
        hint="give the path of its XML file, or the name alone of one that is found by its name",
    )


def _folders(near: Path) -> tuple[Path, ...]:
    found = [start / "aircraft" for start in (near, *near.parents, Path.cwd())]
    package = importlib.util.find_spec("jsbsim")  # without importing it: half a second
    if package is not None and package.submodule_search_locations:
        found.append(Path(next(iter(package.submodule_search_locations))) / "aircraft")
    return tuple(dict.fromkeys(folder for folder in found if folder.is_dir()))
