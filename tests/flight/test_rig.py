"""The rig: the same aircraft, only alpha and q moving, exactly and repeatably."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.errors import AircraftError, InputError, RefusedError
from finback.flight.aircraft import Aircraft
from finback.flight.derivation import MASS_PROPERTIES
from finback.flight.ending import RATE_LIMIT_RAD_S
from finback.flight.equilibrium import trim
from finback.flight.excitation import Step, ThreeTwoOneOne, schedule
from finback.flight.mounting import try_mounting
from finback.flight.plan import FlightPlan
from finback.flight.rig import Rig
from finback.flight.simulator import Simulator
from finback.records import Condition, Hold, Outcome, Schedule
from finback.units import from_si, to_si

Writer = Callable[..., Aircraft]

SAME_FORCES = 1e-12  # relative: the same tables, read at the same state
SMOOTH_RAD = 1e-5  # design: alpha of smooth flights over 10 s at the default step
TABULATED_RAD = 2e-5  # the same through 28 deg of table corners
JUMP_RAD = to_si(1e-3, "deg")  # after a jump of the elevator; written naively it is twenty times as much
AIRSPEED_M_S = 1e-4  # design: drift over 20 s, through stall
LOGGED = 1e-8  # rad/s, rad/s²: derivatives against logged accelerations; airspeed drifts by 1e-9 of itself
ROUNDING = 1e-14  # relative
STARTED = 1e-12  # rad, rad/s: a start that has a past is met by iteration

ALPHA_LIMITS = (-0.56, 0.79)
WIND_AXES = ("forces/fwx-aero-lbs", "forces/fwz-aero-lbs")


def plan(flown: Schedule, *, alpha: float, q: float = 0.0, duration: float = 10.0, **changes: object) -> FlightPlan:
    given = {"sample_interval_s": 0.01, "alpha_limits_rad": ALPHA_LIMITS, "hold": Hold.FOH, "name": "test-01"}
    return FlightPlan(
        kind="test", alpha_rad=alpha, q_rad_s=q, schedule=flown, duration_s=duration, **{**given, **changes}
    )  # type: ignore[arg-type]


def held(elevator: float) -> Schedule:
    return Schedule(time_s=[0.0], elevator_rad=[elevator])


def reference(rig: Rig, flown: Schedule, start: tuple[float, float], time: FloatArray) -> FloatArray:
    """Integrate the rig's own right-hand side by DOP853, line by line of the schedule; shape (n, 2)."""
    corners = np.unique([0.0, *flown.time_s[(flown.time_s > 0) & (flown.time_s < time[-1])], time[-1]])
    result, state = np.empty((time.size, 2)), np.array(start)
    for begin, end in pairwise(corners):
        line = np.array([begin, end]), flown.value([begin, np.nextafter(end, begin)])

        def field(t: float, x: FloatArray, line: tuple[FloatArray, FloatArray] = line) -> tuple[float, float]:
            return rig.derivatives(x[0], x[1], float(np.interp(t, *line)))

        solved = solve_ivp(
            field, (begin, end), state, method="DOP853", rtol=1e-11, atol=1e-12, max_step=0.1, dense_output=True
        )
        inside = (time >= begin) & (time <= end)
        result[inside] = solved.sol(time[inside]).T
        state = solved.y[:, -1]
    return result


# The same aircraft


def loaded_original(aircraft: Aircraft, condition: Condition) -> Simulator:
    original = Simulator(aircraft.path, step_s=1 / 400, freeze_position=True)
    original.override_density(from_si(condition.density_kg_m3, "slug_ft3"))
    original.write({"ic/h-sl-ft": from_si(condition.altitude_m, "ft")})
    return original


def test_mass_center_and_inertia_are_the_loaded_originals(rig: Rig, condition: Condition) -> None:
    original = loaded_original(rig.aircraft, condition)
    original.write({"ic/u-fps": 900.0})
    original.start()
    whole, copy = original.read(MASS_PROPERTIES), rig._simulator.read(MASS_PROPERTIES)
    for name in MASS_PROPERTIES:
        assert copy[name] == pytest.approx(whole[name], rel=1e-12, abs=1e-9), name


@pytest.mark.parametrize(
    ("name", "compared", "moved"),
    [
        # The moment due to alpha_dot apart: it includes gravity in the original, the rig's force in the copy.
        ("f8ii", ("aero/force/lift-lbs", "aero/force/drag-lbs", "aero/moment/pitch-lbsft", *WIND_AXES), ()),
        ("f16", (*WIND_AXES, "moments/m-aero-lbsft"), ("fcs/lef-pos-rad", "gear/gear-pos-norm")),
    ],
)
def test_the_copys_aerodynamics_are_the_originals(
    name: str, compared: tuple[str, ...], moved: tuple[str, ...], request: pytest.FixtureRequest, condition: Condition
) -> None:
    rig: Rig = request.getfixturevalue(f"{name}_rig")
    rig.derivatives(0.0, 0.0, 0.0)  # as loaded, whatever was flown before
    original, copy = loaded_original(rig.aircraft, condition), rig._simulator
    held_in_flight = copy.read(moved)
    airspeed = from_si(condition.airspeed_m_s, "ft_s")
    random = np.random.default_rng(5)
    for alpha, q, command in random.uniform((-0.5, -1.0, -1.0), (0.75, 1.0, 1.0), (60, 3)):
        original.write({"fcs/elevator-cmd-norm": command, "ic/theta-rad": 0.0})
        original.write(
            {"ic/u-fps": airspeed * math.cos(alpha), "ic/w-fps": airspeed * math.sin(alpha), "ic/q-rad_sec": q}
        )
        original.start()
        state = original.read(("fcs/elevator-pos-rad", "velocities/q-aero-rad_sec", "aero/alpha-rad"))
        copy.write(original.read(moved))  # the original's flight control moves flaps and gear, the copy holds them
        rig.derivatives(state["aero/alpha-rad"], state["velocities/q-aero-rad_sec"], state["fcs/elevator-pos-rad"])
        whole, derived = original.read(compared), copy.read(compared)
        for what in compared:
            assert derived[what] == pytest.approx(whole[what], rel=1e-9, abs=1e-6), what
    copy.write(held_in_flight)


def test_what_was_replaced_and_held_is_told(f16_rig: Rig, f8ii_rig: Rig) -> None:
    assert "flight_control" in f16_rig.provenance["replaced"]
    assert "axis YAW" in f16_rig.provenance["replaced"]
    assert "fcs/lef-pos-rad = -0.0349" in f16_rig.provenance["held"]
    assert f8ii_rig.provenance["frame_late"] == "nothing"
    assert f8ii_rig.provenance["aircraft_sha256"] == f8ii_rig.aircraft.sha256


# Its equations


def test_alpha_dot_is_q_less_lift_plus_gravity_and_q_dot_is_moment_over_inertia(rig: Rig, condition: Condition) -> None:
    read = ("inertia/mass-slugs", "inertia/iyy-slugs_ft2", "forces/fwz-aero-lbs", "moments/m-aero-lbsft")
    airspeed = from_si(condition.airspeed_m_s, "ft_s")
    random = np.random.default_rng(6)
    for alpha, q, elevator in random.uniform((-0.5, -1.0, -0.6), (0.75, 1.0, 0.3), (300, 3)):
        alpha_dot, q_dot = rig.derivatives(alpha, q, elevator)
        mass, inertia, lift, moment = rig._simulator.read(read).values()
        expected = q - lift / (mass * airspeed) + condition.gravity_m_s2 / condition.airspeed_m_s
        assert alpha_dot == pytest.approx(expected, rel=ROUNDING, abs=ROUNDING)
        assert q_dot == pytest.approx(moment / inertia, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("alpha", [-3.1, -2.0, -1.6, 1.6, 2.5, 3.1])
def test_alpha_may_be_any_angle(f8ii_rig: Rig, alpha: float) -> None:
    """JSBSim's own initial alpha turns 95 deg into -85 deg without a word."""
    f8ii_rig.derivatives(alpha, 0.1, 0.0)
    assert f8ii_rig._simulator.read(("aero/alpha-rad",))["aero/alpha-rad"] == pytest.approx(alpha, rel=ROUNDING)
    record = f8ii_rig.fly(plan(held(0.0), alpha=alpha, duration=0.05, alpha_limits_rad=(-3.14, 3.14)))
    assert record["alpha_rad"][0] == pytest.approx(alpha, rel=ROUNDING)
    assert record["theta_rad"][0] % math.tau == pytest.approx(alpha % math.tau, abs=1e-9)


LATE = "aero/alphadot-rad_sec"
LATE_TABLE = f"<table><independentVar lookup='row'>{LATE}</independentVar><tableData>\n-9 -9\n9 9\n</tableData></table>"


@pytest.mark.parametrize(
    "reader",
    [
        f"<property>{LATE}</property>",
        f"<p>{LATE}</p>",
        f"<difference><p>-{LATE}</p><property>-{LATE}</property><property>{LATE}</property></difference>",
        f"<product><value>{math.pi / 180!r}</value><p>aero/alphadot-deg_sec</p></product>",
        LATE_TABLE,
    ],
    ids=["property", "p", "signs", "degrees", "table"],
)
def test_jsbsims_late_alpha_dot_is_replaced_by_its_algebraic_form(
    reader: str, write_mini: Writer, condition: Condition
) -> None:
    damping = f"<product><property>aero/ci2vel</property><value>-3</value>{reader}</product>"
    sign = -1.0 if "difference" in reader else 1.0
    flown = plan(held(-0.1), alpha=0.3, q=0.4, duration=1.0)
    with Rig(write_mini(), condition, step_s=1 / 400) as without:
        plain = without.derivatives(0.3, 0.4, -0.1)
    with Rig(write_mini({"<!--pitch-->": damping}), condition, step_s=1 / 400) as rig:
        assert "algebraic" in rig.provenance["replaced"]
        assert rig.provenance["frame_late"] == "nothing"
        alpha_dot, q_dot = rig.derivatives(0.3, 0.4, -0.1)
        read = ("aero/qbar-psf", "metrics/Sw-sqft", "metrics/cbarw-ft", "aero/ci2vel", "inertia/iyy-slugs_ft2")
        pressure, area, chord, half_time, inertia = rig._simulator.read(read).values()
        record = rig.fly(flown)
        states = zip(record["alpha_rad"], record["q_rad_s"], record["elevator_rad"], strict=True)
        derivatives = np.array([rig.derivatives(*state) for state in states])
    assert alpha_dot == plain[0]
    added = sign * pressure * area * chord * half_time * -3.0 * alpha_dot / inertia
    assert q_dot - plain[1] == pytest.approx(added, rel=1e-11)
    np.testing.assert_allclose(record["q_dot_rad_s2"], derivatives[:, 1], atol=LOGGED)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        # A function of no axis is evaluated before the forces: there nothing can be made of this frame's lift.
        (
            {
                "<!--aerodynamics-->": f"<function name='aero/late'><p>{LATE}</p></function>",
                "<!--pitch-->": "<product><property>aero/ci2vel</property><value>-3</value><p>aero/late</p></product>",
            },
            LATE,
        ),
        ({"<!--pitch-->": "<product><value>0.01</value><p>aero/cl-squared</p></product>"}, "aero/cl-squared"),
        (
            {"<!--aerodynamics-->": "<function name='aero/wing'><p>aero/alpha-wing-rad</p></function>"},
            "aero/alpha-wing-rad",
        ),
    ],
    ids=["alpha_dot", "lift squared", "alpha of the wing"],
)
def test_what_stays_a_frame_late_is_told(
    changes: dict[str, str], words: str, write_mini: Writer, condition: Condition
) -> None:
    with Rig(write_mini(changes), condition, step_s=1 / 400) as rig:
        assert rig.provenance["frame_late"] == words
        assert "algebraic" not in rig.provenance["replaced"]


def test_logged_accelerations_are_the_derivatives_of_the_logged_states(rig: Rig) -> None:
    found = trim(rig.derivatives, elevator_rad=-0.1, alpha_limits_rad=(-0.17, 0.7))
    flown = Schedule(time_s=[0.0, 0.5, 0.6], elevator_rad=[-0.1, -0.1, -0.15])
    record = rig.fly(plan(flown, alpha=found.alpha_rad, q=found.q_rad_s, duration=4.0))
    states = zip(record["alpha_rad"], record["q_rad_s"], record["elevator_rad"], strict=True)
    derivatives = np.array([rig.derivatives(*state) for state in states])
    np.testing.assert_allclose(record["alpha_dot_rad_s"], derivatives[:, 0], atol=LOGGED)
    np.testing.assert_allclose(record["q_dot_rad_s2"], derivatives[:, 1], atol=LOGGED)
    # and alpha_dot is the slope of alpha: central differences of smooth rows, 0.01 s apart
    slope = (record["alpha_rad"][2:] - record["alpha_rad"][:-2]) / 0.02
    np.testing.assert_allclose(record["alpha_dot_rad_s"][1:-1], slope, atol=5e-4)


def test_a_flight_from_trim_does_not_move(rig: Rig) -> None:
    """A start in one pass left the integrators a first derivative of 0.5 ft/s² from before the reset."""
    found = trim(rig.derivatives, elevator_rad=-0.1, alpha_limits_rad=(-0.17, 0.7))
    rig.derivatives(0.5, 1.0, 0.2)
    record = rig.fly(plan(held(-0.1), alpha=found.alpha_rad, q=found.q_rad_s, duration=1.0))
    assert np.ptp(record["alpha_rad"]) < 1e-9
    assert np.ptp(record["q_rad_s"]) < 1e-9


def test_a_smooth_flight_is_dop853s(rig: Rig) -> None:
    found = trim(rig.derivatives, elevator_rad=-0.09, alpha_limits_rad=(-0.17, 0.7))
    maneuver = ThreeTwoOneOne(elevator_rad=-0.09, amplitude_rad=0.05, unit_s=0.5, lead_s=0.5, duration_s=10.0)
    flown = schedule(maneuver, rate_limit_rad_s=1.0, limits_rad=(-0.7, 0.35), grid_s=0.01)
    record = rig.fly(plan(flown, alpha=found.alpha_rad, q=found.q_rad_s))
    assert record.outcome is Outcome.COMPLETED
    exact = reference(rig, flown, (found.alpha_rad, found.q_rad_s), record["time_s"])
    assert np.abs(record["alpha_rad"] - exact[:, 0]).max() <= SMOOTH_RAD


def test_a_step_through_stall_is_dop853s_and_keeps_its_airspeed(f8ii_rig: Rig, condition: Condition) -> None:
    found = trim(f8ii_rig.derivatives, elevator_rad=-0.09, alpha_limits_rad=ALPHA_LIMITS)
    maneuver = Step(elevator_rad=-0.09, amplitude_rad=-0.43, lead_s=0.5, duration_s=20.0)
    flown = schedule(maneuver, rate_limit_rad_s=1.0, limits_rad=(-0.7, 0.35), grid_s=0.01)
    record = f8ii_rig.fly(plan(flown, alpha=found.alpha_rad, q=found.q_rad_s, duration=20.0))
    assert record["alpha_rad"].max() > 0.45
    assert np.abs(record["airspeed_m_s"] - condition.airspeed_m_s).max() <= AIRSPEED_M_S
    ten = record["time_s"] <= 10.0
    exact = reference(f8ii_rig, flown, (found.alpha_rad, found.q_rad_s), record["time_s"][ten])
    assert np.abs(record["alpha_rad"][ten] - exact[:, 0]).max() <= TABULATED_RAD


@pytest.mark.parametrize(("alpha", "q"), [(-0.26, 1.0), (0.35, 0.0)])
def test_a_release_is_dop853s(f8ii_rig: Rig, alpha: float, q: float) -> None:
    record = f8ii_rig.fly(plan(held(0.0), alpha=alpha, q=q, duration=3.0))
    assert record.outcome is Outcome.COMPLETED
    exact = reference(f8ii_rig, held(0.0), (alpha, q), record["time_s"])
    assert np.abs(record["alpha_rad"] - exact[:, 0]).max() <= TABULATED_RAD


def test_airspeed_is_held_through_a_violent_release(rig: Rig, condition: Condition) -> None:
    record = rig.fly(plan(held(-0.3), alpha=0.6, q=-1.0, duration=20.0, alpha_limits_rad=(-3.0, 3.0)))
    assert record.outcome is Outcome.COMPLETED
    assert np.abs(record["airspeed_m_s"] - condition.airspeed_m_s).max() <= AIRSPEED_M_S


def test_a_jump_of_the_elevator_acts_when_it_happens(rig: Rig) -> None:
    found = trim(rig.derivatives, elevator_rad=-0.09, alpha_limits_rad=(-0.17, 0.7))
    flown = Schedule(time_s=[0.0, 0.57, 0.57, 1.53, 1.53], elevator_rad=[-0.09, -0.09, -0.18, -0.18, -0.09])
    record = rig.fly(plan(flown, alpha=found.alpha_rad, q=found.q_rad_s, duration=3.0, hold=Hold.ZOH))
    exact = reference(rig, flown, (found.alpha_rad, found.q_rad_s), record["time_s"])
    assert np.abs(record["alpha_rad"] - exact[:, 0]).max() <= JUMP_RAD
    jump = np.flatnonzero(np.diff(record["elevator_rad"]))
    np.testing.assert_allclose(record["time_s"][jump + 1], [0.57, 1.53])


def test_pitch_angle_is_the_integral_of_q_also_through_the_vertical(f8ii_rig: Rig) -> None:
    record = f8ii_rig.fly(plan(held(-0.52), alpha=0.3, duration=30.0))
    q, theta = record["q_rad_s"], record["theta_rad"]
    assert theta[0] == pytest.approx(0.3, abs=1e-12)
    assert theta.max() > 2.0
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (q[1:] + q[:-1]) * 0.01)])
    np.testing.assert_allclose(theta - theta[0], turned, atol=1e-3)


# Its records and outcomes


def test_rows_are_samples_and_time_is_counted(f8ii_rig: Rig) -> None:
    record = f8ii_rig.fly(plan(held(0.0), alpha=0.0, duration=1.0))
    assert len(record) == 101
    np.testing.assert_array_equal(record["time_s"], np.arange(101) * (4 * (1 / 400)))
    assert (record["alpha_rad"][0], record["q_rad_s"][0]) == pytest.approx((0.0, 0.0), abs=STARTED)
    assert record.provenance["kind"] == "test"
    assert set(record.columns) >= {"theta_rad", "airspeed_m_s", "altitude_m", "alpha_dot_rad_s", "q_dot_rad_s2"}
    assert np.ptp(record["altitude_m"]) == 0.0


def test_a_departure_ends_the_record_inside_the_limits_and_is_told_with_numbers(f8ii_rig: Rig) -> None:
    record = f8ii_rig.fly(plan(held(0.35), alpha=0.0, duration=10.0))
    assert record.outcome is Outcome.DEPARTED
    assert record["alpha_rad"].min() > ALPHA_LIMITS[0]
    assert "alpha left" in record.note
    assert " deg at " in record.note
    escape = f8ii_rig.escape(
        alpha_rad=0.0, q_rad_s=0.0, schedule=held(0.35), duration_s=10.0, alpha_limits_rad=ALPHA_LIMITS
    )
    assert escape.outcome is Outcome.DEPARTED
    assert escape.alpha_rad <= ALPHA_LIMITS[0]
    assert record["time_s"][-1] < escape.time_s <= record["time_s"][-1] + 0.01 + 1e-12
    assert f"{escape.time_s:.4f} s" in record.note


def test_a_flight_that_does_not_escape_ends_where_its_record_ends(f8ii_rig: Rig) -> None:
    record = f8ii_rig.fly(plan(held(-0.1), alpha=0.2, duration=5.0))
    escape = f8ii_rig.escape(
        alpha_rad=0.2, q_rad_s=0.0, schedule=held(-0.1), duration_s=5.0, alpha_limits_rad=ALPHA_LIMITS
    )
    assert (escape.outcome, record.outcome) == (Outcome.COMPLETED, Outcome.COMPLETED)
    assert escape.time_s == pytest.approx(5.0)
    assert escape.alpha_rad == record["alpha_rad"][-1]


def test_too_fast_a_rotation_and_a_state_that_is_not_finite_have_diverged(f8ii_rig: Rig) -> None:
    fast = f8ii_rig.fly(plan(held(0.0), alpha=0.0, q=RATE_LIMIT_RAD_S + 1, duration=1.0))
    assert fast.outcome is Outcome.DIVERGED
    assert "deg/s" in fast.note
    broken = f8ii_rig.fly(
        plan(Schedule(time_s=[0.0, 0.5, 0.5], elevator_rad=[0.0, 0.0, 1e305]), alpha=0.0, duration=2.0)
    )
    assert broken.outcome is Outcome.DIVERGED
    assert all(np.isfinite(values).all() for values in broken.columns.values())
    after = f8ii_rig.fly(plan(held(0.0), alpha=0.0, duration=1.0))
    assert after.outcome is Outcome.COMPLETED, "the rig recovers"


def test_flights_and_derivatives_repeat_bit_for_bit_whatever_was_flown_between(rig: Rig, condition: Condition) -> None:
    flown = Schedule(time_s=[0.0, 0.5, 0.6], elevator_rad=[-0.1, -0.1, -0.2])
    asked = plan(flown, alpha=0.05, q=0.1, duration=5.0)
    first, derivatives = rig.fly(asked), rig.derivatives(0.1, 0.2, -0.1)
    rig.fly(plan(held(0.2), alpha=-0.1, q=-0.5, duration=3.0))
    rig.derivatives(0.7, -2.0, 0.3)
    with Rig(rig.aircraft, condition, step_s=1 / 400) as other:
        for again in (rig.fly(asked), rig.fly(asked), other.fly(asked)):
            for name, values in first.columns.items():
                assert values.tobytes() == again[name].tobytes(), name
        assert rig.derivatives(0.1, 0.2, -0.1) == derivatives == other.derivatives(0.1, 0.2, -0.1)


# What it refuses


@pytest.mark.parametrize("state", [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), (0.0, 0.0, math.nan)])
def test_numbers_that_are_not_finite_are_refused(f8ii_rig: Rig, state: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match="not a state"):
        f8ii_rig.derivatives(*state)
    with pytest.raises(InputError):
        f8ii_rig.escape(
            alpha_rad=state[0],
            q_rad_s=state[1],
            schedule=held(state[2]),
            duration_s=1.0,
            alpha_limits_rad=ALPHA_LIMITS,
        )


def test_jumps_and_samples_off_the_step_are_refused(f8ii_rig: Rig) -> None:
    jump = Schedule(time_s=[0.0, 0.501, 0.501], elevator_rad=[0.0, 0.0, 0.1])
    with pytest.raises(InputError, match="jumps"):
        f8ii_rig.fly(plan(jump, alpha=0.0, duration=1.0))
    with pytest.raises(InputError, match="sample interval"):
        f8ii_rig.fly(plan(held(0.0), alpha=0.0, duration=1.0, sample_interval_s=0.011))


def test_a_step_too_long_for_the_motion_is_refused(f8ii: Aircraft, condition: Condition) -> None:
    asked = plan(held(-0.1), alpha=0.4, q=-1.5, duration=10.0, sample_interval_s=0.1, alpha_limits_rad=(-3.0, 3.0))
    with Rig(f8ii, condition, step_s=1 / 10) as coarse, pytest.raises(RefusedError, match="shorter step"):
        coarse.fly(asked)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"fcs/elevator-pos-rad</property></product>": "fcs/rudder-pos-rad</property></product>"}, "do not read"),
        ({"<!--pitch-->": "<property>aero/side</property>"}, "lateral axis"),
        ({"<!--aerodynamics-->": "<hysteresis_limits><min>0</min><max>1</max></hysteresis_limits>"}, "forgets"),
        ({"<aerodynamics>": "<aero>", "</aerodynamics>": "</aero>"}, "no aerodynamics"),
        ({">96800<": ">-500000<"}, "pitch moment of inertia is -.* must be positive"),
        ({">21482<": ">0<"}, "empty weight is 0 lbs, it must be positive"),
    ],
)
def test_aircraft_that_the_rig_cannot_fly_are_refused_with_the_reason(
    changes: dict[str, str], words: str, write_mini: Writer, condition: Condition
) -> None:
    aircraft = write_mini(changes)
    with pytest.raises(AircraftError, match=words) as refused:
        Rig(aircraft, condition, step_s=1 / 400)
    assert try_mounting(aircraft, condition) == (str(refused.value),)


def test_an_aircraft_that_can_be_mounted_has_no_fault(write_mini: Writer, condition: Condition) -> None:
    assert try_mounting(write_mini(), condition) == ()


@pytest.mark.parametrize(
    ("name", "value"), [("airspeed_m_s", 0.0), ("density_kg_m3", math.nan), ("gravity_m_s2", -1.0)]
)
def test_an_impossible_condition_is_refused(name: str, value: float, f8ii: Aircraft, condition: Condition) -> None:
    given = {field: getattr(condition, field) for field in Condition.__dataclass_fields__} | {name: value}
    with pytest.raises(InputError, match=name):
        Rig(f8ii, Condition(**given), step_s=1 / 400)


def test_the_copy_is_removed_at_exit(write_mini: Writer, condition: Condition) -> None:
    with Rig(write_mini(), condition, step_s=1 / 400) as rig:
        folder: Path = rig.model.parent
        assert "rig/normal-force-lbs" in rig.model.read_text(encoding="utf-8")
    assert not folder.exists()


def test_an_aircraft_may_declare_the_rigs_force_or_not(write_mini: Writer, condition: Condition) -> None:
    declared = write_mini({"<!--aerodynamics-->": '<property value="0">rig/normal-force-lbs</property>'}, "declared")
    with Rig(declared, condition, step_s=1 / 400) as one, Rig(write_mini(), condition, step_s=1 / 400) as other:
        assert one.derivatives(0.2, 0.1, -0.1) == other.derivatives(0.2, 0.1, -0.1)


def test_constants_of_the_dropped_flight_control_keep_their_value(write_mini: Writer, condition: Condition) -> None:
    with Rig(write_mini(), condition, step_s=1 / 400) as rig:
        assert rig.provenance["held"] == "fcs/flaperon-rad = 0.125"
        assert rig._simulator.read(["fcs/flaperon-rad"]) == {"fcs/flaperon-rad": 0.125}


def test_an_asymmetric_loading_is_moved_into_the_plane_and_told(write_mini: Writer, condition: Condition) -> None:
    with Rig(write_mini({"<x>-120</x><y>0</y>": "<x>-120</x><y>-14</y>"}), condition, step_s=1 / 400) as rig:
        assert "inertia/cg-y-in" in rig.provenance["replaced"]
        assert "inertia/ixy-slugs_ft2" in rig.provenance["replaced"]
        rig.derivatives(0.2, 0.1, -0.1)
        read = ("accelerations/vdot-ft_sec2", "accelerations/pdot-rad_sec2", "accelerations/rdot-rad_sec2")
        assert max(abs(value) for value in rig._simulator.read(read).values()) < 1e-12


def test_aerodynamics_may_lie_in_a_file_of_their_own(write_mini: Writer, condition: Condition) -> None:
    whole = write_mini()
    text = whole.path.read_text(encoding="utf-8")
    before, rest = text.split("<aerodynamics>")
    inner, after = rest.split("</aerodynamics>")
    apart = write_mini({}, "apart")
    apart.path.write_text(f'{before}<aerodynamics file="aero.xml"/>{after}', encoding="utf-8")
    (apart.path.parent / "aero.xml").write_text(f"<aerodynamics>{inner}</aerodynamics>", encoding="utf-8")
    with Rig(whole, condition, step_s=1 / 400) as one, Rig(apart, condition, step_s=1 / 400) as other:
        assert one.derivatives(0.2, 0.1, -0.1) == other.derivatives(0.2, 0.1, -0.1)


@pytest.mark.parametrize(("rate_hz", "words"), [(50, "; its airspeed drifted by {} m/s, a shorter step"), (400, "")])
def test_an_airspeed_that_is_not_held_is_told(rate_hz: int, words: str, f8ii: Aircraft, condition: Condition) -> None:
    with Rig(f8ii, condition, step_s=1 / rate_hz) as rig:
        violent = plan(held(-0.05), alpha=0.6, q=1.0, duration=4.0, sample_interval_s=0.02)
        record = rig.fly(replace(violent, alpha_limits_rad=(-3.0, 3.0)))
    drift = np.abs(record["airspeed_m_s"] - condition.airspeed_m_s).max()
    assert (drift > 1e-4) == bool(words)
    assert record.note.startswith("flew its 4 s" + words.format(f"{drift:.1e}"))
    assert ("airspeed" in record.note) == bool(words)
