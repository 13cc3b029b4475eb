"""A sweep on disk: ``sweep.parquet`` holds the columns of all flights, ``sweep.json`` everything else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from finback.arrays import FloatArray
from finback.channels import channel
from finback.errors import InputError
from finback.files import replacing, sha256
from finback.flight.accuracy import SweepAccuracy
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.store.campaign import is_campaign, load_campaign, read_campaign_header
from finback.store.envelope import SWEEP, check_fresh, command, read_result, write_result

TABLE_FILE: Final = "sweep.parquet"
_FLIGHT: Final = "flight"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _FlightHeader:
    """A flight without its numbers."""

    name: str
    columns: tuple[str, ...]
    samples: int
    outcome: Outcome
    note: str
    condition: Condition
    schedule: Schedule
    hold: Hold
    provenance: Mapping[str, str]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _SweepHeader:
    """A sweep without its numbers."""

    study: str
    table_sha256: str
    provenance: Mapping[str, str]
    flights: tuple[_FlightHeader, ...]
    accuracy: tuple[SweepAccuracy, ...] = ()


def save_sweep(sweep: Sweep, run: Path, *, accuracy: tuple[SweepAccuracy, ...] = ()) -> None:
    """Write ``sweep.parquet`` (long form, float64 bit for bit, units in the fields' metadata) and ``sweep.json``.

    ``sweep.json`` is written last and names the hash of the table: without it, or with another table, there is no
    sweep.

    Args:
        sweep: the flights.
        run: the folder.
        accuracy: how well the step resolves some of them; nothing if nobody looked.
    """
    with replacing(run / TABLE_FILE) as part:
        pq.write_table(_table(sweep), part, compression="zstd")
        digest = sha256(part)
    header = _SweepHeader(
        study=sweep.study,
        table_sha256=digest,
        provenance=sweep.provenance,
        flights=tuple(
            _FlightHeader(
                name=record.name,
                columns=tuple(record.columns),
                samples=len(record),
                outcome=record.outcome,
                note=record.note,
                condition=record.condition,
                schedule=record.schedule,
                hold=record.hold,
                provenance=record.provenance,
            )
            for record in sweep.records
        ),
        accuracy=accuracy,
    )
    write_result(run, SWEEP, header, aircraft_sha256=sweep.provenance.get("aircraft_sha256", ""))


def load_sweep(run: Path) -> Sweep:
    """Read a sweep; of a campaign, the flights whose time histories were kept.

    Raises:
        MissingResultError: it is missing, not finished, or the run's study file has changed since.
        InputError: it is damaged, or the two files are not of one sweep, or a campaign kept no time histories.
    """
    if is_campaign(run):
        return load_campaign(run)
    check_fresh(run, SWEEP)
    header, _ = read_result(run / SWEEP.file, SWEEP, _SweepHeader)
    again = f"fly again with: {command(run, SWEEP)}"
    table = _read_table(run / TABLE_FILE, header, again)
    try:
        return Sweep(study=header.study, records=_records(header, table), provenance=header.provenance)
    except InputError as error:
        raise InputError(f"{run / SWEEP.file} is damaged: {error.message}", hint=again) from error


def load_accuracy(run: Path) -> tuple[SweepAccuracy, ...]:
    """Return how well the step resolves a sample of a sweep's flights, or a campaign's, in each fidelity.

    Raises:
        MissingResultError: the sweep is missing, not finished, or the run's study file has changed since.
        InputError: it is damaged.
    """
    if is_campaign(run):
        return read_campaign_header(run).accuracy
    check_fresh(run, SWEEP)
    return read_result(run / SWEEP.file, SWEEP, _SweepHeader)[0].accuracy


def _records(header: _SweepHeader, table: pa.Table) -> tuple[FlightRecord, ...]:
    """Return the flights; their rows stand below each other in the table.

    Raises:
        InputError: the table is not of these flights.
    """
    samples = [flight.samples for flight in header.flights]
    if min(samples, default=0) < 0 or sum(samples) != table.num_rows:
        raise InputError(f"its flights have {samples} samples, the table has {table.num_rows} rows")
    records, start = [], 0
    for flight in header.flights:
        records.append(_record(flight, table.slice(start, flight.samples)))
        start += flight.samples
    return tuple(records)


def _record(flight: _FlightHeader, rows: pa.Table) -> FlightRecord:
    """Return a flight whose rows are all of it.

    Raises:
        InputError: the rows are of another flight, or have not just the columns that the header says.
    """
    if rows.num_rows and rows.column(_FLIGHT).unique().to_pylist() != [flight.name]:
        raise InputError(f"the rows of flight '{flight.name}' are of another one in the table")
    channels = [name for name in rows.column_names if name != _FLIGHT]
    filled = [name for name in channels if not rows.num_rows or not rows.column(name).null_count]
    unknown = set(flight.columns) - set(filled)
    missing = set(filled) - set(flight.columns) if rows.num_rows else set()
    if unknown or missing:
        raise InputError(
            f"flight '{flight.name}' has the columns {', '.join(flight.columns)}, in the table {', '.join(filled)}"
        )
    columns: dict[str, FloatArray] = {name: rows.column(name).to_numpy() for name in flight.columns}
    return FlightRecord(
        name=flight.name,
        columns=columns,
        outcome=flight.outcome,
        note=flight.note,
        condition=flight.condition,
        schedule=flight.schedule,
        hold=flight.hold,
        provenance=flight.provenance,
    )


def _table(sweep: Sweep) -> pa.Table:
    """Return all flights below each other; a channel that a flight does not have is null there."""
    names = list(dict.fromkeys(name for record in sweep.records for name in record.columns))
    flights = pa.array([record.name for record in sweep.records], pa.string())
    rows = np.repeat(np.arange(len(sweep.records), dtype=np.int32), [len(record) for record in sweep.records])
    arrays = [pa.DictionaryArray.from_arrays(pa.array(rows), flights)]
    fields = [pa.field(_FLIGHT, arrays[0].type, nullable=False)]
    for name in names:
        chunks = [
            pa.array(record[name], pa.float64()) if name in record.columns else pa.nulls(len(record), pa.float64())
            for record in sweep.records
        ]
        arrays.append(pa.chunked_array(chunks, pa.float64()))
        fields.append(pa.field(name, pa.float64(), metadata={"unit": channel(name).unit}))
    return pa.table(arrays, schema=pa.schema(fields))


def _read_table(path: Path, header: _SweepHeader, again: str) -> pa.Table:
    try:
        if sha256(path) != header.table_sha256:
            raise InputError(f"{path} is not the table that {SWEEP.file} describes", hint=again)
        return pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"{path} cannot be read: {error}", hint=again) from error
