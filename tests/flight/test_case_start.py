"""Starts of a case: what was asked for is what JSBSim's first row has, however it was said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import jsbsim
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.errors import InputError
from finback.flight.case import Case
from finback.flight.case_drive import named_drive
from finback.flight.case_flight import fly_case
from finback.flight.case_start import case_start
from finback.flight.case_wind import WindProfile
from finback.flight.flow_angles import air_velocity, alpha_of, body_to_local, theta_of
from finback.records import Hold

BRICK = Path(__file__).parent / "data" / "aircraft" / "brick" / "brick.xml"
ROUNDING = 1e-9
"""Of angles and rates in rad and speeds relative to the largest: a dozen operations on numbers of 17 digits."""
PLACE_M = 1e-4
"""JSBSim's heights are differences of numbers of 2e7 ft, each rounded to 4e-9 ft, after a search for the latitude."""

angles = st.floats(-3.1, 3.1)
quarters = st.floats(-1.5, 1.5)


def _first(*start: tuple[str, float], **more: object) -> dict[str, float]:
    flown = fly_case(Case(source=BRICK, start=case_start(start), duration_s=0.01, step_s=0.01, **more))  # type: ignore[arg-type] # fields of Case
    return {name: float(values[0]) for name, values in flown.columns.items()}


def _off(one: float, other: float) -> float:
    return abs(float(np.angle(np.exp(1j * (one - other)))))


@settings(deadline=None, max_examples=30)
@given(st.tuples(angles, quarters, angles), angles, quarters, st.floats(1.0, 900.0), st.floats(-30.0, 30.0))
def test_any_attitude_flow_and_wind(
    attitude: tuple[float, float, float], alpha: float, beta: float, speed: float, wind: float
) -> None:
    """Beyond 90° of alpha, in any bank: JSBSim's own initial conditions alias these, or turn one by another."""
    phi, theta, psi = attitude
    wanted = {"phi": phi, "theta": theta, "psi": psi, "alpha": alpha, "beta": beta}
    row = _first(
        ("wind_east_m_s", wind), *((f"{name}_rad", value) for name, value in wanted.items()), ("airspeed_m_s", speed)
    )
    for name, value in wanted.items():
        assert _off(row[f"{name}_rad"], value) < ROUNDING
    assert row["airspeed_m_s"] == pytest.approx(speed, abs=ROUNDING * (speed + abs(wind)))
    assert row["wind_east_m_s"] == pytest.approx(wind, abs=ROUNDING * (speed + abs(wind)))
    ground = body_to_local(phi, theta, psi) @ air_velocity(speed, alpha, beta) + [0.0, wind, 0.0]
    found = [row[f"velocity_{way}_m_s"] for way in ("north", "east", "down")]
    np.testing.assert_allclose(found, ground, atol=ROUNDING * (speed + abs(wind)))


@given(angles, quarters, quarters, quarters)
def test_an_attitude_climbs_as_it_is_asked(alpha: float, beta: float, phi: float, theta: float) -> None:
    gamma = float(-np.arcsin(np.clip((body_to_local(phi, theta, 0.0) @ air_velocity(1.0, alpha, beta))[2], -1, 1)))
    for pitch, attack in (
        (theta_of(alpha=alpha, beta=beta, phi=phi, gamma=gamma), alpha),
        (theta, alpha_of(beta=beta, phi=phi, theta=theta, gamma=gamma)),
    ):
        down = (body_to_local(phi, pitch, 0.0) @ air_velocity(1.0, attack, beta))[2]
        assert down == pytest.approx(-np.sin(gamma), abs=1e-12)


def test_alpha_alone_flies_level_and_gamma_climbs() -> None:
    fast = (("altitude_m", 3000.0), ("airspeed_m_s", 200.0))
    level = _first(*fast, ("alpha_deg", 7.0), ("phi_deg", 60.0))
    assert level["velocity_down_m_s"] == pytest.approx(0.0, abs=1e-9)
    assert np.degrees(level["alpha_rad"]) == pytest.approx(7.0)
    assert level["beta_rad"] == pytest.approx(0.0, abs=ROUNDING)
    climbing = _first(*fast, ("theta_deg", 12.0), ("gamma_deg", 5.0))
    assert np.degrees(climbing["alpha_rad"]) == pytest.approx(7.0)
    assert climbing["velocity_down_m_s"] == pytest.approx(-200.0 * np.sin(np.radians(5.0)))


def test_what_cannot_all_be_true_is_refused() -> None:
    fast = (("altitude_m", 3000.0), ("airspeed_m_s", 200.0))
    with pytest.raises(InputError, match="gamma is 5 deg, not 8"):
        _first(*fast, ("theta_deg", 12.0), ("alpha_deg", 7.0), ("gamma_deg", 8.0))
    with pytest.raises(InputError, match="no attitude with these angles climbs"):
        _first(*fast, ("phi_deg", 90.0), ("beta_deg", 0.0), ("theta_deg", 20.0), ("gamma_deg", 60.0))
    with pytest.raises(InputError, match="alpha is 0 deg, not 3"):  # of a body at rest
        _first(("alpha_deg", 3.0))


def test_a_mach_number_is_one_at_its_place() -> None:
    row = _first(("altitude_m", 11_000.0), ("mach", 0.8), ("alpha_deg", 4.0))
    assert row["mach_1"] == pytest.approx(0.8, rel=1e-12)
    assert row["airspeed_m_s"] == pytest.approx(
        0.8 * 295.154, rel=2e-5
    )  # U.S. Standard Atmosphere 1976, 11 km geometric


@pytest.mark.parametrize("latitude_deg", [-80.0, 0.0, 45.0, 90.0])
def test_places_by_every_name(latitude_deg: float) -> None:
    """The same point by geodetic and geocentric latitude and by its coordinates."""
    one = _first(("latitude_deg", latitude_deg), ("longitude_deg", -70.0), ("geodetic_altitude_m", 9000.0))
    assert one["geodetic_altitude_m"] == pytest.approx(9000.0, abs=PLACE_M)
    assert np.degrees(one["latitude_rad"]) == pytest.approx(latitude_deg, abs=1e-9)
    coordinates = [(f"ecef_{axis}_m", one[f"ecef_{axis}_m"]) for axis in "xyz"]
    central = ("geocentric_latitude_rad", one["geocentric_latitude_rad"])
    for other in (
        _first(*coordinates),
        _first(central, ("longitude_deg", -70.0), ("altitude_m", one["altitude_m"])),
        _first(central, ("longitude_deg", -70.0), ("geodetic_altitude_m", 9000.0)),
    ):
        for name, value in coordinates:
            assert other[name] == pytest.approx(value, abs=PLACE_M)


def test_velocities_by_every_name() -> None:
    """In body axes, north-east-down and the planet's own axes: one velocity."""
    place = (("latitude_deg", 35.0), ("longitude_deg", 20.0), ("geodetic_altitude_m", 5000.0), ("theta_deg", 25.0))
    place += (("psi_deg", 100.0), ("phi_deg", -50.0))
    one = _first(*place, ("u_m_s", 150.0), ("v_m_s", -20.0), ("w_m_s", 30.0))
    flown = fly_case(
        Case(source=BRICK, start=case_start([*place, ("u_m_s", 150.0), ("v_m_s", -20.0), ("w_m_s", 30.0)]),
             duration_s=0.002, step_s=1e-3)
    ).columns  # fmt: skip
    fixed = [float(np.gradient(flown[f"ecef_{axis}_m"], 1e-3)[1]) for axis in "xyz"]
    local = [(f"velocity_{way}_m_s", one[f"velocity_{way}_m_s"]) for way in ("north", "east", "down")]
    for other in (
        _first(*place, *local),
        _first(*place, *((f"velocity_ecef_{axis}_m_s", value) for axis, value in zip("xyz", fixed, strict=True))),
    ):
        for axis, value in zip("uvw", (150.0, -20.0, 30.0), strict=True):
            assert other[f"{axis}_m_s"] == pytest.approx(
                value, abs=0.02
            )  # fall and Coriolis in 1 ms, Euler's first step


def test_rates_to_the_planet_and_to_inertial_space() -> None:
    place = (("latitude_deg", 35.0), ("psi_deg", 100.0), ("altitude_m", 5000.0))
    row = _first(*place, ("inertial_p_deg_s", 10.0), ("inertial_q_deg_s", 20.0), ("inertial_r_deg_s", 30.0))
    for axis, rate in zip("pqr", (10.0, 20.0, 30.0), strict=True):
        assert np.degrees(row[f"inertial_{axis}_rad_s"]) == pytest.approx(rate, abs=1e-12)
        assert 1e-7 < abs(row[f"{axis}_rad_s"] - np.radians(rate)) < 7.3e-5  # the Earth turns at 7.29e-5 rad/s


def test_a_rate_that_is_not_given_stays_as_it_is() -> None:
    row = _first(("inertial_q_deg_s", 5.0), settings=(("ic/r-rad_sec", 0.3),))
    assert np.degrees(row["inertial_q_rad_s"]) == pytest.approx(5.0, abs=1e-12)
    assert (row["p_rad_s"], row["r_rad_s"]) == pytest.approx((0.0, 0.3), abs=1e-12)


def test_what_a_file_says_stays_where_nothing_else_is_said(tmp_path: Path) -> None:
    file = tmp_path / "start.xml"
    file.write_text(
        '<initialize name="start"><ubody unit="FT/SEC">400</ubody><wbody unit="FT/SEC">20</wbody>'
        '<altitude unit="FT">9000</altitude><psi unit="DEG">70</psi><theta unit="DEG">11</theta></initialize>'
    )
    plain, faster = _first(initial_file=str(file)), _first(("airspeed_m_s", 90.0), initial_file=str(file))
    assert faster["airspeed_m_s"] == pytest.approx(90.0)
    for name in ("altitude_m", "psi_rad", "theta_rad", "alpha_rad"):
        assert faster[name] == pytest.approx(plain[name], abs=1e-6)


def test_a_raw_initial_condition_has_the_last_word() -> None:
    row = _first(("altitude_m", 3000.0), settings=(("ic/h-sl-ft", 1000.0),))
    assert row["altitude_m"] == pytest.approx(304.8)


def test_gamma_goes_with_no_wind_whoever_brings_it() -> None:
    start = case_start([("altitude_ft", 20_000.0), ("airspeed_kt", 400.0), ("gamma_deg", -2.0), ("alpha_deg", 3.0)])
    north = WindProfile(altitude_m=np.zeros(1), north_m_s=np.array([10.0]), east_m_s=np.zeros(1))
    blowing = named_drive("wind_east_m_s", np.zeros(1), np.array([5.0]), Hold.FOH)
    for more in ({"wind": (north,)}, {"drives": (blowing,)}):
        with pytest.raises(InputError, match="a wind with gamma"):
            fly_case(Case(source=BRICK, start=start, duration_s=0.01, step_s=0.01, **more))  # type: ignore[arg-type]
    still = replace(north, north_m_s=np.zeros(1))
    assert fly_case(Case(source=BRICK, start=start, wind=(still,), duration_s=0.01, step_s=0.01)).columns


def test_what_begins_still_or_on_its_gear_is_told() -> None:
    fighter = Path(jsbsim.get_default_root_dir()) / "aircraft" / "f16" / "f16.xml"
    still, high, flying = (
        fly_case(Case(source=fighter, start=case_start(start), duration_s=0.02, step_s=0.01)).warnings
        for start in ([], [("altitude_ft", 9e3), ("airspeed_kt", 0.0)], [("altitude_ft", 9e3), ("airspeed_kt", 300.0)])
    )
    assert [any(said in word for word in still) for said in ("without airspeed", "its gear on or in")] == [True, True]
    for asked in (high, flying):  # no airspeed is what was asked for
        assert not any("airspeed" in word or "gear" in word for word in asked)
