"""Abelian integrals on the level curves, the Picard-Fuchs equations, and what follows to first order."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from finback.dynamics.first_order.abelian import (
    Ring,
    RingKind,
    first_order,
    first_order_slope,
    level_integrals,
    rings,
    turning_points,
)
from finback.dynamics.first_order.abelian_zeros import first_order_cycles, first_order_folds
from finback.dynamics.first_order.picard_fuchs import PicardFuchs
from finback.dynamics.first_order.wells import well_loops_estimate
from finback.dynamics.normal_form.cubic import Cubic
from finback.errors import InputError, RefusedError

_QUADRATURE = 1e-12  # two rules agree to 1e-14 of the curve's width; the comparison is no better
_PRINTED = 1e-9  # independent values are given to nine digits or more

_number = st.floats(-2.0, 2.0).map(lambda value: round(value, 3))
_positive = st.floats(0.1, 4.0).map(lambda value: round(value, 3))


@st.composite
def _hamiltonians(draw: st.DrawFn) -> Cubic:
    """Choose one that has rings: between saddles, double well or single well."""
    b1 = draw(_number)
    kind = draw(st.sampled_from(["saddles", "double", "single"]))
    if kind == "saddles":
        return Cubic(a1=0.0, a0=0.0, b1=b1, b0=-draw(_positive))
    if kind == "double":
        return Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=b1, b0=draw(_positive))
    return Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=b1, b0=-b1 * b1 / 4.0 - draw(_positive))


@st.composite
def _curves(draw: st.DrawFn) -> tuple[Cubic, Ring, float]:
    cubic = draw(_hamiltonians())
    ring = draw(st.sampled_from(rings(cubic)))
    return cubic, ring, draw(st.floats(0.01, 0.95)) * ring.size


# --- the integrals -------------------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=40)
@given(_curves())
def test_integrals_by_motion_along_the_curve(case: tuple[Cubic, Ring, float]) -> None:
    """Three roads: I_k = ∮ u^k y dx = ∮ u^k y² dt over one period of the undamped motion, and T = dI0/ds."""
    cubic, ring, level = case
    on = level_integrals(ring, level)
    period = float(on.slopes[0])
    flow = cubic.flow()

    def field(_: float, s: np.ndarray) -> list[float]:
        u, square = s[0] - ring.origin, s[1] ** 2
        return [s[1], flow.acceleration(s[0], 0.0), square, u * square, u * u * square]

    end = solve_ivp(field, (0.0, period), [on.x_max, 0.0, 0.0, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-14)
    size = on.integrals[0] * max(1.0, on.x_max - on.x_min) ** 2
    # The undamped motion near a saddle makes errors grow.
    np.testing.assert_allclose(end.y[2:, -1], on.integrals, rtol=0, atol=1e-9 * size)
    assert end.y[0, -1] == pytest.approx(on.x_max, abs=1e-7)


@settings(deadline=None, max_examples=40)
@given(_curves())
def test_integrals_by_adaptive_quadrature(case: tuple[Cubic, Ring, float]) -> None:
    cubic, ring, level = case
    on = level_integrals(ring, level)
    low, high = on.x_min - ring.origin, on.x_max - ring.origin
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    for k in range(3):

        def integrand(angle: float, k: int = k) -> float:
            u = middle + half * math.sin(angle)
            speed = math.sqrt(max(2.0 * (level - ring.potential(u)), 0.0))
            return u**k * speed * half * math.cos(angle)

        value, _ = quad(
            integrand, -0.5 * math.pi, 0.5 * math.pi, limit=400, epsabs=1e-10 * on.integrals[0], epsrel=1e-10
        )
        assert on.integrals[k] == pytest.approx(2.0 * value, rel=1e-8, abs=1e-8 * on.integrals[0] * max(1.0, half) ** k)
    assert ring.potential(low) == pytest.approx(level, rel=1e-10)
    assert ring.potential(high) == pytest.approx(level, rel=1e-10)
    assert on.error < _QUADRATURE
    assert cubic.flow().acceleration(on.x_max, 0.0) < 0.0 < cubic.flow().acceleration(on.x_min, 0.0)


@settings(deadline=None, max_examples=40)
@given(_curves())
def test_slopes_by_differences(case: tuple[Cubic, Ring, float]) -> None:
    _, ring, level = case
    step = 1e-3 * min(level, ring.size - level)
    ahead, behind = (level_integrals(ring, level + sign * step).integrals for sign in (1.0, -1.0))
    on = level_integrals(ring, level)
    # Central differences: third derivatives, of logarithms near a loop, times step².
    np.testing.assert_allclose((ahead - behind) / (2.0 * step), on.slopes, rtol=1e-4, atol=1e-4 * on.slopes[0])


@settings(deadline=None, max_examples=40)
@given(_hamiltonians(), _positive, st.floats(0.1, 0.9))
def test_scaling_and_symmetry_of_the_balance(cubic: Cubic, eps: float, share: float) -> None:
    """The exact scaling of Eq. 19, and (x, a1, b1) → −(x, a1, b1)."""
    scaled = Cubic(b2=cubic.b2, a1=0.0, a0=0.0, b1=eps * cubic.b1, b0=eps * eps * cubic.b0)
    mirrored = cubic.mirrored()
    for ring, other, mirror in zip(rings(cubic), rings(scaled), _mirrored_order(rings(mirrored)), strict=True):
        a1 = 0.7
        on = level_integrals(ring, share * ring.size)
        value = first_order(ring, on, a2=-1.0, a1=a1)
        at = first_order(other, level_integrals(other, share * other.size), a2=-1.0, a1=eps * a1)
        assert at == pytest.approx(eps * eps * value, rel=1e-9, abs=1e-10)
        across = first_order(mirror, level_integrals(mirror, share * mirror.size), a2=-1.0, a1=-a1)
        assert across == pytest.approx(value, rel=1e-9, abs=1e-10)


def _mirrored_order(found: tuple[Ring, ...]) -> tuple[Ring, ...]:
    return (found[1], found[0], found[2]) if len(found) == 3 else found


def test_the_two_saddle_cycle_in_closed_form() -> None:
    """For b1 = 0: y = (1 − x²)/√2, so I0 : I1 : I2 = 4/3 : 0 : 4/15."""
    (ring,) = rings(Cubic(a1=0.0, a0=0.0, b1=0.0, b0=-1.0))
    on = level_integrals(ring, ring.top)
    np.testing.assert_allclose(on.integrals, math.sqrt(2.0) * np.array([4.0 / 3.0, 0.0, 4.0 / 15.0]), atol=1e-14)
    assert ring.saddles == (-1.0, 1.0)
    assert ring.top == 0.25


def test_the_limit_at_a_center() -> None:
    """I0 → 2πs/√c, and P, Q start with the slopes of the Picard-Fuchs equations."""
    for cubic in (
        Cubic(a1=0.0, a0=0.0, b1=0.75, b0=-2.0),
        Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=0.3, b0=1.0),
        Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=0.3, b0=-1.0),
    ):
        for ring in rings(cubic):
            if ring.kind is RingKind.OUTER:
                with pytest.raises(RefusedError, match="no center"):
                    PicardFuchs.on(ring).slopes_at_center()
                continue
            level = 1e-7
            on = level_integrals(ring, level)
            assert on.integrals[0] == pytest.approx(2.0 * math.pi * level / math.sqrt(ring.quadratic), rel=1e-6)
            np.testing.assert_allclose((on.P / level, on.Q / level), PicardFuchs.on(ring).slopes_at_center(), rtol=1e-5)


def test_the_integrals_hold_up_to_the_loop() -> None:
    """The square of the speed has a nearly double root there; the values approach the loop's as s ln s."""
    (ring,) = rings(Cubic(a1=0.0, a0=0.0, b1=0.75, b0=-1.0))
    loop = level_integrals(ring, ring.top)
    for gap in (1e-4, 1e-8, 1e-12):
        on = level_integrals(ring, ring.top * (1.0 - gap))
        assert on.error < _QUADRATURE
        np.testing.assert_allclose(on.integrals, loop.integrals, atol=20.0 * gap * abs(math.log(gap)))
        assert np.isfinite(on.slopes).all()
    assert np.isinf(loop.slopes).all()


def test_where_there_is_no_level_curve() -> None:
    (ring,) = rings(Cubic(a1=0.0, a0=0.0, b1=0.75, b0=-1.0))
    for level in (-0.1, 0.0, 1.01 * ring.top, math.inf):
        with pytest.raises(InputError, match="not in the ring"):
            level_integrals(ring, level)
    with pytest.raises(RefusedError, match="no closed level curve") as refused:
        rings(Cubic(a1=0.0, a0=0.0, b1=1.0, b0=0.1))
    assert "centered" in refused.value.hint
    with pytest.raises(RefusedError, match="no closed level curve"):
        rings(Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=1.0, b0=-0.1))
    with pytest.raises(RefusedError, match="b2 is zero"):
        rings(Cubic(b2=0.0, a1=0.0, a0=0.0, b1=1.0, b0=-0.1))


# --- Picard-Fuchs ----------------------------------------------------------------------------------------------------


@settings(deadline=None)
@given(_curves())
def test_the_picard_fuchs_equations_hold_on_every_ring(case: tuple[Cubic, Ring, float]) -> None:
    """All twelve coefficients: G dI/ds = A I, with both sides by quadrature."""
    _, ring, level = case
    on, equations = level_integrals(ring, level), PicardFuchs.on(ring)
    left = equations.discriminant(level) * on.slopes
    right = equations.matrix(level) @ on.integrals
    # By symmetry integrals may vanish: what counts is the width of the curve to their power.
    width = np.abs([on.x_min - ring.origin, on.x_max - ring.origin]).max() ** np.arange(3)
    scale = np.abs(equations.matrix(level)) @ (on.integrals[0] * width)
    scale += abs(equations.discriminant(level)) * on.slopes[0] * width
    np.testing.assert_array_less(np.abs(left - right), 1e-11 * scale)
    assume(abs(equations.discriminant(level)) > 1e-6)
    direct = (on.slopes[1:] - np.array([on.P, on.Q]) * on.slopes[0]) / on.integrals[0]
    np.testing.assert_allclose(equations.slopes(level, on.P, on.Q), direct, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("place", [(0, 1), (0, 2), (2, 0)])
def test_with_the_plus_signs_of_the_print_they_fail(place: tuple[int, int]) -> None:
    """Negative control: a01, a02 and a20 as printed."""
    (ring,) = rings(Cubic(a1=0.0, a0=0.0, b1=0.75, b0=-1.0))
    level = 0.5 * ring.top
    on, equations = level_integrals(ring, level), PicardFuchs.on(ring)
    matrix = equations.matrix(level).copy()
    matrix[place] *= -1.0
    wrong = matrix @ on.integrals / equations.discriminant(level) - on.slopes
    assert np.abs(wrong).max() > 0.03


@pytest.mark.parametrize(
    "cubic",
    [
        Cubic(a1=0.0, a0=0.0, b1=0.75, b0=-1.0),
        Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=0.3, b0=1.0),
        Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=1.2, b0=-1.0),
    ],
)
def test_integrating_the_equations_leads_from_level_to_level(cubic: Cubic) -> None:
    """The second road to P and Q, which evaluates no integral between the ends."""
    for ring in rings(cubic):
        equations = PicardFuchs.on(ring)
        first = 0.2
        if equations.discriminant(0.2 * ring.size) * equations.discriminant(0.8 * ring.size) < 0.0:
            # The bottom of the shallower well lies between: nothing happens in this one, but G passes zero there.
            assert ring.kind is RingKind.RIGHT_WELL
            other = next(one for one in rings(cubic) if one.kind is RingKind.LEFT_WELL)
            bottom = ring.top - other.top
            assert equations.discriminant(bottom) == pytest.approx(0.0, abs=1e-10)
            first = 0.3 + 0.7 * bottom / ring.size
        start, end = (level_integrals(ring, share * ring.size) for share in (first, 0.95))
        path = solve_ivp(
            lambda s, pq, equations=equations: equations.slopes(s, pq[0], pq[1]),
            (start.level, end.level),
            [start.P, start.Q],
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
        )
        np.testing.assert_allclose(path.y[:, -1], (end.P, end.Q), rtol=0, atol=1e-9)


def test_singular_levels_are_refused() -> None:
    equations = PicardFuchs(a=-1.0, b=0.0, c=1.0)
    for level in (0.0, 0.25):
        with pytest.raises(RefusedError, match="singular"):
            equations.slopes(level, 0.1, 0.1)


# --- cycles and folds to first order -------------------------------------------------------------------------------


@settings(deadline=None, max_examples=30)
@given(_curves(), _number)
def test_the_slope_of_the_balance_by_differences(case: tuple[Cubic, Ring, float], a1: float) -> None:
    _, ring, level = case
    step = 1e-3 * min(level, ring.size - level)
    ahead, behind = (
        first_order(ring, level_integrals(ring, level + sign * step), a2=-1.0, a1=a1) for sign in (1.0, -1.0)
    )
    slope = first_order_slope(ring, level_integrals(ring, level), a2=-1.0, a1=a1)
    on = level_integrals(ring, level)
    assert (ahead - behind) / (2.0 * step) == pytest.approx(slope, rel=1e-3, abs=1e-4 * (1.0 + on.slopes[0]))


def test_the_fold_between_saddles_by_the_tangency_of_the_paper() -> None:
    """Eq. 33 by the Picard-Fuchs polynomials against the slope by quadrature; k_d to its printed digits."""
    cubic = Cubic(a1=1.0, a0=0.0, b1=0.75, b0=-1.0)
    (fold,) = first_order_folds(cubic)
    assert fold.a0.value == pytest.approx(0.00538574599, abs=5e-12)
    assert fold.resolved
    assert not fold.above
    assert fold.a0.order.startswith("O(eps^4)")
    (ring,) = rings(cubic)
    equations = PicardFuchs.on(ring)

    def tangency(level: float) -> float:
        on = level_integrals(ring, level)
        return equations.tangency(level, on.P, on.Q, a1=1.0) / equations.discriminant(level)

    level = brentq(tangency, 0.05 * ring.top, 0.95 * ring.top, xtol=1e-13)
    assert fold.level == pytest.approx(level, rel=1e-9)


def test_the_curve_of_integral_ratios_is_convex() -> None:
    """R, Fig. 2: its slope dQ/dP falls from 1/b1 at the center (Dumortier & Li 2001, part I)."""
    (ring,) = rings(Cubic(a1=0.0, a0=0.0, b1=0.75, b0=-1.0))
    curves = [level_integrals(ring, share * ring.top) for share in np.linspace(0.01, 0.999, 40)]
    slopes = [(on.slopes[2] - on.Q * on.slopes[0]) / (on.slopes[1] - on.P * on.slopes[0]) for on in curves]
    assert slopes[0] == pytest.approx(1.0 / 0.75, abs=0.02)
    assert (np.diff(slopes) < 0.0).all()


def test_the_outer_fold_of_the_symmetric_wells() -> None:
    """0.752255640405833 at h = 0.08898701864628 (Guckenheimer & Holmes 1983, section 7.3, give 0.752)."""
    (fold,) = first_order_folds(Cubic(b2=-1.0, a1=0.0, a0=0.0, b1=0.0, b0=1.0))
    assert fold.ring is RingKind.OUTER
    assert fold.a0.value == pytest.approx(0.752255640405833, abs=1e-14)
    assert fold.level == pytest.approx(0.08898701864628, abs=1e-12)
    assert fold.above
    assert fold.x_max == pytest.approx(-fold.x_min, rel=_QUADRATURE)
    (asymmetric,) = first_order_folds(Cubic(b2=-1.0, a1=0.3, a0=0.0, b1=0.2, b0=1.0))
    assert asymmetric.a0.value == pytest.approx(0.729698245, abs=5e-10)


def _counts(cubic: Cubic) -> tuple[int, ...]:
    found = [cycle.ring for cycle in first_order_cycles(cubic)]
    return tuple(found.count(kind) for kind in (RingKind.LEFT_WELL, RingKind.RIGHT_WELL, RingKind.OUTER))


def test_cycle_counts_of_two_wells_as_the_damping_grows() -> None:
    """Independent counts, between the exact curves: 000, 002, 111, 001 and 000, 010, 012, 011, 001, 101, 001."""
    symmetric = [_counts(Cubic(b2=-1.0, a1=0.0, a0=a0, b1=0.0, b0=1.0)) for a0 in (0.7, 0.78, 0.9, 1.1)]
    assert symmetric == [(0, 0, 0), (0, 0, 2), (1, 1, 1), (0, 0, 1)]
    # First order: small loops 0.8856, 0.6959, large loop 0.7700, fold 0.7297, Hopf 1.0905, 0.8895.
    levels = (0.69, 0.71, 0.75, 0.8, 0.887, 0.95, 1.1)
    skew = [_counts(Cubic(b2=-1.0, a1=0.3, a0=a0, b1=0.2, b0=1.0)) for a0 in levels]
    expected = [(0, 0, 0), (0, 1, 0), (0, 1, 2), (0, 1, 1), (1, 1, 1), (1, 0, 1), (0, 0, 1)]
    assert skew == expected


def test_cycles_alternate_in_stability_and_lie_on_their_level() -> None:
    inner, outer = first_order_cycles(Cubic(b2=-1.0, a1=0.0, a0=0.78, b1=0.0, b0=1.0))
    assert (inner.stable, outer.stable) == (False, True)
    assert inner.x_max < outer.x_max
    (ring,) = rings(Cubic(a1=1.0, a0=0.0, b1=0.75, b0=-1.0))
    inner, outer = first_order_cycles(Cubic(a1=1.0, a0=0.003, b1=0.75, b0=-1.0))
    assert (inner.stable, outer.stable) == (True, False)  # region II
    for cycle in (inner, outer):
        on = level_integrals(ring, cycle.level)
        assert first_order(ring, on, a2=-1.0, a1=1.0) == pytest.approx(0.003, abs=_QUADRATURE)
        assert turning_points(ring, cycle.level) == (pytest.approx(cycle.x_min), pytest.approx(cycle.x_max))


def test_the_single_well() -> None:
    """Independent values: (2, 1.2): fold at −0.0941, two cycles at −0.05, one at 0.1; (0, 0), (1, 0.5): 0, 1, 1."""
    well = {"b2": -1.0, "a1": 2.0, "b1": 1.2, "b0": -1.0}
    (fold,) = first_order_folds(Cubic(a0=0.0, **well))
    assert fold.a0.value == pytest.approx(-0.0941242042951, abs=0.01)  # eps = 1
    stable = [[cycle.stable for cycle in first_order_cycles(Cubic(a0=a0, **well))] for a0 in (-0.2, -0.05, 0.1)]
    assert stable == [[], [False, True], [True]]
    for a1, b1 in ((0.0, 0.0), (1.0, 0.5)):
        counts = [len(first_order_cycles(Cubic(b2=-1.0, a1=a1, a0=a0, b1=b1, b0=-1.0))) for a0 in (-0.05, 0.1, 0.5)]
        assert counts == [0, 1, 1]


@settings(deadline=None, max_examples=15)
@given(st.floats(0.1, 3.0), st.floats(0.1, 3.0))
def test_a_fold_between_saddles_exists_exactly_where_the_end_slopes_say(a1: float, b1: float) -> None:
    """(Q* − z*²)/(P* − z*) < a1 < 1/b1, and never for a1 b1 ≤ 0 (to first order)."""
    cubic = Cubic(a1=a1, a0=0.0, b1=b1, b0=-1.0)
    (ring,) = rings(cubic)
    on = level_integrals(ring, ring.top)
    z = ring.right
    low, high = (on.Q - z * z) / (on.P - z), 1.0 / b1
    assume(min(abs(a1 - low), abs(a1 - high)) > 1e-6)
    assert len(first_order_folds(cubic)) == (1 if low < a1 < high else 0)
    assert first_order_folds(Cubic(a1=-a1, a0=0.0, b1=b1, b0=-1.0)) == ()


def test_a_fold_too_near_its_loop_is_not_resolved() -> None:
    (ring,) = rings(Cubic(a1=0.0, a0=0.0, b1=0.5, b0=-1.0))
    on = level_integrals(ring, ring.top)
    low = (on.Q - ring.right**2) / (on.P - ring.right)
    (fold,) = first_order_folds(Cubic(a1=low + 1e-3, a0=0.0, b1=0.5, b0=-1.0))
    assert not fold.resolved
    assert "double precision" in fold.a0.caution
    assert fold.a0.value == pytest.approx(on.Q - (low + 1e-3) * on.P, abs=_QUADRATURE)


def test_estimates_are_for_the_normal_form() -> None:
    for function in (first_order_cycles, first_order_folds):
        with pytest.raises(RefusedError, match="normal form"):
            function(Cubic(a2=1.0, a1=0.0, a0=0.0, b1=0.0, b0=-1.0))


def test_four_cycles_around_two_wells() -> None:
    """(left, right, outer) = (0, 1, 3) exists for b1 ≥ 6 (independent search: 4 there, 3 for |b1| ≤ 3)."""
    parameters = {"b2": -1.0, "a1": 5.85, "b1": 6.0, "b0": 1.0}
    folds = [fold for fold in first_order_folds(Cubic(a0=0.0, **parameters)) if fold.ring is RingKind.OUTER]
    assert [fold.above for fold in folds] == [False, True]
    large = well_loops_estimate(Cubic(a0=0.0, **parameters)).large.value
    a0 = 0.5 * (folds[0].a0.value + max(folds[1].a0.value, large))
    cubic = Cubic(a0=a0, **parameters)
    assert _counts(cubic) == (0, 1, 3)
    assert [c.stable for c in first_order_cycles(cubic) if c.ring is RingKind.OUTER] == [True, False, True]
