"""Gusts that turn a slow aircraft's alpha by a degree: they are seen, and intervals hold what they do to estimates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from finback.arrays import FloatArray
from finback.errors import RefusedError
from finback.identification import rough_air
from finback.identification.identify import Identification, identify
from finback.identification.method import Method
from finback.identification.options import IdentificationOptions
from finback.identification.suspicions import fluctuation
from finback.identification.suspicions.finding import Suspect, Suspicion
from finback.identification.suspicions.motion import Motion
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.units import to_si

INTERVAL_S, SAMPLES = 0.04, 500
SPEED_M_S, SCALE_M, GUST_M_S = 30.0, 150.0, 0.5
NOISE = to_si(np.array([0.2, 0.3]), "deg")
# dα/dt and dq/dt of a glider by alpha, q, elevator.
RATES = np.array([[-2.4, 0.97, -0.2], [-9.0, -4.2, -14.0]])
TRUTH = np.array([0.0, 0.97, -2.4, -0.2, 0.0, -4.2, -9.0, -14.0])
OPTIONS = IdentificationOptions(alpha_window_rad=(-1.0, 1.0), alpha_order=(1, 1), half_width_s=0.32)
WIDENED = "use method filter-error"
STEPS = ((3, -2, 1, -1), (1, -1, 1, -1, 2, -2), (-3, 2, -1, 1))


def _elevator(steps: Sequence[int]) -> FloatArray:
    time = INTERVAL_S * np.arange(SAMPLES)
    elevator = np.zeros(SAMPLES)
    for start, unit, size in ((2.0, 0.5, 3.0), (11.0, 0.3, -2.4)):
        at = start
        for step in steps:
            here = (time >= at - 1e-9) & (time < at + abs(step) * unit - 1e-9)
            elevator[here] += np.sign(step) * to_si(size, "deg")
            at += abs(step) * unit
    return elevator


def _flight(random: np.random.Generator, steps: Sequence[int], gust_m_s: float) -> FlightRecord:
    """Fly in Dryden's vertical gusts (MIL-F-8785C), which move alpha as lift and moment feel it."""
    rate = SPEED_M_S / SCALE_M
    whole = np.zeros((5, 5))  # alpha and q as they move, two states of the gust, elevator; the gust moves no path
    gust = gust_m_s / SPEED_M_S * np.array([rate**1.5, np.sqrt(3.0 * rate)])
    whole[:2, :2], whole[:2, 4] = RATES[:, :2], RATES[:, 2]
    whole[:2, 2:4] = RATES[:, :1] * gust
    whole[2:4, 2:4] = [[0.0, 1.0], [-rate * rate, -2.0 * rate]]
    parts = 4
    move = expm(INTERVAL_S / parts * whole)
    state, elevator = np.zeros(5), _elevator(steps)
    state[2:4] = random.standard_normal(2) * [np.sqrt(0.25 / rate**3), np.sqrt(0.25 / rate)]
    rows = np.empty((SAMPLES, 2))
    for i in range(SAMPLES):
        rows[i] = state[0] + gust @ state[2:4], state[1]
        state[4] = elevator[i]
        for _ in range(parts):
            state = move @ state
            state[3] += np.sqrt(INTERVAL_S / parts) * random.standard_normal()
    rows += NOISE * random.standard_normal(rows.shape)
    columns = {"time_s": INTERVAL_S * np.arange(SAMPLES), "alpha_rad": rows[:, 0], "q_rad_s": rows[:, 1]}
    return FlightRecord(
        name="-".join(map(str, steps)),
        condition=Condition(airspeed_m_s=SPEED_M_S, density_kg_m3=1.2, gravity_m_s2=9.81, altitude_m=300.0),
        hold=Hold.ZOH,
        columns={**columns, "elevator_rad": elevator},
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1)),
        outcome=Outcome.COMPLETED,
        note="",
    )


def _found(seed: int, method: Method, gust_m_s: float = GUST_M_S) -> Identification:
    random = np.random.default_rng(seed)
    records = tuple(_flight(random, steps, gust_m_s) for steps in STEPS)
    return identify(Sweep(study="glider", records=records), replace(OPTIONS, method=method))


def _estimates(found: Identification) -> FloatArray:
    coefficients = [
        part.coefficient(**powers)
        for part in (found.model.alpha_dot, found.model.q_dot)
        for powers in ({}, {"q_rad_s": 1}, {"alpha_rad": 1}, {"elevator_rad": 1})
    ]
    return np.array(coefficients)


def _air(found: Identification) -> Suspicion:
    return next(one for one in found.suspicions if one.suspect is Suspect.TURBULENCE)


def test_gusts_of_a_degree_are_seen_and_calm_air_is_calm() -> None:
    calm, rough = (_found(0, Method.WEAK_FORM, gust) for gust in (0.0, GUST_M_S))
    assert _air(rough).raised
    assert _air(calm).judged
    assert not _air(calm).raised
    assert not any(WIDENED in said for said in calm.warnings)


@pytest.mark.parametrize("method", [Method.WEAK_FORM, pytest.param(Method.OUTPUT_ERROR, marks=pytest.mark.slow)])
def test_intervals_in_gusts_hold_the_truth_and_say_that_they_were_widened(method: Method) -> None:
    found = [_found(seed, method) for seed in range(2)]
    assert all(_air(one).raised or not _air(one).judged for one in found)
    assert all(any(WIDENED in said for said in one.warnings) for one in found)
    scores = np.array([(_estimates(one) - TRUTH) / one.standard_errors for one in found])
    # 16 normal scores: of the weak form's, 0.52 lay within 1.96 where gusts were taken for noise of their own.
    assert np.mean(np.abs(scores) < 1.96) > 0.85


def test_where_filter_error_refuses_intervals_are_said_to_be_too_narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise RefusedError("the filter diverged")

    monkeypatch.setattr(rough_air, "estimated", refuse)
    assert any("too narrow" in said and "diverged" in said for said in _found(0, Method.WEAK_FORM).warnings)


@pytest.mark.parametrize("cause", list(fluctuation.Fluctuation))
def test_a_filter_of_fast_divergent_motion_keeps_its_covariance(cause: fluctuation.Fluctuation) -> None:
    random = np.random.default_rng(0)
    rows = 400
    slopes = np.tile(np.array([[2.6, 0.6], [0.05, 0.9]]), (rows, 1, 1))  # of a curve fitted to gusts at its end
    found = fluctuation.likelihood(
        Motion(
            measured=1e-3 * random.standard_normal((rows, 2)),
            drive=np.zeros((rows, 2)),
            transition=slopes,
            activity=np.ones((rows, 2)),
            fresh=np.arange(rows) == 0,
            interval_s=0.04,
            variance=np.full(2, 1e-6),
        ),
        cause,
    )
    assert np.isfinite(found.cost)
