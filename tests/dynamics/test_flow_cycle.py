"""Limit cycles of flows: counts and numbers of references, a second integrator, symmetries."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, example, given, settings, strategies as st
from numpy.polynomial import polynomial as npp
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.dynamics.cycle.flow_cycle import FlowCycle, flow_cycles
from finback.dynamics.flow import Flow, Scale, flow_at, plain_flow
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.orbit.annulus import groups
from finback.dynamics.orbit.half_turn import half_turn
from finback.errors import RefusedError
from finback.units import to_si

# The reference numbers of continuations are printed to ten decimals (places) and seven or five (times, multipliers).
PLACE, TIME, MULTIPLIER = 0.6e-10, 0.6e-7, 0.6e-5
# A start off by 1e-3 has decayed by e^-20, to 2e-12; the interpolant adds some 1e-10.
INTEGRATORS = 1e-9

_PARAMETER = st.floats(-1.5, 1.5).map(lambda value: round(value, 3))


def _cubic(a0: float, a1: float, b1: float, b0: float, b2: float = 1.0) -> Flow:
    """Y' = (-x² + a1 x + a0) y + (b2 x² + b1 x + b0) x."""
    return plain_flow((a0, a1, -1.0), (0.0, b0, b1, b2))


def test_two_cycles_of_the_cubic_family() -> None:
    """Reference: AUTO-07p and shooting at (a1, b1, b0, a0) = (0.5, 0.5, -0.35, 0.0022)."""
    inner, outer = flow_cycles(_cubic(0.0022, 0.5, 0.5, -0.35)).cycles
    assert [inner.x_max, outer.x_max] == pytest.approx([0.2309049400, 0.3530097113], rel=0, abs=PLACE)
    assert [inner.period, outer.period] == pytest.approx([11.8182429, 15.2332123], rel=0, abs=TIME)
    assert [inner.multiplier, outer.multiplier] == pytest.approx([0.98376, 1.07791], rel=0, abs=MULTIPLIER)
    assert [inner.stable, outer.stable] == [True, False]


@pytest.mark.parametrize(
    ("parameters", "stabilities"),
    [
        ((0.003, 0.5, 0.5, -0.35), []),  # I: above all curves
        ((0.0022, 0.5, 0.5, -0.35), [True, False]),  # II: stable inside unstable
        ((0.03, 0.5, 0.5, -1.0), [True]),  # III: between Hopf and homoclinic, where that is positive
        ((-0.003, 0.5, 0.5, -0.1), [False]),  # IV: the same where it is negative
        ((-0.01, 0.5, 0.5, -0.35), []),  # V: below all curves
        ((0.119942, 1.5, 0.0, -1.0), [True, False]),  # cycles that the Abelian integral does not see
        ((0.1199409, 1.5, 0.0, -1.0), [True]),  # below their window of 2.7e-6
        ((0.119945, 1.5, 0.0, -1.0), []),  # above it
    ],
)
def test_the_regions_of_the_saddle_case(parameters: tuple[float, float, float, float], stabilities: list[bool]) -> None:
    """Shi & Fan 2013, Fig. 3 and 4, regions I to V; the last three: Caubergh, Dumortier & Roussarie 2005."""
    assert [cycle.stable for cycle in flow_cycles(_cubic(*parameters)).cycles] == stabilities


@pytest.mark.parametrize(
    ("a1", "b1", "a0", "counts"),
    [
        (0.0, 0.0, 0.76, (0, 0, 0)),
        (0.0, 0.0, 0.79, (0, 0, 2)),
        (0.0, 0.0, 0.90, (1, 1, 1)),
        (0.0, 0.0, 1.10, (0, 0, 1)),
        (0.3, 0.2, 0.70, (0, 0, 0)),
        (0.3, 0.2, 0.74, (0, 1, 0)),
        (0.3, 0.2, 0.765, (0, 1, 2)),
        (0.3, 0.2, 0.80, (0, 1, 1)),
        (0.3, 0.2, 0.895, (0, 0, 1)),
        (0.3, 0.2, 1.00, (1, 0, 1)),
        (0.3, 0.2, 1.20, (0, 0, 1)),
    ],
)
def test_the_sequences_of_the_double_well(a1: float, b1: float, a0: float, counts: tuple[int, int, int]) -> None:
    """Counts [left, right, outer] between the bifurcations of independent 130-bit arithmetic, b2 = -1, b0 = 1."""
    left, right = (0.5 * (b1 + sign * math.sqrt(b1 * b1 + 4.0)) for sign in (-1.0, 1.0))
    found = flow_cycles(_cubic(a0, a1, b1, 1.0, -1.0))
    assert (found.count(left), found.count(right), found.count(left, 0.0, right)) == counts
    assert len(found.cycles) == sum(counts)
    outer = [cycle.stable for cycle in found.cycles if len(cycle.enclosed) == 3]
    assert outer == [False, True][2 - len(outer) :]  # the larger one is stable


@pytest.mark.parametrize(
    ("a1", "b1", "a0", "stabilities"),
    [
        (0.0, 0.0, -0.05, []),
        (0.0, 0.0, 0.1, [True]),
        (1.0, 0.5, 0.5, [True]),
        (2.0, 1.2, -0.1, []),
        (2.0, 1.2, -0.05, [False, True]),
        (2.0, 1.2, 0.1, [True]),
    ],
)
def test_the_single_well(a1: float, b1: float, a0: float, stabilities: list[bool]) -> None:
    found = flow_cycles(_cubic(a0, a1, b1, -1.0, -1.0))
    assert [cycle.stable for cycle in found.cycles] == stabilities


@pytest.mark.parametrize("lam", [1e-5, 1e-8, 1e-11])
def test_a_tiny_cycle_beside_a_hopf_point_is_found(lam: float) -> None:
    """Its amplitude is √(-λ/(2a)), to first order, with a = (a1 b1 + b0)/(-8 b0)."""
    (cycle,) = flow_cycles(_cubic(lam, 0.5, 0.5, -1.0)).cycles
    amplitude = math.sqrt(-lam / (2.0 * (0.25 - 1.0) / 8.0))
    assert 0.5 * (cycle.x_max - cycle.x_min) == pytest.approx(amplitude, rel=max(10.0 * lam, 1e-5))
    assert cycle.stable


def test_van_der_pol() -> None:
    """X'' = μ (1 - x²) x' - x at μ = 1: amplitude 2.00862, period 6.66329 (Zonneveld 1966, cited by many)."""
    (cycle,) = flow_cycles(plain_flow((1.0, 0.0, -1.0), (0.0, -1.0))).cycles
    assert cycle.x_max == pytest.approx(2.00862, rel=0, abs=0.5e-5)
    assert cycle.x_min == pytest.approx(-cycle.x_max, rel=1e-14)
    assert cycle.period == pytest.approx(6.66329, rel=0, abs=0.5e-5)
    assert cycle.stable


def _settled(flow: Flow, x: float, turns: float, *, forward: bool) -> tuple[float, float]:
    """Return x_max and period to which an orbit from (x, 0) settles within a time, by DOP853."""
    sign = 1.0 if forward else -1.0
    damping, force = (np.polynomial.Polynomial(row) for row in (flow.damping, flow.force))

    def field(_: float, state: FloatArray) -> list[float]:
        return [sign * state[1], sign * float(damping(state[0]) * state[1] + force(state[0]))]

    def top(_: float, state: FloatArray) -> float:
        return float(state[1])

    top.direction = -sign  # type: ignore[attr-defined]
    # Events are located on the interpolant, which is of lower order than the steps: they are kept short.
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 0.1}
    found = solve_ivp(field, (0.0, turns), (x, 0.0), events=top, **options)
    return float(found.y_events[0][-1, 0]), float(np.diff(found.t_events[0])[-1])


@pytest.mark.parametrize(
    ("flow", "count"),
    [
        (_cubic(0.765, 0.3, 0.2, 1.0, -1.0), 3),
        (plain_flow((0.3, 0.2, -1.0, 0.1), (0.1, -1.0, 0.3, -0.6)), 1),
    ],
)
def test_orbits_settle_on_the_cycles(flow: Flow, count: int) -> None:
    """Two roads: long integrations by another integrator, backward onto cycles that are unstable."""
    cycles = flow_cycles(flow).cycles
    assert len(cycles) == count
    for cycle in cycles:
        start = cycle.x_max + 1e-3 * (cycle.x_max - cycle.x_min)
        turns = cycle.period * (2.0 + 20.0 / abs(cycle.log_multiplier))
        x_max, period = _settled(flow, start, turns, forward=cycle.stable)
        assert x_max == pytest.approx(cycle.x_max, rel=INTEGRATORS)
        assert period == pytest.approx(cycle.period, rel=INTEGRATORS)


@st.composite
def flows(draw: st.DrawFn) -> Flow:
    """Damping of degree 1 to 4, force of degree 1 to 4 with an equilibrium at 0."""
    damping = draw(st.lists(_PARAMETER, min_size=2, max_size=5))
    force = draw(st.lists(_PARAMETER, min_size=1, max_size=4))
    slopes = [(k + 1) * c for k, c in enumerate(force)]
    zeros = npp.polyroots([0.0, *np.trim_zeros(force, "b")]) if any(force) else np.zeros(1)
    # Equilibria well apart and an eigenvalue scale near 1: a fold is another test.
    assume(all(abs(npp.polyval(z.real, slopes)) > 0.1 for z in zeros if abs(z.imag) < 1e-9))
    return plain_flow(damping, (0.0, *force))


def _cycles(flow: Flow) -> tuple[FlowCycle, ...]:
    try:
        return flow_cycles(flow).cycles
    except RefusedError:
        assume(False)
        raise


def _known(cycle: FlowCycle) -> float:
    """How well a place is known: worse where the multiplier is near 1, and where half a turn amplifies rounding."""
    growth = abs(cycle.log_multiplier)
    return 1e-11 * math.exp(min(0.6 * growth, 20.0)) / min(1.0, growth)


def _same(found: tuple[FlowCycle, ...], expected: tuple[FlowCycle, ...], sign: float, time: float = 1.0) -> None:
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        loose = _known(other)
        assert one.log_multiplier == pytest.approx(sign * other.log_multiplier, rel=1e-7, abs=1e3 * loose)
        assert one.period == pytest.approx(time * other.period, rel=10.0 * loose)


@settings(deadline=None, max_examples=10)
@given(flows())
@example(_cubic(0.0022, 0.5, 0.5, -0.35))
def test_time_reversal(flow: Flow) -> None:
    """Backward in time, with y turned over, the same cycles have the inverse multipliers."""
    expected = _cycles(flow)
    found = _cycles(plain_flow([-c for c in flow.damping], flow.force))
    _same(found, expected, -1.0)
    for one, other in zip(found, expected, strict=True):
        loose = _known(other) * (other.x_max - other.x_min)
        assert [one.x_min, one.x_max] == pytest.approx([other.x_min, other.x_max], rel=0, abs=loose)


@settings(deadline=None, max_examples=10)
@given(flows(), st.floats(0.1, 10.0), st.floats(0.1, 10.0))
@example(_cubic(0.765, 0.3, 0.2, 1.0, -1.0), 3.0, 0.2)
def test_rescaling_commutes(flow: Flow, length: float, time: float) -> None:
    expected = _cycles(flow)
    damping = [c * length**k / time for k, c in enumerate(flow.damping)]
    force = [c * length ** (k - 1) / time**2 for k, c in enumerate(flow.force)]
    found = _cycles(plain_flow(damping, force))
    _same(found, expected, 1.0, time)
    for one, other in zip(found, expected, strict=True):
        loose = _known(other) * (other.x_max - other.x_min)
        assert one.x_max * length == pytest.approx(other.x_max, rel=0, abs=loose)


@settings(deadline=None, max_examples=10)
@given(flows())
@example(_cubic(0.765, 0.3, 0.2, 1.0, -1.0))
@example(plain_flow((-5.557893415608639e-06, 1.382, 1.193, 0.408, -1.22), (0.0, -0.546)))
def test_the_mirror_image(flow: Flow) -> None:
    expected = sorted(_cycles(flow), key=lambda cycle: cycle.period)
    mirrored = plain_flow(
        [c * (-1.0) ** k for k, c in enumerate(flow.damping)], [-c * (-1.0) ** k for k, c in enumerate(flow.force)]
    )
    found = sorted(_cycles(mirrored), key=lambda cycle: cycle.period)
    _same(tuple(found), tuple(expected), 1.0)


def _displacement(flow: Flow, x: float) -> float:
    """Return whether an orbit from its right turn lands farther left forward than backward, as a sign; 0 unknown."""
    ahead, behind = (half_turn(flow, x, forward=forward) for forward in (True, False))
    if not (ahead.landed and behind.landed) or abs(ahead.x - behind.x) < 1e-9 * (x - ahead.x):
        return 0.0
    return float(np.sign(ahead.x - behind.x))


@settings(deadline=None, max_examples=12)
@given(flows())
@example(_cubic(0.765, 0.3, 0.2, 1.0, -1.0))
@example(_cubic(0.0022, 0.5, 0.5, -0.35))
def test_every_change_of_the_displacement_on_a_grid_is_a_cycle(flow: Flow) -> None:
    """A second road to the count: the displacement over a turn on a uniform grid of right turns, at λ = 0."""
    # Odd f and g have a center, whose large orbits, along an invariant line, close to few digits only.
    assume(any(flow.damping[::2]) or any(flow.force[::2]))
    cycles = _cycles(flow)
    for group in groups(flow):
        if len(group.enclosed) > 1:
            continue
        right = group.limits[1] if math.isfinite(group.limits[1]) else group.enclosed[-1].x + 4.0
        grid = np.linspace(group.enclosed[-1].x, right, 60)[1:-1]
        signs = [(x, _displacement(flow, x)) for x in grid.tolist()]
        for (low, before), (high, after) in pairwise(signs):
            here = [half_turn(flow, x, forward=True).x > group.limits[0] for x in (low, high)]
            if before * after < 0.0 and all(here):
                inside = [c for c in cycles if low <= c.x_max <= high and len(c.enclosed) == 1]
                assert len(inside) % 2 == 1, f"between {low} and {high}"


@settings(deadline=None, max_examples=12)
@given(flows())
@example(_cubic(0.0022, 0.5, 0.5, -0.35))
def test_a_cycle_lies_in_its_bracket_where_bendixson_allows_it(flow: Flow) -> None:
    for cycle in _cycles(flow):
        assert cycle.bracket[0] <= cycle.x_max <= cycle.bracket[1]
        assert abs(cycle.residual) <= 100.0 * _known(cycle) * (cycle.x_max - cycle.x_min)
        damping = npp.polyval(np.linspace(cycle.x_min, cycle.x_max, 400), flow.damping)
        assert damping.min() < 0.0 < damping.max()
        assert cycle.x_min < cycle.enclosed[0] <= cycle.enclosed[-1] < cycle.x_max
        assert len(cycle.enclosed) % 2 == 1


_RELAXATION = plain_flow((-1.0, 0.0, 1.0, 0.0, -0.05), (0.0, -1.0))


def test_a_cycle_too_stable_to_be_followed_backward_is_found() -> None:
    """Two roads: DOP853 settles on it; backward half a turn spreads neighbors by e^54."""
    inner, outer = flow_cycles(_RELAXATION).cycles
    assert [inner.stable, outer.stable] == [False, True]
    x_max, period = _settled(_RELAXATION, 7.0, 60.0, forward=True)
    assert outer.x_max == pytest.approx(x_max, rel=INTEGRATORS)
    assert outer.x_min == pytest.approx(-x_max, rel=INTEGRATORS)
    assert outer.period == pytest.approx(period, rel=INTEGRATORS)
    assert outer.log_multiplier < -100.0
    assert abs(outer.residual) <= 1e-13 * x_max
    assert outer.bracket[0] < outer.x_max < outer.bracket[1]


@pytest.mark.parametrize(
    ("damping", "force", "x_min", "x_max"),
    [
        # From random flows: from one end both halves spread orbits, from the other both draw them together.
        ((-1.046, -0.865, 0.219), (0.0, -0.209), -4.168605, 7.664641),
        ((1.261, 0.26, -0.959, 0.698, -0.141), (0.0, -0.976), -2.163675, 4.178593),
        ((1.136, -0.609, -0.023), (0.0, -1.493), -41.480003, 18.254437),
        ((-1.417, 0.842, 0.264), (0.0, -0.343), -7.027653, 4.281470),
        ((-1.332, 0.481, 1.103, -0.141, 0.773), (0.0, -0.554, -0.519, -0.22), -1.721599, 1.415870),
    ],
)
def test_stiff_cycles_are_the_same_in_the_mirror_and_backward(
    damping: tuple[float, ...], force: tuple[float, ...], x_min: float, x_max: float
) -> None:
    """Two roads: DOP853, in the direction in which they attract."""
    flow = plain_flow(damping, force)
    (cycle,) = flow_cycles(flow).cycles
    assert [cycle.x_min, cycle.x_max] == pytest.approx([x_min, x_max], rel=0, abs=1e-6)
    settled = _settled(flow, 1.2 * cycle.x_max, 4.0 * cycle.period, forward=cycle.stable)
    assert [cycle.x_max, cycle.period] == pytest.approx(settled, rel=1e-7)  # DOP853 is at its limit of stiffness
    images = [
        ([c * (-1.0) ** k for k, c in enumerate(damping)], [-c * (-1.0) ** k for k, c in enumerate(force)], -1.0),
        ([-c for c in damping], force, 1.0),
    ]
    for rows in images:
        (other,) = flow_cycles(plain_flow(rows[0], rows[1])).cycles
        assert sorted(rows[2] * x for x in (other.x_min, other.x_max)) == pytest.approx(
            [cycle.x_min, cycle.x_max], rel=1e-9
        )
        assert other.period == pytest.approx(cycle.period, rel=1e-9)
        assert abs(other.log_multiplier) == pytest.approx(abs(cycle.log_multiplier), rel=1e-9)


def test_a_center_whose_large_orbits_cannot_be_followed_is_none_the_less_one() -> None:
    """F linear, g linear: λ* is the same everywhere; beyond an invariant line no orbit closes."""
    length, time = 2.1, 0.7
    found = flow_cycles(plain_flow((-0.994 / time, -0.425 * length / time), (0.0, -1.236 / time**2)))
    assert found.cycles == ()


def test_where_a_search_ended_is_said() -> None:
    """Large orbits of this center run along an invariant line and away from it: no start says where they land."""
    (search,) = flow_cycles(plain_flow((0.0, 0.7), (0.0, -1.0))).searched
    assert "could not be followed closely enough" in search.obstacle
    assert search.obstacle in search.finding
    assert "center" in search.finding
    (search,) = flow_cycles(_RELAXATION).searched
    assert search.obstacle == ""


def test_the_paper_aircraft_has_no_cycle(printed_system: LienardSystem) -> None:
    scale = Scale(length_rad=to_si(40.0, "deg"), time_s=0.35)
    for elevator in (-30.0, -10.0, 0.0, 10.0):
        found = flow_cycles(flow_at(printed_system, to_si(elevator, "deg"), scale))
        assert found.cycles == ()
        assert [search.orbits > 0 for search in found.searched] == [True]
        assert "not proven" in found.searched[0].finding


def test_where_damping_has_one_sign_nothing_is_searched() -> None:
    found = flow_cycles(plain_flow((-0.1, 0.0, -1.0), (0.0, -1.0, 0.0, 0.5)))
    assert found.cycles == ()
    assert "Bendixson" in found.searched[0].finding
    assert found.searched[0].orbits == 0


def test_a_center_has_no_limit_cycle() -> None:
    """Negative controls: a conservative flow, and the reversible one of Eq. 16 at its degenerate Hopf value."""
    conservative = flow_cycles(plain_flow((0.0,), (0.0, -1.0, 0.0, 0.5)))
    assert conservative.cycles == ()
    assert "no closed orbit is isolated" in conservative.searched[0].finding
    reversible = flow_cycles(plain_flow((0.0, 0.7), (0.0, -1.0)))
    assert reversible.cycles == ()
    assert "center" in reversible.searched[0].finding


def test_a_flow_on_a_loop_is_said_to_be_on_it() -> None:
    """Reference: the large loop of (a1, b1, b0) = (0.3, 0.2, 1) of the double well at a0 = 0.769240611445."""
    found = flow_cycles(_cubic(0.7692406114445823, 0.3, 0.2, 1.0, -1.0))
    assert [len(cycle.enclosed) for cycle in found.cycles] == [1, 3]
    assert "loop within rounding" in found.searched[-1].finding


def test_equilibria_that_meet_are_refused() -> None:
    with pytest.raises(RefusedError, match="fold"):
        flow_cycles(plain_flow((0.1, -1.0), (0.0, 0.0, 1.0)))


def test_a_group_without_closed_orbits_is_said_to_have_none() -> None:
    """X'' = f x' + g with the middle saddle above both outer ones: no orbit goes round all three."""
    zeros = (-1.2, -1.0, 0.0, 1.0, 1.2)
    found = flow_cycles(plain_flow((0.1, 0.0, -1.0), npp.polyfromroots(zeros)))
    assert [len(search.enclosed) for search in found.searched] == [1, 1, 3]
    assert "no orbit closes" in found.searched[2].finding


def test_a_multiplier_beyond_double_precision_keeps_its_logarithm() -> None:
    base = flow_cycles(plain_flow((1.0, 0.0, -1.0), (0.0, -1.0))).cycles[0]
    for sign, multiplier in ((1.0, math.inf), (-1.0, 0.0)):
        fields = {name: getattr(base, name) for name in base.__dataclass_fields__}
        cycle = FlowCycle(**{**fields, "log_multiplier": sign * 800.0})
        assert cycle.multiplier == multiplier
