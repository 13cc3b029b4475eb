"""Does alpha fluctuate beyond the white noise of its sensor, and does the aircraft feel it?

A Kalman filter runs along the motion beside the model, with white and colored noise of both sensors (the latter an
Ornstein-Uhlenbeck process each), and white noise on dα/dt and dq/dt that grows with the rates: what a model misses.
The fluctuation of alpha is either of the sensor alone, or of the air: then it is alpha, as lift and moment feel it.
All variances are those of the greatest likelihood. The two have as many unknowns, so their likelihoods compare.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from finback.arrays import FloatArray
from finback.dynamics.compiled import compiled
from finback.identification.suspicions.motion import Motion

# Logarithms of: variances of a block's white noise (2) and of the colored noise (2), densities of what the model misses
# (2), density of noise on dq/dt, all in units of the sensors' white noise and seconds; correlation times in s (2).
_LOW: Final = np.array([-3.0, -3.0, -10.0, -10.0, -10.0, -10.0, -10.0, np.log(0.08), np.log(0.08)])
_HIGH: Final = np.array([3.0, 3.0, 12.0, 12.0, 12.0, 12.0, 12.0, np.log(3.0), np.log(3.0)])
_START: Final = np.array([0.0, 0.0, 0.0, -1.0, -1.0, -1.0, -1.0, np.log(0.5), np.log(0.5)])
_ALPHA: Final = 2  # place of the variance of alpha's fluctuation
_ALPHA_TIME: Final = 7  # place of its correlation time
_NONE: Final = -60.0
_STEP: Final = 1e-2  # of a logarithm, for differences
_ITERATIONS: Final = 60
_IMPOSSIBLE: Final = 1e12  # cost of variances that leave double precision
_UNKNOWN: Final = 1e4  # variance of a start, in units of the noise


@final
class Fluctuation(IntEnum):
    """Where alpha fluctuates beyond white noise."""

    NONE = 0
    SENSOR = 1
    AIR = 2


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Likelihood:
    """How likely a motion is under one cause.

    Attributes:
        cost: twice the negative logarithm of the likelihood, but for a constant; inf where no variances were found
            under which the filter stays within double precision.
        deviation_rad: standard deviation of the fluctuation of alpha.
        time_s: its correlation time.
    """

    cost: float
    deviation_rad: float
    time_s: float


def likelihood(motion: Motion, cause: Fluctuation) -> Likelihood:
    """Return the greatest likelihood of a motion under a cause of alpha's fluctuation."""
    free = np.array(
        [place for place in range(_START.size) if cause is not Fluctuation.NONE or place not in (_ALPHA, _ALPHA_TIME)]
    )
    scale = np.array([*motion.variance, *motion.variance, *motion.variance, motion.variance[1], 1.0, 1.0])
    every = _START.copy()
    every[_ALPHA] = _NONE

    def cost(values: FloatArray) -> float:
        every[free] = values
        found = float(_cost(motion.measured, motion.drive, motion.transition, motion.activity, motion.fresh,
                           motion.interval_s, scale * np.exp(every), cause == Fluctuation.AIR))  # fmt: skip
        return found if np.isfinite(found) else _IMPOSSIBLE

    def with_slope(values: FloatArray) -> tuple[float, FloatArray]:
        here = cost(values)
        slope = np.array([cost(values + step) - here for step in _STEP * np.eye(free.size)]) / _STEP
        return here / len(motion.measured), slope / len(motion.measured)

    bounds = np.stack([_LOW, _HIGH], axis=1)[free]
    found = minimize(
        with_slope,
        _START[free],
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": _ITERATIONS, "ftol": 1e-6, "gtol": 1e-5},
    )
    least = cost(found.x)
    return Likelihood(
        cost=least if least < _IMPOSSIBLE else np.inf,
        deviation_rad=float(np.sqrt(scale[_ALPHA] * np.exp(every[_ALPHA]))),
        time_s=float(np.exp(every[7])),
    )


@compiled
def _cost(  # noqa: PLR0913, PLR0917, C901, PLR0912 - one loop, which compiles faster than its parts
    measured: FloatArray,
    drive: FloatArray,
    transition: FloatArray,
    activity: FloatArray,
    fresh: NDArray[np.bool_],
    interval: float,
    values: FloatArray,
    felt: bool,  # noqa: FBT001 - a kernel takes no keywords
) -> float:
    """Filter the states alpha, q, the fluctuation of alpha, colored noise of q; alpha holds the first if it is felt."""
    stays, keeps = np.exp(-interval / values[7]), np.exp(-interval / values[8])
    state, gain = np.zeros(4), np.zeros(4)
    spread, moved, move, weight = np.zeros((4, 4)), np.zeros((4, 4)), np.zeros((4, 4)), np.zeros(4)
    move[2, 2], move[3, 3] = stays, keeps
    shown = np.zeros((2, 4))
    shown[0, 0], shown[1, 1], shown[1, 3] = 1.0, 1.0, 1.0
    if felt:
        move[0, 2] = stays - 1.0
    else:
        shown[0, 2] = 1.0
    total = 0.0
    for i in range(measured.shape[0]):
        if fresh[i]:
            state[:] = 0.0
            spread[:] = 0.0
            spread[0, 0], spread[1, 1] = _UNKNOWN * values[0], _UNKNOWN * values[1]
            spread[2, 2], spread[3, 3] = values[2], values[3]
        else:
            move[:2, :2] = transition[i - 1]
            for a in range(4):
                gain[a] = 0.0
                for b in range(4):
                    gain[a] += move[a, b] * state[b]
                    moved[a, b] = 0.0
                    for c in range(4):
                        moved[a, b] += move[a, c] * spread[c, b]
            for a in range(4):
                state[a] = gain[a] + (drive[i - 1, a] if a < 2 else 0.0)
                for b in range(a + 1):
                    spread[a, b] = 0.0
                    for c in range(4):
                        spread[a, b] += moved[a, c] * move[b, c]
                    spread[b, a] = spread[a, b]
            fluctuates = (1.0 - stays * stays) * values[2]
            spread[0, 0] += interval * values[4] * activity[i - 1, 0]
            spread[1, 1] += interval * (values[5] * activity[i - 1, 1] + values[6])
            spread[2, 2] += fluctuates
            spread[3, 3] += (1.0 - keeps * keeps) * values[3]
            if felt:
                spread[0, 0] += fluctuates
                spread[0, 2] += fluctuates
                spread[2, 0] += fluctuates
        for channel in range(2):
            error, variance = measured[i, channel], values[channel]
            for a in range(4):
                error -= shown[channel, a] * state[a]
                gain[a] = 0.0
                for b in range(4):
                    gain[a] += spread[a, b] * shown[channel, b]
            for a in range(4):
                variance += shown[channel, a] * gain[a]
            if not variance > 0.0:
                return np.inf
            total += np.log(variance) + error * error / variance
            # (I - w s) P (I - w s)ᵀ + r w wᵀ (Bucy & Joseph 1968), and symmetric: P - w (P s)ᵀ loses its sign by
            # rounding where P has just grown fast.
            for a in range(4):
                weight[a] = gain[a] / variance
                state[a] += weight[a] * error
            for a in range(4):
                for b in range(4):
                    moved[a, b] = spread[a, b] - weight[a] * gain[b]
            for a in range(4):
                gain[a] = 0.0
                for b in range(4):
                    gain[a] += moved[a, b] * shown[channel, b]
            for a in range(4):
                for b in range(a + 1):
                    spread[a, b] = moved[a, b] - gain[a] * weight[b] + values[channel] * weight[a] * weight[b]
                    spread[b, a] = spread[a, b]
    return total
