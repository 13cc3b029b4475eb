"""A simulator's state of flight: putting it there, and its rates, in SI.

Airspeed, alpha and beta are of still air; attitude is to the local horizon, which turns below a vehicle that moves
over a round planet. JSBSim's own rates of the Euler angles leave that out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

from finback.flight.planet import planet_of
from finback.flight.simulator import Simulator
from finback.units import from_si, to_si

STATE_NAMES: Final = (
    "airspeed_m_s",
    "alpha_rad",
    "beta_rad",
    "p_rad_s",
    "q_rad_s",
    "r_rad_s",
    "phi_rad",
    "theta_rad",
)
"""What the numbers of a state are, in the order of ``StateNodes.rates``."""

_ATTITUDE: Final = ("ic/phi-rad", "ic/theta-rad", "ic/psi-true-rad")
_VELOCITY: Final = ("ic/u-fps", "ic/v-fps", "ic/w-fps")
_RATES: Final = ("ic/p-rad_sec", "ic/q-rad_sec", "ic/r-rad_sec")
ANGLES_AND_RATES: Final = (
    ("alpha_rad", "aero/alpha-rad", "rad"),
    ("beta_rad", "aero/beta-rad", "rad"),
    ("p_rad_s", "velocities/p-rad_sec", "rad_s"),
    ("q_rad_s", "velocities/q-rad_sec", "rad_s"),
    ("r_rad_s", "velocities/r-rad_sec", "rad_s"),
    ("phi_rad", "attitude/phi-rad", "rad"),
    ("theta_rad", "attitude/theta-rad", "rad"),
    ("psi_rad", "attitude/psi-rad", "rad"),
)
"""Channel, JSBSim's property and its unit, of what turns."""
AIRSPEED: Final = ("airspeed_m_s", "velocities/vtrue-fps", "ft_s")
"""The same of the airspeed."""
ALTITUDE: Final = ("altitude_m", "position/h-sl-ft", "ft")
"""The same of the altitude above mean sea level."""
_READ: Final = (
    AIRSPEED,
    *ANGLES_AND_RATES,
    ALTITUDE,
    ("latitude_rad", "position/lat-geod-rad", "rad"),
)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlightState:
    """A state of flight in still air.

    Attributes:
        airspeed_m_s: true airspeed.
        alpha_rad: angle of attack.
        beta_rad: sideslip.
        p_rad_s: roll rate.
        q_rad_s: pitch rate.
        r_rad_s: yaw rate.
        phi_rad: roll angle.
        theta_rad: pitch angle.
        psi_rad: heading.
        altitude_m: geometric altitude.
        latitude_rad: geodetic latitude.
    """

    airspeed_m_s: float
    alpha_rad: float
    beta_rad: float = 0.0
    p_rad_s: float = 0.0
    q_rad_s: float = 0.0
    r_rad_s: float = 0.0
    phi_rad: float = 0.0
    theta_rad: float = 0.0
    psi_rad: float = 0.0
    altitude_m: float = 0.0
    latitude_rad: float = 0.0


@final
class StateNodes:
    """The properties of a simulator that set and tell its state.

    Args:
        simulator: with a model loaded.
    """

    def __init__(self, simulator: Simulator) -> None:
        self._attitude = tuple(simulator.setter(name) for name in _ATTITUDE)
        self._velocity = tuple(simulator.setter(name) for name in _VELOCITY)
        self._turning = tuple(simulator.setter(name) for name in _RATES)
        self._altitude = simulator.setter("ic/h-sl-ft")
        self._latitude = simulator.setter("ic/lat-geod-rad")
        get = simulator.getter
        self._accelerations = tuple(get(f"accelerations/{axis}dot-ft_sec2") for axis in "uvw")
        self._angular = tuple(get(f"accelerations/{axis}dot-rad_sec2") for axis in "pqr")
        self._north, self._east = get("velocities/v-north-fps"), get("velocities/v-east-fps")
        self._down = get("velocities/v-down-fps")
        self._planet = planet_of(simulator.path)
        self._read = tuple((name, get(node), unit) for name, node, unit in _READ)

    def state(self) -> FlightState:
        """Return the state where the simulator is, in still air; angles as JSBSim folds them."""
        return FlightState(**{name: to_si(read(), unit) for name, read, unit in self._read})

    def place(self, state: FlightState) -> None:
        """Write an initial condition; the simulator is there after its next start or evaluation.

        JSBSim changes one number of a condition at a time, by turns and conversions that round. So everything is first
        made zero, attitude twice (an angle may leave 1e-17 in another), where these are exact: nothing of earlier
        flights is left, not a bit.
        """
        for put in (*self._attitude, *self._attitude, *self._velocity, self._altitude, self._latitude):
            put(0.0)
        self._latitude(state.latitude_rad)
        self._altitude(from_si(state.altitude_m, "ft"))
        for put in self._velocity:
            put(0.0)
        for put, angle in zip(self._attitude, (state.phi_rad, state.theta_rad, state.psi_rad), strict=True):
            put(angle)
        speed = from_si(state.airspeed_m_s, "ft_s")
        for put, share in zip(self._velocity, _direction(state.alpha_rad, state.beta_rad), strict=True):
            put(speed * share)
        for put, rate in zip(self._turning, (state.p_rad_s, state.q_rad_s, state.r_rad_s), strict=True):
            put(rate)

    def rates(self, state: FlightState) -> tuple[float, ...]:
        """Return the rates of ``STATE_NAMES`` in SI, at a state that the simulator has just evaluated."""
        u, v, w = _direction(state.alpha_rad, state.beta_rad)
        u_dot, v_dot, w_dot = (get() for get in self._accelerations)
        speed = from_si(state.airspeed_m_s, "ft_s")
        in_plane = u * u + w * w
        forward = u * u_dot + w * w_dot
        p_dot, q_dot, r_dot = (get() for get in self._angular)
        phi_dot, theta_dot = self._tilting(state)
        return (
            to_si(forward + v * v_dot, "ft_s"),
            (u * w_dot - w * u_dot) / (in_plane * speed),
            (v_dot * in_plane - v * forward) / (math.sqrt(in_plane) * speed),
            p_dot,
            q_dot,
            r_dot,
            phi_dot,
            theta_dot,
        )

    def travel(self, state: FlightState) -> tuple[float, float]:
        """Return the rates of altitude (m/s) and latitude (rad/s) at a state that has just been evaluated."""
        return to_si(-self._down(), "ft_s"), self._north() / self._radii(state)[0]

    def _radii(self, state: FlightState) -> tuple[float, float]:
        """Return the radii, in ft, on which it moves north and east around the planet."""
        along, across = self._planet.radii_ft(state.latitude_rad)
        height = from_si(state.altitude_m, "ft")
        return along + height, across + height

    def turning(self, state: FlightState) -> tuple[float, float, float]:
        """Return the rates of rotation to the local horizon, which turns as the vehicle moves on, about body axes."""
        meridian, circle = self._radii(state)
        across, along = self._east() / circle, -self._north() / meridian  # of the horizon, about north and east
        down = -across * math.tan(state.latitude_rad)
        sin_phi, cos_phi = math.sin(state.phi_rad), math.cos(state.phi_rad)
        sin_theta, cos_theta = math.sin(state.theta_rad), math.cos(state.theta_rad)
        sin_psi, cos_psi = math.sin(state.psi_rad), math.cos(state.psi_rad)
        level = across * cos_psi + along * sin_psi
        side = along * cos_psi - across * sin_psi
        p = state.p_rad_s - (cos_theta * level - sin_theta * down)
        ahead = sin_theta * level + cos_theta * down
        q = state.q_rad_s - (cos_phi * side + sin_phi * ahead)
        r = state.r_rad_s - (cos_phi * ahead - sin_phi * side)
        return p, q, r

    def _tilting(self, state: FlightState) -> tuple[float, float]:
        """Return the rates of roll and pitch angle to the local horizon."""
        p, q, r = self.turning(state)
        sin_phi, cos_phi = math.sin(state.phi_rad), math.cos(state.phi_rad)
        turning = q * sin_phi + r * cos_phi
        return p + turning * math.tan(state.theta_rad), q * cos_phi - r * sin_phi


def _direction(alpha_rad: float, beta_rad: float) -> tuple[float, float, float]:
    """Return the velocity in body axes as shares of the airspeed."""
    level = math.cos(beta_rad)
    return math.cos(alpha_rad) * level, math.sin(beta_rad), math.sin(alpha_rad) * level
