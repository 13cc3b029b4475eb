"""Trajectories of ours on disk: a flight of a run, or a file with one flight (``.parquet`` or ``.csv``, SI names)."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from finback.errors import InputError
from finback.formats.text_table import read_text_table
from finback.records import FlightRecord
from finback.store.sweep import load_sweep
from finback.validation.compare import Trajectory, listed

_TIME: Final = "time_s"


def read_trajectory(source: Path, *, flight: str = "") -> Trajectory:
    """Read a trajectory whose columns are named as ours are: quantity and SI unit, ``time_s`` among them.

    Args:
        source: the folder of a run, or a file.
        flight: which flight of the run; may be empty if the run has one only.

    Raises:
        InputError: it is not there, cannot be read, has no such flight or no ``time_s``; the message says which.
    """
    if source.is_dir():
        return _of_run(source, flight)
    if source.suffix == ".parquet":
        return _of_parquet(source)
    if source.suffix == ".csv":
        table = read_text_table(source)
        columns = {name: table.numbers(name) for name in table.cells}
        return _trajectory(source, columns)
    raise InputError(f"{source} is no run and no .parquet or .csv file", hint="name a run's folder, or a flown file")


def _of_run(run: Path, flight: str) -> Trajectory:
    records = {record.name: record for record in load_sweep(run).records}
    if not flight and len(records) == 1:
        flight = next(iter(records))
    if flight not in records:
        said = f"no flight '{flight}'" if flight else f"{len(records)} flights, and none is named"
        raise InputError(
            f"{run} has {said}", hint=listed("flight = … in the map, or --flight, names one of: ", records)
        )
    return trajectory_of(records[flight])


def trajectory_of(record: FlightRecord) -> Trajectory:
    """Return a record as a trajectory."""
    return Trajectory(name=record.name, time_s=record[_TIME], columns=record.columns)


def _of_parquet(path: Path) -> Trajectory:
    try:
        table = pq.read_table(path)
    except FileNotFoundError:
        raise InputError(f"{path} is not there") from None
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path} is no Parquet file: {error}") from None
    columns = {}
    for name in table.column_names:
        if pa.types.is_floating(table.schema.field(name).type) or pa.types.is_integer(table.schema.field(name).type):
            columns[name] = table.column(name).to_numpy().astype(np.float64)
    return _trajectory(path, columns)


def _trajectory(path: Path, columns: dict[str, np.ndarray]) -> Trajectory:
    if _TIME not in columns:
        raise InputError(f"{path} has no column '{_TIME}'", hint=f"it has: {', '.join(columns)}")
    return Trajectory(name=path.stem, time_s=columns[_TIME], columns=columns)
