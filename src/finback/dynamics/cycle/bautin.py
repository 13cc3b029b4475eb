"""Bautin points: Hopf points whose first Lyapunov coefficient vanishes, where the folds of cycles of a family begin.

On the Hopf curve of a family, λ = −f(x) at an equilibrium x, so that the first coefficient depends on x and μ alone:
it is zero where f'' (g' + μ d') = f' (g'' + μ d''). With μ = −g/d at the equilibrium this is one polynomial of x.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.cycle.lyapunov import lyapunov_coefficients
from finback.dynamics.family import Family
from finback.dynamics.flow import derivative, horner
from finback.dynamics.roots import real_roots, sign_across

_STEP: Final = 4.0 * math.ulp(1.0)
_DOUBLINGS: Final = 40
_ROUNDING: Final = 1e-14  # of the terms of a sum


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Bautin:
    """A generalized Hopf point of a family.

    Attributes:
        mu: the parameter.
        lam: the constant added to the damping.
        x: the equilibrium.
        frequency: ω.
        second_lyapunov: b, where r' = b r⁵ for the amplitude r of x: with b > 0 the outer of the two cycles beside it
            is unstable.
        bracket: two μ at which the first Lyapunov coefficient of this Hopf curve has opposite signs, shape (2,).
        residual: the first Lyapunov coefficient, as evaluated.
    """

    mu: float
    lam: float
    x: float
    frequency: float
    second_lyapunov: float
    bracket: FloatArray
    residual: float

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "bracket", frozen_array(self.bracket))


def bautin_points(family: Family) -> tuple[Bautin, ...]:
    """Return all Bautin points where the first coefficient changes its sign, by rising μ."""
    found = [point for mu, x in _candidates(family) if (point := _bautin(family, mu, x)) is not None]
    return tuple(sorted(found, key=lambda point: (point.mu, point.x)))


def _candidates(family: Family) -> Iterator[tuple[float, float]]:
    """Yield μ and x at which the condition holds."""
    f1, g0, d0 = derivative(family.damping), family.force, family.direction
    f2, g1, d1 = derivative(f1), derivative(g0), derivative(d0)
    g2, d2 = derivative(g1), derivative(d1)
    mul, sub = np.polynomial.polynomial.polymul, np.polynomial.polynomial.polysub
    condition = sub(mul(f2, sub(mul(g1, d0), mul(g0, d1))), mul(f1, sub(mul(g2, d0), mul(g0, d2))))
    if any(condition):
        for root in real_roots(condition.tolist()):
            if sign_across(d0, root.bracket):
                yield -horner(g0, root.value) / horner(d0, root.value), root.value
    # An equilibrium that does not move, because g and d vanish there: the condition is linear in μ.
    for root in real_roots(d0) if any(d0) else ():
        x = root.value
        if sign_across(g0, root.bracket) == 0:
            slope = horner(f2, x) * horner(d1, x) - horner(f1, x) * horner(d2, x)
            if slope:
                yield (horner(f1, x) * horner(g2, x) - horner(f2, x) * horner(g1, x)) / slope, x


def _bautin(family: Family, mu: float, x: float) -> Bautin | None:
    """Return the point, if the equilibrium there is a focus and the first coefficient changes its sign."""
    flow = family.at(mu, -horner(family.damping, x))
    slope = derivative(flow.force)
    square = -horner(slope, x)
    if not square > _ROUNDING * horner(tuple(map(abs, slope)), abs(x)):
        return None  # a saddle, or no focus within rounding: a Bogdanov-Takens point
    first, second = lyapunov_coefficients(flow.damping, flow.force, x)
    step = _STEP * max(abs(mu), abs(square))
    for _ in range(_DOUBLINGS):
        ends = [_first(family, mu + sign * step, x) for sign in (-1.0, 1.0)]
        if ends[0] * ends[1] < 0.0:
            return Bautin(
                mu=mu,
                lam=-horner(family.damping, x),
                x=x,
                frequency=math.sqrt(square),
                second_lyapunov=second,
                bracket=frozen_array((mu - step, mu + step)),
                residual=first,
            )
        if not all(map(math.isfinite, ends)):
            return None
        step *= 2.0
    return None


def _first(family: Family, mu: float, x: float) -> float:
    """Return the first Lyapunov coefficient of the equilibrium near x; nan where it is no focus."""
    force = family.at(mu, 0.0).force
    slope = derivative(force)
    for _ in range(3):  # the equilibrium moves by the small change of μ
        if not horner(slope, x) < 0.0:
            return math.nan
        x -= horner(force, x) / horner(slope, x)
    return lyapunov_coefficients(family.damping, force, x)[0] if horner(slope, x) < 0.0 else math.nan
