"""Constants of dα/dt and dq/dt that differ from flight to flight: trim, mass, zero shifts, of no interest themselves.

They are fitted as coefficients of columns that name the flight: 1 in its own and -1 in the last flight, so that they
add up to zero, and the model's own constants are the mean of all flights. Every estimator fits them like any other
coefficient, without knowing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import IntArray, frozen_array
from finback.dynamics.model import PolynomialModel
from finback.errors import InputError
from finback.identification.model_form import Equation, ModelForm
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch
from finback.identification.term import Monomial, Term

_CONSTANT: Final = Term.of()


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlightConstants:
    """By how much the constants of one flight are larger than the model's; over all flights they add up to zero.

    Attributes:
        flight: the record's name.
        alpha_dot_rad_s: of dα/dt, in rad/s; 0 where dα/dt has no constant.
        alpha_dot_error_rad_s: its standard error.
        q_dot_rad_s2: of dq/dt, in rad/s²; 0 where dq/dt has no constant.
        q_dot_error_rad_s2: its standard error.
    """

    flight: str
    alpha_dot_rad_s: float
    alpha_dot_error_rad_s: float
    q_dot_rad_s2: float
    q_dot_error_rad_s2: float


def with_constants(
    pieces: Sequence[Stretch], options: IdentificationOptions
) -> tuple[list[Stretch], IdentificationOptions, tuple[str, ...]]:
    """Return stretches and options in which each flight has constants of its own, if the options ask for that.

    Returns:
        The stretches, the options, and the names of the flights that are told apart; none if they are not.
    """
    flights = told_apart(pieces) if options.constants_per_flight else ()
    if not flights:
        return list(pieces), options, ()
    form = with_terms(options.model_form, flights)
    return with_columns(pieces, flights), replace(options, form=(form,)), flights


def told_apart(pieces: Sequence[Stretch]) -> tuple[str, ...]:
    """Return the names of the flights, if there are two or more: one alone differs from none."""
    flights = tuple(dict.fromkeys(piece.flight for piece in pieces))
    return flights if len(flights) > 1 else ()


def with_terms(form: ModelForm, flights: Sequence[str]) -> ModelForm:
    """Return the form with a constant of its own for each flight, in every equation that has a constant to be fitted.

    Raises:
        InputError: none has.
    """
    fixed = {item.equation for item in form.fixed if item.term == _CONSTANT}
    own = [name for name in Equation if (name, _CONSTANT) in form.terms and name not in fixed]
    if not own:
        raise InputError(
            "no equation has a constant that is fitted, so none can differ from flight to flight",
            hint="add the term 1, or leave constants_per_flight out",
        )
    further = tuple(Term(monomials=(Monomial(factors=((name, 1),)),)) for name in _names(flights))
    return replace(
        form,
        alpha_dot=form.alpha_dot + (further if Equation.ALPHA_DOT in own else ()),
        q_dot=form.q_dot + (further if Equation.Q_DOT in own else ()),
    )


def with_columns(pieces: Sequence[Stretch], flights: Sequence[str]) -> list[Stretch]:
    """Return stretches with the columns that tell these flights apart."""
    return [_with_column(piece, flights) for piece in pieces] if flights else list(pieces)


def flight_terms(form: ModelForm, flights: Sequence[str]) -> IntArray:
    """Return the places of the terms that tell flights apart, in a form that has them."""
    names = set(_names(flights))
    return np.array([i for i, (_, term) in enumerate(form.terms) if names & set(term.variables)], dtype=np.int64)


def told_apart_by(form: ModelForm) -> bool:
    """Tell whether a form has constants of each flight: the first flight's is there for any two or more."""
    return _name(0) in form.inputs


def without_columns(model: PolynomialModel, flights: Sequence[str]) -> PolynomialModel:
    """Return the model of the mean flight."""
    return model.held(**dict.fromkeys(_names(flights), 0.0)) if flights else model


def flight_constants(model: PolynomialModel, flights: Sequence[str]) -> tuple[FlightConstants, ...]:
    """Return the constants of every flight, of a model that still has its columns."""
    if not flights:
        return ()
    split = model.alpha_dot.coefficients.size
    pick = np.zeros((2, len(flights) - 1, model.coefficients.size))
    for equation, (polynomial, first) in enumerate(((model.alpha_dot, 0), (model.q_dot, split))):
        for column, name in enumerate(_names(flights)):
            place = polynomial.variables.index(name)
            alone = (polynomial.powers[:, place] == 1) & (polynomial.powers.sum(axis=1) == 1)
            pick[equation, column, first + np.flatnonzero(alone)] = 1.0
    rows = np.concatenate([pick, -pick.sum(axis=1, keepdims=True)], axis=1)
    values = rows @ model.coefficients
    errors = np.sqrt(np.maximum(np.einsum("efi,ij,efj->ef", rows, model.covariance, rows), 0.0))
    return tuple(
        FlightConstants(
            flight=flight,
            alpha_dot_rad_s=float(values[0, index]),
            alpha_dot_error_rad_s=float(errors[0, index]),
            q_dot_rad_s2=float(values[1, index]),
            q_dot_error_rad_s2=float(errors[1, index]),
        )
        for index, flight in enumerate(flights)
    )


def said_of_constants(flights: Sequence[str], *, asked: bool) -> tuple[str, ...]:
    """Say what the model's own constants are, if the flights have others, or why they have none though it was asked."""
    if not flights:
        alone = "constants_per_flight does nothing: only one flight is used, and its constants are the model's"
        return (alone,) if asked else ()
    said = (
        f"the constants of dα/dt and dq/dt are the means of {len(flights)} flights, each of which has its own: so are "
        "the model's equilibria, and no interval holds how far one flight is beside the mean"
    )
    return (said,)


def _names(flights: Sequence[str]) -> tuple[str, ...]:
    """Return what the columns are called, one less than there are flights."""
    return tuple(map(_name, range(len(flights) - 1)))


def _name(place: int) -> str:
    return f"flight{place + 1}_1"  # it is 1, without a unit


def _with_column(piece: Stretch, flights: Sequence[str]) -> Stretch:
    names, place = _names(flights), flights.index(piece.flight)
    row = np.eye(len(names))[place] if place < len(names) else np.full(len(names), -1.0)
    columns = np.hstack([piece.further.reshape(len(piece), -1), np.tile(row, (len(piece), 1))])
    every = (*piece.further_names, *names)
    order = sorted(range(len(every)), key=every.__getitem__)  # that of a form's inputs
    return replace(piece, further_names=tuple(every[index] for index in order), further=frozen_array(columns[:, order]))
