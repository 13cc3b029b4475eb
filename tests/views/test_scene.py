"""The aircraft in space: right side up, nose where it points, tail where the elevator says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

from finback.records import FlightRecord
from finback.views.aircraft_mesh import TAIL_HINGE, Mesh, aircraft_mesh, tail_mesh
from finback.views.phase_plane import PhasePlane, ticks
from finback.views.recording import RecordingContext, write_recording
from finback.views.scene import BODY, TAIL, VEHICLE, attitude, quaternions, velocity

ANGLE = st.floats(-3.0, 3.0)
ROUNDING = 1e-12  # a dozen double operations on numbers of order 1
SINGLE = 2e-6  # transforms are single precision in the viewer


def same_rotation(one: Any, other: Any) -> Any:
    return np.abs(np.sum(one * other, axis=-1)) > 1.0 - ROUNDING


@given(roll=ANGLE, pitch=ANGLE, heading=ANGLE)
def test_quaternions_are_the_aerospace_sequence(roll: float, pitch: float, heading: float) -> None:
    ours = quaternions(np.array([[roll, pitch, heading]]))[0]
    reference = Rotation.from_euler("ZYX", [heading, pitch, roll]).as_quat()
    assert same_rotation(ours, reference)


def test_wings_level_velocity_follows_the_flight_path(flight: FlightRecord) -> None:
    moving = velocity(flight, quaternions(attitude(flight)))
    path = flight["theta_rad"] - flight["alpha_rad"]
    expected = 250.0 * np.column_stack([np.cos(path), np.zeros_like(path), -np.sin(path)])
    assert np.abs(moving - expected).max() < 250.0 * ROUNDING


def test_without_pitch_the_attitude_is_integrated(flight: FlightRecord) -> None:
    columns = {name: values for name, values in flight.columns.items() if name != "theta_rad"}
    bare = FlightRecord(
        name=flight.name,
        columns=columns,
        outcome=flight.outcome,
        note=flight.note,
        condition=flight.condition,
        schedule=flight.schedule,
        hold=flight.hold,
    )
    pitch = attitude(bare)[:, 1]
    assert pitch[0] == flight["alpha_rad"][0]
    assert np.abs(np.gradient(pitch, flight["time_s"])[1:-1] - flight["q_rad_s"][1:-1]).max() < 0.05  # smoothed twice


def columns(path: Path, entity: str, component: str) -> Any:
    chunks = RrdReader(path).stream().filter(content=f"/{entity}", is_static=False).to_chunks()
    for chunk in chunks:
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            return np.array([row[0] for row in batch.column(component).to_pylist()])
    raise AssertionError(f"no {component} at {entity}")


def test_the_recording_holds_attitude_place_and_tail(tmp_path: Path, flight: FlightRecord) -> None:
    path = tmp_path / "flight.rrd"
    write_recording(path, flight, context=RecordingContext(study="s", run="r"))
    nose = Rotation.from_quat(columns(path, BODY, "Transform3D:quaternion")).apply([1.0, 0.0, 0.0])
    assert np.abs(nose[:, 2] + np.sin(flight["theta_rad"])).max() < SINGLE, "nose up is up, z is down"
    place = columns(path, VEHICLE, "Transform3D:translation")
    assert place[0].tolist() == [0.0, 0.0, 0.0]
    assert place[-1, 0] == pytest.approx(250.0 * flight.duration_s, rel=0.01)  # nearly level, at 250 m/s
    turn = Rotation.from_quat(columns(path, TAIL, "Transform3D:quaternion"))
    trailing = turn.apply([-1.0, 0.0, 0.0])
    down = flight["elevator_rad"] > 0
    assert (trailing[down, 2] > 0).all(), "trailing edge down"
    assert (trailing[~down, 2] < 0).all()


@pytest.mark.parametrize("make", [aircraft_mesh, tail_mesh])
def test_meshes_face_outward(make: Any) -> None:
    mesh: Mesh = make()
    a, b, c = (mesh.positions[mesh.triangles[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    assert np.abs(np.linalg.norm(mesh.normals, axis=1) - 1.0).max() < ROUNDING
    assert (np.sum(face * mesh.normals[mesh.triangles].mean(axis=1), axis=1) >= 0).all()
    assert np.sum(a * np.cross(b, c)) > 0, "the enclosed volume is positive only if faces look outward"


@pytest.mark.parametrize("make", [aircraft_mesh, tail_mesh])
def test_meshes_are_symmetric(make: Any) -> None:
    points = {tuple(row) for row in np.round(make().positions, 9).tolist()}
    assert {(x, -y + 0.0, z) for x, y, z in points} == {(x, y + 0.0, z) for x, y, z in points}


def test_the_aircraft_is_slender_and_its_tail_sits_behind() -> None:
    size = np.ptp(aircraft_mesh().positions, axis=0)
    assert size[0] > 2 * size[1] > 2 * size[2]
    behind = np.asarray(TAIL_HINGE) + tail_mesh().positions
    assert behind[:, 0].max() < aircraft_mesh().positions[:, 0].mean()


@given(low=st.floats(-1e3, 1e3), span=st.floats(1e-2, 1e4))
def test_ticks_are_round_few_and_inside(low: float, span: float) -> None:
    values = ticks(low, low + span)
    assert 3 <= values.size <= 12
    step = np.diff(values)
    assert (values >= low - 1e-9 * span).all()
    assert (values <= low + span + 1e-9 * span).all()
    mantissa = step[0] / 10.0 ** np.floor(np.log10(step[0]) + 1e-9)
    assert np.abs(np.array([1.0, 2.0, 5.0, 10.0]) - mantissa).min() < 1e-3


def test_the_plane_holds_the_flight_with_q_upward(flight: FlightRecord) -> None:
    plane = PhasePlane.around(flight)
    places = plane.place(*plane.points.T)
    assert (places >= 0).all()
    highest = int(np.argmax(flight["q_rad_s"]))
    assert places[:, 1].argmin() == highest, "the viewer's y points down"
    assert places[:, 0].argmax() == int(np.argmax(flight["alpha_rad"]))
