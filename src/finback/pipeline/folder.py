"""Runs on disk: the newest one, its recordings, and the study that it was flown by."""

from __future__ import annotations

from pathlib import Path

from finback.dynamics.analysis import AnalysisOptions
from finback.errors import InputError, MissingResultError, RefusedError
from finback.flight.aircraft import Aircraft
from finback.identification.options import IdentificationOptions
from finback.pipeline.recorded import analysis_of_records, identification_of_records, is_recorded
from finback.records import Sweep
from finback.store.envelope import STUDY_FILE, SWEEP, command
from finback.store.run import LOGS, RECORDINGS
from finback.study import Study, StudyPart, read_study, read_study_part


def newest_run(output: Path) -> Path:
    """Return the run below ``output`` that began last, of those whose sweep is finished.

    Raises:
        MissingResultError: there is none.
    """
    runs = [sweep_file.parent for sweep_file in (output / LOGS).glob(f"*/*/{SWEEP.file}")]
    if not runs:
        raise MissingResultError(f"there is no run below {output / LOGS}", hint="make one with: finback run STUDY")
    return max(runs, key=lambda folder: _age(folder.name))


def recording(run: Path, flight: str) -> Path:
    """Return the recording of a flight of the run.

    Raises:
        InputError: there is none; the message lists those that are there.
    """
    folder = run / RECORDINGS
    path = folder / f"{flight}.rrd"
    if not path.is_file():
        there = sorted(file.stem for file in folder.glob("*.rrd"))
        raise InputError(
            f"{run} has no recording of a flight '{flight}'",
            hint=f"recorded flights: {', '.join(there)}" if there else "make a run with: finback run STUDY",
        )
    return path


def refuse_recorded(run: Path, flown: Sweep) -> None:
    """Raise RefusedError where there is no simulator to compare with."""
    if is_recorded(flown):
        raise RefusedError(
            f"the flights of {run} were recorded: there is no simulator to fly the model against",
            hint=f"look at what the model predicts: finback analyze {run}",
        )


def study_of(run: Path, flown: Sweep) -> Study:
    """Return the run's own study, with the very aircraft that was flown.

    Raises:
        StudyError: a section is missing, or has a fault.
        MissingResultError: the aircraft has changed or is gone.
        RefusedError: the flights were recorded: there is no simulator that could fly them.
    """
    refuse_recorded(run, flown)
    study = read_study(run / STUDY_FILE, aircraft=_flown_aircraft(run, flown))
    _check_same(run, flown, study.aircraft)
    return study


def identification_of(run: Path, flown: Sweep) -> IdentificationOptions:
    """Return what the run's study asks ``identify``; it may be silent about later stages. Raises as ``study_of``."""
    if is_recorded(flown):
        return identification_of_records(run, flown)
    (options,) = _part_of(run, flown, "identification").identification
    return options


def analysis_of(run: Path, flown: Sweep) -> AnalysisOptions:
    """Return what the run's study asks ``analyze``; it may be silent about other stages. Raises as ``study_of``."""
    if is_recorded(flown):
        return analysis_of_records(run, flown)
    (options,) = _part_of(run, flown, "analysis").analysis
    return options


def _part_of(run: Path, flown: Sweep, section: str) -> StudyPart:
    """Return what the run's study asks of a model, with the one section that must be there."""
    part = read_study_part(run / STUDY_FILE, section, aircraft=_flown_aircraft(run, flown))
    _check_same(run, flown, part.aircraft)
    return part


def _flown_aircraft(run: Path, flown: Sweep) -> str:
    """Return the path of the aircraft that was flown, empty if nobody knows."""
    aircraft = flown.provenance.get("aircraft_path", "")
    if aircraft and not Path(aircraft).is_file():
        raise MissingResultError(
            f"the aircraft that was flown is gone: {aircraft}",
            hint=f"put it back, or fly again with: {command(run, SWEEP)}",
        )
    return aircraft


def _check_same(run: Path, flown: Sweep, aircraft: Aircraft) -> None:
    if aircraft.sha256 != flown.provenance.get("aircraft_sha256", aircraft.sha256):
        raise MissingResultError(
            f"the sweep in {run} is stale: the aircraft {aircraft.path} has changed since it was flown",
            hint=f"fly again with: {command(run, SWEEP)}",
        )


def _age(name: str) -> tuple[str, int]:
    """Sort key of a run's name: time, then the number of the run within that second."""
    stamp, _, number = name.partition("-")
    return stamp, int(number) if number.isdecimal() else 0
