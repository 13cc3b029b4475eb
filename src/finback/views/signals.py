"""The time histories of a recording: one entity a quantity, in the unit that plots show."""

from __future__ import annotations

from typing import Final

import rerun as rr

from finback.channels import channel
from finback.records import FlightRecord
from finback.views.clock import Clock
from finback.views.drawable import drawable
from finback.views.labels import axis_label, displayed

Rgb = tuple[int, int, int]

COLORS: Final[dict[str, Rgb]] = {
    "alpha_rad": (86, 180, 233),
    "q_rad_s": (72, 200, 150),
    "elevator_rad": (230, 159, 0),
}
"""Plotted column -> color on the viewer's dark ground (Okabe and Ito's color-blind safe set, the green lighter)."""


def plotted(record: FlightRecord) -> list[str]:
    """Return which columns of this record are plotted."""
    return [name for name in COLORS if name in record.columns]


def entity(column: str) -> str:
    """Return the entity that holds a plotted column."""
    return f"plots/{channel(column).quantity}"


def log_signals(stream: rr.RecordingStream, record: FlightRecord, clock: Clock) -> None:
    """Write the plotted columns; a value that cannot be drawn is left out."""
    for name in plotted(record):
        keep = drawable(record, name)
        values = displayed(record[name][keep], name)
        style = rr.SeriesLines(names=axis_label(name), colors=COLORS[name], widths=1.8)
        stream.log(entity(name), style, static=True)
        stream.send_columns(entity(name), clock.columns(keep), rr.Scalars.columns(scalars=values))
