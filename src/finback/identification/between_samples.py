"""What an elevator that is said to go straight between samples would do to the coefficients if it went in curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.identification.model_form import ModelForm
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch, chord_shift
from finback.identification.weak_form import weak_form
from finback.identification.whitening import whitening
from finback.records import Hold

_TOLD: Final = 0.4
"""Of a standard error: an interval of 95 % that is beside the truth by so much holds it in 93 %."""
_DECIDED: Final = 6.6
"""Difference of sums of squares, in noise variances, from which the data tell lines from curves: a chance of 1 %."""


def said_of_chords(
    used: Sequence[Stretch],
    options: IdentificationOptions,
    *,
    coefficients: FloatArray,
    states: Sequence[FloatArray],
    noise: FloatArray,
) -> tuple[str, ...]:
    """Say which coefficient would differ if the elevator's samples were those of a curve, as an actuator's are.

    Lines and curves differ by interval²/12 of the second derivative. What that would add to the weak equations is a
    signal like any other: the model's own terms explain most of it, which moves them, and the rest tells which is true.

    Args:
        used: the data of the fit.
        options: of the fit: form and test functions.
        coefficients: of the fitted model, in SI, shape (p,).
        states: smoothed (alpha, q) of each stretch, shape (n, 2).
        noise: standard deviations of alpha in rad and q in rad/s, shape (2,).

    Returns:
        A sentence where some coefficient would move by more than 0.4 standard errors, and the data do not speak for
        lines; else nothing.
    """
    if any(piece.hold is not Hold.FOH for piece in used):
        return ()
    form = options.model_form
    whitened = _equations(used, form, options, coefficients, states, noise)
    own, signal, residual = whitened[:, form.free], whitened[:, -2], whitened[:, -1]
    scale = np.maximum(np.linalg.norm(own, axis=0), np.finfo(np.float64).tiny)
    basis, upper = np.linalg.qr(own / scale)
    inverse = np.linalg.inv(upper)
    left = residual - basis @ (basis.T @ residual)
    size = max(1.0, float(left @ left) / max(1, left.size - form.free.size))
    moved = (inverse @ (basis.T @ signal)) / np.sqrt(size * (inverse**2).sum(axis=1))
    most = int(np.argmax(np.abs(moved)))
    rest = signal - basis @ (basis.T @ signal)
    # Squares that curves leave, less those that lines leave.
    for_lines = (float((left - rest) @ (left - rest)) - float(left @ left)) / size
    if abs(moved[most]) < _TOLD or for_lines > _DECIDED:
        return ()
    preferred = ", and these data speak for that" if for_lines < -_DECIDED else ""
    said = (
        f"the elevator is said to go straight between samples ({used[0].interval_s:.3g} s); if it is the position of "
        f"an actuator it goes in curves{preferred}: {form.labels()[int(form.free[most])]} would differ by "
        f'{abs(moved[most]):.2g} standard errors: give hold = "actuator"'
    )
    return (said,)


def _equations(
    used: Sequence[Stretch],
    form: ModelForm,
    options: IdentificationOptions,
    coefficients: FloatArray,
    states: Sequence[FloatArray],
    noise: FloatArray,
) -> FloatArray:
    """Return whitened columns, shape (2 K, p + 2): the model's terms, what curves add, the residuals."""
    forms = [weak_form(piece, form, options) for piece in used]
    sides = [weak.sides(coefficients, state) for weak, state in zip(forms, states, strict=True)]
    rows = []
    for weak, side, state in zip(forms, sides, states, strict=True):
        more = side.mean.elevator * chord_shift(weak.stretch.elevator_rad)[:, np.newaxis]
        added = np.stack([weak.integral(more[:, i], weak.bump.value) for i in range(2)], axis=1)
        own = weak.regressors(side)
        left = weak.target(side, state) - own @ coefficients
        rows.append(np.concatenate([own, added[:, :, np.newaxis], left[:, :, np.newaxis]], axis=2))
    stacked = np.concatenate([part.reshape(-1, part.shape[2]) for part in rows])
    white: FloatArray = whitening(forms, sides, noise)(stacked)
    return white
