"""Values and derivatives of a planar field at a point, in plain numbers, for curves through states and parameter."""

from __future__ import annotations

import sys
from typing import Final, final

from finback.dynamics.planar.system import PlanarSystem
from finback.errors import RefusedError

Point = tuple[float, float, float]
"""First state, second state, parameter, each in its unit of the jet."""

_Terms = tuple[tuple[float, int, int, int], ...]
_ROUNDINGS: Final = 16.0 * sys.float_info.epsilon
"""Of a sum of products: powers, coefficient, scaling and summation of some ten terms."""


@final
class PlanarJet:
    """Both rates, scaled so that trace and determinant of the Jacobian stay what they are.

    In units w₁, w₂ of the states the rates are P/w₁ and Q/w₂, so the Jacobian is similar to the one in SI.

    Args:
        system: the field.
        units: of first state, second state and parameter; > 0.
    """

    def __init__(self, system: PlanarSystem, units: Point) -> None:
        self.system = system
        self.units = units
        self._terms: dict[tuple[int, int, int, int], _Terms] = {}
        for row, (curve, unit) in enumerate(zip((system.first, system.second), units[:2], strict=True)):
            scaled = []
            rows = zip(curve.polynomial.coefficients.tolist(), curve.polynomial.powers.tolist(), strict=True)
            for c, (i, j, k) in rows:
                value = c * units[0] ** i * units[1] ** j * units[2] ** k / unit
                if not abs(value) < sys.float_info.max:
                    raise RefusedError("the coefficients of the field are too large for double precision")
                scaled.append((value, i, j, k))
            self._terms[row, 0, 0, 0] = tuple(scaled)
        orders = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
        self._eight = tuple(self._derived(row, *order) for row in (0, 1) for order in orders)
        self._degrees = [max((term[1:][k] for terms in self._eight for term in terms), default=0) for k in range(3)]

    def _derived(self, row: int, i: int, j: int, k: int) -> _Terms:
        key = (row, i, j, k)
        if key not in self._terms:
            lower = (i - 1, j, k) if i else (i, j - 1, k) if j else (i, j, k - 1)
            by = 0 if i else 1 if j else 2
            terms = []
            for term in self._derived(row, *lower):
                powers = list(term[1:])
                if powers[by]:
                    factor = powers[by]
                    powers[by] -= 1
                    terms.append((term[0] * factor, *powers))
            self._terms[key] = tuple((c, int(p), int(q), int(r)) for c, p, q, r in terms)
        return self._terms[key]

    def derivative(self, row: int, order: tuple[int, int, int], at: Point) -> float:
        """Return a partial derivative of rate ``row``; ``order`` counts first state, second state, parameter."""
        x, y, m = at
        return sum(c * x**i * y**j * m**k for c, i, j, k in self._derived(row, *order))

    def noise(self, row: int, order: tuple[int, int, int], at: Point) -> float:
        """Bound the rounding of ``derivative``."""
        x, y, m = (abs(v) for v in at)
        return _ROUNDINGS * sum(abs(c) * x**i * y**j * m**k for c, i, j, k in self._derived(row, *order))

    def first(self, at: Point) -> tuple[Point, Point, tuple[float, float]]:
        """Return the gradients of both rates by states and parameter, and the rates."""
        powers = []
        for value, degree in zip(at, self._degrees, strict=True):
            row = [1.0]
            for _ in range(degree):
                row.append(row[-1] * value)
            powers.append(row)
        xs, ys, ms = powers
        p, px, py, pm, q, qx, qy, qm = (
            sum([c * xs[i] * ys[j] * ms[k] for c, i, j, k in terms]) for terms in self._eight
        )
        return (px, py, pm), (qx, qy, qm), (p, q)

    def trace_gradient(self, at: Point) -> Point:
        """Return the derivative of the trace by states and parameter."""
        x, y, m = (
            self.derivative(0, _plus((1, 0, 0), k), at) + self.derivative(1, _plus((0, 1, 0), k), at) for k in range(3)
        )
        return x, y, m

    def determinant_gradient(self, at: Point) -> Point:
        """Return the derivative of the determinant by states and parameter."""
        (p, q, _), (r, s, _), _ = self.first(at)
        rows = []
        for k in range(3):
            dp, dq, dr, ds = (
                self.derivative(row, _plus(order, k), at) for row in (0, 1) for order in ((1, 0, 0), (0, 1, 0))
            )
            rows.append(dp * s + p * ds - dq * r - q * dr)
        return rows[0], rows[1], rows[2]

    def trace_noise(self, at: Point) -> float:
        """Bound the rounding of the trace."""
        return self.noise(0, (1, 0, 0), at) + self.noise(1, (0, 1, 0), at)

    def determinant_noise(self, at: Point) -> float:
        """Bound the rounding of the determinant."""
        (p, q, _), (r, s, _), _ = self.first(at)
        dp, dq, dr, ds = (self.noise(row, order, at) for row in (0, 1) for order in ((1, 0, 0), (0, 1, 0)))
        size = abs(p) * ds + abs(s) * dp + abs(q) * dr + abs(r) * dq
        return size + _ROUNDINGS * (abs(p * s) + abs(q * r))

    def to_si(self, at: Point) -> Point:
        """Return a point in the units of the system."""
        return at[0] * self.units[0], at[1] * self.units[1], at[2] * self.units[2]


def _plus(order: tuple[int, int, int], by: int) -> tuple[int, int, int]:
    i, j, k = order
    return (i + 1, j, k) if by == 0 else (i, j + 1, k) if by == 1 else (i, j, k + 1)
