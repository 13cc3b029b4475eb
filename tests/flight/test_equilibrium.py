"""Equilibria and folds of fields whose equilibria are known in closed form, and of the simulator."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.errors import InputError, RefusedError
from finback.flight.equilibrium import equilibria, equilibrium_curve, trim
from finback.flight.rig import Rig
from finback.units import from_si

RESIDUAL = 1e-10  # rad/s and rad/s²: what an equilibrium of the simulator may leave
CURVE_RESIDUAL = 2e-9  # the same for a point of the curve: 1e-10 of the typical rates, which are up to 20
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


STEP = 0.01
WIDE = (-0.2, 0.2)


def test_the_folds_of_a_smooth_curve_are_exact() -> None:
    curve, (low, high) = equilibrium_curve(cubic, alpha_limits_rad=LIMITS, elevator_limits_rad=WIDE, step_rad=STEP)
    for fold, sign in ((low, -1), (high, 1)):
        assert fold.alpha_rad == pytest.approx(sign * FOLD_ALPHA, abs=1e-9)
        assert fold.elevator_rad == pytest.approx(-sign * FOLD_ELEVATOR, abs=1e-14)
        assert fold.q_rad_s == pytest.approx(0.3 * fold.alpha_rad / 0.98, abs=1e-9)
        assert fold.alpha_rad in curve.alpha_rad
    # a residual of 1e-10 of the typical rates, over the elevator's gain
    np.testing.assert_allclose(curve.elevator_rad, curve.alpha_rad**3 - 0.03 * curve.alpha_rad, atol=1e-9)
    assert curve.alpha_rad[[0, -1]] == pytest.approx(LIMITS, abs=1e-12)
    assert (np.diff(curve.alpha_rad) > 0.0).all()
    assert np.diff(curve.alpha_rad).max() <= STEP
    apart = np.abs(np.abs(curve.alpha_rad) - FOLD_ALPHA) > 1e-6  # the folds are points of the curve
    assert (curve.stable == (np.abs(curve.alpha_rad) > FOLD_ALPHA))[apart].all()


def test_the_folds_of_a_table_are_its_corners() -> None:
    knots = np.linspace(-0.5, 0.5, 42)
    held = knots**3 - 0.03 * knots
    inner = np.abs(knots) < 0.2
    _, (low, high) = equilibrium_curve(tabulated, alpha_limits_rad=LIMITS, elevator_limits_rad=WIDE, step_rad=STEP)
    assert low.alpha_rad == pytest.approx(knots[inner][np.argmax(held[inner])], abs=1e-9)
    assert high.alpha_rad == pytest.approx(knots[inner][np.argmin(held[inner])], abs=1e-9)
    assert low.elevator_rad == pytest.approx(held[inner].max(), abs=1e-12)


def test_alphas_that_no_elevator_holds_are_left_out() -> None:
    """Beyond the limit at both ends, and between two branches that are no longer connected."""
    most = 0.001
    curve, folds = equilibrium_curve(cubic, alpha_limits_rad=LIMITS, elevator_limits_rad=(-most, most), step_rad=STEP)
    assert folds == ()
    assert (np.abs(curve.elevator_rad) <= most + 1e-15).all()
    gaps = np.flatnonzero(np.diff(curve.alpha_rad) > STEP)
    ends = [curve.alpha_rad[0], *(x for k in gaps for x in curve.alpha_rad[k : k + 2]), curve.alpha_rad[-1]]
    exact = np.sort(np.concatenate([np.roots([1.0, 0.0, -0.03, -limit]).real for limit in (-most, most)]))
    np.testing.assert_allclose(ends, exact, atol=1e-9)


def test_nothing_is_held_where_no_elevator_is_enough() -> None:
    curve, folds = equilibrium_curve(cubic, alpha_limits_rad=(0.4, 0.5), elevator_limits_rad=(-0.01, 0.01))
    assert curve.alpha_rad.size == curve.elevator_rad.size == curve.stable.size == 0
    assert folds == ()


def test_a_curve_without_extremum_has_no_fold() -> None:
    assert equilibrium_curve(cubic, alpha_limits_rad=(0.15, 0.5), elevator_limits_rad=WIDE)[1] == ()


def test_limits_out_of_order_are_a_mistake() -> None:
    with pytest.raises(InputError, match="no curve over alpha"):
        equilibria(cubic, elevator_rad=0.0, alpha_limits_rad=(0.5, -0.5))


def test_an_alpha_dot_that_no_q_balances_is_refused() -> None:
    def bounded(alpha: float, q: float, elevator: float) -> tuple[float, float]:
        return math.tanh(q) - 3.0 * alpha, elevator - alpha - q

    assert len(equilibria(bounded, elevator_rad=0.0, alpha_limits_rad=(-0.2, 0.2))) == 1
    with pytest.raises(RefusedError, match="alpha_dot = 0 has no solution for q beyond alpha"):
        equilibria(bounded, elevator_rad=0.0, alpha_limits_rad=(-0.2, 0.5))
    with pytest.raises(RefusedError, match="do not vanish"):
        equilibria(bounded, elevator_rad=0.0, alpha_limits_rad=(-0.5, 0.5))


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
    curve, folds = equilibrium_curve(field, alpha_limits_rad=(-0.4, 0.6), elevator_limits_rad=limits)
    assert len(folds) == 2
    for fold, inside in zip(folds, (-1.0, 1.0), strict=True):
        counts = [
            len(equilibria(field, elevator_rad=fold.elevator_rad + sign * inside * 1e-7, alpha_limits_rad=(-0.5, 0.7)))
            for sign in (1, -1)
        ]
        assert counts == [counts[1] + 2, counts[1]]
    for alpha, elevator, q in zip(curve.alpha_rad[::50], curve.elevator_rad[::50], curve.q_rad_s[::50], strict=True):
        assert max(map(abs, field(alpha, q, elevator))) <= CURVE_RESIDUAL


def test_the_folds_of_the_f8ii_table_are_its_corners(f8ii_rig: Rig) -> None:
    """Reference: golden section over elevator(alpha), each solved by bisection, as this was done before."""
    _, folds = equilibrium_curve(f8ii_rig.derivatives, alpha_limits_rad=(-0.59, 0.8), elevator_limits_rad=(-2.8, 2.4))
    for fold, elevator, alpha in zip(folds, (14.725038720404, -35.129218793808), (-13.5, 24.8), strict=True):
        assert from_si(fold.elevator_rad, "deg") == pytest.approx(elevator, abs=1e-9)
        assert from_si(fold.alpha_rad, "deg") == pytest.approx(alpha, abs=1e-7)
