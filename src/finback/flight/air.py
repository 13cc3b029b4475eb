"""The air that a flight flies through."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

from finback.errors import InputError


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CalmAir:
    """Air at rest over the ground."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DrydenAir:
    """Gusts with the Dryden spectra; fidelity ``free`` only.

    Attributes:
        intensity_m_s: standard deviation of each gust component, >= 0.
        length_m: scale length of the longitudinal and vertical gusts, > 0.
        seed: of the gusts, >= 0; the same seed and step give the same gusts.
    """

    intensity_m_s: float
    length_m: float
    seed: int

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not (math.isfinite(self.intensity_m_s) and self.intensity_m_s >= 0):
            raise InputError(f"turbulence: intensity_m_s must be a number >= 0, got {self.intensity_m_s}")
        if not (math.isfinite(self.length_m) and self.length_m > 0):
            raise InputError(f"turbulence: length_m must be positive, got {self.length_m}")
        if self.seed < 0:
            raise InputError(f"turbulence: the seed must not be negative, got {self.seed}")


Air = CalmAir | DrydenAir
"""Either."""

CALM: Final = CalmAir()
"""No wind."""
