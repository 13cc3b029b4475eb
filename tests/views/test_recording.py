"""Recordings: the numbers are the record's, bit for bit, and a file is whole or not there."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra.numpy import arrays
from rerun.chunk import RrdReader

from finback.errors import InputError
from finback.records import FlightRecord
from finback.views import recording
from finback.views.recording import RecordingContext, check_recording, read_state, write_recording
from finback.views.viewer import viewer_environment, viewer_program

CONTEXT = RecordingContext(study="study", run="run-1")


def bits(values: Any) -> Any:
    """Return an array's bits: unlike ==, they tell -0.0 from 0.0 and one NaN from another."""
    return np.ascontiguousarray(values, dtype=np.float64).view(np.uint64)


def written(folder: Path, record: FlightRecord, context: RecordingContext = CONTEXT) -> Path:
    path = folder / f"{record.name}.rrd"
    write_recording(path, record, context=context)
    return path


def properties(path: Path) -> dict[str, str]:
    chunks = RrdReader(path).stream().filter(content="/__properties/flight", is_static=True).to_chunks()
    batch = chunks[0].to_record_batch()
    return {
        name.split(":")[-1]: batch.column(name)[0].as_py()[0]
        for name in batch.schema.names
        if not name.startswith("rerun.")
    }


def test_every_column_comes_back_bit_for_bit(tmp_path: Path, flight: FlightRecord) -> None:
    state = read_state(written(tmp_path, flight))
    assert set(state) == set(flight.columns)
    for name, values in flight.columns.items():
        assert (bits(state[name]) == bits(values)).all(), name
        assert not state[name].flags.writeable


ANY_FLOAT = st.integers(0, 2**64 - 1).map(lambda pattern: struct.unpack("<d", struct.pack("<Q", pattern))[0])
SPECIAL = st.sampled_from([np.nan, np.inf, -np.inf, -0.0, 0.0, 5e-324, 1.7976931348623157e308, -1e-310])


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(values=arrays(np.float64, (3, 7), elements=st.one_of(ANY_FLOAT, SPECIAL), fill=st.nothing()))
def test_any_value_comes_back_bit_for_bit(values: Any, tmp_path: Path, flight: FlightRecord) -> None:
    short = {name: column[:7] for name, column in flight.columns.items()}
    names = ("alpha_rad", "q_rad_s", "theta_rad")
    record = FlightRecord(
        name="odd",
        columns={**short, **dict(zip(names, values, strict=True))},
        outcome=flight.outcome,
        note=flight.note,
        condition=flight.condition,
        schedule=flight.schedule,
        hold=flight.hold,
    )
    state = read_state(written(tmp_path, record))
    for name in names:
        assert (bits(state[name]) == bits(record[name])).all()


def test_an_optimized_copy_reads_the_same(tmp_path: Path, flight: FlightRecord) -> None:
    path, copy = written(tmp_path, flight), tmp_path / "copy.rrd"
    command = [str(viewer_program()), "rrd", "optimize", str(path), "-o", str(copy)]
    subprocess.run(command, env=viewer_environment(), check=True, capture_output=True)
    state = read_state(copy)
    assert all((bits(state[name]) == bits(flight[name])).all() for name in flight.columns)


def test_a_recording_is_finished(tmp_path: Path, flight: FlightRecord) -> None:
    path = written(tmp_path, flight)
    check_recording(path)
    # The program itself: `python -m rerun_cli` drops the exit code (rerun-sdk 0.41).
    command = [str(viewer_program()), "rrd", "verify", str(path)]
    assert subprocess.run(command, env=viewer_environment(), check=False, capture_output=True).returncode == 0
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_the_same_flight_has_the_same_identity_and_another_run_another(tmp_path: Path, flight: FlightRecord) -> None:
    runs = [RecordingContext(study="study", run=run) for run in ("run-1", "run-1", "run-2")]
    paths = []
    for number, context in enumerate(runs):
        folder = tmp_path / str(number)
        folder.mkdir()
        paths.append(written(folder, flight, context))
    found = [RrdReader(path).recordings()[0] for path in paths]
    assert [entry.recording_id for entry in found] == ["study/run-1/doublet-01"] * 2 + ["study/run-2/doublet-01"]
    assert {entry.application_id for entry in found} == {"Finback"}


def test_two_recordings_of_one_process_are_independent(tmp_path: Path, flight: FlightRecord) -> None:
    half = flight.with_columns(alpha_rad=0.5 * flight["alpha_rad"])
    first = written(tmp_path, flight)
    second = tmp_path / "half.rrd"
    write_recording(second, half, context=CONTEXT)
    assert (bits(read_state(first)["alpha_rad"]) == bits(flight["alpha_rad"])).all()
    assert (bits(read_state(second)["alpha_rad"]) == bits(half["alpha_rad"])).all()


def test_the_metadata_is_whole(tmp_path: Path, flight: FlightRecord) -> None:
    facts = properties(written(tmp_path, flight))
    assert facts["outcome"] == "completed"
    nested = json.loads(facts["metadata_json"])
    assert nested["condition"]["density_kg_m3"] == 0.5
    assert nested["schedule"]["elevator_rad"] == flight.schedule.elevator_rad.tolist()
    assert nested["provenance"] == dict(flight.provenance)


def test_times_are_rounded_to_nanoseconds_not_cut(tmp_path: Path, flight: FlightRecord) -> None:
    rows = np.arange(200, 300)
    steps = rows * 0.01
    path = written(tmp_path, flight.with_columns(time_s=steps))
    chunk = RrdReader(path).stream().filter(content="/state", is_static=False).to_chunks()[0]
    nanoseconds = chunk.to_record_batch().column("sim_time").cast("int64").to_numpy()
    assert (nanoseconds == rows * 10_000_000).all()
    assert ((steps * 1e9).astype(np.int64) != nanoseconds).any(), "the example must be one that cutting gets wrong"


def test_nothing_depends_on_when_it_was_written(tmp_path: Path, flight: FlightRecord) -> None:
    for chunk in RrdReader(written(tmp_path, flight)).stream().to_chunks():
        assert set(chunk.timeline_names) <= {"sim_time", "step"}, chunk.entity_path


def test_a_flight_that_diverged_is_recorded(tmp_path: Path, flight: FlightRecord) -> None:
    alpha = flight["alpha_rad"].copy()
    alpha[-3:] = [np.inf, np.nan, np.nan]
    nothing = np.full(len(flight), np.nan)
    state = read_state(written(tmp_path, flight.with_columns(alpha_rad=alpha)))
    assert (bits(state["alpha_rad"]) == bits(alpha)).all()
    empty = flight.with_columns(alpha_rad=nothing, q_rad_s=nothing, theta_rad=nothing)
    assert np.isnan(read_state(written(tmp_path, empty))["q_rad_s"]).all()


def test_a_switched_off_sdk_is_an_error(tmp_path: Path, flight: FlightRecord, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RERUN", "off")
    with pytest.raises(InputError, match="RERUN=off") as caught:
        written(tmp_path, flight)
    assert "unset RERUN" in caught.value.hint
    assert not list(tmp_path.iterdir())


def test_a_sdk_switched_off_before_it_was_loaded_is_an_error(tmp_path: Path) -> None:
    code = (
        "import sys, pathlib; sys.path.insert(0, sys.argv[2]); import conftest\n"
        "from finback.views.recording import RecordingContext, write_recording\n"
        "record = conftest.flight._get_wrapped_function()()\n"
        "write_recording(pathlib.Path(sys.argv[1]), record, context=RecordingContext(study='s', run='r'))"
    )
    environment = {**os.environ, "RERUN": "0"}
    command = [sys.executable, "-c", code, str(tmp_path / "a.rrd"), str(Path(__file__).parent)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "RERUN=0" in done.stderr


def test_a_missing_folder_is_an_error(tmp_path: Path, flight: FlightRecord) -> None:
    with pytest.raises(InputError, match="could not be written"):
        write_recording(tmp_path / "none" / "a.rrd", flight, context=CONTEXT)


def test_a_failure_leaves_nothing_and_keeps_what_was_there(
    tmp_path: Path, flight: FlightRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path, flight)
    before = path.read_bytes()

    def broken(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(recording, "log_scene", broken)
    with pytest.raises(KeyboardInterrupt):
        written(tmp_path, flight)
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_an_empty_flight_is_refused(tmp_path: Path, flight: FlightRecord) -> None:
    empty = flight.with_columns(**{name: column[:0] for name, column in flight.columns.items()})
    with pytest.raises(InputError, match="no samples"):
        written(tmp_path, empty)


def test_reading_says_what_is_wrong(tmp_path: Path, flight: FlightRecord) -> None:
    path = written(tmp_path, flight)
    whole = path.read_bytes()
    text = tmp_path / "text.rrd"
    text.write_text("no recording at all " * 20, encoding="utf-8")
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(whole[: len(whole) // 2])
    unfinished = tmp_path / "unfinished.rrd"
    unfinished.write_bytes(whole[:-20])
    for wrong, message in ((tmp_path / "none.rrd", "there is no recording"), (tmp_path, "there is no recording")):
        with pytest.raises(InputError, match=message):
            read_state(wrong)
        with pytest.raises(InputError, match=message):
            check_recording(wrong)
    for wrong in (text, cut):
        with pytest.raises(InputError, match="cannot be read as a recording"):
            read_state(wrong)
    for wrong in (text, cut, unfinished):
        with pytest.raises(InputError):
            check_recording(wrong)


@pytest.mark.parametrize("kept", [(), ("altitude_m",), ("alpha_rad",), ("q_rad_s", "theta_rad")], ids=str)
def test_a_flight_of_which_only_some_channels_were_kept_is_recorded(
    kept: tuple[str, ...], tmp_path: Path, flight: FlightRecord
) -> None:
    path = tmp_path / "flight.rrd"
    columns = {name: flight[name] for name in ("time_s", *kept)}
    write_recording(path, replace(flight, columns=columns), context=CONTEXT)
    check_recording(path)
    shown = read_state(path)
    assert shown.keys() == columns.keys()
    assert all(shown[name].tobytes() == columns[name].tobytes() for name in columns)
