"""The table ``[identification]`` as options."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Final

from finback.errors import InputError
from finback.flight.excitation import Maneuver
from finback.flight.plan import FlightOptions
from finback.identification.method import Method
from finback.identification.model_form import ModelForm
from finback.identification.nuisance import Nuisances
from finback.identification.options import IdentificationOptions
from finback.identification.selection.library import library, polynomial_terms
from finback.identification.selection.options import SelectionOptions
from finback.identification.term import Term
from finback.study.faults import nearest
from finback.study.known import with_known
from finback.study.reading import Reader
from finback.study.tables import IdentificationTable, SelectTable, in_si

_PLACE: Final = "identification"
_EQUATIONS: Final = ("alpha_dot", "q_dot")


def read_identification(
    reader: Reader, flight: FlightOptions | None, maneuvers: Sequence[Maneuver]
) -> IdentificationOptions | None:
    """Read ``[identification]``, or add its faults.

    The form of the model stands in one of three ways: as orders in alpha, as lists of terms, or as a table ``select``
    of candidates. Of the orders nothing is asked where one of the others is given.

    Args:
        reader: of the whole file.
        flight: the limits; None if these are missing.
        maneuvers: of the sweep, whose flights a selection may keep out; empty if their names are not known.
    """
    table = reader.table(IdentificationTable, _PLACE)
    if table is None:
        return None
    values = in_si(table)
    if table.spacing_s > table.half_width_s:
        reader.fault(
            f"{_PLACE}.spacing_s", f"must not exceed half_width_s ({table.half_width_s:g}), got {table.spacing_s:g}"
        )
    if flight is not None:
        window, limits = values["alpha_window_rad"], flight.alpha_limits_rad
        reader.inside(f"{_PLACE}.alpha_window_deg", window, limits, "flight.alpha_limits_deg")
    form = _known(reader, table, _form(reader, table))
    selection = _selection(reader, table, maneuvers)
    if form is None or selection is None or table.spacing_s > table.half_width_s:
        return None
    orders = (table.alpha_dot_order or 1, table.q_dot_order or 1)  # where both are missing, nothing asks for them
    for name in ("alpha_dot_order", "q_dot_order", "alpha_dot_terms", "q_dot_terms", "select", "fixed", "bounded"):
        values.pop(name)
    nuisances = {name: values.pop(name) for name in Nuisances.__slots__}
    return reader.make(
        _PLACE,
        lambda: IdentificationOptions(
            alpha_order=orders,
            form=form,
            selection=selection,
            nuisances=Nuisances(**nuisances),
            **{**values, "method": Method(table.method)},
        ),
    )


def _form(reader: Reader, table: IdentificationTable) -> tuple[ModelForm, ...] | None:
    """Return the form that lists of terms give, or nothing where there are none."""
    lists = {f"{name}_terms": getattr(table, f"{name}_terms") for name in _EQUATIONS}
    given = [name for name, texts in lists.items() if texts]
    if not given:
        _orders(reader, table)
        return ()
    for name in lists:
        if name not in given:
            reader.fault(f"{_PLACE}.{name}", f"missing: {given[0]} stands here, and each equation needs its terms")
    if table.select is not None:
        reader.fault(f"{_PLACE}.select", f"{given[0]} stands here too; give the terms, or a library to select them")
    terms = [_terms(reader, texts, f"{_PLACE}.{name}") for name, texts in lists.items()]
    if not all(terms) or table.select is not None:
        return None
    form = reader.make(_PLACE, lambda: ModelForm(alpha_dot=terms[0], q_dot=terms[1]))
    return None if form is None else (form,)


def _known(
    reader: Reader, table: IdentificationTable, form: tuple[ModelForm, ...] | None
) -> tuple[ModelForm, ...] | None:
    """Return the form with the coefficients that the study knows."""
    if form is None or not (table.fixed or table.bounded):
        return form
    if table.select is not None:
        reader.fault(f"{_PLACE}.select", "no coefficient can be fixed or bounded of terms that are not yet found")
        return None
    orders = (table.alpha_dot_order or 1, table.q_dot_order or 1)
    known = with_known(reader, (*form, ModelForm.polynomial(orders))[0], table.fixed, table.bounded, _PLACE)
    return None if known is None else (known,)


def _orders(reader: Reader, table: IdentificationTable) -> None:
    """Ask for the orders where nothing else says which terms there are."""
    if table.select is not None:
        return
    for name in _EQUATIONS:
        place = f"{_PLACE}.{name}_order"
        if getattr(table, f"{name}_order") is None and reader.sound(place):
            reader.fault(place, f"missing; give it, or {name}_terms, or a table [{_PLACE}.select]")


def _terms(reader: Reader, texts: Sequence[str], place: str) -> tuple[Term, ...]:
    """Read a list of terms, each with its own fault; nothing if one has any."""
    found = [reader.make(f"{place}[{index}]", partial(Term.parse, text)) for index, text in enumerate(texts)]
    read = [term for term in found if term is not None]
    return tuple(read) if len(read) == len(texts) else ()


def _selection(
    reader: Reader, table: IdentificationTable, maneuvers: Sequence[Maneuver]
) -> tuple[SelectionOptions, ...] | None:
    """Return what ``[identification.select]`` asks, or nothing where it is missing."""
    if table.select is None:
        return ()
    place = f"{_PLACE}.select"
    select = reader.parse(SelectTable, table.select, place)
    if select is None:
        return None
    lists = {name: getattr(select, name) for name in ("variables", "terms", "q_dot_terms")}
    sound = [len(_terms(reader, texts, f"{place}.{name}")) == len(texts) for name, texts in lists.items()]
    flights = flight_names(maneuvers)
    for index, name in enumerate(select.prediction):
        if flights and name not in flights:
            reader.fault(f"{place}.prediction[{index}]", f"the sweep has no flight '{name}'{nearest(name, flights)}")
    if not all(sound):
        return None
    made = reader.make(place, lambda: selection_options(select))
    return None if made is None else (made,)


def flight_names(maneuvers: Iterable[Maneuver]) -> list[str]:
    """Return how the flights of these maneuvers will be called, in order (``flight.sweep.plan_flights``)."""
    counts: Counter[str] = Counter()
    names = []
    for maneuver in maneuvers:
        counts[maneuver.kind] += 1
        names.append(f"{maneuver.kind}-{counts[maneuver.kind]:02d}")
    return names


def selection_options(table: SelectTable) -> SelectionOptions:
    """Make options of ``[identification.select]``: all monomials of its variables up to its degree, and its own terms.

    Raises:
        InputError: a term or variable has no meaning.
    """
    candidates = (*polynomial_terms(table.variables, table.degree), *map(Term.parse, table.terms))
    return SelectionOptions(
        library=library(candidates, further_q_dot=map(Term.parse, table.q_dot_terms)),
        false_alarm=table.false_alarm,
        bootstraps=table.bootstraps,
        prediction=tuple(table.prediction),
    )


def estimator(name: str) -> Method:
    """Return the estimator of this name.

    Raises:
        InputError: there is none.
    """
    try:
        return Method(name)
    except ValueError:
        raise InputError(f"unknown method '{name}'", hint=f"use {', '.join(Method)}") from None
