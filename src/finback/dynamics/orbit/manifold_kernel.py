"""Machine code of the power series of a saddle's manifold."""

from __future__ import annotations

from typing import Final

from finback.arrays import FloatArray
from finback.dynamics.compiled import compiled

ORDER: Final = 36
_SMALL: Final = 1e-17  # of the last terms of the series, relative to the slope
_RESIDUAL: Final = 1e-14  # of the invariance equation, relative to its terms
_SHRINK: Final = 0.8
_TRIES: Final = 40


@compiled
def expand_graph(  # noqa: C901, PLR0912 - one recursion and its check, compiled once
    damping: FloatArray, force: FloatArray, saddle: float, values: tuple[float, float], series: FloatArray
) -> float:  # pragma: no cover - machine code
    """Fill ``series`` with h of y = h(x − saddle), for the first of two eigenvalues; return its radius, or 0.

    h h' = f h + g coefficient by coefficient: that of power k is divided by k λ minus the other eigenvalue, which
    have opposite signs, so it never vanishes. The radius follows from the decay of the coefficients, and is reduced
    until the equation holds to rounding at both ends.
    """
    value, other = values
    f, g = damping.copy(), force.copy()
    for row in (f, g):
        for start in range(row.size - 1):
            for k in range(row.size - 2, start - 1, -1):
                row[k] += saddle * row[k + 1]
    # Constant and slope of the shifted polynomials are what the eigenvalues were made of; near a fold, where the slope
    # cancels, another rounding of it would not fit them.
    f[0], g[0], g[1] = value + other, 0.0, -value * other
    series[0], series[1] = 0.0, value
    for k in range(2, ORDER + 1):
        cross = 0.0
        for i in range(2, k):
            cross += series[i] * series[k + 1 - i]
        pushed = g[k] if k < g.size else 0.0
        for m in range(1, min(k, f.size)):
            pushed += f[m] * series[k - m]
        series[k] = (pushed - 0.5 * (k + 1) * cross) / (k * value - other)
    radius = 1.0  # a straight manifold ends somewhere: at the size of the system
    for k in range(ORDER - 3, ORDER + 1):
        if series[k] != 0.0:
            radius = min(radius, (_SMALL * abs(value / series[k])) ** (1.0 / (k - 1)))
    for _ in range(_TRIES):
        worst = 0.0
        for u in (-radius, radius):
            h, slope, damped, pushed = 0.0, 0.0, 0.0, 0.0
            for k in range(ORDER, -1, -1):
                slope = slope * u + h
                h = h * u + series[k]
            for k in range(f.size - 1, -1, -1):
                damped = damped * u + f[k]
            for k in range(g.size - 1, -1, -1):
                pushed = pushed * u + g[k]
            size = abs(h * slope) + abs(damped * h) + abs(pushed)
            worst = max(worst, abs(h * slope - damped * h - pushed) / size if size > 0.0 else 1.0)
        if worst <= _RESIDUAL:
            return radius
        radius *= _SHRINK
    return 0.0
