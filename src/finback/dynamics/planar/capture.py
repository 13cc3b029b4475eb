"""A neighborhood of a sink of a planar field from which no orbit escapes, by a quadratic Lyapunov function."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.planar.field import PlanarField, shifted_table

_ANGLES: Final = 192
_SHRINK: Final = 0.8
_SHRINKINGS: Final = 60


def planar_captures(field: PlanarField, points: Sequence[tuple[float, float]], *, forward: bool) -> FloatArray:
    """Return a row of ``planar_capture`` for each of some points that attract forward (or backward): shape (n, 5)."""
    return np.array([planar_capture(field, point, forward=forward) for point in points]).reshape(-1, 5)


def planar_capture(field: PlanarField, point: tuple[float, float], *, forward: bool) -> FloatArray:
    """Return an ellipse around a sink inside which a quadratic function falls along every orbit.

    P solves A'P + PA = −I for the linearization A. On the ellipse of size r the rate of the function over r² is
    Σ r^(k−1) h_k(φ), h_k a trigonometric polynomial of degree k + 1 made of the terms of degree k; each is bounded by
    its values at 192 angles and Bernstein's inequality in between, and r is as large as the bounds allow.

    Args:
        field: the field.
        point: the sink, or with ``forward`` false the source.
        forward: whether it attracts forward in time.

    Returns:
        (x, y, a, b, c): the ellipse a u² + 2 b u v + c v² < 1 around (x, y), shape (5,).
    """
    sign = 1.0 if forward else -1.0
    first, second = (sign * shifted_table(table, *point) for table in (field.flow.first, field.flow.second))
    # Tables of a field without x or without y in it lack a column that the linearization needs.
    first, second = (np.pad(table, [(0, max(0, 2 - size)) for size in table.shape]) for table in (first, second))
    a, b, c, d = first[1, 0], first[0, 1], second[1, 0], second[0, 1]
    system = np.array([[2.0 * a, 2.0 * c, 0.0], [b, a + d, c], [0.0, 2.0 * b, 2.0 * d]])
    p11, p12, p22 = np.linalg.solve(system, [-1.0, 0.0, -1.0])
    matrix = np.array([[p11, p12], [p12, p22]])
    angles = 2.0 * math.pi * np.arange(_ANGLES) / _ANGLES
    u, v = np.linalg.solve(np.linalg.cholesky(matrix).T, np.array([np.cos(angles), np.sin(angles)]))
    slopes = 2.0 * matrix @ np.array([u, v])
    rates = np.zeros((sum(first.shape) - 1, _ANGLES))
    for i, j in np.argwhere((first != 0.0) | (second != 0.0)).tolist():
        if i + j:
            rates[i + j] += u**i * v**j * (slopes[0] * first[i, j] + slopes[1] * second[i, j])
    degree = np.arange(len(rates))[:, np.newaxis] + 1.0
    # Between two of the angles a trigonometric polynomial exceeds its neighbors by at most (n Δφ)²/8 of its maximum.
    slack = (degree * (angles[1] - angles[0])) ** 2 / 8.0
    bounds = rates + slack / (1.0 - slack) * np.abs(rates).max(axis=1, keepdims=True)
    # From where the longer half axis is 1 downward, the first that the bounds allow.
    radii = math.sqrt(np.linalg.eigvalsh(matrix)[0]) * _SHRINK ** np.arange(_SHRINKINGS)
    powers = radii[:, np.newaxis] ** np.arange(1, max(2, len(rates) - 1))
    worst = (bounds[1] + powers[:, : len(rates) - 2] @ np.maximum(bounds[2:], 0.0)).max(axis=1)
    radius = radii[int(np.argmax(worst < 0.0))] if (worst < 0.0).any() else 0.0
    with np.errstate(divide="ignore"):  # none is an ellipse without inside
        return np.array([*point, *(np.array([p11, p12, p22]) / radius**2)])
