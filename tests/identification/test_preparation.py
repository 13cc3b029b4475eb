"""Records made fit for estimation: outliers, time base, sensor places, kinematics; each against a known truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray
from finback.errors import RefusedError
from finback.identification.coloring import corrected_covariance
from finback.identification.outlier import OutlierOptions, outliers
from finback.identification.position import SensorPlaces, at_center_of_gravity
from finback.identification.preparation import PreparationOptions, prepare, prepare_all
from finback.identification.sampling import without_repeats, without_turns
from finback.identification.uniform import uniform
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule

GRAVITY = 9.80665
NOISE = {
    "alpha_rad": 2e-3, "theta_rad": 1e-3, "airspeed_m_s": 0.3, "q_rad_s": 1e-3, "ax_m_s2": 0.02, "az_m_s2": 0.05,
}  # fmt: skip


def record_of(columns: Mapping[str, FloatArray], *, hold: Hold = Hold.FOH) -> FlightRecord:
    return FlightRecord(
        name="it",
        columns=columns,
        outcome=Outcome.COMPLETED,
        note="",
        condition=Condition(airspeed_m_s=100.0, density_kg_m3=1.0, gravity_m_s2=GRAVITY, altitude_m=0.0),
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1)),
        hold=hold,
    )


def _q(time: FloatArray) -> FloatArray:
    return 0.15 * np.sin(2.0 * time) * np.exp(-0.02 * time) + 0.05 * np.sin(5.0 * time)


def _ax(time: FloatArray) -> FloatArray:
    return 0.5 + 0.8 * np.sin(0.7 * time)


def _az(time: FloatArray) -> FloatArray:
    return -GRAVITY - 6.0 * np.sin(2.0 * time - 0.4)


@pytest.fixture(scope="module")
def motion() -> object:
    def rates(time: float, state: FloatArray) -> list[float]:
        u, w, theta = state
        t = np.array(time)
        return [
            float(-_q(t) * w - GRAVITY * np.sin(theta) + _ax(t)),
            float(_q(t) * u + GRAVITY * np.cos(theta) + _az(t)),
            float(_q(t)),
        ]

    return solve_ivp(rates, (-1.0, 20.5), [100.0, 5.0, 0.05], rtol=1e-10, atol=1e-10, dense_output=True).sol


def _flight(motion: object, seed: int, faults: Mapping[str, float]) -> FlightRecord:
    """Return a flight of 20 s at 50 Hz with noise and faults of the instruments, by the names of ``compatibility``."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 0.02)

    def at(name: str) -> FloatArray:
        when = time - faults.get(f"{name} delay", faults.get("ax delay", 0.0) if name == "az" else 0.0)
        u, w, theta = motion(when)  # type: ignore[operator] # scipy's dense output
        true = {
            "alpha": np.arctan2(w, u), "theta": theta, "airspeed": np.hypot(u, w),
            "q": _q(when), "ax": _ax(when), "az": _az(when),
        }[name]  # fmt: skip
        return (1.0 + faults.get(f"{name} scale", 0.0)) * true + faults.get(f"{name} bias", 0.0)

    columns = {
        channel: at(channel.split("_")[0]) + size * random.standard_normal(time.size) for channel, size in NOISE.items()
    }
    return record_of({"time_s": time, **columns})


FAULTS = {"alpha bias": 0.01, "alpha delay": 0.04, "q bias": 2e-3, "theta delay": 0.03}


def test_colored_residuals_widen_the_bound() -> None:
    """The mean of an AR(1) sequence: its variance is σ²/n · (1 + a)/(1 − a), Morelli & Klein's case in closed form."""
    rows, memory = 4000, 0.9
    random = np.random.default_rng(0)
    ratios = []
    for _ in range(20):
        white = random.standard_normal(rows)
        colored = np.empty(rows)
        colored[0] = white[0]
        for k in range(1, rows):
            colored[k] = memory * colored[k - 1] + white[k]
        found = corrected_covariance(
            np.eye(1) / rows, [np.ones((rows, 1, 1))], [(colored - colored.mean())[:, np.newaxis]]
        )
        ratios.append(float(found[0, 0]) / (1.0 / (1.0 - memory) ** 2 / rows))
    # Residuals hold nothing of what their own regressor can do: a mean makes the corrected error 25 % too small.
    assert 0.4 < float(np.mean(ratios)) < 1.2


@given(st.integers(0, 10_000), st.floats(0.3, 5.0), st.integers(1, 4))
def test_spikes_are_found_and_motion_is_not(seed: int, frequency_rad_s: float, run: int) -> None:
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 10.0, 0.01)
    values = 0.2 * np.sin(frequency_rad_s * time) + 1e-3 * random.standard_normal(time.size)
    spoiled = values.copy()
    start = int(random.integers(20, 950))
    spoiled[start : start + run] += 0.5
    found = outliers(spoiled, OutlierOptions())
    assert found[start : start + run].all()
    assert found.sum() - run <= 3  # noise at the edges of the run
    assert outliers(values, OutlierOptions()).sum() <= 1


def test_a_still_column_has_no_outliers_in_its_last_digit() -> None:
    values = np.sin(np.linspace(0.0, 3.0, 500)).round(2) + 0.01 * (np.random.default_rng(2).random(500) < 0.1)
    assert not outliers(values, OutlierOptions()).any()


def test_a_uniform_record_stays_bit_for_bit() -> None:
    time = np.arange(100) * 0.01
    record = record_of({"time_s": time, "alpha_rad": np.sin(time), "elevator_rad": np.cos(time)})
    same, said = uniform(record)
    assert said == ()
    np.testing.assert_array_equal(same["alpha_rad"], record["alpha_rad"])


def test_unequal_and_missing_samples_are_filled_or_left() -> None:
    time = np.arange(0.0, 10.0, 0.01)
    alpha = np.sin(time)
    alpha[::2] = np.nan  # half the rate
    q = np.cos(time)
    q[300:400] = np.nan
    keep = np.random.default_rng(3).random(time.size) > 0.05
    keep[[0, -1]] = True
    elevator = np.floor(time)
    record = record_of({"time_s": time, "alpha_rad": alpha, "q_rad_s": q, "elevator_rad": elevator}, hold=Hold.ZOH)
    kept = record_of({name: values[keep] for name, values in record.columns.items()}, hold=Hold.ZOH)
    found, said = uniform(kept, interval_s=0.01, longest_gap_s=0.1)
    known = np.isfinite(found["alpha_rad"])
    # The chord of a sine over a gap of g misses it by g²/8.
    assert np.abs(found["alpha_rad"] - np.sin(found["time_s"]))[known].max() < 0.1**2 / 8.0
    assert known.mean() > 0.98
    assert np.isnan(found["q_rad_s"]).sum() == pytest.approx(100, abs=3)
    held = found["elevator_rad"][np.isfinite(found["elevator_rad"])]
    assert set(np.unique(held)) <= set(range(10))  # held, never between; unknown where its step was lost
    assert held.size > 980
    assert any("left missing" in line for line in said)


def test_a_step_of_a_held_elevator_keeps_its_row_or_is_unknown() -> None:
    """Stamps that tremble by 20 % move no step to the next row; where rows are lost, nobody knows when it came."""
    random, rows = np.random.default_rng(4), np.arange(600)
    time, elevator = 0.01 * rows, np.repeat([0.0, 0.1, -0.1, 0.0], [170, 140, 90, 200])
    stamps = time + 0.002 * random.uniform(-1.0, 1.0, rows.size)
    stamps[[0, -1]] = time[[0, -1]]
    trembling = record_of({"time_s": stamps, "elevator_rad": elevator}, hold=Hold.ZOH)
    np.testing.assert_array_equal(uniform(trembling, interval_s=0.01)[0]["elevator_rad"], elevator)
    kept = np.setdiff1d(rows, [50, 170, 309])
    lost = record_of({"time_s": time[kept], "elevator_rad": elevator[kept]}, hold=Hold.ZOH)
    found = uniform(lost, interval_s=0.01)[0]["elevator_rad"]
    assert np.flatnonzero(np.isnan(found)).tolist() == [170, 309]
    np.testing.assert_array_equal(np.delete(found, [170, 309]), np.delete(elevator, [170, 309]))


def test_a_vane_and_accelerometers_ahead_are_moved_back(motion: object) -> None:
    time = np.arange(0.0, 20.0, 0.01)
    u, w, theta = motion(time)  # type: ignore[operator] # scipy's dense output
    q, place = _q(time), np.array([6.0, 0.0, -1.0])
    q_dot = np.gradient(_q(np.arange(0.0, 20.0, 0.001)), 0.001)[::10]
    alpha = np.arctan2(w, u)
    # Rigid body: the velocity there is v + ω×r, the acceleration a + ω̇×r + ω×(ω×r).
    at_vane = np.arctan2(w - q * place[0], u + q * place[2])
    record = record_of(
        {
            "time_s": time,
            "alpha_rad": 1.1 * at_vane,
            "q_rad_s": q,
            "airspeed_m_s": np.hypot(u, w),
            "theta_rad": theta,
            "ax_m_s2": _ax(time) + q_dot * place[2] - q**2 * place[0],
            "az_m_s2": _az(time) - q_dot * place[0] - q**2 * place[2],
        }
    )
    places = SensorPlaces(vane_m=(6.0, 0.0, -1.0), vane_upwash=1.1, accelerometer_m=(6.0, 0.0, -1.0))
    moved, said = at_center_of_gravity(record, places)
    assert np.abs(moved["alpha_rad"] - alpha).max() < 1e-12
    inner = slice(10, -10)
    assert np.abs(moved["ax_m_s2"] - _ax(time))[inner].max() < 2e-3  # the parabola through 0.08 s of a 5 rad/s motion
    assert np.abs(moved["az_m_s2"] - _az(time))[inner].max() < 1.5e-2
    assert len(said) == 3
    with pytest.raises(RefusedError, match="without airspeed_m_s"):
        at_center_of_gravity(record_of({name: record[name] for name in ("time_s", "alpha_rad", "q_rad_s")}), places)


@given(
    st.tuples(*[st.floats(-5.0, 5.0)] * 3),
    st.tuples(*[st.floats(-5.0, 5.0)] * 3),
    st.tuples(*[st.floats(-1.5, 1.5)] * 3),
    st.floats(-0.2, 0.6),
    st.floats(-0.4, 0.4),
    st.booleans(),
)
def test_vanes_of_both_flow_angles_are_moved_back(
    alpha_m: tuple[float, float, float],
    beta_m: tuple[float, float, float],
    turning: tuple[float, float, float],
    alpha: float,
    beta: float,
    flank: bool,  # noqa: FBT001 - hypothesis draws it
) -> None:
    """Written down at each vane: the velocity there is v + ω×r; 50 m/s and at most 1.5 rad/s about each axis."""
    speed = 50.0
    true = speed * np.array([np.cos(beta) * np.cos(alpha), np.sin(beta), np.cos(beta) * np.sin(alpha)])
    at_alpha, at_beta = (true + np.cross(turning, place) for place in (alpha_m, beta_m))
    sideslip = np.arctan2(at_beta[1], at_beta[0] if flank else np.hypot(at_beta[0], at_beta[2]))
    row = {"alpha_rad": 1.2 * np.arctan2(at_alpha[2], at_alpha[0]), "beta_rad": 0.9 * sideslip, "airspeed_m_s": speed,
           **dict(zip(("p_rad_s", "q_rad_s", "r_rad_s"), turning, strict=True))}  # fmt: skip
    record = record_of({"time_s": np.arange(2.0), **{name: np.full(2, value) for name, value in row.items()}})
    places = SensorPlaces(
        vane_m=alpha_m, vane_upwash=1.2, beta_vane_m=beta_m, beta_vane_sidewash=0.9, beta_vane_flank=flank
    )
    moved, said = at_center_of_gravity(record, places)
    assert np.abs(moved["alpha_rad"] - alpha).max() < 1e-4
    assert np.abs(moved["beta_rad"] - beta).max() < 1e-4
    assert [line.split(":")[0] for line in said] == ["alpha_rad", "beta_rad"]
    for missing in ("r_rad_s", "alpha_rad", "beta_rad"):
        with pytest.raises(RefusedError, match=f"without {missing}"):
            at_center_of_gravity(
                record_of({name: values for name, values in record.columns.items() if name != missing}),
                replace(places, vane_m=(0.0, 0.0, 0.0), vane_upwash=1.0),
            )


def test_what_is_interpolated_of_slow_instruments_is_no_knowledge(motion: object) -> None:
    """Rates and forces at 25 Hz, flow at 10 Hz, written 50 times a second: interpolated, their noise is nearly none."""
    record = _flight(motion, 2, FAULTS)
    rows = np.arange(len(record))
    every = {"alpha_rad": 5, "airspeed_m_s": 5, "q_rad_s": 2, "ax_m_s2": 2, "az_m_s2": 2}
    slow = {name: record[name][rows // step * step] for name, step in every.items()}
    found = prepare(record.with_columns(**slow), PreparationOptions())
    (check,) = found.compatibility
    off = [(error.value - FAULTS.get(error.name, 0.0)) / error.standard_error for error in check.errors if error.known]
    assert {error.name for error in check.errors if error.known} >= {"alpha delay", "q bias", "theta delay"}
    assert np.max(np.abs(off)) < 4.0
    # What is integrated is known no better than the mean of its own samples, 20 s of them.
    assert check.error("q bias").standard_error > 0.9 * NOISE["q_rad_s"] / np.sqrt(500)
    assert np.isfinite(found.record["alpha_rad"][:990]).all()


def test_preparation_says_everything_it_did(motion: object) -> None:
    record = _flight(motion, 11, FAULTS)
    alpha = record["alpha_rad"].copy()
    alpha[500] += 1.0
    found = prepare(record.with_columns(alpha_rad=alpha), PreparationOptions(correct_instruments=True))
    assert found.statements[0].startswith("alpha_rad: 1 outliers of 1000 samples left out, the first at 10 s")
    assert any(line.startswith("alpha_rad: 1 of 1000 rows interpolated") for line in found.statements)
    assert any(line.startswith("alpha delay") and line.endswith("taken out") for line in found.statements)
    only = prepare(record, PreparationOptions())
    np.testing.assert_array_equal(only.record["alpha_rad"], record["alpha_rad"])
    assert any(line.endswith("left in") for line in only.findings)


@given(st.integers(2, 8), st.integers(0, 7), st.integers(0, 1000))
def test_a_value_that_is_written_again_is_told_from_one_that_is_rounded(repeat: int, first: int, seed: int) -> None:
    time = 0.01 * np.arange(600)
    smooth = np.sin(3.0 * time) + 0.01 * np.random.default_rng(seed).standard_normal(time.size)
    held = smooth[np.maximum((np.arange(600) - first % repeat) // repeat * repeat + first % repeat, 0)]
    record = record_of({"time_s": time, "alpha_rad": held, "theta_rad": smooth.round(2), "q_rad_s": smooth})
    found, said = without_repeats(record)
    assert len(said) == 1
    assert said[0].startswith(f"alpha_rad: one new value in {repeat} rows")
    kept = np.flatnonzero(np.isfinite(found["alpha_rad"]))
    np.testing.assert_array_equal(found["alpha_rad"][kept], smooth[kept])
    np.testing.assert_array_equal(found["theta_rad"], record["theta_rad"])


def test_an_elevator_that_is_held_is_no_slow_instrument() -> None:
    time = 0.01 * np.arange(600)
    elevator = np.random.default_rng(0).standard_normal(150)[np.arange(600) // 4]
    record = record_of({"time_s": time, "elevator_rad": elevator}, hold=Hold.ZOH)
    assert without_repeats(record)[1] == ()
    assert without_repeats(replace(record, hold=Hold.FOH))[1] != ()


def test_a_heading_through_north_has_no_jump() -> None:
    time = 0.1 * np.arange(200)
    psi = np.remainder(3.0 + 0.05 * time**2, 2.0 * np.pi)
    psi[50] = np.nan
    found, said = without_turns(record_of({"time_s": time, "psi_rad": psi}))
    assert np.nanmax(np.abs(np.diff(found["psi_rad"]))) < 0.3
    assert said[0].startswith("psi_rad: 3 jumps") or said[0].startswith("psi_rad: 4 jumps")
    assert np.isnan(found["psi_rad"][50])


def test_each_column_is_interpolated_over_three_of_its_own_samples() -> None:
    time = 0.01 * np.arange(400)
    slow = np.where(np.arange(400) % 4 == 0, np.sin(time), np.nan)
    slow[100:120] = np.nan
    found, _ = uniform(record_of({"time_s": time, "alpha_rad": slow, "q_rad_s": np.cos(time)}))
    assert np.isfinite(found["alpha_rad"][:96]).all()
    assert np.isnan(found["alpha_rad"][101:119]).all()


@pytest.mark.parametrize(
    "column",
    [
        np.zeros(1000),
        np.full(1000, np.nan),
        pytest.param(np.round(np.sin(np.arange(1000) / 50)), marks=pytest.mark.slow),
        pytest.param(np.arange(1000) * 1e-3, marks=pytest.mark.slow),
    ],
)
def test_no_column_makes_preparation_fail(motion: object, column: FloatArray) -> None:
    """Constant, missing, coarsely rounded and straight ones: statements, never an exception."""
    record = _flight(motion, 1, {})
    found = prepare(record.with_columns(alpha_rad=column), PreparationOptions(correct_instruments=True))
    assert set(found.record.columns) == set(record.columns)
    assert found.statements or found.findings


def test_flights_of_the_same_instruments_are_checked_together(motion: object) -> None:
    records = [_flight(motion, seed, FAULTS) for seed in (0, 1)]
    options = PreparationOptions(same_instruments=True, correct_instruments=True)
    both = prepare_all(records, options)
    assert both[0].compatibility == both[1].compatibility
    alone = prepare(records[0], options).compatibility[0].error("alpha delay").standard_error
    assert both[0].compatibility[0].error("alpha delay").standard_error < alone


def test_a_normal_noise_has_no_outliers() -> None:
    """At six deviations one sample in 5e8: none in 2e5 (a window of 41 samples alone found one in 1e5)."""
    assert not outliers(np.random.default_rng(5).standard_normal(200_000), OutlierOptions()).any()


@pytest.mark.parametrize("rows", [300, 300_000])
@pytest.mark.parametrize("rate_hz", [100.0, 30.0])
def test_rounded_time_stamps_are_put_right_and_nothing_is_interpolated(rows: int, rate_hz: float) -> None:
    exact = np.arange(rows) / rate_hz
    values = np.random.default_rng(0).standard_normal(rows)
    for digits in (4, 6, 15):
        found, said = uniform(record_of({"time_s": exact.round(digits), "q_rad_s": values}))
        np.testing.assert_array_equal(found["q_rad_s"], values)
        np.testing.assert_allclose(found["time_s"], exact, atol=1e-4)
        assert not any("interpolated" in line for line in said)


def test_motion_beside_a_gap_is_no_outlier() -> None:
    time = 0.02 * np.arange(1000)
    values = 0.3 * np.sin(1.5 * time) + 1e-3 * np.random.default_rng(0).standard_normal(1000)
    values[300:360] = np.nan
    assert not outliers(values, OutlierOptions()).any()
    values[::3] = np.nan  # a slower instrument has no gaps
    values[401] += 0.5
    assert np.flatnonzero(outliers(values, OutlierOptions())).tolist() == [401]


def _left_out(gap: slice, seed: int = 0) -> NDArray[np.bool_]:
    """Return the outliers of a pitch angle that drifts, of which some rows are missing altogether."""
    time = 0.02 * np.arange(601)
    values = 0.1 * np.sin(1.1 * time) + 9e-4 * np.random.default_rng(seed).standard_normal(time.size)
    kept = np.delete(np.arange(time.size), gap)
    return outliers(values[kept], OutlierOptions(), time_s=time[kept])


@pytest.mark.parametrize("gap", [slice(200, 240), slice(330, 370), slice(100, 300)])
def test_rows_that_are_missing_make_no_outliers(gap: slice) -> None:
    assert not _left_out(gap).any()


@pytest.mark.parametrize(("corner_rad_s2", "noise_rad_s"), [(0.9, 1.7e-3), (4.0, 1.7e-3), (1.0, 1e-4), (9.0, 1e-2)])
def test_a_corner_of_the_pitch_rate_is_no_outlier_and_a_spike_in_it_is(
    corner_rad_s2: float, noise_rad_s: float
) -> None:
    """A 3-2-1-1 sets the rate of q anew at each step; between the steps q turns back within a second."""
    time = 0.02 * np.arange(601)
    q = np.zeros(time.size)
    for row in range(1, time.size):
        step = int(np.searchsorted(2.0 + 0.5 * np.array([0, 3, 5, 6, 7]), time[row] + 1e-9, side="right"))
        push = corner_rad_s2 * (0.0, 1.0, -1.0, 1.0, -1.0, 0.0)[step]
        q[row] = q[row - 1] + 0.02 * (push - 2.0 * q[row - 1])
    for seed in range(20):
        measured = q + noise_rad_s * np.random.default_rng(seed).standard_normal(time.size)
        assert not outliers(measured, OutlierOptions()).any()
        corner = 175  # where a step begins
        spoiled = measured.copy()
        spoiled[corner] += 2.0 * corner_rad_s2
        spoiled[260:264] -= 2.0 * corner_rad_s2
        assert np.flatnonzero(outliers(spoiled, OutlierOptions())).tolist() == [corner, 260, 261, 262, 263]


@pytest.mark.parametrize("place", [0, 1, 5, 295, 299, 360, 361, 364, 999])
@pytest.mark.parametrize("run", [1, 3])
def test_an_outlier_beside_a_gap_or_an_end_is_found(place: int, run: int) -> None:
    time = 0.01 * np.arange(1000)
    values = 0.3 * np.sin(3.0 * time) + 1e-3 * np.random.default_rng(place).standard_normal(1000)
    values[300:360] = np.nan
    spoiled = np.minimum(np.arange(place, place + run), 999)
    values[spoiled] += 0.05
    expected = {row for row in spoiled.tolist() if not 300 <= row < 360}
    assert set(np.flatnonzero(outliers(values, OutlierOptions())).tolist()) == expected
