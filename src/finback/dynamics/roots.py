"""All real roots of a polynomial, counted by the signs it takes and by nothing else.

Between two neighboring zeros of its derivative a polynomial is monotone, so the signs of its values there decide how
many roots lie between. The value at an extremum hardly depends on where exactly the extremum was found, so the
count stays right when two roots nearly meet, where the roots themselves are ill-conditioned. A sign counts only
beyond the rounding error of the evaluation (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed. 2002,
Eq. 5.3); what is below that is reported as an unresolved root. There is no other tolerance.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Final, final

from scipy.optimize import brentq

from finback.errors import RefusedError

_UNIT_ROUNDOFF: Final = sys.float_info.epsilon / 2.0
_REACH: Final = 1e9  # no angle lies beyond it, and high powers of what does would overflow
_ITERATIONS: Final = 10_000  # far beyond what bisection of all doubles needs; Brent's worst case is slower than it


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RealRoot:
    """One real root, or several that double precision cannot tell apart.

    Attributes:
        value: the root.
        bracket: the nearest points on its left and right, by doubling steps, where the sign is beyond rounding.
        crossing: whether the sign differs at the two; an even root, or a pair of roots, only touches zero.
        resolved: whether this is one simple root; if not, an extremum lies at zero within rounding.
    """

    value: float
    bracket: tuple[float, float]
    crossing: bool
    resolved: bool


@final
@dataclass(frozen=True, slots=True)
class _Row:
    """Coefficients by falling power, with the size of what each was summed from."""

    coefficients: tuple[float, ...]
    magnitudes: tuple[float, ...]

    def value(self, x: float) -> float:
        total = 0.0
        for coefficient in self.coefficients:
            total = total * x + coefficient
        return total

    def rounding(self, x: float) -> float:
        """Bound the error of ``value``, rounded coefficients included: gamma_(2n+2) times the sum of absolute terms."""
        total, size = 0.0, abs(x)
        for magnitude in self.magnitudes:
            total = total * size + magnitude
        steps = 2 * len(self.coefficients) * _UNIT_ROUNDOFF
        return total * steps / (1.0 - steps)

    def sign(self, x: float) -> int:
        """Return -1, 1, or 0 where rounding could have made either."""
        value = self.value(x)
        bound = self.rounding(x)
        if not (math.isfinite(value) and math.isfinite(bound)):
            raise RefusedError(
                f"a polynomial of degree {len(self.coefficients) - 1} overflows at {x:.3g}",
                hint="its coefficients are too large for double precision",
            )
        if abs(value) <= bound:
            return 0
        return 1 if value > 0.0 else -1

    def derivative(self) -> _Row:
        degree = len(self.coefficients) - 1
        return _Row(
            tuple(c * (degree - i) for i, c in enumerate(self.coefficients[:-1])),
            tuple(m * (degree - i) for i, m in enumerate(self.magnitudes[:-1])),
        )

    def edge(self) -> float:
        """Return where to begin: a point with a sign at plus and minus, if possible beyond all roots.

        That is twice Fujiwara's (1916) bound of the roots, from where on the leading term is thrice the rest.
        """
        leading = math.log(abs(self.coefficients[0]))
        logarithms = [(math.log(m) - leading) / (i + 1) for i, m in enumerate(self.magnitudes[1:]) if m]
        # Not below 1, where high powers vanish; not so large that they overflow.
        edge = math.exp(min(max(0.0, math.log(4.0) + max(logarithms, default=0.0)), math.log(_REACH)))
        # Within reach of the roots, one of so many points is away from all of them and from their mirror images.
        for _ in range(2 * len(self.coefficients)):
            if self.sign(-edge) and self.sign(edge):
                return edge
            edge *= 0.9
        raise RefusedError("the polynomial is zero everywhere within rounding: every point is a root")


def real_roots(ascending: Sequence[float], *, magnitudes: Sequence[float] | None = None) -> tuple[RealRoot, ...]:
    """Return all real roots up to 1e9 in absolute value, rising.

    Args:
        ascending: coefficients by rising power.
        magnitudes: what each coefficient was summed from in absolute value, where that was more than itself
            (a constant g0 + c1 δ that nearly cancels is known only to the rounding of g0).

    Raises:
        RefusedError: the polynomial is zero everywhere, or it overflows.
    """
    sizes = [abs(c) for c in ascending] if magnitudes is None else list(magnitudes)
    degree = max((i for i, c in enumerate(ascending) if c != 0.0), default=-1)
    if degree < 0:
        raise RefusedError("the polynomial is zero everywhere: every point is a root")
    falling = tuple(float(c) for c in ascending[degree::-1])
    return _roots(_Row(falling, tuple(float(m) for m in sizes[degree::-1])))


def sign_across(ascending: Sequence[float], bracket: tuple[float, float]) -> int:
    """Return the sign of a polynomial at a point known to lie in ``bracket``.

    Returns:
        -1 or 1 where both ends have that sign beyond rounding, else 0.
    """
    falling = tuple(float(c) for c in ascending[::-1])
    row = _Row(falling, tuple(abs(c) for c in falling))
    left, right = (row.sign(x) for x in bracket)
    return left if left == right else 0


def _roots(row: _Row) -> tuple[RealRoot, ...]:
    if len(row.coefficients) == 1:
        return ()
    edge = row.edge()
    extrema = [root.value for root in _roots(row.derivative()) if abs(root.value) < edge]
    points = [(x, row.sign(x)) for x in (-edge, *extrema, edge)]
    found = []
    # Neighbors that are both zero within rounding are one flat stretch: the polynomial is monotone between them.
    stretches = [(sign, [x for x, _ in group]) for sign, group in groupby(points, key=lambda point: point[1])]
    for index, (sign, xs) in enumerate(stretches):
        if sign == 0:
            outer = (stretches[index - 1][1][-1], stretches[index + 1][1][0])
            found.append(_flat(row, xs, outer))
        elif index + 1 < len(stretches) and stretches[index + 1][0] == -sign:
            found.append(_crossing(row, xs[-1], stretches[index + 1][1][0]))
    return tuple(found)


def _crossing(row: _Row, low: float, high: float) -> RealRoot:
    if row.coefficients[-1] == 0.0 and low < 0.0 < high:
        root = 0.0  # exact; a search would end at some 1e-310
    else:
        smallest = sys.float_info.min
        relative = 4.0 * sys.float_info.epsilon
        root = float(brentq(row.value, low, high, xtol=smallest, rtol=relative, maxiter=_ITERATIONS))
    return RealRoot(
        value=root, bracket=(_beyond(row, root, low), _beyond(row, root, high)), crossing=True, resolved=True
    )


def _flat(row: _Row, xs: list[float], outer: tuple[float, float]) -> RealRoot:
    middle = 0.5 * (xs[0] + xs[-1])
    bracket = (_beyond(row, xs[0], outer[0]), _beyond(row, xs[-1], outer[1]))
    signs = [row.sign(x) for x in bracket]
    return RealRoot(value=middle, bracket=bracket, crossing=signs[0] != signs[1], resolved=False)


def _beyond(row: _Row, start: float, limit: float) -> float:
    """Step from ``start`` towards ``limit``, doubling, to the first point with a sign; ``limit`` has one."""
    step = math.copysign(math.ulp(start), limit - start)
    while abs(step) < abs(limit - start):
        if row.sign(start + step):
            return start + step
        step *= 2.0
    return limit
