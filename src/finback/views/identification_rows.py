"""What an identification found beside its coefficients, as rows of text: terms, suspicions, biases, derived numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.digits import NOT_DETERMINED, interval
from finback.identification.gate import HALF
from finback.identification.identify import Identification
from finback.identification.nuisance import NAMES, UNITS, FlightNuisances
from finback.identification.propagation import PropagatedNumber
from finback.identification.selection.select import Selection
from finback.units import from_si, unit_of
from finback.views.labels import display_unit, minus, short, unit_text, with_error

_EXTRAS: Final = tuple(f"{name.replace(' ', '_')}{{}}_{unit}" for name, unit in zip(NAMES, UNITS, strict=True))
_HALF_OF: Final = 0.5  # an interval's half-width, of its width


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TermRow:
    """One step of a selection: an orthogonal function, and the errors predicted after it, in noise variances.

    Attributes:
        term: the term and its equation.
        chosen: whether it is in the model.
        predicted: predicted squared error.
        press: mean square of each equation's error when it is predicted from the others.
        kept_out: the same on flights that were kept out; empty if there were none.
        frequency: share of the resampled selections that chose it; empty if there were none.
    """

    term: str
    chosen: bool
    predicted: str
    press: str
    kept_out: str
    frequency: str


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SelectionRows:
    """How the terms were found.

    Attributes:
        summary: how many of how many, in a sentence.
        collinearity: what the data can hardly tell apart, in a sentence.
        steps: in the order in which they explain most.
    """

    summary: str
    collinearity: str
    steps: tuple[TermRow, ...]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SuspicionRow:
    """One check of the residuals.

    Attributes:
        suspect: what was looked for.
        finding: raised, not raised, or not judged.
        statement: the finding in a sentence.
    """

    suspect: str
    finding: str
    statement: str


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DerivedRow:
    """One number computed from the coefficients, with its 95 % interval by two roads.

    Attributes:
        name: what it is, with unit.
        value: with half of the linear interval, or that it is not determined.
        sampled: the interval of models drawn from the covariance.
        remark: in how many of them the number exists, if not in all.
    """

    name: str
    value: str
    sampled: str
    remark: str


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class IdentificationRows:
    """Everything a report says of an identification beside the coefficients.

    Attributes:
        method: the estimator.
        selections: how the terms were found; empty if they were given.
        suspicions: checks of the residuals.
        nuisance_names: heads of the columns of ``nuisances``.
        nuisances: one row for each stretch: flight, begin, value with standard error for each name.
        derived: numbers computed from the coefficients.
    """

    method: str
    selections: tuple[SelectionRows, ...]
    suspicions: tuple[SuspicionRow, ...]
    nuisance_names: tuple[str, ...]
    nuisances: tuple[tuple[str, ...], ...]
    derived: tuple[DerivedRow, ...]


def identification_rows(identification: Identification, derived: Sequence[PropagatedNumber]) -> IdentificationRows:
    """Return what was found as text."""
    asked = [place for place, size in enumerate(identification.options.nuisances.deviations) if size > 0.0]
    return IdentificationRows(
        method=identification.options.method.value,
        selections=tuple(map(_selection, identification.selection)),
        suspicions=tuple(
            SuspicionRow(
                suspect=str(found.suspect),
                finding="raised" if found.raised else "not raised" if found.judged else "not judged",
                statement=minus(found.statement),
            )
            for found in identification.suspicions
        ),
        nuisance_names=tuple(f"{NAMES[place]} [{unit_text(display_unit(UNITS[place]))}]" for place in asked),
        nuisances=tuple(_nuisances(flight, asked) for flight in identification.nuisances),
        derived=tuple(map(_derived, derived)),
    )


def _selection(selection: Selection) -> SelectionRows:
    labels = selection.options.library.labels()
    frequency = {label: item.frequency for label, item in zip(labels, selection.candidates, strict=True)}
    chosen, judged = set(selection.form.labels()), selection.collinearity
    tied = [label for label, share in zip(judged.labels, judged.proportions[0].tolist(), strict=True) if share > HALF]
    (one, two), (first, second) = selection.form.sizes, selection.orders
    repeated = selection.options.bootstraps
    same = f"; {selection.same:.0%} of {repeated} resampled selections chose exactly these terms" if repeated else ""
    return SelectionRows(
        summary=(
            f"{one} terms of dα/dt and {two} of dq/dt were selected from {selection.options.library.size} candidates; "
            f"highest powers of α: {first} and {second}{same}."
        ),
        collinearity=(
            f"Largest condition index {short(float(judged.condition_indices[0]))}, which takes more than half of the "
            f"variance of: {', '.join(tied) or 'none'}."
        ),
        steps=tuple(
            TermRow(
                term=step.term,
                chosen=step.term in chosen,
                predicted=f"{step.predicted_squared_error:.5g}",
                press=f"{step.press:.5g}",
                kept_out=f"{step.prediction:.5g}" if selection.options.prediction else "",
                frequency=f"{frequency[step.term]:.0%}" if repeated else "",
            )
            for step in selection.path
        ),
    )


def _nuisances(flight: FlightNuisances, asked: Sequence[int]) -> tuple[str, ...]:
    values = [[getattr(flight, _EXTRAS[place].format(part)) for part in ("", "_error")] for place in asked]
    units = [display_unit(UNITS[place]) for place in asked]
    said = (with_error(from_si(v, unit), from_si(e, unit)) for (v, e), unit in zip(values, units, strict=True))
    return (flight.flight, f"{flight.start_s:.2f}", *said)


def _derived(number: PropagatedNumber) -> DerivedRow:
    si = unit_of(number.name)
    unit = display_unit(si)
    half = _HALF_OF * float(np.ptp(number.linear_interval))
    partly = number.existing < 1.0
    return DerivedRow(
        name=minus(f"{number.name.removesuffix(si).rstrip('_')} [{unit_text(unit)}]"),
        value=with_error(from_si(number.value, unit), from_si(half, unit)) if number.determined else NOT_DETERMINED,
        sampled=minus(" … ".join(interval(*from_si(number.sampled_interval, unit).tolist()))),
        remark=f"exists in {number.existing:.0%} of the models drawn" if partly else minus(number.reason),
    )
