"""Flight in the plane of symmetry: it stays there, with the original's forces, gravity and engines."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from finback.errors import InputError
from finback.flight.air import DrydenAir
from finback.flight.airborne import Airborne
from finback.flight.aircraft import Aircraft, find_aircraft
from finback.flight.plan import FlightOptions, FlightPlan
from finback.flight.power import ENGINES_OFF, FixedThrust, Power, Throttle
from finback.flight.simulator import Simulator
from finback.flight.start import FreeStart, SymmetricStart
from finback.flight.state import STATE_NAMES, FlightState
from finback.records import Condition, Outcome
from finback.units import to_si

Writer = Callable[..., Aircraft]
MakePlan = Callable[..., FlightPlan]

IN_PLANE = 1e-9  # rad, rad/s: the requirement; flown along a meridian of a sphere at rest nothing leans out of it
SAME_FORCES = 1e-9  # relative: the same tables at the same state, which the original reaches by its actuators
RATES = 2e-6  # rad/s, m/s²: central differences over 0.01 s of motions that bend by up to 1 rad/s³
STEADY = FixedThrust(thrust_n=25900.0)
NAMES = dict(zip(STATE_NAMES, range(len(STATE_NAMES)), strict=True))


def limits(**changes: object) -> FlightOptions:
    given: dict[str, object] = {
        "fidelity": "symmetric",
        "alpha_limits_rad": (-3.0, 3.0),
        "elevator_limits_rad": (-0.7, 0.35),
        "elevator_rate_rad_s": 1.0,
    }
    return FlightOptions(**{**given, **changes})  # type: ignore[arg-type]


def sideways(record: object) -> float:
    return max(float(np.abs(record[name]).max()) for name in ("beta_rad", "phi_rad", "p_rad_s", "r_rad_s"))  # type: ignore[index]


@pytest.mark.parametrize("power", [ENGINES_OFF, STEADY, Throttle(setting=0.8)], ids=lambda power: type(power).__name__)
def test_a_violent_flight_stays_in_its_plane(symmetric: Airborne, make_plan: MakePlan, power: Power) -> None:
    pull = -0.5 if symmetric.aircraft.name == "f8ii" else -0.15  # the F-16 would tumble
    knots = ((0.0, -0.02), (1.0, -0.02), (1.5, pull), (6.0, pull), (6.5, 0.0))
    record = symmetric.fly(make_plan(*knots, alpha=0.05, duration=20.0, power=power, alpha_limits_rad=(-3.0, 3.0)))
    assert record.outcome is Outcome.COMPLETED
    assert np.ptp(record["alpha_rad"]) > 0.15
    assert np.ptp(record["airspeed_m_s"]) > 10.0
    assert np.ptp(record["altitude_m"]) > 100.0
    assert sideways(record) <= IN_PLANE


def test_a_propeller_does_not_turn_it_out_of_its_plane(make_plan: MakePlan, f16: Aircraft) -> None:
    """Torque and P-factor are canceled, thrust is not."""
    light = Condition(airspeed_m_s=55.0, density_kg_m3=1.1, gravity_m_s2=9.8, altitude_m=1000.0)
    with Airborne(find_aircraft("c172r", near=f16.path), light, limits()) as vehicle:
        flown = {
            power: vehicle.fly(make_plan((0.0, -0.05), alpha=0.03, duration=10.0, power=power))
            for power in (ENGINES_OFF, Throttle(setting=0.7))
        }
    assert all(sideways(record) <= IN_PLANE for record in flown.values())
    glide, powered = (record["airspeed_m_s"][200] for record in flown.values())
    assert powered > glide + 1.0


def test_an_asymmetric_loading_is_moved_into_the_plane(
    write_mini: Writer, condition: Condition, make_plan: MakePlan
) -> None:
    with Airborne(write_mini({"<x>-120</x><y>0</y>": "<x>-120</x><y>-14</y>"}), condition, limits()) as vehicle:
        assert "inertia/cg-y-in" in vehicle.provenance["replaced"]
        assert sideways(vehicle.fly(make_plan((0.0, -0.1), alpha=0.3, duration=5.0))) <= IN_PLANE


def test_logged_rates_are_those_of_the_right_hand_side(symmetric: Airborne, make_plan: MakePlan) -> None:
    """Two roads: slopes of the flown columns, and the suspended simulator at the flown states."""
    record = symmetric.fly(make_plan((0.0, -0.05), (1.0, -0.05), (1.4, -0.15), alpha=0.05, duration=4.0, power=STEADY))
    names = ("airspeed_m_s", "alpha_rad", "q_rad_s", "theta_rad")
    for row in (50, 150, 300):
        state = FlightState(
            altitude_m=float(record["altitude_m"][row]), **{name: float(record[name][row]) for name in names}
        )
        rates = symmetric.rates(state, float(record["elevator_rad"][row]), STEADY)
        for name in names:
            around = record[name][row - 2 : row + 3]
            slope = (around[0] - 8 * around[1] + 8 * around[3] - around[4]) / 0.12
            assert rates[NAMES[name]] == pytest.approx(slope, abs=RATES * (10.0 if name == "airspeed_m_s" else 1.0))
        assert rates[NAMES["alpha_rad"]] == pytest.approx(record["alpha_dot_rad_s"][row], abs=1e-9)
        assert rates[NAMES["q_rad_s"]] == pytest.approx(record["q_dot_rad_s2"][row], abs=1e-7)


def test_its_equations_are_those_of_a_point_mass_with_thrust_and_standard_gravity(f8ii_symmetric: Airborne) -> None:
    """V' = (T cos α - D)/m - g sin γ and α' = q - (L + T sin α - m g cos γ)/(m V), g of the standard atmosphere."""
    read = (
        "forces/fwx-aero-lbs",
        "forces/fwz-aero-lbs",
        "inertia/mass-slugs",
        "inertia/iyy-slugs_ft2",
        "moments/m-aero-lbsft",
    )
    for alpha, q, theta, speed in ((0.05, 0.1, 0.3, 250.0), (0.5, -0.4, -0.6, 180.0), (-0.3, 0.0, 0.0, 320.0)):
        state = FlightState(airspeed_m_s=speed, alpha_rad=alpha, q_rad_s=q, theta_rad=theta, altitude_m=11000.0)
        rates = f8ii_symmetric.rates(state, -0.1, STEADY)
        drag, lift, mass, inertia, moment = f8ii_symmetric._simulator.read(read).values()
        drag, lift = to_si(drag, "lbf"), to_si(lift, "lbf")
        mass, thrust, gamma = to_si(mass, "slug"), STEADY.thrust_n, theta - alpha
        gravity = 9.80665 * (6356766.0 / (6356766.0 + 11000.0)) ** 2
        along = (thrust * math.cos(alpha) - drag) / mass - gravity * math.sin(gamma)
        across = q - (lift + thrust * math.sin(alpha) - mass * gravity * math.cos(gamma)) / (mass * speed)
        assert rates[NAMES["airspeed_m_s"]] == pytest.approx(along, rel=1e-11)
        assert rates[NAMES["alpha_rad"]] == pytest.approx(across, rel=1e-11)
        assert rates[NAMES["q_rad_s"]] == pytest.approx(moment / inertia, rel=1e-11)


def test_forces_and_engines_are_the_originals(f8ii_symmetric: Airborne, f8ii: Aircraft) -> None:
    """At the same height, airspeed, alpha, q, elevator and throttle, which is the flight control's in the original."""
    compared = ("forces/fwx-aero-lbs", "forces/fwz-aero-lbs", "aero/moment/pitch-lbsft", "forces/fbx-prop-lbs")
    original = Simulator(f8ii.path, step_s=1 / 400, freeze_position=False)
    power = Throttle(setting=0.35)
    for alpha, q, command in ((0.1, 0.2, -0.5), (0.4, -0.3, 0.3), (-0.2, 0.0, 0.0)):
        original.reset()
        state = FlightState(airspeed_m_s=250.0, alpha_rad=alpha, q_rad_s=q, theta_rad=alpha, altitude_m=9000.0)
        f8ii_symmetric._nodes.__class__(original).place(state)
        original.write({"fcs/elevator-cmd-norm": command})
        original.start_engines({f"fcs/throttle-cmd-norm[{index}]": 0.35 for index in range(2)})
        original.start_steadily()
        elevator = original.read(["fcs/elevator-pos-rad"])["fcs/elevator-pos-rad"]
        f8ii_symmetric.rates(state, elevator, power)
        whole, copy = original.read(compared), f8ii_symmetric._simulator.read(compared)
        assert whole["forces/fbx-prop-lbs"] > 1000.0
        for name in compared:
            # Density differs by what the ellipsoid's height differs in the standard atmosphere: nothing.
            assert copy[name] == pytest.approx(whole[name], rel=SAME_FORCES), name


def test_flights_repeat_bit_for_bit_whatever_was_flown_between(symmetric: Airborne, make_plan: MakePlan) -> None:
    asked = make_plan((0.0, -0.05), (1.0, -0.1), alpha=0.1, q=0.1, duration=3.0, power=STEADY)
    first = symmetric.fly(asked)
    symmetric.fly(make_plan((0.0, 0.1), alpha=-0.3, q=-0.5, duration=1.0, power=Throttle(setting=1.0)))
    symmetric.rates(FlightState(airspeed_m_s=150.0, alpha_rad=0.6, theta_rad=-1.0), 0.2, ENGINES_OFF)
    again = symmetric.fly(asked)
    assert {name: values.tobytes() for name, values in first.columns.items()} == {
        name: values.tobytes() for name, values in again.columns.items()
    }


def test_a_start_is_where_it_says(symmetric: Airborne, make_plan: MakePlan) -> None:
    start = SymmetricStart(theta_rad=0.4, airspeed_m_s=210.0, altitude_m=8000.0)
    record = symmetric.fly(make_plan((0.0, -0.05), alpha=0.1, q=0.2, duration=0.1, start=start))
    first = {name: values[0] for name, values in record.columns.items()}
    assert first["theta_rad"] == pytest.approx(0.4, abs=1e-12)
    assert first["alpha_rad"] == pytest.approx(0.1, abs=1e-12)
    assert first["q_rad_s"] == pytest.approx(0.2, abs=1e-12)
    assert first["airspeed_m_s"] == pytest.approx(210.0, rel=1e-12)
    assert first["altitude_m"] == pytest.approx(8000.0, rel=1e-9)


def test_the_pitch_angle_goes_through_the_vertical(f8ii_symmetric: Airborne, make_plan: MakePlan) -> None:
    start = SymmetricStart(theta_rad=1.2, airspeed_m_s=295.0, altitude_m=8000.0)
    record = f8ii_symmetric.fly(
        make_plan((0.0, -0.3), alpha=0.1, q=0.3, duration=6.0, start=start, power=Throttle(setting=1.0))
    )
    assert record["theta_rad"].max() > math.pi / 2 + 0.1
    assert np.abs(np.diff(record["theta_rad"])).max() < 0.05
    assert sideways(record) <= IN_PLANE


def test_reaching_the_ground_ends_a_flight(f8ii_symmetric: Airborne, make_plan: MakePlan) -> None:
    start = SymmetricStart(theta_rad=-1.0, airspeed_m_s=250.0, altitude_m=500.0)
    record = f8ii_symmetric.fly(make_plan((0.0, 0.0), alpha=0.0, duration=20.0, start=start))
    assert record.outcome is Outcome.DEPARTED
    assert "reached the ground" in record.note
    assert record["altitude_m"].min() > 0.0


def test_what_it_does_not_have_is_refused(f8ii_symmetric: Airborne, make_plan: MakePlan) -> None:
    turning = FreeStart(theta_rad=0.0, airspeed_m_s=200.0, altitude_m=5000.0, phi_rad=0.5)
    gusts = DrydenAir(intensity_m_s=1.0, length_m=500.0, seed=1)
    for changes in ({"start": turning}, {"air": gusts}):
        with pytest.raises(InputError, match="symmetric flight has no"):
            f8ii_symmetric.fly(make_plan((0.0, 0.0), alpha=0.0, **changes))
    with pytest.raises(InputError, match="not a state"):
        f8ii_symmetric.rates(FlightState(airspeed_m_s=math.nan, alpha_rad=0.0), 0.0, ENGINES_OFF)
    with pytest.raises(InputError, match="jumps"):
        f8ii_symmetric.fly(make_plan((0.0, 0.0), (0.501, 0.0), (0.501, 0.1), alpha=0.0))


def test_the_rate_of_alpha_in_a_pitching_moment_is_not_late(
    write_mini: Writer, condition: Condition, make_plan: MakePlan
) -> None:
    """With thrust and gravity: the moment's own rate equals the central difference of the flown alpha."""
    late = "<product><p>aero/ci2vel</p><value>-3</value><p>aero/alphadot-rad_sec</p></product>"
    with Airborne(write_mini({"<!--pitch-->": late}), condition, limits()) as vehicle:
        assert "algebraic" in vehicle.provenance["replaced"]
        assert vehicle.provenance["frame_late"] == "nothing"
        record = vehicle.fly(make_plan((0.0, -0.1), (0.5, -0.1), (0.9, -0.2), alpha=0.2, duration=2.0, power=STEADY))
        for row in (30, 80, 150):
            names = ("airspeed_m_s", "alpha_rad", "q_rad_s", "theta_rad")
            state = FlightState(
                altitude_m=float(record["altitude_m"][row]), **{name: float(record[name][row]) for name in names}
            )
            rates = vehicle.rates(state, float(record["elevator_rad"][row]), STEADY)
            own = vehicle._simulator.read(["rig/alpha-dot-rad_sec"])["rig/alpha-dot-rad_sec"]
            assert own == pytest.approx(rates[NAMES["alpha_rad"]], abs=1e-12)
            around = record["alpha_rad"][row - 2 : row + 3]
            assert own == pytest.approx((around[0] - 8 * around[1] + 8 * around[3] - around[4]) / 0.12, abs=1e-4)


def test_its_gravity_is_that_of_the_standard_atmosphere(f8ii_symmetric: Airborne) -> None:
    for height in (0.0, 11000.0, 20000.0):
        f8ii_symmetric.rates(FlightState(airspeed_m_s=250.0, alpha_rad=0.0, altitude_m=height), 0.0, ENGINES_OFF)
        gravity = f8ii_symmetric._simulator.read(["accelerations/gravity-ft_sec2"])["accelerations/gravity-ft_sec2"]
        assert to_si(gravity, "ft_s2") == pytest.approx(9.80665 * (6356766.0 / (6356766.0 + height)) ** 2, rel=1e-12)
