"""Zeros of the trace: Hopf points with their criticality, neutral saddles, Bogdanov-Takens points."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.polynomial import polynomial as npp
from scipy.integrate import solve_ivp

from finback.dynamics.analysis import AnalysisOptions, analyze
from finback.dynamics.cycle.lyapunov import lyapunov_coefficients
from finback.dynamics.hopf import Criticality, bogdanov_takens_points, hopf_points, neutral_saddles
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.located import located
from finback.errors import InputError
from finback.units import from_si

Build = Callable[..., LienardSystem]
_COEFFICIENT = st.floats(-2.0, 2.0).map(lambda value: round(value, 3))


def test_the_trace_of_the_paper_vanishes_on_saddles_only(printed_system: LienardSystem) -> None:
    """Reference: zeros of f at alpha -19.928° and 29.643°, outside the stable branch: no Hopf point."""
    saddles = neutral_saddles(printed_system)
    assert [from_si(zero.alpha_rad, "deg") for zero in saddles] == pytest.approx([-19.928, 29.643], rel=0, abs=0.5e-3)
    assert hopf_points(printed_system) == bogdanov_takens_points(printed_system) == ()
    for saddle in saddles:
        assert saddle.elevator_rad == pytest.approx(float(printed_system.holding_elevator(saddle.alpha_rad)))
        slope = float(printed_system.force.derivative("alpha_rad")(saddle.alpha_rad))
        assert saddle.eigenvalue_1_s == pytest.approx(math.sqrt(slope), rel=1e-15)


def test_a_hopf_point_in_closed_form(build_system: Build) -> None:
    """With g = -4x and f = 0.2 - x - 3x²/2: ω = 2, f' = -1 - 3x, f'' = -3, g'' = 0."""
    system = build_system((0.2, -1.0, -1.5), (0.0, -4.0), gain=5.0)
    left, right = hopf_points(system)
    alpha = (-1.0 + math.sqrt(1.0 + 1.2)) / 3.0
    assert right.alpha_rad == pytest.approx(alpha, rel=1e-15)
    assert right.elevator_rad == pytest.approx(4.0 * alpha / 5.0, rel=1e-15)
    assert right.frequency_rad_s == 2.0
    assert right.lyapunov_1_s == pytest.approx(-3.0 / 16.0, rel=1e-15)
    assert right.q_rad_s == pytest.approx(0.5 * alpha)
    assert right.crossing_speed_1_s == pytest.approx((-1.0 - 3.0 * alpha) * 5.0 / 8.0, rel=1e-14)
    assert right.crossing_speed_1_s == pytest.approx(-left.crossing_speed_1_s, rel=1e-14)
    assert {left.criticality, right.criticality} == {Criticality.SUPERCRITICAL}
    assert neutral_saddles(system) == bogdanov_takens_points(system) == ()


@given(a1=_COEFFICIENT, b1=_COEFFICIENT, b0=st.floats(-3.0, -0.1).map(lambda value: round(value, 3)))
def test_the_cubic_family_has_the_coefficient_of_its_closed_form(a1: float, b1: float, b0: float) -> None:
    """(a1 b1 + b0) / (8 (-b0)); where that vanishes the second is 5/(48 ω²) (A5 = -1/(3 ω⁷), ξ = ω x)."""
    first, _ = lyapunov_coefficients((0.0, a1, -1.0), (0.0, b0, b1, 1.0), 0.0)
    assert first == pytest.approx((a1 * b1 + b0) / (-8.0 * b0), abs=1e-13)
    _, second = lyapunov_coefficients((0.0, -b0 / b1 if b1 else 0.0, -1.0), (0.0, b0, b1, 1.0), 0.0)
    if abs(b1) > 0.05:
        assert second == pytest.approx(5.0 / (48.0 * -b0), rel=1e-9)  # powers of b1/b0 cancel


@settings(deadline=None)
@given(
    st.lists(_COEFFICIENT, min_size=2, max_size=5),
    st.lists(_COEFFICIENT, min_size=1, max_size=4),
    st.floats(-1.0, 1.0).map(lambda value: round(value, 3)),
)
def test_the_coefficient_of_the_system_is_that_of_the_focus(
    build_system: Build, damping: list[float], rest: list[float], gain: float
) -> None:
    """Two roads: the closed form with its interval, and the series in Cherkas' coordinate."""
    system = build_system((0.1, *damping), (0.0, -1.5, *rest), gain=gain or 1.0)
    for point in hopf_points(system):
        first, _ = lyapunov_coefficients(system.damping.ascending, system.force.ascending, point.alpha_rad)
        scale = (1.0 + point.frequency_rad_s**-2) * (1.0 + abs(point.alpha_rad)) ** 9
        assert point.lyapunov_1_s == pytest.approx(first, abs=1e-11 * scale)


@pytest.mark.parametrize("frequency_squared", [1e-263, 1e-154, 1e-40, 1e40, 1e300])
def test_a_focus_of_any_frequency_has_its_coefficient(frequency_squared: float) -> None:
    """As x is counted in a large or small unit and time in another, the coefficient is f''/16 + f' g''/(16 ω²)."""
    for slope, curvature in ((0.5, 2.0), (-1e-20, 0.0), (0.0, 1.0)):
        first, _ = lyapunov_coefficients((0.0, slope, -1.0), (0.0, -frequency_squared, curvature, -1.0), 0.0)
        assert first == pytest.approx((-1.0 + slope * curvature / frequency_squared) / 8.0, rel=1e-13)


def test_a_saddle_has_no_such_coefficient() -> None:
    with pytest.raises(InputError, match="is no focus"):
        lyapunov_coefficients((0.0, 1.0), (0.0, 1e-300, 1.0, -1.0), 2e-263)


def _gain_of_one_turn(damping: tuple[float, ...], force: tuple[float, ...], x: float) -> float:
    """Return by how much an orbit from (x, 0) has moved outward after one turn, by DOP853."""

    def field(_: float, state: np.ndarray) -> list[float]:
        return [state[1], npp.polyval(state[0], damping) * state[1] + npp.polyval(state[0], force)]

    def crossing(_: float, state: np.ndarray) -> float:
        return float(state[1])

    crossing.terminal = True  # type: ignore[attr-defined]
    crossing.direction = -1.0  # type: ignore[attr-defined]
    first = solve_ivp(field, (0.0, 1.0), (x, 0.0), method="DOP853", rtol=1e-13, atol=1e-16)
    start = first.y[:, -1]
    found = solve_ivp(field, (1.0, 60.0), start, method="DOP853", rtol=1e-13, atol=1e-16, events=crossing)
    return float(found.y_events[0][-1, 0]) - x


def test_the_first_coefficient_is_the_measured_growth() -> None:
    damping, force = (0.0, 0.8, -1.3, 0.4), (0.0, -1.7, 0.9, -0.3, 0.2)
    first, _ = lyapunov_coefficients(damping, force, 0.0)
    for x, tolerance in ((0.02, 0.05), (0.005, 0.015)):  # the next term is smaller by x
        growth = _gain_of_one_turn(damping, force, x)
        assert growth == pytest.approx(2.0 * math.pi / math.sqrt(1.7) * first * x**3, rel=tolerance)


def test_the_second_coefficient_is_the_measured_growth() -> None:
    """With f' g'' = -f'' ω²: the first one vanishes."""
    damping, force = (0.0, 1.0, -0.9 / 1.7, 0.7, -0.5), (0.0, -1.7, 0.9, -0.3, 0.2)
    first, second = lyapunov_coefficients(damping, force, 0.0)
    assert first == pytest.approx(0.0, abs=1e-16)
    for x, tolerance in ((0.08, 0.3), (0.03, 0.12)):
        growth = _gain_of_one_turn(damping, force, x)
        assert growth == pytest.approx(2.0 * math.pi / math.sqrt(1.7) * second * x**5, rel=tolerance)


def test_criticality_is_undecided_where_rounding_hides_it(build_system: Build) -> None:
    """The Bautin point of the cubic family, a1 b1 = -b0, and its neighbors."""
    for b0, expected in (
        (-0.25, Criticality.DEGENERATE),
        (-0.25 - 1e-12, Criticality.SUPERCRITICAL),
        (-0.25 + 1e-12, Criticality.SUBCRITICAL),
    ):
        points = hopf_points(build_system((0.0, 0.5, -1.0), (0.0, b0, 0.5, 1.0)))
        assert [point.criticality for point in points if point.alpha_rad == 0.0] == [expected]


def test_trace_and_determinant_that_vanish_together(build_system: Build) -> None:
    """The normal form u'' = a u² + b u u' itself: g = 2x², f = 3x, shifted by 1/4."""
    system = build_system((-0.75, 3.0), (0.125, -1.0, 2.0))
    assert hopf_points(system) == neutral_saddles(system) == ()
    (point,) = bogdanov_takens_points(system)
    assert (point.alpha_rad, point.elevator_rad) == (0.25, 0.0)
    assert (point.force_curvature_1_s2, point.damping_slope_1_s) == (2.0, 3.0)
    assert (point.residual, point.determinant_1_s2) == (0.0, 0.0)


def test_a_step_that_lands_on_a_hopf_point_does_not_hide_it(build_system: Build) -> None:
    """The trace of (0, 0) is zero at elevator 0 exactly, which is a node of the elevator grid and of the branch."""
    system = build_system((0.0, 0.5, -1.0), (0.0, -0.35, 0.5, 1.0))
    options = AnalysisOptions(
        elevator_range_rad=(-0.02, 0.02), elevator_step_rad=0.01, alpha_range_rad=(-0.25, 0.25), branch_points=11
    )
    analysis = analyze(system, options)
    assert 0.0 in analysis.branch.alpha_rad
    assert 0.0 in [point.elevator_rad for point in analysis.equilibria]
    (point,) = analysis.hopf_points
    assert (point.alpha_rad, point.elevator_rad, point.residual) == (0.0, 0.0, 0.0)
    assert point.criticality is Criticality.SUPERCRITICAL
    assert [one.parameter.value for one in located(analysis) if one.kind == "hopf"] == [0.0]
    # Off the node it is the same point.
    shifted = replace(options, elevator_range_rad=(-0.0213, 0.0187), branch_points=12)
    assert analyze(system, shifted).hopf_points[0].elevator_rad == 0.0


def test_without_effect_or_damping_there_is_no_point(build_system: Build) -> None:
    for system in (build_system((0.2, -1.0), (0.0, -1.0), gain=0.0), build_system((0.0,), (0.0, -1.0))):
        assert hopf_points(system) == neutral_saddles(system) == bogdanov_takens_points(system) == ()


@pytest.mark.parametrize("index", range(8))
def test_one_uncertain_coefficient_moves_a_hopf_point_as_its_interval_says(build_system: Build, index: int) -> None:
    """The delta method, coefficient by coefficient, against a central difference."""
    theta = np.array([0.1, 0.5, -1.0, 0.05, -0.35, 0.5, 1.0, 1.3])
    step = 1e-5

    def located(values: np.ndarray, covariance: np.ndarray | None = None) -> np.ndarray:
        system = build_system(values[:3], values[3:7], gain=values[7], covariance=covariance)
        point = min(hopf_points(system), key=lambda point: abs(point.alpha_rad + 0.15))
        rows = (
            (point.elevator_rad, point.elevator_interval_rad),
            (point.alpha_rad, point.alpha_interval_rad),
            (point.lyapunov_1_s, point.lyapunov_interval_1_s),
        )
        return np.array([(value, 0.5 * (high - low)) for value, (low, high) in rows])

    shift = step * np.eye(8)[index]
    change = 0.5 * np.abs(located(theta + shift)[:, 0] - located(theta - shift)[:, 0])
    half = located(theta, np.outer(shift, shift))[:, 1] / 1.959963984540054
    # The difference errs by the third derivative (1e-9 relative) and by the rounding of the values over the step.
    np.testing.assert_allclose(half, change, rtol=1e-6, atol=1e-15)
