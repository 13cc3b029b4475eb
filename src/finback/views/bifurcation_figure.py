"""The bifurcation diagram: every equilibrium over the elevator, predicted and simulated."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby, pairwise
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes

from finback.arrays import FloatArray
from finback.dynamics.analysis import Analysis
from finback.dynamics.branch import Branch
from finback.dynamics.fold import Fold
from finback.units import from_si, to_si
from finback.validation.validate import Validation
from finback.views import style
from finback.views.labels import axis_label, minus, with_error
from finback.views.style import Drawing

KINDS: Final = (
    ("predicted, stable", style.SOLID, style.LINE),
    ("predicted, unstable", style.DASHED, style.LINE),
    ("predicted, outside the fitted domain", style.DOTTED, style.LINE),
)
_MARGIN: Final = 0.03  # of the range of an axis
_PLACE: Final = ("elevator_rad", "alpha_rad")
_NEAR: Final = to_si(2.0, "deg")  # rad of alpha: far enough from a fold to see its sides


def bifurcation_diagram(analysis: Analysis, validation: Validation) -> Drawing:
    """Draw alpha over elevator: predicted branch, simulated equilibria, folds with their 95 % intervals."""
    with style.styled("bifurcation"):
        figure = style.new_figure(4.6)
        axes = figure.add_subplot()
        _limit(axes, analysis)
        draw_branch(axes, analysis.branch, from_si(analysis.branch.alpha_rad, "deg"))
        _draw_equilibria(axes, validation)
        for fold in analysis.folds:
            _draw_fold(axes, fold, analysis.branch)
        _draw_cycles(axes, analysis)
        _draw_hopf(axes, analysis)
        _draw_connections(axes, analysis)
        style.legend_above(axes, columns=3, order=[name for name, *_ in KINDS])
        picture = style.svg(figure)
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
        alt=minus(_words(analysis, validation)),
        svg=picture,
    )


def draw_branch(axes: Axes, branch: Branch, shown: FloatArray) -> None:
    """Draw a quantity (n,) of the branch over the elevator, each stretch by its kind."""
    elevator = from_si(branch.elevator_rad, "deg")
    labeled: set[int] = set()
    for kind, rows in stretches(branch):
        name, line, width = KINDS[kind]
        label = None if kind in labeled else name
        labeled.add(kind)
        axes.plot(elevator[rows], shown[rows], color=style.PREDICTED, linestyle=line, linewidth=width, label=label)


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


def _draw_cycles(axes: Axes, analysis: Analysis) -> None:
    """Draw the least and the greatest alpha of each family of limit cycles: solid where stable, dashed where not."""
    label: str | None = "predicted, limit cycle: least and greatest α"
    for family in analysis.limit_cycles.families:
        for stable, stretch in groupby(family.cycles, key=lambda cycle: cycle.stable):
            found = list(stretch)
            elevator = [from_si(cycle.elevator_rad, "deg") for cycle in found]
            look: dict[str, Any] = {"color": style.PREDICTED, "linewidth": style.THIN}
            look["linestyle"] = style.SOLID if stable else style.DASHED
            for ends in ([c.alpha_min_rad for c in found], [c.alpha_max_rad for c in found]):
                axes.plot(elevator, [from_si(end, "deg") for end in ends], label=label, **look)
                label = None


def _draw_hopf(axes: Axes, analysis: Analysis) -> None:
    found = analysis.hopf_points
    if found:
        elevator, alpha = ([from_si(getattr(point, name), "deg") for point in found] for name in _PLACE)
        look: dict[str, Any] = {"color": style.PREDICTED, "marker": "*", "markersize": 9.0, "linestyle": "none"}
        axes.plot(elevator, alpha, label="predicted, Hopf point", zorder=5, **look)


def _draw_connections(axes: Axes, analysis: Analysis) -> None:
    """Join the saddles of each connection, from where the orbit leaves to where it ends; a loop to where it turns."""
    found = analysis.connections
    lines = [(c.elevator_rad, c.from_alpha_rad, c.to_alpha_rad) for c in found.heteroclinics]
    lines += [(c.elevator_rad, c.alpha_rad, c.turn_alpha_rad) for c in found.homoclinics]
    for number, (elevator_rad, start_rad, end_rad) in enumerate(lines):
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


def _draw_fold(axes: Axes, fold: Fold, branch: Branch) -> None:
    elevator, alpha = from_si(fold.elevator_rad, "deg"), from_si(fold.alpha_rad, "deg")
    low, high = from_si(fold.elevator_interval_rad, "deg")
    if np.isfinite([low, high]).all():
        axes.plot([low, high], [alpha, alpha], color=style.PREDICTED, linewidth=2.4, alpha=0.5, zorder=4)
    fill = style.PREDICTED if fold.in_domain else style.PAPER
    axes.plot(elevator, alpha, color=style.PREDICTED, marker="D", markersize=6.0, markerfacecolor=fill, zorder=5)
    text = f"fold at δe = {with_error(elevator, 0.5 * (high - low))}°\nα = {minus(f'{alpha:.2f}')}°"
    outward, up = _free_side(fold, branch)
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


def _free_side(fold: Fold, branch: Branch) -> tuple[int, int]:
    """Return where a fold leaves room: in elevator beyond it, in alpha on the stable branch's side; each -1 or 1."""
    below, above = (
        np.flatnonzero(side)
        for side in (branch.alpha_rad < fold.alpha_rad - _NEAR, branch.alpha_rad > fold.alpha_rad + _NEAR)
    )
    if not (below.size and above.size):
        return 1, 1
    low, high = int(below[-1]), int(above[0])
    inward = float(branch.elevator_rad[low] + branch.elevator_rad[high]) / 2 - fold.elevator_rad
    return (-1 if inward > 0 else 1), (1 if branch.stable[high] else -1)


def _limit(axes: Axes, analysis: Analysis) -> None:
    for low, high, limit in (
        (*analysis.options.elevator_range_rad, axes.set_xlim),
        (*analysis.options.alpha_range_rad, axes.set_ylim),
    ):
        margin = _MARGIN * (high - low)
        limit(from_si(low - margin, "deg"), from_si(high + margin, "deg"))
    axes.set_xlabel(axis_label("elevator_rad"))
    axes.set_ylabel(axis_label("alpha_rad"))


def _words(analysis: Analysis, validation: Validation) -> str:
    folds = "; ".join(
        f"elevator {from_si(fold.elevator_rad, 'deg'):.3f} deg at alpha {from_si(fold.alpha_rad, 'deg'):.2f} deg"
        for fold in analysis.folds
    )
    return (
        f"Alpha of the equilibria over the elevator, as predicted, with {len(validation.equilibria)} equilibria of the "
        f"simulator on it. Predicted folds: {folds or 'none'}."
    )
