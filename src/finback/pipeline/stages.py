"""The stages of a run, one function each; every one reads files of the run's folder and leaves its own there.

``sweep`` begins a run: a folder ``logs/<study>/<UTC time>`` below ``output``, with a copy of the study file.
``identify``, ``analyze``, ``validate`` and ``report`` work in it. ``run`` does all in order. A stage that ends early,
by an error or by Ctrl-C, leaves nothing half-written, and no folder of a run without a sweep.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final

from finback.campaign import Processes, begin_campaign, fly as fly_campaign
from finback.dynamics.any_form import AnyAnalysis, analyze_any
from finback.errors import FinbackError
from finback.flight.accuracy import sentences
from finback.flight.sweep import fly_sweep, plan_flights
from finback.flight.vehicle import make_vehicle
from finback.identification.followed_numbers import analysis_numbers
from finback.identification.identify import Identification, identify as identify_sweep
from finback.identification.method import Method
from finback.identification.propagation import PropagatedNumber, propagate
from finback.identification.selection.options import SelectionOptions
from finback.pipeline.accuracy import accuracy_of
from finback.pipeline.folder import analysis_of, identification_of, refuse_recorded, study_of
from finback.pipeline.progress import SILENCE, Progress
from finback.pipeline.recorded import is_recorded, with_instruments_of_records
from finback.records import FlightRecord, Sweep
from finback.store import (
    load_accuracy,
    load_analysis,
    load_identification,
    load_sweep,
    load_validation,
    save_analysis,
    save_identification,
    save_sweep,
    save_validation,
)
from finback.store.campaign import DISCRETIZATION
from finback.store.run import RECORDINGS, discard, new_run
from finback.study import is_campaign_study, read_study
from finback.validation.validate import Validation, validate as validate_model

REPORT: Final = "report.html"
NOT_FLOWN: Final = "not_flown"
"""Key in a sweep's provenance: which maneuvers of the study could not be flown, and why; absent if all could."""


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
    analysis: AnyAnalysis
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
            accuracy = (accuracy_of(study, rig, planned.plans, records, progress),)
            provenance = {
                **rig.provenance,
                DISCRETIZATION: sentences(accuracy),
                "study_path": str(study_file.resolve()),
                "aircraft_path": str(study.aircraft.path.resolve()),
                "aircraft_sha256": study.aircraft.sha256,
                **({NOT_FLOWN: "; ".join(planned.notes)} if planned.notes else {}),
            }
        flown = Sweep(study=study.name, records=tuple(records), provenance=provenance)
        save_sweep(flown, run, accuracy=accuracy)
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
    asked = identification_of(run, flown)
    progress.begin("identify", 0)
    asked = replace(asked, method=methods[0]) if methods else asked
    identification = identify_sweep(flown, replace(asked, form=(), selection=selection) if selection else asked)
    if is_recorded(flown):
        identification = with_instruments_of_records(identification, flown)
    save_identification(identification, run)
    return identification


def analyze(run: Path, *, progress: Progress = SILENCE) -> AnyAnalysis:
    """Analyze the run's model, as the run's study asks: as a planar field where the Liénard form cannot hold a term.

    Raises:
        MissingResultError: the model is missing or stale.
        RefusedError: the equilibria are not isolated.
    """
    identification = load_identification(run)
    asked = analysis_of(run, load_sweep(run))
    progress.begin("analyze", 0)
    analysis = analyze_any(identification.model, asked)
    save_analysis(analysis, run)
    return analysis


def validate(run: Path, *, progress: Progress = SILENCE) -> Validation:
    """Fly the full simulator against the run's model and analysis, as the run's study asks.

    Raises:
        MissingResultError: the sweep, the model or the analysis is missing or stale.
        AircraftError: the aircraft does not load without a warning.
        RefusedError: the flights were recorded: there is no simulator to fly the model against.
    """
    flown = load_sweep(run)
    refuse_recorded(run, flown)  # what is stale would be renewed in vain
    analysis, identification = load_analysis(run), load_identification(run)
    study = study_of(run, flown)
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
        RefusedError: the flights were recorded: there is no simulator to report a comparison with.
    """
    flown = load_sweep(run)
    refuse_recorded(run, flown)
    validation, analysis = load_validation(run), load_analysis(run)
    identification = load_identification(run)
    progress.begin("report", 0)
    from finback.views.report import write_report  # noqa: PLC0415 - half a second that only this stage needs

    path = run / REPORT
    write_report(
        path,
        study_name=flown.study,
        sweep=flown,
        accuracy=load_accuracy(run),
        identification=identification,
        analysis=analysis,
        validation=validation,
        derived=derived_numbers(identification),
        provenance={"run": run.name, **flown.provenance},
    )
    return path


def derived_numbers(identification: Identification) -> tuple[PropagatedNumber, ...]:
    """Return every number of the analysis with its uncertainty by two roads; none if the model allows no analysis."""
    try:
        return propagate(identification.model, analysis_numbers(identification.model))
    except FinbackError:
        return ()


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


def _record(run: Path, study: str, record: FlightRecord) -> None:
    from finback.views.recording import RecordingContext, write_recording  # noqa: PLC0415 - half a second, not for all

    (run / RECORDINGS).mkdir(exist_ok=True)
    write_recording(
        run / RECORDINGS / f"{record.name}.rrd", record, context=RecordingContext(study=study, run=run.name)
    )
