"""Time stamps that tremble: instants of the samples, or noise; each against samples whose instants are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from finback.arrays import FloatArray
from finback.dynamics.trajectory import free_run
from finback.identification.clock import Evidence, clock_of, evidence_of
from finback.identification.identify import identify
from finback.identification.options import IdentificationOptions
from finback.identification.preparation import PreparationOptions, prepare_all
from finback.identification.uniform import uniform
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.store.model_file import read_model_file

ROWS, INTERVAL_S = 1200, 0.01
TICKS_S = INTERVAL_S * np.arange(ROWS)
NOISE = 1e-3
STEPS = ((2.0, 1.0), (3.5, -2.0), (4.5, 2.0), (5.0, -1.0), (7.0, 1.5), (9.0, -1.5))
"""Time in s, change of the held elevator."""


def _record(*, hold: Hold = Hold.ZOH, **columns: FloatArray) -> FlightRecord:
    return FlightRecord(
        name="it",
        columns=columns,
        outcome=Outcome.COMPLETED,
        note="",
        condition=Condition(airspeed_m_s=100.0, density_kg_m3=1.0, gravity_m_s2=9.8, altitude_m=0.0),
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1)),
        hold=hold,
    )


def _stamps(seed: int, tremble: float = 0.2) -> FloatArray:
    return TICKS_S + INTERVAL_S * tremble * np.random.default_rng(seed).uniform(-1.0, 1.0, ROWS)


def _turning(time: FloatArray, steps: list[tuple[float, float]]) -> FloatArray:
    """Return the pitch rate of q' = δ − 2 q, by its closed form, so at any times."""
    return sum((0.25 * size * -np.expm1(-2.0 * np.maximum(time - at, 0.0)) for at, size in steps), np.zeros_like(time))


def _held(time: FloatArray, steps: list[tuple[float, float]]) -> FloatArray:
    return sum((0.5 * size * (time >= at) for at, size in steps), np.zeros_like(time))


def _noise(seed: int) -> FloatArray:
    return NOISE * np.random.default_rng([seed, 1]).standard_normal(ROWS)


def test_samples_at_their_stamps_are_moved_and_keep_their_noise() -> None:
    """Moved, they are the motion at the ticks and their own noise: as large, as white. Interpolated: a tenth less."""
    left = []
    for seed in range(5):
        stamps = _stamps(seed)
        q = 0.2 * np.sin(4.0 * stamps) + _noise(seed)
        found, said = uniform(_record(time_s=stamps, q_rad_s=q))
        assert "instants of samples" in said[0]
        left.append(found["q_rad_s"] - 0.2 * np.sin(4.0 * found["time_s"]))
        assert np.abs(found["time_s"] - TICKS_S).max() < 0.03 * INTERVAL_S
    errors = np.concatenate(left)
    # 0.2 · 4 · 0.01 · 0.115 = 0.9 of the noise is what trembling had made.
    assert 0.95 * NOISE < errors.std() < 1.05 * NOISE
    assert abs(errors[1:] @ errors[:-1]) / (errors @ errors) < 3.0 / np.sqrt(errors.size)


def test_samples_at_ticks_stay_as_they_are() -> None:
    stamps, q = _stamps(0), 0.2 * np.sin(4.0 * TICKS_S) + _noise(0)
    elevator = _held(TICKS_S, list(STEPS))
    found, said = uniform(_record(time_s=stamps, q_rad_s=q, elevator_rad=elevator))
    np.testing.assert_array_equal(found["q_rad_s"], q)
    np.testing.assert_array_equal(found["elevator_rad"], elevator)
    assert "are noise" in said[0]


def test_what_cannot_be_told_stays_as_it_is_and_is_said() -> None:
    q = _noise(3)
    found, said = uniform(_record(time_s=_stamps(3), q_rad_s=q))
    np.testing.assert_array_equal(found["q_rad_s"], q)
    assert "nothing tells" in said[0] or "hardly to be told" in said[0]


def test_the_verdict_has_an_honest_error() -> None:
    """In units of it, over 100 records of either kind."""
    off = []
    for seed in range(200):
        stamps, truth = _stamps(seed), seed % 2
        q = 0.05 * np.sin(3.0 * (TICKS_S + truth * (stamps - TICKS_S))) + _noise(seed)
        found = evidence_of([_record(time_s=stamps, q_rad_s=q)])
        off.append((found.slope - truth) / found.slope_error)
    assert 0.8 < float(np.std(off)) < 1.2
    assert abs(float(np.mean(off))) < 3.0 / np.sqrt(len(off))


def test_a_held_elevator_that_steps_at_stamps_keeps_its_integral() -> None:
    stamps = _stamps(5)
    steps = [(float(stamps[np.searchsorted(TICKS_S, at - 1e-9)]), size) for at, size in STEPS]
    record = _record(time_s=stamps, q_rad_s=_turning(stamps, steps) + _noise(5), elevator_rad=_held(stamps, steps))
    found, said = uniform(record, evidence=(Evidence(slope=1.0, slope_error=0.1, lead_error=0.1, odds=-10.0),))
    grid, elevator = found["time_s"], found["elevator_rad"]
    assert "instants of samples" in said[0]
    area = np.concatenate([[0.0], np.cumsum(elevator)[:-1]]) * (grid[1] - grid[0])
    exact = sum((0.5 * size * np.maximum(grid - at, 0.0) for at, size in steps), np.zeros_like(grid))
    whole = np.minimum.reduce([np.abs(grid - at) for at, _ in steps]) > INTERVAL_S
    assert np.abs(area - exact)[whole].max() < 1e-12


def test_an_elevator_that_stepped_before_its_samples_is_unknown_there() -> None:
    """Steps of another clock come at any time between two samples; by q this is seen."""
    stamps, random = _stamps(7), np.random.default_rng(8)
    steps = [(at + INTERVAL_S * float(random.uniform(0.0, 1.0)), size) for at, size in STEPS]
    record = _record(time_s=stamps, q_rad_s=_turning(stamps, steps) + _noise(7), elevator_rad=_held(stamps, steps))
    found, said = uniform(record)
    missing = np.flatnonzero(np.isnan(found["elevator_rad"]))
    assert len(STEPS) <= missing.size <= 2 * len(STEPS)
    for at, _ in steps:  # no interval in which a step came is used
        row = int((at - found["time_s"][0]) / INTERVAL_S)
        assert {row, row + 1} & set(missing.tolist())
    assert any("at its steps" in line for line in said)


def test_steps_at_their_samples_are_mostly_seen_to_be_there() -> None:
    """Not always: rows that are left out without need make intervals wider, steps in the wrong place wrong."""
    kept = 0
    for seed in range(20):
        stamps = _stamps(seed)
        steps = [(float(stamps[np.searchsorted(TICKS_S, at - 1e-9)]), size) for at, size in STEPS]
        columns = {"q_rad_s": 2.0 * _turning(stamps, steps) + _noise(seed), "elevator_rad": _held(stamps, steps)}
        kept += not evidence_of([_record(time_s=stamps, **columns)]).steps_before
    assert kept > 10


@pytest.mark.parametrize("tremble", [0.05, 0.1, 0.2])
def test_a_clock_is_found_behind_lost_rows(tremble: float) -> None:
    stamps = _stamps(2, tremble)
    kept = np.random.default_rng(1).random(ROWS) > 0.1
    kept[0] = True
    (clock,) = clock_of(stamps[kept])
    np.testing.assert_array_equal(clock.rows, np.flatnonzero(kept))
    assert abs(clock.interval_s / INTERVAL_S - 1.0) < 1e-4
    assert clock_of(np.sort(np.random.default_rng(1).uniform(0.0, 12.0, ROWS))) == ()


def _flights(seed: int) -> list[FlightRecord]:
    truth = read_model_file(Path("aircraft/f8ii/published.toml")).model()
    time = 0.01 * np.arange(1001)
    pulse = np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[
        np.searchsorted(1.0 + 0.7 * np.array([0, 3, 5, 6, 7]), time + 1e-9, side="right")
    ]
    flights = []
    for number, (trim, alpha, amplitude) in enumerate(((-3.5, 2.0, 3.0), (-16.0, 9.0, 3.0))):
        elevator = np.radians(trim + amplitude * pulse)
        state = free_run(
            truth, time_s=time, elevator_rad=elevator, hold="zoh", alpha_rad=float(np.radians(alpha)), q_rad_s=0.0
        )
        state = state + np.radians(0.1) * np.random.default_rng([seed, number]).standard_normal(state.shape)
        record = _record(time_s=time, alpha_rad=state[:, 0], q_rad_s=state[:, 1], elevator_rad=elevator)
        flights.append(replace(record, name=f"flight {number}"))
    return flights


def _estimate(records: list[FlightRecord]) -> tuple[FloatArray, FloatArray]:
    options = IdentificationOptions(alpha_window_rad=(-0.2, 0.5))
    model = identify(Sweep(study="s", records=tuple(records), provenance={}), options).model
    return model.coefficients, np.sqrt(np.diag(model.covariance))


@pytest.mark.parametrize("stamps", ["exact", "rounded", "trembling"])
def test_preparing_a_clean_record_moves_no_estimate(stamps: str) -> None:
    """By a tenth of a standard error at most, also where its stamps have few digits or are noise."""
    records = _flights(1)
    expected, error = _estimate(records)
    random = np.random.default_rng(0)
    for k, record in enumerate(records):
        time = record["time_s"]
        by = {"exact": 0.0 * time, "rounded": time.round(4) + 3.3e-5 - time, "trembling": None}[stamps]
        written = time + (2e-3 * random.uniform(-1.0, 1.0, time.size) if by is None else by)
        records[k] = record.with_columns(time_s=written)
    prepared = [item.record for item in prepare_all(records, PreparationOptions())]
    found, _ = _estimate(prepared)
    assert np.abs((found - expected) / error).max() < 0.1
