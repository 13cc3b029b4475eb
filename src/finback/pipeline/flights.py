"""Single flights: one case flown as it is, and any flight beside another trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from finback.errors import InputError
from finback.flight.case import Case, FlownCase
from finback.flight.case_process import fly_apart, fly_apart_checked
from finback.flight.case_record import case_record
from finback.formats.text_table import read_text_table
from finback.store.case_file import save_case
from finback.store.trajectory_file import read_trajectory
from finback.study.channel_map import read_channel_map
from finback.units import to_si
from finback.validation.compare import (
    Trajectory,
    TrajectoryComparison,
    check_names,
    compare as compare_trajectories,
)


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
    table = read_text_table(reference, wanted.layout)
    ours = read_trajectory(source, flight=flight or wanted.flight)
    check_names((ours.name, ours.columns), (reference.name, table.cells), wanted.channels)
    theirs = Trajectory(
        name=reference.name,
        time_s=to_si(table.numbers(wanted.time), wanted.time_unit) + wanted.time_offset_s,
        columns={name: table.numbers(name) for name in dict.fromkeys(one.reference for one in wanted.channels)},
    )
    return compare_trajectories(ours, theirs, wanted.channels, window_s=wanted.window_s)


def fly(case: Case, paths: Sequence[Path], *, check_step: bool = True) -> FlownCase:
    """Fly one case in a process of its own and write it to files: ``.parquet``, ``.csv`` or ``.rrd``.

    Args:
        case: what is flown.
        paths: what is written.
        check_step: fly it again at half the step, so that ``step_error`` is known.

    Raises:
        AircraftError: JSBSim does not load or start it.
        InputError: the case does not fit together, or a file's name ends in none of these.
    """
    for path in paths:
        if path.suffix not in {".parquet", ".csv", ".rrd"}:
            raise InputError(f"{path} ends in none of .parquet, .csv and .rrd")
        if not path.absolute().parent.is_dir():
            raise InputError(f"there is no folder {path.parent} to write {path.name} to")
    flown = fly_apart_checked(case) if check_step else fly_apart(case)
    for path in paths:
        if path.suffix == ".rrd":
            from finback.views.recording import RecordingContext, write_recording  # noqa: PLC0415 - as above

            write_recording(path, case_record(flown), context=RecordingContext(study="fly", run=flown.name))
        else:
            save_case(flown, path)
    return flown
