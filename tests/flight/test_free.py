"""Free flight: all six degrees of freedom over the turning Earth, with the original's forces, actuators and engines."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from finback.errors import AircraftError, InputError, RefusedError
from finback.flight.airborne import Airborne
from finback.flight.aircraft import Aircraft
from finback.flight.derivation import CENTER, INERTIA, MASS_PROPERTIES, WEIGHT
from finback.flight.ending import Escape
from finback.flight.loading import Loading
from finback.flight.plan import FlightOptions, FlightPlan
from finback.flight.power import ENGINES_OFF, FixedThrust, Power, Throttle
from finback.flight.rig import Rig
from finback.flight.simulator import Simulator
from finback.flight.start import FreeStart
from finback.flight.state import STATE_NAMES, FlightState, StateNodes
from finback.records import Condition, Hold, Outcome
from finback.units import from_si, to_si

Writer = Callable[..., Aircraft]
MakePlan = Callable[..., FlightPlan]

SAME_FORCES = 1e-9  # relative to the largest: the same tables at the same state
RATES = 3e-6  # rad/s: differences of fourth order over 0.04 s; the horizon turns by 5e-5 rad/s
START = FreeStart(
    theta_rad=0.2, airspeed_m_s=260.0, altitude_m=9000.0, beta_rad=0.03, phi_rad=0.4, psi_rad=1.0, p_rad_s=0.1,
    r_rad_s=-0.05, latitude_rad=0.7,
)  # fmt: skip
EULER_RAD = 2e-7  # a start without a past, as actuators have it: h²/12 = 5e-7 of rates that change by 0.1 a second
STEADY = FixedThrust(thrust_n=25900.0)
ENGINES = Throttle(setting=0.6)
NAMES = dict(zip(STATE_NAMES, range(len(STATE_NAMES)), strict=True))
RESEARCH = (("fcs/stabilator-research-mode", 1.0),)


def limits(**changes: object) -> FlightOptions:
    given: dict[str, object] = {
        "fidelity": "free",
        "alpha_limits_rad": (-0.6, 0.85),
        "elevator_limits_rad": (-0.7, 0.35),
        "elevator_rate_rad_s": 1.0,
    }
    return FlightOptions(**{**given, **changes})  # type: ignore[arg-type]


def state_at(record: object, row: int, latitude_rad: float) -> FlightState:
    names = (*STATE_NAMES, "psi_rad", "altitude_m")
    return FlightState(latitude_rad=latitude_rad, **{name: float(record[name][row]) for name in names})  # type: ignore[index]


# Its state


def test_a_start_is_where_it_says(free: Airborne, make_plan: MakePlan) -> None:
    record = free.fly(make_plan((0.0, -0.05), alpha=0.1, q=0.2, duration=0.1, start=START))
    first = {name: values[0] for name, values in record.columns.items()}
    for name in ("theta_rad", "airspeed_m_s", "beta_rad", "phi_rad", "psi_rad", "p_rad_s", "r_rad_s"):
        assert first[name] == pytest.approx(getattr(START, name), abs=1e-10), name
    assert first["altitude_m"] == pytest.approx(9000.0, abs=1e-4)
    assert (first["alpha_rad"], first["q_rad_s"]) == pytest.approx((0.1, 0.2), abs=1e-12)
    assert first["elevator_rad"] == pytest.approx(-0.05, abs=1e-12)


@pytest.mark.parametrize("power", [ENGINES_OFF, STEADY, Throttle(setting=0.8)], ids=lambda power: type(power).__name__)
def test_the_right_hand_side_is_the_slope_of_what_is_flown(free: Airborne, make_plan: MakePlan, power: Power) -> None:
    """All eight rates, attitude to the turning horizon included, against differences of the record."""
    record = free.fly(make_plan((0.0, -0.05), alpha=0.08, q=0.02, duration=1.0, start=START, power=power))
    for row in (10, 60):
        rates = free.rates(state_at(record, row, START.latitude_rad), -0.05, power)
        for name, rate in zip(STATE_NAMES, rates, strict=True):
            around = record[name][row - 2 : row + 3]
            slope = (around[0] - 8 * around[1] + 8 * around[3] - around[4]) / 0.12
            # Turbines spool in flight, and turn steadily in the right-hand side.
            slack = 0.2 if isinstance(power, Throttle) else 1e-3
            assert rate == pytest.approx(slope, abs=slack if name == "airspeed_m_s" else 20 * RATES), name


def test_the_horizon_turns_below_a_fast_aircraft(f8ii_direct: Airborne) -> None:
    """Level eastward flight at 250 m/s along the equator: with q = 0 the nose rises by V/r to the horizon."""
    state = FlightState(airspeed_m_s=250.0, alpha_rad=0.0, psi_rad=math.pi / 2, altitude_m=5000.0)
    rates = f8ii_direct.rates(state, 0.0, ENGINES_OFF)
    assert rates[NAMES["theta_rad"]] == pytest.approx(250.0 / 6383137.0, rel=1e-9)


# Its forces


@pytest.mark.parametrize("name", ["f8ii", "f16"])
def test_direct_drive_has_the_originals_forces_and_moments(name: str, request: pytest.FixtureRequest) -> None:
    """At states with sideslip and rotation; surfaces where the original's flight control has put them."""
    vehicle: Airborne = request.getfixturevalue(f"{name}_direct")
    original, copy = Simulator(vehicle.aircraft.path, step_s=1 / 400, freeze_position=False), vehicle._simulator
    compared = tuple(f"forces/fb{axis}-aero-lbs" for axis in "xyz") + tuple(
        f"moments/{axis}-aero-lbsft" for axis in "lmn"
    )
    surfaces = ("fcs/left-aileron-pos-rad", "fcs/aileron-pos-rad", "fcs/rudder-pos-rad", "fcs/flaperon-mix-rad",
                "fcs/lef-pos-rad", "gear/gear-pos-norm", "fcs/speedbrake-pos-rad")  # fmt: skip
    moved = [surface for surface in surfaces if original.has(surface) and copy.has(surface)]
    vehicle.rates(FlightState(airspeed_m_s=250.0, alpha_rad=0.0), 0.0, ENGINES_OFF)
    held = copy.read(moved)
    random = np.random.default_rng(3)
    for alpha, beta, p, q, r, elevator, aileron, rudder in random.uniform(-0.3, 0.3, (20, 8)):
        state = FlightState(
            airspeed_m_s=250.0, alpha_rad=alpha, beta_rad=beta, p_rad_s=p, q_rad_s=q, r_rad_s=r, altitude_m=9000.0,
            latitude_rad=0.5, psi_rad=2.0,
        )  # fmt: skip
        original.reset()
        original.write({"simulation/models/FGPropulsion/enabled": 0.0})
        StateNodes(original).place(state)
        commands = {"elevator": elevator, "aileron": aileron, "rudder": rudder}
        original.write({f"fcs/{surface}-cmd-norm": value for surface, value in commands.items()})
        original.start_steadily()
        copy.write({name: value for name, value in original.read(moved).items() if copy.writable(name)})
        vehicle.rates(state, original.read(["fcs/elevator-pos-rad"])["fcs/elevator-pos-rad"], ENGINES_OFF)
        whole, derived = original.read(compared), copy.read(compared)
        scale = max(abs(value) for value in whole.values())
        for what in compared:
            assert derived[what] == pytest.approx(whole[what], abs=SAME_FORCES * scale), what
    copy.write({name: value for name, value in held.items() if copy.writable(name)})


def test_the_original_is_flown_as_it_is(f8ii_free: Airborne, make_plan: MakePlan) -> None:
    """Two roads: a plan on the vehicle, and the original XML stepped by hand with the same commands."""
    assert f8ii_free.provenance["replaced"] == "nothing"
    record = f8ii_free.fly(
        make_plan(
            (0.0, -0.05), (0.5, -0.05), (0.7, -0.15), alpha=0.05, duration=5.0, start=START, power=Throttle(setting=0.6)
        )
    )
    original = Simulator(f8ii_free.aircraft.path, step_s=1 / 400, freeze_position=False)
    original.reset()
    original.write(dict(RESEARCH))
    StateNodes(original).place(
        FlightState(alpha_rad=0.05, **{name: getattr(START, name) for name in FreeStart.__dataclass_fields__})
    )
    command = original.setter("fcs/elevator-cmd-norm")
    low = from_si(to_si(-40.0, "deg"), "rad")
    command(-0.05 / low * -1.0)
    original.start_engines({f"fcs/throttle-cmd-norm[{index}]": 0.6 for index in range(2)})
    original.start_steadily()
    alpha, altitude = original.getter("aero/alpha-rad"), original.getter("position/h-sl-ft")
    for step in range(1, 2001):
        command(float(record.schedule.value(step / 400)) / low * -1.0)
        original.run()
        if step % 400 == 0:
            assert alpha() == pytest.approx(record["alpha_rad"][step // 4], abs=1e-9)
            assert to_si(altitude(), "ft") == pytest.approx(record["altitude_m"][step // 4], abs=1e-6)


# Its surfaces


def test_an_actuator_within_its_limits_is_direct_drive(
    f8ii_free: Airborne, f8ii_direct: Airborne, make_plan: MakePlan
) -> None:
    """In research mode the F-8 II's servo has a rate limit of 60 deg/s and nothing else."""
    slow = make_plan((0.0, -0.05), (0.5, -0.05), (1.5, -0.25), alpha=0.05, duration=4.0, start=START, power=STEADY)
    own, direct = f8ii_free.fly(slow), f8ii_direct.fly(slow)
    assert (own.hold, direct.hold) == (Hold.ACTUATOR, Hold.FOH)
    np.testing.assert_allclose(own["elevator_rad"], direct["elevator_rad"], atol=1e-9)
    np.testing.assert_allclose(own["alpha_rad"], direct["alpha_rad"], rtol=0.0, atol=EULER_RAD)


def test_an_actuator_is_as_fast_as_it_is(f8ii_free: Airborne, make_plan: MakePlan) -> None:
    jump = make_plan((0.0, 0.0), (0.5, 0.0), (0.5, -0.3), alpha=0.0, duration=1.0)
    elevator = f8ii_free.fly(jump)["elevator_rad"]
    assert elevator[50] > -0.01
    assert np.diff(elevator).min() == pytest.approx(-to_si(60.0, "deg_s") * 0.01, rel=1e-6)
    assert elevator[-1] == pytest.approx(-0.3, abs=1e-9)


def test_an_elevator_beyond_the_flight_control_is_refused(
    f8ii: Aircraft, condition: Condition, make_plan: MakePlan
) -> None:
    with Airborne(f8ii, condition, limits()) as normal:  # stops at -19 deg
        with pytest.raises(InputError, match=r"shall go to -19\.\d+ deg, .* brings it to -19…16\.5 deg"):
            normal.fly(make_plan((0.0, 0.0), (1.0, -0.5), alpha=0.0))
        record = normal.fly(make_plan((0.0, 0.0), (1.0, -0.3), alpha=0.0, duration=3.0))
        assert record.outcome is Outcome.COMPLETED
        assert record["elevator_rad"][-1] == pytest.approx(-0.3, abs=1e-6)


def test_a_flight_control_that_feeds_back_flies_too_and_repeats(
    f16: Aircraft, condition: Condition, make_plan: MakePlan
) -> None:
    with Airborne(f16, condition, limits()) as own:
        plan = make_plan(
            (0.0, -0.02), (1.0, -0.02), (1.2, -0.05), alpha=0.03, duration=4.0, power=Throttle(setting=0.6)
        )
        first = own.fly(plan)
        own.fly(make_plan((0.0, -0.1), alpha=0.2, duration=1.0, start=START))
        again = own.fly(plan)
    assert all(values.tobytes() == again[name].tobytes() for name, values in first.columns.items())
    assert np.ptp(first["elevator_rad"]) > 0.01  # it moves on by itself
    assert "flight control" in first.provenance["drive"]


def test_a_flight_control_without_elevator_is_refused(write_mini: Writer, condition: Condition) -> None:
    dead = write_mini({"<input>fcs/elevator-cmd-norm</input>": "<input>fcs/rudder-cmd-norm</input>"})
    with pytest.raises(RefusedError, match="does not bring the elevator to one place"):
        Airborne(dead, condition, limits())


def test_an_unknown_property_is_named(f8ii: Aircraft, condition: Condition) -> None:
    with pytest.raises(AircraftError, match="no property 'fcs/stabilator-mode'"):
        Airborne(f8ii, condition, limits(properties=(("fcs/stabilator-mode", 1.0),)))
    with pytest.raises(InputError, match="finite"):
        limits(properties=(("fcs/stabilator-mode", math.nan),))


# Its motion


def test_a_departure_is_free_to_roll(f8ii_direct: Airborne, make_plan: MakePlan) -> None:
    """Beyond 27 deg the F-8 II has no directional stability: a little sideslip grows."""
    pull = make_plan(
        (0.0, -0.1), (0.5, -0.1), (1.2, -0.6), alpha=0.05, duration=8.0, power=STEADY, alpha_limits_rad=(-3.0, 3.0),
        start=FreeStart(theta_rad=0.05, airspeed_m_s=295.0, altitude_m=13000.0, beta_rad=0.02),
    )  # fmt: skip
    record = f8ii_direct.fly(pull)
    assert np.abs(record["phi_rad"]).max() > 0.5


def test_flights_repeat_bit_for_bit_whatever_was_flown_between(free: Airborne, make_plan: MakePlan) -> None:
    asked = make_plan(
        (0.0, -0.05), (1.0, -0.1), alpha=0.1, q=0.1, duration=3.0, start=START, power=Throttle(setting=0.5)
    )
    first = free.fly(asked)
    free.fly(make_plan((0.0, 0.1), alpha=-0.3, q=-0.5, duration=1.0, loading=Loading(mass_ratio=0.9)))
    free.rates(FlightState(airspeed_m_s=150.0, alpha_rad=0.4, phi_rad=1.0, psi_rad=3.0), 0.2, ENGINES_OFF)
    again = free.fly(asked)
    assert all(values.tobytes() == again[name].tobytes() for name, values in first.columns.items())


def test_it_escapes_where_its_record_ends(f8ii_direct: Airborne, make_plan: MakePlan) -> None:
    plan = make_plan((0.0, 0.34), alpha=0.0, duration=10.0)
    record = f8ii_direct.fly(plan)
    escape = f8ii_direct.escape(
        alpha_rad=0.0, q_rad_s=0.0, schedule=plan.schedule, duration_s=10.0, alpha_limits_rad=plan.alpha_limits_rad
    )
    assert isinstance(escape, Escape)
    assert record.outcome is Outcome.DEPARTED
    assert f"{escape.time_s:.4f} s" in record.note


# Its loading, in every fidelity


OTHERWISE = Loading(mass_ratio=1.1, inertia_ratio=1.2, center_aft_m=0.1, center_up_m=-0.05)


def expected_mass(vehicle: Airborne | Rig) -> dict[str, float]:
    mass = dict(vehicle._mounting.mass)
    mass[WEIGHT] *= OTHERWISE.mass_ratio
    mass[CENTER[0]] += 12.0 * from_si(OTHERWISE.center_aft_m, "ft")
    mass[CENTER[2]] += 12.0 * from_si(OTHERWISE.center_up_m, "ft")
    return mass | {name: mass[name] * OTHERWISE.inertia_ratio for name in INERTIA}


@pytest.mark.parametrize("name", ["f8ii_rig", "f16_rig", "f8ii_symmetric", "f16_symmetric", "f8ii_free", "f16_direct"])
def test_a_loading_is_flown_with_its_tanks_full(name: str, request: pytest.FixtureRequest, make_plan: MakePlan) -> None:
    vehicle: Airborne | Rig = request.getfixturevalue(name)
    nominal = make_plan((0.0, -0.02), alpha=0.05, duration=1.0)
    before = vehicle.fly(nominal)
    record = vehicle.fly(make_plan((0.0, -0.02), alpha=0.05, duration=1.0, loading=OTHERWISE))
    now, expected = vehicle._simulator.read(MASS_PROPERTIES), expected_mass(vehicle)
    scale = max(abs(value) for value in expected.values())
    for what, value in expected.items():
        assert now[what] == pytest.approx(value, rel=1e-11, abs=1e-11 * scale), what
    assert "mass_ratio=1.1" in record.provenance["loading"]
    assert np.abs(record["alpha_rad"] - before["alpha_rad"]).max() > 1e-4
    assert vehicle.fly(nominal)["alpha_rad"].tobytes() == before["alpha_rad"].tobytes()


def test_less_than_its_tanks_hold_is_refused(f8ii_direct: Airborne, make_plan: MakePlan) -> None:
    with pytest.raises(AircraftError, match="tanks alone weigh 9259"):
        f8ii_direct.fly(make_plan((0.0, 0.0), alpha=0.0, loading=Loading(mass_ratio=0.1)))


def test_a_center_of_gravity_aft_trims_the_f8ii_higher(f8ii_rig: Rig, make_plan: MakePlan) -> None:
    """Lift ahead of the center of gravity pitches up: with static margin to spare the angle settles higher."""
    flown = [
        f8ii_rig.fly(make_plan((0.0, -0.1), alpha=0.08, duration=20.0, loading=Loading(center_aft_m=aft)))
        for aft in (0.0, 0.2)
    ]
    assert flown[1]["alpha_rad"][-1] > flown[0]["alpha_rad"][-1] + 0.005
