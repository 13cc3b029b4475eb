"""A partition of a campaign on disk: a summary row for each flight, and the rows of the time histories kept.

Both are Parquet, written as the flights come and seen only when complete: the history first, then the summary, whose
appearance announces the partition. The bytes depend on the flights alone.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from finback.channels import channel
from finback.errors import InputError
from finback.files import replacing, sha256
from finback.flight.campaign.crew import MEASURES, Flown
from finback.flight.campaign.plan import Campaign
from finback.store.row_groups import RowGroups
from finback.units import unit_of

SUMMARY: Final = "summary"
HISTORY: Final = "history"
SAMPLE: Final = "sample_"
"""Before the name of a number that the flight was given, such as ``sample_elevator_rad``."""

_PLAN: Final = b"finback_plan_sha256"
_HISTORY_SHA256: Final = b"finback_history_sha256"
_HISTORY_ROWS: Final = b"finback_history_rows"
_DEPARTURES: Final = b"finback_departures"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Partition:
    """A partition that is complete.

    Attributes:
        name: of its two files, ``part-00000.parquet``.
        flights: rows of the summary.
        history_rows: rows of the history.
        history_sha256: of the history's file; empty if there is none.
        departures: flights beyond the sample whose history is there because they departed.
    """

    name: str
    flights: int
    history_rows: int
    history_sha256: str
    departures: int


def partition_name(number: int) -> str:
    """Return the name of a partition's files."""
    return f"part-{number:05d}.parquet"


def find_partition(table: Path, campaign: Campaign, number: int) -> tuple[Partition, ...]:
    """Return a partition if it is complete, else nothing.

    Args:
        table: the folder ``sweep.parquet``.
        campaign: the plan.
        number: of the partition.

    Raises:
        InputError: it is there, but of another plan, or damaged.
    """
    name = partition_name(number)
    path = table / SUMMARY / name
    if not path.is_file():
        return ()
    again = f"remove it (rm {path}) and resume the campaign"
    try:
        found = pq.read_metadata(path)
        facts = found.metadata or {}
        if facts[_PLAN] != campaign.sha256.encode():
            raise InputError(f"{path} is of another campaign than the study's", hint=again)
        digest, rows = facts[_HISTORY_SHA256].decode(), int(facts[_HISTORY_ROWS])
        departures = int(facts[_DEPARTURES])
        if digest and pq.read_metadata(table / HISTORY / name).num_rows != rows:
            raise InputError(f"{path} and its history are not of one another", hint=again)
    except (OSError, KeyError, ValueError, pa.ArrowException) as error:
        raise InputError(f"{path}, or its history, is damaged: {error}", hint=again) from error
    return (
        Partition(name=name, flights=found.num_rows, history_rows=rows, history_sha256=digest, departures=departures),
    )


@final
class PartitionWriter:
    """Takes a partition's flights as they come.

    Args:
        campaign: the plan.
        summary: the file of the summaries.
        history: the file of the histories; it is begun with the first row.
        departures: how many flights beyond the sample may leave a history because they departed.

    Attributes:
        departures: how many have.
    """

    def __init__(self, campaign: Campaign, summary: RowGroups, history: RowGroups, *, departures: int) -> None:
        self.departures = 0
        self._campaign = campaign
        self._summary = summary
        self._history = history
        self._most = departures
        self._rows = 0

    def add(self, flights: Sequence[Flown]) -> None:
        """Write the next flights.

        Raises:
            OSError: they cannot be written.
        """
        table = _history_table(self._campaign, [flown for flown in flights if flown.history and self._keeps(flown)])
        self._history.add(table)
        self._rows += table.num_rows
        self._summary.add(_summary_table(self._campaign, flights))

    def _keeps(self, flown: Flown) -> bool:
        """Return whether a history that came is kept; departures count in the order of the flights."""
        if self._campaign.history.keeps(flown.sample.index):
            return True
        if self.departures == self._most:
            return False
        self.departures += 1
        return True

    def facts(self, history_sha256: str) -> dict[str, str]:
        """Return what the summary says of the plan and the history, whose fingerprint is empty if there is none."""
        facts = {
            _PLAN: self._campaign.sha256,
            _HISTORY_SHA256: history_sha256,
            _HISTORY_ROWS: str(self._rows),
            _DEPARTURES: str(self.departures),
        }
        return {key.decode(): value for key, value in facts.items()}


@contextmanager
def writing(table: Path, campaign: Campaign, number: int, *, departures: int) -> Iterator[PartitionWriter]:
    """Give a writer for a partition; on success the partition is there, on any exception nothing of it.

    Args:
        table: the folder ``sweep.parquet``.
        campaign: the plan.
        number: of the partition.
        departures: how many flights beyond the sample may leave a history because they departed.

    Raises:
        OSError: the disk is full, or the folder not writable.
    """
    name = partition_name(number)
    summary, history = table / SUMMARY / name, table / HISTORY / name
    for path in (summary, history):
        path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(summary) as summary_part, _part(history) as history_part:
        rows, samples = RowGroups(summary_part, shown=summary), RowGroups(history_part, shown=history)
        try:
            writer = PartitionWriter(campaign, rows, samples, departures=departures)
            yield writer
            digest = ""
            if samples.finish({}):
                _settle(history_part)
                digest = sha256(history_part)
                history_part.replace(history)
                _settle(history.parent)
            rows.finish(writer.facts(digest))
            _settle(summary_part)
        except BaseException:
            samples.abandon()
            rows.abandon()
            raise
    _settle(summary.parent)


@contextmanager
def _part(path: Path) -> Iterator[Path]:
    """Give a temporary name beside ``path``; what stands there at the end is removed."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
    finally:
        part.unlink(missing_ok=True)


def remove_remains(table: Path) -> None:
    """Remove what a killed process left half-written."""
    for folder in (SUMMARY, HISTORY):
        for part in (table / folder).glob(".*.part"):
            part.unlink()


def _settle(path: Path) -> None:
    """Wait until a file or folder has reached the disk: what is announced survives a loss of power."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _number(name: str, unit: str) -> pa.Field:
    return pa.field(name, pa.float64(), metadata={"unit": unit})


def _history_table(campaign: Campaign, flights: Sequence[Flown]) -> pa.Table:
    """Return the rows of the histories below each other; a channel that a flight does not have is null there."""
    lengths = [flown.history["time_s"].size for flown in flights]
    numbers = np.repeat(np.array([flown.sample.index for flown in flights], dtype=np.int64), lengths)
    arrays, schema = [pa.array(numbers)], [pa.field("flight", pa.int64(), nullable=False)]
    for name in ("time_s", *campaign.history.channels):
        chunks = [
            pa.array(flown.history[name], pa.float64()) if name in flown.history else pa.nulls(rows, pa.float64())
            for flown, rows in zip(flights, lengths, strict=True)
        ]
        arrays.append(pa.chunked_array(chunks, pa.float64()))
        schema.append(_number(name, channel(name).unit))
    return pa.table(arrays, schema=pa.schema(schema))


def _summary_table(campaign: Campaign, flights: Sequence[Flown]) -> pa.Table:
    columns: list[tuple[pa.Field, Any]] = [
        (pa.field("flight", pa.int64(), nullable=False), [flown.sample.index for flown in flights]),
        (pa.field("name", pa.string(), nullable=False), [flown.sample.name for flown in flights]),
        (pa.field("kind", pa.string(), nullable=False), [campaign.kind] * len(flights)),
        (pa.field("fidelity", pa.string(), nullable=False), [flown.sample.fidelity for flown in flights]),
    ]
    for number, name in enumerate(campaign.names):
        values = [flown.sample.values[number] for flown in flights]
        columns.append((_number(SAMPLE + name, _unit(name)), values))
    columns += [
        (pa.field("outcome", pa.string(), nullable=False), [flown.outcome for flown in flights]),
        (pa.field("note", pa.string(), nullable=False), [flown.note for flown in flights]),
    ]
    for number, name in enumerate(MEASURES):
        measured = np.array([flown.measures[number] for flown in flights])
        columns.append((_number(name, unit_of(name)), pa.array(measured, pa.float64(), mask=np.isnan(measured))))
    columns.append((pa.field("hold", pa.string(), nullable=False), [flown.hold.value for flown in flights]))
    for name in ("time_s", "elevator_rad"):
        knots = [getattr(flown.schedule, name) for flown in flights]
        columns.append((pa.field(f"schedule_{name}", pa.list_(pa.float64()), metadata={"unit": unit_of(name)}), knots))
    fields = [field for field, _ in columns]
    return pa.table([pa.array(values, field.type) for field, values in columns], schema=pa.schema(fields))


def _unit(name: str) -> str:
    """Return the unit of a sample's number; a ratio has none."""
    try:
        return unit_of(name)
    except InputError:
        return "1"
