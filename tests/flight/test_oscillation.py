"""Sweeps and multisines become lines from sample to sample, inside rate and limits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from finback.errors import InputError
from finback.flight.excitation import ThreeTwoOneOne, schedule
from finback.flight.oscillation import LinearSweep, LogSweep, MultisineInput, Oscillation
from finback.records import Schedule
from finback.study import read_study

LIMITS = (-0.7, 0.35)
RATE = 1.05
GRID = 0.01
LINEAR = LinearSweep(
    elevator_rad=-0.1, amplitude_rad=0.02, from_1_s=0.1, to_1_s=2.0, sweep_s=20.0, lead_s=1.0, duration_s=25.0
)
LOG = LogSweep(
    elevator_rad=-0.1, amplitude_rad=0.02, from_1_s=0.1, to_1_s=2.0, sweep_s=20.0, lead_s=1.0, duration_s=25.0
)
MULTISINE = MultisineInput(
    elevator_rad=-0.1, amplitude_rad=0.03, lowest_1_s=0.1, highest_1_s=2.0, period_s=10.0, lead_s=1.0, duration_s=25.0
)
SAMPLED = 0.05  # of a frequency: cycles counted between zero crossings of samples


def made(maneuver: Oscillation) -> Schedule:
    return schedule(maneuver, rate_limit_rad_s=RATE, limits_rad=LIMITS, grid_s=GRID)


@pytest.mark.parametrize("maneuver", [LINEAR, LOG, MULTISINE])
def test_it_starts_and_ends_at_the_trim_and_stays_within_amplitude_and_rate(maneuver: Oscillation) -> None:
    flown = made(maneuver)
    time = np.arange(2501) * GRID
    values = flown.value(time)
    assert values[0] == values[100] == values[-1] == maneuver.elevator_rad
    assert np.abs(values - maneuver.elevator_rad).max() <= maneuver.amplitude_rad * 1.002
    assert np.abs(values - maneuver.elevator_rad).max() >= maneuver.amplitude_rad * 0.95
    assert np.abs(np.diff(values)).max() <= RATE * GRID


def crossings(maneuver: Oscillation) -> np.ndarray:
    """Times of all zero crossings, s since the start of the oscillation."""
    time = np.arange(0, 20.0, 1e-4)
    wave = maneuver.wave(time)
    return time[np.flatnonzero(wave[:-1] * wave[1:] < 0)]


def test_the_frequency_of_a_linear_sweep_rises_steadily() -> None:
    zeros = crossings(LINEAR)
    frequency, middle = 0.5 / np.diff(zeros), 0.5 * (zeros[1:] + zeros[:-1])
    np.testing.assert_allclose(frequency[3:], 0.1 + 1.9 * middle[3:] / 20.0, rtol=SAMPLED)


def test_a_log_sweep_has_as_many_cycles_in_each_octave() -> None:
    zeros = crossings(LOG)
    frequency, middle = 0.5 / np.diff(zeros), 0.5 * (zeros[1:] + zeros[:-1])
    np.testing.assert_allclose(np.log(frequency[3:] / 0.1), np.log(20.0) * middle[3:] / 20.0, atol=SAMPLED)


def test_a_multisine_flies_whole_periods() -> None:
    flown = made(MULTISINE)
    time = 1.0 + np.arange(1000) * GRID
    np.testing.assert_allclose(flown.value(time + 10.0)[1:], flown.value(time)[1:], atol=1e-12)
    assert flown.value(21.5) == MULTISINE.elevator_rad  # a half period that would remain is not begun


@pytest.mark.parametrize(
    ("maneuver", "words"),
    [
        (replace(LINEAR, to_1_s=20.0), "samples"),
        (replace(LOG, amplitude_rad=0.5), "limits"),
        (replace(MULTISINE, amplitude_rad=0.3), "faster"),
        (replace(LINEAR, duration_s=15.0), "fit"),
        (replace(MULTISINE, period_s=30.0), "fit"),
    ],
)
def test_what_cannot_be_flown_is_refused(maneuver: Oscillation, words: str) -> None:
    with pytest.raises(InputError, match=words):
        made(maneuver)


def test_a_band_without_a_harmonic_is_refused() -> None:
    with pytest.raises(InputError, match="no harmonic"):
        replace(MULTISINE, lowest_1_s=0.11, highest_1_s=0.19)


def test_they_are_kinds_of_maneuvers_in_a_study(small_study: Path, tmp_path: Path) -> None:
    text = small_study.read_text(encoding="utf-8")
    extra = """
[[sweep]]
kind = "multisine"
elevator_deg = [0.0, -5.0]
amplitude_deg = 2.0
lowest_hz = 0.1
highest_hz = 1.5
period_s = 10.0
lead_s = 1.0
duration_s = 11.0

[[sweep]]
kind = "matched-three-two-one-one"
elevator_deg = 0.0
amplitude_deg = 2.0
frequency_rad_s = [2.0, 4.0]
damping_1 = 0.2
lead_s = 1.0
duration_s = 11.0

[[sweep]]
kind = "log-sweep"
elevator_deg = 0.0
amplitude_deg = 2.0
from_hz = 0.1
to_hz = [1.0, 2.0]
sweep_s = 8.0
lead_s = 1.0
duration_s = 11.0
"""
    path = tmp_path / "study.toml"
    path.write_text(text + extra, encoding="utf-8")
    found = read_study(path).maneuvers
    assert [m.highest_1_s for m in found if isinstance(m, LogSweep)] == [1.0, 2.0]
    assert len([m for m in found if isinstance(m, MultisineInput)]) == 2
    slow, fast = [m.unit_s for m in found if isinstance(m, ThreeTwoOneOne)][-2:]
    assert slow == pytest.approx(2 * fast)
