"""Multisines: low peaks, exact harmonics, orthogonal inputs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.arrays import frozen_array
from finback.errors import InputError
from finback.flight.multisine import Multisine, flat_multisine, orthogonal_multisines

PEAK = 1.2e-3  # of the largest value: a grid of 64 points a shortest period
ORTHOGONAL = 1e-12  # of the product of lengths: rounding of sums over a whole period
GOOD_RPF = 1.15  # Morelli (2012) prints 1.0 to 1.2 for optimized multisines of ten or more harmonics


def schroeder(harmonics: tuple[int, ...]) -> Multisine:
    k = np.arange(len(harmonics))
    return Multisine(
        period_s=10.0,
        harmonics=harmonics,
        amplitudes=np.ones(k.size),
        phases_rad=frozen_array(-np.pi * k * (k + 1) / k.size),
    )


@pytest.mark.parametrize("harmonics", [tuple(range(1, 11)), tuple(range(2, 41)), tuple(range(1, 31, 3))])
def test_the_peak_is_lower_than_that_of_schroeders_phases(harmonics: tuple[int, ...]) -> None:
    found = flat_multisine(harmonics, period_s=10.0).relative_peak_factor
    assert found < GOOD_RPF
    assert found < 0.9 * schroeder(harmonics).relative_peak_factor


def test_a_single_sine_has_the_relative_peak_factor_one() -> None:
    assert flat_multisine((3,), period_s=2.0).relative_peak_factor == pytest.approx(1.0, abs=PEAK)


@given(st.sets(st.integers(1, 40), min_size=1, max_size=12), st.floats(0.5, 50.0))
@settings(deadline=None, max_examples=15)
def test_the_sum_peaks_at_one_and_begins_at_zero_with_its_power_in_the_harmonics(
    harmonics: set[int], period_s: float
) -> None:
    signal = flat_multisine(tuple(sorted(harmonics)), period_s=period_s)
    samples = 200 * max(harmonics)
    values = signal(np.arange(samples) * period_s / samples)
    assert np.abs(values).max() == pytest.approx(1.0, abs=5 * PEAK)
    assert signal(0.0) == pytest.approx(0.0, abs=1e-9)
    assert signal(1e-6 * period_s) > -1e-9
    spectrum = np.abs(np.fft.rfft(values)) / samples
    assert set(np.flatnonzero(spectrum > 1e-9).tolist()) == harmonics
    np.testing.assert_allclose(spectrum[sorted(harmonics)], signal.amplitudes / 2, rtol=1e-9)


@given(st.integers(1, 5))
@settings(deadline=None, max_examples=5)
def test_several_inputs_are_orthogonal_over_a_period(count: int) -> None:
    signals = orthogonal_multisines(count, period_s=20.0, lowest_hz=0.1, highest_hz=1.5)
    time = np.arange(4000) * 20.0 / 4000
    values = np.array([signal(time) for signal in signals])
    gram = values @ values.T
    lengths = np.sqrt(np.diag(gram))
    np.testing.assert_allclose(gram / np.outer(lengths, lengths), np.eye(count), atol=ORTHOGONAL)
    used = [harmonic for signal in signals for harmonic in signal.harmonics]
    assert len(used) == len(set(used)) == 29


def test_mistakes_are_named() -> None:
    with pytest.raises(InputError, match="rise"):
        flat_multisine((2, 2), period_s=1.0)
    with pytest.raises(InputError, match="too few"):
        orthogonal_multisines(3, period_s=1.0, lowest_hz=1.0, highest_hz=2.0)
    with pytest.raises(InputError, match="band"):
        orthogonal_multisines(1, period_s=1.0, lowest_hz=3.0, highest_hz=2.0)
