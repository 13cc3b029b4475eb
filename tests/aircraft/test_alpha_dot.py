"""The closed form of the rate of alpha in the pitching moment is the rate of alpha that is flown."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from finback.flight.excitation import Doublet, schedule
from finback.flight.plan import FlightPlan
from finback.flight.rig import Rig
from finback.flight.simulator import Simulator
from finback.records import Hold
from finback.units import to_si

STEP_S = 1 / 400
POWER = {"fcs/throttle-cmd-norm[0]": 0.65, "fcs/throttle-cmd-norm[1]": 0.55}

# Deviation of gravity from the local vertical once the centrifugal part is taken out, 1e-4 of g or less, over V.
GRAVITY_DIRECTION = 1e-6  # rad/s
# Central difference of alpha over two steps, 1e-6 s² of the third derivative, and a table's corners.
DIFFERENCE = 5e-5  # rad/s


def closed_form(simulator: Simulator) -> Callable[[], float]:
    """Return a reader of the rate of alpha in the moment: the moment over everything that multiplies it."""
    moment, *factors = (
        simulator.getter(name)
        for name in (
            "aero/moment/pitch-alpha-dot-lbsft",
            "aero/force/reference-lbs",
            "metrics/cbarw-ft",
            "aero/ci2vel",
            "aero/table/Cm_alpha_dot",
        )
    )
    return lambda: moment() / math.prod(factor() for factor in factors)


STATES = {
    "level, east, at the equator": {"latitude": 0.0, "alpha": 5.0},
    "pitching, north": {"alpha": 3.0, "psi": 0.0, "rates": (0.0, 5.0, 0.0)},
    "steep climb, stalled": {"alpha": 24.0, "theta": 60.0},
    "banked, slipping, rolling": {"alpha": 5.0, "beta": 10.0, "phi": 30.0, "rates": (40.0, 5.0, 10.0)},
    "nearly inverted, slipping left": {
        "latitude": 60.0,
        "alpha": -8.0,
        "beta": -20.0,
        "phi": -150.0,
        "theta": -30.0,
        "psi": 200.0,
        "rates": (-80.0, -10.0, 20.0),
    },
}


@pytest.mark.parametrize("state", STATES.values(), ids=STATES.keys())
def test_free_flight_with_engines_on(start_flight: Callable[..., Simulator], state: dict[str, float]) -> None:
    simulator = start_flight(running=True, commands=POWER, **state)
    assert simulator.getter("forces/fbx-prop-lbs")() > 1000.0
    formula, alpha = closed_form(simulator), simulator.getter("aero/alpha-rad")
    u, w, u_dot, w_dot = (
        simulator.getter(name)
        for name in ("velocities/u-fps", "velocities/w-fps", "accelerations/udot-ft_sec2", "accelerations/wdot-ft_sec2")
    )
    stated, kinematic, flown = [], [], []
    for _ in range(200):
        simulator.run()
        stated.append(formula())
        kinematic.append((u() * w_dot() - w() * u_dot()) / (u() ** 2 + w() ** 2))
        flown.append(alpha())
    assert np.ptp(stated) > 0.01
    assert np.abs(np.subtract(stated, kinematic)).max() < GRAVITY_DIRECTION
    central = (np.array(flown[2:]) - np.array(flown[:-2])) / (2 * STEP_S)
    settled = slice(5, None)  # the first steps are those of a low-order start
    assert np.abs(central - np.array(stated)[1:-1])[settled].max() < DIFFERENCE


def test_the_rig(rig: Rig, published_polynomial: Callable[[Path], Callable], aircraft_folder: Path) -> None:
    maneuver = Doublet(elevator_rad=0.0, amplitude_rad=to_si(5.0, "deg"), unit_s=0.5, lead_s=0.1, duration_s=3.0)
    limits = (to_si(-40.0, "deg"), to_si(20.0, "deg"))
    plan = FlightPlan(
        name="doublet",
        kind=maneuver.kind,
        alpha_rad=to_si(0.24633694, "deg"),
        q_rad_s=0.0,
        schedule=schedule(maneuver, rate_limit_rad_s=to_si(60.0, "deg_s"), limits_rad=limits, grid_s=STEP_S),
        hold=Hold.FOH,
        duration_s=maneuver.duration_s,
        sample_interval_s=STEP_S,
        alpha_limits_rad=(to_si(-33.0, "deg"), to_si(46.0, "deg")),
    )
    record = rig.fly(plan)
    polynomial = published_polynomial(aircraft_folder / "published.toml")
    k = -0.43379543105980
    # q_dot less everything but k·alpha_dot, over k, is the rate of alpha that the moment was given
    rows = list(zip(record["alpha_rad"], record["q_rad_s"], record["elevator_rad"], strict=True))
    other = np.array([polynomial(*row)[1] - k * polynomial(*row)[0] for row in rows])
    given = (record["q_dot_rad_s2"] - other) / k
    alpha = record["alpha_rad"]
    central = (alpha[2:] - alpha[:-2]) / (2 * STEP_S)
    assert np.ptp(central) > 0.2
    # the tables' chords are off by 4e-5 rad/s² of q_dot at most, 1e-4 rad/s of what is derived from it; the late
    # alpha_dot of JSBSim would be off by a step times d²alpha/dt², 3e-3
    assert np.abs(central - given[1:-1])[5:].max() < 1e-4


@pytest.mark.parametrize(("airspeed", "beta"), [(0.0, 0.0), (50.0, 90.0), (50.0, -90.0)])
def test_no_division_by_nothing(start_flight: Callable[..., Simulator], airspeed: float, beta: float) -> None:
    simulator = start_flight(airspeed_m_s=airspeed, beta=beta, rates=(10.0, 5.0, -5.0), altitude_m=5000.0)
    accelerations = [simulator.getter(f"accelerations/{axis}dot-rad_sec2") for axis in "pqr"]
    for _ in range(20):
        assert all(math.isfinite(acceleration()) for acceleration in accelerations)
        assert abs(accelerations[1]()) < 10.0
        simulator.run()
