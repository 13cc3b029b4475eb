"""An analysis as tables on stdout: one for each kind of located object, made from the layout that all share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from rich.markup import escape
from rich.table import Table

from finback.arrays import FloatArray
from finback.cli import terminal
from finback.cli.numbers import head, measured, plain, shown
from finback.cli.region_tables import planar_regimes_table, planar_regions_table, regimes_table, regions_table
from finback.dynamics.analysis import Analysis
from finback.dynamics.any_form import AnyAnalysis
from finback.dynamics.cycle.family import CycleFamily
from finback.dynamics.equation import Equation, equation
from finback.dynamics.located import Estimate, Located, located
from finback.dynamics.located_planar import located_planar
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.dynamics.planar.cycle_family import PlanarCycleFamily
from finback.units import quantity_of, unit_of

LISTED: Final = ("equilibrium", "cycle")
"""Kinds that are counted here and listed in the JSON only: there may be hundreds."""

_REMARKED: Final = "resolved"  # a word that is said only where it is not so
_TURNS: Final = "turns"  # a property that is shown only where it differs
_EXACT: Final = 10  # digits of the ends of a family that are located
_PLANAR: Final = 6  # of ends that are those of its last cycle


_POWERS: Final = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLURAL: Final = {"equilibrium": "equilibrium points", "cycle": "limit cycles"}
_NOWHERE: Final = "nowhere; --output FILE keeps it"


def show_analysis(source: Mapping[str, str], analysis: AnyAnalysis) -> None:
    """Print what was found.

    Args:
        source: ``run`` or ``model`` -> path; ``form`` -> ``lienard``, or ``planar`` and why; ``stored`` -> where the
            analysis is kept, empty if nowhere.
        analysis: what was found.
    """
    console = terminal.open_console()
    found = located_planar(analysis) if isinstance(analysis, PlanarAnalysis) else located(analysis)
    tables = [*_tables(analysis, found)]
    for table in tables:
        terminal.print_table(console, table)
    if any("±" in str(cell) for table in tables for column in table.columns for cell in column.cells):
        console.print("± is a 95 % interval", style="dim")
    for line in _counts(found):
        terminal.print_line(console, line)
    for note in analysis.notes:
        terminal.print_line(console, f"note     {note}")
    for key, value in source.items():
        terminal.print_line(console, f"{key:<9}{value or _NOWHERE}")


def _tables(analysis: AnyAnalysis, found: Sequence[Located]) -> Iterator[Table]:
    """Yield all tables that have a row."""
    if isinstance(analysis, Analysis):
        yield _equation(equation(analysis.system))
    for kind in dict.fromkeys(one.kind for one in found):
        if kind not in LISTED:
            yield _table(kind, [one for one in found if one.kind == kind])
    if analysis.limit_cycles.families:
        yield _families(analysis)
    if isinstance(analysis, PlanarAnalysis):
        if len(analysis.regimes) > 1:
            yield planar_regimes_table(analysis)
        if analysis.regions:
            yield planar_regions_table(analysis)
        return
    if len(analysis.regimes) > 1:
        yield regimes_table(analysis.regimes)
    if analysis.regions:
        yield regions_table(analysis.regions, analysis.options.region_alpha_rad)


def _equation(equation: Equation) -> Table:
    """Return the coefficients of the reduced equation, in SI: one column for each power of alpha."""
    highest = max(len(equation.damping), len(equation.force))
    powers = [f"alpha{str(k).translate(_POWERS) if k > 1 else ''}" if k else "1" for k in range(highest)]
    table = terminal.new_table("alpha'' = f alpha' + g + c₁ elevator + c₂ elevator', in rad", *powers)
    for name, row in (("f [1/s]", equation.damping), ("g [rad/s²]", equation.force)):
        table.add_row(escape(name), *(_in_si(one) for one in row), *[""] * (highest - len(row)))
    for name, one in (("c₁ [1/s²]", equation.elevator_gain), ("c₂ [1/s]", equation.elevator_rate_gain)):
        table.add_row(escape(name), _in_si(one), *[""] * (highest - 1))
    return table


def _in_si(known: Estimate) -> str:
    half = 0.5 * float(known.interval[1] - known.interval[0])
    return measured(known.value, half) if half else f"{known.value:.10g}"


def _counts(found: Sequence[Located]) -> list[str]:
    """Return a line for each kind that is not shown in full."""
    lines = []
    for kind in LISTED:
        members = [one for one in found if one.kind == kind]
        words = Counter(" ".join(one.words.values()) for one in members)
        held = len({one.parameter.value for one in members})
        said = ", ".join(f"{count} {word}" for word, count in words.items())
        values = "value" if held == 1 else "values"
        if members:
            lines.append(
                f"listed   with --json: {len(members)} {_PLURAL[kind]} at {held} {values} of the parameter: {said}"
            )
    return lines


def _table(kind: str, members: Sequence[Located]) -> Table:
    """Return a table of objects of one kind: what it is called, where it is, what is known of it."""
    first = members[0]
    turns = {one.properties[_TURNS].value for one in members if _TURNS in one.properties}
    properties = [name for name in first.properties if name != _TURNS or len(turns) > 1]
    table = terminal.new_table(
        kind,
        *(head(name, estimate.unit) for name, estimate in first.state.items()),
        head(first.parameter.name, first.parameter.unit),
        *(head(name, first.properties[name].unit) for name in properties),
        *(name.replace("_", " ") for name in first.words if name != _REMARKED),
        "",
    )
    for number, one in enumerate(members, start=1):
        table.add_row(
            str(number),
            *(_estimate(estimate.value, estimate.unit, estimate.interval) for estimate in one.state.values()),
            _estimate(one.parameter.value, one.parameter.unit, one.parameter.interval),
            *(_known(one.properties[name]) for name in properties),
            *(escape(word) for name, word in one.words.items() if name != _REMARKED),
            ", ".join(_remarks(one)),
        )
    return table


def _known(known: Estimate) -> str:
    """Write a property: six digits, or what its interval supports."""
    half = 0.5 * float(known.interval[1] - known.interval[0]) if known.interval.size else 0.0
    value = shown(known.value, known.unit)
    return measured(value, shown(half, known.unit)) if half else plain(value)


def _remarks(one: Located) -> Iterator[str]:
    if one.words.get(_REMARKED) == "unresolved":
        yield "unresolved"
    if not one.in_domain:
        yield "extrapolated"


def _families(analysis: AnyAnalysis) -> Table:
    """Return a table of the families of limit cycles: from where to where, with how many folds."""
    name = analysis.system.variables[2] if isinstance(analysis, PlanarAnalysis) else "elevator_rad"
    unit = unit_of(name)
    table = terminal.new_table(
        "cycle family", "begins at", head(quantity_of(name), unit), "ends at", head(quantity_of(name), unit), "folds"
    )
    families: tuple[CycleFamily | PlanarCycleFamily, ...] = analysis.limit_cycles.families
    for number, family in enumerate(families, start=1):
        if isinstance(family, CycleFamily):
            names, digits = (family.begin.value, family.end.value), _EXACT
            ends = family.begin_elevator_rad, family.end_elevator_rad
        else:
            names, digits = (family.ends[0].value, family.ends[1].value), _PLANAR
            ends = float(family.parameter[0]), float(family.parameter[-1])
        begin, end = (f"{shown(value, unit):.{digits}g}" for value in ends)
        table.add_row(str(number), names[0], begin, names[1], end, str(len(family.folds)))
    return table


def _estimate(value: float, unit: str, interval: FloatArray) -> str:
    """Write a value with its interval; with ten digits where the model is exact."""
    if not interval.size:
        return plain(shown(value, unit))
    half = 0.5 * float(interval[1] - interval[0])
    return measured(shown(value, unit), shown(half, unit)) if half else f"{shown(value, unit):.10g}"
