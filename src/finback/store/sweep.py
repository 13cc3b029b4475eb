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
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.store.envelope import SWEEP, check_fresh, read_result, write_result

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


def save_sweep(sweep: Sweep, run: Path) -> None:
    """Write ``sweep.parquet`` (long form, float64 bit for bit, units in the fields' metadata) and ``sweep.json``.

    ``sweep.json`` is written last and names the hash of the table: without it, or with another table, there is no
    sweep.
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
    )
    write_result(run, SWEEP, header, aircraft_sha256=sweep.provenance.get("aircraft_sha256", ""))


def load_sweep(run: Path) -> Sweep:
    """Read a sweep.

    Raises:
        MissingResultError: it is missing, or the run's study file has changed since.
        InputError: it is damaged, or the two files are not of one sweep.
    """
    check_fresh(run, SWEEP)
    header, _ = read_result(run / SWEEP.file, SWEEP, _SweepHeader)
    table = _read_table(run / TABLE_FILE, header)
    records, row = [], 0
    for flight in header.flights:
        rows = table.slice(row, flight.samples)
        row += flight.samples
        columns: dict[str, FloatArray] = {name: rows.column(name).to_numpy() for name in flight.columns}
        records.append(
            FlightRecord(
                name=flight.name,
                columns=columns,
                outcome=flight.outcome,
                note=flight.note,
                condition=flight.condition,
                schedule=flight.schedule,
                hold=flight.hold,
                provenance=flight.provenance,
            )
        )
    return Sweep(study=header.study, records=tuple(records), provenance=header.provenance)


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


def _read_table(path: Path, header: _SweepHeader) -> pa.Table:
    try:
        if sha256(path) != header.table_sha256:
            raise InputError(
                f"{path} is not the table that {SWEEP.file} describes", hint="fly again with: finback sweep STUDY"
            )
        return pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"{path} cannot be read: {error}", hint="fly again with: finback sweep STUDY") from error
