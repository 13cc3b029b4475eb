"""Flights by DOP853 on the suspended simulator's own right-hand side, in every fidelity, and where that cannot be."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.errors import AircraftError
from finback.flight.air import DrydenAir
from finback.flight.airborne import Airborne
from finback.flight.aircraft import Aircraft
from finback.flight.loading import Loading
from finback.flight.motion import Incomplete, Motion
from finback.flight.plan import Drive, FlightOptions, FlightPlan
from finback.flight.planet import planet_of
from finback.flight.power import FixedThrust, Throttle
from finback.flight.reference import NoReference, Reference, reference
from finback.flight.rig import Rig
from finback.flight.start import FreeStart, SymmetricStart
from finback.flight.table_axis import TableAxis, table_axes
from finback.flight.vehicle import Vehicle, make_vehicle
from finback.records import Condition
from finback.units import to_si

Writer = Callable[..., Aircraft]
MakePlan = Callable[..., FlightPlan]

SECOND_ORDER = 8.0
"""A quarter of the step leaves a sixteenth of the error at second order; half of that for what is not yet of it."""
THRUST = FixedThrust(thrust_n=30000.0)
SMOOTH = {'lookup="row">aero/alpha-deg<': 'lookup="row">velocities/mach<'}
"""The small aircraft's drag over something that passes no breakpoint."""
TURNING = FreeStart(
    theta_rad=0.2, airspeed_m_s=240.0, altitude_m=9000.0, beta_rad=0.03, phi_rad=0.5, psi_rad=2.5, p_rad_s=0.2,
    r_rad_s=-0.1, latitude_rad=0.9,
)  # fmt: skip


def _options(fidelity: str, hz: int = 400) -> FlightOptions:
    return FlightOptions(
        fidelity=fidelity,
        step_s=1 / hz,
        alpha_limits_rad=(-1.5, 1.5),
        elevator_limits_rad=(-0.7, 0.35),
        elevator_rate_rad_s=1.0,
        drive=Drive.DIRECT,
    )


def _error(aircraft: Aircraft, condition: Condition, fidelity: str, plan: FlightPlan, *, hz: int) -> Reference:
    with make_vehicle(aircraft, condition, _options(fidelity, hz)) as vehicle:
        return _compared(vehicle, plan)


def _compared(vehicle: Vehicle, plan: FlightPlan) -> Reference:
    record = vehicle.fly(plan)
    found = reference(vehicle.motion(plan), record)
    assert isinstance(found, Reference)
    return found


@pytest.mark.parametrize(
    ("fidelity", "changes"),
    [
        ("rig", {}),
        ("rig", {"loading": Loading(mass_ratio=0.8, center_aft_m=0.05)}),
        ("symmetric", {"power": THRUST}),
        ("symmetric", {"start": SymmetricStart(theta_rad=1.45, airspeed_m_s=280.0, altitude_m=3000.0)}),
        ("free", {"power": THRUST, "start": TURNING, "loading": Loading(inertia_ratio=1.2)}),
        ("free", {"start": replace(TURNING, theta_rad=1.5, phi_rad=0.0)}),
    ],
    ids=["rig", "rig, loaded", "symmetric", "symmetric, over the top", "free, turning", "free, over the top"],
)
def test_flights_come_nearer_to_the_other_integrator_at_second_order_or_faster(
    fidelity: str, changes: dict[str, object], write_mini: Writer, condition: Condition, make_plan: MakePlan
) -> None:
    """So what is left at the fine step is an error of the step, not of the right-hand side."""
    knots = ((0.0, -0.05), (0.4, -0.05), (0.8, 0.1), (0.8, -0.1), (1.2, -0.1))
    plan = make_plan(*knots, alpha=0.1, q=0.3, duration=3.0, alpha_limits_rad=(-1.5, 1.5), **changes)
    coarse, fine = (_error(write_mini(SMOOTH), condition, fidelity, plan, hz=hz) for hz in (400, 1600))
    assert not coarse.corners
    assert 1e-8 < coarse.alpha_error_rad < 1e-5
    assert coarse.uncertainty_rad < 0.01 * coarse.alpha_error_rad
    assert fine.alpha_error_rad < coarse.alpha_error_rad / SECOND_ORDER
    assert fine.q_error_rad_s < coarse.q_error_rad_s / SECOND_ORDER


def test_the_horizon_of_an_ellipsoid_turns_so_fast_that_an_unstable_aircraft_feels_it(
    f16: Aircraft, condition: Condition, make_plan: MakePlan
) -> None:
    """A fighter that diverges sideways: with a sphere's radii both integrators stayed 2e-5 rad apart at any step."""
    knots = ((0.0, 0.16), (1.0, 0.16), (1.2, -0.34))
    plan = make_plan(*knots, alpha=-0.15, q=-0.11, duration=10.0, power=THRUST, alpha_limits_rad=(-1.5, 1.5))
    coarse, fine = (_error(f16, condition, "free", plan, hz=hz) for hz in (400, 1600))
    assert fine.alpha_error_rad < coarse.alpha_error_rad / SECOND_ORDER + fine.uncertainty_rad


def test_radii_of_the_earth_are_those_of_its_ellipsoid(f16: Aircraft) -> None:
    """WGS 84 (NIMA TR8350.2, 2000): M = a(1 - e²)/(1 - e² sin²φ)^1.5 and N = a/(1 - e² sin²φ)^0.5."""
    planet = planet_of(f16.path)
    major, squared = 6378137.0, 6.69437999014e-3
    for latitude in (0.0, 0.7, -1.4):
        width = 1.0 - squared * math.sin(latitude) ** 2
        expected = major * (1.0 - squared) / width**1.5, major / math.sqrt(width)
        assert to_si(np.array(planet.radii_ft(latitude)), "ft") == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    ("text", "axes"),
    [
        ("<planet><semimajor_axis unit='KM'>6000</semimajor_axis></planet>", (6.0e6, 6356752.3)),
        ("<planet><semimajor_axis>1e7</semimajor_axis><semiminor_axis unit='M'>3e6</semiminor_axis></planet>",
         (3.048e6, 3.0e6)),
    ],
)  # fmt: skip
def test_a_models_own_planet_is_read(text: str, axes: tuple[float, float], tmp_path: Path) -> None:
    path = tmp_path / "moon.xml"
    path.write_text(f"<fdm_config>{text}</fdm_config>", encoding="utf-8")
    planet = planet_of(path)
    assert to_si(np.array([planet.equator_ft, planet.pole_ft]), "ft") == pytest.approx(axes, rel=1e-7)


@pytest.mark.parametrize(
    "axis", ["<semimajor_axis>wide</semimajor_axis>", "<semiminor_axis unit='AU'>1</semiminor_axis>"]
)
def test_a_planet_of_no_size_is_refused(axis: str, tmp_path: Path) -> None:
    path = tmp_path / "moon.xml"
    path.write_text(f"<fdm_config><planet>{axis}</planet></fdm_config>", encoding="utf-8")
    with pytest.raises(AircraftError, match="<planet> has no semim"):
        planet_of(path)


def test_corners_of_tables_are_counted_and_named(f8ii_rig: Rig, make_plan: MakePlan) -> None:
    """The F-8 II's tables have a row every half degree."""
    slow = _compared(f8ii_rig, make_plan((0.0, -0.1), alpha=math.radians(10.1), duration=0.02))
    assert not slow.corners
    record = f8ii_rig.fly(plan := make_plan((0.0, -0.1), alpha=math.radians(10.1), q=0.5, duration=1.0))
    turns = np.diff(np.floor(np.degrees(record["alpha_rad"]) * 2.0))
    found = _compared(f8ii_rig, plan)
    assert found.corners["aero/alpha-deg"] >= int(np.abs(turns).sum()) > 5


def test_an_error_in_a_flight_is_seen(f8ii_rig: Rig, make_plan: MakePlan) -> None:
    plan = make_plan((0.0, -0.1), (1.0, -0.15), alpha=0.1, duration=2.0)
    record = f8ii_rig.fly(plan)
    bent = record.with_columns(alpha_rad=record["alpha_rad"] + 1e-4 * np.sin(record["time_s"]))
    found = reference(f8ii_rig.motion(plan), bent)
    assert isinstance(found, Reference)
    assert found.alpha_error_rad == pytest.approx(1e-4, rel=0.01)  # the sine's largest value lies in the 2 s


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"power": Throttle(setting=0.5)}, "engines under a throttle"),
        ({"air": DrydenAir(intensity_m_s=1.0, length_m=500.0, seed=1)}, "turbulence"),
    ],
    ids=["throttle", "gusts"],
)
def test_what_remembers_more_than_its_state_is_named(
    changes: dict[str, object], reason: str, f16_direct: Airborne, make_plan: MakePlan
) -> None:
    motion = f16_direct.motion(make_plan((0.0, -0.05), alpha=0.1, duration=1.0, **changes))
    assert isinstance(motion, Incomplete)
    assert reason in motion.reason


def test_actuators_are_named(f8ii_free: Airborne, make_plan: MakePlan) -> None:
    plan = make_plan((0.0, -0.05), alpha=0.1, duration=0.1)
    found = reference(f8ii_free.motion(plan), f8ii_free.fly(plan))
    assert isinstance(found, NoReference)
    assert "actuators" in found.reason


def test_what_jsbsim_gives_a_frame_late_is_named(write_mini: Writer, condition: Condition, make_plan: MakePlan) -> None:
    late = "<product><value>-0.1</value><property>aero/cl-squared</property></product>"
    plan = make_plan((0.0, -0.05), alpha=0.1, duration=0.5)
    for fidelity in ("rig", "symmetric"):
        with make_vehicle(write_mini({"<!--pitch-->": late}), condition, _options(fidelity)) as vehicle:
            motion = vehicle.motion(plan)
        assert isinstance(motion, Incomplete)
        assert "aero/cl-squared a frame late" in motion.reason


def test_every_vehicle_gives_the_same_rates_as_equations_and_as_derivatives(rig: Rig, make_plan: MakePlan) -> None:
    motion = rig.motion(make_plan((0.0, -0.05), alpha=0.1, duration=0.1))
    assert isinstance(motion, Motion)
    assert motion.rates(np.array([0.2, -0.3]), -0.1).tolist() == list(rig.derivatives(0.2, -0.3, -0.1))


# tables


def test_breakpoints_of_all_dimensions_are_found() -> None:
    text = """<aerodynamics>
      <table><independentVar> -aero/a </independentVar><tableData> 0 1\n 2.5 3\n</tableData></table>
      <table><independentVar lookup="row">aero/a</independentVar><independentVar lookup="column">b</independentVar>
        <independentVar lookup="table">c</independentVar>
        <tableData breakPoint="7"> 10 20\n 1 0 0\n 2 0 0\n</tableData>
        <tableData breakPoint="8"> 10 30\n 1 0 0\n 4 0 0\n</tableData></table>
      <table name="broken"><independentVar>d</independentVar><tableData>no numbers</tableData></table>
    </aerodynamics>"""
    found = {axis.name: axis.breakpoints.tolist() for axis in table_axes(ET.fromstring(text))}  # noqa: S314 - our own
    assert found == {"aero/a": [0.0, 1.0, 2.0, 2.5, 4.0], "b": [10.0, 20.0, 30.0], "c": [7.0, 8.0]}


@given(values=st.lists(st.floats(-5.0, 5.0), min_size=1, max_size=30))
def test_a_way_and_its_return_pass_as_many_breakpoints(values: list[float]) -> None:
    axis = TableAxis(name="a", breakpoints=np.arange(-3.0, 4.0))
    there = axis.passed(np.array(values))
    assert there == axis.passed(np.array(values[::-1]))
    assert axis.passed(np.array([*values, *values[::-1]])) == 2 * there
    assert axis.passed(np.array([values[0], values[-1]])) <= there
