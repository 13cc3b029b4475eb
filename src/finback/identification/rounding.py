"""The step to which a recorder rounds a channel, and what error it makes.

Noise that is larger than the step makes the error of rounding white (Widrow & Kollár 2008, Quantization Noise); it is
then part of the noise that the record shows. Below, it stays as long as the value does, and no noise can be seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray

_STRAY: Final = 0.02
"""Of a step: a change this near to a whole number of steps counts as one. Text with few digits moves levels."""
_ON_LEVELS: Final = 0.99
"""Share of the changes that must be whole numbers of steps."""
_EQUAL: Final = 0.05
"""Share of neighbors that must be equal: of a smooth or noisy channel none are, by chance."""
_LONGEST_S: Final = 1.0
"""An error that stays longer counts as if it did not: at rest samples tell little of a motion, and should not rule."""
_FEWEST: Final = 8
"""Changes, below which nothing is said."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Rounding:
    """What rounding does to a channel; both are 0 if none is seen.

    Attributes:
        step: between neighboring levels, in the channel's unit.
        deviation: of white noise that tells as little of the channel. The error itself has step / √12; it stays while
            the value does, so that its sum over runs of L samples varies as that of white noise ΣL² / ΣL times larger.
    """

    step: float
    deviation: float


def rounding(signals: Sequence[FloatArray], interval_s: float) -> Rounding:
    """Look for levels in the values of a channel.

    Args:
        signals: as recorded, in order of time, each of shape (n,), without missing samples; n may differ.
        interval_s: between samples.
    """
    none = Rounding(step=0.0, deviation=0.0)
    size = max((float(np.abs(signal).max(initial=0.0)) for signal in signals), default=0.0)
    changes = np.concatenate([np.abs(np.diff(signal)) for signal in signals]) if signals else np.zeros(0)
    real = changes[changes > 1e-12 * size]
    if real.size < _FEWEST or real.size > (1.0 - _EQUAL) * changes.size:
        return none
    steps = real / real.min()
    if np.mean(np.abs(steps - np.round(steps)) <= _STRAY) < _ON_LEVELS:
        return none
    step = float(np.median(real / np.round(steps)))
    runs = np.minimum(np.concatenate([_runs(signal) for signal in signals]), max(_LONGEST_S / interval_s, 1.0))
    return Rounding(step=step, deviation=step * math.sqrt(float((runs**2).sum() / runs.sum()) / 12.0))


def _runs(signal: FloatArray) -> FloatArray:
    """Return how many equal samples follow each other, of all runs of a signal."""
    changed = np.flatnonzero(np.diff(signal) != 0.0) + 1
    return np.diff(np.concatenate([[0.0], changed, [float(signal.size)]]))
