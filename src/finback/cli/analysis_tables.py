"""An analysis as tables on stdout: one for each kind of located object, made from the layout that all share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Final

from rich.markup import escape
from rich.table import Table

from finback.arrays import FloatArray
from finback.cli import terminal
from finback.cli.numbers import display_unit, measured, plain, shown, to_places, written
from finback.dynamics.analysis import Analysis
from finback.dynamics.located import Located, located
from finback.dynamics.located_planar import located_planar
from finback.dynamics.planar_analysis import PlanarAnalysis
from finback.dynamics.stability_region import StabilityRegion

LISTED: Final = ("equilibrium",)
"""Kinds that are counted here and listed in the JSON only: there are hundreds."""


_NOWHERE: Final = "nowhere; --output FILE keeps it"


def show_analysis(source: Mapping[str, str], analysis: Analysis | PlanarAnalysis) -> None:
    """Print what was found.

    Args:
        source: ``run`` or ``model`` -> path; ``form`` -> ``lienard``, or ``planar`` and why; ``stored`` -> where the
            analysis is kept, empty if nowhere.
        analysis: what was found.
    """
    console = terminal.open_console()
    found = located_planar(analysis) if isinstance(analysis, PlanarAnalysis) else located(analysis)
    for kind in dict.fromkeys(one.kind for one in found):
        if kind not in LISTED:
            terminal.print_table(console, _table(kind, [one for one in found if one.kind == kind]))
    if isinstance(analysis, Analysis) and analysis.regions:
        terminal.print_table(console, _regions(analysis.regions, analysis.options.region_alpha_rad))
    console.print("± is a 95 % interval", style="dim")
    for line in _counts(found):
        terminal.print_line(console, line)
    for note in analysis.notes:
        terminal.print_line(console, f"note     {note}")
    for key, value in source.items():
        terminal.print_line(console, f"{key:<9}{value or _NOWHERE}")


def _counts(found: Sequence[Located]) -> list[str]:
    """Return a line for each kind that is not shown in full."""
    lines = []
    for kind in LISTED:
        members = [one for one in found if one.kind == kind]
        words = Counter(" ".join(one.words.values()) for one in members)
        held = len({one.parameter.value for one in members})
        said = ", ".join(f"{count} {word}" for word, count in words.items())
        if members:
            lines.append(
                f"listed   with --json: {len(members)} {kind} points at {held} values of the parameter: {said}"
            )
    return lines


def _table(kind: str, members: Sequence[Located]) -> Table:
    """Return a table of objects of one kind: what it is called, where it is, what is known of it."""
    first = members[0]
    table = terminal.new_table(
        kind,
        *(_head(name, estimate.unit) for name, estimate in first.state.items()),
        _head(first.parameter.name, first.parameter.unit),
        *(_head(name, quantity.unit) for name, quantity in first.properties.items()),
        *(name.replace("_", " ") for name in first.words),
        "",
    )
    for number, one in enumerate(members, start=1):
        table.add_row(
            str(number),
            *(_estimate(estimate.value, estimate.unit, estimate.interval) for estimate in one.state.values()),
            _estimate(one.parameter.value, one.parameter.unit, one.parameter.interval),
            *(plain(shown(quantity.value, quantity.unit)) for quantity in one.properties.values()),
            *(escape(word) for word in one.words.values()),
            "" if one.in_domain else "extrapolated",
        )
    return table


def _head(name: str, unit: str) -> str:
    words, unit = name.replace("_", " "), written(display_unit(unit))
    return f"{words} [{unit}]" if unit else words


def _estimate(value: float, unit: str, interval: FloatArray) -> str:
    """Write a value with its interval; with ten digits where the model is exact."""
    if not interval.size:
        return plain(shown(value, unit))
    half = 0.5 * float(interval[1] - interval[0])
    return measured(shown(value, unit), shown(half, unit)) if half else f"{shown(value, unit):.10g}"


def _regions(regions: Sequence[StabilityRegion], alpha_range_rad: tuple[float, float]) -> Table:
    low, high = (to_places(shown(end, "rad"), 0) for end in alpha_range_rad)
    table = terminal.new_table(
        "stability region at elevator [deg]",
        "sink alpha [deg]",
        "saddles alpha [deg]",
        f"area in alpha {low} … {high} [deg²/s]",
        "smallest escape [deg]",
        "",
    )
    for region in regions:
        saddles = sorted({branch.saddle_alpha_rad for branch in region.boundary})
        table.add_row(
            to_places(shown(region.elevator_rad, "rad"), 2),
            to_places(shown(region.alpha_rad, "rad"), 2),
            ", ".join(to_places(shown(saddle, "rad"), 2) for saddle in saddles),
            to_places(shown(shown(region.area_rad2_s, "rad"), "rad"), 0),
            to_places(shown(region.escape_distance_rad, "rad"), 2),
            "" if region.in_domain else "extrapolated",
        )
    return table
