"""Intervals by gradient are stated only where a point follows its gradient as far as the errors reach."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from finback.arrays import FloatArray
from finback.dynamics.fold import folds
from finback.dynamics.hopf import hopf_points
from finback.dynamics.lienard import NORMAL_95, LienardSystem
from finback.dynamics.linearity import BENT

Build = Callable[..., LienardSystem]

# θ of the systems here: damping 1 and x², force 1 to x³, gain.
DAMPING, FORCE = 3, 4
SHARP = 1e-3  # nothing is judged so near to the limit: rounding decides there


def one_uncertain(place: int, deviation: float) -> FloatArray:
    covariance = np.zeros((DAMPING + FORCE + 1,) * 2)
    covariance[place, place] = deviation**2
    return covariance


def stated(interval: FloatArray) -> bool:
    return bool(np.isfinite(interval).all())


@given(deviation=st.floats(min_value=1e-6, max_value=0.5), cubic=st.floats(min_value=0.3, max_value=3.0))
def test_folds_are_stated_where_the_profile_is_straight(build_system: Build, deviation: float, cubic: float) -> None:
    """Of g = x − c x³ the folds lie at x = ±1/√(3 c), elevator ∓⅔ x: monotone in c, so the profile is exact."""
    spread = deviation * cubic
    system = build_system([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0, -cubic], covariance=one_uncertain(6, spread))
    ends = [cubic + sign * NORMAL_95 * spread for sign in (-1.0, 1.0)]
    angle = 1.0 / np.sqrt(3.0 * cubic)
    half = NORMAL_95 * deviation * angle / 2.0
    exact = [1.0 / np.sqrt(3.0 * end) if end > 0.0 else np.inf for end in ends]
    bent = max(abs(value - angle - sign * half) for value, sign in zip(exact, (1.0, -1.0), strict=True)) / half
    assume(abs(bent / BENT - 1.0) > SHARP)
    for fold, side in zip(folds(system), (-1.0, 1.0), strict=True):
        for interval in (fold.elevator_interval_rad, fold.alpha_interval_rad, fold.q_interval_rad_s):
            assert stated(interval) == (bent < BENT)
        if bent < BENT:
            np.testing.assert_allclose(fold.alpha_interval_rad, side * angle + half * np.array([-1.0, 1.0]), rtol=1e-9)


def test_a_fold_that_the_errors_let_vanish_is_not_determined(build_system: Build) -> None:
    """b₁ may change its sign within its errors; the elevator itself, of a large error of b₀, would look linear."""
    covariance = one_uncertain(4, 0.6) + one_uncertain(3, 100.0)
    system = build_system([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0, -1.0], covariance=covariance)
    assert folds(system)
    assert not any(stated(fold.elevator_interval_rad) for fold in folds(system))
    sharp = build_system([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0, -1.0], covariance=1e-6 * covariance)
    assert all(stated(fold.elevator_interval_rad) for fold in folds(sharp))


@pytest.mark.parametrize(("deviation", "straight"), [(0.02, True), (0.3, False)])
def test_hopf_points_are_stated_where_the_profile_is_straight(
    build_system: Build, deviation: float, *, straight: bool
) -> None:
    """Of f = −0.1 + c x² with c = 1 the zeros are x = ±√(0.1 / c), bent by 0.75 · 1.96 · deviation to second order."""
    system = build_system([-0.1, 0.0, 1.0], [0.0, -1.0, 0.0, 0.0], covariance=one_uncertain(2, deviation), gain=1.0)
    points = hopf_points(system)
    assert len(points) == 2
    for point in points:
        for interval in (point.alpha_interval_rad, point.elevator_interval_rad, point.lyapunov_interval_1_s):
            assert stated(interval) == straight


def test_an_exact_system_is_exact(build_system: Build) -> None:
    for fold in folds(build_system([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0, -1.0])):
        assert fold.elevator_interval_rad.tolist() == [fold.elevator_rad] * 2
