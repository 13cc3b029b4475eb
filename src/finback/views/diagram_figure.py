"""Two-parameter diagrams: exact curves solid, first-order estimates dashed, what cannot be resolved dotted."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from finback.arrays import FloatArray
from finback.dynamics.diagram.curve import CurveKind, Diagram, DiagramPoint, PointKind
from finback.views import style

COLORS: Final[dict[CurveKind, str]] = {
    CurveKind.FOLD: style.INK,
    CurveKind.TRANSCRITICAL: style.INK,
    CurveKind.PITCHFORK: style.INK,
    CurveKind.INFINITY: style.MUTED,
    CurveKind.HOPF: style.PREDICTED,
    CurveKind.HOMOCLINIC: style.SIMULATED,
    CurveKind.HETEROCLINIC: style.BAND,
    CurveKind.SADDLE_CYCLE: style.PURPLE,
    CurveKind.CYCLE_FOLD: style.FLOWN,
}
NAMES: Final[dict[CurveKind, str]] = {
    CurveKind.FOLD: "saddle-node",
    CurveKind.TRANSCRITICAL: "transcritical",
    CurveKind.PITCHFORK: "pitchfork",
    CurveKind.INFINITY: "equilibrium at infinity",
    CurveKind.HOPF: "Hopf",
    CurveKind.HOMOCLINIC: "homoclinic",
    CurveKind.HETEROCLINIC: "heteroclinic",
    CurveKind.SADDLE_CYCLE: "double connection",
    CurveKind.CYCLE_FOLD: "fold of cycles",
}
MARKERS: Final[dict[PointKind, tuple[str, str]]] = {
    PointKind.BOGDANOV_TAKENS: ("s", "Bogdanov–Takens"),
    PointKind.BAUTIN: ("^", "Bautin"),
    PointKind.NEUTRAL_LOOP: ("D", "neutral loop"),
    PointKind.TWO_SADDLE_CYCLE: ("P", "two-saddle cycle"),
    PointKind.DOUBLE_HOMOCLINIC: ("*", "double homoclinic"),
    PointKind.CYCLE_CUSP: ("v", "cusp of cycles"),
    PointKind.SADDLE_NODE_LOOP: ("X", "saddle-node loop"),
    PointKind.CROSSING: ("o", "crossing"),
}
"""Kind of a point -> marker and name."""

ESTIMATE: Final = "first order"
UNRESOLVED: Final = "not resolved"

_SOLID: Final = "-"
_DASHED: Final = "--"  # by its name, which a line gives back, so that the legend can tell what is there
_DOTTED: Final = ":"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """A text in a picture.

    Attributes:
        x: where, as shown.
        y: where.
        text: what it says.
        color: of the text; of the curve it names, or ink.
        target: what it points at, as shown; empty if it stands where it belongs.
    """

    x: float
    y: float
    text: str
    color: str = style.INK
    target: tuple[float, ...] = ()


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """What a diagram shows.

    Attributes:
        x: low and high of the abscissa; equal for all of the diagram's.
        y: of the ordinate.
        x_label: symbol and unit.
        y_label: symbol and unit.
        kinds: which curves are shown.
        points: which points are shown, if all curves that meet there are.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    x_label: str = "$b_0$"
    y_label: str = "$a_0$"
    kinds: Collection[CurveKind] = tuple(CurveKind)
    points: Collection[PointKind] = tuple(PointKind)


def draw_diagram(axes: Axes, diagram: Diagram, window: Window, notes: Sequence[Note] = ()) -> None:
    """Draw the curves and points of a diagram, μ across and λ up, and texts."""
    _frame(axes, window)
    shown = [curve for curve in diagram.curves if curve.kind in window.kinds]
    for curve in shown:
        if curve.kind.is_line:
            axes.axvline(curve.mu[0], color=COLORS[curve.kind], linewidth=1.2, zorder=3, label=NAMES[curve.kind])
        else:
            draw_curve(axes, curve.kind, (curve.mu, curve.lam), exact=curve.exact, resolved=curve.resolved)
    names = {curve.name for curve in shown}
    for point in diagram.points:
        if point.kind in window.points and names.issuperset(point.curves) and _inside(point, window):
            draw_point(axes, point.kind, point.mu, point.lam)
    draw_notes(axes, notes)


def draw_curve(
    axes: Axes,
    kind: CurveKind,
    points: tuple[FloatArray, FloatArray],
    *,
    exact: bool,
    resolved: NDArray[np.bool_] | None = None,
) -> None:
    """Draw one curve in the look of its kind; points that are not resolved are dotted."""
    x, y = points
    known = np.ones(x.size, dtype=np.bool_) if resolved is None else resolved
    for rows, clear in _runs(known):
        line = (_SOLID if exact else _DASHED) if clear else _DOTTED
        width = 1.2 if exact else 1.0
        axes.plot(x[rows], y[rows], color=COLORS[kind], linestyle=line, linewidth=width, zorder=3, label=NAMES[kind])


def draw_point(axes: Axes, kind: PointKind, x: float, y: float) -> None:
    """Mark one point."""
    marker, name = MARKERS[kind]
    axes.plot([x], [y], label=name, **_look(kind, marker))


def _look(kind: PointKind, marker: str) -> dict[str, Any]:
    face = style.PAPER if kind is PointKind.CROSSING else style.INK
    size = 3.2 if kind is PointKind.CROSSING else 5.0
    edge = {"color": style.INK, "markeredgewidth": 0.7, "linestyle": "none", "zorder": 5}
    return {"marker": marker, "markersize": size, "markerfacecolor": face, **edge}


def draw_notes(axes: Axes, notes: Sequence[Note]) -> None:
    """Write texts, each centered at its place, with a line to what it points at."""
    for note in notes:
        arrow = {"arrowstyle": "-", "color": style.MUTED, "linewidth": 0.5, "shrinkA": 0.0, "shrinkB": 1.0}
        target = (note.target[0], note.target[1]) if note.target else (note.x, note.y)
        axes.annotate(
            note.text,
            target,
            xytext=(note.x, note.y),
            color=note.color,
            ha="center",
            va="center",
            arrowprops=arrow if note.target else None,
            zorder=7,
            annotation_clip=False,
        )


def legend_panel(axes: Axes, kinds: Sequence[CurveKind], points: Sequence[PointKind], **options: Any) -> None:
    """Fill axes with the meaning of curves and points, and of dashed lines, instead of a picture."""
    axes.set_axis_off()
    for kind in kinds:
        draw_curve(axes, kind, (np.empty(0), np.empty(0)), exact=True)
    for point in points:
        marker, name = MARKERS[point]
        axes.plot([], [], label=name, **_look(point, marker))
    draw_curve(axes, kinds[0], (np.empty(0), np.empty(0)), exact=False)
    diagram_legend(axes, loc="center", frameon=False, fontsize=8.5, labelspacing=0.7, **options)


def diagram_legend(axes: Axes, **options: Any) -> None:
    """Give axes a legend that names each kind once, and what dashed and dotted lines mean where there are any."""
    handles: dict[str, Line2D] = {}
    broken = {ESTIMATE: False, UNRESOLVED: False}
    for line in axes.get_lines():
        name = str(line.get_label())
        if name in NAMES.values() or name in {text for _, text in MARKERS.values()}:
            marked = line.get_marker() not in (None, "None", "")
            copy = Line2D([], [], color=line.get_color(), linewidth=0.0 if marked else 1.2)
            if marked:
                copy.set_marker(line.get_marker())
                copy.set_markersize(line.get_markersize())
                copy.set_markerfacecolor(line.get_markerfacecolor())
                copy.set_markeredgewidth(line.get_markeredgewidth())
            handles.setdefault(name, copy)
            broken[ESTIMATE] |= line.get_linestyle() == _DASHED and not marked
            broken[UNRESOLVED] |= line.get_linestyle() == _DOTTED and not marked
    if broken[ESTIMATE]:
        handles[ESTIMATE] = Line2D([], [], color=style.INK, linestyle=_DASHED, linewidth=1.0)
    if broken[UNRESOLVED]:
        handles[UNRESOLVED] = Line2D([], [], color=style.INK, linestyle=_DOTTED, linewidth=1.0)
    if handles:
        axes.legend(list(handles.values()), list(handles), **options)


def _frame(axes: Axes, window: Window) -> None:
    axes.set_xlim(*window.x)
    axes.set_ylim(*window.y)
    axes.set_xlabel(window.x_label)
    axes.set_ylabel(window.y_label)


def _inside(point: DiagramPoint, window: Window) -> bool:
    return window.x[0] <= point.mu <= window.x[1] and window.y[0] <= point.lam <= window.y[1]


def _runs(flags: NDArray[np.bool_]) -> Iterator[tuple[slice, bool]]:
    """Yield stretches of equal flags; neighbors share a point. Of no flags, one empty stretch."""
    edges = [0, *(np.flatnonzero(np.diff(flags)) + 1).tolist(), flags.size]
    if not flags.size:
        yield slice(0, 0), True
        return
    for start, stop in pairwise(edges):
        yield slice(start, min(stop + 1, flags.size)), bool(flags[start])
