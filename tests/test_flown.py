"""Flights of the harness as the equations of coefficients take them, and tables that lack something."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from finback.errors import InputError
from finback.flight.airborne import Airborne
from finback.flight.aircraft import find_aircraft
from finback.flight.derived_model import EARTH_RADIUS_M
from finback.flight.felt import FELT_ALTITUDE, FELT_DENSITY, FELT_GRAVITY
from finback.flight.flat_earth import FLATTENED, over_flat_earth
from finback.flight.plan import FlightOptions, FlightPlan, told
from finback.flight.power import EnginesOff, FixedThrust, Power, Throttle
from finback.flight.start import SymmetricStart
from finback.formats.text_table import PLAIN
from finback.identification.coefficient.airframe import Airframe
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule
from finback.store.flight_table import check_columns
from finback.store.flown import as_flown

FRAME = Airframe(mass_kg=5000.0, wing_area_m2=25.0, chord_m=2.0, pitch_inertia_kg_m2=2e4)
CONDITION = Condition(airspeed_m_s=200.0, density_kg_m3=0.5, gravity_m_s2=9.80665, altitude_m=3000.0)
TIME_S = 0.02 * np.arange(200)


def record(provenance: Mapping[str, str], **columns: np.ndarray) -> FlightRecord:
    still = np.zeros(TIME_S.size)
    return FlightRecord(
        name="flown",
        columns={"time_s": TIME_S, "alpha_rad": still, "q_rad_s": still, "elevator_rad": still, **columns},
        outcome=Outcome.COMPLETED,
        note="",
        condition=CONDITION,
        schedule=Schedule(time_s=TIME_S, elevator_rad=still),
        hold=Hold.FOH,
        provenance=dict(provenance),
    )


@pytest.mark.parametrize(("fidelity", "gravity"), [("symmetric", 0.0), ("free", 9.7710)])
def test_a_flight_says_the_air_and_the_gravity_that_it_felt(fidelity: str, gravity: float) -> None:
    """On a sphere at rest that of its height, steep or level; over the equator of the Earth less by its turning."""
    options = FlightOptions(
        fidelity=fidelity, alpha_limits_rad=(-0.5, 0.8), elevator_limits_rad=(-0.4, 0.4), elevator_rate_rad_s=1.0
    )
    here = gravity or 9.80665 * (EARTH_RADIUS_M / (EARTH_RADIUS_M + 3000.0)) ** 2
    with Airborne(
        find_aircraft("f8ii", near=Path(__file__).resolve().parents[1] / "aircraft"), CONDITION, options
    ) as it:
        for theta, power in ((0.1, EnginesOff()), (0.8, FixedThrust(thrust_n=2e4))):
            facts = it.fly(_plan(theta, power)).provenance
            assert float(facts[FELT_GRAVITY]) == pytest.approx(here, abs=1e-4 if gravity else 1e-8)
            # ICAO Doc 7488, at 3000 m; geometric altitude
            assert float(facts[FELT_DENSITY]) == pytest.approx(0.90925, rel=1e-4)
            assert float(facts[FELT_ALTITUDE]) == pytest.approx(3000.0, abs=1e-3)
        assert FELT_GRAVITY not in it.fly(_plan(1.55, EnginesOff())).provenance


def _plan(theta_rad: float, power: Power) -> FlightPlan:
    return FlightPlan(
        name="flown",
        kind="test",
        alpha_rad=0.1,
        q_rad_s=0.2,
        schedule=Schedule(time_s=np.array([0.0, 1.0]), elevator_rad=np.array([-0.05, -0.05])),
        hold=Hold.FOH,
        duration_s=0.1,
        sample_interval_s=0.02,
        alpha_limits_rad=(-0.5, 0.8),
        start=SymmetricStart(airspeed_m_s=200.0, theta_rad=theta_rad, altitude_m=3000.0),
        power=power,
    )


def test_its_condition_is_what_it_felt() -> None:
    found = as_flown(record({FELT_GRAVITY: "9.77", FELT_DENSITY: "0.9", FELT_ALTITUDE: "2999.5"}), FRAME).condition
    assert (found.gravity_m_s2, found.density_kg_m3, found.altitude_m) == (9.77, 0.9, 2999.5)
    assert found.airspeed_m_s == CONDITION.airspeed_m_s
    assert as_flown(record({"made_of": "a table"}), FRAME).condition == CONDITION


def test_the_horizon_turns_below_a_flight() -> None:
    """Level on a circle around the Earth is level over a flat one: q makes up for it, and gravity is less by V² / r."""
    speed, alpha = np.full(TIME_S.size, 300.0), np.full(TIME_S.size, 0.1)
    turning = 300.0 / EARTH_RADIUS_M
    facts = {FELT_GRAVITY: "9.77"}
    level = record(facts, theta_rad=alpha, alpha_rad=alpha, airspeed_m_s=speed, q_rad_s=np.full(TIME_S.size, -turning))
    found = as_flown(level, FRAME)
    assert np.abs(found["q_rad_s"]).max() < 1e-18
    assert found.condition.gravity_m_s2 == pytest.approx(9.77 - 300.0 * turning, rel=1e-15)
    assert found.provenance[FLATTENED] == (
        "the condition has gravity_m_s2 as felt; "
        "the horizon's turning, at most 0.0027 deg/s, in q_rad_s, and 0.014 m/s² less gravity"
    )
    assert over_flat_earth(found) is found


def test_a_fixed_thrust_is_a_column_and_one_that_is_stated_stays() -> None:
    flown = record(_told(FixedThrust(thrust_n=np.float64(2.5e4))))
    assert as_flown(flown, FRAME)["thrust_n"].tolist() == [2.5e4] * TIME_S.size
    stated = Airframe(mass_kg=1.0, wing_area_m2=1.0, chord_m=1.0, pitch_inertia_kg_m2=1.0, thrust_n=3.0)
    assert "thrust_n" not in as_flown(flown, stated).columns
    assert "thrust_n" not in as_flown(record({"fidelity": "free"}), FRAME).columns
    assert "thrust_n" not in as_flown(record(_told(EnginesOff())), FRAME).columns
    for unknown in (_told(Throttle(setting=0.5)), {"power": "FixedThrust(thrust_n=40000.0, angle_rad=0.0)"}):
        with pytest.raises(InputError, match="nothing says what thrust that was") as refused:
            as_flown(record(unknown), FRAME)
        assert "write thrust_n into [airframe]" in refused.value.hint
        assert "thrust_n" not in as_flown(record(unknown), stated).columns


def _told(power: Power) -> dict[str, str]:
    """Return what the provenance of a flight says of its plan."""
    return {"fidelity": "free", **told(_plan(0.1, power))}


def test_flights_of_the_rig_are_refused() -> None:
    with pytest.raises(InputError, match="flown on the rig") as told:
        as_flown(record({"fidelity": "rig"}), FRAME)
    assert "'symmetric' or 'free'" in told.value.hint


def test_a_loop_is_no_bank() -> None:
    """Euler angles fold the pitch angle at the vertical and turn roll by half a turn; a real bank stays one."""
    theta = np.linspace(0.2, 2.6, TIME_S.size)
    over = theta > np.pi / 2
    folded = np.where(over, np.pi - theta, theta)
    found = as_flown(record({}, theta_rad=folded, phi_rad=np.where(over, np.pi - 1e-3, 1e-3)), FRAME)
    np.testing.assert_allclose(found["theta_rad"], theta, atol=1e-12)
    assert np.abs(found["phi_rad"]).max() < 2e-3
    banked = record({}, theta_rad=folded, phi_rad=np.linspace(0.0, np.pi, TIME_S.size))
    np.testing.assert_array_equal(as_flown(banked, FRAME)["theta_rad"], folded)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (
            {"t": "time_s", "thrust": "thrust_lbf"},
            ("no column 'thrust'", "nothing gives alpha_rad", "the table has t, "),
        ),
        ({"t": "time"}, ("'time' names no unit", '"its name" = "time_s"', "[records.columns] of setup.toml")),
        ({}, ("column 'alpha' names no unit, such as alpha_rad", "nothing gives time_s")),
    ],
)
def test_a_table_that_lacks_something_is_told_what_to_write(
    tmp_path: Path, columns: dict[str, str], words: tuple[str, ...]
) -> None:
    (tmp_path / "flight.csv").write_text("t,alpha,q_deg_s,note\n0.0,1.0,2.0,3.0\n", encoding="utf-8")
    with pytest.raises(InputError) as told:
        check_columns(
            tmp_path / "flight.csv",
            PLAIN,
            columns,
            needed=("time_s", "alpha_rad"),
            place="[records.columns] of setup.toml",
        )
    for word in words:
        assert word in str(told.value), word


def test_a_table_that_has_it_all_is_silent(tmp_path: Path) -> None:
    (tmp_path / "flight.csv").write_text("time_s,alpha_deg,note\n0.0,1.0,2.0\n", encoding="utf-8")
    check_columns(tmp_path / "flight.csv", PLAIN, {}, needed=("time_s", "alpha_rad"), place="here")
