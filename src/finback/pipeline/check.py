"""Every fault of a study before anything is flown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import final

from finback.errors import FinbackError, RefusedError
from finback.flight.aircraft import Aircraft, try_aircraft
from finback.flight.campaign.plan import Campaign
from finback.flight.mounting import try_mounting
from finback.flight.sweep import plan_flights
from finback.flight.vehicle import make_vehicle
from finback.pipeline.progress import SILENCE, Progress
from finback.store import read_model_file
from finback.study import Study, inspect_campaign, inspect_study, is_campaign_study


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """What a check found.

    Attributes:
        faults: what keeps the study from being flown; empty if nothing does.
        warnings: maneuvers that would be left out, because the aircraft has no trim at their elevator.
    """

    faults: tuple[str, ...]
    warnings: tuple[str, ...]


def check(study_file: Path, *, model: Path | None = None, progress: Progress = SILENCE) -> Checked:
    """Read a study, try its aircraft and its copies in child processes, look for its trims, read a model if named.

    Nothing is flown; the trims are equilibria of the aircraft's own equations. Those of a campaign are not looked for:
    each of its flights says by itself if it has none.

    Args:
        study_file: the study.
        model: whatever ``finback analyze`` takes: a run, a ``model.json``, or a TOML file.
        progress: who wants to know.
    """
    progress.begin("check", 0)
    study, aircraft, faults = _inspect(study_file)
    found = [f"{study_file}: {fault}" for fault in faults]
    broken = [] if aircraft is None else [f"{aircraft.path}: {fault}" for fault in try_aircraft(aircraft)]
    found += broken
    if study is not None and not broken:
        fidelities = study.fidelities if isinstance(study, Campaign) else (study.flight.fidelity,)
        for fidelity in fidelities:
            found += try_mounting(study.aircraft, study.condition, fidelity)
    warnings: tuple[str, ...] = ()
    if isinstance(study, Study) and not found:
        progress.step("trims")
        missing, warnings = _trims(study)
        found += [f"{study_file}: {fault}" for fault in missing]
    if model is not None:
        try:
            read_model_file(model)
        except FinbackError as error:
            found.append(str(error))
    return Checked(faults=tuple(found), warnings=warnings)


def _trims(study: Study) -> tuple[list[str], tuple[str, ...]]:
    """Return which lists of maneuvers could not be flown at all, and which single maneuvers would be left out."""
    faults: list[str] = []
    warnings: list[str] = []
    try:
        with make_vehicle(study.aircraft, study.condition, study.flight) as vehicle:
            for place, maneuvers in (("sweep", study.maneuvers), ("validation.holdout", study.validation.holdout)):
                try:
                    notes = plan_flights(maneuvers, vehicle.derivatives, study.flight).notes
                    warnings += [f"{place}: {note}" for note in notes]
                except RefusedError as refusal:
                    faults.append(f"{place}: {refusal.message}")
    except FinbackError as error:
        faults.append(f"aircraft: {error.message}")
    return faults, tuple(warnings)


def _inspect(study_file: Path) -> tuple[Study | Campaign | None, Aircraft | None, tuple[str, ...]]:
    if not is_campaign_study(study_file):
        return inspect_study(study_file)
    study, aircraft, faults = inspect_campaign(study_file)
    return (study.campaign if study else None), aircraft, faults
