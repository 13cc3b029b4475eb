"""One stretch's linearized residuals without the unknowns that belong to it alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol, final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from finback.arrays import FloatArray
from finback.errors import RefusedError
from finback.identification.chain import Linearization

_SINGULAR: Final = 1e-10
"""Below this share of its column's length, what is left of a column is rounding."""


class Expected(Protocol):
    """What is known beforehand of the extras of a stretch: its biases and its delay."""

    @property
    def names(self) -> tuple[str, ...]:
        """Their names."""

    @property
    def deviations(self) -> FloatArray:
        """The standard deviation expected of each, in SI, shape (e,): 0 if there is none, ``inf`` if unknown."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Elimination:
    """The triangle of a stretch's whitened residuals, split into unknowns of its own (k) and coefficients (p).

    Attributes:
        wanted: which of the local unknowns are estimated, shape (local,), k of them true.
        own: triangle of the estimated ones, shape (k, k).
        mixed: the same rows' part for the coefficients, shape (k, p).
        target: of these rows, shape (k,).
        rows: rows for the coefficients alone, shape (m, p).
        rest: their target for a step of the coefficients, shape (m,).
    """

    wanted: NDArray[np.bool_]
    own: FloatArray
    mixed: FloatArray
    target: FloatArray
    rows: FloatArray
    rest: FloatArray

    def local(self, change: FloatArray) -> FloatArray:
        """Return the step of all local unknowns that goes with a step of the coefficients (p,)."""
        step = np.zeros(self.wanted.size)
        step[self.wanted] = solve_triangular(self.own, self.target - self.mixed @ change, check_finite=False)
        return step

    def local_errors(self, covariance: FloatArray) -> FloatArray:
        """Return the standard errors of all local unknowns, given the covariance of the coefficients (p, p)."""
        inverse = solve_triangular(self.own, np.eye(len(self.own)), check_finite=False)
        mixed = inverse @ self.mixed
        errors = np.zeros(self.wanted.size)
        errors[self.wanted] = np.sqrt((inverse**2).sum(axis=1) + np.einsum("ij,jk,ik->i", mixed, covariance, mixed))
        return errors


def eliminate(
    found: Linearization, extras: FloatArray, white: FloatArray, expected: Expected, size: int, flight: str
) -> Elimination:
    """Triangulate a stretch's residuals.

    Args:
        found: the stretch's linearization.
        extras: the present biases and delay, shape (e,).
        white: what makes the noise of the outputs white with variance 1, shape (outputs, outputs).
        expected: which extras are estimated, and what is known of them beforehand.
        size: number of coefficients p.
        flight: name of the flight.

    Raises:
        RefusedError: the stretch cannot tell its own unknowns apart.
    """
    local = found.derivative.shape[2] - size
    wanted = np.concatenate([np.ones(local - extras.size, dtype=np.bool_), expected.deviations > 0.0])
    columns = np.concatenate([np.flatnonzero(wanted), local + np.arange(size)])
    rows = np.concatenate([found.derivative[:, :, columns], found.residual[:, :, np.newaxis]], axis=2)
    stacked = (white @ rows).reshape(-1, columns.size + 1)
    every = np.vstack([stacked, _prior(wanted, columns.size + 1, extras, expected)])
    triangle = np.linalg.qr(every).R
    k = int(wanted.sum())
    _refuse_lost(triangle, every, wanted, expected.names, flight)
    return Elimination(
        wanted=wanted,
        own=triangle[:k, :k],
        mixed=triangle[:k, k:-1],
        target=triangle[:k, -1],
        rows=_without_rounding(triangle[k:, k:-1], every[:, k:-1]),
        rest=triangle[k:, -1],
    )


def project(rows: FloatArray, extras: FloatArray, expected: Expected, flight: str) -> Elimination:
    """Free the whitened equations of a stretch from its biases and delay; their order stays.

    Args:
        rows: columns of all extras, the coefficients, the target, shape (m, e + p + 1).
        extras: the present biases and delay, shape (e,).
        expected: which are estimated, and what is known of them beforehand.
        flight: name of the flight.

    Returns:
        The elimination; its rows are as many as were given, and one more for each extra of which something is known.

    Raises:
        RefusedError: the stretch cannot tell its own unknowns apart.
    """
    wanted = expected.deviations > 0.0
    kept = np.concatenate([np.flatnonzero(wanted), np.arange(extras.size, rows.shape[1])])
    every = np.vstack([rows[:, kept], _prior(wanted, kept.size, extras, expected)])
    k = int(wanted.sum())
    basis, triangle = np.linalg.qr(every[:, :k])
    _refuse_lost(triangle, every, wanted, expected.names, flight)
    shadow = basis.T @ every[:, k:]
    free = every[:, k:] - basis @ shadow
    return Elimination(
        wanted=wanted,
        own=triangle,
        mixed=shadow[:, :-1],
        target=shadow[:, -1],
        rows=_without_rounding(free[:, :-1], every[:, k:-1]),
        rest=free[:, -1],
    )


def _without_rounding(rows: FloatArray, every: FloatArray) -> FloatArray:
    """Return what is left of columns, nothing where it is but rounding: a stretch's own unknowns can do all they do."""
    left = np.linalg.norm(rows, axis=0) > _SINGULAR * np.linalg.norm(every, axis=0)
    return np.where(left, rows, 0.0)


def _prior(wanted: NDArray[np.bool_], columns: int, extras: FloatArray, expected: Expected) -> FloatArray:
    """Return the equations that say what is known of the extras beforehand, shape (known, columns)."""
    deviations = expected.deviations
    known = np.flatnonzero((deviations > 0.0) & np.isfinite(deviations))
    prior = np.zeros((known.size, columns))
    place = np.cumsum(wanted) - 1
    prior[np.arange(known.size), place[wanted.size - extras.size + known]] = 1.0 / deviations[known]
    prior[:, -1] = -extras[known] / deviations[known]
    return prior


def _refuse_lost(
    triangle: FloatArray, every: FloatArray, wanted: NDArray[np.bool_], extras: tuple[str, ...], flight: str
) -> None:
    """Raise RefusedError if some of a stretch's own columns are but rounding beside the others."""
    k = int(wanted.sum())
    lost = np.abs(np.diag(triangle)[:k]) <= _SINGULAR * np.sqrt((every[:, :k] ** 2).sum(axis=0))
    if lost.any():
        names = [*["the start"] * (wanted.size - len(extras)), *extras]
        what = {names[i] for i in np.flatnonzero(wanted)[lost].tolist()}
        raise RefusedError(
            f"flight '{flight}' cannot tell {', '.join(sorted(what))}",
            hint="estimate fewer biases, or use only flights whose elevator moves",
        )


def influence(found: Linearization, white: FloatArray, reduced: Elimination) -> FloatArray:
    """Return the whitened derivative of the prediction by the coefficients, what local unknowns can do taken out.

    Shape (n, outputs, p). With it, the step of the coefficients is C Σ influenceᵀ residual, C their covariance.
    """
    local = np.flatnonzero(reduced.wanted)
    own = (white @ found.derivative[:, :, local]).reshape(-1, local.size)
    coefficients = (white @ found.derivative[:, :, reduced.wanted.size :]).reshape(len(own), -1)
    orthogonal = own @ solve_triangular(reduced.own, reduced.mixed, check_finite=False)
    return (coefficients - orthogonal).reshape(*found.residual.shape, -1)
