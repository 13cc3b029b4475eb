"""Families of cycles over λ and over the elevator: ends, folds, numbers by another road."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from finback.arrays import FloatArray
from finback.dynamics.connection.loop import LoopKind, loops
from finback.dynamics.cycle import family as module
from finback.dynamics.cycle.bautin import bautin_points
from finback.dynamics.cycle.branch import FamilyEnd, cycle_branches
from finback.dynamics.cycle.cycle import Cycle, cycles
from finback.dynamics.cycle.family import CycleFamily, ElevatorCycleFold, cycle_families, cycle_family
from finback.dynamics.cycle.flow_cycle import flow_cycles
from finback.dynamics.cycle.fold import cycle_folds
from finback.dynamics.family import Family
from finback.dynamics.flow import Flow, Scale, flow_at
from finback.dynamics.hopf import Hopf, hopf_points
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.orbit.half_turn import half_turn
from finback.errors import InputError, RefusedError

Build = Callable[..., LienardSystem]
# A place found at one elevator by two searches, over the distance of the multiplier from 1.
SAME = 1e-9
# A turn that closes, over the amplitude: rounding, and what of it a half that spreads orbits by e^15 makes.
CLOSED = 2e-9


def _cubic(a1: float, b1: float, b2: float = 1.0) -> Family:
    """μ = b0, λ = a0."""
    return Family(damping=(0.0, a1, -1.0), force=(0.0, 0.0, b1, b2), direction=(0.0, 1.0))


def test_a_branch_from_hopf_to_loop() -> None:
    """Reference: (0.5, 0.5, -0.35), Hopf at a0 = 0, to periods above 67.6, two cycles at 0.0022."""
    (branch,) = cycle_branches(_cubic(0.5, 0.5), -0.35)
    assert (branch.begin, branch.end, branch.begin_lam) == (FamilyEnd.HOPF, FamilyEnd.LOOP, 0.0)
    assert 30 <= branch.lam.size <= 60
    assert branch.period.max() > 67.6
    assert (np.diff(branch.x_max) > 0.0).all()
    assert (np.diff(branch.period) > 0.0).all()
    (fold,) = branch.folds
    # λ rises outward while the cycles are stable and falls where they are not, up to what is flat.
    rising = np.diff(branch.lam) > 0.0
    stable = 0.5 * (branch.log_multiplier[1:] + branch.log_multiplier[:-1]) < 0.0
    clear = (np.abs(np.diff(branch.lam)) > 1e-15) & ~(
        (branch.x_max[1:] > fold.x_max) & (branch.x_max[:-1] < fold.x_max)
    )
    np.testing.assert_array_equal(rising[clear], stable[clear])
    assert branch.end_lam == branch.lam[-1]


@pytest.mark.parametrize(
    ("family", "b0"),
    [(_cubic(0.5, 0.5), -1.0), (_cubic(0.5, 0.5), -0.35), (_cubic(0.3, 0.2, -1.0), 1.0), (_cubic(1.5, 0.0), -1.0)],
)
def test_branches_end_at_the_loops(family: Family, b0: float) -> None:
    """Two roads: the limit of λ* at the ends of the annuli, and manifolds of the saddles shot at each other."""
    ends = {
        round(lam, 9)
        for branch in cycle_branches(family, b0)
        for kind, lam in ((branch.begin, branch.begin_lam), (branch.end, branch.end_lam))
        if kind is FamilyEnd.LOOP
    }
    found = {round(loop.lam, 9): loop for loop in loops(family, b0) if loop.kind is LoopKind.HOMOCLINIC}
    assert ends <= set(found)
    for branch in cycle_branches(family, b0):
        if branch.end is FamilyEnd.LOOP:
            assert branch.end_lam == pytest.approx(found[round(branch.end_lam, 9)].lam, rel=0, abs=1e-12)


@pytest.mark.parametrize(
    ("parameters", "lam"),
    [
        ((0.5, 0.5, -1.0, 1.0), 0.0594558236872),
        ((1.0, 0.75, -1.0, 1.0), 4.34108613069e-4),
        ((0.5, 0.5, -0.1, 1.0), -0.0062445674),
        ((0.5, 0.5, -2.0, 1.0), 0.1783210866),
    ],
)
def test_the_loop_at_the_end_is_the_homoclinic_of_the_references(
    parameters: tuple[float, float, float, float], lam: float
) -> None:
    a1, b1, b0, b2 = parameters
    (branch,) = cycle_branches(_cubic(a1, b1, b2), b0)
    assert branch.end_lam == pytest.approx(lam, rel=0, abs=0.6e-10)


def _check(family: CycleFamily, system: LienardSystem) -> None:
    """Each third cycle of a family is one that the search at its elevator finds, but where the elevator is flat."""
    for cycle in family.cycles[4::3]:
        if family.end is FamilyEnd.LOOP and abs(cycle.elevator_rad - family.end_elevator_rad) < 1e-6:
            continue
        found = cycles(system, cycle.elevator_rad).cycles
        # Near a fold of cycles the place moves as the root of the elevator.
        loose = SAME / min(1.0, abs(cycle.log_multiplier)) ** 2
        near = min(found, key=lambda other: abs(other.alpha_max_rad - cycle.alpha_max_rad))
        assert near.alpha_max_rad == pytest.approx(cycle.alpha_max_rad, rel=0, abs=loose * cycle.amplitude_rad)
        assert near.period_s == pytest.approx(cycle.period_s, rel=10.0 * loose)


def test_a_family_over_the_elevator_from_hopf_to_loop(build_system: Build) -> None:
    system = build_system((0.0, 0.5, -1.0), (0.0, -0.35, 0.5, 1.0))
    (family,) = cycle_families(system, (-0.1, 0.1))
    assert (family.begin, family.end) == (FamilyEnd.HOPF, FamilyEnd.LOOP)
    assert family.begin_elevator_rad == hopf_points(system)[0].elevator_rad
    assert family.cycles[-1].period_s > 67.6
    assert 25 <= len(family.cycles) <= 60
    _check(family, system)
    (fold,) = family.folds
    assert fold.residual == pytest.approx(0.0, abs=1e-12)
    assert fold.bracket_rad[0] < fold.cycle.alpha_max_rad < fold.bracket_rad[1]
    # Both cycles are there below the elevator of the fold, none above.
    counts = [len(cycles(system, fold.elevator_rad + change).cycles) for change in (-1e-8, 1e-8)]
    assert counts == [2, 0]
    assert max(cycle.elevator_rad for cycle in family.cycles) <= fold.elevator_rad


def test_the_loop_over_the_elevator_is_that_of_the_connections(build_system: Build) -> None:
    """Two roads: the elevator at which the family becomes flat, and the splitting of the saddle's manifolds."""
    from finback.dynamics.connection.search import connections

    system = build_system((0.0, 0.5, -1.0), (0.0, -0.35, 0.5, 1.0))
    (family,) = cycle_families(system, (-0.1, 0.1))
    found = [loop.elevator_rad for loop in connections(system, (-0.1, 0.1)).homoclinics]
    assert min(abs(elevator - family.end_elevator_rad) for elevator in found) < 1e-11


def test_a_family_between_two_hopf_points_is_listed_once(build_system: Build) -> None:
    system = build_system((0.3, 0.2, -1.0, 0.1), (0.1, -1.0, 0.3, -0.6))
    points = hopf_points(system)
    (family,) = cycle_families(system, (-3.0, 3.0))
    assert (family.begin, family.end) == (FamilyEnd.HOPF, FamilyEnd.HOPF)
    assert [family.begin_elevator_rad, family.end_elevator_rad] == [point.elevator_rad for point in points[:2]]
    assert family.folds == ()
    _check(family, system)


def test_a_family_that_leaves_the_range_ends_at_its_end(build_system: Build) -> None:
    system = build_system((-0.05, 2.0, -1.0), (0.0, -1.0, 1.2, -1.0))
    family = cycle_families(system, (-1.0, 1.5))[0]
    assert (family.begin, family.end, family.end_elevator_rad) == (FamilyEnd.HOPF, FamilyEnd.RANGE, 1.5)
    assert family.cycles[-1].elevator_rad == 1.5
    assert len(family.folds) == 1
    _check(family, system)


def test_a_family_of_large_cycles_is_followed_both_ways(build_system: Build) -> None:
    """Around both wells: no Hopf point leads there."""
    system = build_system((0.765, 0.3, -1.0), (0.0, 1.0, 0.2, -1.0))
    outer = [cycle for cycle in cycles(system, 0.0).cycles if cycle.enclosed_alpha_rad.size == 3]
    families = [cycle_family(system, cycle, (-0.02, 0.02)) for cycle in outer]
    for family in families:
        assert {family.begin, family.end} <= {FamilyEnd.RANGE, FamilyEnd.LOOP}
        for before, after in pairwise(family.cycles):
            assert abs(after.alpha_max_rad - before.alpha_max_rad) < 0.2
        _check(family, system)
    # Whichever of the two is followed, where they meet it is the other.
    for family in families:
        for fold in family.folds:
            assert fold.residual == pytest.approx(0.0, abs=1e-11)


def test_a_closed_family_is_followed_once(build_system: Build) -> None:
    """Just above the fold at a0 = 0.771215 of the symmetric wells the two large cycles exist near elevator 0 only."""
    system = build_system((0.7716, 0.0, -1.0), (0.0, 1.0, 0.0, -1.0))
    for cycle in cycles(system, 0.0).cycles:
        family = cycle_family(system, cycle, (-0.2, 0.2))
        assert (family.begin, family.end) == (FamilyEnd.CLOSED, FamilyEnd.CLOSED)
        assert len(family.cycles) < 100
        left, right = sorted(fold.elevator_rad for fold in family.folds)
        assert left == pytest.approx(-right, rel=1e-10)  # by symmetry
        assert cycles(system, right + 1e-7).cycles == ()
        assert len(cycles(system, right - 1e-7).cycles) == 2


@pytest.mark.parametrize("coefficient", range(8))
def test_one_uncertain_coefficient_moves_a_fold_of_cycles_as_its_interval_says(
    build_system: Build, coefficient: int
) -> None:
    theta = np.array([0.0, 0.5, -1.0, 0.0, -0.35, 0.5, 1.0, 1.0])
    step = 1e-6
    shift = step * np.eye(8)[coefficient]

    def family_of(values: FloatArray, covariance: FloatArray | None = None) -> CycleFamily:
        system = build_system(values[:3], values[3:7], gain=values[7], covariance=covariance)
        return cycle_families(system, (-0.1, 0.1))[0]

    up, down = (family_of(theta + sign * shift).folds[0].elevator_rad for sign in (1.0, -1.0))
    fold = family_of(theta, np.outer(shift, shift)).folds[0]
    half = 0.5 * np.ptp(fold.elevator_interval_rad) / 1.959963984540054
    # The difference errs by the rounding of the fold (some 1e-16) and by the third derivative.
    assert half == pytest.approx(0.5 * abs(up - down), rel=1e-5, abs=1e-14)


def test_the_curve_of_folds_runs_from_bautin_to_the_neutral_saddle() -> None:
    """Reference: GH at b0 = -0.25, neutral saddle at -0.5463008119455 with a0 = 0.0160439235135."""
    family = _cubic(0.5, 0.5)
    (point,) = [point for point in bautin_points(family) if point.x == 0.0]
    assert point.mu == -0.25
    curve = [cycle_folds(family, b0) for b0 in np.linspace(-0.2501, -0.5463, 12)]
    assert [len(folds) for folds in curve] == [1] * 12
    lam = [folds[0].lam for folds in curve]
    assert all(before < after for before, after in pairwise(lam))
    assert lam[-1] == pytest.approx(0.0160439235135, abs=1e-7)  # 8.1e-7 in b0 before the end, where da0/db0 is -0.08


_VALUE = st.floats(-1.5, 1.5).map(lambda value: round(value, 2))


@settings(deadline=None, max_examples=6)
@given(
    damping=st.lists(_VALUE, min_size=2, max_size=3),
    force=st.lists(_VALUE, min_size=0, max_size=2),
)
@example([1.0, 0.0], [0.12])  # a canard, then a loop: logarithms of multipliers up to 1800
def test_every_family_has_named_ends_and_true_cycles(
    build_system: Build, damping: list[float], force: list[float]
) -> None:
    system = build_system((0.1, *damping), (0.0, -1.0, *force))
    try:
        families = cycle_families(system, (-1.0, 1.0))
    except RefusedError:
        return
    for family in families:
        assert family.begin is FamilyEnd.HOPF
        assert family.end is not FamilyEnd.CLOSED
        assert len(family.cycles) < 600
        assert (family.end is FamilyEnd.LOST) <= bool(family.obstacle)
        for cycle in family.cycles:
            assert -1.0 <= cycle.elevator_rad <= 1.0
            assert abs(cycle.residual_rad) <= CLOSED * cycle.amplitude_rad
            assert cycle.bracket_rad[0] <= cycle.alpha_max_rad <= cycle.bracket_rad[1]
            flow = flow_at(system, cycle.elevator_rad, Scale(length_rad=1.0, time_s=1.0))
            assert _return_miss(flow, cycle) <= 10.0 * CLOSED * cycle.amplitude_rad


def _return_miss(flow: Flow, cycle: Cycle) -> float:
    """By how much a cycle misses itself after two half turns in the direction in which it attracts."""
    start = cycle.alpha_max_rad
    for _ in range(2):
        turn = half_turn(flow, start, forward=cycle.stable)
        assert turn.landed
        start = turn.x
    return abs(start - cycle.alpha_max_rad)


def test_what_fails_harms_no_other_family_and_is_said(build_system: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two Hopf points in one range; the first family is made to fail."""
    system = build_system((0.9, 0.3, -1.0), (0.0, 1.0, 0.2, -1.0))
    plain = cycle_families(system, (-0.3, 0.3))
    assert len(plain) == 2
    assert [family.obstacle for family in plain] == ["", ""]
    follow = module._from_hopf  # the start of a family, which no small system makes fail

    def failing(system: LienardSystem, ends: tuple[float, float], hopf: Hopf) -> CycleFamily | None:
        if hopf.elevator_rad == plain[0].begin_elevator_rad:
            raise RefusedError("no cycle could be found beside a Hopf point")
        return follow(system, ends, hopf)

    monkeypatch.setattr(module, "_from_hopf", failing)
    lost, other = cycle_families(system, (-0.3, 0.3))
    assert (lost.cycles, lost.end, lost.obstacle) == ((), FamilyEnd.LOST, "no cycle could be found beside a Hopf point")
    assert lost.begin_elevator_rad == plain[0].begin_elevator_rad
    assert len(other.cycles) == len(plain[1].cycles)


def test_a_fold_that_cannot_be_named_is_said(build_system: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    system = build_system((0.0, 0.5, -1.0), (0.0, -0.35, 0.5, 1.0))

    def nameless(*_: object) -> ElevatorCycleFold:
        raise RefusedError("the cycles on its two sides have no name in common")

    monkeypatch.setattr(module, "_fold", nameless)
    (family,) = cycle_families(system, (-0.1, 0.1))
    assert family.folds == ()
    assert "not located: the cycles on its two sides have no name" in family.obstacle
    assert family.end is FamilyEnd.LOOP


def test_mistakes_are_named(build_system: Build) -> None:
    system = build_system((0.0022, 0.5, -1.0), (0.0, -0.35, 0.5, 1.0))
    cycle = cycles(system, 0.0).cycles[0]
    with pytest.raises(InputError, match="empty"):
        cycle_families(system, (0.1, -0.1))
    with pytest.raises(InputError, match="outside the elevator range"):
        cycle_family(system, cycle, (0.1, 0.2))
    other = build_system((-0.5, 0.5, -1.0), (0.0, -0.35, 0.5, 1.0))
    with pytest.raises(RefusedError, match="no cycle"):
        cycle_family(other, cycle, (-0.1, 0.1))


def test_a_branch_and_the_count_at_one_lambda_agree() -> None:
    family = _cubic(0.3, 0.2, -1.0)
    for lam in (0.74, 0.765, 0.8, 1.0):
        crossings = 0
        for branch in cycle_branches(family, 1.0):
            levels = np.sign(np.concatenate([branch.lam, [fold.lam for fold in branch.folds]]) - lam)
            order = np.argsort(np.concatenate([branch.x_max, [fold.x_max for fold in branch.folds]]))
            crossings += int((np.diff(levels[order]) != 0).sum())
        assert crossings == len(flow_cycles(family.at(1.0, lam)).cycles)
