"""The weak focus of a Liénard flow: how the amplitude grows or decays where the trace is zero.

With amplitude r of x, averaged over a turn, r' = a r³ + b r⁵ + …; a and b are the first and second Lyapunov
coefficients in the normalization of Guckenheimer & Holmes (1983, Eq. 3.4.11). With F = ∫f and ξ²/2 = −∫g, the time
stretched by −g/ξ, the flow is dξ/dτ = z + F(x(ξ)), dz/dτ = −ξ (Cherkas, Differential Equations 12, 1976), and the
first odd power of ξ in F decides, by the average of its power of a cosine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from finback.dynamics.flow import derivative, horner, shifted
from finback.errors import InputError

_DEPTH: Final = 6  # powers of ξ kept: the fifth is the last that is used


def lyapunov_coefficients(damping: Sequence[float], force: Sequence[float], x: float) -> tuple[float, float]:
    """Return a and b of an equilibrium, as if the trace were zero there.

    a = (f'' ω² + f' g'') / (16 ω²), exactly; b has its meaning only where a is zero (a Bautin point). Of any magnitude:
    what leaves the range of double precision is infinite, or nan.

    Args:
        damping: coefficients of f by rising power.
        force: coefficients of g by rising power; g'(x) < 0.
        x: the equilibrium.

    Raises:
        InputError: g'(x) is not negative.
    """
    f = [0.0, *shifted(damping, x)[1:], *(0.0,) * _DEPTH]
    g = [0.0, *shifted(force, x)[1:], *(0.0,) * _DEPTH]
    square = -horner(derivative(force), x)
    if not square > 0.0:
        raise InputError(f"the equilibrium x = {x} is no focus: g'(x) = {-square} is not negative")
    # ξ = ω u √(1 + s): the relative height of the potential over its parabola.
    relative = [0.0, *(-2.0 * (g[k + 1] / square) / (k + 2) for k in range(1, _DEPTH))]
    if not all(map(math.isfinite, relative)):
        return math.nan, math.nan
    # With u and ξ/ω counted in this length no coefficient of s exceeds 1, and no power of the series overflows.
    unit = min((abs(s) ** (-1.0 / k) for k, s in enumerate(relative) if abs(s) > 1.0), default=1.0)
    xi = [0.0, *_root_of_one_plus([s * unit**k for k, s in enumerate(relative)])]
    powers = _inverse_powers(xi)
    # The averages of cos⁴ and cos⁶ are 3/8 and 5/16; r counts x, ξ counts ω x, and τ counts ω t.
    return 3.0 / 8.0 * _odd(f, powers, unit, 3), 5.0 / 16.0 * _odd(f, powers, unit, 5)


def _odd(f: Sequence[float], powers: Sequence[Sequence[float]], unit: float, order: int) -> float:
    """Return what multiplies this power of ξ/ω in F = ∫f, from powers of u in units of a length."""
    total = 0.0
    for k in range(2, order + 1):
        term = f[k - 1] / k * powers[k][order]
        for _ in range(order - k):
            term /= unit  # a power of it may be no number
        total += term
    return total


def _product(one: Sequence[float], other: Sequence[float]) -> list[float]:
    return [sum(one[i] * other[k - i] for i in range(k + 1)) for k in range(_DEPTH)]


def _root_of_one_plus(series: Sequence[float]) -> list[float]:
    """Return √(1 + s) for a series s without a constant."""
    root = [1.0]
    for k in range(1, _DEPTH):
        root.append(0.5 * (series[k] - sum(root[i] * root[k - i] for i in range(1, k))))
    return root


def _inverse_powers(xi: Sequence[float]) -> list[list[float]]:
    """Return the powers of u as series of ξ, where ξ is this series of u: by fixed point, one power a turn."""
    u = [0.0, 1.0 / xi[1], *(0.0,) * (_DEPTH - 2)]
    for _ in range(_DEPTH - 2):
        powers = _powers(u)
        u = [
            (1.0 if m == 1 else 0.0) / xi[1] - sum(xi[k] * powers[k][m] for k in range(2, _DEPTH)) / xi[1]
            for m in range(_DEPTH)
        ]
    return _powers(u)


def _powers(series: Sequence[float]) -> list[list[float]]:
    powers = [[1.0, *(0.0,) * (_DEPTH - 1)]]
    for _ in range(_DEPTH - 1):
        powers.append(_product(powers[-1], series))
    return powers
