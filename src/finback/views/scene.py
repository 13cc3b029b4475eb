"""The aircraft in space: attitude from the record, position integrated for the eye only. Nothing here is data.

The world is north, east, down, from the place of the first sample. The viewer keeps such things in single precision.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import rerun as rr

from finback.arrays import FloatArray, frozen_array
from finback.records import FlightRecord
from finback.views.aircraft_mesh import TAIL_HINGE, Mesh, aircraft_mesh, tail_mesh
from finback.views.clock import Clock
from finback.views.drawable import drawable

VEHICLE: Final = "world/vehicle"
BODY: Final = "world/vehicle/body"
HINGE: Final = "world/vehicle/body/hinge"
TAIL: Final = "world/vehicle/body/hinge/tail"
_NEEDED: Final = ("alpha_rad", "beta_rad", "q_rad_s", "phi_rad", "theta_rad", "psi_rad", "airspeed_m_s", "elevator_rad")
_ARROW: Final = 17.0  # m, a little longer than the nose, so that the angle between the two is alpha
_TRACK: Final = (74, 86, 106)
_AIRFLOW: Final = (86, 180, 233)
_AXIS: Final = (225, 228, 232)


def attitude(record: FlightRecord) -> FloatArray:
    """Return roll, pitch and heading in rad, shape (n, 3).

    A missing roll or heading is 0. A missing pitch is the integral of q from a level flight path, good for a look.
    """
    rows = len(record)
    roll, heading = (record.columns.get(name, np.zeros(rows)) for name in ("phi_rad", "psi_rad"))
    pitch = record.columns.get("theta_rad")
    if pitch is None:
        alpha, q = (record.columns.get(name, np.zeros(rows)) for name in ("alpha_rad", "q_rad_s"))
        pitch = alpha[0] + _integral(record["time_s"], q)
    return frozen_array(np.column_stack([roll, pitch, heading]))


def quaternions(angles: FloatArray) -> FloatArray:
    """Return the rotation from body axes to north-east-down as x, y, z, w, shape (n, 4); angles as ``attitude``."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles / 2).T, np.cos(angles / 2).T
    return frozen_array(
        np.column_stack(
            [
                sr * cp * cy - cr * sp * sy,
                cr * sp * cy + sr * cp * sy,
                cr * cp * sy - sr * sp * cy,
                cr * cp * cy + sr * sp * sy,
            ]
        )
    )


def velocity(record: FlightRecord, rotation: FloatArray) -> FloatArray:
    """Return the velocity in north-east-down in m/s, shape (n, 3), from airspeed, alpha, beta and the attitude."""
    rows = len(record)
    alpha, beta = (record.columns.get(name, np.zeros(rows)) for name in ("alpha_rad", "beta_rad"))
    speed = record.columns.get("airspeed_m_s", np.full(rows, record.condition.airspeed_m_s))
    body = np.column_stack([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    return frozen_array(speed[:, np.newaxis] * _rotated(rotation, body))


def log_scene(stream: rr.RecordingStream, record: FlightRecord, clock: Clock) -> None:
    """Write the aircraft with its moving tail, the direction of flight, and the track."""
    stream.log("world", rr.ViewCoordinates.FRD, static=True)
    stream.log(f"{BODY}/mesh", _mesh(aircraft_mesh()), static=True)
    stream.log(f"{TAIL}/mesh", _mesh(tail_mesh()), static=True)
    nose = rr.LineStrips3D([[[11.0, 0, 0.25], [_ARROW, 0, 0.25]]], colors=_AXIS, radii=rr.Radius.ui_points(1.2))
    stream.log(f"{BODY}/axis", nose, static=True)
    stream.log(HINGE, rr.Transform3D(translation=TAIL_HINGE), static=True)  # one entity, one kind of transform
    keep = drawable(record, *_NEEDED)
    if not keep.any():
        return
    times, flown = clock.columns(keep), record.with_columns(**{k: v[keep] for k, v in record.columns.items()})
    rotation = quaternions(attitude(flown))
    moving = velocity(flown, rotation)
    elevator = flown.columns.get("elevator_rad", np.zeros(len(flown)))
    track = np.column_stack([_integral(flown["time_s"], moving[:, k]) for k in range(3)])
    stream.log("world/track", rr.LineStrips3D([track], colors=_TRACK, radii=rr.Radius.ui_points(1.0)), static=True)
    stream.send_columns(VEHICLE, times, rr.Transform3D.columns(translation=track))
    stream.send_columns(BODY, times, rr.Transform3D.columns(quaternion=rotation))
    half = elevator / 2  # trailing edge down turns the tail about +y, as nose up turns the aircraft
    turn = np.column_stack([np.zeros_like(half), np.sin(half), np.zeros_like(half), np.cos(half)])
    stream.send_columns(TAIL, times, rr.Transform3D.columns(quaternion=turn))
    length = np.linalg.norm(moving, axis=1, keepdims=True)
    arrows = _ARROW * moving / np.where(length > 0, length, 1.0)
    look = rr.Arrows3D.from_fields(colors=_AIRFLOW, radii=rr.Radius.ui_points(2.2), labels=["V"], show_labels=True)
    stream.log(f"{VEHICLE}/flight_path", look, static=True)
    stream.send_columns(f"{VEHICLE}/flight_path", times, rr.Arrows3D.columns(vectors=arrows))


def _mesh(mesh: Mesh) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=mesh.positions,
        vertex_normals=mesh.normals,  # without normals the viewer does not shade
        triangle_indices=mesh.triangles,
        vertex_colors=mesh.colors.astype(np.uint8),
    )


def _integral(time: FloatArray, rate: FloatArray) -> FloatArray:
    """Return the running integral from the first sample (trapezoidal rule), shape (n,)."""
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _rotated(rotation: FloatArray, vectors: FloatArray) -> FloatArray:
    """Turn each vector (n, 3) by its quaternion (n, 4; x, y, z, w)."""
    axis, w = rotation[:, :3], rotation[:, 3:]
    twice = 2.0 * np.cross(axis, vectors)
    return vectors + w * twice + np.cross(axis, twice)
