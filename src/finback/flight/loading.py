"""A change of an aircraft's mass, center of gravity and inertia."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

from finback.errors import InputError


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Loading:
    """How an aircraft differs from the one in its file, as loaded, fuel included.

    Attributes:
        mass_ratio: mass over the file's, > 0.
        inertia_ratio: every moment and product of inertia about the center of gravity over the file's, > 0; it does
            not follow the mass by itself.
        center_aft_m: how far the center of gravity has moved aft.
        center_up_m: how far it has moved up.
    """

    mass_ratio: float = 1.0
    inertia_ratio: float = 1.0
    center_aft_m: float = 0.0
    center_up_m: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, value in (("mass_ratio", self.mass_ratio), ("inertia_ratio", self.inertia_ratio)):
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"loading: {name} must be positive, got {value}")
        for name, value in (("center_aft_m", self.center_aft_m), ("center_up_m", self.center_up_m)):
            if not math.isfinite(value):
                raise InputError(f"loading: {name} must be a finite number, got {value}")


AS_LOADED: Final = Loading()
"""The aircraft as its file has it."""
