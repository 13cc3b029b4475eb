"""Recorded flights in place of flown ones: tables read and prepared into a run that identify and analyze take."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final

from finback.errors import InputError, StudyError
from finback.files import sha256
from finback.formats.frame import increasing, record_from_frame
from finback.formats.text_table import TextFormat
from finback.identification.compatibility.fault import Kind
from finback.identification.instruments import FAULTS, InstrumentFaults, KnownFault
from finback.identification.preparation import Preparation, PreparationOptions, prepare_all
from finback.pipeline.progress import SILENCE, Progress
from finback.pipeline.recorded import INSTRUMENTS, contradictions
from finback.records import FlightRecord, Sweep
from finback.store import save_sweep
from finback.store.codec import to_tree
from finback.store.envelope import OPTIONS, ORIGIN, RECORDED
from finback.store.flight_table import missing_columns, read_flight_table
from finback.store.run import RECORDINGS, discard, new_run
from finback.study.recorded import RecordedStudy, read_columns, read_recorded_study
from finback.units import si_name

CHANGED: Final = "changed"
"""Key in a flight's provenance: what was changed in it, sentence by sentence."""
FOUND: Final = "found"
"""Key in a flight's provenance: what was seen and left as it is."""
_NEEDED: Final = ("alpha_rad", "q_rad_s")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """A run of recorded flights.

    Attributes:
        folder: where its files stand.
        sweep: the flights as estimators get them.
        preparations: one for each flight.
    """

    folder: Path
    sweep: Sweep
    preparations: tuple[Preparation, ...]


def prepare(
    tables: Sequence[Path], study_file: Path, *, output: Path, correct: bool = False, progress: Progress = SILENCE
) -> Prepared:
    """Read recorded flights, prepare them, and make them a run below ``output``.

    Args:
        tables: one flight each: text, or Parquet.
        study_file: how they are read and prepared (docs/data.md).
        output: results go to ``logs/<study>/<run>`` below it.
        correct: take out faults of instruments, whatever the study says.
        progress: who wants to know.

    Raises:
        StudyError: the study file has faults.
        InputError: a table cannot be read, or lacks what a flight needs.
        RefusedError: a flight is too short, or lacks what a correction needs.
    """
    study = _study(study_file, tables)
    asked = replace(study.preparation, correct_instruments=True) if correct else study.preparation
    if not tables:
        raise InputError("there is no table to prepare")
    read = _records(tables, study, progress)
    found = prepare_all([record for record, _ in read], asked)
    preparations = tuple(
        replace(
            item,
            statements=(*said, *item.statements),
            findings=(*_seen(item.record), *item.findings),
        )
        for item, (_, said) in zip(found, read, strict=True)
    )
    sweep = Sweep(
        study=study.name,
        records=tuple(_told(item, asked) for item in preparations),
        provenance={
            ORIGIN: RECORDED,
            OPTIONS: "--correct" if correct else "",
            "study_path": str(study_file.resolve()),
        },
    )
    folder = new_run(study.name, study.text, output)
    try:
        save_sweep(sweep, folder)
        for record in sweep.records:
            _log(folder, sweep.study, record)
    except BaseException:
        discard(folder)
        raise
    return Prepared(folder=folder, sweep=sweep, preparations=preparations)


def _log(run: Path, study: str, record: FlightRecord) -> None:
    """Write the flight's recording, as of flown ones."""
    from finback.views.recording import RecordingContext, write_recording  # noqa: PLC0415 - half a second, not for all

    (run / RECORDINGS).mkdir(exist_ok=True)
    write_recording(
        run / RECORDINGS / f"{record.name}.rrd", record, context=RecordingContext(study=study, run=run.name)
    )


def _study(study_file: Path, tables: Sequence[Path]) -> RecordedStudy:
    """Read the map; if it has faults, say with them which columns the tables lack."""
    try:
        return read_recorded_study(study_file)
    except StudyError as error:
        columns, layouts = read_columns(study_file)
        lacking = [
            f"{path}: {fault}" for layout in layouts for path in tables for fault in _lacking(path, layout, columns)
        ]
        raise StudyError(str(study_file), (*error.faults, *lacking)) from None


def _lacking(path: Path, layout: TextFormat, names: Mapping[str, str]) -> tuple[str, ...]:
    try:
        return missing_columns(path, layout, names)
    except InputError as error:
        return (error.message.removeprefix(f"{path}: "),)


def _records(
    tables: Sequence[Path], study: RecordedStudy, progress: Progress
) -> list[tuple[FlightRecord, tuple[str, ...]]]:
    """Read all flights, and say which rows were left out of each.

    Raises:
        InputError: what is wrong with any of the tables, one line each.
    """
    progress.begin("prepare", len(tables))
    read: list[tuple[FlightRecord, tuple[str, ...]]] = []
    wrong: list[InputError] = []
    for path, name in zip(tables, _names(tables), strict=True):
        try:
            read.append(_record(path, name, study))
        except InputError as error:
            wrong.append(error)
        progress.step(name)
    if wrong:
        raise InputError("\n".join(error.message for error in wrong), hint=wrong[0].hint)
    return read


def _record(path: Path, name: str, study: RecordedStudy) -> tuple[FlightRecord, tuple[str, ...]]:
    try:
        frame = read_flight_table(path, study.layout, study.columns)
    except InputError as error:
        lacking = _lacking(path, study.layout, study.columns) if path.is_file() else ()
        more = [fault for fault in lacking if fault not in error.message]
        raise InputError("\n".join([error.message, *(f"{path}: {fault}" for fault in more)]), hint=error.hint) from None
    columns = dict(study.columns) or {name: name for name in map(str, frame.columns)}
    clocks = [theirs for theirs, ours in columns.items() if ours.startswith("time_") and si_name(ours) == "time_s"]
    said: tuple[str, ...] = ()
    try:
        if clocks and clocks[0] in frame.columns and set(columns) <= set(frame.columns):
            frame, said = increasing(frame, clocks[0])
        record = record_from_frame(
            frame, name=name, condition=study.condition, hold=study.hold, columns=columns, factors=study.factors
        )
    except InputError as error:
        raise InputError(f"{path}: {error.message}", hint=error.hint) from None
    return replace(record, provenance={"file": str(path.resolve()), "file_sha256": sha256(path)}), said


def _names(tables: Sequence[Path]) -> list[str]:
    """Return a name for each flight: that of its file, numbered where two are alike, but never as another file is."""
    taken = {path.stem for path in tables}
    names: list[str] = []
    for path in tables:
        name, number = path.stem, 1
        while name in names or (number > 1 and name in taken):
            number += 1
            name = f"{path.stem}-{number}"
        names.append(name)
    return names


def _seen(record: FlightRecord) -> tuple[str, ...]:
    missed = [name for name in _NEEDED if name not in record.columns]
    lines = tuple(f"there is no {name}, without which no model is identified" for name in missed)
    return (*lines, *contradictions(record))


def _told(item: Preparation, asked: PreparationOptions) -> FlightRecord:
    facts = {CHANGED: "; ".join(item.statements), FOUND: "; ".join(item.findings)}
    return replace(item.record, provenance={**item.record.provenance, **facts, **_instruments(item, asked)})


def _instruments(item: Preparation, asked: PreparationOptions) -> Mapping[str, str]:
    """Return what the provenance of a prepared flight says of its instruments."""
    told = {error.name: error for check in item.compatibility for error in check.errors}
    wrong = {name for check in item.compatibility for sum_ in check.combinations if sum_.significant
             for name in sum_.names}  # fmt: skip
    biases = {
        name for name, fault in FAULTS.items() if fault.kind is Kind.BIAS and asked.compatibility.size(fault) > 0.0
    }
    found = InstrumentFaults(
        together=next((check.flights for check in item.compatibility), (item.record.name,)),
        known=tuple(
            KnownFault(
                name=name,
                value=told[name].value,
                standard_error=told[name].standard_error,
                taken_out=asked.correct_instruments,
            )
            for name in FAULTS
            if name in told and told[name].significant
        ),
        unknown=tuple(name for name in FAULTS if name in biases | wrong and not (name in told and told[name].known)),
    )
    return {INSTRUMENTS: json.dumps(to_tree(found))}
