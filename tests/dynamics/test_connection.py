"""Saddle connections: reference values, a second road, intervals, and what symmetry demands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from finback.dynamics.connection.connection import Direction
from finback.dynamics.connection.loop import loop_gradient, loops
from finback.dynamics.connection.search import Connections, connections
from finback.dynamics.equilibrium import Kind, equilibria
from finback.dynamics.family import Family
from finback.dynamics.flow import Scale, flow_at, rests
from finback.dynamics.lienard import NORMAL_95, Curve, LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.orbit.manifold import branch_to, manifold
from finback.dynamics.polynomial import Polynomial
from finback.dynamics.reduction import reduce
from finback.units import from_si, to_si

_RANGE = (to_si(-40.0, "deg"), to_si(20.0, "deg"))
# The bound at which the references are required to agree.
_SHOOTING = 1e-10


def _system(damping: Sequence[float], force: Sequence[float], *, uncertain: bool = False) -> LienardSystem:
    """Return x'' = f x' + g + elevator; if ``uncertain``, θ are the coefficients of f, then those of g."""
    size = len(damping) + len(force)
    unit = np.eye(size)

    def curve(terms: Sequence[float], variables: tuple[str, ...], rows: np.ndarray) -> Curve:
        powers = {(k, *(0 for _ in variables[1:])): float(value) for k, value in enumerate(terms)}
        return Curve(polynomial=Polynomial.build(powers, variables=variables, value_unit="1"), sensitivity=rows)

    return LienardSystem(
        damping=curve(damping, ("alpha_rad",), unit[: len(damping)]),
        force=curve(force, ("alpha_rad",), unit[len(damping) :]),
        elevator_gain=1.0,
        elevator_gain_sensitivity=np.zeros(size),
        elevator_rate_gain=0.0,
        elevator_rate_gain_sensitivity=np.zeros(size),
        pitch_rate=curve([0.0], ("alpha_rad", "elevator_rad"), np.zeros((1, size))),
        pitch_rate_gain=1.0,
        covariance=1e-6 * unit if uncertain else np.zeros((size, size)),
        domain=np.array([[-np.inf, np.inf]] * 2),
    )


def _normal_form(a1: float, a0: float, b1: float, b0: float, sign: float = 1.0) -> LienardSystem:
    """Eq. (18) of Shi & Fan (2013), or its counterpart with the cubic force reversed."""
    return _system([a0, a1, -1.0], [0.0, b0, b1, sign])


def _nearest_loop(found: Connections) -> float:
    return min((loop.elevator_rad for loop in found.homoclinics), key=abs)


def test_the_published_model_has_exactly_two_connections(printed_system: LienardSystem) -> None:
    found = connections(printed_system, _RANGE)
    upper, lower = found.heteroclinics
    assert found.homoclinics == ()
    assert (upper.direction, lower.direction) == (Direction.RISING, Direction.FALLING)
    assert upper.from_alpha_rad < 0.0 < upper.to_alpha_rad
    assert lower.to_alpha_rad < 0.0 < lower.from_alpha_rad
    assert not any(stretch.obstacle for stretch in found.stretches)
    assert [(stretch.saddles, stretch.others) for stretch in found.stretches] == [(1, 0), (2, 1), (1, 0)]
    for connection in (upper, lower):
        low, high = connection.bracket_rad
        assert low < connection.elevator_rad < high
        assert high - low < 1e-12
        saddles = [p.alpha_rad for p in equilibria(printed_system, connection.elevator_rad) if p.kind is Kind.SADDLE]
        ends = sorted((connection.from_alpha_rad, connection.to_alpha_rad))
        np.testing.assert_allclose(ends, saddles, rtol=0, atol=1e-13)


@pytest.mark.parametrize("index", [0, 1])
def test_shooting_with_an_unrelated_integrator_finds_the_same(printed_system: LienardSystem, index: int) -> None:
    """DOP853 from a point on each eigenvector, in degrees, against the Taylor road; agreement to 1e-10 degrees."""
    connection = connections(printed_system, _RANGE).heteroclinics[index]

    def gap(elevator_deg: float) -> float:
        elevator = float(to_si(elevator_deg, "deg"))
        saddles = [p for p in equilibria(printed_system, elevator) if p.kind is Kind.SADDLE]
        source, target = saddles if connection.direction is Direction.RISING else saddles[::-1]
        section = 0.5 * (source.alpha_rad + target.alpha_rad)
        heights = []
        for saddle, value, forward in (
            (source, source.eigenvalues_real_1_s[0], 1.0),
            (target, target.eigenvalues_real_1_s[1], -1.0),
        ):
            step = 1e-6 * np.sign(section - saddle.alpha_rad)  # the graph bends by 1e-12 of it, and the flow contracts
            curvature = (
                0.5 * (2.0 * float(printed_system.damping.derivative("alpha_rad")(saddle.alpha_rad)) * value)
                + 0.5 * float(printed_system.force.derivative("alpha_rad").derivative("alpha_rad")(saddle.alpha_rad))
            ) / (3.0 * value - float(printed_system.damping(saddle.alpha_rad)))

            def field(_: float, s: np.ndarray, elevator: float = elevator) -> list[float]:
                push = float(printed_system.force(s[0])) + printed_system.elevator_gain * elevator
                return [s[1], float(printed_system.damping(s[0])) * s[1] + push]

            def reached(_: float, s: np.ndarray, section: float = section) -> float:
                return float(s[0] - section)

            reached.terminal = True  # type: ignore[attr-defined]
            start = [saddle.alpha_rad + step, value * step + curvature * step**2]
            orbit = solve_ivp(
                field, (0.0, 30.0 * forward), start, method="DOP853", rtol=1e-13, atol=1e-16, events=reached
            )
            heights.append(float(orbit.y_events[0][0][1]))
        return heights[0] - heights[1]

    near = from_si(connection.elevator_rad, "deg")
    found = brentq(gap, near - 0.01, near + 0.01, xtol=1e-12)
    assert found == pytest.approx(near, abs=_SHOOTING)


def test_the_printed_value_is_no_connection(printed_system: LienardSystem) -> None:
    """At the elevator that the paper prints, the manifolds miss each other by 0.206 deg/s at the sink."""
    flow = flow_at(printed_system, to_si(-2.16458, "deg"), Scale(length_rad=1.0, time_s=1.0))
    left, sink, right = rests(flow)
    heights = [
        branch_to(flow, (left, sink, right), manifold(flow, saddle, stable=stable), sink.x).path.y
        for saddle, stable in ((right, False), (left, True))
    ]
    assert abs(from_si(heights[0] - heights[1], "deg")) == pytest.approx(0.206, abs=5e-4)


@pytest.mark.parametrize(
    ("a1", "b1", "b0", "a0"),
    [
        (0.5, 0.5, -1.0, 0.0594558236872),
        (1.0, 0.75, -1.0, 4.34108613069e-4),
        (0.5, 0.5, -0.1, -0.0062445674),
        (0.5, 0.5, -0.5, 0.0123387537),
        (0.5, 0.5, -2.0, 0.1783210866),
    ],
)
def test_a_loop_closes_at_the_reference(a1: float, b1: float, b0: float, a0: float) -> None:
    """References by shooting in 130 and 170 bits, printed to the digits given; the elevator is then zero."""
    found = connections(_normal_form(a1, a0, b1, b0), (-1.0, 1.0))
    assert abs(_nearest_loop(found)) < 1.5e-10  # the last printed digit of a0, as a constant force


@pytest.mark.parametrize(
    ("system", "directions"),
    [
        # Two-saddle cycle: both at once.
        ((0.0, 0.0500753647784, 0.0, -0.25), {Direction.RISING, Direction.FALLING}),
        # The two halves of the cycle split.
        ((0.3, 0.1062696062, 0.0, -0.49), {Direction.FALLING}),
        ((0.3, 0.0899484180, 0.0, -0.49), {Direction.RISING}),
    ],
)
def test_two_saddles_connect_at_the_reference(
    system: tuple[float, float, float, float], directions: set[Direction]
) -> None:
    found = connections(_normal_form(*system), (-1.0, 1.0)).heteroclinics
    at_zero = {connection.direction for connection in found if abs(connection.elevator_rad) < 1e-10}
    assert at_zero == directions
    assert len(found) == 2


@pytest.mark.parametrize(
    ("a1", "b1", "a0s"),
    [(0.0, 0.0, (0.813793663107,)), (0.3, 0.2, (0.900526573169, 0.708497480248))],
)
def test_the_small_loops_of_the_double_well(a1: float, b1: float, a0s: tuple[float, ...]) -> None:
    """Cubic force reversed, one saddle between two wells: a loop around each."""
    for a0 in a0s:
        found = connections(_normal_form(a1, a0, b1, 1.0, -1.0), (-1.0, 1.0))
        here = [loop for loop in found.homoclinics if abs(loop.elevator_rad) < 1e-11]
        assert len(here) == (2 if len(a0s) == 1 else 1)
        assert all(loop.divergence_1_s == pytest.approx(a0, abs=1e-10) for loop in here)


@pytest.mark.parametrize(("a1", "b1", "side"), [(0.3, 0.2, Direction.RISING), (-0.3, -0.2, Direction.FALLING)])
def test_the_large_loop_around_both_wells(a1: float, b1: float, side: Direction) -> None:
    """Reference by shooting in 130 and 170 bits: type A leaves to the right and comes back from the left."""
    found = connections(_normal_form(a1, 0.769240611445, b1, 1.0, -1.0), (-1.0, 1.0))
    (large,) = [loop for loop in found.homoclinics if abs(loop.elevator_rad) < 1e-11]
    assert large.direction is side
    assert large.resolved
    assert large.turns_alpha_rad.size == 2
    assert large.turns_alpha_rad[0] == large.turn_alpha_rad
    assert large.turns_alpha_rad.prod() < 0.0
    assert large.alpha_rad == pytest.approx(0.0, abs=1e-11)


_THREE_WELLS = np.poly([-2.0, -1.0, 0.1, 1.0, 2.2])[::-1]


@pytest.mark.parametrize("turns", [1, 2])
def test_orbits_that_turn_more_than_once_are_those_of_the_other_parameter(turns: int) -> None:
    """The λ at which a kind of orbit exists without elevator, put into f: then it exists at elevator 0."""
    damping, force = [0.0, 0.3, -0.5, 0.1], (-_THREE_WELLS).tolist()
    family = Family(damping=tuple(damping), force=tuple(force), direction=(1.0,))
    expected = [loop for loop in loops(family, 0.0) if loop.route.turns == turns]
    assert expected
    for loop in expected:
        # Certain but for λ, which is added to the constant of f.
        system = _system([loop.lam, *damping[1:]], force, uncertain=True)
        found = connections(replace(system, covariance=np.diag(np.eye(10)[0])), (-1.0, 1.0))
        orbits = (*found.heteroclinics, *found.homoclinics)
        here = [one for one in orbits if abs(one.elevator_rad) < 1e-11]
        (one,) = (one for one in here if one.turns_alpha_rad.size == turns)
        np.testing.assert_allclose(one.turns_alpha_rad, loop.turns, rtol=0, atol=1e-9)
        # And it moves with λ as it should: dδ/dλ by the intervals of both roads.
        by_elevator = loop_gradient(family, loop).by_mu
        half = 0.5 * np.diff(one.elevator_interval_rad).item()
        assert half == pytest.approx(NORMAL_95 / abs(by_elevator), rel=1e-9)


def test_two_branches_that_turn_short_of_the_section_hide_no_connection() -> None:
    """Every straight connection of three saddles and two wells is found, as λ finds it without elevator."""
    damping, roots = [0.0, 0.2, -0.3], [-2.0, -1.0, 0.0, 1.0, 2.0]
    force = np.poly(roots)[::-1].tolist()
    family = Family(damping=tuple(damping), force=tuple(force), direction=(1.0,))
    straight = [loop for loop in loops(family, 0.0) if not loop.route.turns]
    assert len(straight) == 6
    for loop in straight:
        found = connections(_system([loop.lam, *damping[1:]], force), (-0.5, 0.5)).heteroclinics
        ends = [
            (one.from_alpha_rad, one.to_alpha_rad)
            for one in found
            if abs(one.elevator_rad) < 1e-11 and not one.turns_alpha_rad.size
        ]
        assert ends == [pytest.approx((loop.from_x, loop.to_x), abs=1e-10)]


def test_the_scatter_of_the_published_model(printed_system: LienardSystem) -> None:
    """2 % independent scatter of the seven coefficients moves the lower connection by 0.44 deg (delta method)."""
    values = np.concatenate(
        [printed_system.damping.polynomial.coefficients, printed_system.force.polynomial.coefficients]
    )
    unit = np.eye(7)
    system = replace(
        printed_system,
        damping=replace(printed_system.damping, sensitivity=unit[:3]),
        force=replace(printed_system.force, sensitivity=unit[3:]),
        pitch_rate=replace(
            printed_system.pitch_rate, sensitivity=np.zeros((printed_system.pitch_rate.sensitivity.shape[0], 7))
        ),
        elevator_gain_sensitivity=np.zeros(7),
        elevator_rate_gain_sensitivity=np.zeros(7),
        covariance=np.diag((0.02 * values) ** 2),
    )
    lower = connections(system, _RANGE).heteroclinics[1]
    deviation = from_si(np.diff(lower.elevator_interval_rad).item(), "deg") / (2.0 * NORMAL_95)
    assert deviation == pytest.approx(0.44, abs=0.005)


def test_intervals_are_those_of_differences_coefficient_by_coefficient(paper_model: PolynomialModel) -> None:
    """The Melnikov integral against moving each coefficient and searching again."""
    size = paper_model.coefficients.size
    for k in (0, 3, 4, 5, 7, 10, 11):  # two of each kind; the others enter the same way
        step = 1e-5 * abs(float(paper_model.coefficients[k]))
        variance = np.zeros((size, size))
        variance[k, k] = 1.0
        exact = connections(reduce(replace(paper_model, covariance=variance)), _RANGE).heteroclinics
        low, high = (
            connections(
                reduce(paper_model.with_coefficients(paper_model.coefficients + s * step * np.eye(size)[k])), _RANGE
            )
            for s in (-1.0, 1.0)
        )
        for connection, before, after in zip(exact, low.heteroclinics, high.heteroclinics, strict=True):
            slope = abs(after.elevator_rad - before.elevator_rad) / (2.0 * step)
            half = 0.5 * np.diff(connection.elevator_interval_rad).item()
            assert half == pytest.approx(NORMAL_95 * slope, rel=1e-6)  # curvature of a step of 1e-5


def test_the_interval_of_a_loop_is_that_of_differences() -> None:
    damping, force = [0.0594558236872, 0.5, -1.0], [0.0, -1.0, 0.5, 1.0]
    for k in (0, 2, 3, 6):
        exact = _system(damping, force, uncertain=True)
        exact = replace(exact, covariance=np.diag(np.eye(7)[k]))
        loop = min(connections(exact, (-1.0, 1.0)).homoclinics, key=lambda one: abs(one.elevator_rad))
        moved = []
        for step in (-1e-6, 1e-6):
            row = np.array([*damping, *force]) + step * np.eye(7)[k]
            moved.append(_nearest_loop(connections(_system(row[:3], row[3:]), (-1.0, 1.0))))
        slope = abs(moved[1] - moved[0]) / 2e-6
        assert 0.5 * np.diff(loop.elevator_interval_rad).item() == pytest.approx(NORMAL_95 * slope, rel=1e-6)


def test_the_interval_is_the_scatter_of_samples(paper_model: PolynomialModel) -> None:
    uncertain = replace(paper_model, covariance=np.diag((0.005 * paper_model.coefficients) ** 2))
    exact = connections(reduce(uncertain), _RANGE).heteroclinics
    generator = np.random.default_rng(7)
    samples = generator.multivariate_normal(uncertain.coefficients, uncertain.covariance, size=20)
    found = np.array(
        [
            [c.elevator_rad for c in connections(reduce(uncertain.with_coefficients(row)), _RANGE).heteroclinics]
            for row in samples
        ]
    )
    half = NORMAL_95 * found.std(axis=0, ddof=1)
    predicted = [0.5 * np.diff(connection.elevator_interval_rad).item() for connection in exact]
    # The deviation of 20 samples is itself known to 16 %; three times that.
    np.testing.assert_allclose(predicted, half, rtol=0.49)


_coefficient = st.floats(-1.0, 1.0).map(lambda value: round(value, 3))


@pytest.mark.parametrize("mu2", [20.0, 99.0, 999.0])
def test_a_canard_closes_where_its_branches_are_nearest(mu2: float) -> None:
    """Of x'' = elevator + (mu2 + x) x' + x²: at mu2 = s - 1 the line x' = s - x leads into the saddle s."""
    (loop,) = connections(_system((mu2, 1.0), (0.0, 0.0, 1.0)), (-2.0 * (mu2 + 2.0) ** 2, -0.001)).homoclinics
    assert loop.elevator_rad == pytest.approx(-((mu2 + 1.0) ** 2), rel=1e-12 + math.exp(-0.5 * mu2))
    assert loop.resolved
    assert abs(loop.residual_rad) < 1e-9 * mu2


@settings(deadline=None, max_examples=8)
@given(st.tuples(_coefficient, _coefficient, _coefficient), _coefficient)
def test_mirroring_and_reversal_of_time(damping: tuple[float, float, float], bend: float) -> None:
    """(x, elevator) -> -(x, elevator), and time reversed, map connections to connections."""
    force = [0.0, -1.0, bend, 1.0]
    found = connections(_system(damping, force), (-1.0, 1.0)).heteroclinics
    if not any(damping):
        return  # conservative: connections exist where the energies of the saddles meet, both ways alike
    signs = np.array([1.0, -1.0, 1.0, -1.0])
    mirrored = connections(_system(damping * signs[:3], force * -signs), (-1.0, 1.0)).heteroclinics
    reversed_ = connections(_system([-c for c in damping], force), (-1.0, 1.0)).heteroclinics
    assert len(found) <= 2
    for others, sign in ((mirrored, -1.0), (reversed_, 1.0)):
        expected = sorted((sign * c.elevator_rad, c.direction is not Direction.RISING) for c in found)
        got = sorted((c.elevator_rad, c.direction is Direction.RISING) for c in others)
        if len(got) == 2 and abs(got[1][0] - got[0][0]) < 1e-9:
            continue  # both at one elevator: rounding orders them
        assert [rising for _, rising in got] == [rising for _, rising in expected]
        np.testing.assert_allclose([e for e, _ in got], [e for e, _ in expected], rtol=0, atol=1e-11)


def test_without_saddles_there_is_nothing_to_search(printed_system: LienardSystem) -> None:
    assert connections(replace(printed_system, elevator_gain=0.0), _RANGE) == Connections(
        heteroclinics=(), homoclinics=(), stretches=()
    )
    well = connections(_system([-1.0], [0.0, -1.0, 0.0, -1.0]), (-1.0, 1.0))
    assert well.stretches == ()
