"""The F-8 II as built, its builder, its published model in degrees, and flights of the original XML."""

from __future__ import annotations

import importlib
import math
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import ModuleType

import pytest

from finback.flight.aircraft import find_aircraft
from finback.flight.rig import Rig
from finback.flight.simulator import Simulator
from finback.records import Condition
from finback.units import from_si, to_si

REPOSITORY = Path(__file__).parents[2]
REFERENCE = Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)
STEP_S = 1 / 400

Polynomial = Callable[[float, float, float], tuple[float, float]]
StartFlight = Callable[..., Simulator]


@pytest.fixture(scope="session")
def aircraft_folder() -> Path:
    """Where the F-8 II stands."""
    return REPOSITORY / "aircraft" / "f8ii"


@pytest.fixture(scope="session")
def builder() -> ModuleType:
    """The script that builds the aircraft."""
    sys.path.insert(0, str(REPOSITORY / "scripts"))
    try:
        return importlib.import_module("build_f8ii")
    finally:
        sys.path.pop(0)


@pytest.fixture(scope="session")
def published_polynomial() -> Callable[[Path], Polynomial]:
    """Make (alpha, q, elevator) -> (alpha_dot, q_dot), in SI, of a published.toml, evaluated in degrees as printed."""

    def read(path: Path) -> Polynomial:
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
        z, m = tree["alpha_dot_deg_s"], tree["q_dot_deg_s2"]

        def polynomial(alpha_rad: float, q_rad_s: float, elevator_rad: float) -> tuple[float, float]:
            alpha, q, elevator = math.degrees(alpha_rad), math.degrees(q_rad_s), math.degrees(elevator_rad)
            powers = {"constant": 1.0, "alpha": alpha, "alpha2": alpha**2, "alpha3": alpha**3, "elevator": elevator}
            alpha_dot = z["q"] * q + sum(z[term] * value for term, value in powers.items())
            q_dot = m["q_plus_alpha_dot"] * (q + alpha_dot) + sum(m[term] * value for term, value in powers.items())
            return math.radians(alpha_dot), math.radians(q_dot)

        return polynomial

    return read


@pytest.fixture(scope="session")
def mount_rig(aircraft_folder: Path) -> Callable[[Path], Rig]:
    """Put the F-8 II of a folder on the rig at its reference condition."""

    def mount(folder: Path) -> Rig:
        return Rig(find_aircraft(str(folder / "f8ii.xml"), near=aircraft_folder), REFERENCE, step_s=STEP_S)

    return mount


@pytest.fixture(scope="session")
def rig(mount_rig: Callable[[Path], Rig], aircraft_folder: Path) -> Iterator[Rig]:
    """The F-8 II on the rig."""
    with mount_rig(aircraft_folder) as mounted:
        yield mounted


@pytest.fixture
def start_flight(aircraft_folder: Path) -> StartFlight:
    """Start the original XML over the turning Earth; angles in degrees, rates in deg/s, height in m."""

    def start(  # noqa: PLR0913 - a state of flight has that many numbers
        *,
        alpha: float = 0.25,
        beta: float = 0.0,
        phi: float = 0.0,
        theta: float | None = None,
        psi: float = 90.0,
        rates: tuple[float, float, float] = (0.0, 0.0, 0.0),
        latitude: float = 45.0,
        airspeed_m_s: float = REFERENCE.airspeed_m_s,
        altitude_m: float = REFERENCE.altitude_m,
        running: bool = False,
        commands: Mapping[str, float] | None = None,
    ) -> Simulator:
        simulator = Simulator(aircraft_folder / "f8ii.xml", step_s=STEP_S, freeze_position=False)
        speed, a, b = from_si(airspeed_m_s, "ft_s"), to_si(alpha, "deg"), to_si(beta, "deg")
        p, q, r = (to_si(rate, "deg_s") for rate in rates)
        simulator.write(
            {
                "ic/h-sl-ft": from_si(altitude_m, "ft"),
                "ic/lat-geod-deg": latitude,
                "ic/phi-rad": to_si(phi, "deg"),
                "ic/theta-rad": to_si(alpha if theta is None else theta, "deg"),
                "ic/psi-true-rad": to_si(psi, "deg"),
                "ic/u-fps": speed * math.cos(a) * math.cos(b),
                "ic/v-fps": speed * math.sin(b),
                "ic/w-fps": speed * math.sin(a) * math.cos(b),
                "ic/p-rad_sec": p,
                "ic/q-rad_sec": q,
                "ic/r-rad_sec": r,
            }
        )
        simulator.start()
        if running:
            simulator.write({"propulsion/set-running": -1})
        simulator.write(commands or {})
        simulator.start()
        return simulator

    return start
