"""Families of cycles of fields given only as functions: closed forms, references, integration as the second road."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.dynamics.continuation.branch import equilibrium_branch
from finback.dynamics.continuation.cycle import (
    CycleBranch,
    CycleEnding,
    CycleOptions,
    cycles_from_hopf,
    cycles_from_orbit,
)
from finback.dynamics.continuation.cycle_point import CycleHappening
from finback.dynamics.continuation.field import BlackBox, FieldError, ScaledField
from finback.dynamics.continuation.path import RESIDUAL
from finback.errors import InputError, RefusedError

COLLOCATION = 1e-7
"""Relative, of period and extent with 30 intervals of degree four; measured 1e-9 to 3e-8."""
MULTIPLIER = 1e-5
"""Of multipliers of size 1; their integrals converge as fast as the orbit, but are longer."""


def assert_consistent(family: CycleBranch) -> None:
    assert (family.residual <= RESIDUAL).all()
    moduli = np.hypot(family.multipliers_real, family.multipliers_imag)
    known = family.trivial_error < 1e-3
    others = np.sort(np.abs(family.multipliers_real + 1j * family.multipliers_imag - 1.0), axis=1)[:, 1:]
    clear = known & (np.abs(np.sort(moduli, axis=1) - 1.0).min(axis=1) < 1e-3) & (others.min(axis=1) > 1e-2)
    assert (family.stable == (np.sum(moduli < 1.0 - 1e-4, axis=1) == moduli.shape[1] - 1))[clear].all()
    np.testing.assert_array_equal(family.orbit_state[:, 0], family.orbit_state[:, -1])
    assert (family.orbit_state.min(axis=1) >= family.state_min - 1e-9 * np.abs(family.state_min)).all()
    assert (family.orbit_state.max(axis=1) <= family.state_max + 1e-9 * np.abs(family.state_max)).all()


def rotor(x: FloatArray, growth: float) -> list[float]:
    """In polar coordinates r' = r (growth - r²), a turn in 2π / 1.5."""
    square = x[0] ** 2 + x[1] ** 2
    return [(growth - square) * x[0] - 1.5 * x[1], 1.5 * x[0] + (growth - square) * x[1]]


def plane(field: object, low: float, high: float, size: float = 1.0, **sizes: list[float]) -> BlackBox:
    return BlackBox(
        field=field, state_box=np.array([[-size, size]] * 2), parameter_range=np.array([low, high]), **sizes
    )


def test_the_cycles_of_a_normal_form_are_circles() -> None:
    box = plane(rotor, -0.2, 0.5)
    (hopf,) = equilibrium_branch(box, state=[0.0, 0.0], parameter=-0.1).hopf_points
    family = cycles_from_hopf(box, hopf)
    assert_consistent(family)
    assert family.end is CycleEnding.PARAMETER_LIMIT
    np.testing.assert_allclose(family.state_max[:, 0], np.sqrt(family.parameter), rtol=COLLOCATION)
    np.testing.assert_allclose(family.period, 2.0 * math.pi / 1.5, rtol=COLLOCATION)
    exact = np.exp(-2.0 * family.parameter * family.period)
    np.testing.assert_allclose(np.min(family.multipliers_real, axis=1), exact, atol=MULTIPLIER)
    assert family.stable.all()
    assert family.points == ()


def test_many_points_at_once_are_each_point() -> None:
    """The rates and Jacobians of a whole orbit, against those of its points, bit for bit; what fails is named."""
    box = plane(lambda x, m: [math.sqrt(x[0] + m) * x[1], x[0] ** 3 - x[1] * m], 1.5, 2.0)
    scaled = ScaledField(box)
    points = np.random.default_rng(5).uniform(-1.0, 1.0, size=(40, 3)) + np.array([0.0, 0.0, 12.0])
    np.testing.assert_array_equal(scaled.along(points), [scaled(point) for point in points])
    np.testing.assert_array_equal(scaled.jacobians(points), [scaled.jacobian(point) for point in points])
    points[7, 0] = -9.0
    with pytest.raises(FieldError, match="at state"):
        scaled.along(points)


def test_a_family_that_ends_at_another_hopf_point_says_so() -> None:
    box = plane(lambda x, m: rotor(x, m * (1.0 - m)), -0.2, 1.2)
    first, last = equilibrium_branch(box, state=[0.0, 0.0], parameter=-0.1).hopf_points
    assert (first.parameter, last.parameter) == pytest.approx((0.0, 1.0), abs=1e-8)
    family = cycles_from_hopf(box, first, CycleOptions(intervals=12))
    assert family.end is CycleEnding.HOPF_POINT
    assert family.parameter[-1] == pytest.approx(1.0, abs=0.05)
    assert family.state_max[:, 0].max() == pytest.approx(0.5, abs=0.01)


def lienard(x: FloatArray, a0: float, b0: float) -> list[float]:
    return [x[1], (-(x[0] ** 2) + 0.5 * x[0] + a0) * x[1] + (x[0] ** 2 + 0.5 * x[0] + b0) * x[0]]


def lienard_box(b0: float) -> BlackBox:
    return plane(lambda x, a0: lienard(x, a0, b0), -0.1, 0.1, state_scale=[0.4, 0.4], parameter_scale=[0.01])


@pytest.mark.parametrize(
    ("x_max", "period", "multiplier"),
    [(0.2309049400, 11.8182429, 0.98376), (0.3530097113, 15.2332123, 1.07791)],
)
def test_both_cycles_of_a_lienard_system_the_unstable_one_too(x_max: float, period: float, multiplier: float) -> None:
    """Reference: shooting with Taylor series, b0 = -0.35, a0 = 0.0022, printed to the digits given."""
    flight = solve_ivp(
        lambda _, x: lienard(x, 0.0022, -0.35), (0.0, period), [x_max, 0.0], method="DOP853", rtol=1e-9, max_step=0.05
    )
    family = cycles_from_orbit(
        lienard_box(-0.35), time=flight.t, state=flight.y.T, parameter=0.0022, options=CycleOptions(most_points=2)
    )
    assert_consistent(family)
    assert family.parameter[0] == pytest.approx(0.0022, abs=1e-15)
    assert family.period[0] == pytest.approx(period, rel=COLLOCATION)
    assert family.state_max[0, 0] == pytest.approx(x_max, rel=COLLOCATION)
    assert np.abs(family.multipliers_real[0] - multiplier).min() < MULTIPLIER
    assert family.stable[0] == (multiplier < 1.0)


def test_a_fold_of_cycles_and_no_spurious_one_near_the_loop() -> None:
    """Reference for b0 = -0.383335: a0 = 0.00424373, T = 13.31827. Toward the loop a0 is flat to rounding."""
    box = lienard_box(-0.383335)
    (hopf,) = equilibrium_branch(box, state=[0.0, 0.0], parameter=-0.05).hopf_points
    family = cycles_from_hopf(box, hopf, CycleOptions(largest_period=6.0))
    assert_consistent(family)
    assert family.end is CycleEnding.PERIOD_LIMIT
    (fold,) = family.points
    assert fold.kind is CycleHappening.FOLD
    # b0 is printed to six digits as well, and the fold moves by 0.07 of it
    assert fold.parameter == pytest.approx(0.00424373, abs=0.5e-8 + 0.07 * 0.5e-6)
    assert fold.period == pytest.approx(13.31827, abs=1e-3)  # the period is steep there, the reference has its own step
    assert min(fold.bracket_parameter) <= fold.parameter
    turn = int(np.argmax(family.parameter))
    assert family.stable[3 : turn - 1].all()
    assert not family.stable[turn + 2 : turn + 6].any()


def roessler(x: FloatArray, c: float) -> list[float]:
    return [-x[1] - x[2], x[0] + 0.2 * x[1], 0.2 + x[2] * (x[0] - c)]


def test_a_period_doubling_is_one_for_the_integrator_too() -> None:
    """Roessler's equations, a = b = 0.2: the first doubling, near c = 2.83 (Roessler 1976; many since)."""
    settled = solve_ivp(lambda _, x: roessler(x, 2.6), (0.0, 300.0), [1.0, 1.0, 0.0], rtol=1e-9, atol=1e-9)

    def crossing(_: float, x: FloatArray) -> float:
        return x[0]

    crossing.direction = 1.0  # type: ignore[attr-defined]
    orbit = solve_ivp(
        lambda _, x: roessler(x, 2.6),
        (0.0, 15.0),
        settled.y[:, -1],
        rtol=1e-9,
        atol=1e-9,
        events=crossing,
        max_step=0.05,
        dense_output=True,
    )
    first, second = orbit.t_events[0][:2]
    time = np.linspace(first, second, 400)
    box = BlackBox(
        field=roessler,
        state_box=np.array([[-15.0, 15.0], [-15.0, 15.0], [-1.0, 30.0]]),
        parameter_range=np.array([2.0, 3.2]),
        state_scale=np.array([4.0, 4.0, 4.0]),
    )
    family = cycles_from_orbit(
        box, time=time, state=orbit.sol(time).T, parameter=2.6, options=CycleOptions(intervals=24)
    )
    assert_consistent(family)
    (doubling,) = family.points
    assert doubling.kind is CycleHappening.PERIOD_DOUBLING
    assert doubling.parameter == pytest.approx(2.8325, abs=5e-3)
    near = int(np.argmin(np.abs(family.parameter - doubling.parameter)))
    parameter, period, start = family.parameter[near], family.period[near], family.orbit_state[near, 0]
    columns = []
    for k in range(3):
        ends = [
            solve_ivp(
                lambda _, x: roessler(x, parameter),
                (0.0, period),
                start + step * np.eye(3)[k],
                method="DOP853",
                rtol=1e-12,
                atol=1e-12,
            ).y[:, -1]
            for step in (1e-5, -1e-5)
        ]
        columns.append((ends[0] - ends[1]) / 2e-5)
    np.testing.assert_allclose(
        np.sort(np.linalg.eigvals(np.column_stack(columns)).real),
        np.sort(family.multipliers_real[near]),
        atol=1e-4,  # differences over a period, and the collocation's own error
    )


def test_a_torus_bifurcation_in_closed_form() -> None:
    """Langford's equations without their asymmetric term: the cycle is a rest in r and z, which has a Hopf point.

    Langford (1984), in Numerical Methods for Bifurcation Problems (Kuepper et al., ISNM 70) 285-295: r' = (z - b) r,
    z' = c + a z - z³/3 - r² (1 + e z). Rest: z = b; trace a - b² - e r² = 0 there.
    """
    b, c, d, e = 0.7, 0.6, 3.5, 0.25
    exact = (1.0 + e * b) * b * b + e * (c - b**3 / 3.0)

    def langford(x: FloatArray, a: float) -> list[float]:
        square = x[0] ** 2 + x[1] ** 2
        return [
            (x[2] - b) * x[0] - d * x[1],
            d * x[0] + (x[2] - b) * x[1],
            c + a * x[2] - x[2] ** 3 / 3.0 - square * (1.0 + e * x[2]),
        ]

    start = 0.6
    radius = math.sqrt((c + start * b - b**3 / 3.0) / (1.0 + e * b))
    time = np.linspace(0.0, 2.0 * math.pi / d, 200)
    circle = np.column_stack((radius * np.cos(d * time), radius * np.sin(d * time), np.full(200, b)))
    box = BlackBox(field=langford, state_box=np.array([[-2.0, 2.0]] * 3), parameter_range=np.array([0.4, 0.8]))
    family = cycles_from_orbit(box, time=time, state=circle, parameter=start, options=CycleOptions(intervals=12))
    assert_consistent(family)
    (torus,) = family.points
    assert torus.kind is CycleHappening.TORUS
    assert torus.parameter == pytest.approx(exact, abs=1e-6)
    radius = math.sqrt((c + exact * b - b**3 / 3.0) / (1.0 + e * b))
    angle = radius * math.sqrt(2.0 * (1.0 + e * b)) * 2.0 * math.pi / d  # of the pair: determinant times the period
    assert torus.multipliers_real.min() == pytest.approx(math.cos(angle), abs=1e-5)
    assert family.stable[0]
    assert not family.stable[-1]


def test_the_unstable_cycles_of_the_lorenz_equations_reach_the_homoclinic_explosion() -> None:
    """From the subcritical Hopf point at r = 24.7368 down to r = 13.926 (Sparrow, The Lorenz Equations, 1982)."""
    box = BlackBox(
        field=lambda x, r: [10.0 * (x[1] - x[0]), r * x[0] - x[1] - x[0] * x[2], x[0] * x[1] - 8.0 / 3.0 * x[2]],
        state_box=np.array([[-30.0, 30.0], [-30.0, 30.0], [-5.0, 60.0]]),
        parameter_range=np.array([5.0, 40.0]),
    )
    (hopf,) = equilibrium_branch(box, state=[(8.0 / 3.0 * 9.0) ** 0.5] * 2 + [9.0], parameter=10.0).hopf_points
    family = cycles_from_hopf(box, hopf, CycleOptions(intervals=20, largest_period=6.0))
    assert not family.stable.any()
    assert family.parameter[-1] == pytest.approx(13.926, abs=5e-3)


def test_mistakes_are_told() -> None:
    with pytest.raises(InputError, match="at least 4 intervals"):
        CycleOptions(intervals=2)
    with pytest.raises(InputError, match="must rise"):
        cycles_from_orbit(plane(rotor, -1, 1), time=[0.0, 0.0], state=np.zeros((2, 2)), parameter=0.1)
    box = plane(lambda x, m: [math.sqrt(x[0] - 0.5), m], -1.0, 1.0)
    with pytest.raises(RefusedError, match="the field failed"):
        cycles_from_orbit(box, time=[0.0, 0.5, 1.0], state=np.zeros((3, 2)), parameter=0.1)
