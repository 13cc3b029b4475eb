"""Bautin points of families, by closed forms and by where folds of cycles begin."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, strategies as st

from finback.dynamics.cycle.bautin import bautin_points
from finback.dynamics.cycle.fold import cycle_folds
from finback.dynamics.family import Family

_VALUE = st.floats(-2.0, 2.0).map(lambda value: round(value, 3))


def _cubic(a1: float, b1: float, b2: float = 1.0) -> Family:
    """μ = b0, λ = a0."""
    return Family(damping=(0.0, a1, -1.0), force=(0.0, 0.0, b1, b2), direction=(0.0, 1.0))


@given(a1=_VALUE, b1=_VALUE)
def test_the_point_of_the_cubic_family(a1: float, b1: float) -> None:
    """At the origin b0 = -a1 b1, if that is negative, and b = 5/(48 ω²) for b2 = 1, minus that for b2 = -1."""
    for b2 in (1.0, -1.0):
        found = [point for point in bautin_points(_cubic(a1, b1, b2)) if point.x == 0.0]
        if a1 * b1 <= 0.0:
            assert found == []
            continue
        (point,) = found
        assert point.mu == pytest.approx(-a1 * b1, rel=1e-14)
        assert point.lam == 0.0
        assert point.frequency == pytest.approx(math.sqrt(a1 * b1), rel=1e-14)
        assert point.bracket[0] <= point.mu <= point.bracket[1]
        if abs(b1) > 0.1 and abs(a1) > 0.1:
            assert point.second_lyapunov == pytest.approx(b2 * 5.0 / (48.0 * a1 * b1), rel=1e-9)


def test_folds_of_cycles_begin_there() -> None:
    """Wells move with b0: the first coefficient of each, in coordinates of its own, changes its sign at the point."""
    family = _cubic(2.0, 1.2, -1.0)
    points = [point for point in bautin_points(family) if point.x != 0.0]
    assert points
    for point in points:
        counts = [
            sum(abs(fold.x_max - point.x) < 0.3 for fold in cycle_folds(family, point.mu + change))
            for change in (-1e-3, 1e-3)
        ]
        assert sorted(counts) == [0, 1]


def test_a_direction_that_never_vanishes() -> None:
    """The elevator has d = 1: f'' g' = f' g'' with all that moves in x alone."""
    # f = -x² + λ and g = -x + x²/2 + μ: -2 (x - 1) = -2 x has no root.
    assert bautin_points(Family(damping=(0.0, 0.0, -1.0), force=(0.0, -1.0, 0.5), direction=(1.0,))) == ()
    # f = x - x² + λ and g = -x - x³/2 + μ: -2 (-1 - 3x²/2) = (1 - 2x) (-3x), thus 3x² - 3x - 2 = 0, both a focus.
    found = bautin_points(Family(damping=(0.0, 1.0, -1.0), force=(0.0, -1.0, 0.0, -0.5), direction=(1.0,)))
    assert [point.x for point in found] == pytest.approx([(3.0 + sign * math.sqrt(33.0)) / 6.0 for sign in (-1, 1)])
    for point in found:
        assert point.mu == pytest.approx(point.x + 0.5 * point.x**3, rel=1e-14)
        assert point.lam == pytest.approx(point.x**2 - point.x, rel=1e-14)
        assert abs(point.residual) < 1e-14


def test_without_damping_slope_there_is_none() -> None:
    assert bautin_points(Family(damping=(1.0,), force=(0.0, -1.0), direction=(1.0,))) == ()
