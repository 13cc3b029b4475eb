"""The error that a sweep reports of itself, against an integrator that is not JSBSim's."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import solve_ivp

from finback.errors import RefusedError
from finback.flight.accuracy import REGULAR_RAD, SweepAccuracy, chosen, sweep_accuracy
from finback.flight.aircraft import find_aircraft
from finback.flight.plan import FlightPlan
from finback.flight.rig import Rig
from finback.records import Condition, Hold, Outcome, Schedule
from finback.units import to_si

ROOT = Path(__file__).resolve().parents[2]
CONDITION = Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)
STEP_S = 1 / 400
SMOOTH_RAD = 1e-5
"""Required of smooth flights over 10 s."""
TABULATED_RAD = 5e-4
"""Required of flights through tables at high alpha over 10 s."""


def _rig(step_s: float) -> Rig:
    return Rig(find_aircraft("f8ii", near=ROOT), CONDITION, step_s=step_s)


def _plan(
    alpha_deg: float, q_deg_s: float, elevator_deg: float, *, name: str = "release", then_deg: float | None = None
) -> FlightPlan:
    elevator = to_si(elevator_deg, "deg")
    time, values = [0.0], [elevator]
    if then_deg is not None:
        time, values = [0.0, 1.0, 1.2], [elevator, elevator, to_si(then_deg, "deg")]
    return FlightPlan(
        name=name,
        kind=name.split("-", maxsplit=1)[0],
        alpha_rad=to_si(alpha_deg, "deg"),
        q_rad_s=to_si(q_deg_s, "deg_s"),
        schedule=Schedule(time_s=np.array(time), elevator_rad=np.array(values)),
        hold=Hold.FOH,
        duration_s=10.0,
        sample_interval_s=0.01,
        alpha_limits_rad=(to_si(-33.0, "deg"), to_si(46.0, "deg")),
    )


def _accuracy(plans: list[FlightPlan]) -> SweepAccuracy:
    with _rig(STEP_S) as rig:
        return sweep_accuracy(rig, lambda: _rig(0.5 * STEP_S), plans, step_s=STEP_S, sample="all")


def _true_error(plan: FlightPlan) -> float:
    """Return the largest error of alpha against DOP853 on the rig's own derivatives, stopped at corners."""
    with _rig(STEP_S) as rig:
        record = rig.fly(plan)
        time = record["time_s"]
        corners = sorted({0.0, *plan.schedule.time_s.tolist(), float(time[-1])})
        state, error = np.array([plan.alpha_rad, plan.q_rad_s]), 0.0
        for begin, end in pairwise(corners):
            inside = (time >= begin) & (time <= end)
            found = solve_ivp(
                lambda t, x: rig.derivatives(x[0], x[1], float(plan.schedule.value(t))),
                (begin, end), state, method="DOP853", rtol=1e-10, atol=1e-11, max_step=0.05,
                dense_output=True,
            )  # fmt: skip
            error = max(error, float(np.abs(found.sol(time[inside])[0] - record["alpha_rad"][inside]).max()))
            state = found.y[:, -1]
    return error


@pytest.mark.parametrize(
    ("plan", "tolerance"),
    [
        (_plan(2.0, 0.0, -5.0, then_deg=-8.0), SMOOTH_RAD),
        (_plan(25.0, -20.0, -10.0), TABULATED_RAD),
        (_plan(-20.0, 30.0, 5.0, then_deg=0.0), TABULATED_RAD),
    ],
    ids=["gentle step", "high-alpha release", "low-alpha release with a step"],
)
def test_the_default_step_is_as_good_as_required_and_the_estimate_says_so(plan: FlightPlan, tolerance: float) -> None:
    accuracy = _accuracy([plan]).flights[0]
    true = _true_error(plan)
    assert not accuracy.sensitive
    assert true < tolerance
    # An estimate from two steps of a method of second order; tables make it irregular.
    assert 0.3 * true < accuracy.alpha_error_rad < 3.0 * true


def test_a_flight_beside_the_separatrix_is_sensitive() -> None:
    """Between two releases of which one departs: bisected until the flight stays near the saddle for seconds."""
    low, high = 0.0, 200.0  # pitch rates: the second departs
    with _rig(STEP_S) as rig:
        for _ in range(36):
            middle = 0.5 * (low + high)
            departed = rig.fly(_plan(20.0, middle, -5.0)).outcome is Outcome.DEPARTED
            low, high = (low, middle) if departed else (middle, high)
    beside = _plan(20.0, low, -5.0, name="release-beside")
    calm = _plan(5.0, 0.0, -5.0, name="release-calm")
    found = _accuracy([beside, calm])
    assert [flight.sensitive for flight in found.flights] == [True, False]
    assert found.flights[0].growth > REGULAR_RAD / 1e-9
    assert "'release-beside' is sensitive" in found.sentence()


def test_the_sample_holds_the_fastest_of_every_kind_and_is_spread_over_the_rest() -> None:
    plans = [_plan(1.0 + k, 0.0, -5.0, name=f"release-{k}") for k in range(20)]
    plans += [_plan(2.0, 0.0, -5.0, name=f"step-{k}", then_deg=-6.0) for k in range(20)]
    turning = [0.1] * 40
    turning[13], turning[37] = 3.0, 2.0
    sample, words = chosen(plans, turning, most=6)
    numbers = [plans.index(plan) for plan in sample]
    assert len(set(numbers)) == 6
    assert {13, 37} <= set(numbers)
    assert numbers == sorted(numbers)
    assert max(np.diff(numbers)) < 20
    assert words == "6 of 40: of each kind the one that turns fastest, the others spread evenly"


@given(
    kinds=st.lists(st.sampled_from("abcdefgh"), min_size=1, max_size=30),
    most=st.integers(1, 10),
    seed=st.integers(0, 99),
)
def test_every_kind_is_in_the_sample_and_no_more_flights_than_needed(kinds: list[str], most: int, seed: int) -> None:
    plans = [_plan(1.0, 0.0, -5.0, name=f"{kind}-{number}") for number, kind in enumerate(kinds)]
    turning = np.random.default_rng(seed).random(len(plans)).tolist()
    sample, words = chosen(plans, turning, most=most)
    assert {plan.kind for plan in sample} == set(kinds)
    assert len({plan.name for plan in sample}) == len(sample) == max(len(set(kinds)), min(most, len(plans)))
    assert (words == "all of the study") == (len(sample) == len(plans))
    assert plans[int(np.argmax(turning))] in sample


def test_a_vehicle_that_does_not_fly_at_half_the_step_costs_the_study_nothing() -> None:
    def none() -> Rig:
        raise RefusedError("no such step")

    with _rig(STEP_S) as rig:
        found = sweep_accuracy(rig, none, [_plan(2.0, 0.0, -5.0)], step_s=STEP_S, sample="all")
    assert not found.flights
    assert found.remarks == ("rig: it does not fly at half the step: no such step",)
