"""Limit cycles of random and of stiff flows: brute-force integration as the second road, any units, obstacles said."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given, settings, strategies as st
from numpy.polynomial import polynomial as npp
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.dynamics.cycle import flow_cycle as module
from finback.dynamics.cycle.flow_cycle import FlowCycle, flow_cycles
from finback.dynamics.flow import Flow, plain_flow
from finback.dynamics.orbit.natural_unit import natural_unit
from finback.dynamics.orbit.passage_kernel import slow_height
from finback.errors import InputError, RefusedError

# LSODA at 1e-8 follows the attracting direction; a cycle is found by it to some 1e-6 of its size.
INTEGRATED = 1e-5
# The search and the same in other units differ by rounding, which a multiplier near 1 magnifies.
UNITS = 1e-9
_TURNS = 12  # after which an orbit has settled, or is not waited for


def _sections(flow: Flow, start: float, *, forward: bool, time: float) -> FloatArray:
    """Return where an orbit from (start, 0) turns on the right, time after time, by LSODA; empty if it goes away."""
    sign = 1.0 if forward else -1.0
    f, g = (np.polynomial.Polynomial(row) for row in (flow.damping, flow.force))
    slopes = f.deriv(), g.deriv()
    far = 1e3 * (1.0 + abs(start))

    def field(_: float, s: FloatArray) -> list[float]:
        return [sign * s[1], sign * float(f(s[0]) * s[1] + g(s[0]))]

    def jacobian(_: float, s: FloatArray) -> list[list[float]]:
        return [[0.0, sign], [sign * float(slopes[0](s[0]) * s[1] + slopes[1](s[0])), sign * float(f(s[0]))]]

    def top(_: float, s: FloatArray) -> float:
        return float(s[1])

    def gone(_: float, s: FloatArray) -> float:
        return far - abs(float(s[0]))

    top.direction, top.terminal, gone.terminal = -sign, _TURNS, True  # type: ignore[attr-defined]
    options = {"method": "LSODA", "jac": jacobian, "rtol": 1e-8, "atol": 1e-11, "events": (top, gone)}
    try:
        found = solve_ivp(field, (0.0, time), (start, 0.0), **options)
    except ValueError:  # at a blow-up its interpolant does not fit its steps
        return np.zeros(0)
    return np.zeros(0) if found.t_events[1].size or not found.success else found.y_events[0].reshape(-1, 2)[:, 0]


def _attractors(flow: Flow, starts: Sequence[float], *, forward: bool) -> list[float]:
    """Return the right turns of the cycles on which orbits from the starts settle, in one direction of time."""
    rests = npp.polyroots(flow.force)
    places: list[float] = []
    for start in starts:
        turns = _sections(flow, start, forward=forward, time=60.0)
        if len(turns) < 4 or abs(turns[-1] - turns[-2]) > 1e-6 * (1.0 + abs(turns[-1])):
            continue  # it rests, or has not settled
        near = min(abs(rests - turns[-1]))
        if near > 1e-3 and not any(abs(turns[-1] - place) < 1e-4 * (1.0 + abs(place)) for place in places):
            places.append(float(turns[-1]))
    return sorted(places)


def _missing(flow: Flow, cycles: Sequence[FlowCycle], starts: Sequence[float]) -> list[tuple[float, bool]]:
    """Return cycles on which orbits settle and that are not among those given."""
    return [
        (place, forward)
        for forward in (True, False)
        for place in _attractors(flow, starts, forward=forward)
        if not any(c.stable is forward and abs(c.x_max - place) < INTEGRATED * (1.0 + abs(place)) for c in cycles)
    ]


def _settles(flow: Flow, cycle: FlowCycle) -> bool:
    """Tell whether orbits from both sides of a cycle come back to it in the direction in which it attracts."""
    off = 1e-3 * (cycle.x_max - cycle.x_min)
    time = cycle.period * (2.0 + 5.0 / abs(cycle.log_multiplier))
    ends = []
    for start in (cycle.x_max - off, cycle.x_max + off):
        turns = _sections(flow, start, forward=cycle.stable, time=time)
        if not turns.size:
            return False
        ends.append(abs(float(turns[-1]) - cycle.x_max))
    return max(ends) < 0.3 * off


_PARAMETER = st.floats(-2.0, 2.0).map(lambda value: round(value, 3))


@st.composite
def flows(draw: st.DrawFn) -> Flow:
    """Damping of degree 1 to 6, up to strong, force of degree 1 to 7; equilibria well apart."""
    strength = draw(st.sampled_from([0.3, 1.0, 4.0]))
    damping = [strength * c for c in draw(st.lists(_PARAMETER, min_size=2, max_size=7))]
    force = draw(st.lists(_PARAMETER, min_size=2, max_size=8))
    assume(abs(force[-1]) > 0.1)
    zeros = npp.polyroots(force)
    real = np.sort(zeros[abs(zeros.imag) < 1e-6].real)
    slopes = npp.polyval(real, npp.polyder(force))
    assume(real.size and (slopes < 0.0).any() and (abs(slopes) > 0.2).all() and abs(real).max() < 4.0)
    return plain_flow(damping, force)


@settings(deadline=None, max_examples=5)
@given(flows())
@example(plain_flow((6.0, 0.0932, -1.0), (0.0, 2.332, 1.3404, -1.0)))
@example(
    plain_flow((7.743694718450087, 3.909011655260085, -1.0), (0.0, 1.3598363831976936, -0.33911947978934637, -1.0))
)
@example(plain_flow((5.0, 0.0, 0.0, 0.0, -1.0), (0.3, 1.0, 0.0, -1.0)))
@example(plain_flow((2.0, 0.0, 0.0, 0.0, -1.0), (0.0, -4.0, 0.0, 5.0, 0.0, -1.0)))
def test_what_orbits_settle_on_is_found_and_what_is_found_they_settle_on(flow: Flow) -> None:
    """Two roads: LSODA from many places, both ways in time."""
    try:
        found = flow_cycles(flow)
    except RefusedError:
        assume(False)
        raise
    rests = npp.polyroots(flow.force).real
    starts = np.linspace(rests.min() - 0.5, rests.max() + 3.0, 4).tolist()
    if not any(search.obstacle for search in found.searched):
        assert _missing(flow, found.cycles, starts) == []
    for cycle in found.cycles:
        assert abs(cycle.residual) <= 1e-9 * (cycle.x_max - cycle.x_min)
        if 0.5 < abs(cycle.log_multiplier) < 1e3 and cycle.period < 50.0:
            assert _settles(flow, cycle)


def test_the_brute_force_finds_a_cycle_that_is_kept_back_and_unmasks_one_that_is_not() -> None:
    """Negative controls of the property above."""
    flow = plain_flow((5.0, 0.0, 0.0, 0.0, -1.0), (0.3, 1.0, 0.0, -1.0))
    (cycle,) = flow_cycles(flow).cycles
    assert _missing(flow, (), [1.0, 3.0]) == [(pytest.approx(cycle.x_max, rel=INTEGRATED), True)]
    assert not _settles(flow, replace(cycle, x_max=1.1 * cycle.x_max))
    assert not _settles(flow, replace(cycle, log_multiplier=-cycle.log_multiplier))


@pytest.mark.parametrize(
    ("damping", "force", "enclosed", "x_max"),
    [
        # x_max by DOP853 and Radau, printed to so many digits.
        ((5.0, 0.0, 0.0, 0.0, -1.0), (0.3, 1.0, 0.0, -1.0), 3, 2.468652),
        ((6.0, 0.0932, -1.0), (0.0, 2.332, 1.3404, -1.0), 3, 4.991022),
        (
            (6.879617344314442, -0.5060254839367364, -0.34811746668377785, 0.5320020862917986, -0.8197313079389856),
            (-0.63047394786987, -3.70346078269896, -8.40667058076422, -9.22093294751797, -4.88553535067787, -1.0),
            5,
            2.129031,
        ),
        (
            (
                -0.43670827618764924,
                -4.916817274455548,
                4.422292429321678,
                0.9489312594382007,
                3.7823201181659503,
                3.7644670405969247,
                -0.6237024499884571,
            ),
            (0.7759563681434667, -0.9620737434554694, -0.5556965398757097, -0.42732062653522446),
            1,
            8.148132,
        ),
    ],
)
def test_large_relaxation_cycles_of_references(
    damping: tuple[float, ...], force: tuple[float, ...], enclosed: int, x_max: float
) -> None:
    found = flow_cycles(plain_flow(damping, force))
    (cycle,) = [cycle for cycle in found.cycles if len(cycle.enclosed) == enclosed and cycle.stable]
    assert cycle.x_max == pytest.approx(x_max, rel=0, abs=0.6e-6)
    assert cycle.bracket[0] < cycle.x_max < cycle.bracket[1]
    assert not any(search.obstacle for search in found.searched)


@pytest.mark.parametrize("mu", [1.0, 10.0, 100.0, 1e3, 1e4])
def test_van_der_pol_from_mild_to_stiff(mu: float) -> None:
    """Amplitude and period by the asymptotic series (Dorodnitsyn 1947; Urabe 1960 to this order), above mu = 10."""
    (cycle,) = flow_cycles(plain_flow((mu, 0.0, -mu), (0.0, -1.0))).cycles
    assert cycle.x_min == pytest.approx(-cycle.x_max, rel=1e-13)
    if mu < 10.0:
        return
    airy = 2.338107
    logarithm = math.log(mu)
    period = (3.0 - 2.0 * math.log(2.0)) * mu + 3.0 * airy / mu ** (1.0 / 3.0) - (2.0 * logarithm + 1.3246) / (3.0 * mu)
    amplitude = 2.0 + airy / 3.0 * mu ** (-4.0 / 3.0) - 16.0 / 27.0 * logarithm / mu**2
    assert cycle.period == pytest.approx(period, rel=0.3 * mu ** (-4.0 / 3.0))
    assert cycle.x_max == pytest.approx(amplitude, abs=2.0 / mu**2)


@settings(deadline=None, max_examples=5)
@given(flows(), st.floats(-9.0, 9.0), st.floats(-9.0, 9.0))
@example(plain_flow((5.0, 0.0, 0.0, 0.0, -1.0), (0.3, 1.0, 0.0, -1.0)), 6.0, -6.0)
def test_units_do_not_matter(flow: Flow, length: float, time: float) -> None:
    """X counted in units 10^length, t in units 10^time; powers of two change no digit."""
    try:
        expected = flow_cycles(flow)
    except RefusedError:
        assume(False)
        raise
    for unit, second, near in ((10.0**length, 10.0**time, UNITS), (2.0 ** round(length), 2.0 ** round(time), 0.0)):
        damping = [c * second * unit**k for k, c in enumerate(flow.damping)]
        force = [c * second**2 * unit ** (k - 1) for k, c in enumerate(flow.force)]
        found = flow_cycles(plain_flow(damping, force))
        assert [cycle.stable for cycle in found.cycles] == [cycle.stable for cycle in expected.cycles]
        assert [bool(s.obstacle) for s in found.searched] == [bool(s.obstacle) for s in expected.searched]
        for one, other in zip(found.cycles, expected.cycles, strict=True):
            loose = near / min(1.0, abs(other.log_multiplier))
            assert one.x_max * unit == pytest.approx(other.x_max, rel=loose, abs=loose)
            assert one.period * second == pytest.approx(other.period, rel=100.0 * loose, abs=0.0)


def test_one_group_that_hinders_harms_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """The cycle around the second well is made not to close; the others are found all the same, and it is said."""
    flow = plain_flow((0.765, 0.3, -1.0), (0.0, 1.0, 0.2, -1.0))
    plain = flow_cycles(flow)
    assert [len(cycle.enclosed) for cycle in plain.cycles] == [1, 3, 3]
    closing = module.closing

    def failing(change: object) -> object:
        found = closing(change)  # type: ignore[arg-type]
        assert not isinstance(found, str)
        return "one did not close" if found.turns[0] > 0.0 else found

    monkeypatch.setattr(module, "closing", failing)
    found = flow_cycles(flow)
    assert [len(cycle.enclosed) for cycle in found.cycles] == [3, 3]
    assert [search.obstacle for search in found.searched] == ["", "one did not close", ""]
    assert "one did not close" in found.searched[1].finding


@pytest.mark.parametrize(
    ("damping", "force"),
    [((1e308, 0.0, -1e308), (0.0, -1.0)), ((1e308, 0.0, -1e308), (0.0, -1e308)), ((1.0, 1e300), (0.1, -1.0, 1e-300))],
)
def test_coefficients_beyond_double_precision_are_a_mistake(
    damping: tuple[float, ...], force: tuple[float, ...]
) -> None:
    with pytest.raises(InputError, match="too large, or too unlike each other"):
        flow_cycles(plain_flow(damping, force))


def test_the_slow_manifold_solves_its_equation_where_it_is_given() -> None:
    """H h' = f h + g, h' by a central difference; beside a fold (f = 0) there is none."""
    damping, force = np.array([50.0, 3.0, -60.0]), np.array([0.2, -1.0, 0.3])
    work = np.zeros((5, 30))

    def height(x: float) -> float:
        return slow_height(damping, force, x, work)

    for x in (-2.5, -1.6, 1.7, 3.0):
        slope = (height(x + 1e-5) - height(x - 1e-5)) / 2e-5
        f, g = npp.polyval(x, damping), npp.polyval(x, force)
        assert height(x) * slope == pytest.approx(f * height(x) + g, abs=1e-9)
        assert height(x) != -g / f
    assert math.isnan(height(0.94))


def test_units_are_powers_of_two_and_of_the_size_of_the_flow() -> None:
    scaled, scale = natural_unit(plain_flow((1e-3, 0.0, -1e7), (0.0, -1e12)))
    assert math.log2(scale.length_rad) == round(math.log2(scale.length_rad))
    assert max(abs(npp.polyroots(scaled.damping))) == pytest.approx(1.0, abs=0.5)
    assert abs(scaled.force[1]) == pytest.approx(1.0, abs=1.0)


@pytest.mark.parametrize(
    ("damping", "force", "cycles"),
    [
        ((3.5126005400810785, -1.5317544702238184, -1.0), (0.0, 1.6156821745183678, -0.19169405208056883, -1.0), 1),
        ((0.20421237467903053, -0.24032915894476511, -1.0), (0.0, -0.0104784219528809, 1.3403967788691311, 1.0), 0),
    ],
)
def test_a_landing_within_rounding_of_an_equilibrium_is_a_rest(
    damping: tuple[float, ...], force: tuple[float, ...], cycles: int
) -> None:
    # Backward in time orbits come to rest in a node; they land one number beyond it, where the force is exactly 0.
    assert len(flow_cycles(plain_flow(damping, force)).cycles) == cycles
