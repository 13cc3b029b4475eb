"""What a term must explain to come into a model, and what it must not explain to be left out without a word."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.identification.model_form import ModelForm
from finback.identification.selection.library import power_of_alpha
from finback.identification.term import ALPHA, ALPHA_DOT, ELEVATOR, Q

_DEGREE: Final = 1.0
"""What each degree of a term costs beside the price, in noise variances, so that of two terms that explain the data
alike the simpler one is taken; one with dα/dt costs more than any without. Far below the price, this hides nothing."""
_DOUBT: Final = 10.0
"""Chances, in units of ``false_alarm``, at which a term that was left out raises a doubt."""
_EXPECTED_DOUBT: Final = 2.0
"""Evidence in noise variances at which a term that was expected, but left out, raises a doubt: below it, even the
mean square of a prediction would not gain (Akaike 1974)."""
_EXPECTED: Final = frozenset({ALPHA, Q, ELEVATOR, "canard_rad"})
"""The motion and its controls."""
_LOWER_DOUBT: Final = 4.0
"""The same for a lower power of alpha than one that was chosen: the origin of alpha is arbitrary, and another one would
make such powers, so that chances of 5 % are doubt enough."""

_ALWAYS: Final = -1e6
"""The price of a term that is in the model whatever it explains: a refund, so that no search leaves it out."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Prices:
    """Evidence in noise variances. All arrays have shape (p,).

    Attributes:
        widening: mean square of what all candidates leave, at least 1.
        least: that brings in a term which nobody expects, without its degree.
        enter: that brings in each term.
        doubt: at which each term that was left out raises a doubt.
        expected: which terms any model of an aircraft is expected to have: the constant, and alpha, q and the controls
            to the first power.
    """

    widening: float
    least: float
    enter: FloatArray
    doubt: FloatArray
    expected: NDArray[np.bool_]

    @classmethod
    def of(cls, library: ModelForm, *, false_alarm: float, widening: float, constants: bool = False) -> Prices:
        """Set the prices of a library.

        A term that is expected is judged alone; all others share the chance of a false alarm (Bonferroni's bound).

        Args:
            library: the candidates.
            false_alarm: chance that noise alone brings in an expected term, and any of the others.
            widening: mean square of what all candidates leave, at least 1.
            constants: whether the constants are in the model whatever they explain.
        """
        implicit = 1 + max(term.degree for _, term in library.terms)
        degrees = np.array([term.degree + implicit * (ALPHA_DOT in term.variables) for _, term in library.terms])
        expected = np.array([term.degree <= 1 and _EXPECTED.issuperset(term.variables) for _, term in library.terms])
        least = widening * float(chdtri(1, false_alarm / library.size))
        doubt = widening * float(chdtri(1, min(0.5, _DOUBT * false_alarm / library.size)))
        enter = np.where(expected, widening * float(chdtri(1, false_alarm)), least) + _DEGREE * degrees
        always = np.array([constants and not term.variables for _, term in library.terms])
        return cls(
            widening=widening,
            least=least,
            enter=frozen_array(np.where(always, _ALWAYS, enter)),
            doubt=frozen_array(np.where(always, _ALWAYS, np.where(expected, _EXPECTED_DOUBT * widening, doubt))),
            expected=expected,
        )

    @property
    def paid(self) -> FloatArray:
        """What the terms add to a predicted error, shape (p,): nothing for those that are always there."""
        return np.maximum(self.enter, 0.0)

    def beside(self, library: ModelForm, chosen: IntArray) -> Prices:
        """Return the same where lower powers of alpha than the chosen ones raise a doubt earlier."""
        highest = {
            equation: max(
                (power_of_alpha(library, int(i)) for i in chosen if library.terms[i][0] is equation), default=0
            )
            for equation, _ in library.terms
        }
        lower = np.array(
            [1 < power_of_alpha(library, i) < highest[equation] for i, (equation, _) in enumerate(library.terms)]
        )
        doubt = np.where(lower, _LOWER_DOUBT * self.widening, self.doubt)
        return replace(self, doubt=frozen_array(doubt))
