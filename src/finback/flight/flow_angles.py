"""Angles of flow and attitude in closed form: any bank, any angle of attack (Stevens, Lewis & Johnson 2016, ch. 3)."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import InputError
from finback.units import from_si

_QUARTER: Final = math.pi / 2
_SLACK: Final = 1e-12  # of a sine: what rounding may put beyond ±1


def body_to_local(phi: float, theta: float, psi: float) -> FloatArray:
    """Return the matrix from body axes to north, east, down, shape (3, 3); angles in rad."""
    (cf, ct, cp), (sf, st, sp) = ([turn(angle) for angle in (phi, theta, psi)] for turn in (math.cos, math.sin))
    return np.array(
        [
            [ct * cp, sf * st * cp - cf * sp, cf * st * cp + sf * sp],
            [ct * sp, sf * st * sp + cf * cp, cf * st * sp - sf * cp],
            [-st, sf * ct, cf * ct],
        ]
    )


def air_velocity(airspeed_m_s: float, alpha: float, beta: float) -> FloatArray:
    """Return the velocity through the air in body axes, shape (3,), in m/s; angles in rad."""
    return airspeed_m_s * np.array([math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)])


def theta_of(*, alpha: float, beta: float, phi: float, gamma: float) -> float:
    """Return the pitch angle in −π/2…π/2 that climbs at ``gamma``; all in rad.

    sin γ = a sin θ − b cos θ with a = cos α cos β, b = sin φ sin β + cos φ sin α cos β.

    Raises:
        InputError: none does.
    """
    a = math.cos(alpha) * math.cos(beta)
    b = math.sin(phi) * math.sin(beta) + math.cos(phi) * math.sin(alpha) * math.cos(beta)
    middle, reach = math.atan2(b, a), _arcsine(math.sin(gamma), math.hypot(a, b), gamma)
    turns = (math.remainder(middle + reach, math.tau), math.remainder(middle + math.pi - reach, math.tau))
    best = min(turns, key=abs)
    if abs(best) > _QUARTER + _SLACK:
        raise _impossible(gamma)
    return best


def alpha_of(*, beta: float, phi: float, theta: float, gamma: float) -> float:
    """Return the smaller angle of attack that climbs at ``gamma`` at a pitch angle; all in rad.

    Raises:
        InputError: none does.
    """
    a, b = math.cos(beta) * math.sin(theta), math.cos(beta) * math.cos(phi) * math.cos(theta)
    wanted = math.sin(gamma) + math.sin(beta) * math.sin(phi) * math.cos(theta)  # = a cos α − b sin α
    middle, reach = math.atan2(b, a), _QUARTER - _arcsine(wanted, math.hypot(a, b), gamma)
    return min((math.remainder(sign * reach - middle, math.tau) for sign in (1, -1)), key=abs)


def _arcsine(value: float, size: float, gamma: float) -> float:
    if abs(value) > size * (1.0 + _SLACK) or not size:
        raise _impossible(gamma)
    return math.asin(max(-1.0, min(1.0, value / size)))


def _impossible(gamma: float) -> InputError:
    return InputError(
        f"no attitude with these angles climbs at gamma = {from_si(gamma, 'deg'):.6g} deg",
        hint="give theta and alpha, or velocities",
    )
