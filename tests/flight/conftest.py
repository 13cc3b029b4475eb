"""Aircraft for the flight room's tests: a small one that a test can spoil, the F-8 II, JSBSim's own F-16."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from finback.flight.airborne import Airborne
from finback.flight.aircraft import Aircraft, find_aircraft
from finback.flight.plan import Drive, FlightOptions, FlightPlan
from finback.flight.rig import Rig
from finback.records import Condition, Hold, Schedule

MINI = """<?xml version="1.0"?>
<fdm_config name="mini" version="2.0">
  <metrics>
    <wingarea unit="FT2">375</wingarea><wingspan unit="FT">35.67</wingspan><chord unit="FT">11.78</chord>
    <location name="AERORP" unit="IN"><x>0</x><y>0</y><z>0</z></location>
  </metrics>
  <mass_balance negated_crossproduct_inertia="false">
    <ixx unit="SLUG*FT2">13600</ixx><iyy unit="SLUG*FT2">96800</iyy><izz unit="SLUG*FT2">105000</izz>
    <ixz unit="SLUG*FT2">3000</ixz>
    <emptywt unit="LBS">21482</emptywt><location name="CG" unit="IN"><x>3</x><y>0</y><z>-1</z></location>
    <pointmass name="pilot"><weight unit="LBS">200</weight>
      <location unit="IN"><x>-120</x><y>0</y><z>8</z></location></pointmass>
  </mass_balance>
  <ground_reactions/>
  <propulsion>
    <!--engine-->
    <tank type="FUEL"><location unit="IN"><x>10</x><y>0</y><z>5</z></location>
      <capacity unit="LBS">4000</capacity><contents unit="LBS">3000</contents></tank>
  </propulsion>
  <flight_control name="FCS">
    <channel name="pitch">
      <aerosurface_scale name="fcs/demand-rad"><input>fcs/elevator-cmd-norm</input>
        <range><min>-0.5</min><max>0.5</max></range></aerosurface_scale>
      <actuator name="fcs/servo"><input>fcs/demand-rad</input><rate_limit>1.0</rate_limit>
        <output>fcs/elevator-pos-rad</output></actuator>
      <fcs_function name="fcs/flaperon-rad"><function><value>0.125</value></function></fcs_function>
    </channel>
  </flight_control>
  <aerodynamics>
    <!--aerodynamics-->
    <axis name="LIFT"><function name="aero/lift"><product>
      <property>aero/qbar-psf</property><property>metrics/Sw-sqft</property>
      <sum>
        <product><value>4.0</value><sin><property>aero/alpha-rad</property></sin></product>
        <product><value>0.5</value><property>fcs/elevator-pos-rad</property></product>
        <product><value>0.1</value><property>fcs/flaperon-rad</property></product>
      </sum></product></function></axis>
    <axis name="DRAG"><function name="aero/drag"><product>
      <property>aero/qbar-psf</property><property>metrics/Sw-sqft</property>
      <table name="aero/CD"><independentVar lookup="row">aero/alpha-deg</independentVar><tableData>
        -20 0.2
          0 0.02
         25 0.4
         90 1.7
      </tableData></table></product></function></axis>
    <axis name="SIDE"><function name="aero/side"><product>
      <property>aero/qbar-psf</property><property>metrics/Sw-sqft</property><property>aero/beta-rad</property>
      <value>-0.8</value></product></function></axis>
    <axis name="PITCH"><function name="aero/pitch"><product>
      <property>aero/qbar-psf</property><property>metrics/Sw-sqft</property><property>metrics/cbarw-ft</property>
      <sum>
        <product><value>-0.5</value><sin><property>aero/alpha-rad</property></sin></product>
        <product><value>-0.8</value><property>fcs/elevator-pos-rad</property></product>
        <product><property>aero/ci2vel</property><property>velocities/q-aero-rad_sec</property><value>-5</value></product>
        <!--pitch-->
      </sum></product></function></axis>
  </aerodynamics>
</fdm_config>
"""

Writer = Callable[..., Aircraft]


@pytest.fixture(scope="session")
def condition() -> Condition:
    return Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)


@pytest.fixture
def write_mini(tmp_path: Path) -> Writer:
    """Write the small aircraft, each key of ``changes`` replaced by its value, and return it."""

    def write(changes: dict[str, str] | None = None, name: str = "mini") -> Aircraft:
        text = MINI
        for old, new in (changes or {}).items():
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "aircraft" / name / f"{name}.xml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return find_aircraft(str(path), near=tmp_path)

    return write


@pytest.fixture(scope="session")
def f8ii() -> Aircraft:
    return find_aircraft("f8ii", near=Path(__file__))


@pytest.fixture(scope="session")
def f16(tmp_path_factory: pytest.TempPathFactory) -> Aircraft:
    return find_aircraft("f16", near=tmp_path_factory.getbasetemp())


@pytest.fixture(scope="session")
def f8ii_rig(f8ii: Aircraft, condition: Condition) -> Iterator[Rig]:
    with Rig(f8ii, condition, step_s=1 / 400) as rig:
        yield rig


@pytest.fixture(scope="session")
def f16_rig(f16: Aircraft, condition: Condition) -> Iterator[Rig]:
    with Rig(f16, condition, step_s=1 / 400) as rig:
        yield rig


@pytest.fixture(params=["f8ii", "f16"])
def rig(request: pytest.FixtureRequest) -> Rig:
    found: Rig = request.getfixturevalue(f"{request.param}_rig")
    found.derivatives(0.0, 0.0, 0.0)  # as loaded, whatever was flown before
    return found


def options(fidelity: str, **changes: object) -> FlightOptions:
    """Return wide limits for a fidelity."""
    given: dict[str, object] = {
        "fidelity": fidelity,
        "alpha_limits_rad": (-0.6, 0.85),
        "elevator_limits_rad": (-0.7, 0.35),
        "elevator_rate_rad_s": 1.0,
    }
    return FlightOptions(**{**given, **changes})  # type: ignore[arg-type]


RESEARCH = (("fcs/stabilator-research-mode", 1.0),)


@pytest.fixture(scope="session")
def f8ii_symmetric(f8ii: Aircraft, condition: Condition) -> Iterator[Airborne]:
    with Airborne(f8ii, condition, options("symmetric")) as vehicle:
        yield vehicle


@pytest.fixture(scope="session")
def f16_symmetric(f16: Aircraft, condition: Condition) -> Iterator[Airborne]:
    with Airborne(f16, condition, options("symmetric")) as vehicle:
        yield vehicle


@pytest.fixture(scope="session")
def f8ii_free(f8ii: Aircraft, condition: Condition) -> Iterator[Airborne]:
    with Airborne(f8ii, condition, options("free", properties=RESEARCH)) as vehicle:
        yield vehicle


@pytest.fixture(scope="session")
def f8ii_direct(f8ii: Aircraft, condition: Condition) -> Iterator[Airborne]:
    with Airborne(f8ii, condition, options("free", drive=Drive.DIRECT)) as vehicle:
        yield vehicle


@pytest.fixture(scope="session")
def f16_direct(f16: Aircraft, condition: Condition) -> Iterator[Airborne]:
    with Airborne(f16, condition, options("free", drive=Drive.DIRECT)) as vehicle:
        yield vehicle


@pytest.fixture(params=["f8ii", "f16"])
def symmetric(request: pytest.FixtureRequest) -> Airborne:
    found: Airborne = request.getfixturevalue(f"{request.param}_symmetric")
    return found


@pytest.fixture(params=["f8ii_free", "f8ii_direct", "f16_direct"])
def free(request: pytest.FixtureRequest) -> Airborne:
    found: Airborne = request.getfixturevalue(request.param)
    return found


MakePlan = Callable[..., FlightPlan]


@pytest.fixture(scope="session")
def make_plan() -> MakePlan:
    """Make a plan from the knots of its elevator, (time in s, elevator in rad)."""

    def make(
        *knots: tuple[float, float], alpha: float, q: float = 0.0, duration: float = 10.0, **changes: object
    ) -> FlightPlan:
        time, elevator = zip(*knots, strict=True)
        given: dict[str, object] = {"sample_interval_s": 0.01, "alpha_limits_rad": (-0.6, 0.85), "name": "test-01"}
        return FlightPlan(
            kind="test",
            alpha_rad=alpha,
            q_rad_s=q,
            schedule=Schedule(time_s=time, elevator_rad=elevator),  # type: ignore[arg-type]
            hold=Hold.FOH,
            duration_s=duration,
            **{**given, **changes},  # type: ignore[arg-type]
        )

    return make
