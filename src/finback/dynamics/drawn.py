"""Models drawn from the errors of a model's coefficients: the same ones in whatever order its terms stand."""

from __future__ import annotations

import math

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.dynamics.model import PolynomialModel
from finback.errors import InputError


def drawn_coefficients(model: PolynomialModel, count: int, *, seed: int) -> FloatArray:
    """Draw coefficients from the normal distribution that a model's covariance says, in SI.

    The draws fill that distribution evenly (Sobol points, scrambled by Owen's method): 512 of them tell a quantile of
    what is computed from them as well as some 2000 independent ones. Each coefficient has its own numbers, by its place
    among the names of all terms and not by its place in the model; so another order of terms or inputs draws the same
    models, and so does a term that is known exactly.

    Args:
        model: with its covariance.
        count: how many, >= 1.
        seed: of the draws.

    Returns:
        One row a draw, in the order of ``PolynomialModel.coefficients``, shape (count, n).

    Raises:
        InputError: no draws are asked for.
    """
    if count < 1:
        raise InputError(f"{count} models cannot be drawn", hint="ask for one or more")
    scale = np.sqrt(np.diag(model.covariance))
    places = _by_name(model)
    places = places[scale[places] > 0.0]
    rows = np.tile(model.coefficients, (count, 1))
    if places.size:
        root = covariance_root(model.covariance[np.ix_(places, places)])
        rows[:, places] += _normal(count, places.size, seed) @ root.T
    return rows


def covariance_root(covariance: FloatArray) -> FloatArray:
    """Return R with R Rᵀ = covariance, shape (n, n): its columns are directions of one standard deviation.

    Coefficients differ by orders of magnitude: the root is taken of their correlations. The symmetric one is the only
    one that does not depend on how eigenvectors are chosen. What is known exactly has a row and a column of zeros.
    """
    scale = np.sqrt(np.diag(covariance))
    kept = np.flatnonzero(scale > 0.0)
    values, vectors = np.linalg.eigh(covariance[np.ix_(kept, kept)] / np.outer(scale[kept], scale[kept]))
    root = np.zeros_like(covariance)
    symmetric = vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
    root[np.ix_(kept, kept)] = scale[kept, np.newaxis] * symmetric
    return root


def _by_name(model: PolynomialModel) -> IntArray:
    """Return the places of all coefficients in the order of their names, shape (n,)."""
    names = [
        (rate, sorted((name, power) for name, power in zip(polynomial.variables, powers, strict=True) if power))
        for rate, polynomial in enumerate((model.alpha_dot, model.q_dot))
        for powers in polynomial.powers.tolist()
    ]
    return np.array(sorted(range(len(names)), key=names.__getitem__), dtype=np.int64)


def _normal(count: int, columns: int, seed: int) -> FloatArray:
    """Return evenly spread normal numbers, shape (count, columns)."""
    from scipy.special import ndtri  # noqa: PLC0415 - with the next
    from scipy.stats import qmc  # noqa: PLC0415 - half a second, which whoever draws nothing need not pay

    uniform = qmc.Sobol(columns, seed=seed).random_base2(math.ceil(math.log2(count)))[:count]
    smallest = np.finfo(np.float64).eps
    normal: FloatArray = ndtri(np.clip(uniform, smallest, 1.0 - smallest))
    return normal
