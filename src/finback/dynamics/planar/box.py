"""Narrow boxes outside of which two polynomials in two variables have no common zero."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import zip_longest
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.planar.elimination import Row, denominator, doubles, eliminant, integers
from finback.dynamics.planar.system import PlanarFlow
from finback.dynamics.planar.taylor import UNIT_ROUNDOFF, Expansion, expansion
from finback.dynamics.roots import real_roots
from finback.errors import RefusedError

_TINY: Final = sys.float_info.min
_SUSPICIOUS_BITS: Final = 26  # half of those of a double: only below that is it worth to ask what rounding does
_ALTOGETHER: Final = 10  # a change of a tenth

NOT_ISOLATED: Final = "equilibria are not isolated: both rates vanish along a curve"
NOT_ISOLATED_HINT: Final = "remove the factor that both polynomials have in common"


def boxes(flow: PlanarFlow) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield boxes (center, half-widths) outside of which there is no common zero."""
    first, second = integers(flow.first), integers(flow.second)
    if not first or not second:
        raise RefusedError("a rate is zero everywhere: equilibria are not isolated", hint=NOT_ISOLATED_HINT)
    if len(first) == len(second) == 1 and _without_second(flow):
        return
    row = eliminant(first, second)
    if _small(row, first, second) and _rounding_decides(flow):
        raise RefusedError(NOT_ISOLATED, hint=NOT_ISOLATED_HINT)
    ys: list[tuple[float, float]] | None = None
    for low, high in _intervals(row):
        direct = _solved_for_second(flow, low, high)
        if direct is not None:
            yield _box((low, high), direct)
            continue
        if ys is None:
            ys = _intervals(eliminant(integers(flow.first.T), integers(flow.second.T)))
        for pair in ys:
            yield _box((low, high), pair)


def _without_second(flow: PlanarFlow) -> bool:
    """Where neither rate depends on y, tell whether they have no zero in common; refuse where they have one."""
    if eliminant(integers(flow.first.T), integers(flow.second.T)):
        return True
    raise RefusedError(NOT_ISOLATED, hint=NOT_ISOLATED_HINT)


def _intervals(row: Row) -> list[tuple[float, float]]:
    if not row:
        raise RefusedError(NOT_ISOLATED, hint=NOT_ISOLATED_HINT)
    return [root.bracket for root in real_roots(doubles(row))]


def _box(x: tuple[float, float], y: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    low, high = np.array([x[0], y[0]]), np.array([x[1], y[1]])
    center = low + 0.5 * (high - low)
    half = np.maximum(high - center, center - low)
    return center, half + 2.0 * UNIT_ROUNDOFF * np.abs(center) + _TINY


def _solved_for_second(flow: PlanarFlow, low: float, high: float) -> tuple[float, float] | None:
    """Return where y lies for an x between low and high, from a rate that is linear in y; None where that fails."""
    middle, half = low + 0.5 * (high - low), 0.5 * (high - low) + 2.0 * UNIT_ROUNDOFF * abs(low)
    here: Expansion | None = None
    for name, table in (("first", flow.first), ("second", flow.second)):
        if table.shape[1] < 2 or not table[:, 1].any() or table[:, 2:].any():
            continue
        here = expansion(flow, middle, 0.0) if here is None else here
        taylor, error = getattr(here, name), getattr(here, f"{name}_error")
        powers = half ** np.arange(taylor.shape[0])
        spread = powers @ (np.abs(taylor) + error)
        constant, slope = float(taylor[0, 0]), float(taylor[0, 1])
        off_constant, off_slope = float(spread[0]) - abs(constant), float(spread[1]) - abs(slope)
        if abs(slope) <= 4.0 * off_slope:
            continue
        y = -constant / slope
        wide = (off_constant + abs(y) * off_slope) / (abs(slope) - off_slope)
        return y - wide, y + wide
    return None


def _small(row: Row, first: list[Row], second: list[Row]) -> bool:
    """Tell whether an eliminant is so small beside what it is made of that a common factor may be near."""
    sizes = [sum(abs(c) for column in columns for c in column).bit_length() for columns in (first, second)]
    whole = sizes[0] * (len(second) - 1) + sizes[1] * (len(first) - 1)
    return max((abs(c).bit_length() for c in row), default=0) < whole - _SUSPICIOUS_BITS


def _rounding_decides(flow: PlanarFlow) -> bool:
    """Tell whether changes of the coefficients in their last digits change the eliminant altogether."""
    generator = np.random.default_rng(0)
    plain, moved = [], []
    for table, sizes in ((flow.first, flow.first_sizes), (flow.second, flow.second_sizes)):
        other = table + 2.0 * UNIT_ROUNDOFF * sizes * generator.choice([-1.0, 1.0], size=table.shape)
        common = max(denominator(table), denominator(other))
        plain.append(integers(table, common))
        moved.append(integers(other, common))
    before, after = eliminant(*plain), eliminant(*moved)
    change = max((abs(a - b) for a, b in zip_longest(before, after, fillvalue=0)), default=0)
    return change * _ALTOGETHER > max(map(abs, before), default=0)


def second_degree(first: FloatArray, second: FloatArray) -> int:
    """Return the smaller degree in the second variable, those without it left out."""
    degrees = [int(np.flatnonzero(table.any(axis=0)).max(initial=0)) for table in (first, second)]
    return min((degree for degree in degrees if degree), default=0)


def turned_over(flow: PlanarFlow) -> PlanarFlow:
    """Return the polynomials with both coordinates exchanged; as polynomials, not as a field."""
    return PlanarFlow(
        first=flow.first.T,
        second=flow.second.T,
        first_sizes=flow.first_sizes.T,
        second_sizes=flow.second_sizes.T,
        scale=flow.scale,
    )
