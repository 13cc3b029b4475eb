"""Centers of a planar system: equilibria about which the orbits are closed, a continuum and no limit cycles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.planar.closed import ClosedBand, closed_orbits
from finback.dynamics.planar.setting import PlanarSetting, planar_setting
from finback.dynamics.planar.system import PlanarSystem


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarCenter:
    """Orbits beside each other that are closed within rounding. Names and units are in ``system.variables``.

    None of them is a limit cycle, though a damping below rounding may make some of one or the other.

    Attributes:
        parameter: held.
        state: an equilibrium inside all of them, shape (2,).
        reach: two states, on a ray from there, between which all orbits that were tried are closed, shape (2, 2); the
            first is the equilibrium itself where they begin there.
        periods: of the innermost and of the outermost that were tried, in s, shape (2,).
        tried: how many were.
        miss: by how much one of them misses itself after one turn at most, relative to the farthest along the ray.
    """

    parameter: float
    state: FloatArray
    reach: FloatArray
    periods: FloatArray
    tried: int
    miss: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "reach", "periods"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def planar_centers(system: PlanarSystem, parameter: float, box: ArrayLike) -> tuple[PlanarCenter, ...]:
    """Find where orbits in a box are closed beside each other, within rounding: measured, not proved.

    Args:
        system: the system.
        parameter: held.
        box: low and high of both states, in SI, shape (2, 2).

    Raises:
        InputError: the box is none.
        RefusedError: equilibria cannot be found; a cycle cannot be told from its neighbor.
    """
    setting = planar_setting(system, parameter, box)
    return tuple(planar_center(setting, band) for band in closed_orbits(setting).bands)


def planar_center(setting: PlanarSetting, band: ClosedBand) -> PlanarCenter:
    """Describe a band of closed orbits in the units of the system."""
    units = setting.units
    return PlanarCenter(
        parameter=setting.parameter,
        state=np.array(band.ray.point) * units,
        reach=np.array([band.ray.at(band.low), band.ray.at(band.high)]) * units,
        periods=np.array(band.periods) * setting.scale.time,
        tried=band.tried,
        miss=band.miss,
    )
