"""Equilibria of a planar field: all of them, none twice, and honest where double precision ends."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.polynomial import polynomial as npp

from finback.dynamics.equilibrium import Kind, equilibria
from finback.dynamics.fold import folds
from finback.dynamics.model import PolynomialModel
from finback.dynamics.planar.elimination import eliminant, integers
from finback.dynamics.planar.equilibrium import PlanarEquilibrium, natural_planar_scale, planar_equilibria
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import reduce
from finback.errors import RefusedError

_NAMES = ("x_1", "y_1", "mu_1")
Terms = dict[tuple[int, int, int], float]


def _system(first: Terms, second: Terms) -> PlanarSystem:
    one, two = (Polynomial.build(dict(t), variables=_NAMES, value_unit="1") for t in (first, second))
    return PlanarSystem.from_polynomials(one, two)


def _states(points: tuple[PlanarEquilibrium, ...]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.array([p.state for p in points]).reshape(-1, 2)


def _lines(offsets: list[float], slope: float, steep: float) -> npp.Polynomial | np.ndarray:  # type: ignore[type-arg]
    """Return the table of a product of lines x + slope y = offset (scaled), a curve that is known by construction."""
    table = np.ones((1, 1))
    for offset in offsets:
        line = np.array([[-offset, slope], [steep, 0.0]])
        grown = np.zeros((table.shape[0] + 1, table.shape[1] + 1))
        for (i, j), c in np.ndenumerate(line):
            grown[i : i + table.shape[0], j : j + table.shape[1]] += c * table
        table = grown
    return table


def _of_table(table: np.ndarray) -> Terms:  # type: ignore[type-arg]
    return {(i, j, 0): float(c) for (i, j), c in np.ndenumerate(table)}


def test_both_roads_agree_over_the_grid(paper_model: PolynomialModel) -> None:
    plane, lienard = PlanarSystem.from_model(paper_model), reduce(paper_model)
    for elevator in np.linspace(-1.0, 0.7, 18).tolist():
        one, two = planar_equilibria(plane, elevator), equilibria(lienard, elevator)
        assert [p.kind for p in one] == [p.kind for p in two]
        np.testing.assert_allclose(_states(one), [[p.alpha_rad, p.q_rad_s] for p in two], rtol=0, atol=1e-13)
        for mine, other in zip(one, two, strict=True):
            np.testing.assert_allclose(mine.eigenvalues_real, other.eigenvalues_real_1_s, atol=1e-12)
            np.testing.assert_allclose(mine.eigenvalues_imag, other.eigenvalues_imag_1_s, atol=1e-12)
            assert (np.abs(mine.residual) < 1e-14).all()


def test_on_a_fold_the_pair_is_one_degenerate_equilibrium(paper_model: PolynomialModel) -> None:
    """The null direction is oblique in (alpha, q): boxes along the axes would never end."""
    plane = PlanarSystem.from_model(paper_model)
    for fold in folds(reduce(paper_model)):
        points = planar_equilibria(plane, fold.elevator_rad)
        assert sorted(p.kind for p in points) == [Kind.DEGENERATE, Kind.SADDLE]
        (meeting,) = (p for p in points if p.kind == Kind.DEGENERATE)
        np.testing.assert_allclose(meeting.state, [fold.alpha_rad, fold.q_rad_s], rtol=0, atol=1e-13)
        np.testing.assert_array_equal(meeting.state_interval, [[-np.inf, np.inf]] * 2)


def test_next_to_a_fold_the_count_does_not_flip(paper_model: PolynomialModel) -> None:
    plane = PlanarSystem.from_model(paper_model)
    upper, lower = (f.elevator_rad for f in folds(reduce(paper_model)))
    for distance in (1e-12, 1e-9, 1e-5):
        for edge, outward in ((upper, 1.0), (lower, -1.0)):
            assert [p.kind for p in planar_equilibria(plane, edge + outward * distance)] == [Kind.SADDLE]
            assert len(planar_equilibria(plane, edge - outward * distance)) == 3


offsets = st.lists(st.integers(-8, 8), min_size=1, max_size=3, unique=True).map(lambda row: [k / 4.0 for k in row])


@settings(deadline=None, max_examples=50, derandomize=True)
@given(offsets, offsets, st.sampled_from([0.5, 1.0, -1.5, 2.0]), st.sampled_from([-0.75, 0.25, 3.0]))
def test_products_of_lines_meet_where_they_were_drawn(
    first: list[float], second: list[float], slope: float, other: float
) -> None:
    """Lines x + slope y = a times … against x + other y = b times …: every pair of lines meets once; sums are exact."""
    system = _system(_of_table(_lines(first, slope, 1.0)), _of_table(_lines(second, other, 1.0)))
    found = planar_equilibria(system, 0.0)
    expected = []
    for a in first:
        for b in second:
            y = float(Fraction(a - b) / Fraction(slope - other))
            expected.append((float(Fraction(a) - Fraction(slope) * Fraction(y)), y))
    # Lines 1/4 apart: the smallest product of distances is of the order 1/100, the rounding 1e-14.
    assert len(found) == len(expected)
    for point in expected:
        assert np.abs(_states(found) - point).max(axis=1).min() < 1e-11
    assert all(p.kind != Kind.DEGENERATE or abs(sum(p.eigenvalues_real)) < 1e-10 for p in found)


def test_a_zero_at_which_the_jacobian_all_but_vanishes_overflows_nowhere() -> None:
    """X' = -2y + xy - 2x², y' = -y² (x + 2y): halving around 0 meets Jacobians whose inverse is no double."""
    first, second = np.zeros((3, 4)), np.zeros((3, 4))
    first[0, 1], first[1, 1], first[2, 0] = -2.0, 1.0, -2.0
    second[0, 3], second[1, 2] = -2.0, -1.0
    meeting, simple = planar_equilibria(_system(_of_table(first), _of_table(second)), 0.0)
    assert meeting.kind is Kind.DEGENERATE
    np.testing.assert_allclose(meeting.state, 0.0, atol=1e-29)
    np.testing.assert_allclose(simple.state, [0.4, -0.2], rtol=0, atol=1e-14)


@settings(deadline=None, max_examples=20, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.integers(2, 3))
def test_no_zero_that_newton_finds_is_missing(seed: int, degree: int) -> None:
    """Two roads: Newton's method from 400 places, which knows nothing of elimination."""
    generator = np.random.default_rng(seed)
    tables = generator.normal(size=(2, degree + 1, degree + 1))
    system = _system(_of_table(tables[0]), _of_table(tables[1]))
    found = _states(planar_equilibria(system, 0.0))
    points = generator.normal(size=(400, 2)) * 2.0
    with np.errstate(all="ignore"):
        for _ in range(60):
            rates, jacobian = system.velocity(points, 0.0), system.jacobian(points, 0.0)
            determinant = np.linalg.det(jacobian)
            usable = np.abs(determinant) > 1e-9
            points, rates, jacobian = points[usable], rates[usable], jacobian[usable]
            points = points - np.linalg.solve(jacobian, rates[..., None])[..., 0]
            points = points[np.isfinite(points).all(axis=1) & (np.abs(points) < 1e4).all(axis=1)]
    rates = np.abs(system.velocity(points, 0.0)).max(axis=1)
    for point in points[rates < 1e-9]:
        assert np.abs(found - point).max(axis=1).min() < 1e-6 * (1.0 + np.abs(point).max())
    # And what was found is a zero: the distance to it is a Newton step.
    for state in found:
        step = np.linalg.solve(system.jacobian(state, 0.0), system.velocity(state, 0.0))
        assert np.abs(step).max() <= 1e-9 * (1.0 + np.abs(state).max())


def test_several_equilibria_with_one_first_state() -> None:
    """Logistic competition: on x = 0 lie two; the eliminant has a double root there."""
    system = _system(
        {(1, 0, 0): 1.0, (2, 0, 0): -1.0, (1, 1, 0): -0.5}, {(0, 1, 0): 0.8, (0, 2, 0): -1.0, (1, 1, 0): -0.3}
    )
    found = planar_equilibria(system, 0.0)
    np.testing.assert_allclose(_states(found), [[0, 0], [0, 0.8], [12 / 17, 10 / 17], [1, 0]], atol=1e-15)
    assert [p.kind for p in found] == [Kind.UNSTABLE_NODE, Kind.SADDLE, Kind.STABLE_NODE, Kind.SADDLE]
    # The circle and the four points of a hyperbola on it: two pairs mirror each other.
    circle = _system(
        {(2, 0, 0): 1.0, (0, 2, 0): 1.0, (0, 0, 0): -5.0}, {(2, 0, 0): 1.0, (0, 2, 0): -2.0, (0, 0, 0): 1.0}
    )
    expected = [(s * 3**0.5, t * 2**0.5) for s in (-1, 1) for t in (-1, 1)]
    np.testing.assert_allclose(_states(planar_equilibria(circle, 0.0)), expected, atol=1e-14)


def test_either_state_may_be_the_simple_one() -> None:
    """Linear in x, not in y: both coordinates are exchanged for the search, and the result turned back."""
    system = _system(
        {(0, 2, 0): 1.0, (1, 0, 0): -1.0}, {(0, 3, 0): 1.0, (1, 0, 0): 2.0, (0, 1, 0): -1.0, (0, 0, 0): -2.0}
    )
    # With x = y²: y³ + 2 y² − y − 2 = (y − 1)(y + 1)(y + 2).
    np.testing.assert_allclose(_states(planar_equilibria(system, 0.0)), [[1, -1], [1, 1], [4, -2]], atol=1e-13)


def test_curves_that_touch_and_curves_that_just_miss() -> None:
    def against(height: float) -> list[Kind]:
        circle = {(2, 0, 0): 1.0, (0, 2, 0): 1.0, (0, 0, 0): -4.0}
        return [p.kind for p in planar_equilibria(_system(circle, {(0, 1, 0): 1.0, (0, 0, 0): -height}), 0.0)]

    assert against(2.0) == [Kind.DEGENERATE]
    assert against(2.0 + 1e-12) == []
    assert len(against(2.0 - 1e-12)) == 2


def test_three_that_meet_are_one_degenerate_equilibrium() -> None:
    cusp = _system({(0, 1, 0): 1.0}, {(3, 0, 0): -1.0, (0, 1, 0): -1.0, (0, 0, 1): 1.0})
    (point,) = planar_equilibria(cusp, 0.0)
    assert point.kind == Kind.DEGENERATE
    np.testing.assert_allclose(point.state, 0.0, atol=1e-5)
    # Away from zero, and oblique: x + y = 3, (x − 1)³ = 0.
    moved = _system(
        {(1, 0, 0): 1.0, (0, 1, 0): 1.0, (0, 0, 0): -3.0},
        {(3, 0, 0): 1.0, (2, 0, 0): -3.0, (1, 0, 0): 3.0, (0, 0, 0): -1.0},
    )
    (point,) = planar_equilibria(moved, 0.0)
    assert point.kind == Kind.DEGENERATE
    np.testing.assert_allclose(point.state, [1.0, 2.0], atol=1e-4)  # the cube root of rounding


def test_a_center_is_degenerate() -> None:
    (point,) = planar_equilibria(_system({(0, 1, 0): 1.0}, {(1, 0, 0): -4.0}), 0.0)
    assert point.kind == Kind.DEGENERATE
    np.testing.assert_array_equal(point.eigenvalues_imag, [2.0, -2.0])


def test_no_equilibrium_at_all() -> None:
    assert planar_equilibria(_system({(0, 0, 0): 1.0}, {(1, 1, 0): 1.0}), 0.0) == ()
    assert planar_equilibria(_system({(2, 0, 0): 1.0, (0, 0, 0): 1.0}, {(0, 1, 0): 1.0}), 0.0) == ()
    assert planar_equilibria(_system({(1, 0, 0): 1.0}, {(1, 0, 0): 1.0, (0, 0, 0): 1.0}), 0.0) == ()
    # Parallel lines: they meet at infinity only.
    assert (
        planar_equilibria(
            _system({(1, 0, 0): 1.0, (0, 1, 0): 1.0}, {(1, 0, 0): 1.0, (0, 1, 0): 1.0, (0, 0, 0): 1.0}), 0.0
        )
        == ()
    )


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ({(1, 0, 0): 1.0}, {(1, 1, 0): 1.0}),
        ({(1, 0, 0): 0.0}, {(1, 1, 0): 1.0}),
        ({(1, 0, 0): 1.0, (0, 0, 0): -1.0}, {(2, 0, 0): 1.0, (0, 0, 0): -1.0}),
        ({(0, 2, 0): 1.0}, {(0, 3, 0): 1.0}),
        ({(1, 1, 0): 1.0, (0, 1, 0): -1.0}, {(0, 2, 0): 1.0, (0, 1, 0): 1.0}),
    ],
)
def test_equilibria_that_are_not_isolated_are_refused(first: Terms, second: Terms) -> None:
    with pytest.raises(RefusedError, match="not isolated"):
        planar_equilibria(_system(first, second), 0.0)


def test_a_common_factor_within_rounding_is_refused() -> None:
    """(x + 0.1 y − 0.3) times two lines each, multiplied out in double precision: no common factor is left exactly."""
    shared = _lines([0.3], 0.1, 1.0)
    tables = []
    for a, b in ((0.7, 1.3), (-0.2, 0.9)):
        line = _lines([a], b, 1.0)
        product = np.zeros((3, 3))
        for (i, j), c in np.ndenumerate(np.asarray(line)):
            product[i : i + 2, j : j + 2] += c * np.asarray(shared)
        tables.append(product)
    with pytest.raises(RefusedError, match="not isolated"):
        planar_equilibria(_system(_of_table(tables[0]), _of_table(tables[1])), 0.0)


def test_the_eliminant_is_exact() -> None:
    """Against the resultant of (y − a)(y − b) and (y − c)(y − d) over x, a product of differences."""
    one = integers(np.array([[2.0, 3.0, 1.0], [0.0, 1.0, 0.0]]))  # y² + (3 + x) y + 2
    two = integers(np.array([[-1.0, 0.5, 2.0], [1.0, 0.0, 0.0]]))  # 2 y² + y/2 − 1 + x
    row = eliminant(one, two)
    scale = row[-1]
    values = [Fraction(c, scale) for c in row]
    for x in (Fraction(0), Fraction(1, 3), Fraction(-5, 2)):
        roots = np.roots([1.0, float(3 + x), 2.0])
        product = np.prod([2.0 * r * r + 0.5 * r - 1.0 + float(x) for r in roots])
        own = sum(c * x**k for k, c in enumerate(values))
        reference = [2.0 * r * r + 0.5 * r - 1.0 for r in np.roots([1.0, 3.0, 2.0])]
        assert float(own / values[0]) == pytest.approx(float(product.real) / float(np.prod(reference)), rel=1e-12)


def test_intervals_are_the_scatter_of_samples() -> None:
    first = Polynomial.build({(0, 1, 0): 1.0, (1, 0, 0): -0.4, (1, 1, 0): 0.3}, variables=_NAMES, value_unit="1")
    second = Polynomial.build(
        {(0, 0, 0): 0.5, (1, 0, 0): -2.0, (3, 0, 0): 1.0, (0, 1, 0): -0.5}, variables=_NAMES, value_unit="1"
    )
    theta = np.concatenate([first.coefficients, second.coefficients])
    errors = 0.002 * np.abs(theta)
    system = PlanarSystem.from_polynomials(first, second, covariance=np.diag(errors**2))
    points = planar_equilibria(system, 0.0)
    assert len(points) == 4
    generator = np.random.default_rng(5)
    draws = theta + generator.standard_normal((300, theta.size)) * errors
    samples = np.array([_states(planar_equilibria(system.with_coefficients(row), 0.0)) for row in draws])
    halves = np.array([0.5 * np.diff(p.state_interval, axis=1)[:, 0] for p in points])
    # The standard deviation of 300 draws is known to 4.1 %; four times that.
    np.testing.assert_allclose(1.959964 * samples.std(axis=0), halves, rtol=0.16)
    exact = planar_equilibria(replace(system, covariance=np.zeros((7, 7))), 0.0)
    for point in exact:
        np.testing.assert_array_equal(point.state_interval, np.stack([point.state, point.state], axis=1))


def test_the_natural_scale_spans_the_equilibria(paper_model: PolynomialModel) -> None:
    system = PlanarSystem.from_model(paper_model)
    scale = natural_planar_scale(system, -0.2)
    points = planar_equilibria(system, -0.2)
    assert scale.first == pytest.approx(0.5 * (points[-1].state[0] - points[0].state[0]))
    fastest = max(np.abs(np.linalg.eigvals(system.jacobian(p.state, -0.2))).max() for p in points)
    assert scale.time * fastest == pytest.approx(1.0)
    assert natural_planar_scale(_system({(0, 0, 0): 1.0}, {(1, 1, 0): 1.0}), 0.0).first == 1.0
