"""The terms that the data need, out of a library of candidates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.special import chdtri

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.errors import InputError, RefusedError
from finback.identification.gate import Collinearity, collinearity
from finback.identification.model_form import Equation, ModelForm
from finback.identification.noise import measured_noise
from finback.identification.options import IdentificationOptions
from finback.identification.selection.equations import Equations, Linearization
from finback.identification.selection.options import SelectionOptions
from finback.identification.selection.path import Step, orthogonal_order, walk
from finback.identification.selection.regression import Regression
from finback.identification.selection.search import best_subset
from finback.identification.selection.stability import stability
from finback.identification.stretch import Stretch, beyond_half_turn, stretches
from finback.identification.term import ALPHA, ALPHA_DOT, Term
from finback.records import FlightRecord, Sweep

_MOST_PASSES: Final = 10
_RATES: Final = {Equation.ALPHA_DOT: "dalpha/dt", Equation.Q_DOT: "dq/dt"}
_DEGREE: Final = 1.0
"""What each degree of a term costs beside the price, in noise variances, so that of two terms that explain the data
alike the simpler one is taken; one with dα/dt costs more than any without. Far below the price, this hides nothing."""
_BEYOND: Final = 4
"""Terms beyond the chosen ones that the path shows, so that one sees the predicted error rise."""
_SIGNIFICANT: Final = 5.0
"""Standard deviations by which the mean square of what all candidates leave must pass 1 before a warning says so."""
_STABLE: Final = 0.8
"""Terms that fewer of the repetitions choose are named in a warning."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One candidate term. Evidence is in units of the noise variance: the square of a number of standard errors.

    Attributes:
        equation: where it would stand.
        term: what its coefficient would multiply.
        chosen: whether it is in the model.
        evidence: of a chosen term, how much the sum of squares would rise without it; of another one, how much it
            would fall with it.
        frequency: share of the resampled selections that chose it; 0 if there were none.
        rival: the term that could best stand in its place; empty if it is not chosen or none could.
        rival_loss: how much the sum of squares would rise with the rival instead; infinite without one.
    """

    equation: Equation
    term: Term
    chosen: bool
    evidence: float
    frequency: float
    rival: str
    rival_loss: float


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
    warnings: tuple[str, ...]

    @property
    def orders(self) -> tuple[int, int]:
        """The highest power of alpha alone in dα/dt and in dq/dt: n_α and n_q of Shi & Fan (2013), Eq. (4) and (5)."""
        one, two = (
            max(
                (
                    part.factors[0][1]
                    for term in terms
                    for part in term.monomials
                    if len(part.factors) == 1 and part.factors[0][0] == ALPHA
                ),
                default=0,
            )
            for terms in (self.form.alpha_dot, self.form.q_dot)
        )
        return one, two


def select(sweep: Sweep, options: IdentificationOptions, selection: SelectionOptions) -> Selection:
    """Choose the terms of dα/dt and dq/dt from a library.

    Works on the weak form of both equations together, so noise does not bias the regressors, and how the elevator is
    held is respected. The form that is chosen has the smallest predicted squared error: the sum of squares of what it
    leaves, plus a price for each term, such that noise alone brings any term into the model with a chance of
    ``false_alarm`` (Bonferroni's bound over all candidates). Where even all candidates leave more than noise, the
    price rises in proportion.

    Regressors need states free of noise, and these need a model: the choice is repeated with states smoothed by the
    model chosen last, until it stays.

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
    lines = Linearization(used, selection.library, options, noise)
    chosen, equations, price, passes, settled = _settled(lines, selection)
    regression = equations.regression()
    labels = selection.library.labels()
    form = _subform(selection.library, chosen)
    repeats = selection.bootstraps
    resampled = (
        stability(
            equations,
            chosen,
            prices=_prices(selection.library, price),
            always=_NONE,
            count=max(repeats, 1),
            seed=selection.seed,
        )
        if repeats
        else None
    )
    frequency = resampled.frequency if resampled else np.zeros(len(labels))
    candidates = _candidates(selection.library, regression, chosen, frequency)
    order = _order(equations, regression, chosen)
    kept_out = _kept_out(predicted, lines, options, noise)
    path = walk(equations, order, labels, price=price, kept_out=kept_out)
    variance = regression.rest / max(1, regression.rows - len(labels))
    return Selection(
        form=form,
        options=selection,
        candidates=candidates,
        path=path,
        price=price,
        variance=variance,
        same=resampled.same if resampled else 0.0,
        passes=passes,
        collinearity=collinearity(equations.regressors, equations.target, selection.library, chosen),
        warnings=(
            *_lacking(variance, regression.rows - len(labels)),
            *(() if settled else (f"the choice of terms still changed after {passes} passes",)),
            *_warnings(candidates, path, chosen.size, price, repeats > 0, bool(kept_out)),
        ),
    )


_NONE: Final = np.array([], dtype=np.int64)


def _settled(lines: Linearization, selection: SelectionOptions) -> tuple[IntArray, Equations, float, int, bool]:
    """Choose and smooth in turn until the choice stays."""
    size = selection.library.size
    least = float(chdtri(1, selection.false_alarm / size))
    chosen, passes, settled = _NONE, 0, False
    while not settled and passes < _MOST_PASSES:
        passes += 1
        equations = lines.equations()
        regression = equations.regression()
        price = least * max(1.0, regression.rest / max(1, regression.rows - size))
        found = best_subset(regression, prices=_prices(selection.library, price), always=_NONE, start=chosen)
        if not found.size:
            raise RefusedError(
                "no candidate term is seen above the noise", hint="fly maneuvers that move alpha, q and the elevator"
            )
        settled = np.array_equal(found, chosen)
        chosen = found
        coefficients = np.zeros(size)
        coefficients[chosen] = regression.solution(chosen)[0]
        if not settled:
            lines.follow(coefficients, variance=regression.misfit(chosen) / max(1, regression.rows - chosen.size))
    return chosen, equations, price, passes, settled


def _prices(library: ModelForm, price: float) -> FloatArray:
    implicit = 1 + max(term.degree for _, term in library.terms)
    degrees = [term.degree + implicit * (ALPHA_DOT in term.variables) for _, term in library.terms]
    return frozen_array(price + _DEGREE * np.array(degrees))


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


def _lacking(variance: float, freedom: int) -> tuple[str, ...]:
    """Say that the library lacks something, if noise as it was measured does not explain what all of it leaves."""
    if variance <= 1 + _SIGNIFICANT * math.sqrt(2 / max(1, freedom)):
        return ()
    size = math.sqrt(variance)
    return (
        (
            f"even all candidates leave {size:.3g} times the noise of the records: the library lacks something, or the "
            "air moved; terms may stand for what is not among them"
        ),
    )


def _warnings(
    candidates: tuple[Candidate, ...],
    path: tuple[Step, ...],
    size: int,
    price: float,
    resampled: bool,  # noqa: FBT001 - an inner function
    predicted: bool,  # noqa: FBT001 - an inner function
) -> tuple[str, ...]:
    """Say what speaks against the choice."""
    found = []
    for item in candidates:
        label = f"{item.term.label} in {_RATES[item.equation]}"
        if item.chosen and item.rival_loss < price:
            found.append(f"{label}: the data would be explained nearly as well by {item.rival} in its place")
        if resampled and item.chosen and item.frequency < _STABLE:
            found.append(f"{label}: only {item.frequency:.0%} of the resampled selections chose it")
    for what, values, asked in (
        ("PRESS", [step.press for step in path], True),
        ("the prediction of the flights kept out", [step.prediction for step in path], predicted),
    ):
        best = int(np.argmin(values)) + 1
        if asked and values[size - 1] > values[best - 1] * (1 + price / 100):
            found.append(f"{what} would have chosen {best} terms, not {size}")
    return tuple(found)
