"""Branches of equilibria of fields given only as functions: closed forms, corners, ends, search."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.arrays import FloatArray
from finback.dynamics.continuation.branch import EquilibriumBranch, equilibrium_branch, other_branch
from finback.dynamics.continuation.branch_point import Crossing
from finback.dynamics.continuation.field import BlackBox
from finback.dynamics.continuation.hopf import Criticality
from finback.dynamics.continuation.path import RESIDUAL, ContinuationOptions, Ending
from finback.dynamics.continuation.search import SearchOptions, equilibria_in_box, equilibrium_branches, states_at
from finback.errors import InputError, RefusedError

LOCATED = 1e-8
"""Relative to the typical sizes: what is promised of a located point; measured 1e-10."""
CORNER = 1e-12
"""Of typical sizes: a corner is found to the rounding of the golden section."""

Rates = Callable[..., list[float]]


def line(field: Rates, low: float = -1.0, high: float = 1.0, size: float = 2.0) -> BlackBox:
    return BlackBox(field=field, state_box=np.array([[-size, size]]), parameter_range=np.array([low, high]))


def lorenz(x: FloatArray, r: float) -> list[float]:
    return [10.0 * (x[1] - x[0]), r * x[0] - x[1] - x[0] * x[2], x[0] * x[1] - 8.0 / 3.0 * x[2]]


LORENZ = BlackBox(
    field=lorenz,
    state_box=np.array([[-30.0, 30.0], [-30.0, 30.0], [-5.0, 60.0]]),
    parameter_range=np.array([0.0, 40.0]),
)


def assert_consistent(branch: EquilibriumBranch) -> None:
    """What must hold for any branch."""
    assert (branch.residual <= RESIDUAL).all()
    assert (branch.stable == (branch.eigenvalues_real < 0.0).all(axis=1)).all()
    for point in (*branch.limit_points, *branch.hopf_points, *branch.neutral_saddles, *branch.branch_points):
        assert point.residual <= RESIDUAL
        low, high = np.sort(point.bracket_state, axis=0)
        slack = 1e-9 * np.maximum(1.0, np.abs(point.state))
        assert ((low - slack <= point.state) & (point.state <= high + slack)).all()


def test_the_folds_of_a_cubic() -> None:
    branch = equilibrium_branch(line(lambda x, m: [m + x[0] - x[0] ** 3]), state=[0.0], parameter=0.0)
    assert_consistent(branch)
    low, high = sorted(branch.limit_points, key=lambda point: point.parameter)
    for point, sign in ((low, -1.0), (high, 1.0)):
        assert point.parameter == pytest.approx(sign * 2.0 / 27.0**0.5, abs=1e-14)
        assert point.state[0] == pytest.approx(-sign / 3.0**0.5, abs=LOCATED)
        assert point.opens == -sign
        # parameter = x³ - x, so its second derivative by x is 6 x; a direction of length 1 is 2 in x.
        assert point.curvature == pytest.approx(0.5 * 6.0 * point.state[0] * 4.0, rel=1e-6)
        assert not point.corner
    assert (branch.beginning, branch.end) == (Ending.PARAMETER_LIMIT, Ending.PARAMETER_LIMIT)
    assert np.sort(branch.parameter[[0, -1]]) == pytest.approx([-1.0, 1.0], abs=1e-15)


@given(st.floats(-0.3, 0.3))
@settings(max_examples=25, deadline=None)
def test_a_branch_passes_every_parameter_where_the_polynomial_has_a_root(parameter: float) -> None:
    if abs(abs(parameter) - 2.0 / 27.0**0.5) < 1e-6:
        return
    box = line(lambda x, m: [m + x[0] - x[0] ** 3])
    branch = equilibrium_branch(box, state=[0.0], parameter=0.0)
    roots = np.roots([-1.0, 0.0, 1.0, parameter])
    real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
    found = np.sort([state[0] for state in states_at(box, branch, parameter)])
    np.testing.assert_allclose(found, real, atol=1e-10)


def test_a_closed_branch_is_run_once() -> None:
    box = line(lambda x, m: [x[0] ** 2 + m**2 - 0.25])
    branch = equilibrium_branch(box, state=[0.5], parameter=0.0)
    assert (branch.beginning, branch.end) == (Ending.CLOSED, Ending.CLOSED)
    angle = np.unwrap(np.arctan2(branch.parameter, branch.state[:, 0]))
    assert abs(angle[-1] - angle[0]) == pytest.approx(2.0 * math.pi, abs=1e-9)
    assert sorted(point.parameter for point in branch.limit_points) == pytest.approx([-0.5, 0.5], abs=1e-12)
    assert len(equilibrium_branches(box).branches) == 1


def test_every_end_is_named() -> None:
    straight = line(lambda x, m: [m - x[0]], size=0.5)
    branch = equilibrium_branch(straight, state=[0.0], parameter=0.0)
    assert (branch.beginning, branch.end) == (Ending.STATE_LIMIT, Ending.STATE_LIMIT)
    assert np.sort(branch.state[[0, -1], 0]) == pytest.approx([-0.5, 0.5], abs=1e-12)

    def half(x: FloatArray, m: float) -> list[float]:
        return [m - math.sqrt(x[0]) + 0.3]

    branch = equilibrium_branch(line(half), state=[0.3], parameter=0.2)
    assert branch.beginning is Ending.FIELD_FAILED
    assert "math domain error" in branch.beginning_note
    assert branch.state[0, 0] < 1e-4  # up to where the root ends
    few = equilibrium_branch(straight, state=[0.0], parameter=0.0, options=ContinuationOptions(most_points=3))
    assert few.end is Ending.POINTS_USED_UP

    def stops(x: FloatArray, m: float) -> list[float]:
        return [m - x[0] if x[0] < 0.2 else 1.0 + m]

    assert equilibrium_branch(line(stops), state=[0.0], parameter=0.0).end is Ending.STEP_TOO_SMALL


@pytest.mark.parametrize("slope", [0.05, 0.3, 1.0, 3.0, 20.0])
@pytest.mark.parametrize("other", [1.0, 2.5])
def test_a_fold_at_a_corner_is_the_corner(slope: float, other: float) -> None:
    """The curve turns by up to 177 degrees in typical sizes: no plane across its tangent meets it again."""
    corner = 0.1234

    def vee(x: FloatArray, m: float) -> list[float]:
        away = x[0] - corner
        return [-m - slope * (away if away > 0.0 else -other * away)]

    branch = equilibrium_branch(line(vee), state=[corner + 0.01], parameter=-0.01 * slope)
    assert_consistent(branch)
    (point,) = branch.limit_points
    assert point.corner
    assert point.opens == -1
    assert math.isnan(point.curvature)
    assert point.state[0] == pytest.approx(corner, abs=10 * CORNER)
    assert point.parameter == pytest.approx(0.0, abs=max(1.0, slope) * 10 * CORNER)


def test_a_table_is_followed_through_all_its_corners() -> None:
    """A sawtooth of 40 corners, half of them folds, and no step left over."""
    knots = np.linspace(-1.0, 1.0, 41)
    heights = 0.3 * np.where(np.arange(41) % 2, 1.0, -1.0) + 0.4 * knots

    def table(x: FloatArray, m: float) -> list[float]:
        return [m - float(np.interp(x[0], knots, heights))]

    box = BlackBox(field=table, state_box=np.array([[-0.99, 0.99]]), parameter_range=np.array([-1.0, 1.0]))
    branch = equilibrium_branch(box, state=[-0.95 + 1e-3], parameter=heights[1])
    assert (branch.beginning, branch.end) == (Ending.STATE_LIMIT, Ending.STATE_LIMIT)
    found = sorted((point.state[0], point.parameter) for point in branch.limit_points)
    np.testing.assert_allclose(found, np.column_stack((knots, heights))[1:-1], atol=100 * CORNER)
    assert all(point.corner for point in branch.limit_points)


def test_a_pitchfork_and_its_other_branch() -> None:
    box = line(lambda x, m: [m * x[0] - x[0] ** 3])
    branch = equilibrium_branch(box, state=[0.0], parameter=-0.5)
    (cross,) = branch.branch_points
    assert cross.kind is Crossing.PITCHFORK
    assert cross.parameter == pytest.approx(0.0, abs=LOCATED)
    assert not branch.limit_points
    other = other_branch(box, cross)
    np.testing.assert_allclose(other.state[:, 0] ** 2, other.parameter, atol=1e-10)
    assert other.state[:, 0].min() == pytest.approx(-1.0)
    assert other.state[:, 0].max() == pytest.approx(1.0)
    assert not other.limit_points  # the turn at a branch point is no fold


def test_a_transcritical_point_and_an_imperfect_one() -> None:
    box = line(lambda x, m: [m * x[0] - x[0] ** 2])
    (cross,) = equilibrium_branch(box, state=[0.0], parameter=-0.5).branch_points
    assert cross.kind is Crossing.TRANSCRITICAL
    assert cross.parameter == pytest.approx(0.0, abs=LOCATED)
    assert len(equilibrium_branches(box).branches) == 2
    broken = line(lambda x, m: [m * x[0] - x[0] ** 2 + 1e-5])  # the branches pass each other
    picture = equilibrium_branches(broken)
    assert len(picture.branches) == 2
    assert not any(branch.branch_points for branch in picture.branches)
    folded = line(lambda x, m: [m * x[0] - x[0] ** 2 - 1e-4])  # or turn back, at m = ±0.02
    assert [p.parameter for p in equilibrium_branches(folded).limit_points] == pytest.approx([-0.02, 0.02], abs=1e-12)


def test_the_lorenz_equations() -> None:
    """Pitchfork at r = 1, neutral saddle at r = (trace), subcritical Hopf points (Lorenz 1963; Marsden & McCracken)."""
    picture = equilibrium_branches(LORENZ)
    assert len(picture.branches) == 2
    (trunk,) = [b for b in picture.branches if np.abs(b.state).max() < 1e-9]
    assert trunk.branch_points[0].parameter == pytest.approx(1.0, abs=LOCATED)
    first, second = picture.hopf_points
    exact = 10.0 * (10.0 + 8.0 / 3.0 + 3.0) / (10.0 - 8.0 / 3.0 - 1.0)
    for point in (first, second):
        assert point.parameter == pytest.approx(exact, rel=LOCATED)
        assert point.frequency == pytest.approx((8.0 / 3.0 * (exact + 10.0)) ** 0.5, rel=LOCATED)
        assert point.criticality is Criticality.SUBCRITICAL
        assert abs(point.test) < 1e-8
        assert point.crossing_speed > 0.0
    assert first.state[0] == pytest.approx(-second.state[0])
    # at the origin the stable z-direction and the unstable one become opposite: r = 1 + (8/3)(8/3 + 11)/10
    (neutral,) = trunk.neutral_saddles
    assert neutral.parameter == pytest.approx(1.0 + 8.0 / 3.0 * (8.0 / 3.0 + 11.0) / 10.0, rel=LOCATED)
    assert neutral.eigenvalue == pytest.approx(8.0 / 3.0, rel=LOCATED)


def test_a_hopf_point_on_which_a_step_lands_is_not_lost() -> None:
    """The linear parameter steps of this branch are exact in binary, one of them is the Hopf point itself."""

    def field(x: FloatArray, m: float) -> list[float]:
        return [m * x[0] - x[1] - x[0] ** 3, x[0] + m * x[1]]

    box = BlackBox(field=field, state_box=np.array([[-1.0, 1.0]] * 2), parameter_range=np.array([-1.0, 1.0]))
    for start in (-0.5, 0.0, -0.25, -(2.0**-6)):  # also from the Hopf point itself
        for step in (0.125, 0.0625, 0.03125):
            options = ContinuationOptions(largest_step=step)
            branch = equilibrium_branch(box, state=[0.0, 0.0], parameter=start, options=options)
            assert [point.parameter for point in branch.hopf_points] == pytest.approx([0.0], abs=LOCATED)


@given(st.floats(0.5, 2.0), st.floats(0.5, 2.0))
@settings(max_examples=15, deadline=None)
def test_the_lyapunov_coefficient_is_that_of_the_planar_closed_form(a: float, scale: float) -> None:
    """Brusselator: Hopf at b = 1 + a²; the coefficient against Guckenheimer & Holmes (1983), Eq. 3.4.11."""

    def field(x: FloatArray, b: float) -> list[float]:
        return [a - (b + 1.0) * x[0] + x[0] ** 2 * x[1], b * x[0] - x[0] ** 2 * x[1]]

    box = BlackBox(
        field=field,
        state_box=np.array([[0.0, 8.0], [0.0, 8.0]]),
        parameter_range=np.array([0.2, 6.0]),
        state_scale=np.array([scale, 1.0]),
    )
    branch = equilibrium_branch(box, state=[a, 0.5 / a], parameter=0.5)
    (point,) = branch.hopf_points
    assert point.parameter == pytest.approx(1.0 + a * a, rel=LOCATED)
    assert point.frequency == pytest.approx(a, rel=LOCATED)
    assert point.crossing_speed == pytest.approx(0.5, rel=1e-5)  # a difference of differences
    assert point.criticality is Criticality.SUPERCRITICAL
    assert point.lyapunov == pytest.approx(_guckenheimer_holmes(a), rel=1e-6)


def _guckenheimer_holmes(a: float) -> float:
    """The radial cubic coefficient in coordinates (ξ, η) with x = (1, 0) ξ scaled ..., converted to |q| = 1.

    With A = [[a², a²], [-1-a², -a²]] the real Jordan basis is x = Re(q) u - Im(q) v, in which r' = l r³ with
    l = (f_uuu + f_uvv + g_uuv + g_vvv)/16 + (f_uv (f_uu + f_vv) - g_uv (g_uu + g_vv) - f_uu g_uu + f_vv g_vv)/(16 ω).
    Kuznetsov's coefficient for |q| = 1 is 2 l / ω there, since x = 2 Re(z q).
    """
    omega = a
    matrix = np.array([[a * a, a * a], [-1.0 - a * a, -a * a]])
    values, vectors = np.linalg.eig(matrix)
    q = vectors[:, int(np.argmax(values.imag))]
    q = q / np.linalg.norm(q)
    basis = np.column_stack((2.0 * q.real, -2.0 * q.imag))  # x = basis (u, v), z = u + i v turns by +ω
    inverse = np.linalg.inv(basis)
    # f = (b/a x1² + 2 a x1 x2 + x1² x2)(1, -1), b = 1 + a²
    hessian = np.array([[2.0 * (1.0 + a * a) / a, 2.0 * a], [2.0 * a, 0.0]])
    second = basis.T @ hessian @ basis
    direction = inverse @ np.array([1.0, -1.0])
    c1, c2 = basis

    def third(i: int, j: int, k: int) -> float:
        return 2.0 * (c1[i] * c1[j] * c2[k] + c1[i] * c2[j] * c1[k] + c2[i] * c1[j] * c1[k])

    f2, g2 = direction[0] * second, direction[1] * second
    cubic = direction[0] * (third(0, 0, 0) + third(0, 1, 1)) + direction[1] * (third(0, 0, 1) + third(1, 1, 1))
    quadratic = (
        f2[0, 1] * (f2[0, 0] + f2[1, 1]) - g2[0, 1] * (g2[0, 0] + g2[1, 1]) - f2[0, 0] * g2[0, 0] + f2[1, 1] * g2[1, 1]
    )
    return float((cubic / 16.0 + quadratic / (16.0 * omega)) / omega)


def test_a_given_jacobian_is_used_and_checked() -> None:
    calls = []

    def jacobian(x: FloatArray, m: float) -> FloatArray:
        calls.append(m)
        return np.array([[1.0 - 3.0 * x[0] ** 2, 1.0]])

    box = BlackBox(
        field=lambda x, m: [m + x[0] - x[0] ** 3],
        state_box=np.array([[-2.0, 2.0]]),
        parameter_range=np.array([-1.0, 1.0]),
        jacobian=jacobian,
    )
    branch = equilibrium_branch(box, state=[0.0], parameter=0.0)
    assert calls
    assert sorted(p.parameter for p in branch.limit_points) == pytest.approx([-2 / 27**0.5, 2 / 27**0.5], abs=1e-14)


def test_all_nine_equilibria_of_a_box_are_found() -> None:
    box = BlackBox(
        field=lambda x, m: [x[0] ** 3 - x[0] - m + 0.1 * x[1], (x[1] ** 2 - 1.0) * (x[1] - 0.3)],
        state_box=np.array([[-2.0, 2.0], [-2.0, 2.0]]),
        parameter_range=np.array([-0.5, 0.5]),
    )
    found = equilibria_in_box(box, 0.0)
    assert len(found.state) == 9
    assert (found.residual <= RESIDUAL).all()
    picture = equilibrium_branches(box)
    assert len(picture.branches) == 3
    assert len(picture.limit_points) == 6
    nothing = BlackBox(field=lambda x, m: [1.0 + x[0] ** 2 + m * m], state_box=[[-1, 1]], parameter_range=[-1, 1])
    assert equilibria_in_box(nothing, 0.0).state.shape == (0, 1)
    assert equilibrium_branches(nothing).branches == ()


def test_one_parameter_of_two_can_be_held() -> None:
    box = BlackBox(
        field=lambda x, a, b: [a + b * x[0] - x[0] ** 3],
        state_box=np.array([[-2.0, 2.0]]),
        parameter_range=np.array([[-1.0, 1.0], [-1.0, 1.0]]),
        jacobian=lambda x, _, b: np.array([[b - 3.0 * x[0] ** 2, 1.0, x[0]]]),
    )
    with pytest.raises(InputError, match="2 parameters"):
        equilibrium_branch(box, state=[0.0], parameter=0.0)
    branch = equilibrium_branch(box.held(second=0.75), state=[0.0], parameter=0.0)
    assert sorted(p.parameter for p in branch.limit_points) == pytest.approx([-0.25, 0.25], abs=1e-12)
    branch = equilibrium_branch(box.held(first=0.0), state=[0.0], parameter=0.5)
    assert branch.branch_points[0].kind is Crossing.PITCHFORK
    with pytest.raises(InputError, match="cannot be held"):
        box.held(first=0.0, second=0.0)


def test_mistakes_are_told() -> None:
    with pytest.raises(InputError, match="state_box"):
        BlackBox(field=lambda x, _: x, state_box=[[1.0, -1.0]], parameter_range=[-1, 1])
    with pytest.raises(InputError, match="state_scale"):
        BlackBox(field=lambda x, _: x, state_box=[[-1.0, 1.0]], parameter_range=[-1, 1], state_scale=[0.0])
    with pytest.raises(InputError, match="returns shape"):
        equilibrium_branch(line(lambda _, m: [m, m]), state=[0.0], parameter=0.0)
    with pytest.raises(InputError, match="finite states"):
        equilibrium_branch(line(lambda _, m: [m]), state=[math.nan], parameter=0.0)
    with pytest.raises(RefusedError, match="no equilibrium"):
        equilibrium_branch(line(lambda x, m: [1.0 + x[0] ** 2 + m * m]), state=[0.5], parameter=0.0)
    with pytest.raises(RefusedError, match="anywhere in the box"):
        equilibrium_branch(line(lambda *_: [math.nan]), state=[0.0], parameter=0.0)
    with pytest.raises(InputError, match="steps from"):
        ContinuationOptions(largest_step=0.0)
    with pytest.raises(InputError, match="power of two"):
        SearchOptions(starts=3)
    wrong = BlackBox(
        field=lambda x, m: [m - x[0]], state_box=[[-1, 1]], parameter_range=[-1, 1], jacobian=lambda *_: np.eye(3)
    )
    with pytest.raises(InputError, match="Jacobian has shape"):
        equilibrium_branch(wrong, state=[0.0], parameter=0.0)
