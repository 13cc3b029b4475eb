"""What the records themselves give cause to doubt, beside the fit."""

from __future__ import annotations

from collections.abc import Sequence

from finback.channels import channel
from finback.identification.coefficient.track import Track
from finback.identification.noise import noise_deviation, rounded
from finback.identification.rounding import Rounding, rounding
from finback.units import from_si


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
