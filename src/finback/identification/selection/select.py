"""The terms that the data need, out of a library of candidates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.errors import InputError, RefusedError
from finback.identification.flight_constants import flight_terms, told_apart, with_columns, with_terms
from finback.identification.gate import Collinearity, collinearity
from finback.identification.model_form import Equation, ModelForm
from finback.identification.noise import measured_noise
from finback.identification.options import IdentificationOptions
from finback.identification.selection.averaging import spread
from finback.identification.selection.doubts import Candidate, ambiguous, lacking, left_out, shared, unstable
from finback.identification.selection.equal import EqualStructure, decided, scored
from finback.identification.selection.equations import Equations, Linearization
from finback.identification.selection.library import alpha_orders
from finback.identification.selection.options import SelectionOptions
from finback.identification.selection.path import Step, orthogonal_order, walk
from finback.identification.selection.prices import Prices
from finback.identification.selection.regression import Regression
from finback.identification.selection.search import best_subset, exchanged
from finback.identification.selection.stability import stability
from finback.identification.stretch import Stretch, beyond_half_turn, stretches
from finback.records import FlightRecord, Sweep

_MOST_PASSES: Final = 10
"""Most choices stay after two to four; one that goes to and fro between two forms never does, and is told."""
_DECIDED: Final = (
    "the flights kept out decided between structures that explain the others equally: they are no independent check of "
    "the terms any more"
)
_NONE: Final = np.array([], dtype=np.int64)
_BEYOND: Final = 4
"""Terms beyond the chosen ones that the path shows, so that one sees the predicted error rise."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """A form that was found, and why.

    Attributes:
        form: the chosen terms.
        options: what was asked for.
        candidates: every candidate, those of dα/dt first.
        path: the chosen terms as orthogonal functions, in the order in which they explain most, and the next ones.
        price: the least evidence that brings a term into the model; each degree of the term adds one noise variance.
        variance: mean square of what all candidates leave, freedom counted; 1 if they and noise explain the data.
        same: share of the resampled selections that chose exactly these terms; 0 if there were none.
        passes: how often terms were chosen, until the choice did not change.
        collinearity: condition indices and variance proportions of the chosen terms.
        equal: other structures that explain the data as well; where there are some, the choice is not determined.
        spread: what the doubt about the terms adds to the covariance of the explicit model's coefficients, those of
            dα/dt first, shape (n, n), in SI.
        warnings: what a reader of the form must know.
    """

    form: ModelForm
    options: SelectionOptions
    candidates: tuple[Candidate, ...]
    path: tuple[Step, ...]
    price: float
    variance: float
    same: float
    passes: int
    collinearity: Collinearity
    equal: tuple[EqualStructure, ...]
    spread: FloatArray
    warnings: tuple[str, ...]

    def __post_init__(self) -> None:
        """Freeze the spread."""
        object.__setattr__(self, "spread", frozen_array(self.spread))

    @property
    def determined(self) -> bool:
        """Whether no other structure explains the data as well as the chosen one."""
        return not self.equal

    @property
    def orders(self) -> tuple[int, int]:
        """The highest power of alpha alone in dα/dt and in dq/dt: n_α and n_q of Shi & Fan (2013), Eq. (4) and (5)."""
        return alpha_orders(self.form, np.arange(self.form.size))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Choice:
    """The terms that explain most for their price.

    Attributes:
        chosen: columns of the library.
        equations: of the library, at states smoothed by the model that was chosen last.
        prices: of its terms.
        passes: how often terms were chosen.
        settled: whether the last choice was that before it.
    """

    chosen: IntArray
    equations: Equations
    prices: Prices
    passes: int
    settled: bool


def select(sweep: Sweep, options: IdentificationOptions, selection: SelectionOptions) -> Selection:
    """Choose the terms of dα/dt and dq/dt from a library.

    Works on the weak form of both equations together, so noise does not bias the regressors, and how the elevator is
    held is respected. The form that is chosen has the smallest predicted squared error: the sum of squares of what it
    leaves, plus a price for each term, such that noise alone brings any term into the model with a chance of
    ``false_alarm`` (Bonferroni's bound over all candidates; terms of first degree in alpha, q and the controls, and the
    constant, are expected and judged alone). Where even all candidates leave more than noise, the price rises in
    proportion.

    Structures near the chosen one, with up to two terms exchanged for two others, that explain the data as well are
    named: then the choice is not determined.

    Regressors need states free of noise, and these need a model: the choice is repeated with states smoothed by the
    model chosen last, until it stays.

    Where flights have constants of their own (``constants_per_flight``), these and the constants of the library are in
    the model whatever they explain.

    Args:
        sweep: the flights; those that ``selection.prediction`` names are kept out.
        options: window and test functions; its own form is not used.
        selection: the candidates.

    Raises:
        InputError: a flight that is to be predicted is not there, or a record cannot be used.
        RefusedError: no flight can be used, or an equation has no term that is seen above the noise.
    """
    fitted, predicted = _parted(sweep, selection.prediction)
    windowed = not any(beyond_half_turn(record["alpha_rad"])[1] for record in fitted)
    used = _stretches(fitted, options, selection.library, windowed=windowed)
    if not used:
        raise RefusedError(
            f"none of the flights of '{sweep.study}' can be used to select terms",
            hint="widen alpha_window_deg, lower half_width_s or minimum_duration_s, or fly longer",
        )
    noise = measured_noise(used).assumed
    apart = told_apart(used) if options.constants_per_flight else ()
    form = with_terms(selection.library, apart) if apart else selection.library
    lines = Linearization(with_columns(used, apart), form, options, noise)
    choice = _settled(lines, selection, flight_terms(form, apart))
    alike = not apart and len(told_apart(used)) > 1
    return _judged(choice, selection, _kept_out(predicted, lines, options, noise), alike=alike)


def _judged(choice: _Choice, selection: SelectionOptions, kept_out: tuple[Equations, ...], *, alike: bool) -> Selection:
    """Decide between structures that explain the data equally, and say how sure the choice is.

    Args:
        choice: the terms that were chosen first.
        selection: the candidates.
        kept_out: equations of the flights that are predicted; none if there are no such flights.
        alike: whether there are several flights, taken for alike in all but their motion.
    """
    first, equations, prices = choice.chosen, choice.equations, choice.prices
    regression, labels = equations.regression(), selection.library.labels()
    variance = regression.rest / max(1, regression.rows - len(labels))
    chosen, near = decided(regression, first, selection.library, prices=prices, kept_out=kept_out)
    repeats = selection.bootstraps
    resampled = stability(equations, chosen, prices=prices.enter, count=repeats, seed=selection.seed)
    candidates = _candidates(selection.library, regression, chosen, resampled.frequency)
    path = walk(equations, _order(equations, regression, chosen), labels, prices=prices.paid, kept_out=kept_out)
    equal = tuple(
        scored(equations, regression, columns, chosen, selection.library, prices=prices, kept_out=kept_out)
        for columns in near
    )
    return Selection(
        form=_subform(selection.library, chosen),
        options=selection,
        candidates=candidates,
        path=path,
        price=prices.least,
        variance=variance,
        same=resampled.same,
        passes=choice.passes,
        collinearity=collinearity(equations.regressors, equations.target, selection.library, chosen),
        equal=equal,
        spread=spread(regression, chosen, near, selection.library, prices=prices),
        warnings=(
            *lacking(variance, regression.rows - len(labels), alike=alike),
            *(() if choice.settled else (f"the choice of terms still changed after {choice.passes} passes",)),
            *ambiguous(equal, alpha_orders(selection.library, chosen)),
            *(() if np.array_equal(chosen, first) else (_DECIDED,)),
            *left_out(regression, chosen, selection.library, prices),
            *shared(equations, chosen, selection.library),
            *unstable(candidates, path, chosen.size, price=prices.least, repeats=repeats, predicted=bool(kept_out)),
        ),
    )


def _settled(lines: Linearization, selection: SelectionOptions, own: IntArray) -> _Choice:
    """Choose and smooth in turn until the choice stays.

    Args:
        lines: of the candidates, and of the constants of each flight.
        selection: the candidates.
        own: places of the constants of each flight: always there, and never candidates.
    """
    library = selection.library
    candidates = np.setdiff1d(np.arange(lines.form.size), own)
    chosen, passes, settled = _NONE, 0, False
    while not settled and passes < _MOST_PASSES:
        passes += 1
        every = lines.equations()
        equations = every.without(own)
        regression = equations.regression()
        widening = max(1.0, regression.rest / max(1, regression.rows - lines.form.size))
        constants = bool(own.size)
        prices = Prices.of(library, false_alarm=selection.false_alarm, widening=widening, constants=constants)
        found = best_subset(regression, prices=prices.enter, start=chosen)
        if not found.size:
            raise RefusedError(
                "no candidate term is seen above the noise", hint="fly maneuvers that move alpha, q and the elevator"
            )
        found = exchanged(regression, prices=prices.enter, chosen=found)
        settled = np.array_equal(found, chosen)
        chosen = found
        coefficients = np.zeros(lines.form.size)
        coefficients[candidates[chosen]] = regression.solution(chosen)[0]
        if own.size:
            left = every.target - every.regressors @ coefficients
            coefficients[own] = np.linalg.lstsq(every.regressors[:, own], left)[0]
        if not settled:
            lines.follow(coefficients, variance=regression.misfit(chosen) / max(1, regression.rows - chosen.size))
    return _Choice(chosen=chosen, equations=equations, prices=prices, passes=passes, settled=settled)


def _parted(sweep: Sweep, names: tuple[str, ...]) -> tuple[tuple[FlightRecord, ...], tuple[FlightRecord, ...]]:
    """Part the flights into those that are fitted and those that are predicted."""
    predicted = tuple(sweep[name] for name in names)
    fitted = tuple(record for record in sweep.records if record.name not in names)
    if not fitted:
        raise InputError("every flight is to be predicted: none is left to select from")
    return fitted, predicted


def _stretches(
    records: Sequence[FlightRecord], options: IdentificationOptions, form: ModelForm, *, windowed: bool
) -> tuple[Stretch, ...]:
    return tuple(
        piece for record in records for piece in stretches(record, options, windowed=windowed, further=form.inputs[1:])
    )


def _subform(library: ModelForm, chosen: IntArray) -> ModelForm:
    terms = [library.terms[i] for i in chosen]
    parts = [tuple(term for equation, term in terms if equation is wanted) for wanted in Equation]
    for equation, part in zip(Equation, parts, strict=True):
        if not part:
            raise RefusedError(
                f"no candidate term of {equation} is seen above the noise", hint="fly maneuvers that move the aircraft"
            )
    return ModelForm(alpha_dot=parts[0], q_dot=parts[1])


def _candidates(
    library: ModelForm, regression: Regression, chosen: IntArray, frequency: FloatArray
) -> tuple[Candidate, ...]:
    """Judge every candidate beside the chosen ones."""
    labels = library.labels()
    gains, misfit = regression.gains(chosen)
    found = []
    for i, (equation, term) in enumerate(library.terms):
        evidence, rival, loss = float(gains[i]), "", float("inf")
        if i in chosen:
            rest_gains, rest = regression.gains(chosen[chosen != i])
            rest_gains[i] = 0.0
            other = int(np.argmax(rest_gains))
            evidence = rest - misfit
            if rest_gains[other] > 0:
                rival, loss = labels[other], rest - float(rest_gains[other]) - misfit
        found.append(
            Candidate(
                equation=equation,
                term=term,
                chosen=i in chosen,
                evidence=evidence,
                frequency=float(frequency[i]),
                rival=rival,
                rival_loss=loss,
            )
        )
    return tuple(found)


def _order(equations: Equations, regression: Regression, chosen: IntArray) -> IntArray:
    """Return the chosen columns in orthogonal order, then the best of the others."""
    order = orthogonal_order(equations.regressors, equations.target, chosen)
    for _ in range(_BEYOND):
        gains, _misfit = regression.gains(np.sort(order))
        best = int(np.argmax(gains))
        if gains[best] <= 0:
            break
        order = np.append(order, best)
    return order


def _kept_out(
    predicted: tuple[FlightRecord, ...], lines: Linearization, options: IdentificationOptions, noise: FloatArray
) -> tuple[Equations, ...]:
    """Return the equations of the flights that are predicted, at states smoothed by the model that was chosen."""
    pieces = _stretches(predicted, options, lines.form, windowed=True)
    if not pieces:
        return ()
    other = Linearization(pieces, lines.form, options, noise)
    for _ in range(2):
        other.follow(lines.coefficients, variance=1.0)
    return (other.equations(),)
