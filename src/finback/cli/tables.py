"""Results as tables on stdout."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Final, NoReturn, final

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from finback import pipeline
from finback.arrays import FloatArray
from finback.cli.exits import say
from finback.cli.numbers import decimals, display_unit, measured, plain, shown, to_places, written
from finback.dynamics.analysis import Analysis
from finback.dynamics.polynomial import Polynomial
from finback.identification.identify import Identification
from finback.records import Sweep
from finback.units import to_si, unit_of
from finback.validation.metric import Judgement, Metric
from finback.validation.validate import Validation

_WIDTH: Final = 140  # where stdout is no terminal
_WIDE: Final = 130  # the full table of metrics needs this much
_NARROW: Final = 80  # below this a table is a list
_FINEST: Final = 1e-4  # of a tolerance: nobody needs to see less
_STYLE: Final = {Judgement.AGREES: "green", Judgement.DISAGREES: "bold red", Judgement.INCONCLUSIVE: "yellow"}


@final
class _Output(Console):
    """Standard output; if nobody reads it, ``exits`` decides the exit code, not rich (its 1 is a verdict here)."""

    def on_broken_pipe(self) -> NoReturn:
        raise  # noqa: PLE0704 - rich calls this while it handles the BrokenPipeError


def warn(identification: Identification) -> None:
    """Write what a reader of the model must know to stderr."""
    for warning in identification.warnings:
        say(f"finback: warning: {warning}")


def warn_of_sweep(sweep: Sweep) -> None:
    """Write which maneuvers could not be flown to stderr."""
    if pipeline.NOT_FLOWN in sweep.provenance:
        say(f"finback: warning: {sweep.provenance[pipeline.NOT_FLOWN]}")


def show_run(run: pipeline.Run) -> None:
    """Print the verdict, the folds, the metrics, and where to look further."""
    show_validation(run.folder, run.analysis, run.validation)
    flights = [holdout.record.name for holdout in run.validation.holdouts] or [run.sweep.records[0].name]
    console = _console()
    _line(console, f"report   {run.report}")
    _line(console, f"replay   finback replay {flights[0]} {shlex.quote(str(run.folder))}")


def show_sweep(run: Path, sweep: Sweep) -> None:
    """Print every flight with its outcome."""
    console = _console()
    table = _table("flight", "outcome", "[s]", "alpha [deg]", "note")
    for record in sweep.records:
        alpha = record["alpha_rad"]
        reach = f"{to_places(shown(alpha.min(), 'rad'), 1)} … {to_places(shown(alpha.max(), 'rad'), 1)}"
        table.add_row(record.name, record.outcome.value, f"{record.duration_s:.2f}", reach, escape(record.note))
    _show(console, table)
    _line(console, f"run      {run}")


def show_identification(run: Path, identification: Identification) -> None:
    """Print every coefficient with its standard error, in degrees."""
    console = _console()
    model, errors = identification.model, identification.standard_errors
    split = model.alpha_dot.coefficients.size
    table = _table("equation", "term", "coefficient ± standard error")
    for name, polynomial, se in (
        ("dα/dt [deg/s]", model.alpha_dot, errors[:split]),
        ("dq/dt [deg/s²]", model.q_dot, errors[split:]),
    ):
        scale = _in_degrees(polynomial)
        for label, value, error in zip(polynomial.labels(), polynomial.coefficients * scale, se * scale, strict=True):
            table.add_row(escape(name), label, _coefficient(float(value), float(error)))
            name = ""  # noqa: PLW2901 - the equation is named once
    _show(console, table)
    noise = f"alpha {plain(shown(identification.alpha_noise_rad, 'rad'))} deg"
    _line(console, f"noise    {noise}, q {plain(shown(identification.q_noise_rad_s, 'rad_s'))} deg/s (estimated)")
    _line(console, f"used     {len(identification.segments)} stretches; not used: {len(identification.unused)} flights")
    _line(console, f"run      {run}")


def show_analysis(run: Path, analysis: Analysis) -> None:
    """Print the folds and what else was found."""
    console = _console()
    table = _table("fold", "alpha [deg]", "elevator [deg]", "other eigenvalue [1/s]", "")
    for number, fold in enumerate(analysis.folds, start=1):
        table.add_row(
            str(number),
            measured(shown(fold.alpha_rad, "rad"), _half(fold.alpha_interval_rad)),
            measured(shown(fold.elevator_rad, "rad"), _half(fold.elevator_interval_rad)),
            plain(fold.divergence_1_s),
            "" if fold.in_domain else "extrapolated",
        )
    _show(console, table)
    if analysis.connections.heteroclinics or analysis.connections.homoclinics:
        console.print(_connections(analysis))
    if analysis.regions:
        console.print(_regions(analysis))
    console.print("± is a 95 % interval", style="dim")
    for note in analysis.notes:
        _line(console, f"note     {note}")
    _line(console, f"run      {run}")


def _connections(analysis: Analysis) -> Table:
    table = _table("saddle connection", "elevator [deg]", "from alpha [deg]", "to alpha [deg]", "")
    found = analysis.connections
    rows = [(c, "heteroclinic", c.from_alpha_rad, c.to_alpha_rad) for c in found.heteroclinics] + [
        (loop, "homoclinic", loop.alpha_rad, loop.alpha_rad) for loop in found.homoclinics
    ]
    for connection, kind, start, end in sorted(rows, key=lambda row: row[0].elevator_rad):
        table.add_row(
            f"{kind}, {connection.direction.value}",
            measured(shown(connection.elevator_rad, "rad"), _half(connection.elevator_interval_rad)),
            to_places(shown(start, "rad"), 2),
            to_places(shown(end, "rad"), 2),
            "" if connection.in_domain else "extrapolated",
        )
    return table


def _regions(analysis: Analysis) -> Table:
    low, high = (to_places(shown(end, "rad"), 0) for end in analysis.options.region_alpha_rad)
    table = _table(
        "stability region at elevator [deg]",
        "sink alpha [deg]",
        "saddles alpha [deg]",
        f"area in alpha {low} … {high} [deg²/s]",
        "smallest escape [deg]",
        "",
    )
    for region in analysis.regions:
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


def show_validation(run: Path, analysis: Analysis, validation: Validation) -> None:
    """Print the verdict first, then the folds by each road, then every metric."""
    console = _console()
    counted = [metric for metric in validation.metrics if metric.counted]
    agreeing = sum(metric.judgement == Judgement.AGREES for metric in counted)
    aside = len(validation.metrics) - len(counted)
    verdict = f"[{_STYLE[validation.verdict]}]{validation.verdict.value.upper()}[/]"
    console.print(f"verdict  {verdict}  {agreeing} of {len(counted)} metrics agree, {aside} not counted")
    _show(console, _folds(analysis, validation))
    metrics, footnotes = _metrics(validation, wide=console.width >= _WIDE)
    _show(console, metrics)
    for footnote in footnotes:
        _line(console, footnote)
    console.print(
        "± and U95 are 95 % intervals; |E| + U95 ≤ tolerance agrees, |E| − U95 > tolerance disagrees", style="dim"
    )
    for note in validation.notes:
        _line(console, f"note     {note}")
    _line(console, f"run      {run}")


def _folds(analysis: Analysis, validation: Validation) -> Table:
    roads = ("predicted", "simulator: curve", "simulator: hold", "simulator: ramps")
    table = _table("fold at alpha [deg]", f"elevator [deg]: {roads[0]}", *roads[1:])
    said = [measured(shown(fold.elevator_rad, "rad"), _half(fold.elevator_interval_rad)) for fold in analysis.folds]
    rows: list[tuple[float, str, str, str, str]] = []
    for fold in validation.folds:
        predicted = [said[index] for index in fold.predicted] or ["not predicted"]
        curve = to_places(shown(fold.simulated.elevator_rad, "rad"), 5)
        flown = [
            measured(shown(answer.elevator_rad, "rad"), shown(answer.uncertainty_rad, "rad"))
            for witness in fold.flown
            for answer in (witness.hold, witness.ramp)
        ] or ["not flown", "not flown"]
        rows.append((fold.simulated.alpha_rad, predicted[0], curve, flown[0], flown[1]))
    paired = {index for fold in validation.folds for index in fold.predicted}
    rows += [
        (fold.alpha_rad, said[index], "none", "not flown", "not flown")
        for index, fold in enumerate(analysis.folds)
        if index not in paired
    ]
    for alpha, *cells in sorted(rows):
        table.add_row(to_places(shown(alpha, "rad"), 2), *cells)
    return table


def _metrics(validation: Validation, *, wide: bool) -> tuple[Table, tuple[str, ...]]:
    """Return the table of metrics and its footnotes; a narrow one leaves out both sides of the difference."""
    notes = tuple(dict.fromkeys(metric.note for metric in validation.metrics if metric.note))
    sides = ("simulated", "predicted") if wide else ()
    table = _table("metric", "unit", *sides, "|E|", "U95", "tolerance", "judgement")
    for metric in validation.metrics:
        style = _STYLE[metric.judgement] if metric.counted else "dim"
        judgement = metric.judgement.value if metric.counted else "not counted"
        mark = f" ({notes.index(metric.note) + 1})" if metric.note else ""
        name, unit, simulated, predicted, *rest = _metric_cells(metric)
        shown_sides = (simulated, predicted) if wide else ()
        table.add_row(name, unit, *shown_sides, *rest, f"[{style}]{judgement}{mark}[/]")
    return table, tuple(f"({number}) {note}" for number, note in enumerate(notes, start=1))


def _metric_cells(metric: Metric) -> tuple[str, ...]:
    """Return a metric's numbers with two digits of its uncertainty, or of a tenth of its tolerance if that is finer."""
    tolerance, uncertainty = shown(metric.tolerance, metric.unit), shown(metric.uncertainty, metric.unit)
    places = decimals(min(tolerance / 10, max(uncertainty, tolerance * _FINEST)))
    numbers = [shown(value, metric.unit) for value in (metric.simulated, metric.predicted, abs(metric.error))]
    cells = [to_places(number, places) if uncertainty > 0 else plain(number) for number in (*numbers, uncertainty)]
    return escape(metric.name), written(display_unit(metric.unit)), *cells, plain(tolerance)


def _coefficient(value: float, error: float) -> str:
    """Write a coefficient of any size with two digits of its standard error."""
    if error <= 0:
        return f"{value:.10g}"
    digits = decimals(error / abs(value)) if value else 1
    return f"{value:.{max(1, digits)}e} ± {error:.1e}"


def _in_degrees(polynomial: Polynomial) -> FloatArray:
    """Return the factor of each coefficient from SI to the units that people read."""
    per_variable = [to_si(1.0, display_unit(unit_of(name))) for name in polynomial.variables]
    factors: FloatArray = (per_variable**polynomial.powers).prod(axis=1)
    return factors * shown(1.0, polynomial.value_unit)


def _half(interval_rad: FloatArray) -> float:
    """Return half the width of an interval, in degrees."""
    return shown(0.5 * float(interval_rad[1] - interval_rad[0]), "rad")


def _console() -> Console:
    return _Output(file=sys.stdout, highlight=False, width=None if sys.stdout.isatty() else _WIDTH)


def _line(console: Console, text: str) -> None:
    """Print a line as it is: never wrapped, so that paths and commands can be copied."""
    console.print(text, markup=False, soft_wrap=True)


def _show(console: Console, table: Table) -> None:
    """Print a table; on a terminal too narrow for its columns, row by row: a title, then a line for each cell."""
    if console.width >= _NARROW:
        console.print(table)
        return
    names = [column.header for column in table.columns]
    console.print(f"\n{names[0]}", style="bold")
    for title, *cells in zip(*(column.cells for column in table.columns), strict=True):
        console.print(title)
        for name, cell in zip(names[1:], cells, strict=True):
            if cell:
                console.print(f"  {name}  {cell}", soft_wrap=True)
    console.print()


def _table(*columns: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in columns:
        table.add_column(escape(name), overflow="fold")
    return table
