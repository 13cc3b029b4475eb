"""Limit cycles of a system with units: numbers, intervals, the orbit itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.dynamics.cycle.cycle import Cycle, cycle_orbit, cycles
from finback.dynamics.cycle.flow_cycle import flow_cycles
from finback.dynamics.flow import plain_flow
from finback.dynamics.lienard import LienardSystem
from finback.errors import RefusedError
from finback.units import to_si

Build = Callable[..., LienardSystem]
_DAMPING, _FORCE = (0.0022, 0.5, -1.0), (0.0, -0.35, 0.5, 1.0)
_WELLS = ((0.765, 0.3, -1.0), (0.0, 1.0, 0.2, -1.0))
# Taylor series of the same flow in other units of length and time.
ROUNDING = 1e-12


def test_the_units_of_the_search_do_not_show(build_system: Build) -> None:
    found = cycles(build_system(_DAMPING, _FORCE), 0.0).cycles
    expected = flow_cycles(plain_flow(_DAMPING, _FORCE)).cycles
    assert len(found) == 2
    for one, other in zip(found, expected, strict=True):
        loose = ROUNDING / abs(other.log_multiplier)
        assert one.alpha_max_rad == pytest.approx(other.x_max, rel=loose)
        assert one.alpha_min_rad == pytest.approx(other.x_min, rel=loose)
        assert one.amplitude_rad == pytest.approx(0.5 * (one.alpha_max_rad - one.alpha_min_rad), rel=1e-14)
        assert one.period_s == pytest.approx(other.period, rel=loose)
        assert one.log_multiplier == pytest.approx(other.log_multiplier, rel=100.0 * loose)
        assert one.multiplier == pytest.approx(other.multiplier)
        assert one.stable is other.stable
        assert one.bracket_rad[0] <= one.alpha_max_rad <= one.bracket_rad[1]
        assert one.in_domain
        assert np.ptp(one.amplitude_interval_rad) == np.ptp(one.period_interval_s) == 0.0


def test_the_domain_is_judged_by_the_whole_cycle(build_system: Build) -> None:
    domain = np.array([[-0.2, 0.3], [-1.0, 1.0]])
    found = cycles(replace(build_system(_DAMPING, _FORCE), domain=domain), 0.0).cycles
    assert [cycle.in_domain for cycle in found] == [True, False]


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize(("damping", "force"), [(_DAMPING, _FORCE), _WELLS])
def test_the_orbit_is_that_of_another_integrator(
    build_system: Build, damping: tuple[float, ...], force: tuple[float, ...], index: int
) -> None:
    """Two roads: DOP853 from the largest angle, over one period."""
    system = build_system(damping, force)
    cycle = cycles(system, 0.0).cycles[index]
    orbit = cycle_orbit(system, cycle)

    def field(_: float, state: FloatArray) -> list[float]:
        return [state[1], float(system.damping(state[0]) * state[1] + system.force(state[0]))]

    start = (cycle.alpha_max_rad, 0.0)
    times = orbit.time_s
    assert (np.diff(times) > 0.0).all()
    expected = solve_ivp(field, (0.0, times[-1]), start, method="DOP853", rtol=1e-12, atol=1e-13, max_step=0.1)
    # The interpolant of that integrator is of lower order than its steps: points of its own are compared.
    np.testing.assert_allclose(expected.y[:, -1], start, rtol=0, atol=1e-9)
    own = solve_ivp(field, (0.0, times[150]), start, method="DOP853", rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(own.y[:, -1], [orbit.alpha_rad[150], orbit.alpha_dot_rad_s[150]], rtol=0, atol=1e-9)
    assert orbit.alpha_rad.max() == orbit.alpha_rad[0] == orbit.alpha_rad[-1] == cycle.alpha_max_rad
    q = system.pitch_rate_at(expected.y[0], expected.y[1], 0.0)
    assert cycle.q_max_rad_s == pytest.approx(q.max(), rel=5e-3)  # the nearest of some hundred points
    assert cycle.q_max_rad_s >= max(q.max(), orbit.q_rad_s.max()) - 1e-12
    assert cycle.q_min_rad_s <= min(q.min(), orbit.q_rad_s.min()) + 1e-12


def _measured(system: LienardSystem, index: int) -> FloatArray:
    cycle = cycles(system, 0.01).cycles[index]
    return np.array([cycle.amplitude_rad, cycle.period_s])


@pytest.mark.parametrize("coefficient", range(8))
@pytest.mark.parametrize("index", [0, 1])
def test_one_uncertain_coefficient_moves_a_cycle_as_its_interval_says(
    build_system: Build, index: int, coefficient: int
) -> None:
    """The delta method, coefficient by coefficient, against a central difference; index 1 goes round both wells."""
    theta = np.array([*_WELLS[0], *_WELLS[1], 1.0])
    step = 1e-5
    shift = step * np.eye(8)[coefficient]

    def system_of(values: FloatArray, covariance: FloatArray | None = None) -> LienardSystem:
        return build_system(values[:3], values[3:7], gain=values[7], covariance=covariance)

    up, down = (_measured(system_of(theta + sign * shift), index) for sign in (1.0, -1.0))
    cycle = cycles(system_of(theta, np.outer(shift, shift)), 0.01).cycles[index]
    half = [0.5 * np.ptp(rows) / 1.959963984540054 for rows in (cycle.amplitude_interval_rad, cycle.period_interval_s)]
    # The third derivative, large near the loop at 0.7692, times the square of the step.
    np.testing.assert_allclose(half, 0.5 * np.abs(up - down), rtol=2e-4, atol=1e-13)


def test_the_aircraft_of_the_paper_has_no_cycle(printed_system: LienardSystem) -> None:
    """Reference: no cycle at any elevator between the folds (measured on 120 of them)."""
    for elevator in np.linspace(-34.0, 14.0, 9):
        assert cycles(printed_system, to_si(float(elevator), "deg")).cycles == ()


def test_at_a_fold_of_equilibria_the_search_is_refused(build_system: Build) -> None:
    with pytest.raises(RefusedError, match="fold"):
        cycles(build_system((0.1, -1.0), (0.0, 0.0, 1.0)), 0.0)


def test_an_overflowing_multiplier_keeps_its_logarithm(build_system: Build) -> None:
    cycle = cycles(build_system(_DAMPING, _FORCE), 0.0).cycles[0]
    assert isinstance(cycle, Cycle)
    assert replace(cycle, log_multiplier=1e3).multiplier == np.inf
    assert not replace(cycle, log_multiplier=1e3).stable


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_cycle_too_stiff_for_one_direction_has_its_orbit(build_system: Build, sign: float) -> None:
    """Forward it contracts by e^-108 in a turn, backward nothing keeps near to it; with f turned over conversely."""
    system = build_system((-sign, 0.0, sign, 0.0, -0.05 * sign), (0.0, -1.0))
    cycle = cycles(system, 0.0).cycles[-1]
    assert sign * cycle.log_multiplier < -100.0
    orbit = cycle_orbit(system, cycle)
    assert (np.diff(orbit.time_s) > 0.0).all()
    assert orbit.alpha_rad.min() >= cycle.alpha_min_rad - 1e-9
    assert orbit.alpha_rad.max() == pytest.approx(cycle.alpha_max_rad, rel=1e-9)

    def field(_: float, state: FloatArray) -> list[float]:
        return [state[1], float(system.damping(state[0]) * state[1] + system.force(state[0]))]

    # The way in which it attracts, all round: both halves are those of the other integrator.
    start, end = (0, -1) if sign > 0.0 else (-1, 0)
    times = orbit.time_s[::1] if sign > 0.0 else orbit.time_s[::-1]
    span = (orbit.time_s[start], orbit.time_s[end])
    path = solve_ivp(field, span, (cycle.alpha_max_rad, 0.0), method="DOP853", rtol=1e-12, atol=1e-13, t_eval=times)
    alpha = orbit.alpha_rad if sign > 0.0 else orbit.alpha_rad[::-1]
    np.testing.assert_allclose(path.y[0], alpha, rtol=0, atol=1e-6)  # the interpolant where the speed is some 20
