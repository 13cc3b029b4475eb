"""The planet that a model flies over, as its file says: an ellipsoid, and how fast the horizon turns above it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from finback.errors import AircraftError, InputError
from finback.flight.xml_text import included, parse
from finback.units import from_si, to_si

_WGS84_FT: Final = (20925646.32546, 20855486.5951)  # JSBSim's own, for a model that names no planet
_AXES: Final = ("semimajor_axis", "semiminor_axis")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Planet:
    """An ellipsoid of revolution.

    Attributes:
        equator_ft: its semi-axis in the equator's plane.
        pole_ft: along the axis of rotation.
    """

    equator_ft: float
    pole_ft: float

    def radii_ft(self, latitude_rad: float) -> tuple[float, float]:
        """Return the radii of curvature of its surface along a meridian and across it, at a geodetic latitude."""
        squared = (self.pole_ft / self.equator_ft) ** 2
        width = 1.0 - (1.0 - squared) * math.sin(latitude_rad) ** 2
        across = self.equator_ft / math.sqrt(width)
        return across * squared / width, across


def planet_of(path: Path) -> Planet:
    """Return the planet of a model's file.

    Raises:
        AircraftError: its axes are no numbers, or in a unit that nobody knows.
    """
    found = parse(path).find("planet")
    axes = list(_WGS84_FT)
    if found is not None:
        found = included(found, path.parent)
        for number, name in enumerate(_AXES):
            element = found.find(name)
            if element is None:
                continue
            try:
                axes[number] = from_si(to_si(float(element.text or ""), element.get("unit", "FT").lower()), "ft")
            except (ValueError, InputError) as error:
                raise AircraftError(f"{path}: <planet> has no {name}: {error}") from None
    return Planet(equator_ft=axes[0], pole_ft=axes[1])
