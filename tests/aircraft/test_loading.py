"""The aircraft loads without one warning, weighs what it should, and takes its engines from its own folder."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from finback.flight.simulator import Simulator
from finback.units import from_si, to_si

ROUNDING = 1e-9  # relative; the reference mass is exact by definition

LOAD_AND_FLY = """
import json, sys, jsbsim

class Log(jsbsim.FGLogger):
    def __init__(self):
        super().__init__()
        self.level, self.said = 0, []
    def set_level(self, level):
        self.level = int(level)
    def message(self, text):
        self.said.append((self.level, text))

log = Log()
jsbsim.set_logger(log)
jsbsim.FGJSBBase().debug_lvl = 1
fdm = jsbsim.FGFDMExec(None)
fdm.set_aircraft_path(sys.argv[1])
fdm.set_dt(1 / 400)
loaded = fdm.load_model("f8ii")
fdm["ic/h-sl-ft"], fdm["ic/u-fps"] = 42738.0, 968.0
started = fdm.run_ic()
fdm["propulsion/set-running"] = -1
flown = all(fdm.run() for _ in range(400))
bad = [text for level, text in log.said if jsbsim.LogLevel.WARN <= level <= jsbsim.LogLevel.FATAL and text.strip()]
print(json.dumps({"loaded": loaded, "started": started, "flown": flown, "heard": len(log.said), "bad": bad}))
"""


def test_it_loads_starts_and_flies_without_one_warning(aircraft_folder: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-c", LOAD_AND_FLY, str(aircraft_folder.parent)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    answer = json.loads(done.stdout.splitlines()[-1])
    assert answer.pop("heard") > 0  # the log was listened to
    assert answer == {"loaded": True, "started": True, "flown": True, "bad": []}


def test_mass_and_inertia_are_the_reference_values(start_flight: Callable[..., Simulator]) -> None:
    read = start_flight().getter
    mass = to_si(read("inertia/mass-slugs")(), "slug")
    assert mass == pytest.approx(14300.0, rel=ROUNDING)
    expected = {"ixx": 1.9e4, "iyy": 2.20e5, "izz": 2.31e5, "ixz": -3.0e3}  # JSBSim gives the matrix entry, -Ixz
    for name, value in expected.items():
        assert to_si(read(f"inertia/{name}-slugs_ft2")(), "slug_ft2") == pytest.approx(value, rel=ROUNDING)


def test_burning_fuel_moves_neither_center_of_gravity_nor_inertia(start_flight: Callable[..., Simulator]) -> None:
    simulator = start_flight(running=True, commands={"fcs/throttle-cmd-norm[0]": 1.0, "fcs/throttle-cmd-norm[1]": 1.0})
    names = (*(f"inertia/cg-{axis}-in" for axis in "xyz"), "inertia/iyy-slugs_ft2")
    before = simulator.read(names)
    reference_point = simulator.read(f"metrics/aero-rp-{axis}-in" for axis in "xyz")
    mass = simulator.getter("inertia/mass-slugs")
    full = mass()
    for _ in range(2000):
        simulator.run()
    assert mass() < full * (1 - 1e-4)
    assert simulator.read(names) == before
    assert list(before.values())[:3] == list(reference_point.values()) == [0.0, 0.0, 0.0]


def test_thrust_is_the_tabulated_fraction_of_the_rating(start_flight: Callable[..., Simulator]) -> None:
    # At the nodes 13 000 m, Mach 1.0 of data/thrust_*.csv: 0.259 of 42.66 kN dry, 0.287 of 65.90 kN in reheat.
    # The reference condition is that node but for the rounding of its height and airspeed, 1e-5 each.
    for throttle, thrust_n in ((0.5, 2 * 0.259 * 42660.0), (1.0, 2 * 0.287 * 65900.0)):
        commands = {"fcs/throttle-cmd-norm[0]": throttle, "fcs/throttle-cmd-norm[1]": throttle}
        simulator = start_flight(running=True, commands=commands)
        assert from_si(thrust_n, "lbf") == pytest.approx(simulator.getter("forces/fbx-prop-lbs")(), rel=1e-4)


def test_an_engine_that_was_not_started_gives_nothing(start_flight: Callable[..., Simulator]) -> None:
    simulator = start_flight()
    for _ in range(10):
        assert simulator.getter("forces/fbx-prop-lbs")() == 0.0
        simulator.run()


def test_side_force_is_a_body_axis_force(start_flight: Callable[..., Simulator]) -> None:
    simulator = start_flight(alpha=30.0, beta=12.0, rates=(20.0, 0.0, -10.0))
    reference, cy = (simulator.getter(name)() for name in ("aero/force/reference-lbs", "aero/coefficient/CY"))
    drag, lift = (simulator.getter(f"aero/coefficient/{name}")() for name in ("CD", "CL"))
    alpha = math.radians(30.0)
    body_x = reference * (lift * math.sin(alpha) - drag * math.cos(alpha))
    assert simulator.getter("forces/fby-aero-lbs")() == pytest.approx(reference * cy, rel=1e-12)
    assert simulator.getter("forces/fbx-aero-lbs")() == pytest.approx(body_x, rel=1e-12)


@pytest.mark.parametrize(
    ("command", "acceleration", "sign"),
    [
        ("fcs/elevator-cmd-norm", "accelerations/qdot-rad_sec2", -1),  # trailing edge down: nose down
        ("fcs/aileron-cmd-norm", "accelerations/pdot-rad_sec2", 1),  # rolls right
        ("fcs/rudder-cmd-norm", "accelerations/rdot-rad_sec2", -1),  # yaws left
    ],
)
def test_each_control_turns_the_aircraft_its_way(
    start_flight: Callable[..., Simulator], command: str, acceleration: str, sign: int
) -> None:
    simulator = start_flight()
    simulator.write({command: 0.5})
    for _ in range(20):
        simulator.run()
    assert sign * simulator.getter(acceleration)() > 0.01
