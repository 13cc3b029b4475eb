"""What the viewer shows of a recording, and where."""

from __future__ import annotations

from typing import Final

import rerun as rr
import rerun.blueprint as rrb

from finback.records import FlightRecord
from finback.views import phase_plane, signals
from finback.views.clock import TIMELINE
from finback.views.labels import axis_label
from finback.views.scene import VEHICLE

_EYE: Final = (8.5, -19.0, -12.5)  # m from the aircraft, in north-east-down: from the left, ahead and above
_GROUND: Final = (24, 28, 36)


def layout(record: FlightRecord) -> rrb.Blueprint:
    """Return the layout: aircraft, phase plane and description on the left, time histories on the right."""
    aircraft = rrb.Spatial3DView(
        origin=VEHICLE,
        contents=["/world/**"],
        name="Aircraft",
        background=rrb.Background(color=_GROUND),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=_EYE, look_target=(1.0, 0.0, 0.0), eye_up=(0.0, 0.0, -1.0)),
    )
    phase = rrb.Spatial2DView(
        origin=f"/{phase_plane.ENTITY}",
        name="Phase plane",
        background=rrb.Background(color=_GROUND),
        visual_bounds=phase_plane.bounds(),
    )
    words = rrb.TextDocumentView(origin="/description", name="Flight")
    plots = [_plot(name) for name in signals.plotted(record)]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(aircraft, rrb.Horizontal(phase, words, column_shares=[3, 2]), row_shares=[5, 4]),
            rrb.Vertical(*plots),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="paused"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _plot(column: str) -> rrb.TimeSeriesView:
    """Return a plot over the whole flight; by itself the viewer shows half a minute around the cursor.

    It names no times: recordings of one application share their layout in the viewer.
    """
    everything = rr.TimeRange(start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite())
    return rrb.TimeSeriesView(
        origin=f"/{signals.entity(column)}",
        name=axis_label(column),
        axis_x=rrb.TimeAxis(view_range=everything),
        plot_legend=rrb.PlotLegend(visible=False),
    )
