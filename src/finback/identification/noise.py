"""The noise of alpha and q, from the signals alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import comb
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.identification.rounding import rounding
from finback.identification.stretch import Stretch
from finback.units import from_si

_ORDER: Final = 6
"""Of the difference: motion at 5 rad/s sampled at 25 Hz or faster leaves (5/25)⁶ = 6e-5 of its amplitude, which
counts, like noise, divided by sqrt(comb(12, 6)): 2e-6."""
_CLIP: Final = 4.0
"""Differences beyond this many standard deviations are corners and jumps of the motion, not noise."""
_CLIPPED_VARIANCE: Final = 0.99893
"""Variance of a normal variable of variance 1, given that it lies within ±4."""
_MEDIAN_OF_NORMAL: Final = 0.6744897501960817
"""Median of the absolute value of a standard normal variable."""
_RESOLUTION: Final = 1e-3
"""Share of a channel's root mean square below which not noise but the model's form and the simulator's tables limit
what a fit can know. Measured on the F-8 II: with alpha or q free of noise, intervals without it never cover."""
_CHANNELS: Final = (("alpha", "deg", "deg"), ("q", "deg_s", "deg/s"))
"""Name, unit and its sign."""
_STILL: Final = 1e-50
"""In rad and rad/s: stands for the noise of a signal that is zero throughout, so that nothing divides by zero."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Noise of (alpha in rad, q in rad/s).

    Attributes:
        found: standard deviations measured on the records, shape (2,).
        least: the least that a fit may assume, shape (2,).
        steps: to which the records are rounded, 0 where that is not seen, shape (2,).
    """

    found: FloatArray
    least: FloatArray
    steps: FloatArray = field(default_factory=lambda: frozen_array(np.zeros(2)))

    @property
    def assumed(self) -> FloatArray:
        """What the fit takes the noise for, shape (2,)."""
        return np.maximum(self.found, self.least)

    def warnings(self) -> tuple[str, ...]:
        """Name each channel that was given more noise than it has."""
        said = []
        for (name, unit, sign), found, least, step in zip(
            _CHANNELS, self.found.tolist(), self.least.tolist(), self.steps.tolist(), strict=True
        ):
            if found >= least:
                continue
            assumed = f"{from_si(least, unit):.2g} {sign}"
            if step > 0.0:
                said.append(rounded(name, f"{from_si(step, unit):.3g} {sign}", assumed))
            else:
                said.append(
                    f"{name} has {from_si(found, unit):.2g} {sign} of noise, less than {_RESOLUTION:g} of itself: "
                    f"standard errors are those of {assumed}"
                )
        return tuple(said)


def rounded(name: str, step: str, assumed: str) -> str:
    """Say that a channel is rounded more coarsely than its noise; step and noise assumed are with their unit."""
    return (
        f"{name} is rounded to steps of {step}, more than its noise: what that hides may bias the numbers; standard "
        f"errors are those of {assumed} of noise"
    )


def measured_noise(used: Sequence[Stretch]) -> Noise:
    """Measure the noise of alpha and q on all stretches together."""
    found = np.array([noise_deviation([piece.measured[:, i] for piece in used]) for i in range(2)])
    size = np.sqrt(np.mean(np.concatenate([piece.measured for piece in used]) ** 2, axis=0))
    levels = [rounding([piece.measured[:, i] for piece in used], used[0].interval_s) for i in range(2)]
    of_rounding = np.array([level.deviation for level in levels])
    resolved = np.maximum(_RESOLUTION * size, _STILL)
    return Noise(
        found=frozen_array(found),
        least=frozen_array(np.maximum(resolved, of_rounding)),
        steps=frozen_array(
            [level.step if level.deviation > low else 0.0 for level, low in zip(levels, resolved, strict=True)]
        ),
    )


def noise_deviation(signals: Sequence[FloatArray]) -> float:
    """Return the standard deviation of white noise on smooth signals, in the signals' unit.

    The sixth difference of a smooth signal is almost nothing, that of white noise has comb(12, 6) times its
    variance. The scale is first taken from the median (kinks and jumps do not move it), then from the mean square of
    what lies within four of these scales; from 20,000 samples it is known to 1 %.

    Args:
        signals: uniform samples, each of shape (n,) with the noise to be measured; n may differ.

    Returns:
        The deviation; 0 if no signal has more than six samples.
    """
    differences = [np.diff(signal, n=_ORDER) for signal in signals if signal.size > _ORDER]
    if not differences:
        return 0.0
    scaled = np.concatenate(differences) / np.sqrt(comb(2 * _ORDER, _ORDER))
    rough = float(np.median(np.abs(scaled))) / _MEDIAN_OF_NORMAL
    kept = scaled[np.abs(scaled) <= _CLIP * rough]
    return float(np.sqrt(np.mean(kept**2) / _CLIPPED_VARIANCE)) if kept.size else 0.0
