"""Why a stability region has no end: between two curves that orbits, followed backward, cannot leave.

Backward in time an orbit beyond the outermost saddles moves outward and falls on y ≈ −g/f. With s = |x| and the
powers of f and g differing by p, take two curves y = m s^p, one below and one above. If on both, for every s from some
S on, orbits followed outward cross towards the other, then what lies between them at S stays between them for ever. The
two conditions are inequalities between polynomials in s, decided by counting roots. Both borders of the region
enter there, hence so does the strip of the region between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

from finback.dynamics.flow import Flow, horner
from finback.dynamics.roots import real_roots, sign_across

_TRIES: Final = 60
_WIDER: Final = 1.05
_SAFE: Final = 1.0 - 1e-6  # of a bound's rate: so that its own inequality is decided beyond rounding


@final
@dataclass(frozen=True, slots=True)
class Trap:
    """Two curves between which orbits stay, backward in time, from a line on.

    Attributes:
        power: p.
        low: m of the one nearer to y = 0, by absolute value.
        high: m of the other.
        rate: the width of a strip between falls at least as exp(−rate (s − S)); 0 if that was not shown.
        obstacle: why no such curves were found; empty if they were.
    """

    power: int
    low: float
    high: float
    rate: float
    obstacle: str


def backward_trap(flow: Flow, line: float, heights: tuple[float, float]) -> Trap:
    """Find such curves for orbits that cross x = ``line`` at these two heights, moving outward backward in time.

    Args:
        flow: the flow.
        line: where; its sign tells the side.
        heights: y of both borders of the region there.

    Returns:
        the curves, or none and why.
    """
    # Outward is x > 0, y < 0 or the mirror image; with s = |x| and v = |y| both give dv/ds = −f + g/v.
    side = 1.0 if line > 0.0 else -1.0
    f = [c * side**k for k, c in enumerate(flow.damping)]
    g = [c * side**k for k, c in enumerate(flow.force)]
    f, g = _trimmed(f), _trimmed([c * side for c in g])
    power = len(g) - len(f)
    start = abs(line)
    low, high = sorted(-side * y for y in heights)
    if low <= 0.0:
        return Trap(0, 0.0, 0.0, 0.0, "an orbit on the border moves inward there, backward in time")
    if not f or power < 0 or f[-1] <= 0.0 or g[-1] <= 0.0:
        return Trap(0, 0.0, 0.0, 0.0, "far out damping and force do not both push outward")
    slopes = [c / start**power for c in (low, high)]
    below = _first(f, g, start, [slopes[0] / _WIDER**k for k in range(_TRIES)], 1)
    above = _first(f, g, start, [slopes[1] * _WIDER**k for k in range(_TRIES)], -1)
    if math.isnan(below) or math.isnan(above):
        return Trap(0, 0.0, 0.0, 0.0, "no curves of that kind hold the border of the region at the line")
    return Trap(power, below, above, _rate(g, start, power, above), "")


def _trimmed(row: Sequence[float]) -> list[float]:
    return list(row[: max((k + 1 for k, c in enumerate(row) if c != 0.0), default=0)])


def _first(f: list[float], g: list[float], start: float, slopes: list[float], sign: int) -> float:
    """Return the first m at which orbits cross y = m s^p with this sign for every s from ``start`` on; nan if none.

    In s, f and g of the mirrored flow give dy/ds = −f + g/y for y > 0 outward; the sign of that less the slope of the
    curve, times y, is a polynomial.
    """
    power = len(g) - len(f)
    for m in slopes:
        row, sizes = [0.0] * len(g), [0.0] * len(g)
        for k, c in enumerate(f):
            row[k + power] -= m * c
            sizes[k + power] += abs(m * c)
        for k, c in enumerate(g):
            row[k] += c
            sizes[k] += abs(c)
        if power:
            place = 2 * power - 1
            row += [0.0] * (place + 1 - len(row))
            sizes += [0.0] * (place + 1 - len(sizes))
            row[place] -= power * m * m
            sizes[place] += power * m * m
        if _holds(row, sizes, start, sign):
            return m
    return math.nan


def _rate(g: list[float], start: float, power: int, high: float) -> float:
    """Return a lower bound of |g|/y² for y below the upper curve: at the line, if it is least there."""
    rate = _SAFE * horner(g, start) / (high * start**power) ** 2
    row = [*g, *([0.0] * max(0, 2 * power + 1 - len(g)))]
    sizes = list(map(abs, row))
    row[2 * power] -= rate * high * high
    sizes[2 * power] += abs(rate) * high * high
    return rate if rate > 0.0 and _holds(row, sizes, start, 1) else 0.0


def _holds(row: list[float], sizes: list[float], start: float, sign: int) -> bool:
    """Tell whether a polynomial has this sign at ``start`` and everywhere beyond."""
    if sign_across(row, (start, start)) != sign:
        return False
    return all(root.bracket[1] < start for root in real_roots(row, magnitudes=sizes))
