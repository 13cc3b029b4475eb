"""Points of a planar field followed as its coefficients move: each step is one that Newton's method can follow.

A fold, a zero of the trace or an equilibrium is the solution of three equations in both states and the parameter. It is
continued from the coefficients as they are to those that are changed, for many changes at once: predictor by the
derivative, corrector by Newton's method with exact derivatives, whose corrections must at least halve (Deuflhard 2011,
Newton Methods for Nonlinear Problems, section 5.1), else the step is halved. A point that cannot be followed has
vanished on the way, or become another one: the determinant of its equations never changes its sign.
"""

from __future__ import annotations

from enum import Enum
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, IntArray
from finback.dynamics.lienard import Curve
from finback.dynamics.planar.jet import Point
from finback.dynamics.planar.system import PlanarSystem

_SHORTEST: Final = 2.0**-6
"""Of the way: a point that needs shorter steps is one that vanishes nearby."""
_CORRECTIONS: Final = 8
_FALLING: Final = 0.5
_CONVERGED: Final = 1e-9  # of what the point moves by on the whole way; the next correction would be its square
_ROUNDINGS: Final = 1e3 * float(np.finfo(np.float64).eps)

Order = tuple[int, int, int]
_UNITS: Final[tuple[Order, Order, Order]] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


@final
class Mark(Enum):
    """What makes a point of the branch of equilibria: the third equation."""

    FOLD = "the determinant vanishes"
    TRACE = "the trace vanishes"
    HELD = "the parameter is held"


@final
class MovedField:
    """A field and what is changed in it: θ + share · change, for n changes at once.

    Args:
        system: the field.
        changes: of θ, shape (n, p).
    """

    def __init__(self, system: PlanarSystem, changes: FloatArray) -> None:
        self.system = system
        self.changes = changes
        self._degree = max(int(c.polynomial.powers.max(initial=0)) for c in (system.first, system.second))
        self._curves: dict[tuple[int, Order], tuple[Curve, FloatArray]] = {}

    def powers(self, at: FloatArray) -> FloatArray:
        """Return all powers of states and parameter, (k, 3), that the field has: shape (degree + 1, 3, k)."""
        table = np.ones((self._degree + 1, 3, len(at)))
        for power in range(self._degree):
            table[power + 1] = table[power] * at.T
        return table

    def derivative(
        self, row: int, order: Order, powers: FloatArray, share: FloatArray, which: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return a partial derivative of rate ``row`` and its derivative by the share, each of shape (k,).

        Args:
            row: 0 or 1.
            order: counts first state, second state, parameter.
            powers: of states and parameter, shape (degree + 1, 3, k).
            share: of the changes, shape (k,).
            which: of the changes, shape (k,).
        """
        curve, moves = self._curve(row, order)
        i, j, k = curve.polynomial.powers.T
        monomials = (powers[i, 0] * powers[j, 1] * powers[k, 2]).T
        by_share = (monomials * moves[which]).sum(axis=1)
        return monomials @ curve.polynomial.coefficients + share * by_share, by_share

    def _curve(self, row: int, order: Order) -> tuple[Curve, FloatArray]:
        key = (row, order)
        if key not in self._curves:
            curve = (self.system.first, self.system.second)[row]
            for name, times in zip(self.system.variables, order, strict=True):
                for _ in range(times):
                    curve = curve.derivative(name)
            self._curves[key] = curve, self.changes @ curve.sensitivity.T
        return self._curves[key]


@final
class _Equations:
    """Both rates and the mark: their values, their derivatives by the point and by the share."""

    def __init__(self, field: MovedField, mark: Mark, start: FloatArray) -> None:
        self._field, self._mark, self._held = field, mark, float(start[2])

    def __call__(self, at: FloatArray, share: FloatArray, which: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return values (k, 3), derivatives by the point (k, 3, 3) and by the share (k, 3)."""
        values, by_share, matrix = np.zeros((len(at), 3)), np.zeros((len(at), 3)), np.zeros((len(at), 3, 3))

        powers = self._field.powers(at)

        def of(row: int, order: Order) -> tuple[FloatArray, FloatArray]:
            return self._field.derivative(row, order, powers, share, which)

        slopes = {}
        for row in (0, 1):
            values[:, row], by_share[:, row] = of(row, (0, 0, 0))
            for column, unit in enumerate(_UNITS):
                slopes[row, column] = of(row, unit)
                matrix[:, row, column] = slopes[row, column][0]
        if self._mark is Mark.HELD:
            values[:, 2], matrix[:, 2, 2] = at[:, 2] - self._held, 1.0
            return values, matrix, by_share
        (p, dp), (s, ds) = slopes[0, 0], slopes[1, 1]
        if self._mark is Mark.TRACE:
            values[:, 2], by_share[:, 2] = p + s, dp + ds
        else:
            (q, dq), (r, dr) = slopes[0, 1], slopes[1, 0]
            values[:, 2], by_share[:, 2] = p * s - q * r, dp * s + p * ds - dq * r - q * dr
        for column, unit in enumerate(_UNITS):
            first, last = of(0, _plus(_UNITS[0], unit))[0], of(1, _plus(_UNITS[1], unit))[0]
            if self._mark is Mark.TRACE:
                matrix[:, 2, column] = first + last
            else:
                other, cross = of(0, _plus(_UNITS[1], unit))[0], of(1, _plus(_UNITS[0], unit))[0]
                matrix[:, 2, column] = first * s + p * last - other * r - q * cross
        return values, matrix, by_share


@np.errstate(all="ignore")  # what leaves double precision is not followed
def tracked(field: MovedField, start: Point, mark: Mark) -> FloatArray:
    """Follow one point of a field to all of its changes.

    Args:
        field: the field and its changes, shape (n, p).
        start: both states and the parameter without a change.
        mark: what makes the point.

    Returns:
        States and parameter with each change, shape (n, 3); nan where the point cannot be followed.
    """
    begin = np.array(start)
    equations = _Equations(field, mark, begin)
    count = len(field.changes)
    at, share, step = np.tile(begin, (count, 1)), np.zeros(count), np.ones(count)
    _, matrix, by_share = equations(at, share, np.arange(count))
    ahead, size = _solved(matrix, -by_share)
    side, turned = np.sign(size), ahead.copy()
    lengths = np.sqrt(np.nanmean(ahead**2, axis=0)) if count else np.ones(3)
    scale = np.where((lengths > 0.0) & np.isfinite(lengths), lengths, 1.0)
    found = np.full((count, 3), np.nan)
    active = np.flatnonzero(np.isfinite(ahead).all(axis=1) & (side != 0.0))
    while active.size:
        target = np.minimum(share[active] + step[active], 1.0)
        way = (target - share[active])[:, np.newaxis] * turned[active]
        reach = np.maximum(np.abs(way / scale).max(axis=1), target - share[active])
        landed, slope, sign, kept = _corrected(equations, at[active] + way, (target, active), reach, scale)
        kept &= sign == side[active]
        good, bad = active[kept], active[~kept]
        at[good], share[good], turned[good] = landed[kept], target[kept], slope[kept]
        step[good], step[bad] = 2.0 * step[good], 0.5 * step[bad]
        there = good[share[good] >= 1.0]
        found[there] = at[there]
        active = np.concatenate([good[share[good] < 1.0], bad[step[bad] >= _SHORTEST]])
    return found


def _corrected(
    equations: _Equations, guess: FloatArray, to: tuple[FloatArray, IntArray], reach: FloatArray, scale: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, np.ndarray[tuple[int, ...], np.dtype[np.bool_]]]:
    """Return the points, their derivatives by the share, the sign of the determinant, and which were reached."""
    at, last = guess, reach
    reached = np.zeros(len(at), dtype=np.bool_)
    failed = np.zeros(len(at), dtype=np.bool_)
    for _ in range(_CORRECTIONS):
        values, matrix, _ = equations(at, *to)
        correction, _ = _solved(matrix, -values)
        size = np.abs(correction / scale).max(axis=1)
        enough = size <= _CONVERGED + _ROUNDINGS * np.abs(at / scale).max(axis=1)
        failed |= ~reached & ~enough & ~(size <= _FALLING * last)
        reached |= enough & ~failed
        at, last = at + correction, size
        if (reached | failed).all():
            break
    _, matrix, by_share = equations(at, *to)
    slope, determinant = _solved(matrix, -by_share)
    return at, slope, np.sign(determinant), reached & np.isfinite(slope).all(axis=1) & np.isfinite(at).all(axis=1)


def _solved(matrix: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return matrix⁻¹ right (k, 3) by Cramer's rule, not finite where it is singular, and the determinants (k,)."""
    (a, b, c), (d, e, f), (g, h, i) = matrix.transpose(1, 2, 0)
    x, y, z = right.T
    one, two, three = e * i - f * h, f * g - d * i, d * h - e * g
    determinant = a * one + b * two + c * three
    found = [
        one * x + (c * h - b * i) * y + (b * f - c * e) * z,
        two * x + (a * i - c * g) * y + (c * d - a * f) * z,
        three * x + (b * g - a * h) * y + (a * e - b * d) * z,
    ]
    return np.asarray((np.array(found) / determinant).T), determinant


def _plus(one: Order, other: Order) -> Order:
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]
