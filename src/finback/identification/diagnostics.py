"""What the residuals of an estimate say of it: numbers, a wider covariance, and words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.lienard import NORMAL_95
from finback.identification.coloring import Coloring
from finback.identification.estimate import Estimate
from finback.identification.flight_constants import told_apart_by
from finback.identification.model_form import Equation, ModelForm
from finback.identification.term import ELEVATOR, Q, Term

_SIGNIFICANT: Final = 5.0
"""Standard deviations by which the mean square residual must pass 1 before the covariance is widened."""
_KINEMATIC: Final = (0.8, 1.02)
"""Between these the coefficient of q in dα/dt lies: 1 less what the lift by q does, ρ S c CLq / (4 m): 0.01 to 0.03 of
most aircraft, up to 0.15 of the very light. It is above 1 only where lift falls as q rises, with most of the wing ahead
of the center of gravity, and by no more than it is below 1 of most others."""
_SURE: Final = 3.0
"""Standard errors by which a coefficient must be beyond."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnostics:
    """How well the data supported the fit. Pairs are for (dα/dt, dq/dt); for output and filter error, (alpha, q).

    Attributes:
        equations: number of equations of each kind; for output and filter error, of samples.
        condition_number: of the whitened regressor with columns scaled to length 1; far above 30, some
            coefficients are known together much better than each alone (their covariance says how).
        chi_square: mean square of the whitened residuals; 1 if model and noise explain the data.
        lag1_correlation: correlation of neighboring whitened residuals; 0 if model and noise explain the data.
        used_fraction: share of all samples that was used.
        iterations: of the estimate with its own noise covariance.
        whiteness: probability that white residuals are as correlated as these (Ljung and Box 1978, 20 lags).
        coloring: how much larger the color of the residuals makes standard errors (median); 1 if they are white.
        process: spectral densities of the noise that filter error finds on dα/dt in rad²/s and on dq/dt in rad²/s³;
            0 for other methods, which know none.
    """

    equations: int
    condition_number: float
    chi_square: tuple[float, float]
    lag1_correlation: tuple[float, float]
    used_fraction: float
    iterations: int
    whiteness: tuple[float, float] = (1.0, 1.0)
    coloring: float = 1.0
    process: tuple[float, float] = (0.0, 0.0)


def diagnostics(fit: Estimate, color: Coloring, noise: FloatArray, *, used_fraction: float) -> Diagnostics:
    """Judge the whitened residuals: their size and the correlation of neighbors; ``noise`` is that of the records."""
    rows = np.concatenate(fit.residuals)
    squares = np.mean(rows**2, axis=0) * (fit.noise / noise) ** 2 / (1 - fit.coefficients.size / rows.size)
    pairs = sum((piece[1:] * piece[:-1]).sum(axis=0) for piece in fit.residuals)
    lag1 = pairs / np.maximum((rows**2).sum(axis=0), np.finfo(np.float64).tiny)
    return Diagnostics(
        equations=len(rows),
        condition_number=fit.condition_number,
        chi_square=(float(squares[0]), float(squares[1])),
        lag1_correlation=(float(lag1[0]), float(lag1[1])),
        used_fraction=used_fraction,
        iterations=fit.iterations,
        whiteness=(color.probability[0], color.probability[1]),
        coloring=color.factor,
        process=(float(fit.process[0]), float(fit.process[1])),
    )


def covariance_widening(fit: Estimate) -> float:
    """Return the factor of the covariance: 1, or the mean square residual if noise does not explain it."""
    return fit.variance if fit.variance > _largest_by_chance(fit) else 1.0


def _largest_by_chance(fit: Estimate) -> float:
    return 1 + _SIGNIFICANT * math.sqrt(2 / sum(rows.size for rows in fit.residuals))


def warnings(fit: Estimate, form: ModelForm, noise: FloatArray, color: Coloring) -> tuple[str, ...]:
    """Return what a reader of the coefficients must know; ``noise`` is that of the records, shape (2,)."""
    found = []
    larger = fit.variance * float(np.mean((fit.noise / noise) ** 2))
    if larger > _largest_by_chance(fit):
        found.append(
            f"residuals are {math.sqrt(larger):.3g} times larger than the noise of the records explains: the model's "
            f"form does not hold everywhere{_own_constants(fit, form)}; standard errors are widened by this factor"
        )
    if color.colored:
        found.append(
            "residuals are not white (Ljung and Box, 20 lags): the model or its noise is not what the fit takes it "
            f"for; standard errors are corrected for this, by a factor of {color.factor:.3g} more (median)"
        )
    if not fit.converged:
        found.append(f"the estimate still moved after {fit.iterations} iterations: do not trust its last digits")
    errors = np.sqrt(np.diag(color.covariance))
    found += _against_signs(fit, form, errors)
    weak = (np.abs(fit.coefficients) < NORMAL_95 * errors) & (errors > 0)
    if weak.any():
        found.append(f"not told from zero (95 %): {', '.join(np.array(form.labels())[weak].tolist())}")
    return tuple(found)


def _own_constants(fit: Estimate, form: ModelForm) -> str:
    """Say what else may explain residuals of several stretches, unless it was asked for."""
    if len(fit.states) == 1 or told_apart_by(form):
        return ""
    return ", or the flights have constants of their own (constants_per_flight)"


def _against_signs(fit: Estimate, form: ModelForm, errors: FloatArray) -> list[str]:
    """Say where dα/dt is not nearly q plus forces, or the elevator acts the wrong way: then a channel is not as taken.

    An alpha that is scaled by k, or late by τ, follows equations of the same form, so that no residual tells of it; nor
    of an elevator with the other sign.
    """
    said = []
    turning = _alone(fit, form, errors, Equation.ALPHA_DOT, Q)
    if turning[0] - turning[1] > _KINEMATIC[1] or turning[0] + turning[1] < _KINEMATIC[0]:
        how = ("much", "late") if turning[0] > 1.0 else ("little", "early")
        said.append(
            f"the coefficient of q in dalpha/dt is {turning[0]:.3g} (its 99.7 % interval ± {turning[1]:.2g}); but for "
            f"forces, dalpha/dt is q, so it is nearly 1: alpha reads too {how[0]} (a vane in the flow around the "
            f"aircraft) or is {how[1]}, and its coefficients are off"
        )
    lifting, pitching = (_alone(fit, form, errors, equation, ELEVATOR) for equation in Equation)
    if pitching[0] > pitching[1]:
        said.append(
            "dq/dt rises with the elevator; ours is positive trailing edge down, nose down: if this one is not, turn "
            "its sign (factors: elevator = -1)"
        )
    elif pitching[0] < -pitching[1] and lifting[0] > lifting[1]:
        said.append(
            "dalpha/dt rises with the elevator, though trailing edge down lifts: alpha is late or the elevator early"
        )
    return said


def _alone(
    fit: Estimate, form: ModelForm, errors: FloatArray, equation: Equation, variable: str
) -> tuple[float, float]:
    """Return a coefficient and how far it is known; without bound if it was given, or its variable stands elsewhere."""
    terms = form.alpha_dot if equation is Equation.ALPHA_DOT else form.q_dot
    alone = Term.of(**{variable: 1})
    if [term for term in terms if variable in term.variables] != [alone]:
        return 1.0, math.inf
    place = form.index(equation, alone)
    return float(fit.coefficients[place]), _SURE * float(errors[place]) or math.inf
