"""The Picard-Fuchs equations of the elliptic Hamiltonian of degree four: how I1/I0 and I2/I0 change with the level.

Shi & Fan 2013, Eq. 31, with the minus signs of a01, a02 and a20 that its print lacks (without them the equations fail
by their own size). They hold on every family of closed level curves, whatever the signs of a, b, c: a road to the
integrals that evaluates none of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.first_order.abelian import Ring
from finback.errors import RefusedError


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PicardFuchs:
    """For H = y²/2 + a u⁴/4 + b u³/3 + c u²/2, I_k = ∮ u^k y du: G(s) d(I0, I1, I2)/ds = A(s) (I0, I1, I2).

    Attributes:
        a: quartic coefficient.
        b: cubic coefficient.
        c: quadratic coefficient.
    """

    a: float
    b: float
    c: float

    @classmethod
    def on(cls, ring: Ring) -> PicardFuchs:
        """Return the equations of a ring; its levels and integrals are about its origin."""
        return cls(a=ring.quartic, b=ring.cubic, c=ring.quadratic)

    def matrix(self, s: float) -> FloatArray:
        """Return the coefficient functions a_ij(s), shape (3, 3)."""
        a, b, c = self.a, self.b, self.c
        d = 2.0 * b * b - 9.0 * a * c
        a00 = 12.0 * (108.0 * a**3 * s * s + (10.0 * b**4 - 61.0 * a * b * b * c + 63.0 * a * a * c * c) * s - c**3 * d)
        a01 = -2.0 * b * (12.0 * a * (b * b + 3.0 * a * c) * s + 7.0 * c * c * d)
        a02 = -15.0 * a * (12.0 * a * (b * b - 3.0 * a * c) * s + c * c * d)
        a10 = 12.0 * b * (12.0 * a * a * s + c * d) * s
        a11 = 24.0 * (72.0 * a**3 * s + 7.0 * b**4 - 34.0 * a * b * b * c + 18.0 * a * a * c * c) * s
        a12 = 180.0 * a * b * (b * b - 4.0 * a * c) * s
        a20 = -12.0 * (12.0 * a * (b * b - 3.0 * a * c) * s + c * c * d) * s
        a21 = 24.0 * b * (12.0 * a * a * s - c * (7.0 * b * b - 27.0 * a * c)) * s
        a22 = 180.0 * a * (12.0 * a * a * s - c * (b * b - 3.0 * a * c)) * s
        return frozen_array([[a00, a01, a02], [a10, a11, a12], [a20, a21, a22]])

    def discriminant(self, s: float) -> float:
        """Return G(s), which vanishes at the levels of all equilibria.

        Also at that of one outside the curve (the bottom of the other well): the integrals pass it smoothly, but the
        equations cannot be integrated across it.
        """
        a, b, c = self.a, self.b, self.c
        d = 2.0 * b * b - 9.0 * a * c
        quadratic = 144.0 * a**3 * s * s + 12.0 * (b**4 - 6.0 * a * b * b * c + 6.0 * a * a * c * c) * s - c**3 * d
        return 12.0 * s * quadratic

    def numerators(self, s: float, P: float, Q: float) -> tuple[float, float]:
        """Return G P' and G Q' (the right sides of Eq. 31)."""
        rows = self.matrix(s) @ np.array([1.0, P, Q])
        return float(rows[1] - P * rows[0]), float(rows[2] - Q * rows[0])

    def slopes(self, s: float, P: float, Q: float) -> tuple[float, float]:
        """Return dP/ds and dQ/ds.

        Raises:
            RefusedError: s is the level of an equilibrium, where the equations are singular.
        """
        divisor = self.discriminant(s)
        if divisor == 0.0:
            raise RefusedError(f"the Picard-Fuchs equations are singular at the level {s} of an equilibrium")
        by_P, by_Q = self.numerators(s, P, Q)
        return by_P / divisor, by_Q / divisor

    def slopes_at_center(self) -> tuple[float, float]:
        """Return dP/ds and dQ/ds in the limit s → 0 at a center (c > 0), where both start at 0: −b/(2c²), 1/(2c)."""
        if self.c <= 0.0:
            raise RefusedError("the origin is no center: c must be positive")
        return -self.b / (2.0 * self.c * self.c), 1.0 / (2.0 * self.c)

    def tangency(self, s: float, P: float, Q: float, *, a1: float) -> float:
        """Return G (a1 P' − Q'), the left side of Eq. 33: zero where two cycles meet (a2 = −1)."""
        by_P, by_Q = self.numerators(s, P, Q)
        return a1 * by_P - by_Q
