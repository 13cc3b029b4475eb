"""Loops in a rotation parameter: references, a second road, completeness, and what double precision cannot say."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from finback.arrays import FloatArray
from finback.dynamics.connection.loop import Loop, LoopKind, loop_gradient, loops, loops_along, two_saddle_cycle
from finback.dynamics.equilibrium import eigenvalues
from finback.dynamics.family import Family
from finback.dynamics.flow import Flow, derivative, horner, plain_flow
from finback.dynamics.normal_form.cubic import Cubic
from finback.dynamics.orbit.splitting import Route
from finback.dynamics.orbit.taylor import follow
from finback.errors import InputError, RefusedError

_PRINTED = 1e-12  # references by shooting in 130 and 170 bits, printed to so many digits or fewer


def _cubic(a1: float, b1: float, b2: float = 1.0) -> Family:
    """Eq. (17) of Shi & Fan (2013) with a2 = -1: μ is b0, λ is a0."""
    return Family(damping=(0.0, a1, -1.0), force=(0.0, 0.0, b1, b2), direction=(0.0, 1.0))


_TAKENS = Family(damping=(0.0, 1.0), force=(0.0, 0.0, 1.0), direction=(1.0,))
"""The Bogdanov-Takens normal form x'' = μ1 + μ2 x' + x² + x x'."""


def _homoclinics(found: Sequence[Loop]) -> list[Loop]:
    return [loop for loop in found if loop.kind is LoopKind.HOMOCLINIC]


@pytest.mark.parametrize(
    ("a1", "b1", "b0", "a0", "digits"),
    [
        (0.5, 0.5, -1.0, 0.0594558236872, 1e-13),
        (1.0, 0.75, -1.0, 4.34108613069e-4, 1e-15),
        (0.5, 0.5, -0.1, -0.0062445674, 1e-10),
        (0.5, 0.5, -0.5, 0.0123387537, 1e-10),
        (0.5, 0.5, -2.0, 0.1783210866, 1e-10),
        (0.5, 0.5, -0.5463008119455, 0.0160439235135, 1e-13),
    ],
)
def test_the_loop_of_two_saddles(a1: float, b1: float, b0: float, a0: float, digits: float) -> None:
    found = loops(_cubic(a1, b1), b0)
    assert [loop.kind for loop in found].count(LoopKind.HETEROCLINIC) == 2
    (loop,) = _homoclinics(found)
    assert loop.lam == pytest.approx(a0, abs=0.6 * digits)
    assert loop.resolved
    assert loop.from_x == loop.to_x > 0.0 > loop.turns[0]  # of lower energy, thus the nearer, for b1 > 0
    assert loop.saddle_trace == pytest.approx(a0 + a1 * loop.from_x - loop.from_x**2, abs=1e-10)


def test_the_neutral_loop_has_no_trace() -> None:
    """Where the fold of cycles ends (b_d of section 3.3), f vanishes at the saddle of the loop."""
    (loop,) = _homoclinics(loops(_cubic(0.5, 0.5), -0.5463008119455))
    assert abs(loop.saddle_trace) < 1e-12  # the last printed digit of b0


@pytest.mark.parametrize(
    ("b1", "upper", "lower"), [(0.0, 0.0899484180, 0.1062696062), (-0.0111561592, 0.0972788168, 0.0972788168)]
)
def test_the_halves_of_a_two_saddle_cycle_split(b1: float, upper: float, lower: float) -> None:
    found = [loop for loop in loops(_cubic(0.3, b1), -0.49) if loop.kind is LoopKind.HETEROCLINIC]
    by_side = {loop.route.side: loop for loop in found}
    assert by_side[1].from_x < 0.0 < by_side[1].to_x
    assert by_side[1].lam == pytest.approx(upper, abs=1.2e-10)  # both as far as b1 is printed
    assert by_side[-1].lam == pytest.approx(lower, abs=1.2e-10)


@pytest.mark.parametrize(("a1", "side"), [(0.3, 1), (-0.3, -1), (0.6, 1), (1.5, 1)])
def test_the_loop_closes_at_one_saddle_and_does_not_slide(a1: float, side: int) -> None:
    """For b1 = 0 and a1 > 0 it is homoclinic to the right saddle, between the two heteroclinics."""
    found = loops(_cubic(a1, 0.0), -0.49)
    assert [loop.kind.value for loop in found] == ["heteroclinic", "homoclinic", "heteroclinic"]
    assert math.copysign(1.0, found[1].from_x) == side
    assert all(loop.resolved for loop in found)
    assert min(b.lam - a.lam for a, b in pairwise(found)) > 1e-5


def test_the_symmetric_cycle_is_two_connections_and_no_loop() -> None:
    found = loops(_cubic(0.0, 0.0), -0.25)
    assert [loop.kind for loop in found] == [LoopKind.HETEROCLINIC] * 2
    for loop in found:
        assert loop.lam == pytest.approx(0.0500753647784, abs=_PRINTED)


def test_a_loop_hidden_by_rounding_is_said_to_be() -> None:
    """5e-11 from a two-saddle cycle the loop lies some 1e-25 beside the upper connection."""
    found = loops(_cubic(0.3, -0.0111561592), -0.49)
    (loop,) = _homoclinics(found)
    assert not loop.resolved
    assert loop.from_x > 0.0
    assert loop.lam == next(one.lam for one in found if one.route.side > 0 and not one.route.turns)
    assert loop.residual == math.inf


def test_the_two_saddle_cycle_is_a_point_in_a_third_parameter() -> None:
    cycle = two_saddle_cycle(lambda b1: _cubic(0.3, b1), -0.49, (-0.1, 0.1))
    assert cycle.parameter == pytest.approx(-0.0111561592, abs=1e-10)
    assert cycle.lam == pytest.approx(0.0972788168, abs=1e-10)
    low, high = cycle.bracket
    assert low < cycle.parameter < high
    assert high - low < 1e-13
    assert abs(cycle.residual) < 1e-14
    assert cycle.left_x < 0.0 < cycle.right_x
    ratio = 1.0
    for x in (cycle.left_x, cycle.right_x):
        expanding, contracting = eigenvalues(
            cycle.lam + 0.3 * x - x * x, -(3.0 * x * x + 2.0 * cycle.parameter * x - 0.49)
        )[0]
        ratio *= -contracting / expanding
    assert cycle.ratio == pytest.approx(ratio, rel=1e-9)
    # By symmetry the mirrored family has it at the mirrored place.
    mirrored = two_saddle_cycle(lambda b1: _cubic(-0.3, b1), -0.49, (-0.1, 0.1))
    assert mirrored.parameter == pytest.approx(-cycle.parameter, abs=1e-13)
    with pytest.raises(InputError, match="same order"):
        two_saddle_cycle(lambda b1: _cubic(0.3, b1), -0.49, (0.0, 0.1))
    with pytest.raises(RefusedError, match="two saddles side by side"):
        two_saddle_cycle(lambda b1: _cubic(0.3, b1, -1.0), 1.0, (0.0, 0.1))


@pytest.mark.parametrize(
    ("a1", "b1", "expected"),
    [
        # Route of each: side it leaves to, turns. Both small loops at once, which are the double homoclinic.
        (0.0, 0.0, {(-1, 1): 0.813793663107, (1, 1): 0.813793663107}),
        # Type A: the large loop leaves to the right and comes back from the left.
        (0.3, 0.2, {(1, 1): 0.708497480248, (1, 2): 0.769240611445, (-1, 1): 0.900526573169}),
        (-0.3, -0.2, {(-1, 1): 0.708497480248, (-1, 2): 0.769240611445, (1, 1): 0.900526573169}),
    ],
)
def test_the_loops_of_the_double_well(a1: float, b1: float, expected: dict[tuple[int, int], float]) -> None:
    found = loops(_cubic(a1, b1, -1.0), 1.0)
    assert {(loop.route.side, loop.route.turns) for loop in found} == set(expected)
    for loop in found:
        assert loop.resolved
        assert loop.lam == pytest.approx(expected[loop.route.side, loop.route.turns], abs=_PRINTED)
        assert loop.turns.size == loop.route.turns
        assert loop.turns[0] * loop.route.side > 0.0


@pytest.mark.parametrize(("size", "ratio"), [(1.0, 0.7692406), (0.1, 0.7602027), (1e-4, 0.7700058)])
def test_the_large_loop_of_any_size(size: float, ratio: float) -> None:
    """The coefficients scaled with ε: a0/ε² of the large loop, which first order misses by O(ε ln ε)."""
    found = loops(_cubic(0.3 * size, 0.2 * size, -1.0), size**2)
    (large,) = (loop for loop in found if loop.route.turns == 2)
    assert large.lam / size**2 == pytest.approx(ratio, abs=6e-8)
    assert large.resolved


@pytest.mark.parametrize(
    ("m1", "m2", "relative"),
    [(-1.9373648777e-2, 0.1, 1e-10), (-0.46360219842, 0.5, 1e-10), (-0.1, 0.2288528176297, 1e-12)],
)
def test_the_loop_of_the_bogdanov_takens_form(m1: float, m2: float, relative: float) -> None:
    (loop,) = loops(_TAKENS, m1)
    assert loop.lam == pytest.approx(m2, rel=relative)
    assert loop.from_x == pytest.approx(math.sqrt(-m1), rel=1e-15)


def _miss(family: Family, mu: float, loop: Loop, lam: float) -> float:
    """Shoot from both eigenvectors with DOP853 and compare where the branches turn last."""
    flow = family.at(mu, lam)
    slope = derivative(flow.force)

    def landing(x: float, side: int, turns: int, *, forward: bool) -> float:
        value = eigenvalues(horner(flow.damping, x), -horner(slope, x))[0][0 if forward else 1]
        bend = 0.5 * horner(derivative(slope), x) + horner(derivative(flow.damping), x) * value
        bend /= 3.0 * value - horner(flow.damping, x)
        step = 1e-5 * side  # the next term is 1e-15, and the flow contracts onto the branch
        start = [x + step, value * step + bend * step**2]
        way = 1.0 if forward else -1.0

        def field(_: float, s: np.ndarray) -> list[float]:
            return [way * s[1], way * flow.acceleration(s[0], s[1])]

        def landed(_: float, s: np.ndarray) -> float:
            return float(s[1])

        landed.terminal = turns  # type: ignore[attr-defined]
        orbit = solve_ivp(field, (0.0, 200.0), start, method="DOP853", rtol=1e-13, atol=1e-16, events=landed)
        return float(orbit.y_events[0][-1][0])

    out = landing(loop.from_x, loop.route.side, loop.route.turns, forward=True)
    return out - landing(loop.to_x, loop.route.arrival, 1, forward=False)


@pytest.mark.parametrize(
    ("family", "mu"),
    [
        (_cubic(0.3, 0.2, -1.0), 1.0),
        (_cubic(0.3, 0.0), -0.49),
        (_cubic(0.5, 0.5), -3.0),
        (_TAKENS, -0.7),
        # Both wells are nodes, towards which branches creep.
        (Family(damping=(-0.1, 9.0, -0.5, -6.6), force=(1.2, 3.5, 0.5, -2.0), direction=(1.0,)), 0.0),
    ],
)
def test_shooting_with_an_unrelated_integrator_finds_the_same(family: Family, mu: float) -> None:
    found_here = [loop for loop in _homoclinics(loops(family, mu)) if abs(loop.lam) < 10.0]
    assert found_here  # beyond it a canard, which is not to be compared at its turn
    for loop in found_here:
        found = brentq(lambda lam, loop=loop: _miss(family, mu, loop, lam), loop.lam - 1e-6, loop.lam + 1e-6)
        assert loop.lam == pytest.approx(found, abs=1e-11)  # what DOP853 is asked for, times the length of the orbit


def _of_roots(roots: Sequence[float], damping: Sequence[float], sign: float) -> Family:
    force = sign * np.poly(roots)[::-1]
    return Family(damping=tuple(damping), force=tuple(force.tolist()), direction=(1.0,))


def _itinerary(family: Family, loop: Loop, lam: float, turns: int) -> tuple[int, ...]:
    """Return between which equilibria an unstable branch turns, time after time, from a point on its eigenvector."""
    flow = family.at(0.0, lam)
    slope = derivative(flow.force)
    xs = [loop.from_x]
    value = eigenvalues(horner(flow.damping, xs[0]), -horner(slope, xs[0]))[0][0]
    step = 1e-5 * loop.route.side
    path = follow(flow, (xs[0] + step, value * step), forward=True, section=math.nan, turns=turns)
    landings = [piece.x[0] for piece in path.pieces if piece.y[0] == 0.0]
    if path.ending.value == "axis":
        landings.append(path.x)
    roots = np.sort(np.roots(flow.force[::-1]).real)
    return tuple(np.searchsorted(roots, landings).tolist())


@pytest.mark.parametrize(
    ("roots", "damping", "sign"),
    [
        ((-2.0, -1.0, 0.0, 1.0, 2.0), (0.0, 0.1, -0.3), -1.0),
        ((-2.0, -1.0, 0.1, 1.0, 2.2), (0.0, 0.3, -0.5, 0.1), -1.0),
        ((-2.0, -1.0, 0.0, 1.0, 2.0), (0.0, 0.2, -0.3), 1.0),
    ],
)
def test_nothing_is_missed_between_many_equilibria(
    roots: tuple[float, ...], damping: tuple[float, ...], sign: float
) -> None:
    """An unstable branch changes where it turns exactly where a connection was found, on a grid of λ."""
    family = _of_roots(roots, damping, sign)
    found = loops(family, 0.0, most_turns=4)
    assert all(loop.resolved for loop in found)
    assert max(loop.route.turns for loop in found) > 1
    grid = np.linspace(found[0].lam - 0.1, found[-1].lam + 0.1, 150)
    for loop in {(one.route.source, one.route.side): one for one in found}.values():
        own = [one.lam for one in found if (one.from_x, one.route.side) == (loop.from_x, loop.route.side)]
        paths = [_itinerary(family, loop, lam, 5) for lam in grid.tolist()]
        for (low, before), (high, after) in pairwise(zip(grid.tolist(), paths, strict=True)):
            here = any(low < lam < high for lam in own)
            if min(len(before), len(after)) < 5 and not here:
                continue  # a node or an escape ends it; where it becomes a focus is no connection
            assert (before != after) == here


def _reversed(route: Route) -> Route:
    return Route(route.target, route.arrival, route.turns, route.source)


_coefficient = st.floats(-1.0, 1.0).map(lambda value: round(value, 3))


@settings(deadline=None, max_examples=15)
@given(st.tuples(_coefficient, _coefficient), _coefficient, st.sampled_from([-1.0, 1.0]))
def test_mirroring_reversal_of_time_and_scaling(damping: tuple[float, float], bend: float, sign: float) -> None:
    family = Family(damping=(0.0, *damping), force=(0.0, -sign, bend, sign), direction=(1.0,))
    found = {loop.route: loop for loop in loops(family, 0.01) if loop.resolved}
    close = {"abs": 1e-10, "rel": 1e-10}  # near a two-saddle cycle a value is known less well
    mirrored = Family(damping=(0.0, -damping[0], damping[1]), force=(0.0, -sign, -bend, sign), direction=(-1.0,))
    for loop in loops(mirrored, 0.01):
        route = Route(2 - loop.route.source, -loop.route.side, loop.route.turns, 2 - loop.route.target)
        if route in found:
            assert loop.lam == pytest.approx(found[route].lam, **close)
    backward = Family(damping=(0.0, -damping[0], -damping[1]), force=family.force, direction=(1.0,))
    reversed_ = {_reversed(loop.route): loop for loop in loops(backward, 0.01) if loop.resolved}
    for route in set(found) & set(reversed_):
        assert reversed_[route].lam == pytest.approx(-found[route].lam, **close)
    # What one road resolves and the other does not lies at a two-saddle cycle or a double loop.
    for route in set(found) ^ set(reversed_):
        lams = [loop.lam for loop in loops(family, 0.01)]
        assert min((abs(b - a) for a, b in pairwise(lams)), default=0.0) < 1e-6, route
    length, time = 3.0, 0.2
    scaled = Family(
        damping=tuple(c * time * length**k for k, c in enumerate(family.damping)),
        force=tuple(c * time**2 * length ** (k - 1) for k, c in enumerate(family.force)),
        direction=(time**2 / length,),
    )
    for loop in loops(scaled, 0.01):
        if loop.resolved and loop.route in found:
            assert loop.lam / time == pytest.approx(found[loop.route].lam, **close)


@pytest.mark.parametrize(
    ("family", "mu"),
    [
        (_cubic(0.3, 0.0), -0.49),
        (_cubic(0.3, 0.2, -1.0), 1.0),
        (_of_roots((-2.0, -1.0, 0.0, 1.0, 2.0), (0.0, 0.1, -0.3), -1.0), 0.0),
    ],
)
def test_the_gradient_is_that_of_differences(family: Family, mu: float) -> None:
    found = loops(family, mu, most_turns=2)
    step = 1e-6

    def moved(rows: str, k: int, by: float) -> dict[Route, float]:
        values = list(getattr(family, rows))
        values[k] += by
        rest = {name: getattr(family, name) for name in ("damping", "force", "direction") if name != rows}
        return {loop.route: loop.lam for loop in loops(Family(**{rows: tuple(values)}, **rest), mu, most_turns=2)}

    for rows, count in (("damping", len(family.damping)), ("force", len(family.force))):
        for k in range(count):
            low, high = (moved(rows, k, by) for by in (-step, step))
            for loop in found:
                gradient = loop_gradient(family, loop)
                exact = gradient.by_damping[k] if rows == "damping" else gradient.by_force[k]
                difference = (high[loop.route] - low[loop.route]) / (2.0 * step)
                assert exact == pytest.approx(difference, rel=1e-5, abs=1e-7)  # curvature of a step of 1e-6
    for loop in found:
        sides = [{one.route: one.lam for one in loops(family, mu + by, most_turns=2)} for by in (-step, step)]
        difference = (sides[1][loop.route] - sides[0][loop.route]) / (2.0 * step)
        assert loop_gradient(family, loop).by_mu == pytest.approx(difference, rel=1e-5, abs=1e-7)
        assert loop_gradient(family, loop).by_damping[0] == -1.0


def test_what_has_no_loop_and_what_is_refused() -> None:
    assert loops(Family(damping=(0.0, 1.0), force=(0.0, -1.0, 0.0, -1.0), direction=(1.0,)), 0.0) == ()
    assert loops(Family(damping=(0.0, 1.0), force=(1.0, 0.0, 1.0), direction=(1.0,)), 0.0) == ()
    with pytest.raises(RefusedError, match="cannot be told apart"):
        loops(_TAKENS, 0.0)
    with pytest.raises(InputError, match="most_turns"):
        loops(_TAKENS, -1.0, most_turns=-1)


_number = st.floats(-2.0, 2.0).map(lambda value: round(value, 3))


@settings(deadline=None, max_examples=12)
@given(_number, _number, st.floats(0.5, 60.0).map(lambda value: round(value, 2)), st.sampled_from([-1.0, 1.0]))
@example(0.205779251045033, -0.8551321370980031, 52.49473954154096, -1.0)
def test_what_is_resolved_closes_within_rounding(a1: float, b1: float, b0: float, b2: float) -> None:
    """Strong damping makes canards of loops: what is rounding where they are passed is 1e-5 at the turn."""
    size = 0.5 * (abs(b1) + math.sqrt(b1 * b1 + 4.0 * b0))
    for loop in loops(_cubic(a1, b1, b2), b2 * -b0, most_turns=2):
        if loop.resolved:
            assert abs(loop.residual) <= 1e-12 * size * max(1.0, b0)


def test_a_canard_is_compared_where_it_is_passed() -> None:
    """Two roads: DOP853 from both sides of λ leaves the orbit to opposite sides after it has passed the fold."""
    family = _cubic(0.205779251045033, -0.8551321370980031, -1.0)
    found = loops(family, 52.49473954154096)
    assert [loop.route.turns for loop in found] == [1, 2, 1]
    assert all(loop.resolved for loop in found)
    assert max(abs(loop.residual) for loop in found) < 1e-12
    # The large loop ends with the same canard as the small one that needs more damping taken off.
    assert found[1].lam == pytest.approx(found[2].lam, rel=1e-11)
    for loop in (found[0], found[2]):
        slope = eigenvalues(loop.saddle_trace, -52.49473954154096)[0][0]
        assert {_passes(family.at(52.49473954154096, loop.lam + change), loop, slope) for change in (-1e-3, 1e-3)} == {
            False,
            True,
        }


@pytest.mark.parametrize("size", [20.0, 53.0, 100.0, 1000.0])
def test_the_loop_of_the_bogdanov_takens_form_far_from_its_cusp(size: float) -> None:
    """It lies ever nearer to μ2 = s - 1, where y = s - x carries the saddle s = √-μ1: the most extreme canard.

    For every μ1 < 0 there is one loop (Perko, SIAM J. Appl. Math. 52, 1992).
    """
    (loop,) = loops(_TAKENS, -(size**2))
    assert loop.resolved
    assert loop.lam == pytest.approx(size - 1.0, rel=2.0 * math.exp(-0.2 * size) + 1e-14)
    assert -3.0 * size < loop.turns.item() < -2.5 * size


@pytest.mark.parametrize("size", [53.0, 100.0])
def test_a_canard_run_backward_is_one(size: float) -> None:
    """With time reversed it is the first arc that throws orbits apart."""
    (loop,) = loops(_TAKENS, -(size**2))
    (back,) = loops(replace(_TAKENS, damping=(0.0, -1.0)), -(size**2))
    assert back.resolved
    assert back.lam == pytest.approx(-loop.lam, rel=1e-13)


def test_a_canard_round_a_node_is_a_loop_like_others() -> None:
    """Its λ by DOP853 and Radau from both sides to x = 1.62, where the last arc ceases to draw orbits together."""
    family = Family(damping=(-0.1, 9.0, -0.5, -6.6), force=(1.2, 3.5, 0.5, -2.0), direction=(1.0,))
    (loop,) = (loop for loop in loops(family, 0.0) if loop.route == Route(1, 1, 1, 1))
    assert loop.resolved
    assert loop.lam == pytest.approx(13.505273321363, abs=1e-11)


def _passes(flow: Flow, loop: Loop, slope: float) -> bool:
    """Tell whether an orbit that leaves a saddle at 0 passes it on its return, or turns before."""

    def field(_: float, state: FloatArray) -> list[float]:
        return [state[1], flow.acceleration(state[0], state[1])]

    def turned(_: float, state: FloatArray) -> float:
        return float(state[1])

    def passed(_: float, state: FloatArray) -> float:
        return float(state[0])

    turned.terminal = 2  # type: ignore[attr-defined]
    passed.terminal = True  # type: ignore[attr-defined]
    start = 1e-6 * loop.route.side
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13, "events": (turned, passed)}
    orbit = solve_ivp(field, (0.0, 100.0), (start, slope * start), **options)
    return bool(orbit.t_events[1].size)


def test_every_loop_lies_in_its_bracket_where_the_signs_differ() -> None:
    for loop in loops(_cubic(0.3, 0.2, -1.0), 1.0):
        low, high = loop.bracket
        assert low < loop.lam < high
        assert high - low < 1e-14
        assert abs(loop.residual) < 1e-14
    flow = plain_flow((1.0,), (0.0, 1.0))  # and a saddle alone has none
    assert loops(Family(damping=flow.damping, force=flow.force, direction=(1.0,)), 0.0) == ()


def test_loops_along_a_row_are_those_found_one_by_one() -> None:
    family = Cubic(a1=0.5, b1=0.5, a0=0.0, b0=-1.0).family()
    mus = [-0.5, -0.6, -0.75, -0.9, -0.9, -1.2, -2.0, 0.5, -0.7]
    for mu, found in zip(mus, loops_along(family, mus), strict=True):
        alone = loops(family, mu)
        assert [loop.route for loop in found] == [loop.route for loop in alone]
        np.testing.assert_allclose([one.lam for one in found], [one.lam for one in alone], rtol=0, atol=1e-14)
