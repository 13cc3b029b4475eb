"""Fitted coefficients for people and programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from finback.cli import terminal
from finback.cli.numbers import coefficient, display_unit, measured, plain, shown, written
from finback.identification.coefficient.identify import CoefficientIdentification, TrackBiases
from finback.store.codec import to_tree
from finback.units import quantity_of, unit_of

_WHITENESS: Final = (
    "whiteness: the probability that white noise is as correlated; below 0.001 the residuals are not white"
)

_BOUND: Final = "Cramér-Rao bound: the standard error as most tables print it, were the residuals white noise"


def show(found: CoefficientIdentification, path: Path) -> None:
    """Print every number with its standard error, biases, residuals, and where the result is."""
    console = terminal.open_console()
    model = found.model
    table = terminal.new_table("term", *model.form.names)
    place = {key: index for index, key in enumerate(model.form.terms)}
    for term in dict.fromkeys(term for _, term in model.form.terms):
        cells = [
            coefficient(float(model.numbers[place[name, term]]), float(model.standard_errors[place[name, term]]))
            if (name, term) in place
            else ""
            for name in model.form.names
        ]
        table.add_row(term.label, *cells)
    terminal.print_table(console, table)
    _show_bounds(found)
    _show_biases(found)
    if found.residual_names and all("_" in name for name in found.residual_names):
        table = terminal.new_table("output", "residual rms", "whiteness (0 … 1)")
        for name, rms, white in zip(found.residual_names, found.residual_rms, found.whiteness, strict=True):
            unit = unit_of(name)
            size = f"{plain(shown(float(rms), unit))} {written(display_unit(unit))}"
            table.add_row(quantity_of(name), size, f"{white:.2g}")
        terminal.print_table(console, table)
        terminal.print_line(console, _WHITENESS)
    samples = sum(stretch.samples for stretch in found.stretches)
    terminal.print_line(console, "± is one standard error; numbers are over angles in rad")
    if found.cramer_rao_errors.size:
        terminal.print_line(console, _BOUND)
    terminal.print_line(console, f"method   {found.options.method.value}")
    terminal.print_line(console, f"used     {len(found.stretches)} stretches, {samples} samples")
    for reason in found.unused:
        terminal.print_line(console, f"unused   {reason}")
    terminal.print_line(console, f"thrust   {plain(model.airframe.thrust_n)} N, the mean: at this it is reduced")
    terminal.print_line(console, f"stored   {path}")


def _show_bounds(found: CoefficientIdentification) -> None:
    """Print the standard errors as most published tables state them; files of older versions have none."""
    form, bounds = found.model.form, found.cramer_rao_errors.tolist()
    if not bounds:
        return
    table = terminal.new_table("Cramér-Rao bound", *form.names)
    place = {key: index for index, key in enumerate(form.terms)}
    for term in dict.fromkeys(term for _, term in form.terms):
        cells = (f"{bounds[place[name, term]]:.4g}" if (name, term) in place else "" for name in form.names)
        table.add_row(term.label, *cells)
    terminal.print_table(terminal.open_console(), table)


def _show_biases(found: CoefficientIdentification) -> None:
    names = found.stretches[0].names
    asked = [index for index in range(len(names)) if any(one.errors[index] > 0.0 for one in found.stretches)]
    if not asked:
        return
    units = [*(unit_of(name) for name in found.residual_names), "rad", "s"]
    heads = [f"{names[index]} [{written(display_unit(units[index]))}]" for index in asked]
    table = terminal.new_table("flight", "from [s]", *heads)
    for one in found.stretches:
        table.add_row(one.flight, f"{one.start_s:.2f}", *(_bias(one, index, units[index]) for index in asked))
    terminal.print_table(terminal.open_console(), table)


def _bias(one: TrackBiases, index: int, unit: str) -> str:
    return measured(shown(float(one.values[index]), unit), shown(float(one.errors[index]), unit))


def document(found: CoefficientIdentification, path: Path) -> dict[str, Any]:
    """Return every number with its standard error, in SI, for ``--json``."""
    model = found.model
    coefficients: list[dict[str, Any]] = [
        {"coefficient": name, "term": term.label, "value": float(value), "standard_error": float(error)}
        for (name, term), value, error in zip(model.form.terms, model.numbers, model.standard_errors, strict=True)
    ]
    for item, bound in zip(coefficients, found.cramer_rao_errors.tolist(), strict=False):  # none in old files
        item["cramer_rao_error"] = bound
    return {
        "schema": "finback/coefficients-summary/1",
        "stored": str(path),
        "method": found.options.method.value,
        "reference_speed_m_s": model.reference_speed_m_s,
        "thrust_n": model.airframe.thrust_n,
        "coefficients": coefficients,
        "residuals": [
            {"name": name, "rms": float(rms), "whiteness": white}
            for name, rms, white in zip(found.residual_names, found.residual_rms, found.whiteness, strict=True)
        ],
        "coloring": found.coloring,
        "condition_number": found.condition_number,
        "iterations": found.iterations,
        "converged": found.converged,
        "stretches": [to_tree(one) for one in found.stretches],
        "unused": list(found.unused),
        "warnings": list(found.warnings),
    }
