"""A comparison of trajectories as a table on stdout and as JSON."""

from __future__ import annotations

from typing import Any

from rich.markup import escape

from finback.cli import terminal
from finback.cli.judged import JUDGED
from finback.cli.numbers import plain, written
from finback.units import from_si
from finback.validation.compare import ChannelComparison, TrajectoryComparison


def show(comparison: TrajectoryComparison) -> None:
    """Print the verdict, then a row for each channel, then what the tolerances rest on."""
    console = terminal.open_console()
    said = comparison.verdict.value.upper() if comparison.metrics else "not judged: the map has no tolerance"
    console.print(f"verdict  [{JUDGED[comparison.verdict]}]{said}[/]")
    table = terminal.new_table("channel", "unit", "worst", "at [s]", "RMSE", "Theil", "tolerance", "judgement")
    sources: list[str] = []
    for channel in comparison.channels:
        sources = list(dict.fromkeys([*sources, *(metric.source for metric in channel.metrics)]))
        table.add_row(*_cells(channel, sources))
    terminal.print_table(console, table)
    for number, source in enumerate(sources, start=1):
        terminal.print_line(console, f"({number}) {source}")
    terminal.print_line(console, f"compared {comparison.start_s:.9g} to {comparison.end_s:.9g} s")
    if comparison.uncovered_s > 0.0:
        terminal.print_line(console, f"note     {comparison.uncovered_s:.6g} s of the reference are not covered")
    told: dict[str, list[str]] = {}
    for channel in comparison.channels:
        said_of = [
            f"{count} {what}"
            for count, what in (
                (channel.interpolated, f"of {channel.time_s.size} times lie between our samples"),
                (channel.missing, "rows of the reference hold no number"),
                (sum(not metric.counted for metric in channel.metrics), "tolerances hold, but not all is covered"),
            )
            if count
        ]
        if channel.suspicion:
            terminal.print_line(console, f"note     {channel.name}: {channel.suspicion}")
        if said_of:
            told.setdefault("; ".join(said_of), []).append(channel.name)
    for words, names in told.items():  # what is true of many channels is told once
        several = len(names) > 1 and len(names) == len(comparison.channels)
        terminal.print_line(console, f"note     {'every channel' if several else ', '.join(names)}: {words}")


def _cells(channel: ChannelComparison, sources: list[str]) -> tuple[str, ...]:
    measures = [metric.name.rsplit(": ")[-1] for metric in channel.metrics]
    bounds = [
        f"{measure} {plain(_in_map_unit(metric.tolerance, channel, metric.unit))} ({sources.index(metric.source) + 1})"
        for measure, metric in zip(measures, channel.metrics, strict=True)
    ]
    judged = [
        f"{measure if len(measures) > 1 else ''} [{JUDGED[metric.judgement]}]{metric.judgement.value}[/]".strip()
        for measure, metric in zip(measures, channel.metrics, strict=True)
    ]
    return (
        escape(channel.name.removesuffix(f"_{channel.unit}")),
        written(channel.map_unit),
        plain(_in_map_unit(channel.worst, channel, channel.unit)),
        plain(channel.worst_time_s),
        plain(_in_map_unit(channel.rmse, channel, channel.unit)),
        plain(channel.theil.coefficient),
        escape(", ".join(bounds)) or "–",
        ", ".join(judged) or "–",
    )


def _in_map_unit(value: float, channel: ChannelComparison, unit: str) -> float:
    """Return a value as the map would write it; a pure number that measures another quantity stays."""
    return from_si(value, channel.map_unit) if unit == channel.unit else value


def document(comparison: TrajectoryComparison) -> dict[str, Any]:
    """Return the comparison as JSON holds it, in SI."""
    return {
        "schema": "finback/comparison/1",
        "flight": comparison.name,
        "reference": comparison.reference,
        "start_s": comparison.start_s,
        "end_s": comparison.end_s,
        "uncovered_s": comparison.uncovered_s,
        "verdict": comparison.verdict.value if comparison.metrics else "not judged",
        "channels": [
            {
                "name": channel.name,
                "reference": channel.reference,
                "unit": channel.unit,
                "samples": channel.time_s.size,
                "interpolated": channel.interpolated,
                "missing": channel.missing,
                "suspicion": channel.suspicion,
                "worst": channel.worst,
                "worst_time_s": channel.worst_time_s,
                "rmse": channel.rmse,
                "theil": {
                    "coefficient": channel.theil.coefficient,
                    "bias": channel.theil.bias,
                    "variance": channel.theil.variance,
                    "covariance": channel.theil.covariance,
                },
                "metrics": [
                    {
                        "name": metric.name,
                        "unit": metric.unit,
                        "value": metric.predicted,
                        "tolerance": metric.tolerance,
                        "source": metric.source,
                        "judgement": metric.judgement.value,
                    }
                    for metric in channel.metrics
                ],
            }
            for channel in comparison.channels
        ],
    }
