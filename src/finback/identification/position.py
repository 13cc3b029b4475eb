"""Where the sensors sit: angle of attack and specific force moved from the sensor's place to the center of gravity.

Body axes: x forward, y right, z down; a place is given from the center of gravity, in m. Source: Klein & Morelli 2006,
Aircraft System Identification, section 10.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.signal import savgol_filter

from finback.arrays import FloatArray
from finback.errors import InputError, RefusedError
from finback.records import FlightRecord

_NEWTON: Final = 6  # steps: the vane's own speed is far below the airspeed, three are enough
_SLOPE_SAMPLES: Final = 9
"""Samples of the local parabola that gives angular accelerations: at 100 Hz it passes 5 Hz with 4 % loss."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SensorPlaces:
    """Where sensors are, from the center of gravity, body axes, in m.

    Attributes:
        vane_m: (x, y, z) of the angle-of-attack sensor.
        vane_upwash: d(measured)/d(true) of the flow at the vane, 1 for none; about 1.1 on a fuselage side.
        accelerometer_m: (x, y, z) of the accelerometers.
    """

    vane_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    vane_upwash: float = 1.0
    accelerometer_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check that places are finite and the vane moves with the flow."""
        if not np.isfinite([*self.vane_m, *self.accelerometer_m]).all():
            raise InputError(f"sensor places must be finite, got {self.vane_m} and {self.accelerometer_m}")
        if not (np.isfinite(self.vane_upwash) and self.vane_upwash > 0.0):
            raise InputError(f"vane_upwash is {self.vane_upwash}, expected a number > 0")


def at_center_of_gravity(record: FlightRecord, places: SensorPlaces) -> tuple[FlightRecord, tuple[str, ...]]:
    """Return the record as sensors at the center of gravity would have it, and what was changed.

    Alpha needs ``airspeed_m_s`` and ``q_rad_s`` (``p_rad_s``, ``r_rad_s`` and ``beta_rad`` count as 0 where there are
    none); the accelerations need the rates, and their derivatives, taken by a running parabola.

    Raises:
        RefusedError: a needed channel is missing.
    """
    changed: dict[str, FloatArray] = {}
    said = []
    if any(places.vane_m) or places.vane_upwash != 1.0:
        changed["alpha_rad"] = _alpha(record, places)
        most = float(np.nanmax(np.abs(changed["alpha_rad"] - record["alpha_rad"])))
        said.append(f"alpha_rad: moved from the vane to the center of gravity, by up to {most:.3g} rad")
    if any(places.accelerometer_m):
        moved = _specific_force(record, np.array(places.accelerometer_m))
        changed |= moved
        said += [
            f"{name}: moved to the center of gravity, by up to {np.nanmax(np.abs(values - record[name])):.3g} m/s²"
            for name, values in moved.items()
        ]
    return record.with_columns(**changed), tuple(said)


def _alpha(record: FlightRecord, places: SensorPlaces) -> FloatArray:
    """Solve atan2(w + (ω×r)_z, u + (ω×r)_x) = measured / upwash for alpha, at the airspeed of the record."""
    p, q, r = _rates(record, "alpha_rad")
    x, y, z = places.vane_m
    speed = _needed(record, "airspeed_m_s", "alpha_rad") * np.cos(record.or_zero("beta_rad"))
    forward, down = q * z - r * y, p * y - q * x
    there = record["alpha_rad"] / places.vane_upwash
    alpha = np.array(there)
    for _ in range(_NEWTON):
        u, w = speed * np.cos(alpha) + forward, speed * np.sin(alpha) + down
        # d atan2(w, u)/d alpha = (u w' − w u') / (u² + w²)
        slope = (u * speed * np.cos(alpha) + w * speed * np.sin(alpha)) / (u * u + w * w)
        alpha -= (np.arctan2(w, u) - there) / slope
    return alpha


def _specific_force(record: FlightRecord, place: FloatArray) -> dict[str, FloatArray]:
    """Take ω̇×r + ω×(ω×r) from what the accelerometers saw."""
    rates = np.column_stack(_rates(record, "specific force"))
    time = record["time_s"]
    interval = float(np.median(np.diff(time)))
    if time.size < _SLOPE_SAMPLES or np.abs(np.diff(time) - interval).max() > 1e-3 * interval:
        raise RefusedError(
            f"flight '{record.name}': accelerations are moved on a uniform time base of at least {_SLOPE_SAMPLES} rows",
            hint="put the record on one first (identification.uniform)",
        )
    turning = savgol_filter(rates, _SLOPE_SAMPLES, 2, deriv=1, delta=interval, axis=0)
    extra = np.cross(turning, place) + np.cross(rates, np.cross(rates, place))
    return {
        name: record[name] - extra[:, axis]
        for axis, name in enumerate(("ax_m_s2", "ay_m_s2", "az_m_s2"))
        if name in record.columns
    }


def _rates(record: FlightRecord, what: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    return record.or_zero("p_rad_s"), _needed(record, "q_rad_s", what), record.or_zero("r_rad_s")


def _needed(record: FlightRecord, name: str, what: str) -> FloatArray:
    if name not in record.columns:
        raise RefusedError(f"flight '{record.name}': {what} cannot be moved to the center of gravity without {name}")
    return record[name]
