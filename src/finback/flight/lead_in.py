"""A start with a past: the steps before t = 0 that a multistep integrator needs.

JSBSim takes the first derivative as all of a flight's past (FGPropagate::InitializeDerivatives), so Adams-Bashforth
begins with a step of Euler's: h²/2 times the rate of the rates, of which h²/12 stay. Its past cannot be written. So a
flight begins some steps early, on its own solution followed backward, elevator held, where the steps of a poor past lie
before t = 0; that beginning is moved until the state at t = 0 is the one asked for. (Hairer, Nørsett, Wanner, Solving
Ordinary Differential Equations I, section III.1: the starting procedure has to be as good as the method.)

Flights that remember more than a state (flight control, actuators, engines under a throttle, what is read a frame late)
begin as JSBSim begins them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from finback.arrays import FloatArray

STEPS: Final = 6
"""Before t = 0: three until the error of the poor past stands still, three for the past that the method remembers."""
_PASSES: Final = 6  # each makes the miss some (h times the fastest eigenvalue)² of what it was; three are usual
_MISS: Final = 5e-13  # rad, rad/s and the like; a place on a planet is rounded to 1e-9 m, which is 1e-13 of 1e4 m


def lead_in(
    wanted: FloatArray,
    rates: Callable[[FloatArray], FloatArray],
    flown: Callable[[FloatArray], FloatArray],
    *,
    step_s: float,
) -> bool:
    """Bring a simulator to a state with the past of a flight through it.

    Args:
        wanted: state at t = 0, shape (n,); airspeeds and the like in units of their size.
        rates: state -> its rates, shape (n,); no time passes.
        flown: starts at a state, makes ``STEPS`` steps, and returns where they led.
        step_s: of the integration.

    Returns:
        Whether it is there. If not, the flight needs no past, as its rates stay what they are to the last bit of a
        state, or has none: its own solution does not go back that far.
    """
    aim = wanted
    for _ in range(_PASSES):
        first = rates(aim)
        half = rates(aim - 0.5 * STEPS * step_s * first)
        if aim is wanted and step_s * np.abs(half - first).max() <= np.finfo(np.float64).eps:
            return False
        begin = _back(aim, first, half, rates, STEPS * step_s)
        if not np.isfinite(begin).all():
            return False
        miss = flown(begin) - wanted
        if not np.isfinite(miss).all():
            return False
        if np.abs(miss).max() <= _MISS:
            return True
        aim = aim - miss
    return False


def _back(
    state: FloatArray, first: FloatArray, half: FloatArray, rates: Callable[[FloatArray], FloatArray], time_s: float
) -> FloatArray:
    """Return the state some time ago, by one step of the classical Runge-Kutta method, two slopes of it given."""
    again = rates(state - 0.5 * time_s * half)
    last = rates(state - time_s * again)
    return state - time_s / 6.0 * (first + 2.0 * half + 2.0 * again + last)
