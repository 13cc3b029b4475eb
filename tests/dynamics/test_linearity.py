"""Intervals by gradient are stated only where a point follows its gradient as far as the errors reach."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from finback.arrays import FloatArray
from finback.dynamics.fold import folds
from finback.dynamics.hopf import hopf_points
from finback.dynamics.lienard import NORMAL_95, LienardSystem
from finback.dynamics.linearity import BENT
from finback.dynamics.planar.branch import PlanarBranches, planar_branches
from finback.dynamics.planar.equilibrium import planar_equilibria
from finback.dynamics.planar.fold import PlanarFold, following
from finback.dynamics.planar.hopf import PlanarHopf, followed_hopf
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.planar.tracked import Mark, MovedField, tracked
from finback.dynamics.polynomial import Polynomial

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


# planar fields: the same points of the same systems, found and judged by another road

BOX = np.array([[-3.0, 3.0], [-3.0, 3.0]])
PARAMETERS = (-1.2, 1.2)
SAME = 1e-6  # Newton's method on both roads


def branches(system: PlanarSystem) -> PlanarBranches:
    starts = [p for mu in np.linspace(*PARAMETERS, 5).tolist() for p in planar_equilibria(system, mu)]
    return planar_branches(system, PARAMETERS, BOX, starts)


@pytest.mark.parametrize("deviation", [0.02, 0.1, 0.14, 0.3, 0.6])
def test_a_planar_fold_is_stated_where_the_same_one_of_a_lienard_system_is(
    build_system: Build, deviation: float
) -> None:
    system = build_system([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0, -1.0], covariance=one_uncertain(6, deviation))
    planar = sorted(branches(PlanarSystem.from_lienard(system)).folds, key=lambda fold: fold.state[0])
    assert len(planar) == 2
    for one, other in zip(folds(system), planar, strict=True):
        assert stated(one.elevator_interval_rad) == stated(other.parameter_interval) == (deviation < 0.12)
        assert stated(one.alpha_interval_rad) == stated(other.state_interval[0])
        if stated(one.elevator_interval_rad):
            np.testing.assert_allclose(other.parameter_interval, one.elevator_interval_rad, rtol=SAME)


@pytest.mark.parametrize("deviation", [0.02, 0.3])
def test_a_planar_hopf_point_is_stated_where_the_same_one_of_a_lienard_system_is(
    build_system: Build, deviation: float
) -> None:
    system = build_system([-0.1, 0.0, 1.0], [0.0, -1.0, 0.0, 0.0], covariance=one_uncertain(2, deviation), gain=1.0)
    planar = sorted(branches(PlanarSystem.from_lienard(system)).hopf_points, key=lambda point: point.state[0])
    assert len(planar) == 2
    for one, other in zip(hopf_points(system), planar, strict=True):
        assert stated(one.elevator_interval_rad) == stated(other.parameter_interval) == (deviation < 0.1)
        assert stated(one.lyapunov_interval_1_s) == stated(other.lyapunov_interval)
        # In (alpha, dα/dt) the frequency of this system depends on the force alone, which is known.
        assert stated(other.frequency_interval) == (deviation < 0.1)


# x' = y + 0.3 x y + 0.1 μ, y' = b − 1.6 y + c x y + x − d x³ + μ + 0.2 y² + e μ x: no Liénard form holds it
NAMES = ("x_1", "y_1", "mu_1")
FIRST = {(0, 1, 0): 1.0, (1, 1, 0): 0.3, (0, 0, 1): 0.1}
SECOND = {
    (0, 0, 0): 0.02,
    (0, 1, 0): -1.6,
    (1, 1, 0): 2.0,
    (1, 0, 0): 1.0,
    (3, 0, 0): -1.0,
    (0, 0, 1): 1.0,
    (0, 2, 0): 0.2,
    (1, 0, 1): 0.15,
}


def field(relative: float, coefficients: FloatArray | None = None) -> PlanarSystem:
    one, two = (Polynomial.build(terms, variables=NAMES, value_unit="1") for terms in (FIRST, SECOND))
    values = np.concatenate([one.coefficients, two.coefficients])
    made = PlanarSystem.from_polynomials(one, two, covariance=np.diag((relative * values) ** 2))
    return made if coefficients is None else made.with_coefficients(coefficients)


def nearest(points: Sequence[PlanarFold | PlanarHopf], like: PlanarFold | PlanarHopf) -> FloatArray:
    one = min(points, key=lambda point: abs(point.state[0] - like.state[0]))
    return np.array([*one.state, one.parameter])


def test_points_are_followed_to_where_the_changed_field_has_them() -> None:
    """Newton's method along the change of all coefficients, against the branches of the changed field itself."""
    here, generator = field(0.0), np.random.default_rng(5)
    values = np.concatenate([here.first.polynomial.coefficients, here.second.polynomial.coefficients])
    changes = 0.04 * values * generator.standard_normal((6, values.size))
    found = branches(here)
    (hopf,) = found.hopf_points
    again = [branches(field(0.0, values + change)) for change in changes]
    moved = MovedField(here, changes)
    assert len(found.folds) == 2
    for fold in found.folds:
        at = (float(fold.state[0]), float(fold.state[1]), fold.parameter)
        right = np.array([nearest(one.folds, fold) for one in again])
        np.testing.assert_allclose(following(here, at, Mark.FOLD)(changes), right, rtol=SAME, atol=SAME)
    at = (float(hopf.state[0]), float(hopf.state[1]), hopf.parameter)
    right = np.array([[*nearest(one.hopf_points, hopf), one.hopf_points[0].frequency] for one in again])
    np.testing.assert_allclose(followed_hopf(moved, at)[:, :4], right, rtol=SAME, atol=SAME)
    lyapunov = [one.hopf_points[0].lyapunov for one in again]
    np.testing.assert_allclose(followed_hopf(moved, at)[:, 4], lyapunov, rtol=1e-4)


def test_a_point_that_vanishes_on_the_way_is_not_followed() -> None:
    """Without the cubic term there is one fold only, and with the other sign of the linear one none."""
    here = field(0.0)
    values = np.concatenate([here.first.polynomial.coefficients, here.second.polynomial.coefficients])
    places = [len(FIRST) + list(SECOND).index(key) for key in ((1, 0, 0), (3, 0, 0))]
    changes = np.zeros((2, values.size))
    changes[0, places[0]] = -3.0  # y' = … − 2 x − x³
    changes[1, places[0]] = -0.3
    for fold in branches(here).folds:
        at = (float(fold.state[0]), float(fold.state[1]), fold.parameter)
        gone, there = tracked(MovedField(here, changes), at, Mark.FOLD)
        assert np.isnan(gone).all()
        assert np.isfinite(there).all()


def test_a_planar_fold_that_the_errors_let_vanish_is_not_determined() -> None:
    for fold in branches(field(0.4)).folds:
        assert not stated(fold.parameter_interval)
    for fold in branches(field(0.01)).folds:
        assert stated(fold.parameter_interval)
        assert stated(fold.state_interval)
