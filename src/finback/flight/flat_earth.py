"""A flight in the air as equations over a flat Earth have it: in the air and gravity it felt, pitch without folds."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.flight.derived_model import EARTH_RADIUS_M
from finback.flight.felt import FELT_ALTITUDE, FELT_DENSITY, FELT_GRAVITY
from finback.flight.rig import unfolded_pitch
from finback.records import FlightRecord
from finback.units import from_si, to_si

FLATTENED: Final = "over_flat_earth"
"""Key in a flight's provenance: what was changed in it, in one sentence."""
_ON_ITS_BACK_RAD: Final = math.pi / 2
_LEVEL_RAD: Final = to_si(10.0, "deg")
"""Of roll, up to which a motion counts as one in the plane of symmetry: more is a bank, that no loop makes."""


def over_flat_earth(record: FlightRecord) -> FlightRecord:
    """Return a flight as over a flat Earth; one that is so already comes back as it is.

    Its condition gets density, gravity and altitude that it felt (``flight.felt``), as far as it tells them: those of a
    study are the rig's. In a loop, where Euler angles fold the pitch angle at the vertical and turn roll by half a
    turn, both are made continuous. Over a round Earth the horizon turns below the path at V cos(theta - alpha) / r: q
    is made the rate relative to it, and gravity less by the mean of V² / r. Then the equations over a flat Earth are
    those that were flown, but for q in the aerodynamics, where the turning is 1e-6 of q c / 2V in a maneuver.
    """
    if FLATTENED in record.provenance:
        return record
    names = {"density_kg_m3": FELT_DENSITY, "altitude_m": FELT_ALTITUDE, "gravity_m_s2": FELT_GRAVITY}
    felt = {name: float(record.provenance[key]) for name, key in names.items() if key in record.provenance}
    columns = _unfolded(record)
    said = ["theta_rad and phi_rad made continuous through the vertical"] if columns else []
    needed = {"theta_rad", "alpha_rad", "airspeed_m_s"}
    if FELT_GRAVITY in record.provenance and needed <= set(record.columns):
        theta = columns.get("theta_rad", record["theta_rad"])
        turning = record["airspeed_m_s"] * np.cos(theta - record["alpha_rad"]) / EARTH_RADIUS_M
        columns["q_rad_s"] = record["q_rad_s"] + np.where(np.isfinite(turning), turning, 0.0)
        lighter = float(np.nanmean(record["airspeed_m_s"] ** 2)) / EARTH_RADIUS_M
        felt["gravity_m_s2"] -= lighter
        most = from_si(float(np.nanmax(np.abs(turning), initial=0.0)), "deg_s")
        said.append(f"the horizon's turning, at most {most:.2g} deg/s, in q_rad_s, and {lighter:.2g} m/s² less gravity")
    if felt:
        said.insert(0, f"the condition has {', '.join(felt)} as felt")
    if not said:
        return record
    return replace(
        record.with_columns(**columns) if columns else record,
        condition=replace(record.condition, **felt),
        provenance={**record.provenance, FLATTENED: "; ".join(said)},
    )


def _unfolded(record: FlightRecord) -> dict[str, FloatArray]:
    """Return pitch and roll without folds, in rad, shape (n,) each; nothing where there is no loop."""
    if not {"theta_rad", "phi_rad"} <= set(record.columns):
        return {}
    phi = record["phi_rad"]
    over = np.abs(phi) > _ON_ITS_BACK_RAD
    level = np.minimum(np.abs(phi), math.pi - np.abs(phi))
    if not over.any() or not np.nanmax(level) < _LEVEL_RAD:
        return {}
    upright = np.where(over, phi - math.pi, phi)
    return {
        "theta_rad": unfolded_pitch(record["theta_rad"], phi),
        "phi_rad": upright - 2.0 * math.pi * np.round(upright / (2.0 * math.pi)),
    }
