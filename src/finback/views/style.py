"""The look of all figures, in one place: sizes, colors, lines, and how a figure becomes SVG.

Colors are Okabe and Ito's set, which color-blind readers can tell apart, and never carry a meaning alone: line style
and marker say it too. The same thing looks the same in every figure: predicted is blue, simulated is vermilion.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final, final

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

INK: Final = "#1f242b"
MUTED: Final = "#66707c"
GRID: Final = "#dde1e6"
PAPER: Final = "#ffffff"
PREDICTED: Final = "#0072b2"
SIMULATED: Final = "#d55e00"
FLOWN: Final = "#009e73"
UNUSED: Final = "#a3abb5"
BAND: Final = "#e69f00"

THEME: Final[dict[str, str]] = {
    INK: "ink",
    MUTED: "muted",
    GRID: "grid",
    PAPER: "paper",
    PREDICTED: "predicted",
    SIMULATED: "simulated",
    FLOWN: "flown",
    UNUSED: "unused",
    BAND: "band",
}
"""Color -> its name in the report's style sheet, which has a light and a dark value for each."""

WIDTH: Final = 7.4
"""Inches of a figure that fills the page; text of 9 points is then as large as the page's own small text."""
LINE: Final = 1.6
THIN: Final = 0.9
SOLID: Final = "-"
DASHED: Final = (0, (5, 2.2))
DOTTED: Final = (0, (1, 1.8))
_PATH: Final = re.compile(r'\bd="[^"]*"')
_LONG: Final = re.compile(r"(\.\d\d)\d+")  # a hundredth of a point is finer than any screen
_TRAILING: Final = re.compile(r"[ \t]+$", flags=re.MULTILINE)

_RC: Final[dict[str, Any]] = {
    "axes.axisbelow": True,
    "axes.edgecolor": MUTED,
    "axes.facecolor": "none",
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.labelsize": 9.0,
    "axes.linewidth": 0.7,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.titlesize": 9.0,
    "axes.titleweight": "bold",
    "axes.unicode_minus": True,
    "figure.facecolor": PAPER,  # a file of its own must be readable on any ground
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.5,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "legend.edgecolor": GRID,
    "legend.facecolor": PAPER,
    "legend.fontsize": 8.0,
    "legend.framealpha": 0.92,
    "legend.labelcolor": INK,
    "lines.linewidth": LINE,
    "lines.markersize": 5.5,
    "path.simplify_threshold": 0.4,  # pixels at 72 dpi: invisible, and noise takes a third of the space
    "svg.fonttype": "none",  # text stays text: it can be searched, read aloud and copied
    "text.color": INK,
    "xtick.color": MUTED,
    "xtick.labelcolor": INK,
    "xtick.labelsize": 8.0,
    "ytick.color": MUTED,
    "ytick.labelcolor": INK,
    "ytick.labelsize": 8.0,
}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """A finished figure.

    Attributes:
        name: its file name without suffix; unique within a report.
        title: what it shows, a few words.
        caption: how to read it, sentences.
        alt: what can be seen, in words, for those who do not see it.
        svg: the picture, a whole SVG document.
    """

    name: str
    title: str
    caption: str
    alt: str
    svg: str


@contextmanager
def styled(name: str) -> Iterator[None]:
    """Draw in the style of all figures; matplotlib's own settings are restored behind it."""
    settings: Any = {**mpl.rcParamsDefault, **_RC, "svg.hashsalt": name}
    settings.pop("backend")  # to touch it would choose one and load pyplot with its global state
    with mpl.rc_context(settings):
        yield


def new_figure(height: float, *, width: float = WIDTH) -> Figure:
    """Return an empty figure that lays itself out; size in inches. Use it inside ``styled``."""
    return Figure(figsize=(width, height), layout="constrained")


def svg(figure: Figure) -> str:
    """Return a figure as SVG: the same text for the same figure, without date or origin."""
    target = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    canvas: Any = FigureCanvasSVG(figure)
    canvas.print_svg(target, metadata=nothing)
    text = _PATH.sub(lambda found: _LONG.sub(r"\1", found[0]), target.getvalue())
    return _TRAILING.sub("", text)


def legend(axes: Axes, **options: Any) -> None:
    """Give axes a legend inside, if anything has a label."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(borderpad=0.6, handlelength=2.6, **options)


def legend_above(axes: Axes, *, columns: int, order: Sequence[str] = ()) -> None:
    """Give axes a legend above, where it hides nothing; labels of ``order`` come first."""
    handles, labels = axes.get_legend_handles_labels()
    if not handles:
        return
    ranked = sorted(
        zip(labels, handles, strict=True), key=lambda item: order.index(item[0]) if item[0] in order else len(order)
    )
    axes.legend(
        [handle for _, handle in ranked],
        [label for label, _ in ranked],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.2,
        columnspacing=1.6,
        frameon=False,
        handlelength=2.6,
        ncols=columns,
    )
