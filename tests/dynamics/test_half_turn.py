"""Half a turn: closed forms, an unrelated integrator, the way back, and every way of not landing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from finback.dynamics.flow import Flow, horner, plain_flow
from finback.dynamics.orbit.half_turn import half_turn
from finback.dynamics.orbit.taylor import Ending
from finback.errors import InputError

# Eq. (18) of Shi & Fan (2013) with a0 = 0, a1 = b1 = 0.5, b0 = -1: a focus at 0 between saddles at -1.28 and 0.78.
_CUBIC = plain_flow([0.0, 0.5, -1.0], [0.0, -1.0, 0.5, 1.0])


def test_a_linear_focus_has_closed_forms() -> None:
    """For x'' = -2 c x' - x half a turn takes π/ω and shrinks x by exp(-π c/ω)."""
    c = 0.1
    omega = math.sqrt(1.0 - c * c)
    flow = plain_flow([-2.0 * c], [0.0, -1.0])
    for x in (1.0, -1e-12, 1e6):
        turn = half_turn(flow, x, forward=True)
        assert turn.ending is Ending.AXIS
        assert turn.landed
        assert turn.duration == pytest.approx(math.pi / omega, rel=1e-14)
        assert turn.damping == pytest.approx(-2.0 * c * math.pi / omega, rel=1e-14)
        assert turn.x == pytest.approx(-x * math.exp(-c * math.pi / omega), rel=1e-14)
        # y = -(x/ω) exp(-c t) sin ωt, so E y² = (x/ω)² sin² ωt.
        assert turn.moment == pytest.approx(0.5 * math.pi * x * x / omega**3, rel=1e-13)


def _by_runge_kutta(flow: Flow, x: float, *, forward: bool) -> tuple[float, float, float, float]:
    way = 1.0 if forward else -1.0

    def field(_: float, s: np.ndarray) -> list[float]:
        f = horner(flow.damping, s[0])
        return [way * v for v in (s[1], f * s[1] + horner(flow.force, s[0]), f, math.exp(-s[2]) * s[1] ** 2)]

    def landed(time: float, s: np.ndarray) -> float:
        return float(s[1]) if time > 1e-3 else -math.copysign(1.0, -way * horner(flow.force, x))

    landed.terminal = True  # type: ignore[attr-defined]
    orbit = solve_ivp(field, (0.0, 60.0), [x, 0.0, 0.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-15, events=landed)
    end, _, damping, moment = orbit.y_events[0][0].tolist()
    return end, way * float(orbit.t_events[0][0]), damping, moment


@pytest.mark.parametrize("forward", [True, False])
@pytest.mark.parametrize("x", [0.6, 0.05, -0.3, -0.45])
def test_an_unrelated_integrator_agrees(x: float, *, forward: bool) -> None:
    turn = half_turn(_CUBIC, x, forward=forward)
    expected = _by_runge_kutta(_CUBIC, x, forward=forward)
    np.testing.assert_allclose((turn.x, turn.duration, turn.damping, turn.moment), expected, rtol=1e-11, atol=1e-12)


@settings(deadline=None, max_examples=40)
@given(
    x=st.floats(-0.7, 0.7).filter(lambda x: abs(x) > 1e-6),
    trace=st.floats(-0.3, 0.3),
    bend=st.floats(-1.0, 1.0),
    forward=st.booleans(),
)
def test_the_way_back_leads_home_and_the_wedge_is_the_derivative(
    x: float, trace: float, bend: float, *, forward: bool
) -> None:
    """Near the center of x'' = -x + …, where every orbit of this size turns."""

    def flow(lam: float) -> Flow:
        return plain_flow([trace + lam, 0.2, -1.0], [0.0, -1.0, bend, -1.0])

    turn = half_turn(flow(0.0), x, forward=forward)
    assert turn.landed
    back = half_turn(flow(0.0), turn.x, forward=not forward)
    assert back.x == pytest.approx(x, rel=1e-12)
    assert back.duration == pytest.approx(-turn.duration, rel=1e-12)
    assert back.damping == pytest.approx(-turn.damping, abs=1e-12)
    growth, force = math.exp(turn.damping), flow(0.0).acceleration
    step = 1e-5
    by_lam = [half_turn(flow(lam), x, forward=forward).x for lam in (-step, step)]
    assert (by_lam[1] - by_lam[0]) / (2.0 * step) == pytest.approx(
        -growth * turn.moment / force(turn.x, 0.0),
        rel=1e-7,
        abs=1e-10 * abs(x),  # a step of 1e-5 curves by 1e-10
    )
    by_x = [half_turn(flow(0.0), x * (1.0 + s), forward=forward).x for s in (-step, step)]
    slope = (by_x[1] - by_x[0]) / (2.0 * step * x)
    assert slope == pytest.approx(growth * force(x, 0.0) / force(turn.x, 0.0), rel=1e-7)


@pytest.mark.parametrize(
    ("damping", "force", "x", "ending"),
    [
        ([0.0, 0.5, -1.0], [0.0, -1.0, 0.5, 1.0], 0.9, Ending.AWAY),  # beyond the right saddle
        ([0.0, 0.5, -1.0], [0.0, -1.0, 0.5, 1.0], -1.5, Ending.AWAY),  # beyond the left
        ([0.0, 0.5, -1.0], [0.0, -1.0, 0.5, 1.0], 0.0, Ending.REST),  # on the equilibrium
        ([-10.0], [0.0, -1.0], 1.0, Ending.REST),  # into a node
        ([-10.0], [-1.0, 1.0], 0.5, Ending.AWAY),
        ([0.0], [1.0], 0.0, Ending.AWAY),  # a constant force: the series is exact for ever
        ([-1e4], [0.0, -1.0], 1.0, Ending.NOWHERE),  # into a node so slowly that no step is long enough
    ],
)
def test_what_does_not_land_says_how_it_ended(
    damping: list[float], force: list[float], x: float, ending: Ending
) -> None:
    for forward in (True, False):
        # Backward, a reversed damping makes the same picture.
        turn = half_turn(plain_flow([c if forward else -c for c in damping], force), x, forward=forward)
        assert not turn.landed
        assert turn.ending is ending
        assert math.isfinite(turn.x)


@given(swing=st.floats(1e-9, 1e-5), forward=st.booleans())
def test_a_swing_that_is_small_beside_its_place_is_not_jumped(swing: float, *, forward: bool) -> None:
    """For x'' = -(x - 1) the series around 1 is dominated by the constant."""
    turn = half_turn(plain_flow([0.0], [1.0, -1.0]), 1.0 + swing, forward=forward)
    assert turn.landed
    assert abs(turn.duration) == pytest.approx(math.pi, abs=1e-5)  # what rounding of 1 leaves of a swing of 1e-9
    assert turn.x - 1.0 == pytest.approx(-swing, abs=1e-15)


@pytest.mark.parametrize(("damping", "force"), [((), (1.0,)), ((1.0,), ()), ((math.nan,), (1.0,))])
def test_a_plain_flow_needs_coefficients(damping: tuple[float, ...], force: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="one finite coefficient"):
        plain_flow(damping, force)
