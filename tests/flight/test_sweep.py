"""Maneuvers to plans to measured records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from finback.errors import RefusedError
from finback.flight.excitation import Hold, Release, Step, ThreeTwoOneOne
from finback.flight.plan import FlightOptions
from finback.flight.rig import Rig
from finback.flight.sensors import Sensors
from finback.flight.sweep import fly_sweep, plan_flights
from finback.records import Outcome

OPTIONS = FlightOptions(alpha_limits_rad=(-0.56, 0.79), elevator_limits_rad=(-0.69, 0.34), elevator_rate_rad_s=1.0)
SENSORS = Sensors(alpha_noise_rad=0.002, q_noise_rad_s=0.002)
MANEUVERS = (
    ThreeTwoOneOne(elevator_rad=0.0, amplitude_rad=0.05, unit_s=0.3, lead_s=0.2, duration_s=3.0),
    Hold(elevator_rad=-0.2, duration_s=2.0),
    ThreeTwoOneOne(elevator_rad=-0.2, amplitude_rad=0.05, unit_s=0.3, lead_s=0.2, duration_s=3.0),
    Release(elevator_rad=0.0, alpha_rad=0.5, q_rad_s=-0.3, duration_s=3.0),
    Step(elevator_rad=0.0, amplitude_rad=0.33, lead_s=0.2, duration_s=8.0),
)


def test_plans_are_named_by_kind_and_number_and_begin_at_trim(f8ii_rig: Rig) -> None:
    made = plan_flights(MANEUVERS, f8ii_rig.derivatives, OPTIONS).plans
    assert [plan.name for plan in made] == [
        "three-two-one-one-01",
        "hold-01",
        "three-two-one-one-02",
        "release-01",
        "step-01",
    ]
    assert (made[3].alpha_rad, made[3].q_rad_s) == (0.5, -0.3)
    still = f8ii_rig.fly(made[1])
    assert np.ptp(still["alpha_rad"]) < 1e-9
    assert np.ptp(still["q_rad_s"]) < 1e-9


def test_a_sweep_repeats_bit_for_bit_and_a_flight_does_not_depend_on_the_others(f8ii_rig: Rig) -> None:
    made = plan_flights(MANEUVERS, f8ii_rig.derivatives, OPTIONS).plans
    first = list(fly_sweep(f8ii_rig, made, sensors=SENSORS, seed=1))
    again = list(fly_sweep(f8ii_rig, made, sensors=SENSORS, seed=1))
    other = list(fly_sweep(f8ii_rig, (replace(made[1], name="another"), *made[1:]), sensors=SENSORS, seed=1))
    for one, two in zip(first, again, strict=True):
        assert one["alpha_rad"].tobytes() == two["alpha_rad"].tobytes()
    for one, two in zip(first[1:], other[1:], strict=True):
        assert one["q_rad_s"].tobytes() == two["q_rad_s"].tobytes()
    assert [record.outcome for record in first[3:]] == [Outcome.COMPLETED, Outcome.DEPARTED]


def test_noise_is_added_to_what_was_flown(f8ii_rig: Rig) -> None:
    made = plan_flights(MANEUVERS[:1], f8ii_rig.derivatives, OPTIONS).plans
    (seen,) = fly_sweep(f8ii_rig, made, sensors=SENSORS, seed=1)
    noise = seen["alpha_rad"] - f8ii_rig.fly(made[0])["alpha_rad"]
    assert noise.std() == pytest.approx(0.002, rel=0.25)  # 5 standard errors of 301 samples


NO_TRIM = Hold(elevator_rad=0.34, duration_s=2.0)


def test_a_maneuver_without_a_trim_is_a_note_and_the_others_keep_their_names(f8ii_rig: Rig) -> None:
    planned = plan_flights((MANEUVERS[1], NO_TRIM, MANEUVERS[1]), f8ii_rig.derivatives, OPTIONS)
    assert [plan.name for plan in planned.plans] == ["hold-01", "hold-03"]
    (note,) = planned.notes
    assert note.startswith("'hold-02' is not flown: no stable equilibrium at elevator 19.48 deg")


def test_maneuvers_of_which_none_has_a_trim_are_refused(f8ii_rig: Rig) -> None:
    with pytest.raises(RefusedError, match=r"no maneuver can be flown: 'hold-01'(.|\n)*no stable equilibrium"):
        plan_flights((NO_TRIM,), f8ii_rig.derivatives, OPTIONS)
