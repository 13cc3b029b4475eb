"""Time histories: reference states, the elevator's rate, and the model in alpha and q as the second road."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from finback.dynamics.lienard import LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.reduction import reduce
from finback.dynamics.response import ElevatorSchedule, Response, respond
from finback.errors import InputError
from finback.units import from_si, to_si

PRINTED = 5e-10  # deg: half a unit of the last digit of the reference states
EXACT = 1e-12  # rad, rad/s: two integrators of double precision


def test_the_papers_fig_8(printed_system: LienardSystem) -> None:
    """Taylor series in 130 bits: elevator 0, from (10, 0) in deg and deg/s."""
    found = respond(
        printed_system,
        ElevatorSchedule.held(0.0),
        time_s=[0.0, 1.0, 2.0, 5.0],
        alpha_rad=to_si(10.0, "deg"),
        alpha_dot_rad_s=0.0,
    )
    np.testing.assert_allclose(
        np.column_stack([from_si(found.alpha_rad, "deg"), from_si(found.alpha_dot_rad_s, "deg_s")]),
        [[10.0, 0.0], [-4.752475157, -5.055375146], [2.053296123, 6.086562887], [0.409073270, -1.441426790]],
        rtol=0,
        atol=PRINTED,
    )


def _second_road(
    model: PolynomialModel, schedule: ElevatorSchedule, times: list[float], start: tuple[float, float]
) -> np.ndarray:
    """The same flight in alpha and q, where the elevator's rate does not appear at all."""
    states, state = [np.array(start)], np.array(start)
    stops = sorted({*times, *(t for t in schedule.time_s.tolist() if times[0] < t < times[-1])})
    for begin, end in pairwise(stops):
        low, high = schedule.after(begin), schedule.before(end)

        def field(time: float, now: np.ndarray, ramp: tuple[float, ...] = (begin, end, low, high)) -> list[float]:
            share = (time - ramp[0]) / (ramp[1] - ramp[0])
            elevator = ramp[2] + (ramp[3] - ramp[2]) * share
            return [float(model.alpha_dot(*now, elevator)), float(model.q_dot(*now, elevator))]

        state = solve_ivp(field, (begin, end), state, method="DOP853", rtol=3e-14, atol=1e-15).y[:, -1]
        if end in times:
            states.append(state)
    return np.array(states)


def test_steps_and_ramps_agree_with_the_model_in_alpha_and_q(paper_model: PolynomialModel) -> None:
    """A step makes dα/dt jump by c2 D and leaves q; a ramp adds c2 times its rate. Without c2 nothing agrees."""
    system = reduce(paper_model)
    schedule = ElevatorSchedule(time_s=np.array([0.5, 0.5, 1.0, 2.0]), elevator_rad=np.array([0.0, -0.1, -0.1, 0.05]))
    times = [0.0, 0.25, 0.5, 0.7, 1.5, 3.0]
    found = respond(system, schedule, time_s=times, alpha_rad=0.1, alpha_dot_rad_s=0.2)
    expected = _second_road(paper_model, schedule, times, (0.1, float(system.pitch_rate_at(0.1, 0.2, 0.0))))
    np.testing.assert_allclose(np.column_stack([found.alpha_rad, found.q_rad_s]), expected, rtol=0, atol=EXACT)
    np.testing.assert_allclose(found.elevator_rad, [0.0, 0.0, -0.1, -0.1, -0.025, 0.05], rtol=0, atol=1e-16)
    slopes = [float(paper_model.alpha_dot(*row, de)) for row, de in zip(expected, found.elevator_rad, strict=True)]
    np.testing.assert_allclose(found.alpha_dot_rad_s, slopes, rtol=0, atol=EXACT)


@given(
    split=st.floats(0.05, 0.95),
    elevators=st.lists(st.floats(-0.2, 0.1), min_size=3, max_size=3),
    alpha=st.floats(-0.1, 0.3),
)
@settings(max_examples=15, deadline=None)
def test_a_flight_in_two_parts_is_the_flight(
    printed_system: LienardSystem, split: float, elevators: list[float], alpha: float
) -> None:
    """To stop and go on from the state reached changes nothing: not on a ramp, and not before a step."""
    schedule = ElevatorSchedule(time_s=np.array([0.0, 0.5, 0.5, 1.0]), elevator_rad=np.array([*elevators, 0.0]))
    whole = respond(printed_system, schedule, time_s=[0.0, split, 1.0], alpha_rad=alpha, alpha_dot_rad_s=0.0)
    after = ElevatorSchedule(
        time_s=np.array([split, split, *schedule.time_s[schedule.time_s > split]]),
        elevator_rad=np.array(
            [schedule.after(split), schedule.after(split), *schedule.elevator_rad[schedule.time_s > split]]
        ),
    )
    part = respond(
        printed_system,
        after,
        time_s=[split, 1.0],
        alpha_rad=float(whole.alpha_rad[1]),
        alpha_dot_rad_s=float(whole.alpha_dot_rad_s[1]),
    )
    assert part.alpha_rad[-1] == pytest.approx(whole.alpha_rad[-1], abs=EXACT)
    assert part.alpha_dot_rad_s[-1] == pytest.approx(whole.alpha_dot_rad_s[-1], abs=10 * EXACT)


def test_many_samples_change_none(printed_system: LienardSystem) -> None:
    """Between its steps the integrator interpolates; that must be as exact as the steps."""

    def flown(times: list[float]) -> Response:
        start = {"alpha_rad": 0.3, "alpha_dot_rad_s": 0.1}
        return respond(printed_system, ElevatorSchedule.held(0.02), time_s=times, **start)

    many = flown(np.linspace(0.0, 4.0, 801).tolist())
    for place in (1, 137, 401, 800):
        one = flown([0.0, float(many.time_s[place])])
        assert many.alpha_rad[place] == pytest.approx(one.alpha_rad[-1], abs=EXACT)
        assert many.alpha_dot_rad_s[place] == pytest.approx(one.alpha_dot_rad_s[-1], abs=10 * EXACT)


def test_a_step_at_the_first_time_counts(printed_system: LienardSystem) -> None:
    schedule = ElevatorSchedule.stepped(1.0, before_rad=0.0, after_rad=0.1)
    at = {"alpha_rad": 0.1, "alpha_dot_rad_s": 0.0}
    found = respond(printed_system, schedule, time_s=[1.0], **at)
    assert found.alpha_dot_rad_s.tolist() == [printed_system.elevator_rate_gain * 0.1]
    still = printed_system.pitch_rate_at(0.1, 0.0, 0.0)
    assert found.q_rad_s[0] == pytest.approx(float(still), abs=1e-12)  # c2 as printed is not quite the model's
    later = respond(printed_system, schedule, time_s=[1.5], **at)
    assert later.alpha_dot_rad_s.tolist() == [0.0]


def test_what_blows_up_is_nan_from_there(printed_system: LienardSystem) -> None:
    schedule = ElevatorSchedule(time_s=np.array([0.0, 5.0, 5.0]), elevator_rad=np.array([0.0, 0.0, 0.1]))
    found = respond(printed_system, schedule, time_s=np.linspace(0.0, 10.0, 101), alpha_rad=0.9, alpha_dot_rad_s=1.0)
    lost = np.isnan(found.alpha_rad)
    assert lost.any()
    assert not lost[:3].any()
    first = int(lost.argmax())
    assert lost[first:].all()
    assert np.isnan(found.q_rad_s[first:]).all()
    assert np.isfinite(found.elevator_rad).all()


@pytest.mark.parametrize(
    ("time", "elevator", "said"),
    [
        ([], [], "one length"),
        ([0.0], [0.0, 1.0], "one length"),
        ([0.0, np.nan], [0.0, 0.0], "not finite"),
        ([1.0, 0.0], [0.0, 0.0], "fall"),
    ],
)
def test_schedules_that_are_none(time: list[float], elevator: list[float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        ElevatorSchedule(time_s=np.array(time), elevator_rad=np.array(elevator))


@pytest.mark.parametrize("times", [[], [1.0, 0.0], [0.0, np.inf]])
def test_times_that_are_none(printed_system: LienardSystem, times: list[float]) -> None:
    with pytest.raises(InputError, match="times of a response"):
        respond(printed_system, ElevatorSchedule.held(0.0), time_s=times, alpha_rad=0.0, alpha_dot_rad_s=0.0)
    with pytest.raises(InputError, match="cannot begin"):
        respond(printed_system, ElevatorSchedule.held(0.0), time_s=[0.0], alpha_rad=np.nan, alpha_dot_rad_s=0.0)
