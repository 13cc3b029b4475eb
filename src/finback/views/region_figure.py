"""Stability regions in the plane of alpha and its rate, several in one picture, and their size over the elevator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from finback.arrays import FloatArray
from finback.dynamics.stability.boundary_curve import CurveEnd
from finback.dynamics.stability.region import BoundaryBranch, BoundaryCycle, StabilityRegion
from finback.units import from_si
from finback.views import style
from finback.views.labels import minus
from finback.views.plane import PITCH, Plane

_LINES: Final = (style.PREDICTED, style.SIMULATED, style.FLOWN, style.PURPLE)
_DASHES: Final = (style.SOLID, style.DASHED, style.DOTTED, (0, (6, 1.6, 1, 1.6)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """The part of the plane that is shown.

    Attributes:
        alpha_deg: low and high.
        alpha_dot_deg_s: low and high.
    """

    alpha_deg: tuple[float, float]
    alpha_dot_deg_s: tuple[float, float]

    def put(self, axes: Axes, plane: Plane = PITCH) -> None:
        """Set limits and labels."""
        axes.set_xlim(*self.alpha_deg)
        axes.set_ylim(*self.alpha_dot_deg_s)
        plane.label(axes)


def draw_region(axes: Axes, region: StabilityRegion, *, color: str = style.SKY, name: str = "") -> None:
    """Shade a stability region as far as it was computed; nothing where a branch winds from a source or a cycle."""
    if not all(branch.ending is CurveEnd.AWAY for branch in region.boundary):
        return
    look: dict[str, Any] = {"facecolor": color, "alpha": 0.28, "linewidth": 0.0, "zorder": 1}
    rings = [PITCH.shown(ring) for ring in outline(region)]
    if not rings:  # the whole plane
        axes.axhspan(*axes.get_ylim(), label=name or None, **look)
        return
    axes.add_patch(PathPatch(Outline.make_compound_path(*map(Outline, rings)), label=name or None, **look))


def draw_regions(axes: Axes, regions: Sequence[StabilityRegion], frame: Frame) -> None:
    """Draw the boundaries of regions at several elevators, each with its sink and saddles; the first is shaded."""
    frame.put(axes)
    for number, region in enumerate(regions):
        color, dash = _LINES[number % len(_LINES)], _DASHES[number % len(_DASHES)]
        if not number:
            draw_region(axes, region)
        name = minus(rf"$\delta_e$ = {from_si(region.elevator_rad, 'deg'):g}°")
        curves: list[BoundaryBranch | BoundaryCycle] = [*region.boundary, *region.cycles]
        for part, curve in enumerate(curves):
            points = PITCH.shown(_points(curve))
            label = None if part else name
            axes.plot(*points.T, color=color, linestyle=dash, linewidth=1.1, zorder=3, label=label)
        saddles = sorted({branch.saddle_alpha_rad for branch in region.boundary})
        look: dict[str, Any] = {"color": color, "linestyle": "none", "zorder": 5}
        axes.plot(from_si(np.array(saddles), "deg"), np.zeros(len(saddles)), marker="x", markeredgewidth=1.2, **look)
        axes.plot([from_si(region.alpha_rad, "deg")], [0.0], marker="o", markersize=3.6, **look)


def outline(region: StabilityRegion) -> tuple[FloatArray, ...]:
    """Return the border of a region as closed curves in alpha and dα/dt; the holes run the other way.

    The curve of the stable branches goes saddle by saddle, joined where they are cut. Nothing for the whole plane.
    """
    curves = []
    for saddle in sorted({branch.saddle_alpha_rad for branch in region.boundary}):
        mine = sorted((b for b in region.boundary if b.saddle_alpha_rad == saddle), key=lambda b: b.side)
        whole = [_points(branch) for branch in mine]
        curves.append(np.concatenate([whole[0][::-1], *whole[1:]]))
    rings = [np.concatenate([curves[0], *(curve[::-1] for curve in curves[1:])])] if curves else []
    rings += [_points(cycle) for cycle in region.cycles if cycle.around]
    holes = [_points(cycle) for cycle in region.cycles if not cycle.around]
    turned = [_turning(ring, 1.0) for ring in rings] + [_turning(hole, -1.0) for hole in holes]
    return tuple(np.concatenate([ring, ring[:1]]) for ring in turned)


def draw_over_elevator(
    axes: Axes, regions: Sequence[StabilityRegion], values: FloatArray, *, label: str, marks: Sequence[float] = ()
) -> None:
    """Draw a quantity of stability regions, as it is shown, over the elevator.

    Args:
        axes: where.
        regions: by rising elevator.
        values: one for each, shape (n,).
        label: symbol and unit.
        marks: elevators in deg at which something happens, each a dashed line.
    """
    elevator = from_si(np.array([region.elevator_rad for region in regions]), "deg")
    axes.plot(elevator, values, color=style.PREDICTED, zorder=3)
    for mark in marks:
        axes.axvline(mark, color=style.MUTED, linestyle=style.DASHED, linewidth=0.8, zorder=2)
    axes.set_xlabel(r"$\delta_e$ [deg]")
    axes.set_ylabel(label)


def _points(curve: BoundaryBranch | BoundaryCycle) -> FloatArray:
    return np.column_stack([curve.alpha_rad, curve.alpha_dot_rad_s])


def _turning(ring: FloatArray, sign: float) -> FloatArray:
    """Return a closed curve so that it runs counterclockwise for 1, clockwise for -1."""
    x, y = ring.T
    enclosed = float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    return ring if enclosed * sign >= 0.0 else ring[::-1]
