"""Rates of a state do not depend on the state before, also where JSBSim tells a property a frame late."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from finback.errors import RefusedError
from finback.flight.airborne import Airborne
from finback.flight.aircraft import Aircraft
from finback.flight.plan import FlightOptions
from finback.flight.power import FixedThrust
from finback.flight.rig import Rig
from finback.flight.state import FlightState
from finback.flight.steady import linearized
from finback.records import Condition
from finback.units import from_si

Writer = Callable[..., Aircraft]

LATE = "aero/alphadot-rad_sec"
FLAPERON = "<product><value>0.1</value><property>fcs/flaperon-rad</property></product>"
ROUNDING = 1e-13  # relative, of sums of some ten numbers
STATE, OTHER = (0.1, 0.2, -0.1), (-0.2, -1.0, 0.2)  # alpha, q, elevator


def options(fidelity: str) -> FlightOptions:
    """Return wide limits for a fidelity."""
    return FlightOptions(
        fidelity=fidelity,
        alpha_limits_rad=(-0.6, 0.85),
        elevator_limits_rad=(-0.5, 0.5),
        elevator_rate_rad_s=1.0,
    )


def late_lift(coefficient: float) -> dict[str, str]:
    """Return a change that adds a multiple of JSBSim's late rate of alpha to the lift coefficient."""
    return {FLAPERON: f"{FLAPERON}<product><value>{coefficient}</value><p>{LATE}</p></product>"}


@pytest.mark.parametrize("coefficient", [2.0, -2.0])
def test_rates_solve_for_a_late_rate_of_alpha(coefficient: float, write_mini: Writer, condition: Condition) -> None:
    with Rig(write_mini(name="prompt"), condition, step_s=1 / 400) as rig:
        prompt = rig.derivatives(*STATE)
    with Rig(write_mini(late_lift(coefficient)), condition, step_s=1 / 400) as rig:
        assert rig.provenance["frame_late"] == LATE
        found = rig.derivatives(*STATE)
        rig.derivatives(*OTHER)
        assert rig.derivatives(*STATE) == pytest.approx(found, rel=ROUNDING)
        pressure, area, mass = rig._simulator.read(("aero/qbar-psf", "metrics/Sw-sqft", "inertia/mass-slugs")).values()
        late = pressure * area * coefficient / (mass * from_si(condition.airspeed_m_s, "ft_s"))
    # m V dalpha/dt = what it is without, less the lift by dalpha/dt
    assert found[0] * (1.0 + late) == pytest.approx(prompt[0], rel=ROUNDING)
    assert abs(late) > 0.1


def test_linear_models_know_the_late_rate_of_alpha(write_mini: Writer, condition: Condition) -> None:
    state = np.array([condition.airspeed_m_s, 0.08, 0.05, 0.1])

    def model(vehicle: Airborne) -> np.ndarray:
        return linearized(vehicle, state=state, elevator_rad=-0.05, thrust_n=5000.0).A

    with Airborne(write_mini(name="prompt"), condition, options("symmetric")) as vehicle:
        prompt = model(vehicle)
    with Airborne(write_mini(late_lift(2.0)), condition, options("symmetric")) as vehicle:
        late = model(vehicle)
        pressure, area, mass = vehicle._simulator.read(
            ("aero/qbar-psf", "metrics/Sw-sqft", "inertia/mass-slugs")
        ).values()
        share = pressure * area * 2.0 / (mass * from_si(condition.airspeed_m_s, "ft_s"))
    # By alpha, q and pitch angle: m V dalpha/dt is what it is without, less the lift by dalpha/dt.
    np.testing.assert_allclose(late[1, 1:] * (1.0 + share), prompt[1, 1:], rtol=1e-7, atol=1e-7)


def test_a_late_property_that_feeds_on_itself_is_refused(write_mini: Writer, condition: Condition) -> None:
    with (
        Rig(write_mini(late_lift(20.0)), condition, step_s=1 / 400) as rig,
        pytest.raises(RefusedError, match=f"mini: '{LATE}' does not settle"),
    ):
        rig.derivatives(*STATE)


def test_a_flight_control_that_reads_the_air_is_that_of_the_state(write_mini: Writer, condition: Condition) -> None:
    # JSBSim runs the flight control before it knows alpha.
    flap = {"<value>0.125</value>": "<p>aero/alpha-rad</p>"}
    state = FlightState(airspeed_m_s=295.0, alpha_rad=0.1, theta_rad=0.1, altitude_m=condition.altitude_m)
    other = FlightState(airspeed_m_s=250.0, alpha_rad=0.5, theta_rad=0.1, altitude_m=condition.altitude_m)
    power = FixedThrust(thrust_n=5000.0)
    with Airborne(write_mini(flap), condition, options("free")) as vehicle:
        first = vehicle.rates(state, -0.05, power)
        vehicle.rates(other, -0.05, power)
        assert vehicle.rates(state, -0.05, power) == pytest.approx(first, rel=ROUNDING, abs=1e-15)
        assert vehicle._simulator.read(["fcs/flaperon-rad"])["fcs/flaperon-rad"] == pytest.approx(0.1, rel=ROUNDING)


def test_rates_forget_what_a_flight_control_has_integrated(f16: Aircraft, condition: Condition) -> None:
    state = FlightState(airspeed_m_s=200.0, alpha_rad=0.08, theta_rad=0.1, altitude_m=6000.0)
    other = FlightState(airspeed_m_s=160.0, alpha_rad=0.4, q_rad_s=0.3, theta_rad=0.1, altitude_m=6000.0)
    power = FixedThrust(thrust_n=5000.0)
    with Airborne(f16, condition, options("free")) as vehicle:
        first = vehicle.rates(state, -0.05, power)
        vehicle.rates(other, 0.1, power)
        assert vehicle.rates(state, -0.05, power) == pytest.approx(first, rel=ROUNDING, abs=1e-15)


def test_nothing_late_is_evaluated_once(write_mini: Writer, condition: Condition) -> None:
    with Rig(write_mini(), condition, step_s=1 / 400) as rig:
        assert rig._simulator.evaluate == rig._simulator._fdm.run_ic
