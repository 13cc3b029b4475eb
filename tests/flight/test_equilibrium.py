"""Equilibria and folds of fields whose equilibria are known in closed form, and of the simulator."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.errors import RefusedError
from finback.flight.equilibrium import curve_folds, equilibria, equilibrium_curve, trim
from finback.flight.rig import Rig

RESIDUAL = 1e-10  # rad/s and rad/s²: what an equilibrium of the simulator may leave
LIMITS = (-0.5, 0.5)
GAIN = 5.0


def cubic(alpha: float, q: float, elevator: float) -> tuple[float, float]:
    """alpha_dot = 0.98 q - 0.3 alpha; the equilibria hold alpha³ - 0.03 alpha = elevator."""
    balance = 0.3 * alpha / 0.98
    return 0.98 * q - 0.3 * alpha, GAIN * (elevator - alpha**3 + 0.03 * alpha) - 2.0 * (q - balance)


FOLD_ALPHA = 0.1  # where 3 alpha² = 0.03
FOLD_ELEVATOR = 0.03 * 0.1 - 0.1**3


def tabulated(alpha: float, q: float, elevator: float) -> tuple[float, float]:
    """The same with elevator(alpha) interpolated between knots, as a table does."""
    knots = np.linspace(-0.5, 0.5, 42)
    held = float(np.interp(alpha, knots, knots**3 - 0.03 * knots))
    return q - 0.3 * alpha, GAIN * (elevator - held) - 2.0 * (q - 0.3 * alpha)


@given(st.floats(-0.003, 0.003))
@settings(max_examples=40, deadline=None)
def test_all_equilibria_are_found_and_are_roots_of_the_cubic(elevator: float) -> None:
    found = equilibria(cubic, elevator_rad=elevator, alpha_limits_rad=LIMITS)
    roots = np.roots([1.0, 0.0, -0.03, -elevator])
    real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
    if abs(abs(elevator) - FOLD_ELEVATOR) < 1e-9:
        return  # within rounding of a fold the number of roots is nobody's to say
    assert len(found) == len(real)
    slope = 3 * real**2 - 0.03
    for equilibrium, root, rise in zip(found, real, slope, strict=True):
        assert equilibrium.alpha_rad == pytest.approx(root, abs=1e-12 / max(abs(rise), 1e-4))
        assert equilibrium.q_rad_s == pytest.approx(0.3 * equilibrium.alpha_rad / 0.98, abs=1e-12)
        assert equilibrium.residual <= RESIDUAL
        if abs(rise) > 1e-6:
            assert equilibrium.stable == (rise > 0)


def test_two_equilibria_closer_together_than_the_grid_are_both_found() -> None:
    found = equilibria(cubic, elevator_rad=-FOLD_ELEVATOR + 1e-8, alpha_limits_rad=LIMITS, alpha_step_rad=0.03)
    assert len(found) == 3
    assert found[2].alpha_rad - found[1].alpha_rad < 0.001


def test_the_folds_of_a_smooth_curve_are_exact() -> None:
    curve = equilibrium_curve(cubic, np.linspace(*LIMITS, 101), elevator_limits_rad=(-0.2, 0.2))
    low, high = curve_folds(cubic, curve, elevator_limits_rad=(-0.2, 0.2))
    for fold, sign in ((low, -1), (high, 1)):
        assert fold.alpha_rad == pytest.approx(sign * FOLD_ALPHA, abs=1e-9)
        assert fold.elevator_rad == pytest.approx(-sign * FOLD_ELEVATOR, abs=1e-14)
        assert fold.q_rad_s == pytest.approx(0.3 * fold.alpha_rad / 0.98, abs=1e-12)
    np.testing.assert_allclose(curve.elevator_rad, curve.alpha_rad**3 - 0.03 * curve.alpha_rad, atol=1e-14)
    apart = np.abs(np.abs(curve.alpha_rad) - FOLD_ALPHA) > 1e-6  # a point of the grid lies on the fold itself
    assert (curve.stable == (np.abs(curve.alpha_rad) > FOLD_ALPHA))[apart].all()


def test_the_folds_of_a_table_are_its_corners() -> None:
    knots = np.linspace(-0.5, 0.5, 42)
    held = knots**3 - 0.03 * knots
    inner = np.abs(knots) < 0.2
    curve = equilibrium_curve(tabulated, np.linspace(*LIMITS, 173), elevator_limits_rad=(-0.2, 0.2))
    low, high = curve_folds(tabulated, curve, elevator_limits_rad=(-0.2, 0.2))
    assert low.alpha_rad == pytest.approx(knots[inner][np.argmax(held[inner])], abs=1e-9)
    assert high.alpha_rad == pytest.approx(knots[inner][np.argmin(held[inner])], abs=1e-9)
    assert low.elevator_rad == pytest.approx(held[inner].max(), abs=1e-12)


def test_alphas_that_no_elevator_holds_are_left_out() -> None:
    curve = equilibrium_curve(cubic, np.linspace(*LIMITS, 101), elevator_limits_rad=(-0.01, 0.01))
    held = np.linspace(*LIMITS, 101)
    held = held[np.abs(held**3 - 0.03 * held) <= 0.01]
    np.testing.assert_array_equal(curve.alpha_rad, held)


def test_a_curve_without_extremum_has_no_fold() -> None:
    curve = equilibrium_curve(cubic, np.linspace(0.15, 0.5, 50), elevator_limits_rad=(-0.2, 0.2))
    assert curve_folds(cubic, curve, elevator_limits_rad=(-0.2, 0.2)) == ()


def test_trim_is_the_stable_one_nearest_to_zero_or_refused() -> None:
    found = trim(cubic, elevator_rad=0.001, alpha_limits_rad=LIMITS)
    assert found.stable
    assert found.alpha_rad < 0
    with pytest.raises(RefusedError, match="no stable equilibrium"):
        trim(cubic, elevator_rad=0.0, alpha_limits_rad=(-0.05, 0.05))


def test_the_simulator_stays_in_its_equilibria(rig: Rig) -> None:
    for elevator in (-0.2, -0.1, 0.05):
        found = trim(rig.derivatives, elevator_rad=elevator, alpha_limits_rad=(-0.17, 0.7))
        assert found.residual <= RESIDUAL
        alpha_dot, q_dot = rig.derivatives(found.alpha_rad, found.q_rad_s, elevator)
        assert math.hypot(alpha_dot, q_dot) <= 2 * RESIDUAL


def test_the_folds_of_the_f8ii_table_lie_where_its_equilibria_meet(f8ii_rig: Rig) -> None:
    """Two roads: the extremum of elevator(alpha), and counting equilibria on both sides of it."""
    field, limits = f8ii_rig.derivatives, (-0.7, 0.35)
    curve = equilibrium_curve(field, np.linspace(-0.4, 0.6, 120), elevator_limits_rad=limits)
    folds = curve_folds(field, curve, elevator_limits_rad=limits)
    assert len(folds) == 2
    for fold, inside in zip(folds, (-1.0, 1.0), strict=True):
        counts = [
            len(equilibria(field, elevator_rad=fold.elevator_rad + sign * inside * 1e-7, alpha_limits_rad=(-0.5, 0.7)))
            for sign in (1, -1)
        ]
        assert counts == [counts[1] + 2, counts[1]]
