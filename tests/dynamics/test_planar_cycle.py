"""Limit cycles of planar fields: the literature, closed forms, how they move with the coefficients, symmetry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.dynamics.lienard import NORMAL_95
from finback.dynamics.planar.cycle import PlanarCycle, planar_cycles
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError

_VARIABLES = ("x_1", "y_1", "mu_1")
_BOX = ((-3.0, 3.0), (-4.0, 4.0))
Terms = Mapping[tuple[int, int, int], float]


def _system(first: Terms, second: Terms, *, covariance: ArrayLike | None = None) -> PlanarSystem:
    p, q = (Polynomial.build(terms, variables=_VARIABLES, value_unit="1") for terms in (first, second))
    return PlanarSystem.from_polynomials(p, q, covariance=covariance)


def _van_der_pol(variance: float = 0.0) -> PlanarSystem:
    """The equation x' = y, y' = mu (1 − x²) y − x."""
    second = {(1, 0, 0): -1.0, (0, 1, 1): 1.0, (2, 1, 1): -1.0}
    return _system({(0, 1, 0): 1.0}, second, covariance=variance * np.eye(4))


def _cubic(a1: float, b1: float, b0: float) -> PlanarSystem:
    """Eq. (18) of Shi & Fan (2013), a0 the parameter."""
    second = {(0, 1, 1): 1.0, (1, 1, 0): a1, (2, 1, 0): -1.0, (1, 0, 0): b0, (2, 0, 0): b1, (3, 0, 0): 1.0}
    return _system({(0, 1, 0): 1.0}, second)


def _circles(turn: Terms) -> PlanarSystem:
    """Circles: r' = r (1 − r²)(4 − r²) mu, the angle turning at a rate given as terms in x, y."""
    radial = {(0, 0): 4.0, (2, 0): -5.0, (0, 2): -5.0, (4, 0): 1.0, (2, 2): 2.0, (0, 4): 1.0}
    first: dict[tuple[int, int, int], float] = {(i + 1, j, 1): c for (i, j), c in radial.items()}
    second: dict[tuple[int, int, int], float] = {(i, j + 1, 1): c for (i, j), c in radial.items()}
    for (i, j, _), c in turn.items():
        first[i, j + 1, 0] = -c
        second[i + 1, j, 0] = c
    return _system(first, second)


@pytest.mark.parametrize(
    ("mu", "period", "tolerance"),
    [
        # Amore, Boyd & Fernandez, Appl. Math. Comput. 340 (2018): 6.66328685932313018969968203.
        (1.0, 6.6632868593231302, 1e-12),
        # Strasberg & Schaffer, computed tables; the classical value 7.62987 at mu = 2.
        (2.0, 7.62987, 1e-5),
    ],
)
def test_van_der_pol(mu: float, period: float, tolerance: float) -> None:
    (cycle,) = planar_cycles(_van_der_pol(), mu, _BOX)
    assert cycle.period == pytest.approx(period, abs=tolerance)
    assert cycle.stable
    np.testing.assert_allclose(cycle.high, -cycle.low, rtol=1e-12)  # it is symmetric
    if mu == 1.0:
        assert cycle.high[0] == pytest.approx(2.00862, abs=5e-6)
    np.testing.assert_array_equal(cycle.enclosed, [[0.0, 0.0]])
    (reversed_,) = planar_cycles(_van_der_pol(), -mu, _BOX)
    assert not reversed_.stable
    assert reversed_.period == pytest.approx(cycle.period, abs=1e-12)
    assert reversed_.log_multiplier == pytest.approx(-cycle.log_multiplier, abs=1e-11)


def test_a_relaxation_oscillation_has_a_multiplier_below_double_precision() -> None:
    """Dorodnicyn's expansion of the period for large mu (Grimshaw 1990, with ln mu terms), error O(mu^(-5/3))."""
    mu = 30.0
    (cycle,) = planar_cycles(_van_der_pol(), mu, ((-3.0, 3.0), (-60.0, 60.0)))
    leading = (3.0 - 2.0 * math.log(2.0)) * mu + 3.0 * 2.338107410 * mu ** (-1.0 / 3.0)
    assert cycle.period == pytest.approx(leading - (2.0 / 3.0 * math.log(mu) + 1.3246) / mu, abs=0.05)
    assert cycle.multiplier == 0.0
    assert cycle.log_multiplier < -1000.0


# By scipy's implicit Radau method at rtol 1e-12, to the digits that three turns agree in.
_RELAXATION = {40.0: 66.50136904, 100.0: 162.83707109, 300.0: 485.14228274}


@pytest.mark.parametrize("mu", _RELAXATION)
def test_a_stiff_relaxation_oscillation_is_found(mu: float) -> None:
    (cycle,) = planar_cycles(_van_der_pol(), mu, ((-3.0, 3.0), (-2.0 * mu, 2.0 * mu)))
    assert cycle.period == pytest.approx(_RELAXATION[mu], rel=1e-10)
    assert cycle.stable
    np.testing.assert_allclose(cycle.high, -cycle.low, rtol=1e-11)  # it is symmetric
    assert np.isfinite(cycle.period_interval).all()


def test_the_period_of_relaxation_oscillations() -> None:
    """Dorodnicyn (1947), as corrected: T = (3 − 2 ln 2) mu + 7.0143 mu^(-1/3) − (2/3) ln mu/mu − 1.3246/mu + …."""
    for mu in (300.0, 1000.0):
        (cycle,) = planar_cycles(_van_der_pol(), mu, ((-3.0, 3.0), (-2.0 * mu, 2.0 * mu)))
        expansion = (3.0 - 2.0 * math.log(2.0)) * mu + 3.0 * 2.338107410459767 * mu ** (-1.0 / 3.0)
        expansion -= (2.0 / 3.0 * math.log(mu) + 1.3246) / mu
        assert cycle.period == pytest.approx(expansion, abs=3.0 * mu ** (-5.0 / 3.0))  # the next term's order
        # Along the slow arcs dt = mu (1 − x²)/x dx, so ∫ mu (1 − x²) dt from 2 to 1, twice; corners add mu^(2/3).
        assert cycle.log_multiplier == pytest.approx(-(2.0 * math.log(2.0) + 1.5) * mu**2, abs=10.0 * mu ** (2.0 / 3.0))


def test_the_two_cycles_of_the_cubic_family() -> None:
    """Shooting in 130 bits: one attracts, one repels (references to the digits given)."""
    inner, outer = planar_cycles(_cubic(0.5, 0.5, -0.35), 0.0022, ((-1.0, 0.5), (-0.5, 0.5)))
    for cycle, high, period, multiplier in (
        (inner, 0.2309049400, 11.8182429, 0.98376),
        (outer, 0.3530097113, 15.2332123, 1.07791),
    ):
        assert cycle.high[0] == pytest.approx(high, abs=1e-10)
        assert cycle.period == pytest.approx(period, abs=1e-7)
        assert cycle.multiplier == pytest.approx(multiplier, abs=1e-5)
        assert cycle.stable == (multiplier < 1.0)


def test_circles_have_the_multipliers_of_a_calculation() -> None:
    """With r' = g(r), theta' = 1: the logarithm is 2π g'(r), with g' = −6 mu at 1 and 24 mu at 2."""
    one, two = sorted(planar_cycles(_circles({(0, 0, 0): 1.0}), 0.1, _BOX), key=lambda cycle: cycle.high[0])
    for cycle, radius, slope in ((one, 1.0, -0.6), (two, 2.0, 2.4)):
        np.testing.assert_allclose(cycle.high, radius, rtol=0, atol=1e-12)
        np.testing.assert_allclose(np.hypot(*cycle.orbit.T), radius, rtol=0, atol=1e-12)
        assert cycle.period == pytest.approx(2.0 * math.pi, abs=1e-12)
        assert cycle.log_multiplier == pytest.approx(2.0 * math.pi * slope, abs=1e-10)
        x, y = cycle.orbit.T
        assert (x[:-1] * np.diff(y) - y[:-1] * np.diff(x) > 0.0).all()  # in the order of time: counterclockwise


def test_cycles_that_turn_opposite_ways_are_both_found() -> None:
    """With theta' = 2 − r²: counterclockwise at r = 1, clockwise at r = 2, and any ray has a tangency between."""
    found = planar_cycles(_circles({(0, 0, 0): 2.0, (2, 0, 0): -1.0, (0, 2, 0): -1.0}), 0.1, _BOX)
    assert sorted(round(float(cycle.high[0]), 10) for cycle in found) == [1.0, 2.0]
    areas = {round(float(c.high[0])): np.sum(c.orbit[:-1, 0] * np.diff(c.orbit[:, 1])) for c in found}
    assert areas[1] > 0.0 > areas[2]


def test_a_cycle_around_three_equilibria() -> None:
    """A double well with negative damping inside: one cycle around all three, seen from either well once."""
    second = {(1, 0, 0): 1.0, (3, 0, 0): -1.0, (0, 1, 1): 1.0, (2, 1, 1): -0.2}
    found = planar_cycles(_system({(0, 1, 0): 1.0}, second), 0.5, ((-6.0, 6.0), (-15.0, 15.0)))
    (large,) = (cycle for cycle in found if len(cycle.enclosed) == 3)
    assert large.stable
    np.testing.assert_allclose(large.high, -large.low, rtol=1e-11)


def test_one_turn_with_an_unrelated_integrator_closes() -> None:
    system = _cubic(1.0, 0.75, -1.0)
    (cycle,) = planar_cycles(system, 0.003, ((-1.5, 0.8), (-1.0, 1.0)))[:1]
    found = solve_ivp(
        lambda _, s: system.velocity(s, 0.003),
        (0.0, cycle.period),
        cycle.orbit[0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-14,
    )
    np.testing.assert_allclose(found.y[:, -1], cycle.orbit[0], rtol=0, atol=1e-10)
    found = solve_ivp(
        lambda _, s: system.velocity(s, 0.003),
        (0.0, cycle.period),
        cycle.bracket[0],
        method="DOP853",
        rtol=1e-9,
        atol=1e-9,
    )
    np.testing.assert_allclose(found.y[:, -1], cycle.orbit[0], rtol=0, atol=1e-7)


def _measures(cycle: PlanarCycle) -> FloatArray:
    return np.array([cycle.period, cycle.log_multiplier, *cycle.low, *cycle.high])


@pytest.mark.parametrize("mu", [1.0, -0.4, 60.0])
def test_intervals_are_those_of_changed_coefficients(mu: float) -> None:
    """Central differences by each coefficient, step 1e-5: their own error is some 1e-9 of the value."""
    variance = 1e-4
    system = _van_der_pol(variance)
    box = _BOX if mu < 2.0 else ((-3.0, 3.0), (-2.0 * mu, 2.0 * mu))
    (cycle,) = planar_cycles(system, mu, box)
    theta = np.concatenate([system.first.polynomial.coefficients, system.second.polynomial.coefficients])
    step, rows = 1e-5, []
    for k in range(theta.size):
        pair = []
        for sign in (1.0, -1.0):
            moved = theta.copy()
            moved[k] += sign * step
            pair.append(_measures(planar_cycles(system.with_coefficients(moved), mu, box)[0]))
        rows.append((pair[0] - pair[1]) / (2.0 * step))
    expected = np.sqrt(variance * (np.array(rows) ** 2).sum(axis=0))
    intervals = [cycle.period_interval, cycle.log_multiplier_interval, *cycle.low_interval, *cycle.high_interval]
    found = [float(interval[1] - interval[0]) / (2.0 * 1.959963984540054) for interval in intervals]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize(("deviation", "stated"), [(0.05, True), (0.1, True), (0.15, False), (0.6, False)])
def test_a_cycle_is_stated_where_it_follows_its_gradient(deviation: float, *, stated: bool) -> None:
    """Of r' = r − c r³ the radius is 1/√c: with c = 1 − d it misses its gradient by ¾ d of its change, to first order.

    The turn takes 2π for every c, and ∫ divergence dt is −4π: what does not depend on c is known. At the end of the
    largest interval no cycle is left.
    """
    first = {(1, 0, 0): 1.0, (0, 1, 0): -1.0, (3, 0, 0): -1.0, (1, 2, 0): -1.0}
    second = {(0, 1, 0): 1.0, (1, 0, 0): 1.0, (2, 1, 0): -1.0, (0, 3, 0): -1.0}
    cubic = np.array([0.0, 0.0, 1.0, 1.0] * 2)
    system = _system(first, second)
    (cycle,) = planar_cycles(replace(system, covariance=deviation**2 * np.outer(cubic, cubic)), 0.0, _BOX)
    for interval in (*cycle.low_interval, *cycle.high_interval):
        assert np.isfinite(interval).all() == stated
    if stated:
        half = 0.5 * NORMAL_95 * deviation
        np.testing.assert_allclose(cycle.high_interval, [[1.0 - half, 1.0 + half]] * 2, rtol=1e-9)
        np.testing.assert_allclose(cycle.period_interval, 2.0 * np.pi, rtol=1e-9)


def test_errors_that_turn_the_equilibrium_inside_round_leave_nothing_determined() -> None:
    """With x'' = (m − x²) x' − x, errors of m that reach beyond 0 let the cycle vanish in a Hopf point."""
    covariance = np.zeros((4, 4))
    covariance[2, 2] = 0.3**2
    second = {(1, 0, 0): -1.0, (0, 1, 0): 0.2, (2, 1, 0): -1.0}
    system = _system({(0, 1, 0): 1.0}, second, covariance=covariance)
    (cycle,) = planar_cycles(system, 0.0, _BOX)
    assert np.isinf([*cycle.low_interval, *cycle.high_interval, cycle.log_multiplier_interval]).all()


def test_what_is_no_cycle_is_not_found() -> None:
    """A center has closed orbits everywhere and no limit cycle; a linear sink has none; damped pendula neither."""
    linear = _system({(0, 1, 0): 1.0}, {(1, 0, 0): -1.0, (0, 1, 1): -1.0})
    assert planar_cycles(linear, 0.3, _BOX) == ()
    quadratic = _system({(0, 1, 0): 1.0}, {(0, 0, 0): -1.0, (2, 0, 0): 1.0, (0, 1, 1): 1.0})
    assert planar_cycles(quadratic, 0.2, _BOX) == ()  # constant divergence (Bendixson 1901)
    assert planar_cycles(quadratic, -0.2, _BOX) == ()
    empty = _system({(0, 0, 0): 1.0, (2, 0, 0): 1.0}, {(0, 1, 1): 1.0})
    assert planar_cycles(empty, 1.0, _BOX) == ()  # no equilibrium, no cycle


def test_a_cycle_that_leaves_the_box_is_not_in_it() -> None:
    assert planar_cycles(_van_der_pol(), 1.0, ((-3.0, 3.0), (-2.0, 2.0))) == ()
    with pytest.raises(InputError, match="a box is two finite intervals"):
        planar_cycles(_van_der_pol(), 1.0, ((3.0, -3.0), (-2.0, 2.0)))


@settings(max_examples=10, deadline=None)
@given(
    angle=st.floats(0.0, 6.28), stretch=st.floats(0.3, 3.0), shift=st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
)
def test_other_coordinates_have_the_same_cycle(angle: float, stretch: float, shift: tuple[float, float]) -> None:
    """With x = shift + stretch R z: period and multiplier are the field's own."""
    c, s = math.cos(angle), math.sin(angle)
    poly = np.polynomial.polynomial

    def rate(z: FloatArray) -> FloatArray:
        x, y = stretch * np.array([[c, -s], [s, c]]) @ z.T + np.array(shift)[:, np.newaxis]
        p, q = y, (1.0 - x**2) * y - x
        return np.array([c * p + s * q, -s * p + c * q]).T / stretch

    # A polynomial of degree 3 in each variable is known by its values at 16 places.
    nodes = np.array([(u, v) for u in (-2.0, -0.5, 0.7, 2.0) for v in (-2.0, -0.5, 0.7, 2.0)])
    tables = np.linalg.solve(poly.polyvander2d(nodes[:, 0], nodes[:, 1], [3, 3]), rate(nodes))
    # Rounding leaves terms of 1e-15 where there are none, and with them equilibria far away.
    terms = [{(k // 4, k % 4, 0): float(row[k]) for k in range(16) if abs(row[k]) > 1e-12} for row in tables.T]
    center = -np.array([[c, s], [-s, c]]) @ shift / stretch
    box = np.array([center - 5.0 / stretch, center + 5.0 / stretch]).T
    (cycle,) = planar_cycles(_system(*terms), 0.0, box)
    assert cycle.period == pytest.approx(6.6632868593231302, abs=1e-9)
    assert cycle.log_multiplier == pytest.approx(-7.058932808798, abs=1e-8)
