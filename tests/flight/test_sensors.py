"""Noise: its size, its seed, what it leaves alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from finback.errors import InputError
from finback.flight.sensors import Instrument, Sensors, measure
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule

ROWS = 20_000
SENSORS = Sensors(alpha_noise_rad=0.002, q_noise_rad_s=0.003)


@pytest.fixture
def record(condition: Condition) -> FlightRecord:
    time = np.arange(ROWS) * 0.01
    names = ("alpha_rad", "q_rad_s", "theta_rad", "elevator_rad", "alpha_dot_rad_s", "q_dot_rad_s2")
    return FlightRecord(
        name="hold-01",
        columns={"time_s": time, **{name: np.sin(time) for name in names}},
        outcome=Outcome.COMPLETED,
        note="",
        condition=condition,
        schedule=Schedule(time_s=[0.0], elevator_rad=[0.0]),
        hold=Hold.FOH,
    )


def test_noise_is_white_of_the_stated_size_and_of_alpha_and_q_only(record: FlightRecord) -> None:
    seen = measure(record, SENSORS, seed=7, index=0)
    alpha = seen["alpha_rad"] - record["alpha_rad"]
    q = seen["q_rad_s"] - record["q_rad_s"]
    five_sigma = 5 / math.sqrt(ROWS)  # of a correlation, and about of a relative standard deviation
    assert alpha.std() == pytest.approx(0.002, rel=five_sigma)
    assert q.std() == pytest.approx(0.003, rel=five_sigma)
    for one, other in ((alpha, q), (alpha[1:], alpha[:-1]), (q[1:], q[:-1])):
        assert abs(np.corrcoef(one, other)[0, 1]) < five_sigma
    for name in ("time_s", "theta_rad", "elevator_rad"):
        assert (seen[name] == record[name]).all()
    assert not {"alpha_dot_rad_s", "q_dot_rad_s2"} & set(seen.columns)
    assert seen.provenance["seed"] == "7"
    assert float(seen.provenance["alpha_noise_rad"]) == 0.002


def test_seed_and_index_fix_every_bit(record: FlightRecord) -> None:
    first = measure(record, SENSORS, seed=7, index=3)
    assert (measure(record, SENSORS, seed=7, index=3)["alpha_rad"] == first["alpha_rad"]).all()
    assert (measure(record, SENSORS, seed=7, index=4)["alpha_rad"] != first["alpha_rad"]).any()
    assert (measure(record, SENSORS, seed=8, index=3)["alpha_rad"] != first["alpha_rad"]).any()


def test_silent_sensors_change_nothing(record: FlightRecord) -> None:
    seen = measure(record, Sensors(alpha_noise_rad=0.0, q_noise_rad_s=0.0), seed=1, index=0)
    assert (seen["alpha_rad"] == record["alpha_rad"]).all()


def test_impossible_sensors_and_seeds_are_refused(record: FlightRecord) -> None:
    with pytest.raises(InputError, match="alpha_noise_rad"):
        Sensors(alpha_noise_rad=-0.1, q_noise_rad_s=0.0)
    with pytest.raises(InputError, match="negative"):
        measure(record, SENSORS, seed=-1, index=0)


# What is wrong with a sensor


def through(record: FlightRecord, *instruments: Instrument, **changes: float) -> FlightRecord:
    silent = Sensors(alpha_noise_rad=0.0, q_noise_rad_s=0.0, instruments=instruments, **changes)
    return measure(record, silent, seed=3, index=0)


def test_bias_and_scale(record: FlightRecord) -> None:
    seen = through(record, Instrument(channel="alpha_rad", bias=0.01, scale=1.02))
    np.testing.assert_allclose(seen["alpha_rad"], 1.02 * record["alpha_rad"] + 0.01, atol=1e-15)
    assert (seen["q_rad_s"] == record["q_rad_s"]).all()
    assert "bias=0.01" in seen.provenance["sensor_alpha_rad"]


def test_a_lag_is_the_exact_response_to_a_ramp(record: FlightRecord) -> None:
    """dy/dt = (x - y)/τ with x = t from rest: y = t - τ (1 - exp(-t/τ))."""
    time = record["time_s"]
    ramp = record.with_columns(alpha_rad=time)
    seen = through(ramp, Instrument(channel="alpha_rad", lag_s=0.3))
    np.testing.assert_allclose(seen["alpha_rad"], time - 0.3 * (1 - np.exp(-time / 0.3)), atol=1e-11)


def test_it_starts_at_rest(record: FlightRecord) -> None:
    seen = through(record.with_columns(alpha_rad=np.full(ROWS, 0.4)), Instrument(channel="alpha_rad", lag_s=0.3))
    np.testing.assert_allclose(seen["alpha_rad"], 0.4, atol=1e-14)


def test_a_slow_sensor_shows_each_sample_until_the_next(record: FlightRecord) -> None:
    seen = through(record, Instrument(channel="q_rad_s", sample_interval_s=0.05, noise=0.0))
    np.testing.assert_array_equal(seen["q_rad_s"], np.repeat(record["q_rad_s"][::5], 5))
    with pytest.raises(InputError, match="sensor of 'q_rad_s'"):
        through(record, Instrument(channel="q_rad_s", sample_interval_s=0.025))


def test_quantization_is_within_half_a_step(record: FlightRecord) -> None:
    seen = through(record, Instrument(channel="alpha_rad", resolution=0.005))["alpha_rad"]
    np.testing.assert_allclose(seen / 0.005, np.round(seen / 0.005), atol=1e-9)
    assert np.abs(seen - record["alpha_rad"]).max() <= 0.0025 * (1 + 1e-12)


def test_a_vane_ahead_feels_the_pitch_rate(record: FlightRecord, condition: Condition) -> None:
    """The velocity of its point is that of the center of gravity plus ω × r; by hand in body axes."""
    seen = through(record, vane_forward_m=6.0)["alpha_rad"]
    speed, alpha, q = condition.airspeed_m_s, record["alpha_rad"], record["q_rad_s"]
    u, w = speed * np.cos(alpha), speed * np.sin(alpha) - q * 6.0
    np.testing.assert_allclose(seen, np.arctan2(w, u), atol=1e-14)
    assert (seen < record["alpha_rad"])[record["q_rad_s"] > 0.1].all()


def test_another_channels_noise_leaves_the_others_as_they_were(record: FlightRecord) -> None:
    plain = measure(record, SENSORS, seed=7, index=3)
    theta = Instrument(channel="theta_rad", noise=0.01)
    seen = measure(record, replace(SENSORS, instruments=(theta,)), seed=7, index=3)
    assert (seen["alpha_rad"] == plain["alpha_rad"]).all()
    assert (seen["theta_rad"] - record["theta_rad"]).std() == pytest.approx(0.01, rel=0.05)
    again = measure(record, replace(SENSORS, instruments=(theta,)), seed=7, index=3)
    assert (seen["theta_rad"] == again["theta_rad"]).all()


def test_noise_is_added_at_the_sensors_own_samples(record: FlightRecord) -> None:
    slow = Instrument(channel="alpha_rad", sample_interval_s=0.1)
    seen = measure(record, replace(SENSORS, instruments=(slow,)), seed=7, index=0)["alpha_rad"]
    assert (np.diff(seen.reshape(-1, 10), axis=1) == 0.0).all()
    assert (seen[::10] - record["alpha_rad"][::10]).std() == pytest.approx(0.002, rel=0.1)


def test_impossible_instruments_are_refused(record: FlightRecord) -> None:
    with pytest.raises(InputError, match="unknown channel"):
        Instrument(channel="alpha_deg")
    with pytest.raises(InputError, match="no sensor gives"):
        Instrument(channel="q_dot_rad_s2")
    with pytest.raises(InputError, match="lag_s"):
        Instrument(channel="q_rad_s", lag_s=-1.0)
    with pytest.raises(InputError, match="bias"):
        Instrument(channel="q_rad_s", bias=math.nan)
    with pytest.raises(InputError, match="two sensors"):
        through(record, Instrument(channel="q_rad_s"), Instrument(channel="q_rad_s"))
    with pytest.raises(InputError, match="given twice"):
        replace(SENSORS, instruments=(Instrument(channel="q_rad_s", noise=0.1),))
    with pytest.raises(InputError, match="no 'beta_rad'"):
        through(record, Instrument(channel="beta_rad", bias=0.1))


@pytest.mark.parametrize(("name", "low"), [("psi_rad", 0.0), ("phi_rad", -math.pi), ("alpha_rad", -math.pi)])
@pytest.mark.parametrize("rate", [0.7, -0.7], ids=["up", "down"])
def test_an_angle_goes_through_a_turn_without_a_jump(record: FlightRecord, name: str, low: float, rate: float) -> None:
    lag, bias, noise, resolution, interval = 0.3, 0.2, 1e-3, 1e-4, 0.05
    angle = 0.4 + rate * record["time_s"]
    folded = low + (angle - low) % math.tau
    seen = measure(
        record.with_columns(**{name: folded}),
        Sensors(
            alpha_noise_rad=noise if name == "alpha_rad" else 0.0,
            q_noise_rad_s=0.0,
            instruments=(
                Instrument(
                    channel=name,
                    lag_s=lag,
                    bias=bias,
                    noise=0.0 if name == "alpha_rad" else noise,
                    resolution=resolution,
                    sample_interval_s=interval,
                ),
            ),
        ),
        seed=1,
        index=0,
    )[name]
    # A ramp, long after its beginning, is shown by the lag too late, and held.
    late = slice(1000, None)
    shown = (angle - rate * (lag + record["time_s"] % interval) + bias)[late]
    off = (seen[late] - shown + math.pi) % math.tau - math.pi
    assert np.abs(off).max() < 6 * noise + resolution + abs(rate) * 0.05
    assert low - resolution <= seen.min()
    assert seen.max() <= low + math.tau + resolution
    np.testing.assert_allclose(seen / resolution, np.round(seen / resolution), atol=1e-9)


def test_noise_of_alpha_stays_in_its_turn(record: FlightRecord) -> None:
    seen = measure(record.with_columns(alpha_rad=np.full(ROWS, math.pi)), SENSORS, seed=1, index=0)["alpha_rad"]
    assert np.abs(seen).max() <= math.pi
    assert (seen < 0.0).any()


def test_a_heading_that_rounds_up_to_a_turn_is_north(record: FlightRecord) -> None:
    heading = record.with_columns(psi_rad=np.full(ROWS, 6.27))
    seen = through(heading, Instrument(channel="psi_rad", resolution=0.1))["psi_rad"]
    assert (seen == 0.0).all()


def test_an_angle_that_a_record_does_not_fold_is_not_folded(record: FlightRecord) -> None:
    on = record.with_columns(psi_rad=5.0 + 0.01 * record["time_s"], alpha_rad=np.full(ROWS, 4.0))
    seen = through(on, Instrument(channel="psi_rad", bias=2.0), Instrument(channel="alpha_rad", bias=0.5))
    assert on["psi_rad"].max() > math.tau
    for name, bias in (("psi_rad", 2.0), ("alpha_rad", 0.5)):
        np.testing.assert_array_equal(seen[name], on[name] + bias)
