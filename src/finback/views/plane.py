"""Planes of states as a journal shows them: axes with symbol and unit, orbits with arrows, equilibria by kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from matplotlib.axes import Axes

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.equilibrium import Kind
from finback.units import from_si
from finback.views import style

_TIP: Final = 1e-3  # of the picture: how far the foot of an arrow lies behind its point; only its head is to be seen
_HEAD: Final = 8.0  # points
_SHORT: Final = 0.06  # of the picture: a piece that is shorter carries no arrow


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Plane:
    """How points (x, y) are shown.

    Attributes:
        x_label: symbol and unit of the abscissa.
        y_label: of the ordinate.
        x_unit: what one unit of x is in the unit shown.
        y_unit: the same of y.
    """

    x_label: str
    y_label: str
    x_unit: float = 1.0
    y_unit: float = 1.0

    def shown(self, points: FloatArray) -> FloatArray:
        """Return points, shape (n, 2), as they are shown."""
        return frozen_array(np.asarray(points, dtype=np.float64).reshape(-1, 2) * (self.x_unit, self.y_unit))

    def label(self, axes: Axes) -> None:
        """Write the labels."""
        axes.set_xlabel(self.x_label)
        axes.set_ylabel(self.y_label)


NUMBERS: Final = Plane(x_label="$x$", y_label="$y$")
"""The plane of a normal form, which has no units."""
PITCH: Final = Plane(
    x_label=r"$\alpha$ [deg]",
    y_label=r"$\dot\alpha$ [deg/s]",
    x_unit=from_si(1.0, "deg"),
    y_unit=from_si(1.0, "deg_s"),
)
"""The plane of (alpha, dα/dt), given in rad and rad/s."""

MARKERS: Final[dict[str, dict[str, Any]]] = {
    "sink": {"marker": "o", "markerfacecolor": style.INK},
    "source": {"marker": "o", "markerfacecolor": style.PAPER},
    "saddle": {"marker": "x", "markeredgewidth": 1.3},
    "degenerate": {"marker": ".", "markersize": 3.5},
}
"""What an equilibrium is -> how it is marked."""


def role(kind: Kind) -> str:
    """Return which of ``MARKERS`` an equilibrium gets."""
    if kind is Kind.SADDLE:
        return "saddle"
    if kind.stable:
        return "sink"
    return "source" if kind in (Kind.UNSTABLE_FOCUS, Kind.UNSTABLE_NODE) else "degenerate"


def draw_equilibria(axes: Axes, kinds: Sequence[Kind], points: FloatArray, *, named: bool = True) -> None:
    """Mark equilibria at points as they are shown, shape (n, 2); with names for a legend or without."""
    places = np.asarray(points).reshape(-1, 2)
    for name, look in MARKERS.items():
        mine = places[[role(kind) == name for kind in kinds]]
        if len(mine):
            label = name if named else None
            axes.plot(*mine.T, color=style.INK, linestyle="none", label=label, zorder=6, clip_on=True, **look)


def draw_arrow(axes: Axes, piece: FloatArray, *, forward: bool, color: str, share: float = 0.5) -> None:
    """Put an arrow head on a polyline as it is shown, shape (n, 2), at a share of its length in the picture.

    The limits of the axes must have been set.
    """
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    span = np.array([abs(right - left), abs(high - low)])
    steps = np.hypot(*(np.diff(piece, axis=0) / span).T)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    if length[-1] < _SHORT:
        return
    at = share * length[-1]
    ends = np.array([at - _TIP, at + _TIP] if forward else [at + _TIP, at - _TIP])
    foot, tip = (tuple(np.interp(place, length, row) for row in piece.T) for place in ends)
    arrow = {"arrowstyle": "-|>", "color": color, "linewidth": 0.0, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", tip, xytext=foot, arrowprops={**arrow, "mutation_scale": _HEAD}, zorder=5)
