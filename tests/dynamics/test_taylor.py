"""Orbits by Taylor series: published time histories, an unrelated integrator, and the way back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st
from scipy.integrate import solve_ivp

from finback.dynamics.flow import Flow, Scale, flow_at, horner, shifted
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.orbit.taylor import Ending, follow, pieces
from finback.errors import RefusedError
from finback.units import from_si, si_factor, to_si

_PLAIN = Scale(length_rad=1.0, time_s=1.0)


def _flow(damping: list[float], force: list[float]) -> Flow:
    return Flow(damping=tuple(damping), force=tuple(force), force_sizes=tuple(map(abs, force)))


def _state(flow: Flow, start: tuple[float, float], time: float) -> tuple[float, float]:
    elapsed = 0.0
    for piece in pieces(flow, start, forward=time > 0.0):
        if abs(elapsed + piece.span) >= abs(time):
            return piece.at(time - elapsed)
        elapsed += piece.span
    raise AssertionError("the orbit ended early")


def test_time_history_of_the_published_model(printed_system: LienardSystem) -> None:
    """States from alpha = 10 deg at rest, elevator 0: Taylor integration in 130 and 170 bits."""
    flow = flow_at(printed_system, 0.0, _PLAIN)
    for time, alpha, rate in (
        (1.0, -4.752475157, -5.055375146),
        (2.0, 2.053296123, 6.086562887),
        (5.0, 0.409073270, -1.441426790),
    ):
        found = from_si(np.array(_state(flow, (to_si(10.0, "deg"), 0.0), time)), "deg")
        np.testing.assert_allclose(found, (alpha, rate), rtol=0, atol=6e-10)  # printed to nine decimals


_number = st.floats(-1.0, 1.0)
_SHORT = 0.25  # s: no orbit from the unit square blows up so soon, even with every coefficient 1


@settings(deadline=None, max_examples=20)
@example([1.0], [1.0], 0.0, 0.0)  # starts where the state has no size
@example([0.0], [1.0, 3.6e-21], 0.0, 0.0)  # a series that is nearly exact for ever
@given(st.lists(_number, min_size=1, max_size=4), st.lists(_number, min_size=1, max_size=6), _number, _number)
def test_an_unrelated_integrator_agrees_and_the_way_back_leads_home(
    damping: list[float], force: list[float], x: float, y: float
) -> None:
    flow = _flow(damping, force)
    reached = _state(flow, (x, y), _SHORT)
    other = solve_ivp(
        lambda _, s: [s[1], flow.acceleration(*s)], (0.0, _SHORT), [x, y], method="DOP853", rtol=1e-13, atol=1e-14
    )
    size = max(1.0, *map(abs, reached))
    np.testing.assert_allclose(reached, other.y[:, -1], rtol=0, atol=1e-10 * size)  # what DOP853 is asked for
    np.testing.assert_allclose(_state(flow, reached, -_SHORT), (x, y), rtol=0, atol=1e-11 * size**4)


def test_an_oscillator_turns_where_it_must() -> None:
    """The oscillator x'' = -x from (0, 1): at the section after an angle, at the axis after a quarter turn."""
    flow = _flow([0.0], [0.0, -1.0])
    for section, ending, time in ((0.5, Ending.SECTION, math.pi / 6.0), (2.0, Ending.AXIS, math.pi / 2.0)):
        path = follow(flow, (0.0, 1.0), forward=True, section=section)
        assert path.ending is ending
        assert path.duration == pytest.approx(time, abs=1e-15 * 8)
        assert path.x == pytest.approx(min(section, 1.0), abs=1e-15 * 4)
    back = follow(flow, (0.0, 1.0), forward=False, section=-2.0)
    assert (back.ending, back.duration) == (Ending.AXIS, pytest.approx(-math.pi / 2.0, abs=1e-14))


def test_blow_up_ends_an_orbit() -> None:
    """The solution of x'' = x³ from (1, 1) is infinite after a finite time; nothing hangs and nothing warns."""
    flow = _flow([0.0], [0.0, 0.0, 0.0, 1.0])
    path = follow(flow, (1.0, 1.0), forward=True, section=math.inf)
    assert path.ending is Ending.AWAY
    assert 0.5 < path.duration < 2.0


@given(st.lists(_number, min_size=1, max_size=6), _number, _number)
def test_a_shifted_polynomial_is_the_same(row: list[float], x: float, u: float) -> None:
    assert horner(shifted(row, x), u) == pytest.approx(horner(row, x + u), abs=1e-13)


def test_degrees_need_no_other_scale(printed_system: LienardSystem) -> None:
    """The same flow in units of a degree and of half a second is the same motion."""
    scale = Scale(length_rad=si_factor("deg"), time_s=0.5)
    plain, scaled = flow_at(printed_system, 0.1, _PLAIN), flow_at(printed_system, 0.1, scale)
    x, y = 0.2, -0.3
    expected = plain.acceleration(x, y) * scale.time_s**2 / scale.length_rad
    assert scaled.acceleration(x / scale.length_rad, y / scale.speed_rad_s) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("length", [1e155, 1e-155])
def test_absurd_units_are_refused_not_crashed_on(printed_system: LienardSystem, length: float) -> None:
    """A power of a double raises OverflowError where a product gives inf; neither gets out."""
    with pytest.raises(RefusedError, match="too large for double precision"):
        flow_at(printed_system, 0.0, Scale(length_rad=length, time_s=1.0 / length))
