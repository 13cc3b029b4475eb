"""What a flight in the air feels at its start: the air's density, and the gravity of its planet.

A study's condition says those of the rig. Gravity is what a flat Earth at rest must have for the same rate of alpha:
less than standard by height and latitude, and by the turning of the planet, 9.771 m/s² at 3 km over the equator. What
turns the horizon below a path (V/r) is none of it: that is in the pitch angle.
"""

from __future__ import annotations

import math
from typing import Final

from finback.flight.simulator import Simulator
from finback.units import to_si

FELT_GRAVITY: Final = "felt_gravity_m_s2"
"""Key in a flight's provenance, unless it began steeply."""
FELT_DENSITY: Final = "felt_density_kg_m3"
"""Key in a flight's provenance: of the air at its start."""
FELT_ALTITUDE: Final = "felt_altitude_m"
"""Key in a flight's provenance: where that is."""
_STEEPEST: Final = 0.2  # share of gravity across the path below which nothing is said of it
_NAMES: Final = (
    *(f"velocities/{axis}-fps" for axis in "uvw"),
    *(f"velocities/{axis}-rad_sec" for axis in "pqr"),
    "accelerations/udot-ft_sec2",
    "accelerations/wdot-ft_sec2",
    "forces/fbx-total-lbs",
    "forces/fbz-total-lbs",
    "inertia/mass-slugs",
    "attitude/theta-rad",
    "attitude/phi-rad",
)


def felt(simulator: Simulator) -> dict[str, str]:
    """Return density, altitude and gravity where a simulator is, as provenance; no gravity on a vertical path."""
    density, altitude = simulator.read(("atmosphere/rho-slugs_ft3", "position/h-sl-ft")).values()
    found = {FELT_DENSITY: to_si(density, "slug_ft3"), FELT_ALTITUDE: to_si(altitude, "ft"), **_gravity(simulator)}
    return {name: repr(value) for name, value in found.items()}


def _gravity(simulator: Simulator) -> dict[str, float]:
    """Return the gravity across the path, made that of level flight.

    It is what the acceleration is beyond specific forces and body rates: along body z and x, turned by alpha.
    """
    u, v, w, p, q, r, u_dot, w_dot, force_x, force_z, mass, theta, phi = simulator.read(_NAMES).values()
    down = w_dot - force_z / mass - q * u + p * v
    forward = u_dot - force_x / mass - r * v + q * w
    speed = math.hypot(u, w)
    if not speed > 0.0:
        return {}
    sine, cosine = w / speed, u / speed
    share = cosine * math.cos(phi) * math.cos(theta) + sine * math.sin(theta)
    if abs(share) < _STEEPEST:
        return {}
    return {FELT_GRAVITY: to_si((down * cosine - forward * sine) / share, "ft_s2")}
