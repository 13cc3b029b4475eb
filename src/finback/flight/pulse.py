"""Multisteps matched to a mode: the unit of time that puts most of the input's energy into it."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import InputError
from finback.flight.excitation import ThreeTwoOneOne

DOUBLET: Final = (1, 1)
THREE_TWO_ONE_ONE: Final = (3, 2, 1, 1)
_SHORTEST: Final = 0.1
_LONGEST: Final = 5.0
"""Units that are looked at, over the time of one radian of the mode; the best ones are at 1.7 to 2.8."""
_GRID: Final = 500


def matched_unit(*, frequency_rad_s: float, damping_ratio: float, pulses: tuple[int, ...] = THREE_TWO_ONE_ONE) -> float:
    """Return the unit of time, in s, for which a multistep moves a mode most.

    The mode's rate answers each edge with the impulse response of 1/(s² + 2ζωs + ω²); the sum of these answers has an
    energy, which is compared with that of the input itself. The best unit is close to the rules of thumb 2.1/ω for a
    3-2-1-1 and 2.3/ω for a doublet (Jategaonkar 2006, chapter 2).

    Args:
        frequency_rad_s: undamped natural frequency of the mode, > 0.
        damping_ratio: of the mode, 0 <= ζ < 1.
        pulses: lengths of the pulses in units, of alternating sign, at least one.

    Raises:
        InputError: a number is out of its range.
    """
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 - a quarter of a second that only this needs

    if not (0 < frequency_rad_s < math.inf and 0 <= damping_ratio < 1):
        raise InputError(
            f"no oscillating mode has {frequency_rad_s:g} rad/s and a damping ratio of {damping_ratio:g}",
            hint="give a positive frequency and a damping ratio in 0…1",
        )
    if not pulses or any(length < 1 for length in pulses):
        raise InputError(f"a multistep has pulses of whole units, got {pulses}")
    units = np.linspace(_SHORTEST, _LONGEST, _GRID)
    shares = [energy_share(float(unit), damping_ratio=damping_ratio, pulses=pulses) for unit in units]
    best = int(np.argmax(shares))
    low, high = units[max(best - 1, 0)], units[min(best + 1, _GRID - 1)]
    found = minimize_scalar(
        lambda unit: -energy_share(unit, damping_ratio=damping_ratio, pulses=pulses),
        bounds=(float(low), float(high)),
        method="bounded",
        options={"xatol": 1e-8},
    )
    return float(found.x) / frequency_rad_s


def matched_three_two_one_one(
    *,
    elevator_rad: float,
    amplitude_rad: float,
    frequency_rad_s: float,
    damping_1: float,
    lead_s: float,
    duration_s: float,
) -> ThreeTwoOneOne:
    """Return the 3-2-1-1 whose unit is matched to a mode.

    Args:
        elevator_rad: as of ``ThreeTwoOneOne``, like all others but the mode's.
        amplitude_rad: see there.
        frequency_rad_s: undamped natural frequency of the mode.
        damping_1: its damping ratio.
        lead_s: see there.
        duration_s: see there.
    """
    return ThreeTwoOneOne(
        elevator_rad=elevator_rad,
        amplitude_rad=amplitude_rad,
        unit_s=matched_unit(frequency_rad_s=frequency_rad_s, damping_ratio=damping_1),
        lead_s=lead_s,
        duration_s=duration_s,
    )


def energy_share(unit: float, *, damping_ratio: float, pulses: tuple[int, ...]) -> float:
    """Return the energy of a mode's rate over that of a multistep, both up to one constant.

    Args:
        unit: of time, times the mode's frequency.
        damping_ratio: 0 <= ζ < 1.
        pulses: lengths in units, of alternating sign.
    """
    levels = [0.0, *((-1.0) ** k for k in range(len(pulses))), 0.0]
    edges = np.array([after - before for before, after in pairwise(levels)])
    times = unit * np.concatenate([[0.0], np.cumsum(np.array(pulses, dtype=np.float64))])
    distance = np.abs(times[:, np.newaxis] - times)
    return float(edges @ _autocorrelation(distance, damping_ratio) @ edges) / (unit * sum(pulses))


def _autocorrelation(lag: FloatArray, damping_ratio: float) -> FloatArray:
    """Return that of the impulse response of 1/(s² + 2ζs + 1), over its value at 0."""
    damped = math.sqrt(1 - damping_ratio**2)
    phase: FloatArray = damped * lag
    result: FloatArray = np.exp(-damping_ratio * lag) * (np.cos(phase) + damping_ratio / damped * np.sin(phase))
    return result
