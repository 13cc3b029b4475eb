"""The stages of a run, one function each; every one reads files of the run's folder and leaves its own there.

``sweep`` begins a run: a folder ``logs/<study>/<UTC time>`` below ``output``, with a copy of the study file.
``identify``, ``analyze``, ``validate`` and ``report`` work in it. ``run`` does all in order. A stage that ends early,
by an error or by Ctrl-C, leaves nothing half-written, and no folder of a run without a sweep.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Protocol, final

from finback.campaign import Processes, begin_campaign, fly as fly_campaign
from finback.dynamics.analysis import Analysis, analyze as analyze_system, analyze_model
from finback.dynamics.analysis_range import Range, options_for, planar_options_for
from finback.dynamics.planar.analysis import PlanarAnalysis, analyze_planar
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.reduction import reduce
from finback.errors import FinbackError, InputError, MissingResultError
from finback.flight.aircraft import Aircraft, try_aircraft
from finback.flight.campaign.plan import Campaign
from finback.flight.case import Case, FlownCase, fly_case
from finback.flight.case_record import case_record
from finback.flight.mounting import try_mounting
from finback.flight.sweep import fly_sweep, plan_flights
from finback.flight.vehicle import make_vehicle
from finback.formats.text_table import read_text_table
from finback.identification.identify import Identification, identify as identify_sweep
from finback.identification.method import Method
from finback.identification.selection.options import SelectionOptions
from finback.records import FlightRecord, Sweep
from finback.store import (
    ModelFile,
    load_analysis,
    load_identification,
    load_sweep,
    load_validation,
    read_model_file,
    save_analysis,
    save_identification,
    save_sweep,
    save_validation,
)
from finback.store.case_file import save_case
from finback.store.envelope import STUDY_FILE, SWEEP, command
from finback.store.run import LOGS, RECORDINGS as STORED_RECORDINGS, discard, new_run
from finback.store.trajectory_file import read_trajectory
from finback.study import Study, inspect_campaign, inspect_study, is_campaign_study, read_study
from finback.study.channel_map import read_channel_map
from finback.units import to_si
from finback.validation.compare import Trajectory, TrajectoryComparison, compare as compare_trajectories
from finback.validation.validate import Validation, validate as validate_model

RECORDINGS: Final = STORED_RECORDINGS
REPORT: Final = "report.html"
NOT_FLOWN: Final = "not_flown"
"""Key in a sweep's provenance: which maneuvers of the study could not be flown, and why; absent if all could."""


class Progress(Protocol):
    """Whoever wants to know how far a stage is."""

    def begin(self, stage: str, steps: int) -> None:
        """A stage begins; ``steps`` calls of ``step`` are expected, 0 if nobody knows."""

    def step(self, what: str) -> None:
        """One thing is done or, where their number is unknown, begun: a flight's name or a short sentence."""


@final
class Silence:
    """Progress that nobody watches."""

    def begin(self, stage: str, steps: int) -> None:
        """Say nothing."""

    def step(self, what: str) -> None:
        """Say nothing."""


SILENCE: Final = Silence()


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A run from sweep to report.

    Attributes:
        folder: where its files stand.
        sweep: the flights.
        identification: the model.
        analysis: what it predicts.
        validation: what the simulator says about that.
        report: the page to look at.
    """

    folder: Path
    sweep: Sweep
    identification: Identification
    analysis: Analysis
    validation: Validation
    report: Path


def sweep(study_file: Path, *, output: Path, progress: Progress = SILENCE) -> tuple[Path, Sweep]:
    """Fly the study's sweep into a new run below ``output``.

    Returns:
        The folder of the run, and the flights with sensor noise.

    Raises:
        StudyError: the study file has faults.
        AircraftError: the aircraft does not load without a warning.
        RefusedError: no maneuver of the sweep, or none of the hold-outs, starts from a trim that exists.
        OSError: ``output`` cannot be written to.
    """
    study = read_study(study_file)
    run = new_run(study.name, study.text, output)
    try:
        with make_vehicle(study.aircraft, study.condition, study.flight) as rig:
            planned = plan_flights(study.maneuvers, rig.derivatives, study.flight)
            # If nothing could be held out, say so before anything is flown.
            plan_flights(study.validation.holdout, rig.derivatives, study.flight)
            progress.begin("sweep", len(planned.plans))
            records = []
            for record in fly_sweep(rig, planned.plans, sensors=study.sensors, seed=study.seed):
                _record(run, study.name, record)
                records.append(record)
                progress.step(record.name)
            provenance = {
                **rig.provenance,
                "study_path": str(study_file.resolve()),
                "aircraft_path": str(study.aircraft.path.resolve()),
                "aircraft_sha256": study.aircraft.sha256,
                **({NOT_FLOWN: "; ".join(planned.notes)} if planned.notes else {}),
            }
        flown = Sweep(study=study.name, records=tuple(records), provenance=provenance)
        save_sweep(flown, run)
    except BaseException:
        discard(run)
        raise
    return run, flown


def identify(
    run: Path,
    *,
    methods: tuple[Method, ...] = (),
    selection: tuple[SelectionOptions, ...] = (),
    progress: Progress = SILENCE,
) -> Identification:
    """Identify a model from the run's sweep, as the run's study asks.

    Args:
        run: the folder.
        methods: one estimator, whatever the study says; or empty.
        selection: a library from which the terms are selected, whatever the study says of them; or empty.
        progress: who wants to know.

    Raises:
        MissingResultError: the sweep is missing or stale.
        RefusedError: the data do not support the model asked for.
    """
    flown = load_sweep(run)
    study = _study_of(run, flown)
    progress.begin("identify", 0)
    asked = replace(study.identification, method=methods[0]) if methods else study.identification
    identification = identify_sweep(flown, replace(asked, form=(), selection=selection) if selection else asked)
    save_identification(identification, run)
    return identification


def analyze(run: Path, *, progress: Progress = SILENCE) -> Analysis:
    """Analyze the run's model, as the run's study asks.

    Raises:
        MissingResultError: the model is missing or stale.
        RefusedError: the model has terms that the reduced form cannot hold.
    """
    identification = load_identification(run)
    study = _study_of(run, load_sweep(run))
    progress.begin("analyze", 0)
    analysis = analyze_model(identification.model, study.analysis)
    save_analysis(analysis, run)
    return analysis


def analyze_otherwise(
    run: Path, *, ranges: Mapping[str, Range], steps: Mapping[str, float], progress: Progress = SILENCE
) -> Analysis:
    """Analyze the run's model in other ranges than its study asks; nothing is stored.

    Args:
        run: the folder.
        ranges: ``elevator_rad`` and ``alpha_rad`` -> (low, high), as far as they are not the study's.
        steps: ``elevator_rad`` -> step of the list of equilibria, likewise.
        progress: who wants to know.

    Raises:
        MissingResultError: the model is missing or stale.
        InputError: a range is empty.
        RefusedError: the model has terms that the reduced form cannot hold.
    """
    asked = _study_of(run, load_sweep(run)).analysis
    known = {"elevator_rad": asked.elevator_range_rad, "alpha_rad": asked.alpha_range_rad}
    model = load_identification(run).model
    progress.begin("analyze", 0)
    system = reduce(model)
    options = options_for(system, {**known, **ranges}, {"elevator_rad": asked.elevator_step_rad, **steps})
    return analyze_system(system, options)


def analyze_file(
    file: ModelFile, *, ranges: Mapping[str, Range], steps: Mapping[str, float], progress: Progress = SILENCE
) -> Analysis | PlanarAnalysis:
    """Analyze a model that belongs to no run: where it is asked, else where its file says, else where its data lie.

    Args:
        file: the model.
        ranges: variable, by its name in SI -> (low, high), as far as given.
        steps: parameter, by its name in SI -> step of the list of equilibria, if given.
        progress: who wants to know.

    Returns:
        The analysis of the Liénard system where one holds every term, of the planar field elsewhere.

    Raises:
        InputError: nothing says where to look, or a range is empty.
        RefusedError: the equilibria are not isolated.
    """
    system, asked = file.system(), {**file.ranges, **ranges}
    progress.begin("analyze", 0)
    if isinstance(system, PlanarSystem):
        return analyze_planar(system, planar_options_for(system, asked, steps))
    return analyze_system(system, options_for(system, asked, steps))


def validate(run: Path, *, progress: Progress = SILENCE) -> Validation:
    """Fly the full simulator against the run's model and analysis, as the run's study asks.

    Raises:
        MissingResultError: the sweep, the model or the analysis is missing or stale.
        AircraftError: the aircraft does not load without a warning.
    """
    analysis, identification, flown = load_analysis(run), load_identification(run), load_sweep(run)
    study = _study_of(run, flown)
    progress.begin("validate", 0)
    with make_vehicle(study.aircraft, study.condition, study.flight) as rig:
        validation = validate_model(flown, identification, analysis, rig, study.validation, study.flight, progress.step)
    for holdout in validation.holdouts:
        _record(run, study.name, holdout.record)
    save_validation(validation, run)
    return validation


def report(run: Path, *, progress: Progress = SILENCE) -> Path:
    """Write the run's report and its figures; return the report's path.

    Raises:
        MissingResultError: a result of the run is missing or stale.
    """
    validation, analysis = load_validation(run), load_analysis(run)
    identification, flown = load_identification(run), load_sweep(run)
    progress.begin("report", 0)
    from finback.views.report import write_report  # noqa: PLC0415 - half a second that only this stage needs

    path = run / REPORT
    write_report(
        path,
        study_name=flown.study,
        sweep=flown,
        identification=identification,
        analysis=analysis,
        validation=validation,
        provenance={"run": run.name, **flown.provenance},
    )
    return path


def run(study_file: Path, *, output: Path, progress: Progress = SILENCE) -> Run:
    """Do all stages in order.

    Raises:
        FinbackError: as the stages do; the results of the stages before stay.
    """
    if is_campaign_study(study_file):
        read_study(study_file)  # that later stages find what they need, before anything is flown
        campaign = begin_campaign(study_file, output=output)
        fly_campaign(campaign, Processes(), progress)
        folder, flown = campaign.run, load_sweep(campaign.run)
    else:
        folder, flown = sweep(study_file, output=output, progress=progress)
    identification = identify(folder, progress=progress)
    analysis = analyze(folder, progress=progress)
    validation = validate(folder, progress=progress)
    return Run(
        folder=folder,
        sweep=flown,
        identification=identification,
        analysis=analysis,
        validation=validation,
        report=report(folder, progress=progress),
    )


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


def compare(source: Path, reference: Path, channel_map: Path, *, flight: str = "") -> TrajectoryComparison:
    """Compare a flight with a trajectory of another simulator or of an aircraft (docs/compare.md).

    Args:
        source: a run, or a file with one flight.
        reference: text file of columns.
        channel_map: which column is which channel, in which unit, within what tolerance.
        flight: which flight of the run; empty for the one that the map names.

    Raises:
        InputError: a file, a flight, a channel or a column is missing or damaged; every fault of the map is named.
        RefusedError: the two have no time in common.
    """
    wanted = read_channel_map(channel_map)
    table = read_text_table(reference, separator=wanted.separator, skip_lines=wanted.skip_lines)
    theirs = Trajectory(
        name=reference.name,
        time_s=to_si(table.numbers(wanted.time), wanted.time_unit) + wanted.time_offset_s,
        columns={
            channel.reference: table.numbers(channel.reference)
            for channel in wanted.channels
            if channel.reference in table.cells
        },
    )
    return compare_trajectories(read_trajectory(source, flight=flight or wanted.flight), theirs, wanted.channels)


def fly(case: Case, paths: Sequence[Path]) -> FlownCase:
    """Fly one case and write it to files: ``.parquet``, ``.csv`` or ``.rrd``.

    Raises:
        AircraftError: JSBSim does not load or start it.
        InputError: the case does not fit together, or a file's name ends in none of these.
    """
    for path in paths:
        if path.suffix not in {".parquet", ".csv", ".rrd"}:
            raise InputError(f"{path} ends in none of .parquet, .csv and .rrd")
    flown = fly_case(case)
    for path in paths:
        if path.suffix == ".rrd":
            from finback.views.recording import RecordingContext, write_recording  # noqa: PLC0415 - as above

            write_recording(path, case_record(flown), context=RecordingContext(study="fly", run=flown.name))
        else:
            save_case(flown, path)
    return flown


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


def _age(name: str) -> tuple[str, int]:
    """Sort key of a run's name: time, then the number of the run within that second."""
    stamp, _, number = name.partition("-")
    return stamp, int(number) if number.isdecimal() else 0


def _study_of(run: Path, flown: Sweep) -> Study:
    """Return the run's own study, with the very aircraft that was flown."""
    aircraft = flown.provenance.get("aircraft_path", "")
    if aircraft and not Path(aircraft).is_file():
        raise MissingResultError(
            f"the aircraft that was flown is gone: {aircraft}",
            hint=f"put it back, or fly again with: {command(run, SWEEP)}",
        )
    study = read_study(run / STUDY_FILE, aircraft=aircraft)
    if study.aircraft.sha256 != flown.provenance.get("aircraft_sha256", study.aircraft.sha256):
        raise MissingResultError(
            f"the sweep in {run} is stale: the aircraft {study.aircraft.path} has changed since it was flown",
            hint=f"fly again with: {command(run, SWEEP)}",
        )
    return study


def _record(run: Path, study: str, record: FlightRecord) -> None:
    from finback.views.recording import RecordingContext, write_recording  # noqa: PLC0415 - half a second, not for all

    (run / RECORDINGS).mkdir(exist_ok=True)
    write_recording(
        run / RECORDINGS / f"{record.name}.rrd", record, context=RecordingContext(study=study, run=run.name)
    )
