"""Phase portraits: orbits, manifolds of saddles, limit cycles, equilibria."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from finback.arrays import FloatArray
from finback.dynamics.portrait.path import DrawnCycle, Orbit, Portrait, Separatrix
from finback.views import style
from finback.views.plane import MARKERS, NUMBERS, Plane, draw_arrow, draw_equilibria

STABLE: Final[dict[str, Any]] = {"color": style.PREDICTED, "linestyle": style.SOLID, "linewidth": 1.2, "zorder": 4}
UNSTABLE: Final[dict[str, Any]] = {"color": style.SIMULATED, "linestyle": style.DASHED, "linewidth": 1.2, "zorder": 4.5}
ORBIT: Final[dict[str, Any]] = {"color": style.MUTED, "linestyle": style.SOLID, "linewidth": 0.6, "zorder": 2}
ATTRACTING: Final[dict[str, Any]] = {"color": style.FLOWN, "linestyle": style.SOLID, "linewidth": 2.0, "zorder": 4.8}
REPELLING: Final[dict[str, Any]] = {"color": style.FLOWN, "linestyle": style.DASHED, "linewidth": 2.0, "zorder": 4.8}

STABLE_NAME: Final = "stable manifold"
UNSTABLE_NAME: Final = "unstable manifold"
ORBIT_NAME: Final = "orbit"
ATTRACTING_NAME: Final = "stable cycle"
REPELLING_NAME: Final = "unstable cycle"


def draw_portrait(axes: Axes, portrait: Portrait, plane: Plane = NUMBERS, *, orbits: bool = True) -> None:
    """Draw a portrait into its box; ``orbits`` tells whether those that are no separatrices are shown."""
    box, plain = portrait.box, np.array
    corners = plane.shown(plain([[box.x_low, box.y_low], [box.x_high, box.y_high]]))
    axes.set_xlim(*corners[:, 0])
    axes.set_ylim(*corners[:, 1])
    plane.label(axes)
    if orbits:
        draw_orbits(axes, portrait.orbits, plane)
    draw_separatrices(axes, portrait.separatrices, plane)
    draw_cycles(axes, portrait.cycles, plane)
    inside = [point for point in portrait.equilibria if box.x_low <= point.x <= box.x_high]
    places = plane.shown(plain([[point.x, 0.0] for point in inside]))
    draw_equilibria(axes, [point.kind for point in inside], places)


def draw_orbits(axes: Axes, orbits: Iterable[Orbit], plane: Plane, *, name: str = ORBIT_NAME, **look: Any) -> None:
    """Draw orbits with an arrow on their longest piece."""
    chosen = {**ORBIT, **look}
    for number, orbit in enumerate(orbits):
        _draw(axes, [plane.shown(piece) for piece in orbit.pieces], chosen, "" if number else name)
        _point(axes, orbit, plane, chosen["color"])


def draw_separatrices(axes: Axes, branches: Iterable[Separatrix], plane: Plane) -> None:
    """Draw branches of manifolds, stable ones solid and unstable ones dashed, with an arrow in the sense of time."""
    known: set[str] = set()
    for branch in branches:
        look, name = (STABLE, STABLE_NAME) if branch.stable else (UNSTABLE, UNSTABLE_NAME)
        pieces = [plane.shown(piece) for piece in branch.orbit.pieces]
        _draw(axes, pieces, look, "" if name in known else name)
        known.add(name)
        _point(axes, branch.orbit, plane, look["color"])


def draw_cycles(axes: Axes, cycles: Iterable[DrawnCycle], plane: Plane) -> None:
    """Draw limit cycles, stable ones solid and unstable ones dashed."""
    known: set[str] = set()
    for drawn in cycles:
        look, name = (ATTRACTING, ATTRACTING_NAME) if drawn.cycle.stable else (REPELLING, REPELLING_NAME)
        _draw(axes, [plane.shown(piece) for piece in drawn.pieces], look, "" if name in known else name)
        known.add(name)


def portrait_legend(axes: Axes) -> None:
    """Fill axes with the meaning of all lines and marks, instead of a picture."""
    lines = (
        (STABLE_NAME, STABLE),
        (UNSTABLE_NAME, UNSTABLE),
        (ORBIT_NAME, ORBIT),
        (ATTRACTING_NAME, ATTRACTING),
        (REPELLING_NAME, REPELLING),
    )
    handles = [Line2D([], [], label=name, **look) for name, look in lines]
    marks = [(name, look) for name, look in MARKERS.items() if name != "degenerate"]
    handles += [Line2D([], [], label=name, color=style.INK, linestyle="none", **look) for name, look in marks]
    axes.set_axis_off()
    axes.legend(handles=handles, loc="center", frameon=False, fontsize=8.5, labelspacing=0.7)


def _draw(axes: Axes, pieces: list[FloatArray], look: dict[str, Any], name: str) -> None:
    for number, piece in enumerate(pieces):
        axes.plot(*piece.T, label=name if name and not number else None, **look)


def _point(axes: Axes, orbit: Orbit, plane: Plane, color: str) -> None:
    shown = [plane.shown(piece) for piece in orbit.pieces]
    if shown:
        longest = max(shown, key=lambda piece: float(np.ptp(piece, axis=0) @ (1.0 / _span(axes))))
        draw_arrow(axes, longest, forward=orbit.forward, color=color)


def _span(axes: Axes) -> FloatArray:
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    return np.array([abs(right - left), abs(high - low)])
