"""Curves of folds and Hopf points in two parameters, and the points on them, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.dynamics.continuation.branch import equilibrium_branch
from finback.dynamics.continuation.curve import fold_curve, hopf_curve
from finback.dynamics.continuation.curve_point import CodimensionTwo
from finback.dynamics.continuation.field import BlackBox
from finback.dynamics.continuation.path import RESIDUAL, Ending
from finback.errors import InputError, RefusedError

LOCATED = 1e-7
"""Of typical sizes: conditions are found to 1e-11 by differences, and some points are double."""

BOGDANOV_TAKENS = BlackBox(
    field=lambda x, m1, m2: [x[1], m1 + m2 * x[1] + x[0] ** 2 + x[0] * x[1]],
    state_box=np.array([[-2.0, 2.0], [-2.0, 2.0]]),
    parameter_range=np.array([[-1.0, 1.0], [-1.0, 1.0]]),
)


def test_the_curves_of_the_bogdanov_takens_normal_form() -> None:
    """Folds m1 = 0; Hopf points m1 = -m2² with x = -m2 for m2 > 0, neutral saddles on the other half."""
    folds = fold_curve(BOGDANOV_TAKENS, state=[0.1, 0.0], parameters=[0.05, 0.5])
    np.testing.assert_allclose(folds.parameters[:, 0], 0.0, atol=1e-10)
    assert np.sort(folds.parameters[[0, -1], 1]) == pytest.approx([-1.0, 1.0])
    assert (folds.residual <= RESIDUAL).all()
    hopfs = hopf_curve(BOGDANOV_TAKENS, state=[-0.5, 0.0], parameters=[-0.25, 0.5])
    np.testing.assert_allclose(hopfs.parameters[:, 0], -(hopfs.parameters[:, 1] ** 2), atol=1e-10)
    np.testing.assert_array_equal(hopfs.neutral, hopfs.parameters[:, 1] < 0.0)
    hopf = ~hopfs.neutral
    np.testing.assert_allclose(hopfs.frequency[hopf] ** 2, 2.0 * hopfs.parameters[hopf, 1], atol=1e-8)
    assert (hopfs.lyapunov[hopf] > 0.0).all()  # subcritical on the whole half
    for curve in (folds, hopfs):
        (point,) = curve.points
        assert point.kind is CodimensionTwo.BOGDANOV_TAKENS
        np.testing.assert_allclose([*point.parameters, *point.state], 0.0, atol=LOCATED)


@given(st.floats(0.2, 0.8), st.floats(0.2, 0.8))
@settings(max_examples=4, deadline=None, derandomize=True)
def test_the_bautin_point_of_the_cubic_lienard_family(a1: float, b1: float) -> None:
    """With y' = (-x² + a1 x + a0) y + (x² + b1 x + b0) x: Hopf points at a0 = 0, Bautin point at b0 = -a1 b1."""
    box = BlackBox(
        field=lambda x, b0, a0: [x[1], (-(x[0] ** 2) + a1 * x[0] + a0) * x[1] + (x[0] ** 2 + b1 * x[0] + b0) * x[0]],
        state_box=np.array([[-1.0, 1.0], [-1.0, 1.0]]),
        parameter_range=np.array([[-1.0, 0.2], [-0.5, 0.5]]),
    )
    curve = hopf_curve(box, state=[0.0, 0.0], parameters=[-0.9, 0.0])
    np.testing.assert_allclose(curve.parameters[:, 1], 0.0, atol=1e-9)
    points = {point.kind: point for point in curve.points}
    assert set(points) == {CodimensionTwo.BAUTIN, CodimensionTwo.BOGDANOV_TAKENS}
    assert points[CodimensionTwo.BAUTIN].parameters[0] == pytest.approx(-a1 * b1, abs=LOCATED)
    assert points[CodimensionTwo.BOGDANOV_TAKENS].parameters == pytest.approx([0.0, 0.0], abs=LOCATED)
    # a = (a1 b1 / -b0 - 1)/8 of r' = a r³ with x = r cos: |q|² = 1 there means r² = 4 |z|² / (1 + ω²).
    hopf = ~curve.neutral
    b0 = curve.parameters[hopf, 0]
    exact = (a1 * b1 / -b0 - 1.0) / 8.0 * 4.0 / (1.0 - b0) / np.sqrt(-b0)
    far = b0 < -0.05
    np.testing.assert_allclose(curve.lyapunov[hopf][far], exact[far], rtol=1e-5, atol=1e-7)


def test_the_cusp_of_a_cubic() -> None:
    box = BlackBox(
        field=lambda x, a, b: [a + b * x[0] - x[0] ** 3],
        state_box=np.array([[-1.0, 1.0]]),
        parameter_range=np.array([[-1.0, 1.0], [-1.0, 1.0]]),
    )
    (fold, _) = equilibrium_branch(box.held(second=0.3), state=[0.0], parameter=0.0).limit_points
    curve = fold_curve(box, state=fold.state, parameters=[fold.parameter, 0.3])
    a, b = curve.parameters.T
    np.testing.assert_allclose(27.0 * a**2, 4.0 * b**3, atol=1e-10)
    (cusp,) = curve.points
    assert cusp.kind is CodimensionTwo.CUSP
    np.testing.assert_allclose([*cusp.parameters, *cusp.state], 0.0, atol=LOCATED)
    assert (curve.beginning, curve.end) == (Ending.PARAMETER_LIMIT, Ending.PARAMETER_LIMIT)


def test_zero_hopf_and_double_hopf_points() -> None:
    """Uncoupled parts, so that each eigenvalue is a parameter."""
    zero = BlackBox(
        field=lambda x, m, n: [m + x[0] ** 2, (n + x[0]) * x[1] - x[2], x[1] + (n + x[0]) * x[2]],
        state_box=np.array([[-1.0, 1.0]] * 3),
        parameter_range=np.array([[-0.5, 0.5], [-0.5, 0.5]]),
    )
    (point,) = fold_curve(zero, state=[0.0, 0.0, 0.0], parameters=[0.0, 0.2]).points
    assert point.kind is CodimensionTwo.ZERO_HOPF
    np.testing.assert_allclose(point.parameters, 0.0, atol=LOCATED)
    points = hopf_curve(zero, state=[-0.2, 0.0, 0.0], parameters=[-0.04, 0.2]).points
    assert CodimensionTwo.ZERO_HOPF in {point.kind for point in points}

    def two(x: np.ndarray, m: float, n: float) -> list[float]:
        return [m * x[0] - x[1], x[0] + m * x[1], n * x[2] - 2.5 * x[3], 2.5 * x[2] + n * x[3]]

    double = BlackBox(
        field=two, state_box=np.array([[-1.0, 1.0]] * 4), parameter_range=np.array([[-0.5, 0.5], [-0.5, 0.5]])
    )
    curve = hopf_curve(double, state=np.zeros(4), parameters=[0.0, 0.3])
    assert [point.kind for point in curve.points if point.kind is not CodimensionTwo.BAUTIN] == [
        CodimensionTwo.DOUBLE_HOPF
    ]


def test_mistakes_are_told() -> None:
    with pytest.raises(InputError, match="two parameters"):
        fold_curve(BOGDANOV_TAKENS.held(second=0.0), state=[0.0, 0.0], parameters=[0.0, 0.0])
    line = BlackBox(field=lambda x, a, b: [a + b + x[0]], state_box=[[-1, 1]], parameter_range=[[-1, 1], [-1, 1]])
    with pytest.raises(InputError, match="no Hopf"):
        hopf_curve(line, state=[0.0], parameters=[0.0, 0.0])
    with pytest.raises(RefusedError, match="no point of the curve"):
        fold_curve(line, state=[0.0], parameters=[0.0, 0.0])
