"""The table ``[identification]`` as options."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from finback.errors import InputError
from finback.identification.method import Method
from finback.identification.model_form import ModelForm
from finback.identification.nuisance import Nuisances
from finback.identification.options import IdentificationOptions
from finback.identification.selection.library import library, polynomial_terms
from finback.identification.selection.options import SelectionOptions
from finback.identification.term import Term
from finback.study.faults import dotted, explain
from finback.study.tables import SelectTable


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


def _select_table(values: dict[str, Any]) -> SelectTable:
    """Read ``[identification.select]``, or raise one InputError that names all its faults."""
    try:
        return SelectTable.model_validate(values)
    except ValidationError as error:
        faults = (
            f"{dotted('select', fault['loc'], values)}: {explain(dict(fault), list(SelectTable.model_fields))}"
            for fault in error.errors()
        )
        raise InputError("; ".join(faults)) from None


def identification_options(values: Mapping[str, Any]) -> IdentificationOptions:
    """Make options of the table's values in SI.

    ``alpha_dot_terms`` and ``q_dot_terms``, if given, stand instead of the orders; each is a list of terms such as
    ``"1"``, ``"alpha^2"``, ``"alpha*q"``, ``"q+alpha_dot"``. ``select``, if given, is a table of candidates instead.

    Raises:
        InputError: a value, or the combination, has no meaning.
    """
    rest = dict(values)
    orders = (rest.pop("alpha_dot_order"), rest.pop("q_dot_order"))
    terms = (rest.pop("alpha_dot_terms"), rest.pop("q_dot_terms"))
    if bool(terms[0]) != bool(terms[1]):
        raise InputError("alpha_dot_terms and q_dot_terms are given both or not at all")
    select = rest.pop("select")
    nuisances = Nuisances(**{name: rest.pop(name) for name in Nuisances.__slots__})
    return IdentificationOptions(
        alpha_order=orders,
        form=(ModelForm.parse(*terms),) if terms[0] else (),
        method=Method(rest.pop("method")),
        nuisances=nuisances,
        selection=() if select is None else (selection_options(_select_table(select)),),
        **rest,
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
