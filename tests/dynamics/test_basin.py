"""Basins bounded by cycles and slits, how they move with the coefficients, and why they have no end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from finback.dynamics.flow import Flow, Rest, plain_flow, rests
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.stability.basin import Basin, area, basin, nearest
from finback.dynamics.stability.boundary_curve import CurveEnd, Segment
from finback.dynamics.stability.map import stability_map
from finback.dynamics.stability.region import (
    RegionNotFound,
    StabilityRegion,
    each_stability_region,
    stability_region,
    stability_regions,
)
from finback.dynamics.stability.tongue import backward_trap
from finback.errors import RefusedError
from finback.units import to_si

Build = Callable[..., LienardSystem]


def _minus(a0: float, a1: float, b1: float, b0: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The family with b2 = −1."""
    return (a0, a1, -1.0), (0.0, b0, b1, -1.0)


def _plus(a0: float, a1: float, b1: float, b0: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The family with b2 = +1."""
    return (a0, a1, -1.0), (0.0, b0, b1, 1.0)


# What bounds each region, from the published sequences of loops and cycles of the family with b2 = −1: the elevator
# has no effect, two wells at most, by rising angle. In order: what ends the branches, cycles around and holes.
AWAY, CYCLE = CurveEnd.AWAY, CurveEnd.CYCLE
CASES = {
    "reversed van der Pol": ((-1.0, 0.0, 1.0), (0.0, -1.0), [((), [True])]),
    "saddles beyond an unstable cycle": ((-0.1, 0.0, 1.0), (0.0, -1.0, 0.0, 1.0), [((), [True])]),
    "two wells, no cycle": (*_minus(0.7, 0.0, 0.0, 1.0), [((AWAY, AWAY), []), ((AWAY, AWAY), [])]),
    "two wells in an unstable cycle": (*_minus(0.79, 0.0, 0.0, 1.0), [((CYCLE, CYCLE), [True])] * 2),
    "a cycle in each well": (*_minus(0.9, 0.0, 0.0, 1.0), [((), [True])] * 2),
    "a slit that winds onto a hole": (*_minus(0.74, 0.3, 0.2, 1.0), [((AWAY, CYCLE), [False]), ((), [True])]),
    "a hole, and a cycle around": (*_minus(0.765, 0.3, 0.2, 1.0), [((CYCLE, CYCLE), [True, False]), ((), [True])]),
    "both branches onto a hole": (*_minus(0.85, 0.3, 0.2, 1.0), [((CYCLE, CYCLE), [False]), ((), [True])]),
    "one saddle of three": (*_plus(-0.1, 0.5, 0.5, -0.1), [((AWAY, AWAY), [])]),
}


@pytest.mark.parametrize("name", CASES)
def test_each_kind_of_region_against_the_grid_map(build_system: Build, name: str) -> None:
    """Endings and cycles as the loops and cycles of the family demand; the area as the grid counts it."""
    damping, force, expected = CASES[name]
    system = build_system(damping, force, gain=0.0)
    found = stability_regions(system, 0.0, alpha_range_rad=(-2.5, 2.5))
    assert [(tuple(b.ending for b in r.boundary), [c.around for c in r.cycles]) for r in found] == expected
    alpha, rate = np.meshgrid(np.linspace(-2.5, 2.5, 141), np.linspace(-6.0, 6.0, 241))
    mapped = stability_map(system, 0.0, alpha, rate)
    for index, region in enumerate(found):
        counted = (mapped == index).sum() * (5.0 / 140) * (12.0 / 240)
        if np.isfinite(region.area_rad2_s):
            # The rounding of a border to cells is about as often up as down: a cell for each ten of the border.
            assert region.area_rad2_s == pytest.approx(counted, abs=0.02 + 0.01 * counted)
        else:
            rim = np.concatenate([mapped[0], mapped[-1]])
            assert (rim == index).any()
        step = 1.001 * np.array([region.escape_alpha_rad - region.alpha_rad, region.escape_alpha_dot_rad_s])
        shares = np.array([0.998 / 1.001, 1.0])
        inside, outside = stability_map(system, 0.0, region.alpha_rad + step[0] * shares, step[1] * shares).tolist()
        assert inside == index
        # Across a slit, and across two windings, lies the same region.
        assert outside != index or (
            index == 0 and name in ("a slit that winds onto a hole", "a hole, and a cycle around")
        )


def test_the_whole_plane_has_no_boundary(build_system: Build) -> None:
    region = stability_region(build_system((-0.2,), (0.0, -1.0)), 0.0, alpha_range_rad=(-1.0, 1.0))
    assert region.boundary == region.cycles == region.tongues == ()
    assert region.area_rad2_s == region.escape_distance_rad == np.inf
    assert np.isnan(region.escape_alpha_rad)


def test_wells_without_cycle_between_branches_that_wind_outward_for_ever(build_system: Build) -> None:
    """x" = −x' + x − x³: by symmetry both regions are alike; each takes strips of any height, about half of all."""
    system = build_system((-1.0,), (0.0, 1.0, 0.0, -1.0), gain=0.0)
    limits = (-2.5, 2.5)
    left, right = stability_regions(system, 0.0, alpha_range_rad=limits)
    assert right.escape_distance_rad == pytest.approx(left.escape_distance_rad, rel=1e-12)
    for index, region in enumerate((left, right)):
        assert {branch.ending for branch in region.boundary} == {CurveEnd.WINDS}
        assert region.area_rad2_s == np.inf
        assert region.tongues == ()
        for height in (20.0, 80.0):
            alpha, rate = np.meshgrid(np.linspace(*limits, 41), np.linspace(-height, height, 2001))
            assert (stability_map(system, 0.0, alpha, rate) == index).mean() == pytest.approx(0.5, abs=0.1)


def test_a_slow_spiral_under_damping_of_one_sign_is_the_whole_plane(build_system: Build) -> None:
    """x" = −x' + 2 − 0.5 (x + x³): far out the turns are so fast that an orbit hardly grows in one."""
    (region,) = stability_regions(build_system((-1.0,), (2.0, -0.5, 0.0, -0.5), gain=0.0), 0.0, alpha_range_rad=(-2, 2))
    assert region.boundary == region.cycles == ()
    assert region.escape_distance_rad == np.inf


def test_a_sink_that_is_refused_hides_no_other(build_system: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two wells in which the search at one is made to fail."""
    system = build_system((-0.5,), (0.0, 1.0, 0.0, -1.0), gain=0.0)
    before = stability_regions(system, 0.0, alpha_range_rad=(-1.0, 1.0))

    def fails(flow: Flow, points: tuple[Rest, ...], sink: Rest, reach: float, inner: float) -> Basin:
        if sink.x > 0.0:
            raise RefusedError("not today")
        return basin(flow, points, sink, reach, inner)

    monkeypatch.setattr("finback.dynamics.stability.region.basin", fails)
    with pytest.raises(RefusedError, match="not today"):
        stability_regions(system, 0.0, alpha_range_rad=(-1.0, 1.0))
    found, refused = each_stability_region(system, 0.0, alpha_range_rad=(-1.0, 1.0))
    assert isinstance(found, StabilityRegion)
    assert found.escape_distance_rad == before[0].escape_distance_rad
    assert isinstance(refused, RegionNotFound)
    assert (refused.alpha_rad, refused.obstacle) == (before[1].alpha_rad, "not today")


def test_a_saddle_outside_the_range_cuts_what_reaches_in(printed_system: LienardSystem) -> None:
    """The area within a narrow range is that of the wide region between the two lines."""
    narrow = (to_si(-10.0, "deg"), to_si(10.0, "deg"))
    region = stability_region(printed_system, 0.0, alpha_range_rad=narrow)
    alpha, rate = np.meshgrid(np.linspace(*narrow, 81), np.linspace(-2.0, 2.0, 401))
    counted = (stability_map(printed_system, 0.0, alpha, rate) == 0)[:, :-1].sum() * (alpha[0, 1] - alpha[0, 0]) * 0.01
    assert region.area_rad2_s == pytest.approx(counted, rel=0.01)
    whole = stability_region(printed_system, 0.0, alpha_range_rad=(to_si(-100.0, "deg"), to_si(100.0, "deg")))
    assert region.escape_distance_rad == whole.escape_distance_rad
    low, high = region.area_beyond_rad2_s
    assert low - 1e-9 <= whole.area_rad2_s - region.area_rad2_s + whole.area_beyond_rad2_s[0] <= high + 1e-9


@pytest.mark.parametrize("elevator_deg", [10.0, -10.0, -25.0])
def test_what_lies_beyond_is_bracketed(printed_system: LienardSystem, elevator_deg: float) -> None:
    """The area within 250 degrees less that within 100 is not more than what is said to lie beyond, and nearly all."""
    near, far = (
        stability_region(
            printed_system, to_si(elevator_deg, "deg"), alpha_range_rad=(-to_si(c, "deg"), to_si(c, "deg"))
        )
        for c in (100.0, 250.0)
    )
    gained = far.area_rad2_s - near.area_rad2_s
    low, high = near.area_beyond_rad2_s
    assert 0.0 < low <= high < low * (1.0 + 1e-6)
    assert gained <= high
    assert gained == pytest.approx(low, rel=1e-4)


@pytest.mark.parametrize("elevator_deg", [0.0, -10.0, -25.0])
def test_a_tongue_holds_backward_orbits(printed_system: LienardSystem, elevator_deg: float) -> None:
    """The second road to the proof: orbits from the strip, integrated backward, stay between its two curves."""
    cut = to_si(100.0, "deg")
    region = stability_region(printed_system, to_si(elevator_deg, "deg"), alpha_range_rad=(-cut, cut))
    assert len(region.tongues) == len(region.boundary) // 2
    f, g = printed_system.damping.ascending, printed_system.force.ascending.copy()
    g[0] += printed_system.elevator_gain * region.elevator_rad
    value = np.polynomial.polynomial.polyval
    for tongue in region.tongues:
        assert tongue.obstacle == ""
        assert tongue.low_rad_s < tongue.high_rad_s
        assert np.sign(tongue.low_rad_s) == -np.sign(tongue.alpha_rad)
        for start in (tongue.low_rad_s, tongue.high_rad_s):
            low, high = tongue.slopes * abs(tongue.alpha_rad) ** tongue.power
            assert low * (1.0 - 1e-12) <= abs(start) <= high * (1.0 + 1e-12)
            end = solve_ivp(
                lambda x, y: value(x, f) + value(x, g) / y,  # dy/dx
                (tongue.alpha_rad, 2.0 * tongue.alpha_rad),
                [start],
                method="LSODA",
                rtol=1e-9,
                atol=1e-12,
            )
            held = np.abs(end.y[0]) / np.abs(end.t) ** tongue.power
            assert (tongue.slopes[0] * (1.0 - 1e-8) < held).all()  # of the integration
            assert (held < tongue.slopes[1] * (1.0 + 1e-8)).all()


def test_no_tongue_is_proved_where_orbits_turn_back() -> None:
    """Negative controls: damping or force of the other sign far out, a border that moves inward."""
    outward = Flow(damping=(0.0, 0.0, 1.0), force=(0.0, 0.0, 0.0, 1.0), force_sizes=(0.0, 0.0, 0.0, 1.0))
    assert backward_trap(outward, -10.0, (9.0, 11.0)).obstacle == ""
    assert backward_trap(outward, 10.0, (-11.0, -9.0)).rate > 0.0
    for flow, line, heights in (
        (replace(outward, damping=(0.0, 0.0, -1.0)), -10.0, (9.0, 11.0)),
        (replace(outward, force=(0.0, 0.0, 0.0, -1.0)), -10.0, (9.0, 11.0)),
        (outward, -10.0, (-11.0, -9.0)),
        (outward, -10.0, (-1.0, 9.0)),
        (replace(outward, force=(0.0, 1.0)), -10.0, (9.0, 11.0)),
    ):
        assert backward_trap(flow, line, heights).obstacle


@pytest.mark.parametrize(
    ("damping", "force", "difference"),
    [
        ((-0.4, -0.2, 0.5), (0.05, -1.0, -0.2, 1.0), 1e-8),  # saddles
        ((-1.0, 0.1, 1.0), (0.0, -1.0), 1e-8),  # a cycle
        (*_minus(0.79, 0.1, 0.0, 1.0), 1e-6),  # both, and the windings between them, which bend more
    ],
)
def test_area_and_escape_move_as_their_derivatives_say(
    damping: tuple[float, ...], force: tuple[float, ...], difference: float
) -> None:
    """Against central differences with a step of 1e-5."""

    def sizes(f: np.ndarray, g: np.ndarray) -> tuple[float, float]:
        flow = plain_flow(tuple(f), tuple(g))
        points = rests(flow)
        sink = next(point for point in points if point.kind.stable)
        found = basin(flow, points, sink, 3.0, 3.0)
        return area(flow, found, (-1.2, 3.0))[0], nearest(flow, found).distance

    flow = plain_flow(damping, force)
    points = rests(flow)
    found = basin(flow, points, next(point for point in points if point.kind.stable), 3.0, 3.0)
    by = np.array([area(flow, found, (-1.2, 3.0))[1], nearest(flow, found).by])
    row = np.array([*damping, *force])
    for k in range(0, row.size, 1 if difference < 1e-7 else 3):  # the windings take long to follow
        step = np.zeros(row.size)
        step[k] = 1e-5
        ends = [sizes(*np.split(row + sign * step, [len(damping)])) for sign in (1.0, -1.0)]
        slope = (np.array(ends[0]) - np.array(ends[1])) / 2e-5
        np.testing.assert_allclose(by[:, k], slope, rtol=difference, atol=30 * difference * np.abs(by).max())


def test_intervals_agree_with_samples(build_system: Build) -> None:
    """The delta method against 60 systems drawn from the covariance (1 % of each coefficient)."""
    damping, force = np.array([-0.4, -0.2, 0.5]), np.array([0.05, -1.0, -0.2, 1.0])
    theta = np.array([*damping, *force, 1.0])
    spread = 0.01 * np.abs(theta)

    def region(row: np.ndarray, covariance: np.ndarray | None = None):  # noqa: ANN202 - what it says
        system = build_system(row[:3], row[3:7], gain=row[7], covariance=covariance)
        return stability_region(system, 0.02, alpha_range_rad=(-3.0, 3.0))

    found = region(theta, np.diag(spread**2))
    generator = np.random.default_rng(3)
    drawn = [region(theta + spread * generator.normal(size=8)) for _ in range(60)]
    for values, interval in (
        ([one.area_rad2_s for one in drawn], found.area_interval_rad2_s),
        ([one.escape_distance_rad for one in drawn], found.escape_interval_rad),
    ):
        # A standard deviation of 60 samples is known to 9 %; three of that.
        assert np.std(values) == pytest.approx((interval[1] - interval[0]) / 2 / 1.96, rel=0.27)
        assert interval[0] < np.mean(values) < interval[1]


def test_the_boundary_moves_by_its_half_width(build_system: Build) -> None:
    """One uncertain coefficient: the boundary of the system moved by 1.96 deviations lies a half-width away."""
    damping, force = (-0.4, -0.2, 0.5), (0.05, -1.0, -0.2, 1.0)
    variance = np.zeros((8, 8))
    variance[0, 0] = 1e-9
    system = build_system(damping, force, covariance=variance)
    found = stability_region(system, 0.0, alpha_range_rad=(-3.0, 3.0))
    moved = plain_flow((damping[0] + 1.959964 * variance[0, 0] ** 0.5, *damping[1:]), force)
    points = rests(moved)
    after = basin(moved, points, next(point for point in points if point.kind.stable), 9.0, 3.0)
    for branch, other in zip(found.boundary, after.branches, strict=True):
        for k in range(4, min(len(branch.alpha_rad), 90), 9):
            x, y = branch.alpha_rad[k], branch.alpha_dot_rad_s[k]

            def distance(parameter: float, segment: Segment, x: float = x, y: float = y) -> float:
                there = segment.at(parameter)
                return float(np.hypot(there[0] - x, (there[1] - y) / found.frequency_rad_s))

            nearest_point = min(
                minimize_scalar(
                    distance, bounds=sorted((0.0, segment.span)), args=(segment,), options={"xatol": 1e-12}
                ).fun
                for segment in other.segments
            )
            assert nearest_point == pytest.approx(branch.half_width_rad[k], rel=2e-3)
