"""What a study file asks for, in SI."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

from finback.flight.aircraft import Aircraft
from finback.flight.excitation import Maneuver
from finback.flight.plan import FlightOptions
from finback.flight.sensors import Sensors
from finback.identification.options import IdentificationOptions
from finback.records import Condition
from finback.validation.options import ValidationOptions

if TYPE_CHECKING:
    from finback.dynamics.analysis import AnalysisOptions  # a second that a campaign does not need


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class StudyPart:
    """What a study asks of a model, whatever else it holds.

    Attributes:
        aircraft: what is flown.
        identification: what ``identify`` is asked; empty if the study has no such section.
        analysis: what ``analyze`` is asked; likewise.
    """

    aircraft: Aircraft
    identification: tuple[IdentificationOptions, ...]
    analysis: tuple[AnalysisOptions, ...]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """Everything that a run does, in SI.

    Attributes:
        name: folder-safe name of the study.
        path: the file it was read from.
        text: that file's content.
        seed: of all random numbers of the run, >= 0.
        aircraft: what is flown.
        condition: the reference flight.
        flight: fidelity, time steps and limits.
        sensors: noise of the measured channels.
        maneuvers: of the sweep, one a flight.
        identification: what ``identify`` is asked.
        analysis: what ``analyze`` is asked.
        validation: what ``validate`` is asked.
    """

    name: str
    path: Path
    text: str
    seed: int
    aircraft: Aircraft
    condition: Condition
    flight: FlightOptions
    sensors: Sensors
    maneuvers: tuple[Maneuver, ...]
    identification: IdentificationOptions
    analysis: AnalysisOptions
    validation: ValidationOptions
