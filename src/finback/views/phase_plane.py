"""The (alpha, q) plane of a recording. The viewer's 2-D views have neither axes nor scales, so they are drawn here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike, NDArray

from finback.arrays import FloatArray, frozen_array
from finback.records import FlightRecord
from finback.views.clock import Clock
from finback.views.drawable import drawable
from finback.views.labels import axis_label, displayed

ENTITY: Final = "phase"
_AXES: Final = ("alpha_rad", "q_rad_s")
_WIDTH: Final = 160.0  # of the picture, in the viewer's own units
_HEIGHT: Final = 100.0
_MARGIN: Final = 0.06  # of the data's range, on each side
_LEAST_SPAN: Final = (2.0, 2.0)  # deg, deg/s: a flight at rest is not magnified into its noise
_LINES: Final = 6  # grid lines on an axis, about
_TEXT_DROP: Final = 3.5  # the viewer writes a label below its point, by about this much
_GRID: Final = (54, 60, 72)
_TEXT: Final = (176, 182, 190)
_PATH: Final = (120, 150, 190)
_NOW: Final = (255, 96, 64)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PhasePlane:
    """Scales from (alpha, q) to the picture; q points up, which in the viewer is negative.

    Attributes:
        drawn: the rows of the record that can be drawn, shape (n,).
        points: alpha in deg and q in deg/s in those rows, shape (m, 2).
        low: alpha and q at the lower left corner, shape (2,).
        high: the same at the upper right.
    """

    drawn: NDArray[np.bool_]
    points: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def around(cls, record: FlightRecord) -> PhasePlane:
        """Return a plane that holds all of a flight; of one whose alpha or q was not kept, nothing."""
        drawn = drawable(record, *_AXES) & (record.columns.keys() >= set(_AXES))
        points = np.column_stack([displayed(record.or_zero(name)[drawn], name) for name in _AXES])
        shown = points if points.size else np.zeros((1, 2))
        middle, span = 0.5 * (shown.min(axis=0) + shown.max(axis=0)), np.maximum(np.ptp(shown, axis=0), _LEAST_SPAN)
        half = (0.5 + _MARGIN) * span
        return cls(
            points=frozen_array(points),
            drawn=drawn,
            low=frozen_array(middle - half),
            high=frozen_array(middle + half),
        )

    def place(self, alpha_deg: ArrayLike, q_deg_s: ArrayLike) -> FloatArray:
        """Return where points stand in the picture, shape (n, 2)."""
        share = (np.column_stack(np.broadcast_arrays(alpha_deg, q_deg_s)) - self.low) / (self.high - self.low)
        return np.column_stack([share[:, 0] * _WIDTH, (1.0 - share[:, 1]) * _HEIGHT])

    def log(self, stream: rr.RecordingStream, clock: Clock) -> None:
        """Write axes, path, start and the moving point."""
        self._log_axes(stream)
        if not self.points.size:
            return
        places = self.place(*self.points.T)
        path = rr.LineStrips2D([places], colors=_PATH, radii=rr.Radius.ui_points(1.1))
        stream.log(f"{ENTITY}/path", path, static=True)
        start = rr.Points2D(
            places[:1], colors=_PATH, radii=rr.Radius.ui_points(3.5), labels=["start"], show_labels=False
        )
        stream.log(f"{ENTITY}/start", start, static=True)
        look = rr.Points2D.from_fields(colors=_NOW, radii=rr.Radius.ui_points(5.5), draw_order=50.0)
        stream.log(f"{ENTITY}/now", look, static=True)
        stream.send_columns(f"{ENTITY}/now", clock.columns(self.drawn), rr.Points2D.columns(positions=places))

    def _log_axes(self, stream: rr.RecordingStream) -> None:
        across, up = (ticks(self.low[k], self.high[k]) for k in range(2))
        ends = [[self.low[1], self.high[1]], [self.low[0], self.high[0]]]
        grid = [self.place([x, x], ends[0]) for x in across] + [self.place(ends[1], [y, y]) for y in up]
        lines = rr.LineStrips2D(grid, colors=_GRID, radii=rr.Radius.ui_points(0.4), draw_order=-20.0)
        stream.log(f"{ENTITY}/grid", lines, static=True)
        zero = [self.place([0.0, 0.0], ends[0])] if self.low[0] < 0.0 < self.high[0] else []
        zero += [self.place(ends[1], [0.0, 0.0])] if self.low[1] < 0.0 < self.high[1] else []
        frame = [np.array([[0, 0], [0, _HEIGHT], [_WIDTH, _HEIGHT], [_WIDTH, 0], [0, 0]])]
        border = rr.LineStrips2D([*zero, *frame], colors=_TEXT, radii=rr.Radius.ui_points(0.6), draw_order=-10.0)
        stream.log(f"{ENTITY}/axes", border, static=True)
        places = np.vstack(
            [
                np.add(self.place(across, self.low[1]), [0.0, 1.0]),
                np.subtract(self.place(self.low[0], up), [7.0, _TEXT_DROP]),
                [[0.5 * _WIDTH, _HEIGHT + 9.0], [-4.0, -11.0]],
            ]
        )
        names = [axis_label(name) for name in _AXES]
        texts = [f"{value:g}" for value in (*across, *up)] + names
        # A point that is fully transparent would hide its text, so it is tiny instead.
        labels = rr.Points2D(places, labels=texts, show_labels=True, radii=rr.Radius.ui_points(0.01), colors=_TEXT)
        stream.log(f"{ENTITY}/labels", labels, static=True)


def bounds() -> rrb.VisualBounds2D:
    """Return the part of the picture that the view shows, room for labels included."""
    return rrb.VisualBounds2D(x_range=(-16.0, _WIDTH + 6.0), y_range=(-12.0, _HEIGHT + 16.0))


def ticks(low: float, high: float) -> FloatArray:
    """Return round values between two limits, about six of them."""
    raw = (high - low) / _LINES
    power = 10.0 ** np.floor(np.log10(raw))
    step = min((1.0, 2.0, 5.0, 10.0), key=lambda factor: abs(factor * power - raw)) * power
    first, last = np.ceil(low / step), np.floor(high / step)
    return frozen_array(np.arange(first, last + 1.0) * step + 0.0)
