"""Least squares for the coefficients of a form, some of them known or bounded."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy.optimize import lsq_linear

from finback.arrays import FloatArray, IntArray
from finback.identification.collinearity import Solution, solve


class Coefficients(Protocol):
    """What a form says of its coefficients."""

    @property
    def size(self) -> int:
        """Number of all coefficients p."""

    @property
    def free(self) -> IntArray:
        """Indices of those that are fitted, bounded ones included."""

    @property
    def bounds(self) -> FloatArray:
        """Low and high of each, infinite where nothing is said, shape (p, 2)."""

    def labels(self) -> tuple[str, ...]:
        """Return a readable name for each."""


def solve_within(  # noqa: PLR0913 - equations, what is known of their unknowns, and how they are judged
    regressors: FloatArray,
    target: FloatArray,
    form: Coefficients,
    coefficients: FloatArray,
    columns: IntArray,
    *,
    judged: bool,
    folded: int = 0,
) -> Solution:
    """Solve whitened equations for some coefficients of a form.

    A coefficient that would leave its bounds stands at the bound; there it counts as known, so its variance is zero.

    Args:
        regressors: one column for each coefficient of the form, shape (n, p).
        target: shape (n,), with noise of variance 1.
        form: says which coefficients are known or bounded.
        coefficients: values of those that are not solved for, shape (p,).
        columns: indices of the coefficients to solve for; known ones among them keep their value.
        judged: as for ``solve``.
        folded: as for ``solve``.

    Returns:
        The solution, with all p coefficients; zero covariance for those not solved for.

    Raises:
        RefusedError: some combination of coefficients is not determined.
    """
    labels = np.array(form.labels())
    free = np.intersect1d(columns, form.free)
    values = coefficients.copy()
    rest = np.setdiff1d(np.arange(form.size), free)
    remaining = target - regressors[:, rest] @ values[rest]
    found = solve(regressors[:, free], remaining, tuple(labels[free].tolist()), judged=judged, folded=folded)
    low, high = form.bounds[free].T
    if ((found.coefficients < low) | (found.coefficients > high)).any():
        scale = np.sqrt((regressors[:, free] ** 2).sum(axis=0))
        upper = np.linalg.qr(np.column_stack([regressors[:, free] / scale, remaining])).R
        inside = lsq_linear(upper[:, :-1], upper[:, -1], bounds=(low * scale, high * scale), method="bvls")
        stuck = inside.active_mask != 0
        values[free] = np.where(inside.active_mask < 0, low, np.where(inside.active_mask > 0, high, 0.0))
        remaining = remaining - regressors[:, free[stuck]] @ values[free[stuck]]
        free = free[~stuck]
        found = solve(regressors[:, free], remaining, tuple(labels[free].tolist()), judged=judged, folded=folded)
    values[free] = found.coefficients
    covariance = np.zeros((form.size, form.size))
    covariance[np.ix_(free, free)] = found.covariance
    return replace(found, coefficients=values, covariance=covariance)
