"""First-order estimates against the exact loops: how far they are off, and that they say so."""

from __future__ import annotations

import numpy as np
import pytest

from finback.dynamics.connection.loop import Loop, LoopKind, loops
from finback.dynamics.first_order.saddles import loop_estimate, neutral_loop_b0
from finback.dynamics.first_order.wells import well_loops_estimate
from finback.dynamics.normal_form.bogdanov_takens import Unfolding, homoclinic_estimate
from finback.dynamics.normal_form.cubic import Cubic
from finback.dynamics.normal_form.cubic_region import Region, exact_curves, first_order_curves, region
from finback.errors import RefusedError


def _homoclinic(found: tuple[Loop, ...], turns: int = 1) -> list[Loop]:
    return [loop for loop in found if loop.kind is LoopKind.HOMOCLINIC and loop.turns.size == turns]


@pytest.mark.parametrize(("a1", "b1"), [(0.5, 0.5), (1.0, 0.75), (-0.7, 1.2)])
def test_the_loop_between_saddles_is_off_by_eps_squared(a1: float, b1: float) -> None:
    errors = []
    for eps in (0.4, 0.2, 0.1):
        cubic = Cubic(a1=eps * a1, a0=0.0, b1=eps * b1, b0=-eps * eps)
        (loop,) = _homoclinic(loops(cubic.family(), cubic.b0))
        errors.append(abs(loop_estimate(cubic).value - loop.lam) / eps**4)
    assert errors[0] > 0.0
    np.testing.assert_allclose(errors, errors[-1], rtol=0.1)


def test_the_small_loops_of_the_wells_are_off_by_eps_squared_and_the_large_one_by_more() -> None:
    small, large = [], []
    for eps in (0.2, 0.1, 0.05):
        cubic = Cubic(b2=-1.0, a1=0.3 * eps, a0=0.0, b1=0.2 * eps, b0=eps * eps)
        estimate, found = well_loops_estimate(cubic), loops(cubic.family(), cubic.b0)
        exact = sorted(loop.lam for loop in _homoclinic(found))
        small.append(abs(estimate.right.value - exact[0]) / eps**4)
        assert estimate.left.value == pytest.approx(exact[1], abs=eps**4)
        (around,) = _homoclinic(found, turns=2)
        assert (around.turns[0] > 0.0) == (estimate.direction == "leaves-right")
        large.append(abs(estimate.large.value - around.lam) / eps**2)
    np.testing.assert_allclose(small, small[-1], rtol=0.2)
    assert large[-1] > 0.4 * large[0]  # hardly smaller for a quarter of the eps: no eps squared


def test_the_neutral_loop() -> None:
    """At the true b_d the saddle of the true loop is neutral: −0.54630081 against −0.54665944 to first order."""
    traces = []
    for b0 in (-0.54630081 - 1e-6, -0.54630081 + 1e-6):
        cubic = Cubic(a1=0.5, a0=0.0, b1=0.5, b0=b0)
        (loop,) = _homoclinic(loops(cubic.family(), b0))
        traces.append(loop.saddle_trace)
    assert traces[0] < 0.0 < traces[1]
    assert neutral_loop_b0(0.5, 0.5).value == pytest.approx(-0.54630081, rel=1e-3)


@pytest.mark.parametrize(("a", "b"), [(1.0, 1.0), (2.0, -0.7), (-1.0, 0.5)])
def test_the_unfolding_and_its_loop(a: float, b: float) -> None:
    """Any signs of a and b, reversal of time included."""
    errors = []
    for size in (1e-2, 1e-2 / 16.0):
        scaled = size * a**3 / b**4
        system = Unfolding(mu1=-scaled, mu2=0.0, a=a, b=b)
        (loop,) = _homoclinic(loops(system.family(), system.mu1))
        errors.append(abs(homoclinic_estimate(system).value - loop.lam) * abs(b / a))
    assert errors[0] < 1e-6
    assert 45.0 < errors[0] / errors[1] < 75.0  # eps to the sixth, for half the eps


def test_regions_by_shooting() -> None:
    """Set H with its fold, set A without, the two-saddle cycle of set K, and the homoclinic loop at b1 = 0 ≠ a1."""
    cubic = Cubic(a1=1.0, a0=3e-4, b1=0.75, b0=-1.0)
    curves = exact_curves(cubic, folds=(0.00533818018161,))
    assert curves.loop == pytest.approx(4.34108613069e-4, abs=1e-12)
    assert exact_curves(cubic).folds == pytest.approx(curves.folds, abs=1e-12)  # found by itself
    assert region(cubic, curves).region is Region.III
    # First order puts the same system, above its loop at 1.09e-4, into region II.
    assert region(cubic, first_order_curves(cubic)).region is Region.II
    assert exact_curves(Cubic(a1=0.5, a0=0.0, b1=0.5, b0=-1.0), folds=()).loop == pytest.approx(
        0.0594558236872, abs=1e-12
    )
    assert exact_curves(Cubic(a1=0.0, a0=0.0, b1=0.0, b0=-0.25), folds=()).loop == pytest.approx(
        0.0500753647784, abs=1e-12
    )
    between = exact_curves(Cubic(a1=0.3, a0=0.0, b1=0.0, b0=-0.49), folds=()).loop
    assert 0.0899484180 < between < 0.1062696062  # the two halves of the cycle that has split
    with pytest.raises(RefusedError, match="normal form"):
        exact_curves(Cubic(a1=0.3, a0=0.0, b1=0.0, b0=0.49), folds=())
