"""Where equilibria of a family meet, and the strips of the plane (μ, λ) between: λ does not move them.

An equilibrium of g + μ d is double where g' d = g d' besides. Common roots of g and d do not move at all: the cubic
system keeps one at the origin. They are divided out first, so that what meets them is a transcritical bifurcation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np

from finback.arrays import frozen_array
from finback.dynamics.diagram.curve import Cell, CurveKind
from finback.dynamics.family import Family
from finback.dynamics.flow import derivative, horner
from finback.dynamics.orbit.annulus import poles
from finback.dynamics.roots import real_roots
from finback.errors import RefusedError

_THINNEST: Final = 1e-12  # of the range of μ: lines nearer to each other are one within rounding
_ROUNDING: Final = 1e-14  # of the terms of a sum


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A value of μ at which equilibria meet, whatever λ is.

    Attributes:
        kind: how.
        mu: where.
        x: the equilibrium; infinite if one comes from infinity.
        lam: the λ at which the trace there is zero (a Bogdanov-Takens point); nan at infinity.
    """

    kind: CurveKind
    mu: float
    x: float
    lam: float


def lines(family: Family) -> tuple[Line, ...]:
    """Return all lines, by rising μ.

    Raises:
        RefusedError: μ has no effect, or the force vanishes everywhere.
    """
    g, d = _trimmed(family.force), _trimmed(family.direction)
    if not d:
        raise RefusedError("mu has no effect: the direction of the family is zero")
    fixed, g, d = _without_common(g, d)
    found = [_meeting(family, g, d, x) for x in fixed if horner(d, x)]
    met = {(line.mu, line.x): line for line in found}
    mul, sub = np.polynomial.polynomial.polymul, np.polynomial.polynomial.polysub
    condition = sub(mul(derivative(g), d), mul(g, derivative(d))).tolist() if g else []
    for root in real_roots(condition) if any(condition) else ():
        if root.crossing and horner(d, root.value):
            mu = -horner(g, root.value) / horner(d, root.value)
            if (mu + 0.0, root.value) not in met:  # else three meet: a pitchfork
                found.append(_line(family, CurveKind.FOLD, mu, root.value))
    if len(d) > 1 and len(d) >= len(g):
        top = g[len(d) - 1] if len(g) == len(d) else 0.0
        found.append(Line(kind=CurveKind.INFINITY, mu=-top / d[-1] + 0.0, x=math.inf, lam=math.nan))
    return tuple(sorted(found, key=lambda line: (line.mu, line.x)))


def cells(family: Family, mu_range: tuple[float, float], marks: Sequence[Line]) -> tuple[Cell, ...]:
    """Return the strips between the lines, by rising μ; those too thin for double precision are left out."""
    low, high = mu_range
    places = sorted({low, high, *(line.mu for line in marks if low < line.mu < high)})
    found = []
    for left, right in pairwise(places):
        if right - left <= _THINNEST * (high - low):
            continue
        saddles = tuple(pole.saddle for pole in poles(family.at(0.5 * (left + right), 0.0)))
        found.append(Cell(mu=frozen_array((left, right)), saddles=saddles))
    return tuple(found)


def _trimmed(row: Sequence[float]) -> list[float]:
    kept = list(row)
    while kept and kept[-1] == 0.0:
        kept.pop()
    return kept


def _without_common(g: list[float], d: list[float]) -> tuple[list[float], list[float], list[float]]:
    """Divide both by their common real roots; return those and what is left."""
    fixed = []
    for root in real_roots(d) if len(d) > 1 else ():
        while len(d) > 1 and g and _is_zero(g, root.value) and _is_zero(d, root.value):
            fixed.append(root.value)
            g, d = _divided(g, root.value), _divided(d, root.value)
    return fixed, g, d


def _is_zero(row: Sequence[float], x: float) -> bool:
    return abs(horner(row, x)) <= _ROUNDING * horner([abs(c) for c in row], abs(x))


def _divided(row: list[float], x: float) -> list[float]:
    """Return the quotient by (u − x), the remainder dropped."""
    quotient = [0.0] * (len(row) - 1)
    carry = 0.0
    for k in range(len(row) - 1, 0, -1):
        carry = row[k] + x * carry
        quotient[k - 1] = carry
    return quotient


def _meeting(family: Family, g: list[float], d: list[float], x: float) -> Line:
    """Return where a moving equilibrium meets one that does not move; three meet where the moving one turns back."""
    mu = -horner(g, x) / horner(d, x) + 0.0  # not −0
    rates = horner(derivative(g), x), mu * horner(derivative(d), x)
    turns = abs(sum(rates)) <= _ROUNDING * sum(map(abs, rates))
    return _line(family, CurveKind.PITCHFORK if turns else CurveKind.TRANSCRITICAL, mu, x)


def _line(family: Family, kind: CurveKind, mu: float, x: float) -> Line:
    return Line(kind=kind, mu=mu + 0.0, x=x, lam=-horner(family.damping, x) + 0.0)
