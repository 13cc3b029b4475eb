"""Panels beside each other in the plane of alpha and pitch rate, one for each stability region."""

from __future__ import annotations

import math
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finback.views import style
from finback.views.labels import axis_label

_PANEL: Final = 3.1
_COLUMNS: Final = 4  # panels beside each other

Place = tuple[float, float]


def region_panels(count: int) -> tuple[Figure, tuple[Axes, ...]]:
    """Return a figure and its panels, at least one; all show the same ranges."""
    rows = math.ceil(count / _COLUMNS)
    figure = style.new_figure(_PANEL * rows)
    grid = figure.subplots(rows, min(_COLUMNS, count), sharex=True, sharey=True, squeeze=False)
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    for axes in grid[-1]:
        axes.set_xlabel(axis_label("alpha_rad"))
    for axes in grid[:, 0]:
        axes.set_ylabel(axis_label("q_rad_s"))
    return figure, tuple(grid.flat[:count])


def explain_panels(figure: Figure, panels: tuple[Axes, ...]) -> None:
    """Write the legend of the first panel above all."""
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=4, frameon=False)


def mark_escape(axes: Axes, sink: Place, near: Place) -> None:
    """Mark the stable equilibrium, the nearest point of the boundary, and the way between, in deg and deg/s."""
    axes.plot(*sink, color=style.INK, marker="o", linestyle="none", zorder=4)
    axes.plot(
        *near,
        color=style.INK,
        marker="o",
        markerfacecolor=style.PAPER,
        linestyle="none",
        label="nearest escape",
        zorder=4,
    )
    axes.plot(*zip(sink, near, strict=True), color=style.MUTED, linewidth=style.THIN, zorder=3)
