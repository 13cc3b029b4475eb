"""A trajectory beside its reference: each channel above, its difference below."""

from __future__ import annotations

from typing import Final

from finback.units import from_si, quantity_of
from finback.validation.compare import ChannelComparison, TrajectoryComparison
from finback.views import style
from finback.views.labels import display_unit, unit_text
from finback.views.style import Drawing

_COLUMNS: Final = 2


def comparison_histories(comparison: TrajectoryComparison) -> Drawing:
    """Draw every channel of both over time, with the difference below it on its own scale."""
    rows = -(-len(comparison.channels) // _COLUMNS)
    with style.styled(comparison.name):
        figure = style.new_figure(2.6 * rows + 0.4)
        grid = figure.add_gridspec(2 * rows, _COLUMNS, height_ratios=(1.6, 1.0) * rows)
        for number, channel in enumerate(comparison.channels):
            row, column = divmod(number, _COLUMNS)
            above = figure.add_subplot(grid[2 * row, column])
            below = figure.add_subplot(grid[2 * row + 1, column], sharex=above)
            unit = display_unit(channel.unit)
            above.plot(
                channel.time_s, from_si(channel.theirs, unit), color=style.SIMULATED, linewidth=2.2, alpha=0.75,
                label="reference",
            )  # fmt: skip
            above.plot(
                channel.time_s, from_si(channel.ours, unit), color=style.PREDICTED, linestyle=style.DASHED,
                linewidth=1.3, label="ours",
            )  # fmt: skip
            below.plot(channel.time_s, from_si(channel.difference, unit), color=style.INK, linewidth=1.0)
            for metric in channel.metrics:
                if metric.name.endswith("worst"):
                    for side in (-1.0, 1.0):
                        below.axhline(side * from_si(metric.tolerance, unit), color=style.MUTED, linewidth=style.THIN)
            above.set_ylabel(f"{quantity_of(channel.name)} [{unit_text(unit)}]")
            below.set_ylabel("difference")
            above.tick_params(labelbottom=False)
            below.set_xlabel("t [s]")
            if number == 0:
                style.legend(above, loc="best")
        picture = style.svg(figure)
    return Drawing(
        name="comparison",
        title=f"{comparison.name} beside {comparison.reference}",
        caption=(
            f"Reference (line) and ours (dashed) from {comparison.start_s:g} to {comparison.end_s:g} s; below each "
            "the difference, ours less the reference, with its tolerance where there is one."
        ),
        alt=f"{len(comparison.channels)} channels over time, {_worst(comparison.channels)}",
        svg=picture,
    )


def _worst(channels: tuple[ChannelComparison, ...]) -> str:
    said = [f"{channel.name} differs by at most {channel.worst:.3g}" for channel in channels]
    return "; ".join(said)
