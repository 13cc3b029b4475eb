"""The surfaces keep their limits and rates, in both stabilator modes, and never wind up behind a stop."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from finback.flight.simulator import Simulator
from finback.units import from_si, to_si

STEP_S = 1 / 400
ROUNDING = 1e-9  # deg and deg/s
NORMAL, RESEARCH = 0.0, 1.0
ELEVATOR = "fcs/elevator-pos-rad"
# mode, lower limit, upper limit in deg, rate in deg/s
MODES = ((NORMAL, -19.0, 16.5, 25.0), (RESEARCH, -40.0, 20.0, 60.0))


def drive(simulator: Simulator, surface: str, commands: dict[str, float], seconds: float) -> np.ndarray:
    """Fly with held commands; return the surface in deg at every step."""
    simulator.write(commands)
    position = simulator.getter(surface)
    positions = []
    for _ in range(round(seconds / STEP_S)):
        simulator.run()
        positions.append(from_si(position(), "deg"))
    return np.array(positions)


@pytest.mark.parametrize(("mode", "low", "high", "rate"), MODES)
@pytest.mark.parametrize("trim", [0.0, 1.0, -1.0])
def test_limits_and_rates_hold_in_each_mode(
    start_flight: Callable[..., Simulator], mode: float, low: float, high: float, rate: float, trim: float
) -> None:
    simulator = start_flight(commands={"fcs/stabilator-research-mode": mode})
    commands = {"fcs/elevator-cmd-norm": -1.0, "fcs/pitch-trim-cmd-norm": min(trim, 0.0)}
    down = drive(simulator, ELEVATOR, commands, 2.0)
    up = drive(simulator, ELEVATOR, {"fcs/elevator-cmd-norm": 1.0, "fcs/pitch-trim-cmd-norm": max(trim, 0.0)}, 3.0)
    flown = np.concatenate([[0.0], down, up])
    assert down[-1] == pytest.approx(low, abs=ROUNDING)
    assert up[-1] == pytest.approx(high, abs=ROUNDING)
    assert low - ROUNDING <= flown.min() < flown.max() <= high + ROUNDING
    fastest = np.abs(np.diff(flown)).max() / STEP_S
    assert fastest == pytest.approx(rate, rel=ROUNDING)


@pytest.mark.parametrize(("mode", "low", "high", "rate"), MODES)
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_surface_leaves_its_stop_at_once(
    start_flight: Callable[..., Simulator], mode: float, low: float, high: float, rate: float, side: float
) -> None:
    simulator = start_flight(commands={"fcs/stabilator-research-mode": mode})
    far = {"fcs/elevator-cmd-norm": 5.0 * side, "fcs/pitch-trim-cmd-norm": 3.0 * side}
    stop = low if side < 0 else high
    assert drive(simulator, ELEVATOR, far, 2.5)[-1] == pytest.approx(stop, abs=ROUNDING)
    back = drive(simulator, ELEVATOR, dict.fromkeys(far, 0.0), 0.1)
    # from the very first step it comes back at full rate, as if the command had never been beyond the stop
    expected = stop - side * rate * STEP_S * np.arange(1, len(back) + 1)
    assert np.abs(back - expected).max() < ROUNDING


def test_a_small_command_follows_the_servo_lag_in_normal_mode_only(start_flight: Callable[..., Simulator]) -> None:
    # 1 deg asks for 20 deg/s at most: under the rate limit, so the first-order lag of 20 rad/s is all there is.
    lagged = drive(start_flight(), ELEVATOR, {"fcs/elevator-cmd-norm": 1.0 / 16.5}, 0.2)
    time = STEP_S * (np.arange(len(lagged)) + 0.5)  # the bilinear lag answers half a step late
    assert np.abs(lagged - (1.0 - np.exp(-20.0 * time))).max() < 1e-3
    research = start_flight(commands={"fcs/stabilator-research-mode": RESEARCH})
    direct = drive(research, ELEVATOR, {"fcs/elevator-cmd-norm": 1.0 / 20.0}, 0.2)
    expected = np.minimum(60.0 * STEP_S * np.arange(1, len(direct) + 1), 1.0)
    assert np.abs(direct - expected).max() < ROUNDING


def test_the_command_maps_to_the_limits_of_the_mode_with_zero_at_zero(start_flight: Callable[..., Simulator]) -> None:
    for mode, low, high, _ in MODES:
        for command, expected in ((-0.5, low / 2), (0.0, 0.0), (0.5, high / 2)):
            simulator = start_flight(commands={"fcs/stabilator-research-mode": mode})
            flown = drive(simulator, ELEVATOR, {"fcs/elevator-cmd-norm": command}, 2.0)
            assert flown[-1] == pytest.approx(expected, abs=1e-6)  # the lag has died away by exp(-20)


@pytest.mark.parametrize(
    ("surface", "command", "limit", "rate"),
    [
        ("left-aileron", "aileron", 20.0, 60.0),
        ("right-aileron", "aileron", -20.0, 60.0),
        ("rudder", "rudder", 25.0, 40.0),
    ],
)
def test_ailerons_and_rudder(
    start_flight: Callable[..., Simulator], surface: str, command: str, limit: float, rate: float
) -> None:
    simulator = start_flight()
    name, position = f"fcs/{command}-cmd-norm", f"fcs/{surface}-pos-rad"
    out = drive(simulator, position, {name: 4.0}, 1.0)
    assert out[-1] == pytest.approx(limit, abs=ROUNDING)
    assert np.abs(np.diff(out)).max() / STEP_S == pytest.approx(rate, rel=ROUNDING)
    back = drive(simulator, position, {name: 0.0}, 0.01)
    assert abs(back[0]) == pytest.approx(abs(limit) - rate * STEP_S, abs=ROUNDING)
    other = drive(simulator, position, {name: -4.0}, 2.0)
    assert other[-1] == pytest.approx(-limit, abs=ROUNDING)


def test_degrees_follow_radians(start_flight: Callable[..., Simulator]) -> None:
    simulator = start_flight()
    drive(simulator, ELEVATOR, {"fcs/elevator-cmd-norm": -0.3}, 1.0)
    degrees, radians = simulator.getter("fcs/elevator-pos-deg")(), simulator.getter(ELEVATOR)()
    assert radians < -0.05
    assert to_si(degrees, "deg") == pytest.approx(radians, rel=1e-12)
    assert math.isfinite(degrees)
