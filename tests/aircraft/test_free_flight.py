"""Trimmed at the reference condition over the turning Earth, the aircraft flies on as it was."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from finback.flight.simulator import Simulator
from finback.units import from_si, to_si

TRIM_DEG = 0.2463  # 1-g trim of the identified model with the stabilator at zero
SECONDS = 20


@pytest.fixture
def trimmed(start_flight: Callable[..., Simulator]) -> Simulator:
    """Level at the reference condition, thrust equal to drag."""

    def excess(throttle: float) -> tuple[float, Simulator]:
        commands = {"fcs/throttle-cmd-norm[0]": throttle, "fcs/throttle-cmd-norm[1]": throttle}
        simulator = start_flight(alpha=TRIM_DEG, running=True, commands=commands)
        return simulator.getter("forces/fbx-prop-lbs")() - simulator.getter("forces/fwx-aero-lbs")(), simulator

    low, high = excess(0.5)[0], excess(1.0)[0]
    assert low < 0 < high  # level flight there takes light reheat
    balance, simulator = excess(0.5 - 0.5 * low / (high - low))
    assert abs(balance) < 1.0  # lbf; in reheat thrust is linear in the throttle
    return simulator


def test_twenty_seconds_trimmed(trimmed: Simulator) -> None:
    read = trimmed.getter
    alpha, q, theta, phi, beta = (
        read(name)
        for name in (
            "aero/alpha-rad",
            "velocities/q-rad_sec",
            "attitude/theta-rad",
            "attitude/phi-rad",
            "aero/beta-rad",
        )
    )
    airspeed, height = read("velocities/vtrue-fps"), read("position/h-sl-ft")
    for _ in range(SECONDS * 400):
        trimmed.run()
        # gravity there is 0.3 % below the reference, so it climbs a little; nothing else happens
        assert from_si(alpha(), "deg") == pytest.approx(TRIM_DEG, abs=0.02)
        assert abs(from_si(q(), "deg_s")) < 0.05
        assert abs(from_si(beta(), "deg")) < 0.02
    assert from_si(theta(), "deg") == pytest.approx(TRIM_DEG, abs=1.0)
    assert abs(from_si(phi(), "deg")) < 0.5
    assert to_si(airspeed(), "ft_s") == pytest.approx(295.07, abs=2.0)
    assert to_si(height(), "ft") == pytest.approx(13026.6, abs=50.0)
    assert trimmed.faults == ()


def test_a_pull_to_high_alpha_and_a_roll_stay_finite(trimmed: Simulator) -> None:
    trimmed.write({"fcs/stabilator-research-mode": 1.0, "fcs/elevator-cmd-norm": -0.8, "fcs/aileron-cmd-norm": 0.3})
    names = ("aero/alpha-rad", "aero/beta-rad", "velocities/q-rad_sec", "velocities/vtrue-fps")
    getters = [trimmed.getter(name) for name in names]
    highest = 0.0
    for _ in range(10 * 400):
        trimmed.run()
        values = [get() for get in getters]
        assert all(math.isfinite(value) for value in values)
        highest = max(highest, values[0])
    assert from_si(highest, "deg") > 25.0  # a departure is flown through, whatever becomes of it
    assert to_si(getters[3](), "ft_s") > 30.0


def test_coefficients_are_of_their_own_frame(start_flight: Callable[..., Simulator]) -> None:
    """JSBSim's own half chord over airspeed is a frame late where coefficients are computed: 6e-6 of CL here."""
    simulator = start_flight(alpha=17.0, beta=5.0, rates=(20.0, 17.0, 5.0))
    names = ("CL", "CL_elevator", "CL_q", "CY_beta", "CY_p", "CY_r", "CY_rudder")
    tables = {name: simulator.getter(f"aero/table/{name}") for name in names}
    lift, side, elevator, rudder, beta, airspeed, chord, span = (
        simulator.getter(name)
        for name in (
            "aero/coefficient/CL",
            "aero/coefficient/CY",
            "fcs/elevator-pos-rad",
            "fcs/rudder-pos-rad",
            "aero/beta-rad",
            "velocities/vt-fps",
            "metrics/cbarw-ft",
            "metrics/bw-ft",
        )
    )
    p, q, r = (simulator.getter(f"velocities/{axis}-aero-rad_sec") for axis in "pqr")
    slowed = airspeed()
    for _ in range(200):
        simulator.run()
        table = {name: get() for name, get in tables.items()}
        half = 0.5 / airspeed()
        expected = table["CL"] + elevator() * table["CL_elevator"] + q() * chord() * half * table["CL_q"]
        assert lift() == pytest.approx(expected, rel=1e-13, abs=1e-13)
        rates = p() * table["CY_p"] + r() * table["CY_r"]
        expected = beta() * table["CY_beta"] + rates * span() * half + rudder() * table["CY_rudder"]
        assert side() == pytest.approx(expected, rel=1e-13, abs=1e-13)
    assert slowed - airspeed() > 10.0
