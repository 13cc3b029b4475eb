"""Whitened residuals of every weak equation, and what signals beside the model's own terms explain of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import comb
from typing import Final, final

import numpy as np
from scipy.linalg import block_diag

from finback.arrays import FloatArray
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch
from finback.identification.suspicions.signals import SPEED, Signals
from finback.identification.suspicions.significance import explained, orthonormal
from finback.identification.weak_form import Sides, WeakForm, weak_form
from finback.identification.whitening import Whitening, whitening

_MEMORY: Final = 8  # neighbors whose correlation the test allows for: two half widths of the usual test function
_BIASES: Final = 3  # of alpha, q and the elevator: the first of a stretch's extras
_DIFFERENCED: Final = 2.0 * sum((comb(12, 6 + lag) / comb(12, 6)) ** 2 for lag in range(-6, 7))
"""Of the mean square of sixth differences: twice the sum of the squares of their autocorrelation."""
OF_SLOW: Final = 0.05
"""Of what slow changes explain, where the airspeed is not known: as much may be left of what the airspeed does."""
_COLLINEAR: Final = 1e-6  # of its length is left of a signal that is there already


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Residuals:
    """Residuals of a fit in units in which the sensors' white noise is 1, rows (dα/dt, dq/dt) per test function.

    Attributes:
        forms: the weak equations of every stretch.
        sides: the fitted model at the smoothed states.
        states: smoothed alpha in rad and q in rad/s of each stretch, shape (n, 2).
        coefficients: of the fitted model, in SI, shape (p,).
        noise: standard deviations of alpha in rad and q in rad/s, shape (2,).
        beside: airspeed and pitch angle of every stretch, as far as they are known, shape (n,) each.
        white: what makes the noise white.
        basis: orthonormal; what is allowed to explain the residuals, shape (2 K, m).
        raw: residuals before anything of the basis is taken out, shape (2 K,).
        values: residuals free of the basis, shape (2 K,).
    """

    forms: tuple[WeakForm, ...]
    sides: tuple[Sides, ...]
    states: tuple[FloatArray, ...]
    coefficients: FloatArray
    noise: FloatArray
    beside: tuple[Mapping[str, FloatArray], ...]
    white: Whitening
    basis: FloatArray
    raw: FloatArray
    values: FloatArray

    @property
    def excess(self) -> FloatArray:
        """Mean square of the residuals of (dα/dt, dq/dt), freedom counted, shape (2,); 1 for noise alone."""
        squares: FloatArray = np.sum(self.values.reshape(-1, 2) ** 2, axis=0)
        mean: FloatArray = squares / max(0.5 * (self.values.size - self.basis.shape[1]), 1.0)
        return mean

    @property
    def speed_known(self) -> bool:
        """Whether every stretch has the airspeed."""
        return all(SPEED in channels for channels in self.beside)

    @property
    def uncertainty(self) -> float:
        """Standard error of the variance of the sensors' white noise, over itself: it is measured on the records."""
        return float(np.sqrt(_DIFFERENCED / sum(len(weak.stretch) for weak in self.forms)))

    def columns(self, signals: Signals) -> FloatArray:
        """Return signals as whitened columns, each in both equations, shape (2 K, 2 · signals)."""
        return self.white(stacked(self.forms, signals))

    def without_biases(self) -> Residuals:
        """Return the residuals that are left when alpha, q and elevator of each stretch may read too much."""
        parts = [weak.extras(side)[:, :, :_BIASES] for weak, side in zip(self.forms, self.sides, strict=True)]
        return self.without(self.white(block_diag(*(part.reshape(-1, _BIASES) for part in parts))))

    def without(self, columns: FloatArray) -> Residuals:
        """Return the residuals that are left when these whitened columns may explain what they can."""
        more = orthonormal(self._free(columns))
        left = self.values - more @ (more.T @ self.values)
        return replace(self, basis=np.concatenate([self.basis, more], axis=1), values=left)

    def explained(self, columns: FloatArray) -> tuple[float, float]:
        """Return the probability that chance explains as much as whitened columns do, and the share they explain.

        See ``significance.explained``.
        """
        spent, memory = self.basis.shape[1], 2 * _MEMORY  # two equations a test function
        return explained(self.values, self._free(columns), spent=spent, memory=memory)

    def _free(self, whole: FloatArray) -> FloatArray:
        """Return columns free of the basis, without those that it holds already, each of length 1."""
        free = whole - self.basis @ (self.basis.T @ whole)
        length = np.linalg.norm(free, axis=0)
        kept = length > _COLLINEAR * np.maximum(np.linalg.norm(whole, axis=0), np.finfo(np.float64).tiny)
        scaled: FloatArray = free[:, kept] / length[kept]
        return scaled


def residuals(
    used: Sequence[Stretch],
    options: IdentificationOptions,
    *,
    coefficients: FloatArray,
    states: Sequence[FloatArray],
    noise: FloatArray,
    beside: Sequence[Mapping[str, FloatArray]],
) -> Residuals:
    """Return the residuals of a fitted model, free of what its own coefficients can still explain.

    Args:
        used: the data of the fit.
        options: of the fit: form and test functions.
        coefficients: of the fitted model, in SI, shape (p,).
        states: smoothed (alpha, q) of each stretch, shape (n, 2).
        noise: standard deviations of alpha in rad and q in rad/s as the records show them, shape (2,).
        beside: airspeed and pitch angle of every stretch, as far as they are known, shape (n,) each.
    """
    form = options.model_form
    forms = tuple(weak_form(stretch, form, options) for stretch in used)
    sides = tuple(weak.sides(coefficients, state) for weak, state in zip(forms, states, strict=True))
    white = whitening(forms, sides, noise)
    own, raw = own_columns(forms, sides, states, coefficients)
    whitened = white(np.column_stack([own, raw]))
    basis = orthonormal(
        whitened[:, :-1] / np.maximum(np.linalg.norm(whitened[:, :-1], axis=0), np.finfo(np.float64).tiny)
    )
    return Residuals(
        forms=forms,
        sides=sides,
        states=tuple(states),
        coefficients=coefficients,
        noise=noise,
        beside=tuple(beside),
        white=white,
        basis=basis,
        raw=whitened[:, -1],
        values=whitened[:, -1] - basis @ (basis.T @ whitened[:, -1]),
    )


def own_columns(
    forms: Sequence[WeakForm], sides: Sequence[Sides], states: Sequence[FloatArray], coefficients: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the regressors of the model's own terms, shape (2 K, p), and the residuals, shape (2 K,), not whitened."""
    rows = np.concatenate(
        [weak.regressors(side).reshape(-1, coefficients.size) for weak, side in zip(forms, sides, strict=True)]
    )
    target = [weak.target(side, state).ravel() for weak, side, state in zip(forms, sides, states, strict=True)]
    return rows, np.concatenate(target) - rows @ coefficients


def stacked(forms: Sequence[WeakForm], signals: Signals) -> FloatArray:
    """Return the integrals of signals, first all in dα/dt, then all in dq/dt, shape (2 K, 2 · signals)."""
    columns = []
    for weak, signal in zip(forms, signals, strict=True):
        integrals = np.stack([weak.integral(column, weak.bump.value) for column in signal.T], axis=1)
        rows = np.zeros((integrals.shape[0], 2, 2 * integrals.shape[1]))
        rows[:, 0, : integrals.shape[1]] = integrals
        rows[:, 1, integrals.shape[1] :] = integrals
        columns.append(rows.reshape(-1, rows.shape[2]))
    return np.concatenate(columns)
