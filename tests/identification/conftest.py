"""Flights of a known polynomial model, integrated by Runge and Kutta's rule: the truth is exact."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from finback.arrays import FloatArray
from finback.dynamics.model import PolynomialModel
from finback.dynamics.trajectory import free_run
from finback.identification.options import IdentificationOptions
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.store.model_file import read_model_file
from finback.units import to_si

PUBLISHED = Path(__file__).resolve().parents[2] / "aircraft" / "f8ii" / "published.toml"
INTERVAL_S = 0.01
RATE_RAD_S = to_si(60.0, "deg")
CONDITION = Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)
STILL = Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1))

# (elevator, alpha, q) in deg and deg/s at the start of free releases; three of them depart within 2 s.
RELEASES = ((-35.0, -20.0, -30.0), (-20.0, 30.0, -30.0), (-5.0, -25.0, 30.0), (-5.0, 30.0, 0.0), (10.0, -15.0, 30.0))
# (elevator, alpha, q) near equilibrium, then amplitude in deg and pulse unit in s of a 3-2-1-1.
MULTISTEPS = ((0.0, 0.246, 0.0, 8.0, 0.5), (-10.0, 5.5, 1.4, 8.0, 0.8), (4.0, -2.1, -0.6, 6.0, 0.5))


@pytest.fixture(scope="session")
def truth() -> PolynomialModel:
    """The published model of the F-8 II, explicit and in SI."""
    return read_model_file(PUBLISHED).model()


@pytest.fixture(scope="session")
def exact(truth: PolynomialModel) -> FloatArray:
    """The published coefficients in the order of an identified model: 1, q, alpha …, elevator, dα/dt first."""
    order = ((0, 0, 0), (0, 1, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0), (0, 0, 1))
    return np.array(
        [
            polynomial.coefficients[polynomial.powers.tolist().index(list(powers))]
            for polynomial in (truth.alpha_dot, truth.q_dot)
            for powers in order
        ]
    )


@pytest.fixture(scope="session")
def options() -> IdentificationOptions:
    """The window of the aircraft's study, short test functions."""
    return IdentificationOptions(
        alpha_window_rad=(to_si(-32.5, "deg"), to_si(45.5, "deg")), half_width_s=0.2, spacing_s=0.05
    )


def _record(
    name: str, state: FloatArray, elevator_rad: FloatArray, *, hold: Hold = Hold.FOH, interval_s: float = INTERVAL_S
) -> FlightRecord:
    """Make a record of (alpha, q), shape (n, 2), and elevator, shape (n,)."""
    columns = {
        "time_s": interval_s * np.arange(len(state)),
        "alpha_rad": state[:, 0],
        "q_rad_s": state[:, 1],
        "elevator_rad": elevator_rad,
    }
    return FlightRecord(
        name=name,
        columns=columns,
        outcome=Outcome.COMPLETED,
        note="",
        condition=CONDITION,
        schedule=STILL,
        hold=hold,
    )


def _fly(
    model: PolynomialModel,
    name: str,
    start: tuple[float, float, float],
    elevator_rad: FloatArray,
    hold: Hold = Hold.FOH,
) -> FlightRecord:
    """Integrate a model from (elevator, alpha, q) in deg until alpha leaves -33...46 deg."""
    time = INTERVAL_S * np.arange(elevator_rad.size)
    state = free_run(
        model,
        time_s=time,
        elevator_rad=elevator_rad,
        hold="zoh" if hold is Hold.ZOH else "foh",
        alpha_rad=to_si(start[1], "deg"),
        q_rad_s=to_si(start[2], "deg_s"),
    )
    inside = (state[:, 0] >= to_si(-33.0, "deg")) & (state[:, 0] <= to_si(46.0, "deg"))
    end = elevator_rad.size if inside.all() else int(np.argmin(inside))
    return _record(name, state[:end], elevator_rad[:end], hold=hold)


def _multistep(elevator_deg: float, amplitude_deg: float, unit_s: float, duration_s: float, hold: Hold) -> FloatArray:
    """Sample a 3-2-1-1: straight at 60 deg/s with corners on samples, or held jumps."""
    starts = 0.5 + unit_s * np.cumsum([0, 3, 2, 1, 1])
    levels = elevator_deg + amplitude_deg * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])
    time = INTERVAL_S * np.arange(round(duration_s / INTERVAL_S) + 1)
    if hold is Hold.ZOH:
        return to_si(levels[np.searchsorted(starts, time + 1e-9, side="right")], "deg")
    moving = np.ceil(np.abs(np.diff(to_si(levels, "deg"))) / RATE_RAD_S / INTERVAL_S) * INTERVAL_S
    knots = np.stack([starts, starts + moving], axis=1).ravel()
    return to_si(np.interp(time, knots, np.stack([levels[:-1], levels[1:]], axis=1).ravel()), "deg")


@pytest.fixture(scope="session")
def flights(truth: PolynomialModel) -> Callable[..., tuple[FlightRecord, ...]]:
    """Noise-free flights of a model (the published one unless another is given) under a hold of the elevator."""

    def make(model: PolynomialModel = truth, hold: Hold = Hold.FOH) -> tuple[FlightRecord, ...]:
        steps = [
            _fly(model, f"multistep-{i}", start, _multistep(start[0], amplitude, unit, 8.0, hold), hold)
            for i, (*start, amplitude, unit) in enumerate(MULTISTEPS)  # type: ignore[misc]
        ]
        free = [
            _fly(model, f"release-{i}", start, np.full(501, to_si(start[0], "deg")), hold)
            for i, start in enumerate(RELEASES)
        ]
        return (*steps, *free)

    return make


@pytest.fixture(scope="session")
def clean(flights: Callable[..., tuple[FlightRecord, ...]]) -> Sweep:
    """All flights of the published model, without noise."""
    return Sweep(study="clean", records=flights())


@pytest.fixture(scope="session")
def noisy() -> Callable[..., Sweep]:
    """Add white noise (standard deviations in deg and deg/s) to alpha and q of every flight."""
    return _noisy


@pytest.fixture(scope="session")
def make_record() -> Callable[..., FlightRecord]:
    """Make a record of a name, (alpha, q) of shape (n, 2), and elevator of shape (n,)."""
    return _record


def _noisy(sweep: Sweep, *, alpha_deg: float, q_deg_s: float, seed: int) -> Sweep:
    random = np.random.default_rng(seed)
    records = tuple(
        flight.with_columns(
            alpha_rad=flight["alpha_rad"] + to_si(alpha_deg, "deg") * random.standard_normal(len(flight)),
            q_rad_s=flight["q_rad_s"] + to_si(q_deg_s, "deg_s") * random.standard_normal(len(flight)),
        )
        for flight in sweep.records
    )
    return Sweep(study=sweep.study, records=records)
