"""The trace of the linearized motion along the branch of equilibria: the paper's a₀ over the elevator."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from finback.dynamics.analysis import Analysis
from finback.units import from_si
from finback.views import style
from finback.views.bifurcation_figure import KINDS, draw_branch
from finback.views.labels import axis_label
from finback.views.style import Drawing


def trace_over_elevator(analysis: Analysis) -> Drawing:
    """Draw the trace of the Jacobian on every equilibrium over the elevator, with folds and zeros."""
    with style.styled("trace"):
        figure = style.new_figure(3.6)
        axes = figure.add_subplot()
        axes.axhline(0.0, color=style.MUTED, linewidth=style.THIN)
        draw_branch(axes, analysis.branch, analysis.branch.divergence_1_s)
        _draw_points(axes, analysis)
        low, high = from_si(np.array(analysis.options.elevator_range_rad), "deg")
        axes.set_xlim(low, high)
        _limit(axes, analysis)
        axes.set_xlabel(axis_label("elevator_rad"))
        axes.set_ylabel("a₀ = trace [1/s]")
        style.legend_above(axes, columns=3, order=[name for name, *_ in KINDS])
        picture = style.svg(figure)
    zeros = sum(map(len, (analysis.hopf_points, analysis.neutral_saddles, analysis.bogdanov_takens)))
    return Drawing(
        name="trace",
        title="Trace along the branch",
        caption=(
            "The sum of the two eigenvalues of each equilibrium over the elevator: the paper's a₀. Below zero the "
            "motion contracts. A zero on a stretch that is not a saddle is a Hopf point; on a saddle it is none."
        ),
        alt=f"Trace of the linearized motion over the elevator, with {len(analysis.folds)} folds and {zeros} zeros.",
        svg=picture,
    )


def _draw_points(axes: Axes, analysis: Analysis) -> None:
    if analysis.folds:
        elevator = [from_si(fold.elevator_rad, "deg") for fold in analysis.folds]
        trace = [fold.divergence_1_s for fold in analysis.folds]
        axes.plot(elevator, trace, color=style.PREDICTED, marker="D", linestyle="none", label="fold", zorder=4)
    for zeros, name, marker in (
        (analysis.hopf_points, "Hopf point", "*"),
        (analysis.neutral_saddles, "zero on a saddle (no bifurcation)", "o"),
        (analysis.bogdanov_takens, "Bogdanov–Takens point", "s"),
    ):
        if zeros:
            hopf = marker == "*"
            elevator = [from_si(zero.elevator_rad, "deg") for zero in zeros]
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


def _limit(axes: Axes, analysis: Analysis) -> None:
    """Show the part of the branch inside the elevator range."""
    low, high = analysis.options.elevator_range_rad
    shown = analysis.branch.divergence_1_s[
        (low <= analysis.branch.elevator_rad) & (analysis.branch.elevator_rad <= high)
    ]
    if shown.size:
        margin = 0.06 * max(float(np.ptp(shown)), 0.1)
        axes.set_ylim(float(shown.min()) - margin, float(shown.max()) + margin)
