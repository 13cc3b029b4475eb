"""Results as tables on stdout."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Final

from rich.markup import escape
from rich.table import Table

from finback import pipeline
from finback.arrays import FloatArray
from finback.cli import terminal
from finback.cli.accuracy_table import print_accuracy
from finback.cli.exits import say
from finback.cli.judged import JUDGED
from finback.cli.numbers import coefficient, decimals, display_unit, measured, plain, shown, to_places, written
from finback.dynamics.any_form import AnyAnalysis
from finback.dynamics.polynomial import Polynomial
from finback.flight.accuracy import SweepAccuracy
from finback.identification.identify import Identification
from finback.records import Sweep
from finback.units import to_si, unit_of
from finback.validation.metric import Judgement, Metric
from finback.validation.prediction import PredictedFold, prediction
from finback.validation.validate import Validation

_WIDE: Final = 130  # the full table of metrics needs this much
_FINEST: Final = 1e-4  # of a tolerance: nobody needs to see less


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
    console = terminal.open_console()
    terminal.print_line(console, f"report   {run.report}")
    terminal.print_line(console, f"replay   finback replay {flights[0]} {shlex.quote(str(run.folder))}")


def show_sweep(run: Path, sweep: Sweep, accuracy: Sequence[SweepAccuracy]) -> None:
    """Print every flight with its outcome, and how well the step resolves some of them."""
    console = terminal.open_console()
    table = terminal.new_table("flight", "outcome", "[s]", "alpha [deg]", "note")
    for record in sweep.records:
        alpha = record["alpha_rad"]
        reach = f"{to_places(shown(alpha.min(), 'rad'), 1)} … {to_places(shown(alpha.max(), 'rad'), 1)}"
        table.add_row(record.name, record.outcome.value, f"{record.duration_s:.2f}", reach, escape(record.note))
    terminal.print_table(console, table)
    print_accuracy(console, accuracy)
    terminal.print_line(console, f"run      {run}")


def show_identification(run: Path, identification: Identification) -> None:
    """Print every coefficient with its standard error, and the plain Cramér-Rao bound of it, in degrees."""
    console = terminal.open_console()
    model, errors = identification.model, iter(identification.standard_errors.tolist())
    bounds = iter(identification.cramer_rao_errors.tolist())  # none in files of older versions
    table = terminal.new_table("equation", "term", "coefficient ± standard error", "Cramér-Rao bound")
    for name, polynomial in (("dα/dt [deg/s]", model.alpha_dot), ("dq/dt [deg/s²]", model.q_dot)):
        scales = _in_degrees(polynomial).tolist()
        for label, value, scale in zip(polynomial.labels(), polynomial.coefficients.tolist(), scales, strict=True):
            bound = "".join(f"{scale * item:.4g}" for item in islice(bounds, 1))
            table.add_row(escape(name), label, coefficient(scale * value, scale * next(errors)), bound)
            name = ""  # noqa: PLW2901 - the equation is named once
    terminal.print_table(console, table)
    terminal.print_line(console, f"method   {identification.options.method}")
    noise = f"alpha {plain(shown(identification.alpha_noise_rad, 'rad'))} deg"
    terminal.print_line(
        console, f"noise    {noise}, q {plain(shown(identification.q_noise_rad_s, 'rad_s'))} deg/s (estimated)"
    )
    flights = len({segment.flight for segment in identification.segments})
    used = _number(len(identification.segments), "stretch", "stretches")
    terminal.print_line(console, f"used     {used} of {_number(flights, 'flight', 'flights')}")
    for reason in identification.unused:
        terminal.print_line(console, f"not used {reason}")
    terminal.print_line(console, f"run      {run}")


def _number(count: int, one: str, many: str) -> str:
    return f"{count} {one if count == 1 else many}"


def show_validation(run: Path, analysis: AnyAnalysis, validation: Validation) -> None:
    """Print the verdict first, then the folds by each road, then every metric."""
    console = terminal.open_console()
    counted = [metric for metric in validation.metrics if metric.counted]
    agreeing = sum(metric.judgement == Judgement.AGREES for metric in counted)
    aside = len(validation.metrics) - len(counted)
    verdict = f"[{JUDGED[validation.verdict]}]{validation.verdict.value.upper()}[/]"
    console.print(f"verdict  {verdict}  {agreeing} of {len(counted)} metrics agree, {aside} not counted")
    folds = _folds(analysis, validation)
    if folds.row_count:
        terminal.print_table(console, folds)
    metrics, footnotes = _metrics(validation, wide=console.width >= _WIDE)
    terminal.print_table(console, metrics)
    for footnote in footnotes:
        terminal.print_line(console, footnote)
    console.print(
        "± and U95 are 95 % intervals; |E| + U95 ≤ tolerance agrees, |E| − U95 > tolerance disagrees",
        style="dim",
        soft_wrap=True,
    )
    for note in validation.notes:
        terminal.print_line(console, f"note     {note}")
    terminal.print_line(console, f"run      {run}")


def _folds(analysis: AnyAnalysis, validation: Validation) -> Table:
    roads = ("predicted", "simulator: curve", "simulator: hold", "simulator: ramps")
    table = terminal.new_table("fold at alpha [deg]", f"elevator [deg]: {roads[0]}", *roads[1:])
    known = prediction(analysis).folds
    said = [measured(shown(fold.elevator_rad, "rad"), _half(fold.elevator_interval_rad)) for fold in known]
    rows: list[tuple[float, str, str, str, str, str]] = []
    for fold in validation.folds:
        predicted = [said[index] for index in fold.predicted] or ["not predicted"]
        curve = to_places(shown(fold.simulated.elevator_rad, "rad"), 5)
        flown = [
            measured(shown(answer.elevator_rad, "rad"), shown(answer.uncertainty_rad, "rad"))
            for witness in fold.flown
            for answer in (witness.hold, witness.ramp)
        ] or ["not flown", "not flown"]
        alpha = fold.simulated.alpha_rad
        rows.append((alpha, to_places(shown(alpha, "rad"), 2), predicted[0], curve, flown[0], flown[1]))
    paired = {index for fold in validation.folds for index in fold.predicted}
    rows += [
        (fold.alpha_rad, _alpha(fold), said[index], "none", "not flown", "not flown")
        for index, fold in enumerate(known)
        if index not in paired
    ]
    for _, *cells in sorted(rows):
        table.add_row(*cells)
    return table


def _alpha(fold: PredictedFold) -> str:
    """Write where only a model has a fold: with its interval, or two decimals where the model is exact."""
    value, half = shown(fold.alpha_rad, "rad"), _half(fold.alpha_interval_rad)
    return to_places(value, 2) if half == 0.0 else measured(value, half)


def _metrics(validation: Validation, *, wide: bool) -> tuple[Table, tuple[str, ...]]:
    """Return the table of metrics and its footnotes; a narrow one leaves out both sides of the difference."""
    notes = tuple(dict.fromkeys(metric.note for metric in validation.metrics if metric.note))
    sides = ("simulated", "predicted") if wide else ()
    table = terminal.new_table("metric", "unit", *sides, "|E|", "U95", "tolerance", "judgement")
    for metric in validation.metrics:
        style = JUDGED[metric.judgement] if metric.counted else "dim"
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


def _in_degrees(polynomial: Polynomial) -> FloatArray:
    """Return the factor of each coefficient from SI to the units that people read."""
    per_variable = [to_si(1.0, display_unit(unit_of(name))) for name in polynomial.variables]
    factors: FloatArray = (per_variable**polynomial.powers).prod(axis=1)
    return factors * shown(1.0, polynomial.value_unit)


def _half(interval_rad: FloatArray) -> float:
    """Return half the width of an interval, in degrees."""
    return shown(0.5 * float(interval_rad[1] - interval_rad[0]), "rad")
