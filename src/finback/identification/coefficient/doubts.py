"""What the records themselves give cause to doubt, beside the fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.channels import channel
from finback.identification.coefficient.track import Track
from finback.identification.noise import noise_deviation, rounded
from finback.identification.rounding import Rounding, rounding
from finback.units import from_si

_LARGER: Final = 1.3
"""Times the white noise that a record shows, from which on residuals are something else. Of 1000 samples, chance makes
1.05."""


def roundings(used: Sequence[Track]) -> list[Rounding]:
    """Return the rounding of each output."""
    interval_s = used[0].interval_s
    return [rounding([track.measured[:, k] for track in used], interval_s) for k in range(len(used[0].outputs))]


def rounded_outputs(used: Sequence[Track]) -> tuple[str, ...]:
    """Name the outputs that are rounded more coarsely than their noise."""
    said = []
    for k, (name, level) in enumerate(zip(used[0].outputs, roundings(used), strict=True)):
        if level.deviation > noise_deviation([track.measured[:, k] for track in used]):
            unit = channel(name).display_unit
            step, assumed = (f"{from_si(size, unit):.3g} {unit}" for size in (level.step, level.deviation))
            said.append(rounded(name, step, assumed))
    return tuple(said)


def beyond_noise(used: Sequence[Track], residual_rms: FloatArray, least: FloatArray) -> tuple[str, ...]:
    """Say which outputs output error leaves with more than the white noise that the records show.

    Args:
        used: the data.
        residual_rms: of the outputs, in SI, shape (outputs,).
        least: noise of the outputs that is believed at least, in SI, shape (outputs,).
    """
    white = [noise_deviation([track.measured[:, k] for track in used]) for k in range(least.size)]
    ratios = residual_rms / np.maximum(white, least)
    larger = [
        f"{name} {ratio:.3g}" for name, ratio in zip(used[0].outputs, ratios.tolist(), strict=True) if ratio > _LARGER
    ]
    if not larger:
        return ()
    said = (
        f"residuals are larger than the white noise of the records, by factors: {', '.join(larger)}; from gusts, noise "
        "of its own color, or what the model misses: compare with method filter-error"
    )
    return (said,)
