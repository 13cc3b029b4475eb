"""Displacements carried along an orbit of a planar field, however strongly it attracts.

The wedge D of the velocity and a displacement obeys D' = (div f) D + source (``wedge``). It is solved by collocation at
20 Radau points of each piece of the orbit, which stays exact to rounding where D decays a thousand times within one.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.special import roots_jacobi

from finback.arrays import FloatArray
from finback.dynamics.planar.kernel import ORDER
from finback.dynamics.planar.orbit import PlanarOrbit

COUNT: Final = 20
_INNER: Final = roots_jacobi(COUNT - 1, 1.0, 0.0)[0]
PLACES: Final = np.concatenate([_INNER, [1.0]])
"""Radau points between -1 and 1, the end included, on each piece."""
TO_LEGENDRE: Final = np.linalg.inv(np.polynomial.legendre.legvander(PLACES, COUNT - 1))
_SHARES: Final = 0.5 * (PLACES + 1.0)
_PRIMITIVES: Final = np.array([np.polynomial.legendre.legint(row, lbnd=-1) for row in np.eye(COUNT)])
_INTEGRATION: Final = 0.5 * np.polynomial.legendre.legval(PLACES, _PRIMITIVES.T).T @ TO_LEGENDRE
_WEIGHTS: Final = _INTEGRATION[-1]
_POWERS: Final = np.vander(_SHARES, ORDER + 1, increasing=True)


def radau_nodes(orbit: PlanarOrbit) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return weight (dt), x, y and the divergence at 20 Radau points of each piece, each of shape (n, 20)."""
    scaled = orbit.series * (orbit.spans[:, np.newaxis] ** np.arange(ORDER + 1))[:, np.newaxis]
    x, y, divergence = (scaled @ _POWERS.T).transpose(1, 0, 2)
    return orbit.spans[:, np.newaxis] * _WEIGHTS, x, y, divergence


def carried(
    spans: FloatArray, divergence: FloatArray, source: FloatArray, first: FloatArray, closing: float | None = None
) -> FloatArray:
    """Solve D' = (div f) D + source along an orbit.

    Args:
        spans: of the pieces, shape (n,).
        divergence: at the nodes, shape (n, 20).
        source: at the nodes, shape (n, 20, k).
        first: D at the beginning, shape (k,).
        closing: ∫ div dt once around: D is then the periodic solution, and ``first`` is not used.

    Returns:
        D at the nodes, shape (n, 20, k); the last node is the end.
    """
    reach = spans[:, np.newaxis, np.newaxis] * _INTEGRATION
    matrix = np.eye(COUNT) - reach * divergence[:, np.newaxis]
    right = np.concatenate([np.ones((*source.shape[:2], 1)), reach @ source], axis=2)
    solved = np.linalg.solve(matrix, right)
    kept, made = solved[..., 0], solved[..., 1:]

    def values(begin: FloatArray) -> FloatArray:
        before = np.empty((len(spans), source.shape[2]))
        for k in range(len(spans)):
            before[k] = begin
            begin = kept[k, -1] * begin + made[k, -1]
        return np.asarray(kept[..., np.newaxis] * before[:, np.newaxis] + made)

    if closing is None:
        return values(first)
    return values(values(np.zeros_like(first))[-1, -1] / -np.expm1(closing))
