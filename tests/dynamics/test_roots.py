"""Real roots: those that were put in are found, and near-double ones are never miscounted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.dynamics.roots import real_roots, sign_across
from finback.errors import RefusedError

_APART = st.lists(st.integers(-40, 40), min_size=1, max_size=6, unique=True).map(sorted)


@given(_APART, st.floats(0.1, 10.0), st.booleans())
def test_the_roots_put_in_are_found(tenths: list[int], leading: float, add_a_pair: bool) -> None:  # noqa: FBT001 - hypothesis draws it
    expected = np.array(tenths) / 10.0
    row = leading * np.polynomial.polynomial.polyfromroots(expected)
    if add_a_pair:  # x² + x + 9 has no real root and adds none
        row = np.polynomial.polynomial.polymul(row, [9.0, 1.0, 1.0])
    found = real_roots(row.tolist())
    assert len(found) == len(expected)
    # First-order bound: the error of the coefficients (one rounding each, a few dozen in their making) over the slope.
    sizes = np.polynomial.polynomial.polyval(np.abs(expected), np.abs(row))
    slopes = np.abs(np.polynomial.polynomial.polyval(expected, np.polynomial.polynomial.polyder(row)))
    errors = np.abs(np.array([root.value for root in found]) - expected)
    assert (errors <= 64 * np.finfo(float).eps * sizes / slopes + np.finfo(float).tiny).all()
    for root in found:
        assert root.crossing
        assert root.resolved
        assert root.bracket[0] < root.value < root.bracket[1]


@given(st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=6))
def test_as_many_as_the_companion_matrix_has(ascending: list[float]) -> None:
    leading = abs(ascending[-1])
    if leading < 0.1:
        ascending = [*ascending[:-1], 1.0]
    companion = np.roots(ascending[::-1])
    # The other road is ill-conditioned near double roots: compare where its roots are clearly real or clearly not.
    gaps = np.abs(companion[:, None] - companion[None, :])[~np.eye(len(companion), dtype=bool)]
    if gaps.size and gaps.min() < 1e-2:
        return
    real = np.sort(companion.real[np.abs(companion.imag) < 1e-6])
    found = [root.value for root in real_roots(ascending)]
    assert len(found) == len(real)
    np.testing.assert_allclose(found, real, atol=1e-7)  # the gap of 1e-2 costs the companion roots up to 8 digits


@given(st.floats(-2.0, 2.0), st.integers(-14, -3), st.sampled_from([-1.0, 1.0]))
def test_a_near_double_root_is_two_or_none(center: float, exponent: int, side: float) -> None:
    gap = side * 10.0**exponent  # (x - c)² = gap
    row = [center**2 - gap, -2.0 * center, 1.0]
    exact_discriminant = math.fsum([row[1] ** 2 / 4.0, -row[0]])  # of the rounded row, correctly rounded
    found = real_roots(row)
    if all(root.resolved for root in found):
        assert len(found) == (2 if exact_discriminant > 0.0 else 0)
    else:  # allowed only where rounding hides the sign of the extremum
        assert abs(exact_discriminant) <= 64 * np.finfo(float).eps * max(center**2, abs(gap))
        assert len(found) == 1
        assert not found[0].crossing


@pytest.mark.parametrize(
    ("row", "values", "crossing"),
    [
        ([1.0, -2.0, 1.0], [1.0], [False]),  # (x - 1)²
        ([-1.0, 3.0, -3.0, 1.0], [1.0], [True]),  # (x - 1)³
        ([0.0, 0.0, 0.0, 0.0, 2.0], [0.0], [False]),
        ([0.0, 0.0, 1.0, 1.0], [-1.0, 0.0], [True, False]),  # x² (x + 1)
        ([2.0, 1.0], [-2.0], [True]),
        ([2.0, 1.0, 0.0, 0.0], [-2.0], [True]),  # leading zeros are no degree
        ([7.0], [], []),
    ],
)
def test_multiple_roots(row: list[float], values: list[float], crossing: list[bool]) -> None:
    found = real_roots(row)
    assert [root.crossing for root in found] == crossing
    # A triple root is known to the cube root of the rounding.
    np.testing.assert_allclose([root.value for root in found], values, atol=2e-5)
    for root in found:
        assert root.bracket[0] < root.value < root.bracket[1]
        assert root.resolved == (row[:2] in ([2.0, 1.0], [0.0, 0.0]) and root.value in (-2.0, -1.0))


def test_cancellation_in_the_constant_counts() -> None:
    """x² + (1 - (1 + e)) has its constant only to the rounding of 1: a root pair below that is not resolved."""
    tiny = -(2.0**-53)
    assert all(root.resolved for root in real_roots([tiny, 0.0, 1.0]))
    assert [root.resolved for root in real_roots([tiny, 0.0, 1.0], magnitudes=[2.0, 0.0, 1.0])] == [False]


def test_sign_across() -> None:
    assert sign_across([-1.0, 1.0], (2.0, 3.0)) == 1
    assert sign_across([-1.0, 1.0], (-2.0, 0.5)) == -1
    assert sign_across([-1.0, 1.0], (0.5, 2.0)) == 0
    assert sign_across([0.0, 0.0], (1.0, 2.0)) == 0


def test_roots_beyond_any_angle_are_not_sought() -> None:
    assert real_roots([1.0, -1e-9]) == ()  # at 1e9, the end of the search
    (near,) = real_roots([1.0, -1.0, 1e-200])  # the other one is at 1e200
    assert near.value == pytest.approx(1.0, rel=1e-15)


def test_refusals() -> None:
    with pytest.raises(RefusedError, match="within rounding"):
        real_roots([0.0, 0.0, 1e-200], magnitudes=[1.0, 0.0, 1e-200])
    with pytest.raises(RefusedError, match="zero everywhere"):
        real_roots([0.0, 0.0])
    with pytest.raises(RefusedError, match="overflows"):
        real_roots([1.0, 0.0, 1.7e308, 1.7e308])
