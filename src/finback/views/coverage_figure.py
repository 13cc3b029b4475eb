"""Where the sweep's flights went in the (alpha, q) plane, and what of them the fit used."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from finback.identification.identify import Identification
from finback.records import FlightRecord, Outcome, Sweep
from finback.units import from_si
from finback.views import style
from finback.views.labels import axis_label, displayed
from finback.views.style import Drawing

_USED: Final = {"color": style.PREDICTED, "linewidth": 0.7, "alpha": 0.8, "zorder": 2}
_UNUSED: Final = {"color": style.UNUSED, "linewidth": 0.7, "zorder": 1}


def sweep_coverage(sweep: Sweep, identification: Identification) -> Drawing:
    """Draw every flight of the sweep over alpha and q: what was used, what was not, and how it ended."""
    with style.styled("coverage"):
        figure = style.new_figure(4.4)
        axes = figure.add_subplot()
        for record in sweep.records:
            _draw_flight(axes, record, _used(record, identification))
        _draw_ends(axes, sweep)
        _draw_limits(axes, identification)
        axes.set_xlabel(axis_label("alpha_rad"))
        axes.set_ylabel(axis_label("q_rad_s"))
        _describe(axes)
        picture = style.svg(figure)
    departed = sum(record.outcome is not Outcome.COMPLETED for record in sweep.records)
    low, high = from_si(np.array(identification.options.alpha_window_rad), "deg")
    counted = f"{len(sweep.records)} flights, {departed} of which departed or diverged"
    return Drawing(
        name="coverage",
        title="Coverage of the sweep",
        caption=(
            f"{counted}. Blue: the samples that the fit used; gray: what it did not use. The dashed box is the fitted "
            "domain: outside it, predictions are extrapolated and never counted. Dotted: the window of alpha."
        ),
        alt=f"Trajectories in the plane of alpha and pitch rate: {counted}; window from {low:.1f} to {high:.1f} deg.",
        svg=picture,
    )


def _used(record: FlightRecord, identification: Identification) -> NDArray[np.bool_]:
    time = record["time_s"]
    used = np.zeros(len(record), dtype=np.bool_)
    for segment in identification.segments:
        if segment.flight == record.name:
            used |= (segment.start_s <= time) & (time <= segment.end_s)
    return used


def _draw_flight(axes: Axes, record: FlightRecord, used: NDArray[np.bool_]) -> None:
    alpha, q = (displayed(record[name], name) for name in ("alpha_rad", "q_rad_s"))
    for start, stop in pairwise([0, *(np.flatnonzero(np.diff(used)) + 1).tolist(), len(record)]):
        if start < stop:
            rows = slice(start, min(stop + 1, len(record)))  # neighbors share a point: no gap
            look: dict[str, Any] = _USED if used[start] else _UNUSED
            axes.plot(alpha[rows], q[rows], **look)


def _draw_ends(axes: Axes, sweep: Sweep) -> None:
    for outcome, marker in ((Outcome.DEPARTED, "x"), (Outcome.DIVERGED, "P")):
        ended = [record for record in sweep.records if record.outcome is outcome and len(record)]
        if ended:
            alpha, q = ([displayed(record[name], name)[-1] for record in ended] for name in ("alpha_rad", "q_rad_s"))
            axes.plot(alpha, q, color=style.SIMULATED, marker=marker, linestyle="none", label=outcome.value, zorder=4)


def _draw_limits(axes: Axes, identification: Identification) -> None:
    for number, limit in enumerate(identification.options.alpha_window_rad):
        label = "window of alpha" if number == 0 else None
        axes.axvline(from_si(limit, "deg"), color=style.INK, linestyle=style.DOTTED, linewidth=1.0, label=label)
    domain = from_si(identification.model.alpha_dot.domain[:2], "deg")
    if np.isfinite(domain).all():
        corner, size = domain[:, 0], domain[:, 1] - domain[:, 0]
        box = Rectangle(
            (corner[0], corner[1]),
            size[0],
            size[1],
            fill=False,
            edgecolor=style.INK,
            linestyle="--",
            label="fitted domain",
        )
        axes.add_patch(box)


def _describe(axes: Axes) -> None:
    axes.plot([], [], color=style.PREDICTED, label="used")
    axes.plot([], [], color=style.UNUSED, label="not used")
    style.legend_above(axes, columns=5, order=("used", "not used"))
