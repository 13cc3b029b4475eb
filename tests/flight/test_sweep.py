"""Maneuvers to plans to measured records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from finback.errors import RefusedError
from finback.flight.air import DrydenAir
from finback.flight.airborne import Airborne
from finback.flight.excitation import Hold, Release, Step, ThreeTwoOneOne
from finback.flight.plan import Drive, FlightOptions
from finback.flight.power import ENGINES_OFF, FixedThrust
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


def test_a_sweep_in_free_air_has_thrust_and_gusts_of_its_own(f8ii_direct: Airborne) -> None:
    air = DrydenAir(intensity_m_s=1.0, length_m=500.0, seed=5)
    power = FixedThrust(thrust_n=25900.0)
    options = replace(OPTIONS, fidelity="free", drive=Drive.DIRECT, power=power, air=air)
    made = plan_flights(MANEUVERS[:2], f8ii_direct.derivatives, options).plans
    assert [plan.power for plan in made] == [power, power]
    seeds = [plan.air.seed for plan in made if isinstance(plan.air, DrydenAir)]
    assert len(set(seeds)) == 2
    first, again = (list(fly_sweep(f8ii_direct, made, sensors=SENSORS, seed=1)) for _ in range(2))
    for one, two in zip(first, again, strict=True):
        assert all(one[name].tobytes() == two[name].tobytes() for name in one.columns)
        assert np.std(one["beta_rad"]) > 1e-4


def test_the_same_plans_on_the_rig_have_no_thrust(f8ii_rig: Rig) -> None:
    """A campaign over fidelities shares one set of options."""
    options = replace(OPTIONS, power=FixedThrust(thrust_n=25900.0))
    (plan,) = plan_flights(MANEUVERS[1:2], f8ii_rig.derivatives, options).plans
    assert plan.power == ENGINES_OFF


def test_the_same_maneuver_diverges_between_fidelities_as_airspeed_does(
    f8ii_rig: Rig, f8ii_symmetric: Airborne, f8ii_direct: Airborne
) -> None:
    """What tells a cause of disagreement: symmetric and free agree in plane, the rig holds the airspeed."""
    maneuver = Step(elevator_rad=-0.05, amplitude_rad=-0.2, lead_s=0.2, duration_s=8.0)
    rig, plane, free = (
        vehicle.fly(plan_flights((maneuver,), f8ii_rig.derivatives, OPTIONS).plans[0])
        for vehicle in (f8ii_rig, f8ii_symmetric, f8ii_direct)
    )
    assert np.abs(plane["alpha_rad"] - free["alpha_rad"]).max() < 1e-3  # rotation, and gravity of the ellipsoid
    assert 2e-3 < np.abs(plane["alpha_rad"] - rig["alpha_rad"]).max() < 0.1
    assert np.ptp(rig["airspeed_m_s"]) < 1e-4
    assert np.ptp(plane["airspeed_m_s"]) > 10.0
