"""No closed orbit around one equilibrium: two theorems of Liénard systems, checked by interval arithmetic.

x' = y, y' = f(x) y + g(x) with g(s) = 0 at an equilibrium s that is no saddle; u = x − s. With F = ∫f, G = −∫g from s
and z = y − F the energy z²/2 + G changes at the rate −g F (Liénard 1928). A closed orbit around s and no other
equilibrium stays between the neighbors of s, where −g u > 0. There:

* mean damping: if F(x)/u, the mean of f from s to x, has one sign, the energy only falls (or grows) along any orbit,
  and none is closed;
* energy levels: if F(x₂) − F(x₁) has one sign for all x₁ < s < x₂ of the same G, none is closed either (Filippov's
  comparison of the two halves of an orbit over G; Sugie & Hara, J. Math. Anal. Appl. 156, 1991; Cherkas, Differ.
  Equations 13, 1977). With x₂ = s + r, x₁ = s − r t this is the sign of [F(x₂) − F(x₁)]/r where
  G(x₂)/r² − t² G(x₁)/(r t)² = 0: regular at r = 0, where it is 2 f(s).

Both are decided for all s of an interval at once, thus for an interval of elevators.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Final, final

import numpy as np

from finback.dynamics.roots import real_roots
from finback.dynamics.stability.interval import Effort, Interval, evaluate, everywhere, homogeneous

_MARGINS: Final = tuple(0.25 * 2.0**k for k in range(-6, 7))  # of the interval of s: how far beyond a neighbor
_LEVELS: Final = 48
_BISECTIONS: Final = 60
_SLACK: Final = 1.01


@final
@dataclass(frozen=True, slots=True)
class Field:
    """The exact coefficients of f and g, as polynomials in s that multiply powers of u.

    Attributes:
        mean: of F(s + u)/u: row k holds the coefficients by s of u^k.
        slope: of (g(s + u) − g(s))/u.
        energy: of G(s + u)/u².
    """

    mean: tuple[tuple[Fraction, ...], ...]
    slope: tuple[tuple[Fraction, ...], ...]
    energy: tuple[tuple[Fraction, ...], ...]


def field_of(damping: Sequence[float], force: Sequence[float]) -> Field:
    """Return the exact polynomials of a system with these coefficients (a constant in the force does not matter)."""
    f, g = (_exact(row) for row in (damping, force))

    def taylor(row: list[Fraction], k: int) -> tuple[Fraction, ...]:
        return tuple(math.comb(j, k) * row[j] for j in range(k, len(row)))

    return Field(
        mean=tuple(tuple(c / (k + 1) for c in taylor(f, k)) for k in range(len(f))),
        slope=tuple(taylor(g, k) for k in range(1, len(g))),
        energy=tuple(tuple(-c / (k + 1) for c in taylor(g, k)) for k in range(1, len(g))),
    )


def _exact(row: Sequence[float]) -> list[Fraction]:
    """Return the coefficients without zeros at the end: the last one is the sign far out."""
    length = max((k + 1 for k, c in enumerate(row) if c != 0.0), default=1)
    return [Fraction(c) for c in row[:length]]


@final
@dataclass(frozen=True, slots=True)
class Strip:
    """All equilibria s of an interval, and how far from them the neighbors lie at most.

    Attributes:
        field: the polynomials.
        s: the interval.
        left: upper bound of s − x over the left neighbor x; infinite where there is none.
        right: the same to the right.
        unit: a length of the size of the motion around s.
    """

    field: Field
    s: tuple[float, float]
    left: float
    right: float
    unit: float


def strip_of(field: Field, s: tuple[float, float]) -> Strip:
    """Bound the neighbors of the equilibria of an interval: beyond a point where g u > 0 for all of them."""
    left, right = _bound(field, s, -1), _bound(field, s, 1)
    finite = [bound for bound in (left, right) if math.isfinite(bound)]
    return Strip(field, s, left, right, max(finite) if finite else _length(field, s))


def _length(field: Field, s: tuple[float, float]) -> float:
    """Return where the last term of the potential is as large as its first; 1 where there is but one."""
    middle = Fraction(0.5 * (s[0] + s[1]))
    row = [abs(float(sum(c * middle**j for j, c in enumerate(terms)))) for terms in field.energy]
    found = [(row[0] / c) ** (1.0 / k) for k, c in enumerate(row) if k and c]
    return found[-1] if found and found[-1] > 0.0 else 1.0


def _bound(field: Field, s: tuple[float, float], side: int) -> float:
    """Return a distance at which (g(s + u) − g(s))/u > 0 for every s; infinite if none was found."""
    places = []
    for point in (s[0], 0.5 * (s[0] + s[1]), s[1]):
        row = [float(sum(c * Fraction(point) ** j for j, c in enumerate(terms))) for terms in field.slope]
        if not any(row):
            return math.inf
        roots = [abs(root.value) for root in real_roots(row) if root.crossing and root.value * side > 0.0]
        places.append(min(roots, default=math.inf))
    if not all(map(math.isfinite, places)):
        places = [place for place in places if math.isfinite(place)]
        if not places:
            return math.inf
    width = max(s[1] - s[0], 1e-12 * max(places))
    whole = Interval(np.array([s[0]]), np.array([s[1]]))
    rows = [evaluate([Interval.around(c) for c in terms], whole) for terms in field.slope]
    for margin in _MARGINS:
        distance = side * (max(places) + margin * width)
        if (evaluate(rows, Interval(np.array([distance]), np.array([distance]))).low > 0.0).all():
            return abs(distance)
    return math.inf


def mean_damping(strip: Strip, sign: int, effort: Effort) -> int:
    """Check that the mean of f from s to x has this sign for all s and all x between the neighbors.

    Args:
        strip: the equilibria.
        sign: of the mean.
        effort: boxes that may be spent.

    Returns:
        the number of boxes checked, 0 if it was not shown.
    """
    coefficients = _enclosures(strip.field.mean)

    def claim(side: int) -> int:
        def decide(box: Interval) -> tuple[np.ndarray, np.ndarray]:
            s, x, w = _Box(box).plane(side * strip.unit)
            value = homogeneous(_at(coefficients, s), x, w)
            return _signed(value, sign)

        return everywhere(decide, np.array([[strip.s, (0.0, _compact(strip, side))]]), effort)

    counts = [claim(side) for side in (-1, 1)]
    return sum(counts) if all(counts) else 0


def energy_levels(strip: Strip, sign: int, effort: Effort) -> int:
    """Check that F(x₂) − F(x₁) has this sign for all s and all x₁ < s < x₂ of one energy between the neighbors.

    Args:
        strip: the equilibria.
        sign: of the mean.
        effort: boxes that may be spent.

    Returns:
        the number of boxes checked, 0 if it was not shown.
    """
    if not plausible(strip, sign):
        return 0
    mean, energy = _enclosures(strip.field.mean), _enclosures(strip.field.energy)

    def claim(side: int) -> int:
        other = strip.left if side > 0 else strip.right

        def decide(box: Interval) -> tuple[np.ndarray, np.ndarray]:
            s, x, w = _Box(box).plane(side * strip.unit)
            t = Interval(box.low[2], box.high[2])
            back = -(x * t)
            at_mean, at_energy = _at(mean, s), _at(energy, s)
            level = homogeneous(at_energy, x, w) - t * t * homogeneous(at_energy, back, w)
            value = homogeneous(at_mean, x, w) + t * homogeneous(at_mean, back, w)
            apart = (level.low > 0.0) | (level.high < 0.0)
            if math.isfinite(other):  # beyond the other neighbor: r t > bound
                bound = Interval.around(other)
                apart |= (-back * Interval.around(float(side)) - bound * w).low > 0.0
            holds, _ = _signed(value, sign)
            return holds | apart, np.zeros_like(holds)

        return everywhere(decide, np.array([[strip.s, (0.0, _compact(strip, side)), (0.0, 1.0)]]), effort)

    counts = [claim(side) for side in (-1, 1)]
    return sum(counts) if all(counts) else 0


@final
@dataclass(frozen=True, slots=True)
class _Box:
    """Boxes of s and ρ, where u = L ρ/(1 − ρ) reaches infinity at ρ = 1."""

    box: Interval

    def plane(self, length: float) -> tuple[Interval, Interval, Interval]:
        """Return s, and x and w with u = x/w."""
        rho = Interval(self.box.low[1], self.box.high[1])
        return (
            Interval(self.box.low[0], self.box.high[0]),
            rho * Interval.around(length),
            Interval.around(1.0) - rho,
        )


def _compact(strip: Strip, side: int) -> float:
    """Return the ρ of the bound on one side, rounded up."""
    bound = strip.right if side > 0 else strip.left
    return 1.0 if math.isinf(bound) else min(1.0, bound / (bound + strip.unit) * (1.0 + 1e-14))


def _enclosures(rows: tuple[tuple[Fraction, ...], ...]) -> list[list[Interval]]:
    return [[Interval.around(c) for c in row] for row in rows]


def _at(rows: list[list[Interval]], s: Interval) -> list[Interval]:
    return [evaluate(row, s) for row in rows]


def _signed(value: Interval, sign: int) -> tuple[np.ndarray, np.ndarray]:
    if sign > 0:
        return value.low > 0.0, value.high <= 0.0
    return value.high < 0.0, value.low >= 0.0


def plausible(strip: Strip, sign: int) -> bool:
    """Tell, by plain numbers at the middle of the interval, whether the ordering of levels can hold at all."""
    s = 0.5 * (strip.s[0] + strip.s[1])
    mean, energy = (
        np.array([float(sum(c * Fraction(s) ** j for j, c in enumerate(row))) for row in rows])
        for rows in (strip.field.mean, strip.field.energy)
    )
    if sign * mean[0] <= 0.0:
        return False
    value = np.polynomial.polynomial.polyval
    for side in (-1, 1):
        rho = np.linspace(0.0, _compact(strip, side) / _SLACK, _LEVELS + 1)[1:]
        r = side * strip.unit * rho / (1.0 - rho)
        low, high = np.zeros_like(r), np.ones_like(r)

        def excess(t: np.ndarray, r: np.ndarray = r) -> np.ndarray:
            return np.asarray(t * t * value(-r * t, energy) - value(r, energy))

        crosses = excess(high) > 0.0
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            below = excess(middle) < 0.0
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        other = strip.left if side > 0 else strip.right
        inside = crosses & (np.abs(r) * low < other / _SLACK)
        ordered = sign * (value(r, mean) + low * value(-r * low, mean))
        if (ordered[inside] <= 0.0).any():
            return False
    return True
