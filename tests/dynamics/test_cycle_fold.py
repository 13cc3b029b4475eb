"""Folds of cycles in the rotation parameter: references, the flat end, the Bautin end, symmetries."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.dynamics.cycle.flow_cycle import flow_cycles
from finback.dynamics.cycle.fold import cycle_folds
from finback.dynamics.family import Family
from finback.dynamics.orbit.annulus import groups

# References are printed to 13 decimals; twice half of the last, for the reference rounds too.
EXACT = 1e-12


def _cubic(a1: float, b1: float, b2: float = 1.0) -> Family:
    """μ = b0, λ = a0."""
    return Family(damping=(0.0, a1, -1.0), force=(0.0, 0.0, b1, b2), direction=(0.0, 1.0))


@pytest.mark.parametrize(
    ("family", "b0", "a0"),
    [
        (_cubic(1.0, 0.75), -1.0, 0.00533818018161),
        (_cubic(0.0, 0.0, -1.0), 1.0, 0.771215070536),
        (_cubic(0.3, 0.2, -1.0), 1.0, 0.761455282401),
        (_cubic(2.0, 1.2, -1.0), -1.0, -0.0941242042951),
    ],
)
def test_folds_of_independent_arithmetic(family: Family, b0: float, a0: float) -> None:
    """Reference: 130-bit Taylor series, Newton's method on displacement and ∮f dt, two precisions."""
    (fold,) = cycle_folds(family, b0)
    assert fold.lam == pytest.approx(a0, rel=0, abs=EXACT)
    assert fold.resolved
    assert abs(fold.residual) < 1e-12


@pytest.mark.parametrize(
    ("b0", "a0", "period", "gap"),
    [(-0.383335, 0.00424373, 13.31827, 3.0e-4), (-0.472226, 0.01021202, 16.81604, 3.0e-6)],
)
def test_the_curve_of_folds(b0: float, a0: float, period: float, gap: float) -> None:
    """Reference: a continuation of folds; its b0 has six decimals, and a0 falls by 0.07, T by 60, per unit of b0."""
    (fold,) = cycle_folds(_cubic(0.5, 0.5), b0)
    assert fold.lam == pytest.approx(a0, rel=0, abs=0.5e-6 * 0.07 + 0.5e-8)
    assert fold.period == pytest.approx(period, rel=0, abs=0.5e-6 * 60.0 + 0.5e-5)
    assert fold.gap == pytest.approx(gap, rel=0.02)
    assert fold.vanishing == -1


def test_the_flat_end() -> None:
    """Towards the neutral saddle at b0 = -0.5463008119455 the gap falls below everything; λ stays, and a flag falls."""
    family = _cubic(0.5, 0.5)
    gaps = []
    for b0, resolved in ((-0.5, True), (-0.5315, False), (-0.54, False), (-0.546, False), (-0.5463, False)):
        (fold,) = cycle_folds(family, b0)
        assert fold.resolved is resolved
        gaps.append(fold.gap)
        loop = groups(family.at(b0, 0.0))[0].annulus()
        assert loop is not None
        assert fold.lam == pytest.approx(loop.outer.lam, rel=0, abs=max(fold.gap, 1e-15) * 1.01)
    assert gaps[0] == pytest.approx(3.3e-8, rel=0.01)
    assert max(gaps[1:]) < 1e-15
    # Beyond the neutral saddle there is none, nor just at it beside the last one.
    for b0 in (-0.546302, -0.55, -0.7, -2.0):
        assert cycle_folds(family, b0) == ()
    assert len(cycle_folds(family, -0.5463008)) == 1


def test_where_the_fold_is_known_by_signs_only_its_residual_says_so() -> None:
    (fold,) = cycle_folds(_cubic(0.5, 0.5), -0.5463)
    assert math.isnan(fold.residual)
    assert fold.period > 1e3


def test_the_bautin_end() -> None:
    """At b0 = -a1 b1 the fold grows out of the Hopf point: a0 = a²/(2 b), x = √(-a/(2 b)), and nothing before."""
    family = _cubic(0.5, 0.5)
    for b0 in (-0.1, -0.24, -0.2499, -0.25 + 1e-9, -0.25):
        assert cycle_folds(family, b0) == ()
    for excess in (1e-6, 1e-5, 1e-4):
        b0 = -0.25 - excess
        first, second = (0.25 + b0) / (-8.0 * b0), 5.0 / (48.0 * -b0)
        (fold,) = cycle_folds(family, b0)
        # The next power of the amplitude is smaller by the excess over the frequency squared.
        assert fold.lam == pytest.approx(first**2 / (2.0 * second), rel=20.0 * excess)
        assert 0.5 * (fold.x_max - fold.x_min) == pytest.approx(math.sqrt(-first / (2.0 * second)), rel=20.0 * excess)
        assert fold.resolved


def test_the_fold_that_first_order_denies() -> None:
    """(a1, b1, b0) = (1.5, 0, -1): two cycles in a window of a0 of 2.7e-6 below 0.11994, though a1 b1 = 0."""
    (fold,) = cycle_folds(_cubic(1.5, 0.0), -1.0)
    assert fold.lam == pytest.approx(0.11994, rel=0, abs=0.5e-5)
    assert fold.gap == pytest.approx(2.7e-6, rel=0, abs=0.05e-6)
    counts = [len(flow_cycles(_cubic(1.5, 0.0).at(-1.0, fold.lam + change)).cycles) for change in (-1e-6, 1e-6)]
    assert counts == [2, 0]


_VALUE = st.floats(-2.0, 2.0).map(lambda value: round(value, 2))


@settings(deadline=None, max_examples=12)
@given(a1=_VALUE, b1=_VALUE, b0=st.floats(-1.5, -0.1).map(lambda value: round(value, 2)))
def test_cycles_come_and_go_in_pairs_at_folds(a1: float, b1: float, b0: float) -> None:
    """Negative and positive control at once: two cycles more on one side of the fold than on the other."""
    family = _cubic(a1, b1, -1.0)
    for fold in cycle_folds(family, b0):
        if not fold.resolved:
            continue
        step = 1e-7 * max(1.0, abs(fold.lam)) if math.isnan(fold.gap) else min(1e-7, 0.1 * fold.gap)
        inside, outside = (
            [c for c in flow_cycles(family.at(b0, fold.lam + sign * step)).cycles if c.enclosed == fold.enclosed]
            for sign in (fold.vanishing, -fold.vanishing)
        )
        assert len(inside) == len(outside) + 2
        assert fold.bracket[0] <= fold.x_max <= fold.bracket[1]


@settings(deadline=None, max_examples=10)
@given(st.floats(0.2, 5.0), st.floats(0.2, 5.0))
def test_rescaling_and_time_reversal_commute(length: float, time: float) -> None:
    family, b0 = _cubic(0.3, 0.2, -1.0), 1.0
    (expected,) = cycle_folds(family, b0)
    scaled = Family(
        damping=tuple(-c * length**k / time for k, c in enumerate(family.damping)),
        force=tuple(c * length ** (k - 1) / time**2 for k, c in enumerate(family.force)),
        direction=tuple(c * length ** (k - 1) / time**2 for k, c in enumerate(family.direction)),
    )
    (found,) = cycle_folds(scaled, b0)
    assert -found.lam * time == pytest.approx(expected.lam, rel=1e-12)
    assert found.period == pytest.approx(expected.period * time, rel=1e-9)
    assert found.gap * time == pytest.approx(expected.gap, rel=1e-9)
    assert found.vanishing == -expected.vanishing
    np.testing.assert_allclose(np.array([found.x_min, found.x_max]) * length, [expected.x_min, expected.x_max], 1e-9)


def test_four_cycles_of_the_figure_eight() -> None:
    """Dumortier & Li (2003) allow five for small ε; a grid found (left, right, outer) = (0, 1, 3), as here.

    Three outer cycles need λ between that of the large loop and that of a fold beside it, 3e-12 apart.
    """
    family, b0 = _cubic(0.05 * 5.8, 0.05 * 6.0, -1.0), 0.05**2
    outer = [fold for fold in cycle_folds(family, b0) if len(fold.enclosed) == 3]
    assert [fold.vanishing for fold in outer] == [1, -1]
    found = flow_cycles(family.at(b0, outer[1].lam - 0.5 * outer[1].gap))
    left, _, right = outer[0].enclosed
    assert (found.count(left), found.count(right), found.count(*outer[0].enclosed)) == (0, 1, 3)
    assert [cycle.stable for cycle in found.cycles if len(cycle.enclosed) == 3] == [True, False, True]
