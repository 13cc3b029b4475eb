"""The spread of coefficients by fitting again: the second road to their uncertainty, without a formula.

Efron & Tibshirani (1993), chapters 6 and 8; blocks of residuals after Künsch (1989, Ann. Statist. 17(3)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError, RefusedError
from finback.identification.estimate import Estimate
from finback.identification.estimators import estimated
from finback.identification.flight_constants import with_constants
from finback.identification.maneuver import linearize, maneuver
from finback.identification.model_form import ModelForm
from finback.identification.noise import measured_noise
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch, stretches
from finback.records import Sweep

_MOST_REFUSED: Final = 0.2
"""Share of draws that may be refused before the spread of the others says too little."""
_FEWEST_STRETCHES: Final = 5
"""Of fewer, too few different draws can be made, and most of them miss what one flight alone has shown."""


@final
class Scheme(StrEnum):
    """What is drawn anew."""

    MANEUVER = "maneuver"
    """whole stretches of flight, with replacement: makes no assumption about noise or model"""
    BLOCK = "block"
    """the model's own flight, with blocks of its residuals: keeps their color, takes the model for right"""
    PARAMETRIC = "parametric"
    """the model's own flight, with white noise of the size found: takes model and noise for right"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Bootstrap:
    """Coefficients of repeated fits.

    Attributes:
        coefficients: of the form, one row a draw, shape (draws - refused, p).
        estimate: those of the data themselves, shape (p,).
        scheme: what was drawn.
        refused: draws whose fit was refused.
    """

    coefficients: FloatArray
    estimate: FloatArray
    scheme: Scheme
    refused: int

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the draws, shape (p, p)."""
        return np.atleast_2d(np.cov(self.coefficients, rowvar=False))

    @property
    def standard_errors(self) -> FloatArray:
        """Standard deviations of the draws, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def bias(self) -> FloatArray:
        """Mean of the draws less the estimate, shape (p,)."""
        bias: FloatArray = self.coefficients.mean(axis=0) - self.estimate
        return bias

    def intervals(self) -> FloatArray:
        """Return the central 95 % of the draws, shape (p, 2)."""
        low, high = np.percentile(self.coefficients, [2.5, 97.5], axis=0)
        return np.stack([low, high], axis=1)


def bootstrap(
    sweep: Sweep,
    options: IdentificationOptions,
    *,
    scheme: Scheme,
    draws: int = 200,
    seed: int = 0,
    block_s: float = 0.25,
) -> Bootstrap:
    """Fit draws of the flights.

    Args:
        sweep: the flights.
        options: as for ``identify``; output error is the method whose own flight is that of its model.
        scheme: what is drawn anew.
        draws: how many.
        seed: of the draws.
        block_s: length of the blocks of residuals, in s: longer than their color lasts, much shorter than a flight.

    Raises:
        InputError: fewer than two draws, or a block of no length.
        RefusedError: the data support no fit; whole stretches are to be drawn from fewer than five; more than a fifth
            of the draws support none.
    """
    if draws < 2 or not block_s > 0.0:
        raise InputError(f"{draws} draws with blocks of {block_s:g} s are no bootstrap", hint="use 100 draws or more")
    given = options.model_form
    used = [
        piece
        for record in sweep.records
        for piece in stretches(record, options, windowed=True, further=given.inputs[1:])
    ]
    if not used:
        raise RefusedError(f"none of the flights of '{sweep.study}' can be used", hint="finback identify says why")
    if scheme is Scheme.MANEUVER and len(used) < _FEWEST_STRETCHES:
        raise RefusedError(
            f"whole stretches cannot be drawn from {len(used)}: at least {_FEWEST_STRETCHES} are needed",
            hint="draw blocks of residuals instead (Scheme.BLOCK)",
        )
    used, options, _ = with_constants(used, options)
    form = options.model_form
    places = [form.index(equation, term) for equation, term in given.terms]
    fit = estimated(used, options, measured_noise(used))
    random = np.random.default_rng(seed)
    flown = [] if scheme is Scheme.MANEUVER else _flown(used, form, fit)
    rows, refused = [], 0
    for _ in range(draws):
        drawn = _drawn(used, flown, fit, scheme, random, block_s)
        try:
            rows.append(estimated(drawn, options, measured_noise(drawn)).coefficients[places])
        except RefusedError:
            refused += 1
    if refused > _MOST_REFUSED * draws:
        raise RefusedError(
            f"{refused} of {draws} draws support no fit: the spread of the others would be too small",
            hint="fly more maneuvers, or ask for fewer terms",
        )
    return Bootstrap(coefficients=frozen_array(rows), estimate=fit.coefficients[places], scheme=scheme, refused=refused)


def _flown(used: Sequence[Stretch], form: ModelForm, fit: Estimate) -> list[FloatArray]:
    """Return the model's own flight of each stretch, from the states of the estimate, shape (n, 2)."""
    flown = []
    for piece, state in zip(used, fit.states, strict=True):
        one, guess = maneuver(piece, form, fit.coefficients, state)
        flown.append(linearize(one, form, fit.coefficients, guess).states)
    return flown


def _drawn(
    used: Sequence[Stretch],
    flown: Sequence[FloatArray],
    fit: Estimate,
    scheme: Scheme,
    random: np.random.Generator,
    block_s: float,
) -> list[Stretch]:
    """Return one draw of all stretches."""
    if scheme is Scheme.MANEUVER:
        return [used[i] for i in random.integers(len(used), size=len(used)).tolist()]
    drawn = []
    for piece, states in zip(used, flown, strict=True):
        if scheme is Scheme.PARAMETRIC:
            noise = fit.noise * random.standard_normal(states.shape)
        else:
            residual = piece.measured - states
            noise = _blocks(residual - residual.mean(axis=0), max(1, round(block_s / piece.interval_s)), random)
        drawn.append(replace(piece, measured=frozen_array(states + noise)))
    return drawn


def _blocks(residual: FloatArray, length: int, random: np.random.Generator) -> FloatArray:
    """Return as many rows, put together from blocks that begin anywhere; the end is followed by the beginning."""
    count = len(residual)
    starts = random.integers(count, size=-(-count // length))
    rows = (starts[:, np.newaxis] + np.arange(length)).ravel()[:count] % count
    drawn: FloatArray = residual[rows]
    return drawn
