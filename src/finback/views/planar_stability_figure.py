"""Stability regions of a planar field at several elevators, in the plane of alpha and pitch rate."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes

from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.dynamics.planar.region import PlanarRegion
from finback.units import from_si
from finback.views import style
from finback.views.labels import minus
from finback.views.region_panels import explain_panels, mark_escape, region_panels
from finback.views.style import Drawing


def planar_stability_regions(analysis: PlanarAnalysis) -> Drawing:
    """Draw each stability region that has a boundary (there must be one): boundary, sink, smallest escape."""
    regions = planar_bounded(analysis)
    with style.styled("stability"):
        figure, panels = region_panels(len(regions))
        for axes, region in zip(panels, regions, strict=True):
            _draw(axes, region, analysis)
        explain_panels(figure, panels)
        picture = style.svg(figure)
    return Drawing(
        name="stability",
        title="Stability regions",
        caption=(
            "From states around the stable equilibrium (dot), as far as the lines, the model returns to it with the "
            "elevator held; one elevator for each regime. The lines are stable manifolds of saddles, unstable limit "
            "cycles, or orbits that leave the ranges for good; the open circle is the nearest point of the boundary. "
            "Beyond the dotted rectangle no data supported the model."
        ),
        alt=minus(_words(regions)),
        svg=picture,
    )


def planar_bounded(analysis: PlanarAnalysis) -> tuple[PlanarRegion, ...]:
    """Return the stability regions that have a boundary to be drawn."""
    return tuple(region for region in analysis.regions if region.boundary)


def _draw(axes: Axes, region: PlanarRegion, analysis: PlanarAnalysis) -> None:
    label: str | None = "boundary of the stability region"
    for curve in region.boundary:
        alpha, q = from_si(curve.states, "deg").T
        line = style.SOLID if curve.separates else style.DASHED
        axes.plot(alpha, q, color=style.PREDICTED, linewidth=style.LINE, linestyle=line, label=label)
        label = None
    mark_escape(axes, *(from_si(state, "deg").tolist() for state in (region.state, region.escape_state)))
    (left, right), (low, high) = from_si(analysis.system.domain[:2], "deg").tolist()
    edge: dict[str, Any] = {"color": style.MUTED, "linewidth": style.THIN, "linestyle": style.DOTTED}
    axes.plot([left, right, right, left, left], [low, low, high, high, low], **edge)
    axes.set_title(minus(f"δe = {from_si(region.parameter, 'deg'):.2f}°"))
    axes.set_xlim(*from_si(region.box[0], "deg"))
    axes.set_ylim(*from_si(region.box[1], "deg"))


def _words(regions: tuple[PlanarRegion, ...]) -> str:
    said = (
        f"at elevator {from_si(region.parameter, 'deg'):.2f} deg around alpha "
        f"{from_si(float(region.state[0]), 'deg'):.1f} deg, within {region.escape_distance:.2f} of half the ranges"
        for region in regions
    )
    return f"Stability regions in the plane of alpha and pitch rate: {'; '.join(said)}."
