"""Flying a flight of a run again: is it the same one, to the last bit? And its recording, where it has none."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

import numpy as np

from finback.errors import FinbackError, InputError, MissingResultError
from finback.flight.campaign.crew import MEASURES, REFUSED, Crew
from finback.flight.campaign.plan import Campaign
from finback.flight.plan import FlightPlan
from finback.flight.sensors import measure
from finback.flight.sweep import plan_flights
from finback.flight.vehicle import Vehicle, make_vehicle
from finback.pipeline.folder import recording, study_of
from finback.records import FlightRecord
from finback.store import load_sweep, load_validation
from finback.store.campaign import is_campaign, read_begun, read_campaign_header
from finback.store.campaign_flight import flight_number, load_histories, summary_row
from finback.store.envelope import STUDY_FILE, VALIDATE
from finback.store.partition import SAMPLE
from finback.store.run import RECORDINGS
from finback.study import Study, read_campaign_study

_HOLDOUT = "holdout-"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Reflown:
    """A flight that was flown again.

    Attributes:
        record: what happened now, as the sensors saw it.
        outcome: how it ended then: a word of ``Outcome``.
        compared: what of it is stored: columns, and numbers of its summary.
        differing: those of ``compared`` that are not the same to the last bit.
        versions: what else is other than then, such as ``jsbsim 1.3.3, then 1.3.2``.
    """

    record: FlightRecord
    outcome: str
    compared: tuple[str, ...]
    differing: tuple[str, ...]
    versions: tuple[str, ...]

    @property
    def same(self) -> bool:
        """Whether it ended the same way, with the same bits wherever they are stored."""
        return self.outcome == self.record.outcome.value and not self.differing


def refly(run: Path, flight: str) -> Reflown:
    """Fly a flight of a run again and compare it with what the run holds of it.

    Args:
        run: the folder of a run, or of a finished campaign.
        flight: of the sweep, a hold-out (``holdout-...``), or any flight of a campaign, by name or number.

    Raises:
        InputError: there is no such flight, or it was refused then.
        MissingResultError: a result is missing or stale, or the aircraft has changed.
    """
    if is_campaign(run):
        return _of_campaign(run, flight)
    flown = load_sweep(run)
    study = study_of(run, flown)
    if flight.startswith(_HOLDOUT) and (run / VALIDATE.file).is_file():
        return _holdout(run, study, flight)
    stored = flown[flight]
    with make_vehicle(study.aircraft, study.condition, study.flight) as vehicle:
        plans = plan_flights(study.maneuvers, vehicle.derivatives, study.flight).plans
        names = [plan.name for plan in plans]
        if flight not in names:
            raise _unplanned(run, flight)
        index = names.index(flight)
        record = measure(vehicle.fly(plans[index]), study.sensors, seed=study.seed, index=index)
    return _beside(record, stored)


def _holdout(run: Path, study: Study, flight: str) -> Reflown:
    stored = {holdout.record.name: holdout.record for holdout in load_validation(run).holdouts}
    if flight not in stored:
        raise InputError(f"{run} has no flight '{flight}'", hint=f"hold-outs: {', '.join(stored)}")
    with make_vehicle(study.aircraft, study.condition, study.flight) as vehicle:
        plan = _planned_holdout(run, study, vehicle, flight)
        return _beside(vehicle.fly(plan), stored[flight])


def _unplanned(run: Path, flight: str) -> InputError:
    return InputError(
        f"flight '{flight}' is stored in {run}, but its study plans no such flight now: no trim is found for it",
        hint="was it flown by another version of Finback or JSBSim? its provenance in sweep.json tells",
    )


def _planned_holdout(run: Path, study: Study, vehicle: Vehicle, flight: str) -> FlightPlan:
    plans = plan_flights(study.validation.holdout, vehicle.derivatives, study.flight).plans
    named = {f"{_HOLDOUT}{plan.name}": plan for plan in plans}
    if flight not in named:
        raise _unplanned(run, flight)
    return replace(named[flight], name=flight)


def _beside(record: FlightRecord, stored: FlightRecord) -> Reflown:
    return Reflown(
        record=record,
        outcome=stored.outcome.value,
        compared=tuple(stored.columns),
        differing=_other_columns(record, stored.columns),
        versions=_other_versions(record.provenance, stored.provenance),
    )


def _of_campaign(run: Path, flight: str) -> Reflown:
    header = read_campaign_header(run)
    campaign = read_campaign_study(run / STUDY_FILE, aircraft=read_begun(run).aircraft_path).campaign
    if campaign.sha256 != header.plan_sha256:
        raise MissingResultError(
            f"the campaign in {run} was flown by another study file, aircraft or version of Finback",
            hint="put them back, or fly it again with: finback sweep STUDY",
        )
    number = flight_number(header, flight)
    row = summary_row(run, header, number)
    if row["outcome"] == REFUSED:
        raise InputError(f"flight '{row['name']}' was refused: {row['note']}", hint="choose one that was flown")
    with Crew(campaign) as crew:
        try:
            again, record = crew.fly(number), crew.record(number)
        except FinbackError as error:
            raise InputError(f"flight '{row['name']}' was flown then, and is refused now: {error.message}") from error
        now = dict(zip(MEASURES, again.measures, strict=True))
    kept = tuple(load_histories(run, header, (number,)))
    stored = kept[0].columns if kept else {}
    return Reflown(
        record=record,
        outcome=str(row["outcome"]),
        compared=(*_given(campaign), *MEASURES, *stored),
        differing=(
            *_other_samples(campaign, row, number),
            *(name for name in MEASURES if not _same(now[name], row[name])),
            *_other_columns(record, stored),
        ),
        versions=_other_versions(record.provenance, header.vehicles[str(row["fidelity"])]),
    )


def _given(campaign: Campaign) -> tuple[str, ...]:
    return tuple(f"{SAMPLE}{name}" for name in campaign.names)


def _other_samples(campaign: Campaign, row: Mapping[str, Any], number: int) -> list[str]:
    values = campaign.sample(number).values
    return [name for name, value in zip(_given(campaign), values, strict=True) if not _same(value, row[name])]


def _same(now: float, then: float | None) -> bool:
    return (then is None or math.isnan(then)) if math.isnan(now) else now == then


def _other_columns(record: FlightRecord, stored: Mapping[str, Any]) -> tuple[str, ...]:
    found = record.columns
    return tuple(
        name
        for name, values in stored.items()
        if name not in found or found[name].tobytes() != np.ascontiguousarray(values).tobytes()
    )


def _other_versions(now: Mapping[str, str], then: Mapping[str, str]) -> tuple[str, ...]:
    keys = ("aircraft_sha256", "fidelity", "step_s", "jsbsim", "numpy", "python")
    return tuple(
        f"{key} {now[key]}, then {then[key]}" for key in keys if key in now and now[key] != then.get(key, now[key])
    )


def recording_of(run: Path, flight: str) -> tuple[Path, bool]:
    """Return the recording of a flight of a run, and whether it was made just now, by flying it again.

    Of a campaign any flight can be had, by name or number; of other runs those that were recorded.

    Raises:
        InputError: there is no such flight, or its recording cannot be written.
        MissingResultError: a result is missing or stale, or the aircraft has changed.
    """
    if not is_campaign(run):
        return recording(run, flight), False
    header = read_campaign_header(run)
    name = f"{header.kind}-{flight_number(header, flight):07d}"
    path = run / RECORDINGS / f"{name}.rrd"
    if path.is_file():
        return path, False
    again = refly(run, name)
    if not again.same:
        raise InputError(
            f"flight '{name}' is not what it was then: {again.outcome}, now {again.record.outcome.value};"
            f" not the same: {', '.join(again.differing)}",
            hint=f"{'; '.join(again.versions) or 'fly the campaign again'}",
        )
    from finback.views.recording import RecordingContext, write_recording  # noqa: PLC0415 - half a second, not for all

    path.parent.mkdir(exist_ok=True)
    write_recording(path, again.record, context=RecordingContext(study=header.study, run=run.name))
    return path, True
