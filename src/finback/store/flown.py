"""What flights of the harness know of themselves, made what the equations of coefficients take."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import InputError
from finback.flight.derived_model import EARTH_RADIUS_M
from finback.flight.felt import FELT_ALTITUDE, FELT_DENSITY, FELT_GRAVITY
from finback.flight.rig import unfolded_pitch
from finback.identification.coefficient.airframe import Airframe
from finback.records import FlightRecord
from finback.units import to_si

_FIXED_THRUST: Final = re.compile(r"FixedThrust\(thrust_n=([^)]+)\)")
_THROTTLE: Final = "Throttle("
_ON_ITS_BACK_RAD: Final = math.pi / 2
_LEVEL_RAD: Final = to_si(10.0, "deg")


def as_flown(record: FlightRecord, airframe: Airframe) -> FlightRecord:
    """Return a flight of a run in the air and gravity that it felt, with its thrust, and a pitch angle without folds.

    The condition of a study says density and gravity of the rig; flights in the air have those of their planet. A fixed
    thrust is a column, where the setup states none. Euler angles turn roll by half a turn where a loop passes the
    vertical.

    Raises:
        InputError: it was flown on the rig, or by engines whose thrust nobody states.
    """
    facts = record.provenance
    if facts.get("fidelity") == "rig":
        raise InputError(
            f"flight '{record.name}' was flown on the rig, which holds the airspeed by a force of its own",
            hint="fly it with fidelity 'symmetric' or 'free'; 'finback identify' reads flights of the rig",
        )
    columns: dict[str, FloatArray] = {}
    power = facts.get("power", "")
    if airframe.thrust_n == 0.0 and "thrust_n" not in record.columns:
        if power.startswith(_THROTTLE):
            raise InputError(
                f"flight '{record.name}' was flown by engines at a throttle, and nothing says what thrust they had",
                hint="write thrust_n into [airframe], or fly with thrust_kn in the study's [flight]",
            )
        if found := _FIXED_THRUST.fullmatch(power):
            columns["thrust_n"] = np.full(len(record), float(found[1]))
    if _loops(record):
        columns["theta_rad"] = unfolded_pitch(record["theta_rad"], record["phi_rad"])
        columns["phi_rad"] = np.where(_on_its_back(record), record["phi_rad"] - math.pi, record["phi_rad"])
        columns["phi_rad"] -= 2.0 * math.pi * np.round(columns["phi_rad"] / (2.0 * math.pi))
    flown = record.with_columns(**columns) if columns else record
    names = {"density_kg_m3": FELT_DENSITY, "altitude_m": FELT_ALTITUDE, "gravity_m_s2": FELT_GRAVITY}
    told = {name: float(facts[key]) for name, key in names.items() if key in facts}
    return _over_flat_earth(replace(flown, condition=replace(record.condition, **told)))


def _over_flat_earth(record: FlightRecord) -> FlightRecord:
    """Return a flight as over a flat Earth: pitching relative to the horizon, which turns, and lighter by V² / r.

    With q + V cos(theta - alpha) / r in place of q, and g - V² / r in place of g, the equations over a flat Earth are
    those over a round one. What it does to q c / 2V is 1e-6 of it in a maneuver.
    """
    needed = ("theta_rad", "alpha_rad", "airspeed_m_s")
    if FELT_GRAVITY not in record.provenance or not set(needed) <= set(record.columns):
        return record
    theta, alpha, speed = (record[name] for name in needed)
    turning = speed * np.cos(theta - alpha) / EARTH_RADIUS_M
    gravity = record.condition.gravity_m_s2 - float(np.nanmean(speed**2)) / EARTH_RADIUS_M
    seen = np.where(np.isfinite(turning), turning, 0.0)
    return replace(
        record.with_columns(q_rad_s=record["q_rad_s"] + seen), condition=replace(record.condition, gravity_m_s2=gravity)
    )


def _on_its_back(record: FlightRecord) -> np.ndarray:
    return np.abs(record["phi_rad"]) > _ON_ITS_BACK_RAD


def _loops(record: FlightRecord) -> bool:
    """Tell whether roll stands at nothing or half a turn, and at both: a loop in the plane of symmetry."""
    if not {"theta_rad", "phi_rad"} <= set(record.columns):
        return False
    phi = np.abs(record["phi_rad"])
    flat = np.minimum(phi, math.pi - phi)
    return bool(_on_its_back(record).any() and np.nanmax(flat) < _LEVEL_RAD)
