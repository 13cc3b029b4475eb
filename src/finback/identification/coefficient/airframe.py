"""What turns coefficients into motion: mass, geometry, thrust, and where the moment is taken about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.errors import InputError


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Airframe:
    """A rigid aircraft of constant mass.

    Attributes:
        mass_kg: mass, > 0.
        wing_area_m2: reference area S, > 0.
        chord_m: reference chord c, > 0.
        pitch_inertia_kg_m2: Iy about the center of gravity, > 0.
        thrust_n: constant thrust T, where a record has no ``thrust_n`` of its own.
        thrust_angle_rad: its angle ε above the body x-axis.
        thrust_arm_m: its arm about the center of gravity, nose up > 0.
        reference_x_m: how far forward of the center of gravity the point lies that Cm is about.
        reference_z_m: how far below the center of gravity it lies.
    """

    mass_kg: float
    wing_area_m2: float
    chord_m: float
    pitch_inertia_kg_m2: float
    thrust_n: float = 0.0
    thrust_angle_rad: float = 0.0
    thrust_arm_m: float = 0.0
    reference_x_m: float = 0.0
    reference_z_m: float = 0.0

    def __post_init__(self) -> None:
        """Check that what divides is positive, and that every number is one."""
        if not min(self.mass_kg, self.wing_area_m2, self.chord_m, self.pitch_inertia_kg_m2) > 0.0:
            raise InputError("mass, wing area, chord and pitch inertia of an airframe are > 0")
        if not np.isfinite([getattr(self, name) for name in self.__slots__]).all():
            raise InputError("every number of an airframe is finite")
