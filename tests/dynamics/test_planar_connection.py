"""Saddle connections of planar fields: exact ones, references, the Liénard road, intervals, and what is none."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from finback.dynamics.connection.search import connections
from finback.dynamics.lienard import NORMAL_95, LienardSystem
from finback.dynamics.planar.connection_search import PlanarConnections, planar_connections
from finback.dynamics.planar.equilibrium import planar_equilibria
from finback.dynamics.planar.field import PlanarField
from finback.dynamics.planar.manifold import planar_manifold, saddle_frame
from finback.dynamics.planar.system import PlanarFlow, PlanarScale, PlanarSystem
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError, RefusedError
from finback.store.model_file import read_model_file
from finback.units import from_si, to_si

_VARIABLES = ("x_1", "y_1", "mu_1")
# Roundings of the parameter of a connection: the splitting is known to some 1e-15 and moves at least a tenth as fast.
_ROUNDING = 1e-13
Terms = Mapping[tuple[int, int, int], float]


def _system(first: Terms, second: Terms, *, covariance: ArrayLike | None = None) -> PlanarSystem:
    p, q = (Polynomial.build(terms, variables=_VARIABLES, value_unit="1") for terms in (first, second))
    return PlanarSystem.from_polynomials(p, q, covariance=covariance)


def _cubic(a1: float, b1: float, b0: float, sign: float = 1.0) -> PlanarSystem:
    """Eq. (18) of Shi & Fan (2013) with a0 as the parameter, or its counterpart with the cubic force reversed."""
    second = {(0, 1, 1): 1.0, (1, 1, 0): a1, (2, 1, 0): -1.0, (1, 0, 0): b0, (2, 0, 0): b1, (3, 0, 0): sign}
    return _system({(0, 1, 0): 1.0}, second)


def _leaf(covariance: ArrayLike | None = None) -> PlanarSystem:
    """Sandstede (1997): at mu = 0 the leaf x² (1 − x) = y² is a loop of the saddle at the origin, eigenvalues 1, −3."""
    first = {(1, 0, 0): -1.0, (0, 1, 0): 2.0, (2, 0, 0): 1.0, (1, 0, 1): 2.0, (2, 0, 1): -3.0}
    second = {(1, 0, 0): 2.0, (0, 1, 0): -1.0, (2, 0, 0): -3.0, (1, 1, 0): 1.5, (0, 1, 1): -2.0}
    return _system(first, second, covariance=covariance)


def _line(tilt: float, covariance: ArrayLike | None = None) -> PlanarSystem:
    """With x' = 1 − x², y' = x y + mu + tilt x²: linear in y, and the Melnikov integral is mu π + tilt π/2, exactly."""
    second = {(1, 1, 0): 1.0, (0, 0, 1): 1.0, (2, 0, 0): tilt}
    return _system({(0, 0, 0): 1.0, (2, 0, 0): -1.0}, second, covariance=covariance)


def _everything(found: PlanarConnections) -> list[float]:
    return sorted(c.parameter for c in (*found.heteroclinics, *found.homoclinics))


def test_a_loop_that_is_an_algebraic_curve() -> None:
    found = planar_connections(_leaf(), (-0.2, 0.15), ((-1.5, 1.5), (-1.5, 1.5)))
    (loop,) = found.homoclinics
    assert found.heteroclinics == ()
    assert loop.parameter == pytest.approx(0.0, abs=_ROUNDING)
    assert loop.bracket[0] < 0.0 < loop.bracket[1]
    assert loop.divergence == pytest.approx(-2.0, abs=1e-14)
    x, y = loop.orbit.T
    np.testing.assert_allclose(x**2 * (1.0 - x), y**2, rtol=0, atol=1e-14)
    assert (np.abs(loop.residual) < 1e-14).all()


@pytest.mark.parametrize("tilt", [0.1, -0.6])
def test_a_heteroclinic_orbit_known_in_closed_form(tilt: float) -> None:
    covariance = np.diag([0.0, 0.0, 0.0, 0.0, 1e-4])
    found = planar_connections(_line(tilt, covariance), (-0.21, 0.5), ((-2.0, 2.0), (-1.5, 1.5)))
    (orbit,) = found.heteroclinics
    assert orbit.parameter == pytest.approx(-0.5 * tilt, abs=_ROUNDING)
    np.testing.assert_allclose([orbit.from_state[0], orbit.to_state[0]], [-1.0, 1.0], atol=1e-15)
    assert np.ptp(orbit.parameter_interval) == pytest.approx(2.0 * NORMAL_95 * 0.5e-2, rel=1e-10)
    assert np.mean(orbit.parameter_interval) == pytest.approx(orbit.parameter, abs=1e-14)
    np.testing.assert_allclose(orbit.orbit[[0, -1]], [orbit.from_state, orbit.to_state], atol=1e-14)


@pytest.mark.parametrize(
    ("a1", "b1", "b0", "a0"),
    [(0.5, 0.5, -1.0, 0.0594558236872), (1.0, 0.75, -1.0, 4.34108613069e-4), (0.5, 0.5, -0.5, 0.0123387537)],
)
def test_loops_of_the_cubic_family(a1: float, b1: float, b0: float, a0: float) -> None:
    """References by shooting in 130 and 170 bits, printed to the digits given."""
    found = planar_connections(_cubic(a1, b1, b0), (-0.05, 0.1), ((-2.0, 1.5), (-1.5, 1.5)))
    (loop,) = found.homoclinics
    assert loop.parameter == pytest.approx(a0, abs=6e-11 if b0 == -0.5 else 6e-14)


def test_a_cycle_of_two_saddles_splits_in_two() -> None:
    """References as above: both connections at once if b1 = a1 = 0; else one for each direction."""
    box = ((-1.0, 1.0), (-1.0, 1.0))
    both = planar_connections(_cubic(0.0, 0.0, -0.25), (0.02, 0.1), box).heteroclinics
    assert [orbit.parameter for orbit in both] == pytest.approx([0.0500753647784] * 2, abs=1e-12)
    assert sorted(float(orbit.from_state[0]) for orbit in both) == pytest.approx([-0.5, 0.5])
    rising, falling = planar_connections(_cubic(0.3, 0.0, -0.49), (0.05, 0.15), box).heteroclinics
    assert rising.parameter == pytest.approx(0.0899484180, abs=6e-11)
    assert falling.parameter == pytest.approx(0.1062696062, abs=6e-11)
    assert rising.from_state[0] < 0.0 < falling.from_state[0]


def test_small_and_large_loops_of_a_double_well() -> None:
    """The small loops by reference; the large one, around both wells, by an unrelated integrator from end to end."""
    system = _cubic(0.3, 0.2, 1.0, -1.0)
    found = planar_connections(system, (0.65, 0.88), ((-2.5, 2.5), (-3.0, 3.0)))
    small, large = found.homoclinics
    assert small.parameter == pytest.approx(0.708497480248, abs=6e-13)
    assert large.orbit[:, 0].min() < -1.0
    assert large.orbit[:, 0].max() > 1.0
    start = large.orbit[4]  # on the series: past the saddle, where the integrator has something to grow
    orbit = solve_ivp(
        lambda _, s: system.velocity(s, large.parameter), (0.0, 30.0), start, method="DOP853", rtol=1e-13, atol=1e-14
    )
    # Back near the saddle the error has grown as e to the time spent there.
    distance = np.hypot(*orbit.y)
    last = np.flatnonzero(distance > 0.5)
    back = distance[last[last < np.argmax(orbit.t > 0.0) + len(distance)].max() :] if last.size else distance
    assert back.min() < 1e-4


@pytest.mark.parametrize(("mu2", "mu1"), [(0.1, -1.9373648777e-2), (0.5, -0.46360219842)])
def test_bogdanov_takens_loops(mu2: float, mu1: float) -> None:
    """References by shooting, printed to the digits given: x' = y, y' = mu1 + mu2 y + x² + x y."""
    system = _system({(0, 1, 0): 1.0}, {(0, 0, 1): 1.0, (0, 1, 0): mu2, (2, 0, 0): 1.0, (1, 1, 0): 1.0})
    found = planar_connections(system, (2.0 * mu1, 0.5 * mu1), ((-6.0 * mu2, 6.0 * mu2), (-6.0 * mu2, 6.0 * mu2)))
    assert [loop.parameter for loop in found.homoclinics] == pytest.approx([mu1], rel=2e-11)


def test_the_lienard_road_finds_the_same(printed_system: LienardSystem) -> None:
    """Two roads to the connections of the published model; both are known to 13 digits."""
    box = to_si(100.0, "deg"), to_si(300.0, "deg")
    low, high = to_si(-40.0, "deg"), to_si(20.0, "deg")
    planar = planar_connections(
        PlanarSystem.from_lienard(printed_system), (low, high), ((-box[0], box[0]), (-box[1], box[1]))
    )
    assert planar.homoclinics == ()
    found = [from_si(orbit.parameter, "deg") for orbit in planar.heteroclinics]
    np.testing.assert_allclose(found, [-18.3068198203387, -2.11863437866778], rtol=0, atol=2e-12)
    other = connections(printed_system, (low, high)).heteroclinics
    np.testing.assert_allclose(sorted(o.elevator_rad for o in other), to_si(np.array(found), "deg"), rtol=0, atol=1e-14)
    assert [(stretch.saddles, stretch.others) for stretch in planar.stretches] == [(1, 0), (2, 1), (1, 0)]


def test_intervals_are_those_of_changed_coefficients() -> None:
    """Central differences along a random direction of the coefficients of the leaf; their own error is some 1e-8."""
    direction = np.random.default_rng(1).normal(size=10)
    deviation = 1e-4
    system = _leaf(np.outer(direction, direction) * deviation**2)
    box, reach = ((-1.5, 1.5), (-1.5, 1.5)), (-0.02, 0.03)
    (loop,) = planar_connections(system, reach, box).homoclinics
    theta = np.concatenate([system.first.polynomial.coefficients, system.second.polynomial.coefficients])
    step = 1e-5
    pair = [
        planar_connections(system.with_coefficients(theta + sign * step * direction), reach, box).homoclinics
        for sign in (1.0, -1.0)
    ]
    slope = (pair[0][0].parameter - pair[1][0].parameter) / (2.0 * step)
    assert np.ptp(loop.parameter_interval) == pytest.approx(2.0 * NORMAL_95 * deviation * abs(slope), rel=1e-6)


@pytest.mark.parametrize(
    ("tilt", "damping", "stated"),
    [(0.5, 0.0, True), (0.0, 0.05, True), (0.0, 0.15, True), (0.0, 0.19, False), (0.0, 0.5, False)],
)
def test_a_connection_is_stated_where_it_follows_its_gradient(tilt: float, damping: float, *, stated: bool) -> None:
    """With y' = c x y + mu + tilt x² it lies at mu = −tilt/(1 + c): linear in tilt, but not in c.

    With c = 1 ± d it is where the gradient says but for d/(2 ± d) of d/4: a fifth at d = 1/3, below.
    """
    covariance = np.diag([0.0, 0.0, damping**2, 0.0, tilt**2])
    (orbit,) = planar_connections(_line(0.3, covariance), (-0.3, 0.1), ((-2.0, 2.0), (-1.5, 1.5))).heteroclinics
    assert np.isfinite(orbit.parameter_interval).all() == stated
    if stated:
        half = NORMAL_95 * np.hypot(tilt / 2.0, damping * 0.3 / 4.0)
        np.testing.assert_allclose(orbit.parameter_interval, orbit.parameter + half * np.array([-1.0, 1.0]), rtol=1e-9)


def test_nothing_is_found_where_nothing_is() -> None:
    """Constant divergence allows no loop (Bendixson 1901), however the branches jump as the parameter moves."""
    system = _system({(0, 1, 0): 1.0}, {(0, 0, 1): 1.0, (2, 0, 0): 1.0, (0, 1, 0): -0.3})
    found = planar_connections(system, (-2.0, 1.0), ((-3.0, 3.0), (-3.0, 3.0)))
    assert _everything(found) == []
    assert [(stretch.saddles, stretch.others) for stretch in found.stretches][-1] == (0, 0)
    assert any(stretch.saddles == 1 and not stretch.obstacle for stretch in found.stretches)


def test_equilibria_far_outside_the_box_may_move_by_more_than_the_box() -> None:
    """The short period of Garrard & Jordan (1977) has saddles at ten times the pitch rates that were asked for."""
    system = read_model_file(Path(__file__).parents[2] / "docs" / "examples" / "f8-crusader.toml").system()
    assert isinstance(system, PlanarSystem)
    box = np.array([(-0.6, 0.6), (-1.5, 1.5)])
    far = [max(abs(point.state[1]) for point in planar_equilibria(system, parameter)) for parameter in (0.0, 0.15)]
    assert min(far) > 10.0
    assert abs(far[0] - far[1]) > 1.5  # half of the box, over half of the range
    found = planar_connections(system, (-0.15, 0.15), box)
    assert [stretch.obstacle for stretch in found.stretches] == [""] * len(found.stretches)
    assert sum(stretch.saddles for stretch in found.stretches) == 0
    wide = planar_connections(system, (-0.15, 0.15), np.array([(-1.2, 1.2), (-25.0, 25.0)]))
    assert [stretch.obstacle for stretch in wide.stretches] == [""] * len(wide.stretches)
    assert all(stretch.saddles == 2 for stretch in wide.stretches)


def test_a_connection_outside_the_range_or_the_box_is_not_found() -> None:
    assert _everything(planar_connections(_line(0.1), (0.0, 0.5), ((-2.0, 2.0), (-1.5, 1.5)))) == []
    assert _everything(planar_connections(_line(0.1), (-0.2, 0.5), ((-0.5, 2.0), (-1.5, 1.5)))) == []
    with pytest.raises(InputError, match="a range of parameters"):
        planar_connections(_line(0.1), (0.5, 0.0), ((-2.0, 2.0), (-1.5, 1.5)))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), stable=st.booleans())
def test_a_manifold_is_invariant(seed: int, stable: bool) -> None:  # noqa: FBT001 - hypothesis gives it
    """A step along the series is a step in time: s grows by exp(λ t). Any field of degree 4 with a saddle somewhere."""
    rng = np.random.default_rng(seed)
    i, j = np.indices((5, 5))
    tables = [np.where(i + j <= 4, rng.normal(size=(5, 5)), 0.0) for _ in range(2)]
    values = rng.uniform(0.2, 2.0), -rng.uniform(0.2, 2.0)
    axes = rng.normal(size=(2, 2)) + 2.0 * np.eye(2)
    assume(np.linalg.cond(axes) < 30.0)  # nearly parallel directions are refused: 97 of 100 draws are not
    matrix = axes @ np.diag(values) @ np.linalg.inv(axes)
    for table, row in zip(tables, matrix, strict=True):
        table[0, 0], (table[1, 0], table[0, 1]) = 0.0, row
    flow = PlanarFlow(
        first=tables[0], second=tables[1], first_sizes=abs(tables[0]), second_sizes=abs(tables[1]), scale=PlanarScale()
    )
    whole = planar_manifold(saddle_frame(PlanarField.of(flow), (0.0, 0.0), np.eye(2)), stable=stable)
    assert whole.stable == stable
    assert whole.eigenvalue == pytest.approx(values[1] if stable else values[0], rel=1e-9)
    for side in (-1.0, 1.0):
        start, end = whole.at(0.4 * side * whole.radius), whole.at(side * whole.radius)
        duration = np.log(1.0 / 0.4) / whole.eigenvalue
        orbit = solve_ivp(
            lambda _, s: flow.velocity(*s), (0.0, duration), start, method="DOP853", rtol=1e-12, atol=1e-14
        )
        np.testing.assert_allclose(orbit.y[:, -1], end, rtol=0, atol=1e-9 * whole.radius)


def test_a_node_has_no_saddle_frame() -> None:
    table = np.zeros((2, 2))
    first, second = table.copy(), table.copy()
    first[1, 0], second[0, 1] = -1.0, -2.0
    flow = PlanarFlow(first=first, second=second, first_sizes=abs(first), second_sizes=abs(second), scale=PlanarScale())
    with pytest.raises(RefusedError, match="cannot be told from a node"):
        saddle_frame(PlanarField.of(flow), (0.0, 0.0), np.eye(2))
