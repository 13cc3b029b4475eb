"""Coordinates of a flight for an integrator: a state of flight as an array, and the rates of that array.

``InPlane``: airspeed, alpha, q, pitch angle, altitude. ``InSpace``: airspeed, alpha, beta, p, q, r, attitude to the
local horizon as a quaternion (Euler angles fail where the nose points up or down), altitude, latitude. Longitude
changes nothing. Airspeeds and altitudes are in units of their size, so that one tolerance suits all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.flight.state import STATE_NAMES, FlightState, StateNodes

_AIRSPEED_M_S: Final = 100.0
_ALTITUDE_M: Final = 10_000.0
_SPEED, _ALPHA, _BETA, _P, _Q, _R, _PHI, _THETA = range(len(STATE_NAMES))


@final
class InPlane:
    """Of a flight in its plane of symmetry."""

    alpha: Final = 1
    q: Final = 2

    @staticmethod
    def of(state: FlightState) -> FloatArray:
        """Return the array of a state, shape (5,)."""
        speed, height = state.airspeed_m_s / _AIRSPEED_M_S, state.altitude_m / _ALTITUDE_M
        theta = state.theta_rad if abs(state.phi_rad) <= math.pi / 2 else math.pi - state.theta_rad
        return frozen_array([speed, state.alpha_rad, state.q_rad_s, theta, height])

    @staticmethod
    def near(array: FloatArray, other: FloatArray) -> FloatArray:
        """Return the array of the same state that is next to another one: pitch angles may differ by turns."""
        turns = np.zeros(array.size)
        turns[3] = 2.0 * math.pi * round((other[3] - array[3]) / (2.0 * math.pi))
        return array + turns

    @staticmethod
    def state(array: FloatArray) -> FlightState:
        """Return the state of an array."""
        speed, alpha, q, theta, height = array.tolist()
        return FlightState(
            airspeed_m_s=speed * _AIRSPEED_M_S,
            alpha_rad=alpha,
            q_rad_s=q,
            theta_rad=theta,
            altitude_m=height * _ALTITUDE_M,
        )

    @staticmethod
    def rates(_: FloatArray, rates: Sequence[float], state: FlightState, nodes: StateNodes) -> FloatArray:
        """Return the rates of the array.

        Args:
            _: the array.
            rates: of ``STATE_NAMES``.
            state: of flight.
            nodes: of the simulator, which has just been evaluated there.
        """
        climb = nodes.travel(state)[0] / _ALTITUDE_M
        pitching = nodes.turning(state)[1]  # through the vertical, too, where roll folds
        return np.array([rates[_SPEED] / _AIRSPEED_M_S, rates[_ALPHA], rates[_Q], pitching, climb])


@final
class InSpace:
    """Of a flight in all six degrees of freedom."""

    alpha: Final = 1
    q: Final = 4

    @staticmethod
    def of(state: FlightState) -> FloatArray:
        """Return the array of a state, shape (12,)."""
        turn = np.array([1.0, 0.0, 0.0, 0.0])
        for axis, angle in ((2, state.psi_rad), (1, state.theta_rad), (0, state.phi_rad)):
            about = np.zeros(4)
            about[0], about[1 + axis] = math.cos(0.5 * angle), math.sin(0.5 * angle)
            turn = _product(turn, about)
        flow = (state.airspeed_m_s / _AIRSPEED_M_S, state.alpha_rad, state.beta_rad)
        spin = (state.p_rad_s, state.q_rad_s, state.r_rad_s)
        return frozen_array([*flow, *spin, *turn, state.altitude_m / _ALTITUDE_M, state.latitude_rad])

    @staticmethod
    def near(array: FloatArray, other: FloatArray) -> FloatArray:
        """Return the array of the same state that is next to another one: a quaternion and its negative are one."""
        found = array.copy()
        found[6:10] *= math.copysign(1.0, float(array[6:10] @ other[6:10]))
        return found

    @staticmethod
    def state(array: FloatArray) -> FlightState:
        """Return the state of an array."""
        speed, alpha, beta, p, q, r, a, b, c, d, height, latitude = array.tolist()
        size = a * a + b * b + c * c + d * d
        return FlightState(
            airspeed_m_s=speed * _AIRSPEED_M_S,
            alpha_rad=alpha,
            beta_rad=beta,
            p_rad_s=p,
            q_rad_s=q,
            r_rad_s=r,
            phi_rad=math.atan2(2.0 * (a * b + c * d), a * a - b * b - c * c + d * d),
            theta_rad=math.asin(max(-1.0, min(1.0, 2.0 * (a * c - b * d) / size))),
            psi_rad=math.atan2(2.0 * (a * d + b * c), a * a + b * b - c * c - d * d),
            altitude_m=height * _ALTITUDE_M,
            latitude_rad=latitude,
        )

    @staticmethod
    def rates(array: FloatArray, rates: Sequence[float], state: FlightState, nodes: StateNodes) -> FloatArray:
        """Return the rates of the array.

        Args:
            array: the array.
            rates: of ``STATE_NAMES``.
            state: of flight.
            nodes: of the simulator, which has just been evaluated there.
        """
        climb, northward = nodes.travel(state)
        turning = 0.5 * _product(array[6:10], np.array([0.0, *nodes.turning(state)]))
        flow = (rates[_SPEED] / _AIRSPEED_M_S, rates[_ALPHA], rates[_BETA])
        return np.array([*flow, rates[_P], rates[_Q], rates[_R], *turning, climb / _ALTITUDE_M, northward])


def _product(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the product of two quaternions, scalar first."""
    a, b, c, d = one.tolist()
    e, f, g, h = other.tolist()
    return np.array(
        [
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ]
    )
