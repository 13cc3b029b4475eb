"""The trace of the linearized motion along the branch of equilibria: the paper's a₀ over the elevator."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from finback.dynamics.any_form import AnyAnalysis
from finback.units import from_si
from finback.views import style
from finback.views.bifurcation_figure import KINDS, draw_branches
from finback.views.labels import axis_label
from finback.views.picture import Picture, picture_of
from finback.views.style import Drawing


def trace_over_elevator(analysis: AnyAnalysis) -> Drawing:
    """Draw the trace of the Jacobian on every equilibrium over the elevator, with folds and zeros."""
    picture = picture_of(analysis)
    with style.styled("trace"):
        figure = style.new_figure(3.6)
        axes = figure.add_subplot()
        axes.axhline(0.0, color=style.MUTED, linewidth=style.THIN)
        draw_branches(axes, picture.branches, [branch.divergence_1_s for branch in picture.branches])
        _draw_points(axes, picture)
        low, high = from_si(np.array(picture.elevator_range_rad), "deg")
        axes.set_xlim(low, high)
        _limit(axes, picture)
        axes.set_xlabel(axis_label("elevator_rad"))
        axes.set_ylabel("a₀ = trace [1/s]")
        style.legend_above(axes, columns=3, order=[name for name, *_ in KINDS])
        drawn = style.svg(figure)
    zeros = sum(map(len, (picture.hopf_points, picture.neutral_saddles, picture.bogdanov_takens)))
    return Drawing(
        name="trace",
        title="Trace along the branch",
        caption=(
            "The sum of the two eigenvalues of each equilibrium over the elevator: the paper's a₀. Below zero the "
            "motion contracts. A zero on a stretch that is not a saddle is a Hopf point; on a saddle it is none."
        ),
        alt=f"Trace of the linearized motion over the elevator, with {len(picture.folds)} folds and {zeros} zeros.",
        svg=drawn,
    )


def _draw_points(axes: Axes, picture: Picture) -> None:
    if picture.folds:
        elevator = [from_si(fold.elevator_rad, "deg") for fold in picture.folds]
        axes.plot(
            elevator,
            picture.fold_traces_1_s,
            color=style.PREDICTED,
            marker="D",
            linestyle="none",
            label="fold",
            zorder=4,
        )
    for zeros, name, marker in (
        (picture.hopf_points, "Hopf point", "*"),
        (picture.neutral_saddles, "zero on a saddle (no bifurcation)", "o"),
        (picture.bogdanov_takens, "Bogdanov–Takens point", "s"),
    ):
        if zeros:
            hopf = marker == "*"
            elevator = [from_si(place, "deg") for place, _ in zeros]
            look = style.SIMULATED if hopf else style.PAPER
            axes.plot(
                elevator,
                [0.0] * len(zeros),
                color=style.SIMULATED if hopf else style.PREDICTED,
                marker=marker,
                markerfacecolor=look,
                linestyle="none",
                label=name,
                zorder=4,
            )


def _limit(axes: Axes, picture: Picture) -> None:
    """Show the part of the branches inside the ranges."""
    (low, high), (least, most) = picture.elevator_range_rad, picture.alpha_range_rad
    parts = [
        branch.divergence_1_s[
            (low <= branch.elevator_rad)
            & (branch.elevator_rad <= high)
            & (least <= branch.alpha_rad)
            & (branch.alpha_rad <= most)
        ]
        for branch in picture.branches
    ]
    shown = np.concatenate([np.empty(0), *parts])
    if shown.size:
        margin = 0.06 * max(float(np.ptp(shown)), 0.1)
        axes.set_ylim(float(shown.min()) - margin, float(shown.max()) + margin)
