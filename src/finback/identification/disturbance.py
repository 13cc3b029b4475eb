"""Noise on the rates themselves: what neither the model nor the noise of the sensors explains of the weak equations.

Residuals far beyond the noise of the sensors are gusts, or what the model misses. Weighted as if they were noise of
alpha and q, they would count as errors of the slow motion only, and a smoother that trusts the model would bend the
states towards it: in gusts these two drive each other away from the data. As noise on the rates they weight all
frequencies alike, and the states stay at the measurements.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.identification.weak_form import WeakForm
from finback.identification.whitening import NO_PROCESS

_MEMORY: Final = 2.5
"""How long the smoother trusts the model, in half widths; between 1.25 and 5 no error changes by 1 %."""
BEYOND_NOISE: Final = 4.0
"""Mean square of whitened residuals from which they are no noise of the sensors: twice as large."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """White noise on both rates.

    Attributes:
        densities: on dα/dt in rad²/s and dq/dt in rad²/s³, shape (2,); 0 without any.
        excess: mean square of the residuals over that of the sensors' noise, the mean of both equations; 1 without any.
    """

    densities: FloatArray = field(default_factory=lambda: NO_PROCESS)
    excess: float = 1.0


def disturbance(
    forms: Sequence[WeakForm],
    coefficients: FloatArray,
    states: Sequence[FloatArray],
    noise: FloatArray,
) -> Disturbance:
    """Return the noise on the rates that makes the residuals of the weak equations as large as they are.

    Args:
        forms: the weak equations of every stretch.
        coefficients: of the model, in SI, shape (p,).
        states: about which they are linearized, shape (n, 2) each.
        noise: standard deviations of alpha in rad and q in rad/s, shape (2,).
    """
    squares, sensors = [], []
    for weak, state in zip(forms, states, strict=True):
        sides = weak.sides(coefficients, state)
        squares.append((weak.target(sides, state) - weak.regressors(sides) @ coefficients) ** 2)
        sensors.append((weak.noise_rows(sides, noise) ** 2).sum(axis=(2, 3)))
    found, explained = np.concatenate(squares).mean(axis=0), np.concatenate(sensors).mean(axis=0)
    # White noise of density g on a rate gives g ∫w² to its equation.
    bump, interval = forms[0].bump, forms[0].stretch.interval_s
    densities = np.maximum(found - explained, 0.0) * interval / float((bump.value**2).sum())
    return Disturbance(densities=densities, excess=max(1.0, float((found / explained).mean())))


def memory(weak: WeakForm, noise: FloatArray, rates: Disturbance, *, half_width_s: float, variance: float) -> float:
    """Return how long the smoother may trust a model, in s.

    Args:
        weak: any of the weak equations.
        noise: standard deviations of alpha in rad and q in rad/s, shape (2,).
        rates: the noise on the rates.
        half_width_s: half width of the test functions in s.
        variance: mean square of the whitened residuals.
    """
    # A model that misses by s deviations of the noise is trusted s times shorter, so it cannot bend the states.
    longest = _MEMORY * half_width_s / math.sqrt(max(1.0, variance))
    # White noise of density g on a rate is what the smoother lets it have: (noise · interval / memory)² = g · interval.
    densities = np.maximum(rates.densities, np.finfo(np.float64).tiny)
    known = np.sqrt(noise**2 * weak.stretch.interval_s / densities)
    return min(longest, float(known.min()))
