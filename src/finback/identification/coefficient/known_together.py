"""Which numbers of a form the data know only together, judged by the covariance that noise as it is gives them.

Condition indices and variance-decomposition proportions of Belsley, Kuh and Welsch (1980), chapter 3, of the equations
whitened by that covariance, columns scaled to length 1.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.lienard import NORMAL_95
from finback.errors import RefusedError
from finback.identification.coefficient.form import ALPHA_RATE, CoefficientForm
from finback.identification.collinearity import APART
from finback.identification.gate import HALF, STRONG

_EXACT: Final = 1e-12
"""Share of the largest variance along any direction below which one is rounding."""
_HINT: Final = (
    "leave one of them out, give them one number as in 'pitch_rate+alpha_rate', fix what is known, or fly what moves "
    "them apart"
)


def known_together(form: CoefficientForm, numbers: FloatArray, covariance: FloatArray) -> tuple[str, ...]:
    """Say which numbers are known only together; refuse where what is printed of them would be of no use.

    They are known only together if a near dependency has an index above 30 and more than half of the variance of two or
    more numbers of which none is told from zero (95 %). Their errors say so, too, and a polynomial's terms may well do
    without being told apart; but not damping and the lag of the downwash, which mean something by themselves.

    Args:
        form: the terms.
        numbers: as found, shape (p,).
        covariance: of them, shape (p, p); zero where a number is known or at its bound.

    Raises:
        RefusedError: such numbers could add and cancel more than everything that the terms explain; or dα/dt is among
            them.
    """
    errors = np.sqrt(np.diag(covariance))
    free = np.flatnonzero(errors > 0.0)
    if free.size < 2:
        return ()
    labels = np.array(form.labels())[free]
    scaled = covariance[np.ix_(free, free)] / np.outer(errors[free], errors[free])
    values = numbers[free] / errors[free]
    # What is known all but exactly makes the covariance singular; that is no dependency among the numbers.
    spread, axes = np.linalg.eigh(scaled)
    root = (axes / np.sqrt(np.maximum(spread, _EXACT * spread[-1]))).T
    lengths = np.sqrt((root**2).sum(axis=0))
    _, singular, right = np.linalg.svd(root / lengths)
    shares = (right / singular[:, np.newaxis]) ** 2
    proportions = shares / shares.sum(axis=0)
    explained = float(np.linalg.norm(root @ values))
    lags = np.array([ALPHA_RATE in form.terms[i][1].variables for i in free])
    said = []
    for index, one, share in zip(singular[0] / singular, singular, proportions, strict=True):
        group = share > HALF
        if index <= STRONG or group.sum() < 2 or (np.abs(values[group]) >= NORMAL_95).any():
            continue
        names = " with ".join(labels[group].tolist())
        if 1.0 / one > explained or lags[group].any():
            raise RefusedError(f"{APART}, within the noise: {names} (condition index {index:.3g})", hint=_HINT)
        said.append(f"{names} (condition index {index:.3g})")
    return (f"known only together, none told from zero: {'; '.join(said)}",) if said else ()
