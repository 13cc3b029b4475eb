"""A JSBSim aircraft: where it is, what it is exactly, and whether it loads."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import final


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
    """Find an aircraft by its name, or by the path of its folder or file."""
    raise NotImplementedError


def try_aircraft(aircraft: Aircraft) -> tuple[str, ...]:
    """Load an aircraft in a child process and return every fault found; empty if it is fine."""
    raise NotImplementedError
