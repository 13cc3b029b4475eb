"""Every fault of a study before anything is flown."""

from __future__ import annotations

from pathlib import Path

from finback.errors import FinbackError
from finback.flight.aircraft import Aircraft, try_aircraft
from finback.flight.campaign.plan import Campaign
from finback.flight.mounting import try_mounting
from finback.store import read_model_file
from finback.study import Study, inspect_campaign, inspect_study, is_campaign_study


def check(study_file: Path, *, model: Path | None = None) -> tuple[str, ...]:
    """Read a study, try its aircraft and its copies in child processes, read a model if named; fly nothing.

    Args:
        study_file: the study.
        model: whatever ``finback analyze`` takes: a run, a ``model.json``, or a TOML file.

    Returns:
        Every fault found; empty if all is well.
    """
    study, aircraft, faults = _inspect(study_file)
    found = [f"{study_file}: {fault}" for fault in faults]
    broken = [] if aircraft is None else [f"{aircraft.path}: {fault}" for fault in try_aircraft(aircraft)]
    found += broken
    if study is not None and not broken:
        fidelities = study.fidelities if isinstance(study, Campaign) else (study.flight.fidelity,)
        for fidelity in fidelities:
            found += try_mounting(study.aircraft, study.condition, fidelity)
    if model is not None:
        try:
            read_model_file(model)
        except FinbackError as error:
            found.append(str(error))
    return tuple(found)


def _inspect(study_file: Path) -> tuple[Study | Campaign | None, Aircraft | None, tuple[str, ...]]:
    if not is_campaign_study(study_file):
        return inspect_study(study_file)
    study, aircraft, faults = inspect_campaign(study_file)
    return (study.campaign if study else None), aircraft, faults
