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
from matplotlib.backends.backend_agg import FigureCanvasAgg
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
PURPLE: Final = "#cc79a7"
SKY: Final = "#56b4e9"

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
COLUMN: Final = 3.54
"""Inches of one column of a journal (90 mm); two with the gap between them are ``PAGE``."""
PAGE: Final = 7.48
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

_PRINT: Final[dict[str, Any]] = {
    "axes.axisbelow": False,
    "axes.edgecolor": INK,
    "axes.facecolor": PAPER,
    "axes.grid": False,
    "axes.linewidth": 0.6,
    "axes.spines.right": True,
    "axes.spines.top": True,
    "axes.titleweight": "normal",
    "font.family": "STIXGeneral",
    "font.size": 8.5,
    "legend.borderpad": 0.4,
    "legend.edgecolor": INK,
    "legend.fancybox": False,
    "legend.fontsize": 7.5,
    "legend.framealpha": 1.0,
    "legend.handlelength": 2.4,
    "legend.labelspacing": 0.35,
    "lines.dashed_pattern": (5.0, 2.2),
    "lines.dotted_pattern": (1.0, 1.8),
    "lines.linewidth": 1.1,
    "lines.markersize": 4.5,
    "mathtext.fontset": "stix",
    "patch.linewidth": 0.6,
    "path.simplify_threshold": 0.12,  # points of the SVG: a twentieth of a millimeter, below any printer's grain
    "savefig.dpi": 220,
    "svg.fonttype": "path",  # symbols with accents are set the same way everywhere only as outlines
    "xtick.color": INK,
    "xtick.direction": "in",
    "xtick.major.width": 0.6,
    "xtick.top": True,
    "ytick.color": INK,
    "ytick.direction": "in",
    "ytick.major.width": 0.6,
    "ytick.right": True,
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
    with _set(name, _RC):
        yield


@contextmanager
def printed(name: str) -> Iterator[None]:
    """Draw in the style of a printed journal: the same colors, framed axes, ticks inside, text as outlines."""
    with _set(name, {**_RC, **_PRINT}):
        yield


@contextmanager
def _set(name: str, chosen: dict[str, Any]) -> Iterator[None]:
    settings: Any = {**mpl.rcParamsDefault, **chosen, "svg.hashsalt": name}
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


def png(figure: Figure) -> bytes:
    """Return a figure as PNG, as finely as the style says."""
    target = io.BytesIO()
    canvas: Any = FigureCanvasAgg(figure)
    canvas.figure.savefig(target, format="png")
    return target.getvalue()


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
