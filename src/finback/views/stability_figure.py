"""Stability regions at several elevators, in the plane of alpha and pitch rate."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from matplotlib.axes import Axes

from finback.arrays import FloatArray
from finback.dynamics.analysis import Analysis
from finback.dynamics.stability.boundary_curve import CurveEnd
from finback.dynamics.stability.region import BoundaryBranch, BoundaryCycle, StabilityRegion
from finback.units import from_si
from finback.views import style
from finback.views.labels import minus
from finback.views.region_panels import explain_panels, mark_escape, region_panels
from finback.views.style import Drawing

_BESIDE: Final = 0.35  # of the saddles' distance from the sink: how far beyond them the picture goes
_ABOVE: Final = 1.15


def stability_regions(analysis: Analysis) -> Drawing:
    """Draw each stability region that is bounded (there must be one): boundary, sink, saddles, smallest escape."""
    regions = bounded(analysis)
    with style.styled("stability"):
        figure, panels = region_panels(len(regions))
        for axes, region in zip(panels, regions, strict=True):
            _draw(axes, region, analysis)
        half = _ABOVE * max(_height(region, analysis) for region in regions)
        panels[0].set_ylim(-half, half)
        explain_panels(figure, panels)
        picture = style.svg(figure)
    return Drawing(
        name="stability",
        title="Stability regions",
        caption=(
            "Shaded: states from which the model returns to its stable equilibrium (dot) with the elevator held, one "
            "elevator for each regime. The lines are stable manifolds of the saddles (crosses), or unstable limit "
            "cycles; the open circle is the nearest point of the boundary, the smallest disturbance that escapes. The "
            "regions of saddles go on beyond the picture in ever thinner tongues; beyond the dotted lines no data "
            "supported the model."
        ),
        alt=minus(_words(regions)),
        svg=picture,
    )


def bounded(analysis: Analysis) -> tuple[StabilityRegion, ...]:
    """Return the stability regions that have a boundary to be drawn."""
    return tuple(region for region in analysis.regions if region.boundary or region.cycles)


def _draw(axes: Axes, region: StabilityRegion, analysis: Analysis) -> None:
    outline = from_si(_outline(region), "deg")
    if _closed(region):
        axes.fill(*outline.T, color=style.PREDICTED, alpha=0.15, linewidth=0.0, label="stability region")
    curves: list[BoundaryBranch | BoundaryCycle] = [*region.boundary, *region.cycles]
    for number, curve in enumerate(curves):
        label = None if number else "stable manifold of a saddle" if region.boundary else "unstable limit cycle"
        alpha, q = from_si(curve.alpha_rad, "deg"), from_si(curve.q_rad_s, "deg_s")
        axes.plot(alpha, q, color=style.PREDICTED, linewidth=style.LINE, label=label)
    saddles = sorted({branch.saddle_alpha_rad for branch in region.boundary})
    places = from_si(np.array(saddles), "deg")
    rates = from_si(analysis.system.pitch_rate(np.array(saddles), region.elevator_rad), "deg_s")
    axes.plot(places, rates, color=style.INK, marker="x", linestyle="none", label="saddle", zorder=4)
    sink = (from_si(region.alpha_rad, "deg"), from_si(region.q_rad_s, "deg_s"))
    near = (from_si(region.escape_alpha_rad, "deg"), from_si(region.escape_q_rad_s, "deg_s"))
    mark_escape(axes, sink, near)
    axes.set_title(minus(f"δe = {from_si(region.elevator_rad, 'deg'):.2f}°"))
    axes.set_xlim(*_width(analysis))
    for limit in from_si(analysis.system.domain[0], "deg"):
        if np.isfinite(limit):
            axes.axvline(float(limit), color=style.MUTED, linewidth=style.THIN, linestyle=style.DOTTED)


def _closed(region: StabilityRegion) -> bool:
    """Tell whether the outline of a region can be filled: branches that leave the range in pairs, or a cycle."""
    leave = all(branch.ending is CurveEnd.AWAY for branch in region.boundary)
    return math.isfinite(region.area_rad2_s) and leave and (bool(region.boundary) != bool(region.cycles))


def _outline(region: StabilityRegion) -> FloatArray:
    """Return the boundary as one closed curve in alpha and q, shape (n, 2): saddle by saddle, joined where cut."""
    if not region.boundary:
        parts = [np.column_stack([cycle.alpha_rad, cycle.q_rad_s]) for cycle in region.cycles]
        return np.concatenate([np.empty((0, 2)), *parts])
    curves = []
    for saddle in sorted({branch.saddle_alpha_rad for branch in region.boundary}):
        mine = sorted((b for b in region.boundary if b.saddle_alpha_rad == saddle), key=lambda b: b.side)
        parts = [np.column_stack([b.alpha_rad, b.q_rad_s])[:: b.side] for b in mine]
        curves.append(np.concatenate(parts))
    return np.concatenate([curves[0], *(curve[::-1] for curve in curves[1:])])


def _width(analysis: Analysis) -> tuple[float, float]:
    """Return the angles that all panels show: the alpha range and all sinks and saddles, with room beside them."""
    angles = [b.saddle_alpha_rad for region in analysis.regions for b in region.boundary]
    angles += [x for region in analysis.regions for c in region.cycles for x in (c.alpha_min_rad, c.alpha_max_rad)]
    angles += [region.alpha_rad for region in analysis.regions]
    low, high = min(angles), max(angles)
    beside = _BESIDE * (high - low)
    cut = analysis.options.region_alpha_rad
    return from_si(max(cut[0], low - beside), "deg"), from_si(min(cut[1], high + beside), "deg")


def _height(region: StabilityRegion, analysis: Analysis) -> float:
    """Return the largest pitch rate of the boundary in the part that is shown, in deg/s."""
    low, high = _width(analysis)
    outline = from_si(_outline(region), "deg")
    shown = outline[(low <= outline[:, 0]) & (outline[:, 0] <= high), 1]
    return float(np.abs(shown).max(initial=1.0))


def _owners(region: StabilityRegion) -> str:
    saddles = len({branch.saddle_alpha_rad for branch in region.boundary})
    return f"{saddles} saddles" if saddles else "a limit cycle"


def _words(regions: tuple[StabilityRegion, ...]) -> str:
    said = (
        f"at elevator {from_si(region.elevator_rad, 'deg'):.2f} deg the boundary belongs to "
        f"{_owners(region)} and comes within "
        f"{from_si(region.escape_distance_rad, 'deg'):.1f} deg of the equilibrium"
        for region in regions
    )
    return f"Stability regions in the plane of alpha and pitch rate: {'; '.join(said)}."
