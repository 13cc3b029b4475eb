"""One flight, one recording: an .rrd file for the Rerun viewer, whose numbers are the record's, bit for bit."""

from __future__ import annotations

import json
import os
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import pyarrow as pa
import rerun as rr
from rerun.chunk import RrdReader

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError
from finback.files import replacing
from finback.records import FlightRecord
from finback.views.blueprint import layout
from finback.views.clock import ROW, TIMELINE, Clock
from finback.views.description import describe
from finback.views.phase_plane import PhasePlane
from finback.views.scene import log_scene
from finback.views.signals import log_signals

APPLICATION: Final = "Finback"
STATE: Final = "/state"
_SWITCHED_OFF: Final = ("0", "false", "off", "no")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingContext:
    """Where a flight belongs.

    Attributes:
        study: name of the study.
        run: name of the run (the folder of its results).
    """

    study: str
    run: str

    def recording_id(self, flight: str) -> str:
        """Return the identity of a flight's recording: the same for the same flight, different for any other."""
        return f"{self.study}/{self.run}/{flight}"


def write_recording(path: Path, record: FlightRecord, *, context: RecordingContext) -> None:
    """Write a flight with plots, phase plane, the aircraft in 3-D, and every column of the record at ``/state``.

    The file appears when it is complete; an earlier one of the same name is replaced.

    Args:
        path: the file to write, ending in ``.rrd``; its folder must exist.
        record: the flight; drawn are alpha, q and elevator, and the attitude from theta (phi, psi where present).
        context: study and run, for the recording's identity.

    Raises:
        InputError: the record is empty or its times are not finite; the file cannot be written; recordings are
            switched off by the environment variable RERUN.
    """
    if os.environ.get("RERUN", "").lower() in _SWITCHED_OFF:
        raise InputError(
            f"{path}: no recording can be written, the environment variable RERUN={os.environ['RERUN']} forbids it",
            hint="unset RERUN",
        )
    clock = Clock.of(record)
    plane = PhasePlane.around(record)
    rr.set_strict_mode(True)  # a wrong shape is our bug: let it raise instead of being dropped with a warning
    try:
        with rr.RecordingStream(
            APPLICATION, recording_id=context.recording_id(record.name), send_properties=False
        ) as stream:
            # Into memory first: writing to a full disk by itself, the SDK can block for good.
            memory = stream.memory_recording()
            stream.send_blueprint(layout(record), make_active=False, make_default=True)
            stream.set_log_time_enabled(False)  # nothing in the file depends on when it was written
            stream.send_recording_name(record.name)
            stream.send_property("flight", rr.AnyValues(**_properties(record, context)))
            stream.send_dataframe(_table(record, clock), index=[TIMELINE, ROW], entity_path=STATE)
            stream.log(
                "description", rr.TextDocument(describe(record, context.study), media_type="text/markdown"), static=True
            )
            log_signals(stream, record, clock)
            plane.log(stream, clock)
            log_scene(stream, record, clock)
            stream.flush()
            content = memory.drain_as_bytes()
        with replacing(path) as part:
            part.write_bytes(content)
            _check_finished(part)
    except (OSError, RuntimeError) as error:
        raise InputError(
            f"{path}: the recording could not be written: {error}", hint="is the folder there, writable, and not full?"
        ) from error


def read_state(path: Path) -> dict[str, FloatArray]:
    """Return the columns of the recorded flight, channel name -> values (n,), in SI, bit for bit as recorded.

    Raises:
        InputError: the file is missing, is no recording, is damaged, or holds no flight.
    """
    chunks = [chunk for chunk in _chunks(path) if chunk.entity_path == STATE and not chunk.is_static]
    if not chunks:
        raise InputError(f"{path} holds no flight: it has no entity {STATE}", hint="was it written by Finback?")
    table = pa.concat_tables([pa.Table.from_batches([chunk.to_record_batch()]) for chunk in chunks]).sort_by(ROW)
    timelines = {name for chunk in chunks for name in chunk.timeline_names}
    return {
        name: frozen_array(pa.concat_arrays(table.column(name).chunks).flatten().to_numpy(zero_copy_only=False))
        for name in table.column_names
        if name not in timelines and not name.startswith("rerun.")
    }


def check_recording(path: Path) -> None:
    """Check that a file is a finished, undamaged recording.

    Raises:
        InputError: it is missing, is no recording, is damaged, or was never finished; the message says which.
    """
    _chunks(path)
    try:
        _check_finished(path)
    except RuntimeError as error:
        raise InputError(f"{path} was never finished: {error}", hint="record the flight again") from error


def _table(record: FlightRecord, clock: Clock) -> pa.Table:
    return pa.table(
        {**clock.arrow(), **{name: pa.array(values, pa.float64()) for name, values in record.columns.items()}}
    )


def _properties(record: FlightRecord, context: RecordingContext) -> dict[str, str]:
    condition = record.condition
    facts = {
        "study": context.study,
        "run": context.run,
        "flight": record.name,
        "outcome": record.outcome.value,
        "note": record.note,
        "hold": record.hold.value,
    }
    nested = {
        **facts,
        "condition": {
            "airspeed_m_s": condition.airspeed_m_s,
            "density_kg_m3": condition.density_kg_m3,
            "gravity_m_s2": condition.gravity_m_s2,
            "altitude_m": condition.altitude_m,
        },
        "schedule": {
            "time_s": record.schedule.time_s.tolist(),
            "elevator_rad": record.schedule.elevator_rad.tolist(),
        },
        "provenance": dict(record.provenance),
    }
    # The SDK keeps only the first key of a nested value, silently; JSON text keeps all of it.
    return {**facts, "metadata_json": json.dumps(nested, ensure_ascii=False, sort_keys=True)}


def _check_finished(path: Path) -> None:
    """Let the reader look for the footer, which is written last."""
    if not path.is_file():
        raise FileNotFoundError(f"no file {path.name} appeared")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the error that follows says the same
        RrdReader(path).store()


def _chunks(path: Path) -> list[Any]:
    if not path.is_file():
        raise InputError(f"there is no recording {path}", hint="recordings stand in <run>/recordings/*.rrd")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a missing footer is the business of check_recording
            return list(RrdReader(path).stream().to_chunks())
    except (RuntimeError, ValueError) as error:
        raise InputError(
            f"{path} cannot be read as a recording: {error}", hint="is it an .rrd file, and whole?"
        ) from error
