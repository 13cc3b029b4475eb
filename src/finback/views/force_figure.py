"""The force over the angle, cut by the lines at which the elevator holds it in equilibrium."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes

from finback.dynamics.equilibrium import Equilibrium
from finback.dynamics.fold import Fold
from finback.dynamics.lienard import LienardSystem
from finback.units import from_si
from finback.views import style
from finback.views.labels import minus
from finback.views.plane import draw_equilibria

X_LABEL: Final = r"$\alpha$ [deg]"
Y_LABEL: Final = r"$y$ [deg/s$^2$]"
_SAMPLES: Final = 301


def draw_force_cuts(
    axes: Axes,
    system: LienardSystem,
    cuts: Sequence[tuple[float, tuple[Equilibrium, ...]]],
    folds: Sequence[Fold],
    *,
    alpha_range_rad: tuple[float, float],
) -> None:
    """Draw y = g(alpha) and y = −c₁ δe for some elevators, with the equilibria on each line.

    Args:
        axes: where.
        system: whose force.
        cuts: elevator in rad, and the equilibria there.
        folds: where the line touches the curve.
        alpha_range_rad: the abscissa.
    """
    alpha = np.linspace(*alpha_range_rad, _SAMPLES)
    low, high = from_si(alpha_range_rad[0], "deg"), from_si(alpha_range_rad[1], "deg")
    axes.set_xlim(low, high)
    axes.set_xlabel(X_LABEL)
    axes.set_ylabel(Y_LABEL)
    force = from_si(system.force(alpha), "deg_s2")
    axes.plot(from_si(alpha, "deg"), force, color=style.PREDICTED, linewidth=1.4, zorder=3, label=r"$y = g_0(\alpha)$")
    for number, (elevator, points) in enumerate(cuts):
        level = height(system, elevator)
        look: dict[str, Any] = {"color": style.MUTED, "linewidth": 0.8, "zorder": 2}
        axes.plot([low, high], [level, level], label=None if number else r"$y = -\delta$", **look)
        places = np.column_stack(
            [from_si(np.array([point.alpha_rad for point in points]), "deg"), np.full(len(points), level)]
        )
        draw_equilibria(axes, [point.kind for point in points], places, named=False)
        said = minus(rf"$\delta_e = {from_si(elevator, 'deg'):g}$°")
        axes.annotate(said, (high, level), xytext=(3, 0), textcoords="offset points", va="center", fontsize=7.0)
    for fold in folds:
        level = height(system, fold.elevator_rad)
        place = from_si(fold.alpha_rad, "deg")
        axes.plot([low, high], [level, level], color=style.MUTED, linewidth=0.8, linestyle=style.DASHED, zorder=2)
        axes.plot([place], [level], color=style.SIMULATED, marker="D", linestyle="none", zorder=5)
        said = minus(rf"{from_si(fold.elevator_rad, 'deg'):.2f}°")
        axes.annotate(said, (high, level), xytext=(3, 0), textcoords="offset points", va="center", fontsize=7.0)


def height(system: LienardSystem, elevator_rad: float) -> float:
    """Return −δ = −c₁ δe in deg/s²."""
    return from_si(-system.elevator_gain * elevator_rad, "deg_s2")
