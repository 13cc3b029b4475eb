"""Gusts with Dryden spectra along a flight, seeded: MIL-F-8785C, section 3.7, at medium and high altitude.

Longitudinal gusts have the spectrum 2 σ² L/π / (1 + (L Ω)²), lateral and vertical ones σ² L/π (1 + 3 (L Ω)²) /
(1 + (L Ω)²)², per wave number Ω > 0. The air is frozen and flown through at the airspeed of the start. Each gust comes
of white noise by the exact discretization of its filter, so that variance and correlation are right at any step, and
begins in the stationary state. The gradient of the gusts over the airframe (roll gusts and the like) is left out.
"""

from __future__ import annotations

import math

import numpy as np

from finback.arrays import FloatArray
from finback.flight.air import DrydenAir


def dryden_gusts(air: DrydenAir, *, airspeed_m_s: float, step_s: float, steps: int) -> FloatArray:
    """Return gusts along, across (to the right) and down of the level line of flight, in m/s, shape (steps + 1, 3).

    Args:
        air: intensity, scale length, seed.
        airspeed_m_s: at which the frozen air is flown through.
        step_s: time between two rows.
        steps: number of steps.
    """
    random = np.random.default_rng(air.seed)
    time_s = air.length_m / airspeed_m_s
    unit = [
        _along(random.standard_normal(steps + 1), time_s, step_s),
        _across(random.standard_normal((steps + 1, 2)), time_s, step_s),
        _across(random.standard_normal((steps + 1, 2)), time_s, step_s),
    ]
    return air.intensity_m_s * np.column_stack(unit)


def _along(noise: FloatArray, time_s: float, step_s: float) -> FloatArray:
    """Return a stationary process of unit variance with the correlation exp(-t / time)."""
    from scipy.signal import lfilter  # noqa: PLC0415 - a second that only turbulent air needs

    stays = math.exp(-step_s / time_s)
    driven = math.sqrt(1.0 - stays * stays) * noise
    driven[0] = noise[0]
    found: FloatArray = lfilter([1.0], [1.0, -stays], driven)
    return found


def _across(noise: FloatArray, time_s: float, step_s: float) -> FloatArray:
    """Return a stationary process of unit variance with the spectrum of (1 + √3 T s) / (1 + T s)²."""
    from scipy.linalg import cholesky, expm, solve_continuous_lyapunov  # noqa: PLC0415 - as above

    scale = 1.0 / time_s
    # dx/dt = A x + b w in units of T; the output is x0 + √3 x1.
    matrix = scale * np.array([[0.0, 1.0], [-1.0, -2.0]])
    strength = scale * np.array([[0.0, 0.0], [0.0, 1.0]])
    stationary = solve_continuous_lyapunov(matrix, -strength)
    output = np.array([1.0, math.sqrt(3.0)])
    output = output / math.sqrt(output @ stationary @ output)
    move = expm(matrix * step_s)
    added = stationary - move @ stationary @ move.T
    spread = np.linalg.eigh(0.5 * (added + added.T))
    driven = noise @ (spread.eigenvectors * np.sqrt(np.maximum(spread.eigenvalues, 0.0))).T
    driven[0] = cholesky(stationary, lower=True) @ noise[0]
    state, found = np.zeros(2), np.empty(len(noise))
    for row, kick in enumerate(driven):
        state = (move @ state if row else state) + kick
        found[row] = output @ state
    return found
