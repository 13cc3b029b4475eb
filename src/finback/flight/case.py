"""One flight of an aircraft as it is, or of a script of JSBSim: nothing derived, nothing replaced.

This is how a check case of another simulator is flown (``fly_case``). A script keeps the initial condition, the step
and the events that it has, but not JSBSim's first-order integrators.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import final

from finback.arrays import FloatArray, frozen_array
from finback.errors import AircraftError
from finback.flight.case_column import CaseColumn
from finback.flight.case_drive import Drive
from finback.flight.case_start import AS_IT_IS, CaseStart
from finback.flight.case_wind import WindProfile
from finback.records import Outcome


class Attitude(StrEnum):
    """How the attitude is integrated."""

    BUSS2 = "buss2"
    """second order on the rotation group; keeps a tumbling body's quaternion a rotation (Buss 2000)"""
    AB4 = "ab4"


class CaseEngine(StrEnum):
    """How the engines begin."""

    AS_LOADED = "as-loaded"
    """as the files, the script or the settings have them; off, if they say nothing"""
    RUNNING = "running"
    """all of them running steadily at their commands"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What is flown, and how.

    Attributes:
        source: XML of an aircraft, or of a script.
        settings: property -> value in JSBSim's unit, written before the start, in this order, after its condition.
        initial_file: JSBSim's initialization file; empty for the script's own or none.
        planet_file: JSBSim's planet file; empty for the Earth of WGS 84.
        start: the initial condition, beyond what files and settings say.
        drives: properties that are written over time.
        wind: profiles of a steady wind, one at most.
        duration_s: > 0, taken to the nearest whole number of steps; 0 flies a script to its own end.
        step_s: > 0; 0 takes a script's own.
        sample_interval_s: a whole number of steps; 0 for every step.
        attitude: how it is integrated.
        columns: what is recorded besides ``CASE_COLUMNS``.
        engines: how they begin.
    """

    source: Path
    settings: tuple[tuple[str, float], ...] = ()
    initial_file: str = ""
    planet_file: str = ""
    start: CaseStart = AS_IT_IS
    drives: tuple[Drive, ...] = ()
    wind: tuple[WindProfile, ...] = ()
    duration_s: float = 0.0
    step_s: float = 0.0
    sample_interval_s: float = 0.0
    attitude: Attitude = Attitude.BUSS2
    columns: tuple[CaseColumn, ...] = ()
    engines: CaseEngine = CaseEngine.AS_LOADED


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlownCase:
    """What a case gave.

    Attributes:
        name: of the file that was flown.
        columns: name with SI unit -> values, shape (n,), ``time_s`` first.
        outcome: completed, or diverged where a number was no longer finite (rows end before it).
        note: the outcome in a sentence.
        warnings: what JSBSim said on loading and flying, and what was left out.
        provenance: text facts.
        step_error: column -> estimated error of the step in SI; empty where nobody has flown it at half the step.
    """

    name: str
    columns: Mapping[str, FloatArray]
    outcome: Outcome
    note: str
    warnings: tuple[str, ...]
    provenance: Mapping[str, str]
    step_error: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Freeze the columns."""
        object.__setattr__(
            self, "columns", MappingProxyType({name: frozen_array(values) for name, values in self.columns.items()})
        )
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))
        object.__setattr__(self, "step_error", MappingProxyType(dict(self.step_error)))


def is_script(path: Path) -> bool:
    """Return whether an XML file is a script of JSBSim.

    Raises:
        AircraftError: it cannot be read as XML.
    """
    try:
        return ET.parse(path).getroot().tag == "runscript"  # noqa: S314 - JSBSim itself will read the file
    except (OSError, ET.ParseError) as error:
        raise AircraftError(f"{path}: cannot be read as XML: {error}") from None
