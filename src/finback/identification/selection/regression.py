"""All candidates as one whitened linear regression, reduced to its triangular factor: what every search works on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, IntArray, frozen_array


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Regression:
    """Rows target = regressors · coefficients + noise of variance 1, seen through their triangular factor.

    Attributes:
        factor: shape (m, p): its Gram matrix is that of the regressors, columns scaled to length 1.
        target: shape (m,): the target in the same coordinates.
        scale: lengths of the columns, shape (p,); 0 where a column is zero.
        rest: sum of squares of the target outside the space of all columns.
        rows: number of equations.
    """

    factor: FloatArray
    target: FloatArray
    scale: FloatArray
    rest: float
    rows: int

    @classmethod
    def of(cls, regressors: FloatArray, target: FloatArray) -> Regression:
        """Reduce whitened equations, shape (n, p) and (n,)."""
        scale = np.sqrt((regressors**2).sum(axis=0))
        safe = np.where(scale > 0, scale, 1.0)
        upper: FloatArray = np.linalg.qr(np.column_stack([regressors / safe, target])).R
        size = min(upper.shape[0], regressors.shape[1])
        return cls(
            factor=frozen_array(upper[:size, :-1]),
            target=frozen_array(upper[:size, -1]),
            scale=frozen_array(scale),
            rest=float((upper[size:, -1] ** 2).sum()),
            rows=target.size,
        )

    def misfit(self, chosen: IntArray) -> float:
        """Return the sum of squares that a subset of the columns leaves."""
        return self.basis(chosen)[2]

    def basis(self, chosen: IntArray) -> tuple[FloatArray, FloatArray, float]:
        """Return an orthonormal basis of a subset, shape (m, k), the residual, shape (m,), and its sum of squares."""
        q = np.linalg.qr(self.factor[:, chosen])[0]
        residual = self.target - q @ (q.T @ self.target)
        return q, residual, float(residual @ residual) + self.rest

    def gains(self, chosen: IntArray) -> tuple[FloatArray, float]:
        """Return by how much each column would lower the sum of squares of a subset, shape (p,), and that sum.

        A column that the subset explains to 1e-5 of its length gains nothing: it says nothing new.
        """
        q, residual, misfit = self.basis(chosen)
        beyond = self.factor - q @ (q.T @ self.factor)
        lengths = (beyond**2).sum(axis=0)
        new = lengths > 1e-10
        gains = np.zeros(lengths.size)
        gains[new] = (beyond[:, new].T @ residual) ** 2 / lengths[new]
        gains[chosen] = 0.0
        return gains, misfit

    def losses(self, chosen: IntArray) -> FloatArray:
        """Return by how much the sum of squares would rise without each column of a subset, shape (k,)."""
        q, r = np.linalg.qr(self.factor[:, chosen])
        inverse = np.linalg.solve(r, np.eye(chosen.size))
        losses: FloatArray = (inverse @ (q.T @ self.target)) ** 2 / (inverse**2).sum(axis=1)
        return losses

    def solution(self, chosen: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return coefficients and covariance (for noise of variance 1) of a subset, unscaled."""
        q, r = np.linalg.qr(self.factor[:, chosen])
        inverse = np.linalg.solve(r, np.eye(chosen.size)) / self.scale[chosen][:, np.newaxis]
        return inverse @ (q.T @ self.target), inverse @ inverse.T
