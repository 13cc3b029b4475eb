"""A campaign on disk: ``campaign.json``, the folder ``sweep.parquet`` grown by partitions, then ``sweep.json``."""

from __future__ import annotations

import fcntl
import json
from collections import Counter
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from finback.arrays import frozen_array
from finback.errors import InputError, MissingResultError
from finback.files import sha256, write_text
from finback.flight.accuracy import SweepAccuracy, sentences
from finback.flight.campaign.crew import Flown
from finback.flight.campaign.fidelity import THROTTLE
from finback.flight.campaign.flying import chunks_of
from finback.flight.campaign.plan import Campaign
from finback.flight.power import POWER, THRUST, FixedThrust, Throttle, power_told
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.store.codec import from_tree, to_json, to_tree
from finback.store.envelope import CAMPAIGN, STUDY_FILE, SWEEP, check_fresh, command, read_result, write_result
from finback.store.partition import (
    HISTORY,
    SAMPLE,
    SUMMARY,
    Partition,
    find_partition,
    partition_name,
    remove_remains,
    writing,
)
from finback.store.run import RECORDINGS

CAMPAIGN_FILE: Final = "campaign.json"
TABLE: Final = "sweep.parquet"
MAXIMUM_SAMPLES: Final = 10_000_000
"""Rows of histories that are taken into memory at once: 28 hours at 100 Hz."""

DISCRETIZATION: Final = "discretization"
"""Key in the provenance of a sweep or campaign: how well the step resolves a sample of its flights."""
RECORDED: Final = "recordings"
"""Key in a campaign's provenance: which of its flights are recorded for the viewer, and what is left out."""

_LOCK: Final = ".campaign.lock"
_BEGUN: Final = "finback/campaign-begun/1"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Begun:
    """A campaign that was begun.

    Attributes:
        study_path: the study's file.
        aircraft_path: the aircraft's file.
        plan_sha256: fingerprint of the plan.
        vehicles: fidelity -> what is flown in it, with versions.
    """

    study_path: str
    aircraft_path: str
    plan_sha256: str
    vehicles: Mapping[str, Mapping[str, str]]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PartitionHeader:
    """A partition without its numbers.

    Attributes:
        name: of its two files.
        flights: rows of the summary.
        history_rows: rows of the history.
        summary_sha256: of the summary's file.
        history_sha256: of the history's file; empty if there is none.
        departures: flights beyond the sample whose history is there because they departed.
    """

    name: str
    flights: int
    history_rows: int
    summary_sha256: str
    history_sha256: str
    departures: int = 0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignHeader:
    """A finished campaign without its numbers.

    Attributes:
        study: the study's name.
        plan_sha256: fingerprint of the plan.
        kind: of the maneuver.
        flights: how many there are.
        outcomes: word -> how many flights ended so.
        condition: the reference flight.
        sample_interval_s: time between two rows of a history.
        vehicles: fidelity -> what was flown in it, with versions.
        provenance: text facts about the whole campaign.
        partitions: what stands in the folder, in order.
        accuracy: how well the step resolves some of the flights, in each fidelity.
    """

    study: str
    plan_sha256: str
    kind: str
    flights: int
    outcomes: Mapping[str, int]
    condition: Condition
    sample_interval_s: float
    vehicles: Mapping[str, Mapping[str, str]]
    provenance: Mapping[str, str]
    partitions: tuple[PartitionHeader, ...]
    accuracy: tuple[SweepAccuracy, ...] = ()


@contextmanager
def alone(run: Path) -> Iterator[None]:
    """Keep every other process from flying the campaign of a run meanwhile; a killed one keeps nobody.

    Raises:
        InputError: another process flies it.
        OSError: the folder is not writable, or its file system knows no locks.
    """
    with (run / _LOCK).open("a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(f"the campaign in {run} is being flown by another process", hint="wait for it") from error
        yield


def begin(run: Path, begun: Begun) -> None:
    """Note that a campaign has begun, or check that what goes on is the same one.

    Raises:
        InputError: the campaign that was begun here is another one, or was flown by other versions.
    """
    path = run / CAMPAIGN_FILE
    if not path.is_file():
        (run / TABLE).mkdir(exist_ok=True)
        write_text(path, to_json({"schema": _BEGUN, "content": to_tree(begun)}))
        return
    before = read_begun(run)
    if before.plan_sha256 != begun.plan_sha256:
        raise InputError(
            f"{run / STUDY_FILE} or the aircraft has changed since its campaign was begun",
            hint="put it back, or begin a new campaign with: finback sweep STUDY",
        )
    for fidelity, facts in begun.vehicles.items():
        for key, value in facts.items():
            was = before.vehicles.get(fidelity, {}).get(key, "")
            if was != value:
                raise InputError(
                    f"the campaign in {run} was begun with {key} '{was}', here it is '{value}': its flights would not"
                    " be of one kind",
                    hint="put that back, or begin a new campaign with: finback sweep STUDY",
                )


def read_begun(run: Path) -> Begun:
    """Return the campaign that was begun in a run.

    Raises:
        MissingResultError: none was.
        InputError: its file is damaged.
    """
    path = run / CAMPAIGN_FILE
    if not path.is_file():
        raise MissingResultError(f"{run} holds no campaign to go on with", hint="begin one with: finback sweep STUDY")
    try:
        tree: Any = json.loads(path.read_bytes())
        return from_tree({_BEGUN: tree["content"]}[tree["schema"]], Begun)
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{path} is damaged: {error}", hint="begin a new campaign: finback sweep STUDY") from error


def written_partitions(run: Path, campaign: Campaign) -> int:
    """Return how many partitions are complete; nothing is changed.

    Raises:
        InputError: one is of another plan, or damaged.
    """
    for number in range(campaign.partitions):
        if not find_partition(run / TABLE, campaign, number):
            return number
    return campaign.partitions


def tidy(run: Path) -> None:
    """Remove what a killed process left half-written; nobody else may fly the campaign."""
    remove_remains(run / TABLE)
    for folder in (run, run / RECORDINGS):
        for part in folder.glob(".*.part"):
            part.unlink()


def write_partitions(
    run: Path, campaign: Campaign, flights: Iterator[Sequence[Flown]], *, first: int
) -> Generator[Sequence[Flown], None, None]:
    """Write flights as they come, and yield them.

    Args:
        run: the folder.
        campaign: the plan.
        flights: chunk by chunk, in order, from the beginning of partition ``first``.
        first: the first partition that is missing.

    Raises:
        OSError: the disk is full, or the folder not writable.
    """
    table = run / TABLE
    before = (find_partition(table, campaign, number) for number in range(first))
    left = campaign.history.departures - sum(found.departures for (found,) in before)
    for number in range(first, campaign.partitions):
        with writing(table, campaign, number, departures=left) as writer:
            for _ in chunks_of(campaign, number):
                chunk = next(flights)
                writer.add(chunk)
                yield chunk
        left -= writer.departures


def fastest_flights(run: Path, campaign: Campaign) -> dict[str, int]:
    """Return the number of the flight that turned fastest in each fidelity, of those that were flown.

    Args:
        run: the folder, with all partitions.
        campaign: the plan.
    """
    found: dict[str, tuple[float, int]] = {}
    columns = ["flight", "fidelity", "q_min_rad_s", "q_max_rad_s"]
    for number in range(campaign.partitions):
        rows = pq.read_table(run / TABLE / SUMMARY / partition_name(number), columns=columns).drop_null()
        turning = np.fmax(np.abs(rows.column("q_min_rad_s").to_numpy()), np.abs(rows.column("q_max_rad_s").to_numpy()))
        fidelities = np.array(rows.column("fidelity").to_pylist(), dtype=object)
        for fidelity in dict.fromkeys(fidelities.tolist()):
            mine = np.flatnonzero(fidelities == fidelity)
            best = mine[np.argmax(turning[mine])]
            if turning[best] > found.get(fidelity, (-1.0, 0))[0]:
                found[fidelity] = float(turning[best]), rows.column("flight")[int(best)].as_py()
    return {fidelity: flight for fidelity, (_, flight) in found.items()}


def describe_flown(
    run: Path, campaign: Campaign, *, accuracy: tuple[SweepAccuracy, ...], recordings: str = ""
) -> CampaignHeader:
    """Return what ``sweep.json`` will say of a campaign whose partitions are all there; nothing is written.

    Args:
        run: the folder.
        campaign: the plan.
        accuracy: how well the step resolves a sample of the flights, in each fidelity.
        recordings: which flights are recorded for the viewer, in a sentence.
    """
    begun, table = read_begun(run), run / TABLE
    headers, outcomes = [], Counter[str]()
    for number in range(campaign.partitions):
        (found,) = find_partition(table, campaign, number)
        outcomes.update(_column(table / SUMMARY / found.name, "outcome"))
        headers.append(_header(table, found))
    return CampaignHeader(
        study=campaign.study,
        plan_sha256=campaign.sha256,
        kind=campaign.kind,
        flights=campaign.flights,
        outcomes=dict(sorted(outcomes.items())),
        condition=campaign.condition,
        sample_interval_s=campaign.options.sample_interval_s,
        vehicles=begun.vehicles,
        provenance={
            "study_path": begun.study_path,
            "aircraft_path": begun.aircraft_path,
            "aircraft_sha256": campaign.aircraft.sha256,
            DISCRETIZATION: sentences(accuracy),
            RECORDED: recordings,
            "seed": str(campaign.seed),
            "alpha_noise_rad": repr(float(campaign.sensors.alpha_noise_rad)),
            "q_noise_rad_s": repr(float(campaign.sensors.q_noise_rad_s)),
            **power_told(campaign.options.power),
        },
        partitions=tuple(headers),
        accuracy=accuracy,
    )


def finish(run: Path, header: CampaignHeader) -> None:
    """Write ``sweep.json``: from now on the campaign is there for later stages, and nothing is left to do.

    Args:
        run: the folder, with all else that the campaign leaves.
        header: what it says.
    """
    write_result(run, CAMPAIGN, header, aircraft_sha256=header.provenance["aircraft_sha256"])
    with suppress(OSError):
        (run / _LOCK).unlink()


def is_campaign(run: Path) -> bool:
    """Return whether a run is one of a campaign, finished or not."""
    return (run / CAMPAIGN_FILE).is_file()


def read_campaign_header(run: Path) -> CampaignHeader:
    """Return a finished campaign without its numbers.

    Raises:
        MissingResultError: it is not finished, or the run's study file has changed since.
        InputError: its file is damaged.
    """
    if not (run / SWEEP.file).is_file():
        raise MissingResultError(f"the campaign in {run} is not finished", hint=f"go on with: finback sweep {run}")
    check_fresh(run, SWEEP)
    return read_result(run / SWEEP.file, CAMPAIGN, CampaignHeader)[0]


def load_campaign(run: Path) -> Sweep:
    """Return the flights of a finished campaign whose time histories were kept.

    Raises:
        MissingResultError: it is not finished, or the run's study file has changed since.
        InputError: it is damaged, kept no history, or more than fit in memory.
    """
    header = read_campaign_header(run)
    rows = sum(partition.history_rows for partition in header.partitions)
    if not rows:
        raise InputError(
            f"the campaign in {run} kept no time histories",
            hint="keep some with: every = 10 in [campaign.history] of the study, and fly again",
        )
    if rows > MAXIMUM_SAMPLES:
        raise InputError(
            f"the campaign in {run} kept {rows} samples of histories, more than {MAXIMUM_SAMPLES} fit in memory",
            hint="keep fewer with: every = 10 in [campaign.history] of the study, and fly again",
        )
    records: list[FlightRecord] = []
    for partition in header.partitions:
        records.extend(records_of(run, header, partition))
    return Sweep(study=header.study, records=tuple(records), provenance=header.provenance)


def _header(table: Path, found: Partition) -> PartitionHeader:
    return PartitionHeader(
        name=found.name,
        flights=found.flights,
        history_rows=found.history_rows,
        summary_sha256=sha256(table / SUMMARY / found.name),
        history_sha256=found.history_sha256,
        departures=found.departures,
    )


def _column(path: Path, name: str) -> list[str]:
    words: list[str] = pq.read_table(path, columns=[name]).column(name).to_pylist()
    return words


def records_of(run: Path, header: CampaignHeader, partition: PartitionHeader) -> Iterator[FlightRecord]:
    """Yield the flights of a partition whose histories were kept, in order.

    Raises:
        InputError: a table is damaged, or is not the one that the header describes.
    """
    if not partition.history_sha256:
        return
    again = f"fly again with: {command(run, SWEEP)}"
    summary = _read(run / TABLE / SUMMARY / partition.name, partition.summary_sha256, again)
    history = _read(run / TABLE / HISTORY / partition.name, partition.history_sha256, again)
    counts = {item["values"]: item["counts"] for item in history.column("flight").value_counts().to_pylist()}
    start = 0
    for row in summary.to_pylist():
        samples = counts.get(row["flight"], 0)
        if samples:
            yield _record(header, row, history.slice(start, samples))
            start += samples


def _record(header: CampaignHeader, row: Mapping[str, Any], rows: pa.Table) -> FlightRecord:
    filled = [name for name in rows.column_names if name != "flight" and not rows.column(name).null_count]
    samples = {key: repr(value) for key, value in row.items() if key.startswith(SAMPLE)}
    return FlightRecord(
        name=row["name"],
        columns={name: rows.column(name).to_numpy() for name in filled},
        outcome=Outcome(row["outcome"]),
        note=row["note"],
        condition=header.condition,
        schedule=Schedule(
            time_s=frozen_array(row["schedule_time_s"]), elevator_rad=frozen_array(row["schedule_elevator_rad"])
        ),
        hold=Hold(row["hold"]),
        provenance={
            **header.vehicles[row["fidelity"]],
            "kind": row["kind"],
            "sample_interval_s": repr(header.sample_interval_s),
            "seed": header.provenance["seed"],
            "index": str(row["flight"]),
            "alpha_noise_rad": header.provenance["alpha_noise_rad"],
            "q_noise_rad_s": header.provenance["q_noise_rad_s"],
            **_power(header, row),
            **samples,
        },
    )


def _power(header: CampaignHeader, row: Mapping[str, Any]) -> dict[str, str]:
    """Return what drove a flight, as the provenance of one flown alone says it."""
    if row["fidelity"] == "rig":
        return {}
    if SAMPLE + THRUST in row:
        return power_told(FixedThrust(thrust_n=row[SAMPLE + THRUST]))
    if SAMPLE + THROTTLE[0] in row:
        return power_told(Throttle(setting=row[SAMPLE + THROTTLE[0]]))
    return {key: header.provenance[key] for key in (POWER, THRUST) if key in header.provenance}


def _read(path: Path, digest: str, again: str) -> pa.Table:
    try:
        if sha256(path) != digest:
            raise InputError(f"{path} is not the table that {SWEEP.file} describes", hint=again)
        return pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"{path} cannot be read: {error}", hint=again) from error
