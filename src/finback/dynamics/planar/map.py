"""Where states of a planar field go: a check of stability regions that follows no manifold and no cycle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.planar.map_kernel import LANES, UNDECIDED, settle
from finback.dynamics.planar.setting import PlanarSetting, planar_setting
from finback.dynamics.planar.system import PlanarSystem

_FAR: Final = 1e4  # times the box; where a region is unbounded, orbits come back from far

_MOST_STEPS: Final = 20_000


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarMap:
    """Where states go.

    Attributes:
        sinks: shape (k, 2), by first state.
        fate: index of the sink to which a state goes, -1 where it leaves 10 000 times the box, -2 where neither happens
            within the steps allowed: it winds onto a stable cycle, or stays on a boundary; shape of the states.
    """

    sinks: FloatArray
    fate: NDArray[np.int64]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, "sinks", frozen_array(self.sinks))
        fate = np.array(self.fate, dtype=np.int64)
        fate.setflags(write=False)
        object.__setattr__(self, "fate", fate)


def planar_map(
    system: PlanarSystem, parameter: float, first: ArrayLike, second: ArrayLike, *, box: ArrayLike
) -> PlanarMap:
    """Follow states, any number, until each is in an ellipse from which none escapes, or far away.

    Args:
        system: the system.
        parameter: held.
        first: first states, in SI, any shape.
        second: second states, the same shape.
        box: low and high of both states, in SI, shape (2, 2): what is of interest, and what far is measured by.

    Raises:
        InputError: the box is none.
        RefusedError: the equilibria cannot be found.
    """
    setting = planar_setting(system, parameter, box)
    x, y = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    states = np.stack([x.ravel(), y.ravel()], axis=-1) / setting.units
    sinks = [point for point, kind in zip(setting.points, setting.kinds, strict=True) if kind.stable]
    return PlanarMap(sinks=np.array(sinks).reshape(-1, 2) * setting.units, fate=fates(setting, states).reshape(x.shape))


def fates(setting: PlanarSetting, states: FloatArray) -> NDArray[np.int64]:
    """Return where states of shape (n, 2), in the units of the setting, go: as ``PlanarMap.fate``, shape (n,)."""
    field = setting.field
    result = np.full(len(states), UNDECIDED, dtype=np.int64)
    room, values = np.zeros((7, LANES)), np.zeros((len(field.factors) + 2, LANES))
    lanes = np.full((2, LANES), -1)
    far = _FAR * float(np.abs(setting.box).max())
    starts = np.ascontiguousarray(states)
    settle(field.factors, field.weights, starts, setting.attracting, far, _MOST_STEPS, room, values, lanes, result)
    return result
