"""Where the sensors sit: flow angles and specific force moved from the sensor's place to the center of gravity.

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
_TURNS: Final = 8
"""How often alpha and sideslip are solved for in turn: each depends on the other only by the vane's own speed, or by
the cosine of a small angle."""
_SLOPE_SAMPLES: Final = 9
"""Samples of the local parabola that gives angular accelerations: at 100 Hz it passes 5 Hz with 4 % loss."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SensorPlaces:
    """Where sensors are, from the center of gravity, body axes, in m.

    Attributes:
        vane_m: (x, y, z) of the angle-of-attack sensor.
        vane_upwash: d(measured)/d(true) of the flow at the vane, 1 for none; about 1.1 on a fuselage side.
        beta_vane_m: (x, y, z) of the sideslip sensor.
        beta_vane_sidewash: d(measured)/d(true) of the sideward flow there, 1 for none.
        beta_vane_flank: whether it is a vane that turns about the body's z-axis: it measures atan(v/u), not the
            sideslip asin(v/V).
        accelerometer_m: (x, y, z) of the accelerometers.
    """

    vane_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    vane_upwash: float = 1.0
    beta_vane_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    beta_vane_sidewash: float = 1.0
    beta_vane_flank: bool = False
    accelerometer_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check that places are finite and the vanes move with the flow."""
        places = (self.vane_m, self.beta_vane_m, self.accelerometer_m)
        if not np.isfinite(places).all():
            raise InputError(f"sensor places must be finite, got {', '.join(map(str, places))}")
        for name, wash in (("vane_upwash", self.vane_upwash), ("beta_vane_sidewash", self.beta_vane_sidewash)):
            if not (np.isfinite(wash) and wash > 0.0):
                raise InputError(f"{name} is {wash}, expected a number > 0")

    @property
    def moves_alpha(self) -> bool:
        """Whether the angle of attack is measured elsewhere than at the center of gravity."""
        return any(self.vane_m) or self.vane_upwash != 1.0

    @property
    def moves_beta(self) -> bool:
        """Whether the sideslip is, or is no sideslip."""
        return any(self.beta_vane_m) or self.beta_vane_sidewash != 1.0 or self.beta_vane_flank


def at_center_of_gravity(record: FlightRecord, places: SensorPlaces) -> tuple[FlightRecord, tuple[str, ...]]:
    """Return the record as sensors at the center of gravity would have it, and what was changed.

    Alpha needs ``airspeed_m_s`` and ``q_rad_s`` (``p_rad_s``, ``r_rad_s`` and ``beta_rad`` count as 0 where there are
    none), the sideslip ``airspeed_m_s``, ``q_rad_s``, ``r_rad_s`` and ``alpha_rad``; the accelerations need the rates,
    and their derivatives, taken by a running parabola.

    Raises:
        RefusedError: a needed channel is missing.
    """
    changed: dict[str, FloatArray] = {}
    said = []
    if places.moves_alpha or places.moves_beta:
        changed |= _flow(record, places)
        said += [
            f"{name}: moved from the vane to the center of gravity, by up to "
            f"{np.nanmax(np.abs(values - record[name]), initial=0.0):.3g} rad"
            for name, values in changed.items()
        ]
    if any(places.accelerometer_m):
        moved = _specific_force(record, np.array(places.accelerometer_m))
        changed |= moved
        said += [
            f"{name}: moved to the center of gravity, by up to {np.nanmax(np.abs(values - record[name])):.3g} m/s²"
            for name, values in moved.items()
        ]
    return record.with_columns(**changed), tuple(said)


def _flow(record: FlightRecord, places: SensorPlaces) -> dict[str, FloatArray]:
    """Solve for alpha and sideslip at the center of gravity that make the flow at each vane what it measured."""
    first = "alpha_rad" if places.moves_alpha else "beta_rad"
    rates = np.column_stack(_rates(record, first))
    speed = _needed(record, "airspeed_m_s", first)
    if places.moves_beta:
        for name in ("alpha_rad", "beta_rad", "r_rad_s"):
            _needed(record, name, "beta_rad")
    alpha, beta = record["alpha_rad"], record.or_zero("beta_rad")
    for _ in range(_TURNS if places.moves_alpha and places.moves_beta else 1):
        if places.moves_alpha:
            alpha = _alpha(record["alpha_rad"] / places.vane_upwash, alpha, speed * np.cos(beta), rates, places.vane_m)
        if places.moves_beta:
            beta = _beta(record["beta_rad"] / places.beta_vane_sidewash, alpha, speed, rates, places)
    return {
        **({"alpha_rad": alpha} if places.moves_alpha else {}),
        **({"beta_rad": beta} if places.moves_beta else {}),
    }


def _alpha(
    there: FloatArray, guess: FloatArray, along: FloatArray, rates: FloatArray, place: tuple[float, float, float]
) -> FloatArray:
    """Solve atan2(w + (ω×r)_z, u + (ω×r)_x) = measured / upwash for alpha, by Newton's steps."""
    forward, _, down = np.cross(rates, place).T
    alpha = np.array(guess)
    for _ in range(_NEWTON):
        u, w = along * np.cos(alpha) + forward, along * np.sin(alpha) + down
        # d atan2(w, u)/d alpha = (u w' − w u') / (u² + w²)
        slope = (u * along * np.cos(alpha) + w * along * np.sin(alpha)) / (u * u + w * w)
        alpha -= (np.arctan2(w, u) - there) / slope
    return alpha


def _beta(
    there: FloatArray, alpha: FloatArray, speed: FloatArray, rates: FloatArray, places: SensorPlaces
) -> FloatArray:
    """Solve asin(v/V) at the vane, or atan(v/u), for the sideslip: v = V sin β is what the vane says less its own."""
    forward, aside, down = np.cross(rates, places.beta_vane_m).T
    beta = np.array(there)
    for _ in range(_TURNS):
        u, w = speed * np.cos(beta) * np.cos(alpha) + forward, speed * np.cos(beta) * np.sin(alpha) + down
        across = u if places.beta_vane_flank else np.hypot(u, w)
        beta = np.arcsin(np.clip((across * np.tan(there) - aside) / speed, -1.0, 1.0))
    return beta


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
