"""How a flight begins, apart from angle of attack and pitch rate: as much of it as its fidelity has.

The rig holds everything else, so it knows ``LevelStart`` only; ``symmetric`` takes the first two, ``free`` all three.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Final, final

from finback.errors import InputError
from finback.units import from_si

_RIGHT_ANGLE: Final = math.pi / 2


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LevelStart:
    """At the airspeed and altitude of the reference flight, on a level path northward (pitch angle = alpha)."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SymmetricStart:
    """In the plane of symmetry, wings level, northward.

    Attributes:
        theta_rad: pitch angle, inside ±π/2.
        airspeed_m_s: true airspeed, > 0.
        altitude_m: geometric altitude.
    """

    theta_rad: float
    airspeed_m_s: float
    altitude_m: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FreeStart:
    """Any state of flight over the turning Earth.

    Attributes:
        theta_rad: pitch angle, inside ±π/2.
        airspeed_m_s: true airspeed, > 0.
        altitude_m: geometric altitude.
        beta_rad: sideslip, wind from the right > 0, inside ±π/2.
        phi_rad: roll angle, right wing down > 0.
        psi_rad: heading, from north to east.
        p_rad_s: roll rate.
        r_rad_s: yaw rate.
        latitude_rad: geodetic latitude, north > 0.
    """

    theta_rad: float
    airspeed_m_s: float
    altitude_m: float
    beta_rad: float = 0.0
    phi_rad: float = 0.0
    psi_rad: float = 0.0
    p_rad_s: float = 0.0
    r_rad_s: float = 0.0
    latitude_rad: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)
        _inside("beta", self.beta_rad)
        _inside("latitude", self.latitude_rad)


Start = LevelStart | SymmetricStart | FreeStart
"""Any start."""

LEVEL: Final = LevelStart()
"""The start of most flights."""


def _check(start: SymmetricStart | FreeStart) -> None:
    for part in fields(start):
        value = getattr(start, part.name)
        if not math.isfinite(value):
            raise InputError(f"start of a flight: {part.name} is not a finite number: {value}")
    if start.airspeed_m_s <= 0:
        raise InputError(f"start of a flight: airspeed_m_s must be positive, got {start.airspeed_m_s:g}")
    _inside("theta", start.theta_rad)


def _inside(name: str, angle_rad: float) -> None:
    if not abs(angle_rad) < _RIGHT_ANGLE:
        raise InputError(f"start of a flight: {name} must lie inside ±90 deg, got {from_si(angle_rad, 'deg'):.6g} deg")
