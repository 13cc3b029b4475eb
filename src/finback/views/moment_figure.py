"""The curve R of the ratios P = I1/I0 and Q = I2/I0 over the closed level curves, and lines that cut it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from matplotlib.axes import Axes

from finback.arrays import FloatArray, frozen_array
from finback.views import style

_NAME: Final = "curve $R$"
_GROUND: Final[dict[str, Any]] = {"bbox": {"facecolor": style.PAPER, "edgecolor": "none", "pad": 1.2}, "zorder": 5}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MomentLine:
    """A straight line Q = a0 + a1 P.

    Attributes:
        intercept: a0.
        slope: a1.
        text: its name.
        tangent: whether it touches the curve at an end; else it is drawn as a cutting line.
        text_at: P at which the name stands.
    """

    intercept: float
    slope: float
    text: str
    tangent: bool
    text_at: float

    def at(self, P: float) -> float:
        """Return Q."""
        return self.intercept + self.slope * P


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MomentCurve:
    """The curve R, from the center outward to the loop.

    Attributes:
        level: of H, shape (n,).
        P: I1/I0, shape (n,).
        Q: I2/I0, shape (n,).
    """

    level: FloatArray
    P: FloatArray
    Q: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("level", "P", "Q"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def draw_moments(
    axes: Axes, curve: MomentCurve, lines: Sequence[MomentLine], *, cuts: FloatArray, limits: FloatArray
) -> None:
    """Draw the curve, its end tangents and lines that cut it.

    Args:
        axes: where.
        curve: the curve.
        lines: the lines.
        cuts: where lines meet the curve, P and Q, shape (n, 2).
        limits: low and high of P and of Q, shape (2, 2).
    """
    axes.set_xlim(*limits[0])
    axes.set_ylim(*limits[1])
    axes.set_xlabel(r"$P = I_1/I_0$")
    axes.set_ylabel(r"$Q = I_2/I_0$")
    ends = np.array(axes.get_xlim())
    for line in lines:
        color, dash = (style.MUTED, style.DASHED) if line.tangent else (style.SIMULATED, style.SOLID)
        axes.plot(ends, line.intercept + line.slope * ends, color=color, linestyle=dash, linewidth=0.9, zorder=2)
        axes.text(line.text_at, line.at(line.text_at), line.text, color=color, ha="center", va="center", **_GROUND)
    axes.plot(curve.P, curve.Q, color=style.PREDICTED, linewidth=1.6, zorder=3, label=_NAME)
    axes.plot(curve.P[[0, -1]], curve.Q[[0, -1]], color=style.INK, marker="o", linestyle="none", zorder=4)
    if len(cuts):
        look: dict[str, Any] = {"marker": "o", "markerfacecolor": style.PAPER, "linestyle": "none"}
        axes.plot(*np.asarray(cuts).T, color=style.SIMULATED, zorder=4, **look)
