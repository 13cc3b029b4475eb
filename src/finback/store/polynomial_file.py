"""Two polynomials written by hand, over any two states and one parameter: TOML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.model import check_covariance
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError
from finback.store.model_table import Draft, Table, box
from finback.store.model_terms import parse_term
from finback.study.faults import nearest, show
from finback.units import quantity_of, si_unit, unit_of

SCHEMA: Final = "finback/polynomials/1"

_HEAD: Final = ("schema", "name", "source", "state", "parameter", "inputs", "held", "domain", "range", "covariance")
_RATE: Final = {
    "1": "1",
    "1_s": "1_s2",
    "rad": "rad_s",
    "deg": "deg_s",
    "rad_s": "rad_s2",
    "deg_s": "deg_s2",
    "m": "m_s",
    "ft": "ft_s",
    "m_s": "m_s2",
    "ft_s": "ft_s2",
}
"""Unit of a state -> unit of its rate. A pure number changes per unit of its own time, or per second (``1_s``)."""
_TERM: Final = {"value", "standard_error"}

Equation = dict[tuple[int, ...], tuple[float, float]]
"""Exponents -> value and standard error."""


def read_polynomials(table: Table) -> Draft | None:
    """Return the polynomials of a parsed file, or add its faults."""
    before = len(table.faults)
    state = _names(table, "state", count=2)
    parameter = _name(table, "parameter", table.root.get("parameter"))
    variables = (*state, *parameter, *_names(table, "inputs", count=None))
    symbols = tuple(quantity_of(name) for name in variables)
    for symbol in sorted({symbol for symbol in symbols if symbols.count(symbol) > 1}):
        table.fault("state", f"the name '{symbol}' stands for two variables")
    if len(table.faults) > before:  # whatever else is said rests on the names
        return None
    tables = _equation_tables(table, variables)
    table.keys("", table.root, [*_HEAD, *tables.values()])
    equations = [_equation(table, tables.get(name, ""), symbols) for name in variables[:2]]
    held = _held(table, variables[3:])
    domain, ranges = table.ranges("domain", variables), table.ranges("range", variables[:3])
    covariance = _covariance(table, variables[:2], symbols, equations)
    if len(table.faults) > before:
        return None
    first, second = (
        replace(
            Polynomial.build(
                {term: value for term, (value, _) in equation.items()},
                variables=variables,
                value_unit=unit_of(tables[name]),
            ),
            domain=box(variables, domain),
        )
        for name, equation in zip(variables[:2], equations, strict=True)
    )
    return Draft(variables=variables, first=first, second=second, covariance=covariance, held=held, ranges=ranges)


# names


def _name(table: Table, place: str, value: object) -> tuple[str, ...]:
    """Return a name that ends in a unit, or nothing and a fault."""
    if value is None:
        table.fault(place, "missing")
    elif not isinstance(value, str):
        table.fault(place, f"must be a name with its unit, got {show(value)}")
    else:
        try:
            unit_of(value)
        except InputError:
            table.fault(
                place, f"{show(value)} names no unit; end it with one, as in 'alpha_deg', or in '_1' as in 'x_1'"
            )
        else:
            if quantity_of(value).isidentifier():
                return (value,)
            table.fault(place, f"{show(value)} is no name; use letters, digits and underscores")
    return ()


def _names(table: Table, key: str, *, count: int | None) -> tuple[str, ...]:
    """Return a list of names: ``count`` of them, or any number that may be none."""
    value = table.root.get(key, None if count else [])
    if not isinstance(value, list) or (count and len(value) != count):
        table.fault(key, "missing" if value is None else f"must be a list of {count or ''} names, got {show(value)}")
        return ()
    return tuple(name for i, item in enumerate(value) for name in _name(table, f"{key}[{i}]", item))


def _equation_tables(table: Table, variables: tuple[str, ...]) -> dict[str, str]:
    """Return the table of each state's rate: ``alpha_deg`` -> ``alpha_dot_deg_s``."""
    found = {}
    for name in variables[:2]:
        stem, rate = f"{quantity_of(name)}_dot", _RATE.get(unit_of(name), "")
        if not rate:
            table.fault("state", f"the rate of '{name}' has no unit here; known are states in {', '.join(_RATE)}")
            continue
        given = [key for key in table.root if key.startswith(f"{stem}_")]
        if len(given) == 1 and _si_or_nothing(given[0].removeprefix(f"{stem}_")) in _dimensions(rate):
            found[name] = given[0]
        else:
            said = f", got {', '.join(given)}" if given else ""
            table.fault(stem, f"the rate of {name} needs one table [{stem}_{rate}]{said}")
    units = {name: unit_of(key) for name, key in found.items()}
    if "1" in units.values() and set(units.values()) != {"1"}:
        table.fault(" and ".join(found.values()), "one rate is per second and the other is not; write _1_s")
    return found


def _dimensions(rate: str) -> tuple[str, ...]:
    return ("1", "1_s") if rate == "1" else (si_unit(rate),)


def _si_or_nothing(unit: str) -> str:
    try:
        return si_unit(unit)
    except InputError:
        return ""


# numbers


def _equation(table: Table, name: str, symbols: tuple[str, ...]) -> Equation:
    """Return the terms of one equation."""
    found: Equation = {}
    for key, item in table.table(name).items():
        place = f"{name}.{key}"
        try:
            term = parse_term(key, symbols)
        except ValueError as error:
            table.fault(place, str(error))
            continue
        if term in found:
            table.fault(place, "this term stands here twice")
        found[term] = _coefficient(table, place, item)
    return found


def _coefficient(table: Table, place: str, item: object) -> tuple[float, float]:
    """Return value and standard error, 0 if none is given."""
    if not isinstance(item, dict):
        return table.number(place, item), 0.0
    table.keys(place, item, sorted(_TERM))
    if "value" not in item:
        table.fault(f"{place}.value", "missing")
    error = table.number(f"{place}.standard_error", item.get("standard_error", 0.0))
    if error < 0.0:
        table.fault(f"{place}.standard_error", f"must be 0 or more, got {error:g}")
    return table.number(f"{place}.value", item.get("value", 0.0)), error


def _held(table: Table, inputs: tuple[str, ...]) -> dict[str, float]:
    held = table.numbers("held", inputs) if inputs or "held" not in table.root else {}
    if "held" in table.root and not inputs:
        table.fault("held", "there are no inputs to be held; name them in: inputs = […]")
    for name in inputs:
        if name not in table.table("held"):
            table.fault(f"held.{name}", "missing; an input needs the value at which it is held")
    return held


def _covariance(
    table: Table, state: tuple[str, ...], symbols: tuple[str, ...], equations: list[Equation]
) -> FloatArray:
    """Return the covariance of all coefficients: the standard errors squared, and what ``[covariance]`` says."""
    errors = np.array([error for equation in equations for _, error in equation.values()])
    covariance = np.diag(errors**2)
    given: Mapping[str, Any] = table.table("covariance")
    if not given:
        return frozen_array(covariance)
    before = len(table.faults)
    table.keys("covariance", given, ["terms", "matrix"])
    rows = _covariance_rows(table, given.get("terms"), state, symbols, equations)
    matrix = _matrix(table, given.get("matrix"), len(rows))
    for row in rows:
        if errors[row]:
            table.fault("covariance.terms", "a term that has a standard_error stands here too: give one of both")
    if len(table.faults) > before:
        return frozen_array(covariance)
    covariance[np.ix_(rows, rows)] = matrix
    try:
        check_covariance(covariance)
    except InputError as error:
        table.fault("covariance.matrix", error.message)
    return frozen_array(covariance)


def _covariance_rows(
    table: Table, terms: object, state: tuple[str, ...], symbols: tuple[str, ...], equations: list[Equation]
) -> list[int]:
    """Return which coefficients the rows of the matrix belong to."""
    if not isinstance(terms, list) or not all(isinstance(item, str) for item in terms):
        table.fault("covariance.terms", "must be a list of terms, such as ['alpha_dot: alpha^2']")
        return []
    names = [f"{quantity_of(name)}_dot" for name in state]
    rows = []
    for i, item in enumerate(terms):
        place = f"covariance.terms[{i}]"
        equation, _, text = item.partition(":")
        if equation.strip() not in names:
            table.fault(place, f"{show(item)} begins with no equation{nearest(equation.strip(), names)}")
            continue
        which = names.index(equation.strip())
        try:
            term = parse_term(text.strip(), symbols)
        except ValueError as error:
            table.fault(place, str(error))
            continue
        if term not in equations[which]:
            table.fault(place, f"{show(text.strip())} is no term of {names[which]}")
            continue
        row = list(equations[which]).index(term) + (len(equations[0]) if which else 0)
        if row in rows:
            table.fault(place, "this term stands here twice")
        rows.append(row)
    return rows


def _matrix(table: Table, value: object, size: int) -> FloatArray:
    if (
        not isinstance(value, list)
        or len(value) != size
        or not all(isinstance(row, list) and len(row) == size for row in value)
    ):
        table.fault("covariance.matrix", f"must be a list of {size} rows of {size} numbers, one row for each term")
        return np.zeros((size, size))
    return np.array(
        [
            [table.number(f"covariance.matrix[{i}][{j}]", item) for j, item in enumerate(row)]
            for i, row in enumerate(value)
        ]
    ).reshape(size, size)
