"""Melnikov estimates of loops: closed forms, limits, printed values, and where they say that they mislead."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import quad

from finback.dynamics.first_order.abelian import RingKind, level_integrals, rings
from finback.dynamics.first_order.saddles import (
    closed_loop_moments,
    k_sc,
    loop_estimate,
    loop_moments,
    neutral_loop_b0,
    slope_at_loop,
    vanishing_loop_b0,
)
from finback.dynamics.first_order.wells import LargeLoop, closed_well_moments, well_loops_estimate
from finback.dynamics.normal_form.cubic import Cubic
from finback.errors import InputError, RefusedError

_CLOSED = 1e-12  # what the closed forms keep up to |b1| = 2


# --- between saddles -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("b1", "P", "Q"),
    [
        (0.5, 0.071663020072, 0.095769140860),
        (1.0, 0.071018940481, 0.057399694385),
        (2.0, 0.054478670148, 0.025025364178),
    ],
)
def test_loop_moments_to_their_printed_digits(b1: float, P: float, Q: float) -> None:
    """Independent values: closed form against quadrature to 40 digits."""
    for moments in (closed_loop_moments(b1), loop_moments(b1)):
        np.testing.assert_allclose(moments, (P, Q), rtol=0, atol=5e-13)


@settings(deadline=None)
@given(st.floats(-2.0, 2.0))
def test_closed_form_and_quadrature_agree(b1: float) -> None:
    np.testing.assert_allclose(closed_loop_moments(b1), loop_moments(b1), rtol=0, atol=_CLOSED)


@settings(deadline=None, max_examples=30)
@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_symmetry_of_the_loop(a1: float, b1: float) -> None:
    assert k_sc(a1, b1) == pytest.approx(k_sc(-a1, -b1), abs=_CLOSED)


def test_the_two_saddle_cycle_lies_at_one_fifth() -> None:
    """G&H 1983, section 7.3: mu2 = −mu1/5, whatever a1."""
    for a1 in (-1.0, 0.0, 2.0):
        assert k_sc(a1, 0.0) == pytest.approx(0.2, abs=1e-15)
        assert closed_loop_moments(0.0) == (pytest.approx(0.0, abs=1e-15), pytest.approx(0.2, abs=1e-15))


def test_the_loop_near_the_bogdanov_takens_point() -> None:
    """b1 → ∞: P* → 1/(7 b1), Q* → 1/(7 b1²); the quadrature holds where the closed form has no digit left."""
    for b1 in (1e2, 1e4, 1e6):
        p, q = loop_moments(b1)
        assert p * 7.0 * b1 == pytest.approx(1.0, abs=5.0 / b1**2 + 1e-9)
        assert q * 7.0 * b1 * b1 == pytest.approx(1.0, abs=5.0 / b1**2 + 1e-9)


def test_the_loop_by_adaptive_quadrature() -> None:
    """Third road: y² = z⁴/2 + 2 b1 z³/3 − z² + 2 H* between the turning point and the saddle (Eq. 24)."""
    b1 = 0.75
    z = 0.5 * (-b1 + math.sqrt(b1 * b1 + 4.0))
    height = z * z - 0.5 * z**4 - 2.0 / 3.0 * b1 * z**3
    roots = np.roots([0.5, 2.0 / 3.0 * b1, -1.0, 0.0, height])
    turn = max(root.real for root in roots if root.real < 0.0)

    def moment(k: int) -> float:
        def integrand(x: float) -> float:
            return x**k * math.sqrt(max(0.5 * x**4 + 2.0 / 3.0 * b1 * x**3 - x * x + height, 0.0))

        return float(quad(integrand, turn, z, epsabs=1e-13, epsrel=1e-12, limit=400)[0])

    assert loop_moments(b1) == (
        pytest.approx(moment(1) / moment(0), abs=1e-7),  # the double root at the saddle is split by rounding
        pytest.approx(moment(2) / moment(0), abs=1e-7),
    )


@pytest.mark.parametrize(
    ("a1", "b1", "b0", "value", "true"),
    [
        (0.5, 0.5, -1.0, 0.0599376308, 0.0594558236872),
        (1.0, 0.75, -1.0, 1.08920469e-4, 4.34108613069e-4),
        (0.0, 0.0, -0.25, 0.05, 0.0500753647784),
    ],
)
def test_the_loop_of_the_paper_to_first_order(a1: float, b1: float, b0: float, value: float, true: float) -> None:
    estimate = loop_estimate(Cubic(a1=a1, a0=0.0, b1=b1, b0=b0))
    assert estimate.value == pytest.approx(value, abs=5e-11)
    assert estimate.value == pytest.approx(-k_sc(a1 / math.sqrt(-b0), b1 / math.sqrt(-b0)) * b0, rel=1e-11)
    assert abs(estimate.value - true) < 2e-3 * b0 * b0  # what O(eps^4) means here
    assert abs(estimate.value - true) > 1e-6  # and it is no exact value


def test_estimates_say_where_they_mislead() -> None:
    assert loop_estimate(Cubic(a1=0.3, a0=0.0, b1=0.5, b0=-0.25)).caution == ""
    assert "no relative accuracy" in loop_estimate(Cubic(a1=1.0, a0=0.0, b1=0.75, b0=-1.0)).caution
    assert "not small" in loop_estimate(Cubic(a1=1.0, a0=0.0, b1=0.75, b0=-4.0)).caution
    for b1 in (0.0, -0.0111561592):  # where the loop is homoclinic, and where the two-saddle cycle really is
        assert "splits" in loop_estimate(Cubic(a1=0.3, a0=0.0, b1=b1, b0=-0.49)).caution
    assert loop_estimate(Cubic(a1=0.0, a0=0.0, b1=0.0, b0=-0.49)).caution == ""
    assert loop_estimate(Cubic(a1=0.3, a0=0.0, b1=0.5, b0=-0.25)).order.startswith("O(eps^4)")


def test_the_slope_at_the_loop_to_its_printed_digits() -> None:
    scaled = [b1 * slope_at_loop(b1) for b1 in (0.1, 0.5, 1.0, 2.0, 5.0)]
    np.testing.assert_allclose(scaled, (0.0817, 0.3623, 0.5933, 0.8148, 0.9596), rtol=0, atol=6e-5)
    assert slope_at_loop(1e-9) == pytest.approx(0.8, abs=1e-6)
    assert slope_at_loop(-0.5) == pytest.approx(-slope_at_loop(0.5), abs=_CLOSED)


def test_where_the_fold_meets_the_loop() -> None:
    """b_d at (0.5, 0.5): −0.54665944 to first order, −0.54630081 in truth; at (2, 0.4) first order is useless."""
    estimate = neutral_loop_b0(0.5, 0.5)
    assert estimate.value == pytest.approx(-0.54665944, abs=5e-9)
    assert estimate.value == pytest.approx(-0.54630081, abs=1e-3)
    assert estimate.caution == ""
    assert neutral_loop_b0(2.0, 0.4).caution != ""


@settings(deadline=None, max_examples=30)
@given(st.floats(0.05, 3.0), st.floats(0.05, 3.0))
def test_the_order_of_the_three_special_values(a1: float, b1: float) -> None:
    """b_d < b_x < −a1 b1; at b_d the saddle of the loop is neutral, at b_x the loop has a0 = 0."""
    neutral, vanishing = neutral_loop_b0(a1, b1).value, vanishing_loop_b0(a1, b1).value
    assert neutral < vanishing < -a1 * b1
    assert neutral_loop_b0(-a1, -b1).value == pytest.approx(neutral, rel=1e-12)
    at = Cubic(a1=a1, a0=0.0, b1=b1, b0=neutral)
    saddle = rings(at)[0].right
    damping = loop_estimate(at).value + a1 * saddle - saddle * saddle
    assert damping == pytest.approx(0.0, abs=1e-9 * max(1.0, -neutral))
    assert loop_estimate(Cubic(a1=a1, a0=0.0, b1=b1, b0=vanishing)).value == pytest.approx(0.0, abs=1e-10)


def test_without_a_positive_product_there_is_no_fold() -> None:
    for function in (neutral_loop_b0, vanishing_loop_b0):
        for a1, b1 in ((0.5, -0.5), (0.0, 0.5), (0.5, 0.0), (math.nan, 1.0)):
            with pytest.raises(InputError, match="no positive product"):
                function(a1, b1)
    with pytest.raises(RefusedError, match="double precision"):
        neutral_loop_b0(1e-30, 1.0)
    with pytest.raises(RefusedError, match="normal form"):
        loop_estimate(Cubic(a1=0.5, a0=0.0, b1=0.5, b0=0.01))


# --- wells -----------------------------------------------------------------------------------------------------------


@settings(deadline=None)
@given(st.floats(-2.0, 2.0))
def test_the_small_loops_in_closed_form(b1: float) -> None:
    left, right, _ = rings(Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=b1, b0=1.0))
    for ring, closed in ((right, closed_well_moments(b1)), (left, closed_well_moments(-b1))):
        on = level_integrals(ring, ring.top)
        x = ring.origin
        first, second = x + on.P, x * x + 2.0 * x * on.P + on.Q
        sign = 1.0 if ring.kind is RingKind.RIGHT_WELL else -1.0
        np.testing.assert_allclose((sign * first, second), closed, rtol=0, atol=1e-11)


def test_the_symmetric_small_loops() -> None:
    """Both at 4/5, and I1/I0 = 3√2 π/16."""
    first, second = closed_well_moments(0.0)
    assert first == pytest.approx(3.0 * math.sqrt(2.0) * math.pi / 16.0, abs=1e-15)
    assert first == pytest.approx(0.8330405509, abs=5e-11)
    assert second == pytest.approx(0.8, abs=1e-15)
    found = well_loops_estimate(Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=0.0, b0=1.0))
    values = (found.left.value, found.right.value, found.large.value)
    np.testing.assert_allclose(values, 0.8, rtol=0, atol=1e-14)
    assert found.direction is LargeLoop.BOTH
    skew = well_loops_estimate(Cubic(b2=-1.0, a1=0.3, a0=0.0, b1=0.0, b0=1.0))
    assert skew.right.value == pytest.approx(0.8 - 0.3 * 0.8330405509, abs=1e-10)
    assert skew.left.value == pytest.approx(0.8 + 0.3 * 0.8330405509, abs=1e-10)


def test_the_three_loops_of_set_c() -> None:
    """(0.3, 0.2): k_8 = 0.7700403505; true loops at b0 = 1: 0.900526573169, 0.708497480248, 0.769240611445."""
    found = well_loops_estimate(Cubic(b2=-1.0, a1=0.3, a0=0.0, b1=0.2, b0=1.0))
    assert found.large.value == pytest.approx(0.7700403505, abs=5e-11)
    assert found.left.value == pytest.approx(0.900526573169, abs=0.02)
    assert found.right.value == pytest.approx(0.708497480248, abs=0.02)
    assert found.direction is LargeLoop.LEAVES_RIGHT
    mirrored = well_loops_estimate(Cubic(b2=-1.0, a1=-0.3, a0=0.0, b1=-0.2, b0=1.0))
    assert mirrored.direction is LargeLoop.LEAVES_LEFT
    assert mirrored.left.value == pytest.approx(found.right.value, abs=1e-14)
    sizes = [
        level_integrals(ring, ring.top if ring.kind is not RingKind.OUTER else 0.0).integrals[0]
        for ring in rings(Cubic(b2=-1.0, a1=0.3, a0=0.0, b1=0.2, b0=1.0))
    ]
    mixed = (found.left.value * sizes[0] + found.right.value * sizes[1]) / (sizes[0] + sizes[1])
    assert found.large.value == pytest.approx(mixed, abs=1e-14)


def test_the_large_loop_is_off_by_eps_ln_eps() -> None:
    """True a0/b0 at eps = 0.1 and 1e-4: 0.7602027 and 0.7700058; between them the error falls as eps ln(1/eps)."""
    errors = {}
    for eps, true in ((0.1, 0.7602027), (1e-4, 0.7700058)):
        cubic = Cubic(b2=-1.0, a1=0.3 * eps, a0=0.0, b1=0.2 * eps, b0=eps * eps)
        large = well_loops_estimate(cubic).large
        assert "ln eps" in large.order
        assert "ln eps" in large.caution
        errors[eps] = abs(large.value / (eps * eps) - true) / (eps * math.log(1.0 / eps))
    assert errors[0.1] == pytest.approx(errors[1e-4], rel=0.2)
    assert well_loops_estimate(Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=0.0, b0=0.1)).large.caution == ""


def test_wells_are_needed() -> None:
    for cubic in (
        Cubic(a1=0.0, a0=0.0, b1=0.0, b0=-1.0),
        Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=0.0, b0=-1.0),
        Cubic(b2=-2.0, a1=0.0, a0=0.0, b1=0.0, b0=1.0),
    ):
        with pytest.raises(RefusedError, match="no saddle between two wells"):
            well_loops_estimate(cubic)
