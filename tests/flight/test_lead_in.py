"""Starts with a past: as good as the steps that follow, exactly where asked, and nothing where nothing moves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.flight import airborne, rig as rig_module
from finback.flight.airborne import Airborne
from finback.flight.aircraft import Aircraft, find_aircraft
from finback.flight.equilibrium import trim
from finback.flight.lead_in import STEPS, lead_in
from finback.flight.plan import FlightOptions, FlightPlan
from finback.flight.power import FixedThrust
from finback.flight.reference import Reference, reference
from finback.flight.rig import Rig
from finback.flight.start import FreeStart
from finback.flight.vehicle import Vehicle
from finback.records import Condition
from finback.store.export.jsbsim_aircraft import Airframe, jsbsim_aircraft
from finback.store.model_file import read_model_file
from finback.units import to_si

MakePlan = Callable[..., FlightPlan]
Field = Callable[[FloatArray], FloatArray]

ROOT = Path(__file__).resolve().parents[2]
STEP_S = 1 / 400
WIDE = FlightOptions(
    fidelity="symmetric",
    alpha_limits_rad=(-0.6, 0.85),
    elevator_limits_rad=(-0.7, 0.35),
    elevator_rate_rad_s=1.0,
)
SMOOTH_RAD = 1e-5
"""Required of smooth flights over 10 s at the default step; the starts below leave up to 2e-5 without a past."""
RELEASED_RAD = 2e-7
"""What such a flight errs by with one, five times over: its fourth order is all that is left."""
EXACT = 1e-12
"""rad, rad/s and shares of airspeed: what a start may miss by."""
WEIGHTS = np.array([55.0, -59.0, 37.0, -9.0]) / 24.0  # Adams-Bashforth of fourth order (Hairer, Nørsett, Wanner, III.1)
RELEASES_DEG = [(-3.0, -56.0, 2.0), (28.0, 52.0, -3.0), (36.0, -50.0, 9.0)]
"""alpha, q, elevator."""


@pytest.fixture(scope="module")
def smooth(tmp_path_factory: pytest.TempPathFactory) -> Aircraft:
    """Return the published polynomials of the F-8 II as an aircraft: it has no tables."""
    file = tmp_path_factory.mktemp("smooth") / "smooth" / "smooth.xml"
    file.parent.mkdir()
    model = read_model_file(ROOT / "aircraft" / "f8ii" / "published.toml").model()
    condition = Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)
    text = jsbsim_aircraft(model, name="smooth", condition=condition, airframe=Airframe(), source="published")
    file.write_text(text, encoding="utf-8")
    return find_aircraft(str(file), near=file.parent)


def _error(vehicle: Vehicle, plan: FlightPlan) -> float:
    found = reference(vehicle.motion(plan), vehicle.fly(plan))
    assert isinstance(found, Reference)
    assert not found.corners
    assert found.uncertainty_rad < 0.1 * RELEASED_RAD
    return found.alpha_error_rad


def _released(make_plan: MakePlan, alpha_deg: float, q_deg_s: float, elevator_deg: float, **more: object) -> FlightPlan:
    alpha, q, elevator = to_si(np.array([alpha_deg, q_deg_s, elevator_deg]), "deg").tolist()
    return make_plan((0.0, elevator), alpha=alpha, q=q, duration=10.0, **more)


# Against another integrator


@pytest.mark.parametrize("fidelity", ["rig", "symmetric"])
def test_a_violent_release_of_a_smooth_aircraft_is_as_good_as_required(
    fidelity: str, smooth: Aircraft, condition: Condition, make_plan: MakePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    on_rig = fidelity == "rig"
    more = {} if on_rig else {"power": FixedThrust(thrust_n=25900.0)}
    plans = [_released(make_plan, *start, **more) for start in RELEASES_DEG]
    vehicle = Rig(smooth, condition, step_s=STEP_S) if on_rig else Airborne(smooth, condition, WIDE)
    with vehicle:
        with_past = [_error(vehicle, plan) for plan in plans]
        for module in (rig_module, airborne):
            monkeypatch.setattr(module, "lead_in", lambda *_, **__: False)
        without = [_error(vehicle, plan) for plan in plans]
    assert max(with_past) < RELEASED_RAD
    assert max(without) > SMOOTH_RAD


# Where it begins


@pytest.mark.parametrize(
    "name", ["f8ii_rig", "f16_rig", "f8ii_symmetric", "f16_symmetric", "f8ii_direct", "f16_direct"]
)
def test_a_violent_start_is_where_it_says_with_a_past(
    name: str, request: pytest.FixtureRequest, make_plan: MakePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    came = _counted(monkeypatch)
    vehicle: Vehicle = request.getfixturevalue(name)
    for alpha, q, elevator in RELEASES_DEG:
        record = vehicle.fly(
            _released(make_plan, alpha, q, elevator, sample_interval_s=STEP_S, alpha_limits_rad=(-3.0, 3.0))
        )
        first = {column: float(values[0]) for column, values in record.columns.items()}
        assert first["time_s"] == 0.0
        assert first["alpha_rad"] == pytest.approx(to_si(alpha, "deg"), abs=EXACT)
        assert first["theta_rad"] == pytest.approx(to_si(alpha, "deg"), abs=EXACT)
        assert first["q_rad_s"] == pytest.approx(to_si(q, "deg_s"), abs=EXACT)
        assert first["airspeed_m_s"] == pytest.approx(295.07, rel=EXACT)
    assert came == [True] * len(RELEASES_DEG)


@pytest.mark.parametrize(
    ("phi_deg", "psi_deg", "theta_deg"), [(0.0, 180.0, 0.0), (180.0, 0.0, 30.0), (-90.0, 359.9, -80.0)]
)
def test_a_start_in_any_attitude_has_a_past(
    phi_deg: float, psi_deg: float, theta_deg: float, f8ii_direct: Airborne, make_plan: MakePlan,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Where JSBSim's angles jump by a turn, and the quaternion of an attitude by its sign."""
    came = _counted(monkeypatch)
    phi, psi, theta = to_si(np.array([phi_deg, psi_deg, theta_deg]), "deg").tolist()
    start = FreeStart(theta_rad=theta, airspeed_m_s=250.0, altitude_m=8000.0, phi_rad=phi, psi_rad=psi, p_rad_s=0.5)
    record = f8ii_direct.fly(make_plan((0.0, -0.1), alpha=0.3, q=-0.4, duration=0.1, start=start))
    assert came == [True]
    assert (record["alpha_rad"][0], record["q_rad_s"][0], record["p_rad_s"][0]) == pytest.approx(
        (0.3, -0.4, 0.5), abs=EXACT
    )


def _counted(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Return a list that each start will tell whether it came with a past."""
    came: list[bool] = []

    def told(*given: Any, step_s: float) -> bool:
        came.append(lead_in(*given, step_s=step_s))
        return came[-1]

    for module in (rig_module, airborne):
        monkeypatch.setattr(module, "lead_in", told)
    return came


# Where nothing moves


def test_a_flight_from_a_trim_has_the_bytes_that_it_has_without_a_past(
    f8ii_rig: Rig, make_plan: MakePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = trim(f8ii_rig.derivatives, elevator_rad=-0.09, alpha_limits_rad=(-0.56, 0.79))
    plan = make_plan((0.0, -0.09), (0.5, -0.09), (0.7, -0.2), alpha=found.alpha_rad, q=found.q_rad_s, duration=3.0)
    came = _counted(monkeypatch)
    one = f8ii_rig.fly(plan)
    assert came == [False]
    monkeypatch.setattr(rig_module, "lead_in", lambda *_, **__: False)
    other = f8ii_rig.fly(plan)
    for name, values in one.columns.items():
        assert values.tobytes() == other[name].tobytes(), name


# The method itself, on a pendulum


def _pendulum(state: FloatArray) -> FloatArray:
    return np.array([state[1], -9.0 * np.sin(state[0]) - 0.4 * state[1]])


def _slopes(field: Field, state: FloatArray) -> list[FloatArray]:
    return [field(state)] * 4


def _step(field: Field, state: FloatArray, slopes: list[FloatArray], step_s: float) -> FloatArray:
    """Make a step as JSBSim does: the newest slope first, all of them the first one at the start."""
    slopes[:] = [field(state), *slopes[:3]]
    return state + step_s * (WEIGHTS @ np.array(slopes))


def _flown(start: FloatArray, steps: int, step_s: float, *, with_past: bool) -> FloatArray:
    slopes = _slopes(_pendulum, start)
    state = start

    def flown(begin: FloatArray) -> FloatArray:
        nonlocal state
        state, slopes[:] = begin, _slopes(_pendulum, begin)
        for _ in range(STEPS):
            state = _step(_pendulum, state, slopes, step_s)
        return state

    if with_past:
        assert lead_in(start, _pendulum, flown, step_s=step_s)
        np.testing.assert_allclose(state, start, rtol=0.0, atol=EXACT)
    for _ in range(steps):
        state = _step(_pendulum, state, slopes, step_s)
    return state


@pytest.mark.parametrize("start", [(1.0, 3.0), (-2.0, 0.0), (0.5, -4.0)])
def test_with_a_past_a_flight_has_the_order_of_its_method(start: tuple[float, float]) -> None:
    exact = solve_ivp(lambda _, x: _pendulum(x), (0.0, 1.0), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    for with_past, order in ((True, 4), (False, 2)):
        coarse, fine = (
            np.linalg.norm(_flown(np.array(start), steps, 1.0 / steps, with_past=with_past) - exact)
            for steps in (400, 800)
        )
        assert np.log2(coarse / fine) == pytest.approx(order, abs=0.2)


def test_a_state_at_rest_is_not_flown() -> None:
    def never(_: FloatArray) -> FloatArray:
        raise AssertionError

    assert not lead_in(np.zeros(2), _pendulum, never, step_s=STEP_S)


def test_a_motion_that_does_not_go_back_has_no_past() -> None:
    """Rates that are not there, steps that lead nowhere, steps that lead elsewhere however they begin."""
    start = np.array([1.0, 1.0])
    assert not lead_in(start, lambda x: np.where(x == start, -x, np.nan), lambda x: x, step_s=STEP_S)
    assert not lead_in(start, lambda x: -x, lambda x: np.full_like(x, np.nan), step_s=STEP_S)
    assert not lead_in(start, lambda x: -x, lambda _: start + 0.1, step_s=STEP_S)
