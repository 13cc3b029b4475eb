"""Branches of a planar field: complete, through folds, closed ones once; special points named for what they are."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.polynomial import polynomial as npp

from finback.arrays import FloatArray
from finback.dynamics.equilibrium import Kind
from finback.dynamics.fold import folds
from finback.dynamics.hopf import hopf_points, neutral_saddles
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.planar.branch import PlanarBranches, planar_branches
from finback.dynamics.planar.branch_point import Crossing
from finback.dynamics.planar.equilibrium import PlanarEquilibrium, planar_equilibria
from finback.dynamics.planar.fold import PlanarFold
from finback.dynamics.planar.hopf import PlanarHopf
from finback.dynamics.planar.path import BranchEnd
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import reduce

_NAMES = ("x_1", "y_1", "mu_1")
Terms = dict[tuple[int, ...], float]
_LOW, _HIGH = BranchEnd.PARAMETER_LOW, BranchEnd.PARAMETER_HIGH
_CLOSED = (BranchEnd.CLOSED, BranchEnd.CLOSED)


def _system(first: Terms, second: Terms) -> PlanarSystem:
    one, two = (Polynomial.build(t, variables=_NAMES, value_unit="1") for t in (first, second))
    return PlanarSystem.from_polynomials(one, two)


def _branches(
    system: PlanarSystem,
    parameters: tuple[float, float] = (-1.0, 1.0),
    *,
    at: tuple[float, ...] = (-1.0, -0.3, 0.4, 1.0),
    box: float = 2.0,
) -> PlanarBranches:
    starts = [point for parameter in at for point in planar_equilibria(system, parameter)]
    return planar_branches(system, parameters, np.array([[-box, box], [-box, box]]), starts)


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """The branches through all equilibria of a grid of parameters, within a box."""

    system: PlanarSystem
    box: np.ndarray  # type: ignore[type-arg]
    grid: list[float]
    equilibria: list[PlanarEquilibrium]
    found: PlanarBranches


def _drawn(
    system: PlanarSystem,
    parameters: tuple[float, float],
    step: float,
    first: tuple[float, float],
    second: tuple[float, float],
) -> Drawn:
    box = np.array([first, second])
    grid = np.linspace(*parameters, round((parameters[1] - parameters[0]) / step) + 1).tolist()
    every = [point for parameter in grid for point in planar_equilibria(system, parameter)]
    kept = [point for point in every if ((box[:, 0] <= point.state) & (point.state <= box[:, 1])).all()]
    found = planar_branches(system, parameters, box, kept)
    return Drawn(system=system, box=np.vstack([box, parameters]), grid=grid, equilibria=kept, found=found)


def _check(drawn: Drawn) -> None:
    """What must hold for any branches: everything on its branch, each point in its bracket, signs as stated."""
    system, found, box = drawn.system, drawn.found, drawn.box
    for branch in found.branches:
        places = np.column_stack([branch.state, branch.parameter])
        assert ((box[:, 0] - 1e-9 <= places) & (places <= box[:, 1] + 1e-9)).all()
        jacobian = system.jacobian(branch.state, branch.parameter)
        size = np.abs(jacobian).max(axis=(1, 2)) + 1.0
        assert (np.abs(system.velocity(branch.state, branch.parameter)).max(axis=1) <= 1e-11 * size).all()
        assert (np.abs(np.trace(jacobian, axis1=1, axis2=2) - branch.divergence) <= 1e-12 * size).all()
        assert (np.abs(np.linalg.det(jacobian) - branch.determinant) <= 1e-11 * size**2).all()
        assert (branch.stable == ((branch.divergence < 0) & (branch.determinant > 0))).all()
    for point in (*found.folds, *found.hopf_points, *found.neutral_saddles):
        place = np.array([*point.state, point.parameter])
        left, right = (end for end in point.bracket)
        assert np.abs(left - place).max() < 1e-3 * np.ptp(box, axis=1).max()
        values = []
        for end in (left, right):
            jacobian = system.jacobian(end[:2], end[2])
            fold = isinstance(point, PlanarFold)
            values.append(np.linalg.det(jacobian) if fold else np.trace(jacobian))
        assert np.sign(values[0]) == -np.sign(values[1]) != 0
        assert (point.state_interval[:, 0] <= point.state).all()
        assert (point.state <= point.state_interval[:, 1]).all()
        assert point.parameter_interval[0] <= point.parameter <= point.parameter_interval[1]


def test_the_published_branch_has_two_folds_and_no_hopf_point(
    paper_model: PolynomialModel, printed_system: LienardSystem
) -> None:
    for system, lienard in (
        (PlanarSystem.from_model(paper_model), reduce(paper_model)),
        (PlanarSystem.from_lienard(printed_system), printed_system),
    ):
        drawn = _drawn(system, (-1.0, 0.7), 0.1, (-1.2, 1.2), (-3.0, 3.0))
        _check(drawn)
        (branch,) = drawn.found.branches
        assert set(branch.ends) == {_LOW, _HIGH}
        assert sorted([branch.parameter[0], branch.parameter[-1]]) == [-1.0, 0.7]
        expected = sorted(folds(lienard), key=lambda fold: fold.elevator_rad)
        assert len(drawn.found.folds) == 2
        for mine, other in zip(drawn.found.folds, expected, strict=True):
            assert mine.parameter == pytest.approx(other.elevator_rad, abs=1e-14)
            assert mine.state[0] == pytest.approx(other.alpha_rad, abs=1e-14)
            assert mine.other_eigenvalue == pytest.approx(other.divergence_1_s, abs=1e-12)
            # Two equilibria exist on the side on which δ = −g/c₁ bends away.
            bend = float(lienard.force.derivative("alpha_rad").derivative("alpha_rad")(other.alpha_rad))
            assert np.sign(mine.curvature) == np.sign(-bend / lienard.elevator_gain)
        assert drawn.found.hopf_points == ()
        assert len(drawn.found.neutral_saddles) == len(neutral_saddles(lienard)) == 2
        assert drawn.found.branch_points == drawn.found.cusps == drawn.found.bogdanov_takens == ()


def _number(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda value: round(value, 4))


@st.composite
def models(draw: st.DrawFn) -> PolynomialModel:
    """A model of Liénard shape whose folds are at least 0.1 rad apart, with its covariance."""
    turns = tuple(k / 10.0 for k in sorted(draw(st.sets(st.integers(-9, 9), max_size=3))))
    slope = draw(st.sampled_from([-1.0, 1.0])) * draw(_number(3.0, 20.0)) * npp.polyfromroots(turns)
    force = npp.polyint(slope, k=[draw(_number(-0.5, 0.5))])
    zeros = tuple(k / 7.0 for k in sorted(draw(st.sets(st.integers(-6, 6), max_size=2))))
    damping = draw(st.sampled_from([-1.0, 1.0])) * draw(_number(0.5, 2.0)) * npp.polyfromroots(zeros)
    a_q, b_q, a_elevator = draw(_number(0.7, 1.3)), draw(_number(-1.0, 1.0)), draw(_number(-0.1, 0.1))
    gain = draw(st.sampled_from([-1.0, 1.0])) * draw(_number(2.0, 6.0))
    a = npp.polyint(npp.polysub(damping, [b_q]), k=[draw(_number(-0.2, 0.2))])
    b = npp.polyadd(force, b_q * a) / a_q

    def polynomial(row: np.ndarray, q: float, elevator: float, unit: str) -> Polynomial:  # type: ignore[type-arg]
        terms: Terms = {(k, 0, 0): float(value) for k, value in enumerate(row)}
        return Polynomial.build(terms | {(0, 1, 0): q, (0, 0, 1): elevator}, variables=VARIABLES, value_unit=unit)

    alpha_dot = polynomial(a, a_q, a_elevator, "rad_s")
    q_dot = polynomial(b, b_q, (gain + b_q * a_elevator) / a_q, "rad_s2")
    theta = np.concatenate([alpha_dot.coefficients, q_dot.coefficients])
    return PolynomialModel(alpha_dot=alpha_dot, q_dot=q_dot, covariance=np.diag(1e-6 * theta**2 + 1e-8))


@settings(deadline=None, max_examples=20, derandomize=True)
@given(models())
def test_both_roads_agree_on_any_lienard_system(model: PolynomialModel) -> None:
    """Folds, Hopf points and all that is said of them: from the Liénard closed forms and from the planar field."""
    lienard = reduce(model)
    angles = np.linspace(-1.0, 1.0, 201)
    held = lienard.holding_elevator(angles)
    wide, tall = float(np.ptp(held)) + 1.0, float(np.abs(lienard.pitch_rate(angles, held)).max()) + 1.0
    parameters = (float(held.min()) - 0.1, float(held.max()) + 0.1)
    ranges = (parameters, wide / 20.0, (-1.0, 1.0), (-3.0 * tall, 3.0 * tall))
    drawn = _drawn(PlanarSystem.from_model(model), *ranges)
    _check(drawn)
    found = drawn.found
    turned = [fold for fold in folds(lienard) if abs(fold.alpha_rad) < 1.0]
    # Both in the order of the angle: of points that share an elevator, rounding decides which elevator is greater.
    mine_turned = sorted(found.folds, key=lambda f: float(f.state[0]))
    for mine, theirs in zip(mine_turned, sorted(turned, key=lambda f: f.alpha_rad), strict=True):
        assert mine.parameter == pytest.approx(theirs.elevator_rad, abs=1e-10)
        np.testing.assert_allclose(mine.state, [theirs.alpha_rad, theirs.q_rad_s], rtol=0, atol=1e-10)
        _same_interval(mine.parameter_interval, theirs.elevator_interval_rad, atol=1e-8)
        _same_interval(mine.state_interval[0], theirs.alpha_interval_rad, atol=1e-8)
        _same_interval(mine.state_interval[1], theirs.q_interval_rad_s, atol=1e-7)
    born = [hopf for hopf in hopf_points(lienard) if abs(hopf.alpha_rad) < 1.0]
    mine_born = sorted(found.hopf_points, key=lambda h: float(h.state[0]))
    for own, other in zip(mine_born, sorted(born, key=lambda h: h.alpha_rad), strict=True):
        _same_hopf(own, other.elevator_rad, [other.alpha_rad, other.q_rad_s])
        assert own.frequency == pytest.approx(other.frequency_rad_s, abs=1e-10)
        assert own.lyapunov == pytest.approx(other.lyapunov_1_s, rel=1e-9, abs=1e-9)
        assert own.criticality == other.criticality
        assert own.crossing_speed == pytest.approx(other.crossing_speed_1_s, rel=1e-9)
        _same_interval(own.parameter_interval, other.elevator_interval_rad, atol=1e-8)
        _same_interval(own.lyapunov_interval, other.lyapunov_interval_1_s, rtol=1e-6, atol=1e-7)
    neutral = [saddle for saddle in neutral_saddles(lienard) if abs(saddle.alpha_rad) < 1.0]
    assert len(found.neutral_saddles) == len(neutral)
    # In (alpha, dα/dt) the same, but for the second state.
    other_plane = _drawn(PlanarSystem.from_lienard(lienard), *ranges).found
    other_turned, other_born = (
        sorted(points, key=lambda p: float(p.state[0])) for points in (other_plane.folds, other_plane.hopf_points)
    )
    for one, two in ((mine_turned, other_turned), (mine_born, other_born)):
        np.testing.assert_allclose([p.parameter for p in one], [p.parameter for p in two], rtol=0, atol=1e-10)
    np.testing.assert_allclose([h.lyapunov for h in mine_born], [h.lyapunov for h in other_born], rtol=1e-8, atol=1e-9)


def _same_interval(planar: FloatArray, lienard: FloatArray, *, atol: float, rtol: float = 0.0) -> None:
    """Compare; of a point that leaves its gradient within the errors the Liénard form alone states no interval."""
    if np.isfinite(lienard).all():
        np.testing.assert_allclose(planar, lienard, rtol=rtol, atol=atol)


def _same_hopf(own: PlanarHopf, parameter: float, state: list[float]) -> None:
    assert own.parameter == pytest.approx(parameter, abs=1e-10)
    np.testing.assert_allclose(own.state, state, rtol=0, atol=1e-10)


@settings(deadline=None, max_examples=12, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_every_equilibrium_lies_on_a_branch_and_counts_change_at_folds_only(seed: int) -> None:
    """Random fields with terms in xy and μ², whatever they do; branches are drawn from a few parameters only."""
    generator = np.random.default_rng(seed)
    powers = [(i, j, k) for i in range(4) for j in range(3) for k in range(3) if i + j + k <= 3]
    tables = generator.normal(size=(2, len(powers)))
    system = _system(*(dict(zip(powers, row.tolist(), strict=True)) for row in tables))
    drawn = _drawn(system, (-1.0, 1.0), 0.1, (-2.0, 2.0), (-2.0, 2.0))
    _check(drawn)
    places = [np.column_stack([b.state, b.parameter]) for b in drawn.found.branches]
    crossings = 0
    for row in places:
        signs = np.sign(row[:, 2] - 0.05)
        crossings += int((signs[1:] != signs[:-1]).sum())
    # The parameter 0.05 is not on the grid: the branches must know all that is there.
    inside = [p for p in planar_equilibria(system, 0.05) if (np.abs(p.state) <= 2.0).all()]
    assert crossings == len(inside)
    for low, high in pairwise(drawn.grid):
        here, there = (len([p for p in drawn.equilibria if p.parameter == parameter]) for parameter in (low, high))
        between = [f for f in drawn.found.folds if low < f.parameter < high]
        ends = [
            row[k, 2]
            for row, branch in zip(places, drawn.found.branches, strict=True)
            for k, end in ((0, branch.ends[0]), (-1, branch.ends[1]))
            if end is BranchEnd.BOX
        ]
        if not any(low <= value <= high for value in ends):
            assert there - here == sum(2 if fold.curvature > 0.0 else -2 for fold in between)
    # No branch is drawn twice.
    for one, two in pairwise(sorted(places, key=len)):
        middle = two[len(two) // 2]
        assert np.linalg.norm(one - middle, axis=1).min() > 1e-9


def test_a_closed_branch_is_not_retraced() -> None:
    """x² + μ² = 1/4: a circle of equilibria, met at one parameter only."""
    isola = _system({(2, 0, 0): 1.0, (0, 0, 2): 1.0, (0, 0, 0): -0.25}, {(0, 1, 0): -1.0, (1, 0, 0): 0.3})
    for at in ((0.1,), (-0.4, -0.1, 0.0, 0.3), (0.5,)):  # the last is the fold itself
        found = _branches(isola, at=at)
        (branch,) = found.branches
        assert branch.ends == _CLOSED
        assert branch.closed
        np.testing.assert_array_equal(branch.state[0], branch.state[-1])
        np.testing.assert_allclose(branch.state[:, 0] ** 2 + branch.parameter**2, 0.25, atol=1e-14)
        turns = np.unwrap(np.arctan2(branch.state[:, 0], branch.parameter))
        assert abs(turns[-1] - turns[0]) == pytest.approx(2.0 * np.pi)
        assert [fold.parameter for fold in found.folds] == [pytest.approx(-0.5), pytest.approx(0.5)]
        assert [np.sign(fold.curvature) for fold in found.folds] == [1.0, -1.0]


def test_disconnected_branches_are_all_found() -> None:
    """Three sheets, (x − 1.2)(x² − μ² − 0.1): the middle ones never meet within the range."""
    cubic = _system(
        {(3, 0, 0): 1.0, (1, 0, 2): -1.0, (1, 0, 0): -0.1, (2, 0, 0): -1.2, (0, 0, 2): 1.2, (0, 0, 0): 0.12},
        {(0, 1, 0): -1.0, (2, 0, 0): 0.5},
    )
    found = _branches(cubic, (-0.9, 0.9), at=(-0.5,))
    assert [set(b.ends) for b in found.branches] == [{_LOW, _HIGH}] * 3
    assert found.folds == ()


def test_a_branch_that_leaves_the_box_says_so() -> None:
    found = _branches(_system({(1, 0, 1): 1.0, (0, 0, 0): -0.5}, {(0, 1, 0): -1.0}), at=(-1.0, 1.0))
    assert [set(b.ends) for b in found.branches] == [{_LOW, BranchEnd.BOX}, {_HIGH, BranchEnd.BOX}]
    for branch in found.branches:
        assert np.abs(branch.state).max() == pytest.approx(2.0, abs=1e-15)
        assert np.abs(branch.parameter).min() == pytest.approx(0.25, abs=1e-12)


def test_a_branch_across_a_corner_of_the_box_ends_at_both_edges() -> None:
    """It begins on the lower end of the parameter and leaves through the edge of the box within one step."""
    corner = _system({(1, 0, 0): 1.0, (0, 0, 1): 0.5, (0, 0, 0): 2.49}, {(0, 1, 0): -1.0})
    (branch,) = _branches(corner, at=(-1.0,)).branches
    assert set(branch.ends) == {_LOW, BranchEnd.BOX}
    np.testing.assert_allclose(sorted(branch.parameter[[0, -1]]), [-1.0, -0.98], atol=1e-15)


@pytest.mark.parametrize("at", [(-1.0, 0.5), (-1.0, 0.0, 1.0), (-0.25, 0.25), (-0.6, 0.7)])
def test_branches_that_cross(at: tuple[float, ...]) -> None:
    transcritical = _branches(_system({(1, 0, 1): 1.0, (2, 0, 0): -1.0}, {(0, 1, 0): -1.5, (1, 0, 0): 0.2}), at=at)
    (point,) = transcritical.branch_points
    assert point.crossing is Crossing.TRANSCRITICAL
    assert abs(point.parameter) < 1e-14
    np.testing.assert_allclose(point.state, 0.0, atol=1e-14)
    directions = sorted(abs(float(row[0] / row[2])) for row in point.slopes)
    np.testing.assert_allclose(directions, [0.0, 1.0], atol=1e-12)
    assert len(transcritical.branches) == 2
    assert transcritical.folds == ()
    assert point.other_eigenvalue == pytest.approx(-1.5)

    pitchfork = _branches(_system({(1, 0, 1): 1.0, (3, 0, 0): -1.0}, {(0, 1, 0): -1.5, (1, 0, 0): 0.2}), at=at)
    (point,) = pitchfork.branch_points
    assert point.crossing is Crossing.PITCHFORK
    assert abs(point.parameter) < 1e-10
    assert pitchfork.folds == ()
    assert pitchfork.cusps == ()
    assert len(pitchfork.branches) == 2


def test_a_broken_pitchfork_is_a_fold() -> None:
    """Negative control: μ x − x³ + 0.01 has a fold where 4 μ³ = 27 · 0.0001, and no crossing."""
    found = _branches(_system({(1, 0, 1): 1.0, (3, 0, 0): -1.0, (0, 0, 0): 0.01}, {(0, 1, 0): -1.5}))
    assert found.branch_points == ()
    (fold,) = found.folds
    assert fold.parameter == pytest.approx((27e-4 / 4.0) ** (1.0 / 3.0), abs=1e-13)
    assert len(found.branches) == 2


@pytest.mark.parametrize("at", [(-1.0, 1.0), (-1.0, 0.0), (0.0,), (-0.37,)])
def test_a_cusp_is_no_fold(at: tuple[float, ...]) -> None:
    found = _branches(_system({(0, 0, 1): 1.0, (3, 0, 0): -1.0}, {(0, 1, 0): -1.0, (1, 0, 0): 0.3}), at=at)
    assert found.folds == ()
    (cusp,) = found.cusps
    np.testing.assert_allclose([*cusp.state, cusp.parameter], 0.0, atol=1e-8)
    # Opened by a little, it is two folds, however near: at x = ± sqrt(ε/3).
    for opening in (1e-2, 1e-6, 1e-10):
        two = _branches(
            _system({(0, 0, 1): 1.0, (3, 0, 0): -1.0, (1, 0, 0): opening}, {(0, 1, 0): -1.0, (1, 0, 0): 0.3})
        )
        place = (opening / 3.0) ** 0.5
        np.testing.assert_allclose(sorted(f.state[0] for f in two.folds), [-place, place], rtol=1e-5)
        assert two.cusps == ()
    # Closed by a little, it is nothing.
    none = _branches(_system({(0, 0, 1): 1.0, (3, 0, 0): -1.0, (1, 0, 0): -1e-6}, {(0, 1, 0): -1.0}))
    assert none.folds == none.cusps == ()


@pytest.mark.parametrize("at", [(0.0,), (-1.0, 0.0, 1.0), (-0.5, 0.5), (-0.3,)])
@pytest.mark.parametrize("edges", [(-1.0, 1.0), (0.0, 1.0), (-1.0, 0.0)])
def test_a_step_that_lands_on_a_point_reports_it(at: tuple[float, ...], edges: tuple[float, float]) -> None:
    """The path begins on the very point, ends on it, or passes it."""
    at = tuple(value for value in (*at, *edges) if edges[0] <= value <= edges[1])
    van_der_pol = _system({(0, 1, 0): 1.0}, {(0, 1, 1): 1.0, (2, 1, 0): -1.0, (1, 0, 0): -1.0})
    (hopf,) = _branches(van_der_pol, edges, at=at).hopf_points
    assert abs(hopf.parameter) < 1e-14
    parabola = _system({(0, 0, 1): 1.0, (2, 0, 0): -1.0}, {(0, 1, 0): -1.0, (1, 0, 0): 0.5})
    if edges[1] > 0.0:
        (fold,) = _branches(parabola, edges, at=at).folds
        assert abs(fold.parameter) < 1e-14
        assert fold.curvature > 0.0


def test_two_zeros_within_a_step_are_not_missed() -> None:
    """The trace is μ² − 10⁻⁸ at rest: two Hopf points, 2e-4 apart; μ² touches, μ² + 10⁻⁸ has none."""
    for shift, expected in ((-1e-8, [-1e-4, 1e-4]), (0.0, []), (1e-8, [])):
        system = _system({(0, 1, 0): 1.0}, {(0, 1, 2): 1.0, (0, 1, 0): shift, (2, 1, 0): -1.0, (1, 0, 0): -1.0})
        found = _branches(system, at=(-1.0,))
        np.testing.assert_allclose([h.parameter for h in found.hopf_points], expected, rtol=1e-10)


def test_a_conservative_branch_has_no_hopf_points() -> None:
    found = _branches(_system({(0, 1, 0): 1.0}, {(1, 0, 0): -1.0, (3, 0, 0): -0.3, (0, 0, 1): 0.3}))
    assert found.conservative
    assert found.hopf_points == ()
    assert not _branches(_system({(0, 0, 1): 1.0, (2, 0, 0): -1.0}, {(0, 1, 0): -1.0})).conservative


def test_fold_and_trace_zero_in_one_point_are_bogdanov_takens() -> None:
    def unfolded(trace: float) -> PlanarBranches:
        return _branches(_system({(0, 1, 0): 1.0}, {(0, 0, 1): 1.0, (0, 1, 0): trace, (2, 0, 0): 1.0, (1, 1, 0): 1.0}))

    found = unfolded(0.0)
    assert len(found.bogdanov_takens) == len(found.folds) == 1
    assert found.hopf_points == found.neutral_saddles == ()
    assert found.folds[0].quadratic == np.inf
    # Trace m2 + x on x = ∓ sqrt(−m1): m2 > 0 gives a Hopf point, m2 < 0 a neutral saddle, at m1 = −m2².
    for trace in (1e-3, 0.5):
        (hopf,) = unfolded(trace).hopf_points
        assert hopf.parameter == pytest.approx(-(trace**2), rel=1e-9)
        assert hopf.frequency == pytest.approx((2.0 * trace) ** 0.5, rel=1e-9)
        (saddle,) = unfolded(-trace).neutral_saddles
        assert saddle.parameter == pytest.approx(-(trace**2), rel=1e-9)
        assert saddle.eigenvalue == pytest.approx((2.0 * trace) ** 0.5, rel=1e-9)


def test_an_edge_of_the_box_may_be_an_invariant_line() -> None:
    """Predator and prey: equilibria on the axes lie on the edge of the positive quadrant."""
    system = _system({(1, 0, 0): 1.0, (2, 0, 0): -1.0, (1, 1, 0): -1.0}, {(0, 1, 1): -1.0, (1, 1, 0): 1.0})
    starts = [p for mu in (0.2, 0.7, 1.4) for p in planar_equilibria(system, mu)]
    found = planar_branches(system, (0.1, 1.5), np.array([[0.0, 2.0], [0.0, 2.0]]), starts)
    # x = y = 0, x = 1 and y = 0, and x = μ and y = 1 − μ, which leaves the quadrant where it crosses the second.
    assert len(found.branches) == 3
    assert [p.kind for p in planar_equilibria(system, 1.4)].count(Kind.STABLE_NODE) == 1
    (point,) = found.branch_points
    assert point.parameter == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(point.state, [1.0, 0.0], atol=1e-12)
