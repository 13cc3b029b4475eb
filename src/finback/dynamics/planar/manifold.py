"""Stable and unstable manifolds of a saddle of a planar field by their power series (the parametrization method).

Both coordinates are series of one parameter s, on which the field acts as s' = λ s (Cabré, Fontich & de la Llave, "The
parameterization method for invariant manifolds III", J. Differential Equations 218, 2005). No coordinate is singled
out, so the manifold may turn wherever it likes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.planar.field import PlanarField, shifted_table
from finback.errors import RefusedError

ORDER: Final = 30
_SMALL: Final = 1e-17  # of the last terms of the series, relative to the first
_RESIDUAL: Final = 1e-14  # of the invariance equation, relative to its terms
_LONGEST: Final = 0.5  # half-widths of the box: a straight manifold ends somewhere
_SHRINK: Final = 0.8
_TRIES: Final = 40
_ENDS: Final = np.array([-1.0, -0.5, 0.5, 1.0])


@final
@dataclass(frozen=True, slots=True, eq=False)
class PlanarManifold:
    """A stable or unstable manifold: (x, y) = Σ series[k] sᵏ for |s| <= radius.

    Attributes:
        saddle: where.
        eigenvalue: λ, positive for the unstable manifold.
        other_eigenvalue: the saddle's other one.
        series: shape (ORDER + 1, 2); row 0 is the saddle, row 1 an eigenvector of length 1.
        radius: where the series is as exact as double precision.
    """

    saddle: tuple[float, float]
    eigenvalue: float
    other_eigenvalue: float
    series: FloatArray
    radius: float

    @property
    def stable(self) -> bool:
        """Whether it is the stable manifold."""
        return self.eigenvalue < 0.0

    def at(self, s: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        """Return x and y."""
        x, y = np.polynomial.polynomial.polyval(s, self.series)
        return x, y


@final
@dataclass(frozen=True, slots=True, eq=False)
class SaddleFrame:
    """A saddle with its linearization.

    Attributes:
        local: the field with the saddle at the origin.
        saddle: where it is.
        eigenvalues: the positive one first.
        eigenvectors: of length 1, shape (2, 2), row k for eigenvalue k; their signs tell the sides of the manifolds.
    """

    local: PlanarField
    saddle: tuple[float, float]
    eigenvalues: tuple[float, float]
    eigenvectors: FloatArray


def saddle_frame(field: PlanarField, saddle: tuple[float, float], like: FloatArray) -> SaddleFrame:
    """Linearize a field at a saddle.

    Args:
        field: the field.
        saddle: where.
        like: two vectors, shape (2, 2): the eigenvectors are directed so that their products with these are positive.

    Raises:
        RefusedError: the eigenvalues are not real and of opposite signs beyond rounding.
    """
    first, second = (shifted_table(table, *saddle) for table in (field.flow.first, field.flow.second))
    first[0, 0] = second[0, 0] = 0.0
    local = PlanarField.of(replace(field.flow, first=first, second=second))
    (p, q), (r, s) = local.jacobian(0.0, 0.0).tolist()
    trace, determinant = p + s, p * s - q * r
    if not determinant < 0.0:
        raise RefusedError("near a fold the saddle cannot be told from a node in double precision")
    far = 0.5 * trace + math.copysign(math.sqrt(0.25 * trace * trace - determinant), trace)
    values = sorted((far, determinant / far), reverse=True)
    vectors = []
    for value, guide in zip(values, like, strict=True):
        # The rows of J − λ are parallel; the larger one is known better.
        row = max((p - value, q), (r, s - value), key=lambda pair: math.hypot(*pair))
        vector = np.array([-row[1], row[0]]) / math.hypot(*row)
        vectors.append(vector if vector @ guide >= 0.0 else -vector)
    return SaddleFrame(local, saddle, (values[0], values[1]), np.array(vectors))


def planar_manifold(frame: SaddleFrame, *, stable: bool) -> PlanarManifold:
    """Expand a manifold: f(z(s)) = λ s z'(s), coefficient by coefficient.

    That of power k solves (k λ − J) z_k = (what lower powers make); k λ is no eigenvalue, as they have opposite signs.
    The radius follows from the decay of the coefficients, and is reduced until the equation holds to rounding.

    Raises:
        RefusedError: no radius was found.
    """
    index = 1 if stable else 0
    value, other = frame.eigenvalues[index], frame.eigenvalues[1 - index]
    field = frame.local
    factors = field.factors.tolist()
    nonlinear = field.weights[:2, 3:]
    (p, q), (r, s) = field.jacobian(0.0, 0.0).tolist()
    table = np.zeros((len(factors) + 2, ORDER + 1))
    table[:2, 1] = frame.eigenvectors[index]
    for k in range(2, ORDER + 1):
        for m, (one, two) in enumerate(factors):
            table[m + 2, k] = table[one, 1:k] @ table[two, k - 1 : 0 : -1]
        u, v = (nonlinear @ table[2:, k]).tolist()
        a, d = k * value - p, k * value - s
        determinant = a * d - q * r
        table[0, k], table[1, k] = (d * u + q * v) / determinant, (r * u + a * v) / determinant
    series = table[:2].T.copy()
    radius = _radius(field, series, value)
    series[0] = frame.saddle
    return PlanarManifold(frame.saddle, value, other, series, radius)


def _radius(field: PlanarField, series: FloatArray, value: float) -> float:
    sizes = np.abs(series[ORDER - 3 :]).max(axis=1)
    powers = np.arange(ORDER - 3, ORDER + 1)[sizes > 0.0]
    spans = (_SMALL / sizes[sizes > 0.0]) ** (1.0 / (powers - 1))
    radius = float(min([*spans, _LONGEST]))
    slopes = series * np.arange(ORDER + 1)[:, np.newaxis]
    for _ in range(_TRIES):
        powers = (radius * _ENDS)[:, np.newaxis] ** np.arange(ORDER + 1)
        x, y = (powers @ series).T
        rates = np.array(field.velocity(x, y))
        moved = value * (powers @ slopes).T
        if (np.abs(rates - moved).max(axis=0) <= _RESIDUAL * (np.abs(rates) + np.abs(moved)).max(axis=0)).all():
            return radius
        radius *= _SHRINK
    raise RefusedError("the series of a manifold does not converge in double precision")
