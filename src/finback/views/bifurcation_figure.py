"""The bifurcation diagram: every equilibrium over the elevator, predicted and simulated."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes

from finback.arrays import FloatArray
from finback.digits import NOT_DETERMINED, supported
from finback.dynamics.any_form import AnyAnalysis
from finback.dynamics.branch import Branch
from finback.units import from_si, to_si
from finback.validation.prediction import PredictedFold
from finback.validation.validate import Validation
from finback.views import style
from finback.views.labels import axis_label, minus, with_error
from finback.views.picture import Picture, Place, picture_of
from finback.views.style import Drawing

KINDS: Final = (
    ("predicted, stable", style.SOLID, style.LINE),
    ("predicted, unstable", style.DASHED, style.LINE),
    ("predicted, outside the fitted domain", style.DOTTED, style.LINE),
)
_MARGIN: Final = 0.03  # of the range of an axis
_NEAR: Final = to_si(2.0, "deg")  # rad of alpha: far enough from a fold to see its sides


def bifurcation_diagram(analysis: AnyAnalysis, validation: Validation) -> Drawing:
    """Draw alpha over elevator: predicted branch, simulated equilibria, folds with their 95 % intervals."""
    picture = picture_of(analysis)
    with style.styled("bifurcation"):
        figure = style.new_figure(4.6)
        axes = figure.add_subplot()
        _limit(axes, picture)
        draw_branches(axes, picture.branches, [from_si(branch.alpha_rad, "deg") for branch in picture.branches])
        _draw_equilibria(axes, validation)
        for fold in picture.folds:
            _draw_fold(axes, fold, picture.branches)
        _draw_cycles(axes, picture)
        _draw_hopf(axes, picture.hopf_points)
        _draw_connections(axes, picture)
        style.legend_above(axes, columns=3, order=[name for name, *_ in KINDS])
        drawn = style.svg(figure)
    return Drawing(
        name="bifurcation",
        title="Bifurcation diagram",
        caption=(
            "Equilibria over the elevator. The line is the identified model's branch: solid where stable, dashed where "
            "unstable, dotted where no data supported the model. Points are equilibria of the full simulator: filled "
            "stable, open unstable. At a fold (diamond, with the 95 % interval of its elevator) a stable and an "
            "unstable equilibrium meet; beyond it the aircraft jumps. A gray vertical line joins the saddles of a "
            "saddle connection, where the stability region changes its boundary."
        ),
        alt=minus(_words(picture, validation)),
        svg=drawn,
    )


def draw_branches(axes: Axes, branches: Sequence[Branch], shown: Sequence[FloatArray]) -> None:
    """Draw a quantity (n,) of each branch over the elevator, each stretch by its kind."""
    labeled: set[int] = set()
    for branch, values in zip(branches, shown, strict=True):
        elevator = from_si(branch.elevator_rad, "deg")
        for kind, rows in stretches(branch):
            name, line, width = KINDS[kind]
            label = None if kind in labeled else name
            labeled.add(kind)
            axes.plot(elevator[rows], values[rows], color=style.PREDICTED, linestyle=line, linewidth=width, label=label)


def stretches(branch: Branch) -> Iterator[tuple[int, slice]]:
    """Yield stretches of one kind: 0 stable, 1 unstable, 2 outside the domain; neighbors share a point."""
    kind = np.where(branch.in_domain, np.where(branch.stable, 0, 1), 2)
    edges = [0, *(np.flatnonzero(np.diff(kind)) + 1).tolist(), kind.size]
    for start, stop in pairwise(edges):
        if start < stop:
            yield int(kind[start]), slice(start, min(stop + 1, kind.size))


def _draw_equilibria(axes: Axes, validation: Validation) -> None:
    for stable, name in ((True, "simulated, stable"), (False, "simulated, unstable")):
        points = [point for point in validation.equilibria if point.stable is stable]
        look: dict[str, Any] = {"color": style.SIMULATED, "linestyle": "none", "marker": "o", "zorder": 4}
        look |= {"markerfacecolor": style.SIMULATED if stable else style.PAPER, "markeredgewidth": 1.2}
        if points:
            elevator = [from_si(point.elevator_rad, "deg") for point in points]
            axes.plot(elevator, [from_si(point.alpha_rad, "deg") for point in points], label=name, **look)


def _draw_cycles(axes: Axes, picture: Picture) -> None:
    """Draw the least and the greatest alpha of each family of limit cycles: solid where stable, dashed where not."""
    label: str | None = "predicted, limit cycle: least and greatest α"
    for curve in picture.cycles:
        look: dict[str, Any] = {"color": style.PREDICTED, "linewidth": style.THIN}
        look["linestyle"] = style.SOLID if curve.stable else style.DASHED
        for ends in (curve.alpha_min_rad, curve.alpha_max_rad):
            axes.plot(from_si(curve.elevator_rad, "deg"), from_si(ends, "deg"), label=label, **look)
            label = None


def _draw_hopf(axes: Axes, found: Sequence[Place]) -> None:
    if found:
        elevator, alpha = ([from_si(value, "deg") for value in values] for values in zip(*found, strict=True))
        look: dict[str, Any] = {"color": style.PREDICTED, "marker": "*", "markersize": 9.0, "linestyle": "none"}
        axes.plot(elevator, alpha, label="predicted, Hopf point", zorder=5, **look)


def _draw_connections(axes: Axes, picture: Picture) -> None:
    """Join the saddles of each connection, from where the orbit leaves to where it ends; a loop to where it turns."""
    for number, (elevator_rad, start_rad, end_rad) in enumerate(picture.connections):
        elevator, start, end = (from_si(value, "deg") for value in (elevator_rad, start_rad, end_rad))
        label = "" if number else "predicted, saddle connection"
        look: dict[str, Any] = {"color": style.MUTED, "linewidth": style.THIN, "zorder": 3}
        axes.plot([elevator, elevator], [start, end], linestyle=style.DASHED, label=label or None, **look)
        middle = 0.5 * (start + end)
        axes.annotate(
            "",
            (elevator, middle + 1e-3 * (end - start)),
            xytext=(elevator, middle),
            arrowprops={"arrowstyle": "-|>", "color": style.MUTED, "linewidth": style.THIN},
            zorder=3,
        )


def _draw_fold(axes: Axes, fold: PredictedFold, branches: Sequence[Branch]) -> None:
    elevator, alpha = from_si(fold.elevator_rad, "deg"), from_si(fold.alpha_rad, "deg")
    low, high = from_si(fold.elevator_interval_rad, "deg")
    if np.isfinite([low, high]).all():
        axes.plot([low, high], [alpha, alpha], color=style.PREDICTED, linewidth=2.4, alpha=0.5, zorder=4)
    fill = style.PREDICTED if fold.in_domain else style.PAPER
    axes.plot(elevator, alpha, color=style.PREDICTED, marker="D", markersize=6.0, markerfacecolor=fill, zorder=5)
    text = f"fold at δe {_said(with_error(elevator, 0.5 * (high - low)))}\nα {_said(_alpha_text(fold))}"
    outward, up = _free_side(fold, branches)
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    axes.annotate(
        text if fold.in_domain else f"{text} (extrapolated)",
        (elevator, alpha),
        xytext=(elevator + outward * 0.045 * (right - left), alpha + up * 0.24 * (top - bottom)),
        arrowprops={
            "arrowstyle": "-",
            "color": style.MUTED,
            "linewidth": 0.7,
            "relpos": (0.06 if outward < 0 else 0.94, 0.0 if up > 0 else 1.0),
            "shrinkB": 4.0,
        },
        ha="left" if outward < 0 else "right",
        va="bottom" if up > 0 else "top",
        fontsize=8.0,
        zorder=6,
    )


def _said(text: str) -> str:
    return text if text == NOT_DETERMINED else f"= {text}°"


def _alpha_text(fold: PredictedFold) -> str:
    """Return the fold's alpha in degrees, two decimals at most and no more than its interval supports."""
    alpha, (low, high) = from_si(fold.alpha_rad, "deg"), from_si(fold.alpha_interval_rad, "deg")
    if not math.isfinite(high - low):
        return NOT_DETERMINED
    return minus(supported(alpha, 0.5 * (high - low), most=2)[0] if high > low else f"{alpha:.2f}")


def _free_side(fold: PredictedFold, branches: Sequence[Branch]) -> tuple[int, int]:
    """Return where a fold leaves room: in elevator beyond it, in alpha on the stable branch's side; each -1 or 1."""
    near = [branch for branch in branches if branch.alpha_rad.size]
    if not near:
        return 1, 1
    branch = min(near, key=lambda one: float(_distance(fold, one).min()))
    below, above = (
        np.flatnonzero(side)
        for side in (branch.alpha_rad < fold.alpha_rad - _NEAR, branch.alpha_rad > fold.alpha_rad + _NEAR)
    )
    if not (below.size and above.size):
        return 1, 1
    # A branch may turn round in alpha: of each side, the point nearest to the fold.
    low, high = (int(side[_distance(fold, branch)[side].argmin()]) for side in (below, above))
    inward = float(branch.elevator_rad[low] + branch.elevator_rad[high]) / 2 - fold.elevator_rad
    return (-1 if inward > 0 else 1), (1 if branch.stable[high] else -1)


def _distance(fold: PredictedFold, branch: Branch) -> FloatArray:
    return np.hypot(branch.alpha_rad - fold.alpha_rad, branch.elevator_rad - fold.elevator_rad)


def _limit(axes: Axes, picture: Picture) -> None:
    for low, high, limit in (
        (*picture.elevator_range_rad, axes.set_xlim),
        (*picture.alpha_range_rad, axes.set_ylim),
    ):
        margin = _MARGIN * (high - low)
        limit(from_si(low - margin, "deg"), from_si(high + margin, "deg"))
    axes.set_xlabel(axis_label("elevator_rad"))
    axes.set_ylabel(axis_label("alpha_rad"))


def _words(picture: Picture, validation: Validation) -> str:
    folds = "; ".join(
        f"elevator {from_si(fold.elevator_rad, 'deg'):.3f} deg at alpha {from_si(fold.alpha_rad, 'deg'):.2f} deg"
        for fold in picture.folds
    )
    return (
        f"Alpha of the equilibria over the elevator, as predicted, with {len(validation.equilibria)} equilibria of the "
        f"simulator on it. Predicted folds: {folds or 'none'}."
    )
