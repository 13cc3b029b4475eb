"""The traps of JSBSim, each sprung on purpose."""

from __future__ import annotations

import math
import subprocess
import sys
import threading
from collections.abc import Callable

import pytest

from finback.errors import AircraftError, InputError
from finback.flight.aircraft import Aircraft
from finback.flight.simulator import Simulator, native_properties

Writer = Callable[..., Aircraft]
FLYING = {"ic/h-sl-ft": 30000.0, "ic/u-fps": 800.0, "ic/w-fps": 40.0}
INTEGRATORS = [
    f"simulation/integrator/{kind}/{motion}"
    for kind in ("rate", "position")
    for motion in ("rotational", "translational")
]


@pytest.fixture
def simulator(write_mini: Writer) -> Simulator:
    made = Simulator(write_mini().path, step_s=1 / 1000, freeze_position=True)
    made.write(FLYING)
    made.start()
    return made


def test_the_step_is_set_before_the_model_is_loaded_so_an_actuator_keeps_its_rate(simulator: Simulator) -> None:
    """A step set after loading made this surface several times too fast: JSBSim loads with 1/120 s."""
    simulator.reset()
    simulator.start()
    simulator.write({"fcs/elevator-cmd-norm": 1.0})
    position = simulator.getter("fcs/elevator-pos-rad")
    before = position()
    for _ in range(200):
        simulator.run()
    assert position() - before == pytest.approx(1.0 * 0.2, abs=0.002)  # 1 rad/s for 0.2 s; two steps of start


def test_integrators_are_chosen_at_the_start_and_again_after_a_reset(simulator: Simulator) -> None:
    chosen = dict.fromkeys(INTEGRATORS, 5.0) | {INTEGRATORS[-1]: 0.0}
    assert simulator.read(INTEGRATORS) == chosen
    simulator.reset()
    assert simulator.read(INTEGRATORS) == chosen


def test_unknown_names_are_errors_and_create_nothing(simulator: Simulator) -> None:
    for use in (simulator.getter, simulator.setter, lambda name: simulator.write({name: 1.0})):
        with pytest.raises(AircraftError, match="no property 'fcs/elevater-cmd-norm'"):
            use("fcs/elevater-cmd-norm")
    assert not simulator.has("fcs/elevater-cmd-norm")


def test_a_read_only_property_is_an_error(simulator: Simulator) -> None:
    with pytest.raises(AircraftError, match="read-only"):
        simulator.write({"aero/alpha-rad": 0.1})


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_value_that_is_not_finite_is_refused(simulator: Simulator, value: float) -> None:
    with pytest.raises(InputError, match="finite"):
        simulator.write({"fcs/elevator-cmd-norm": value})


def test_nan_in_the_state_is_seen_although_jsbsim_reads_alpha_as_zero(simulator: Simulator) -> None:
    assert simulator.finite()
    simulator.setter("fcs/elevator-cmd-norm")(math.nan)
    for _ in range(3):
        assert simulator.run()
    assert simulator.getter("aero/alpha-rad")() == 0.0
    assert not simulator.finite()


def test_threads_are_refused(write_mini: Writer) -> None:
    path = write_mini().path
    caught: list[Exception] = []

    def load() -> None:
        try:
            Simulator(path, step_s=0.01, freeze_position=True)
        except InputError as error:
            caught.append(error)

    thread = threading.Thread(target=load)
    thread.start()
    thread.join()
    assert "thread" in str(caught[0])


def test_a_start_that_fails_does_not_abort_the_interpreter_when_the_object_goes(write_mini: Writer) -> None:
    path = write_mini({"<property>aero/beta-rad</property>": "<property>aero/no-such-thing</property>"}).path
    program = (
        "import gc, sys\nfrom pathlib import Path\nfrom finback.errors import AircraftError\n"
        "from finback.flight.simulator import Simulator\n"
        "s = Simulator(Path(sys.argv[1]), step_s=0.01, freeze_position=True)\n"
        "try: s.start()\nexcept AircraftError as e: print(e)\n"
        "del s; gc.collect(); print('alive')"
    )
    done = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert "aero/no-such-thing" in done.stdout
    assert done.stdout.strip().endswith("alive")


def test_a_model_that_loads_with_a_warning_is_an_error_that_quotes_it(write_mini: Writer) -> None:
    twice = '<property value="1">aero/mine</property><property value="2">aero/mine</property>'
    with pytest.raises(AircraftError, match="already defined"):
        Simulator(write_mini({"<!--aerodynamics-->": twice}).path, step_s=0.01, freeze_position=True)


def test_density_is_held_over_a_reset(simulator: Simulator) -> None:
    simulator.override_density(5e-4)
    for _ in range(2):
        simulator.reset()
        simulator.start()
        assert simulator.read(["atmosphere/rho-slugs_ft3"]) == {"atmosphere/rho-slugs_ft3": 5e-4}


def test_native_properties_are_those_of_no_model() -> None:
    assert native_properties(["fcs/elevator-pos-rad", "fcs/flaperon-rad"]) == {"fcs/elevator-pos-rad"}
