"""Dryden gusts: their variance, spectrum and seed, and what they do to an aircraft."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import welch

from finback.errors import InputError
from finback.flight.air import DrydenAir
from finback.flight.airborne import Airborne
from finback.flight.plan import FlightPlan
from finback.flight.turbulence import dryden_gusts

MakePlan = Callable[..., FlightPlan]

AIR = DrydenAir(intensity_m_s=1.5, length_m=50.0, seed=11)
SPEED = 100.0
STEPS = 400_000  # 4000 s of a correlation time of 0.5 s: 4000 independent samples, variances good to 2.2 % (1 σ)
FOUR_SIGMA = 0.09


@pytest.fixture(scope="module")
def gusts() -> np.ndarray:
    return dryden_gusts(AIR, airspeed_m_s=SPEED, step_s=0.01, steps=STEPS)


def test_each_gust_has_the_intensity_and_no_other_one_in_it(gusts: np.ndarray) -> None:
    np.testing.assert_allclose(gusts.var(axis=0), AIR.intensity_m_s**2, rtol=FOUR_SIGMA)
    assert np.abs(np.corrcoef(gusts.T) - np.eye(3)).max() < 0.08


@pytest.mark.parametrize(("column", "shape_of"), [(0, "along"), (1, "across"), (2, "across")])
def test_the_spectra_are_drydens(gusts: np.ndarray, column: int, shape_of: str) -> None:
    """MIL-F-8785C Eq. for Φ_u, Φ_v, Φ_w, turned into frequency by Ω = 2πf/V."""
    frequency, found = welch(gusts[:, column], fs=100.0, nperseg=4096)
    inside = (frequency > 0.05) & (frequency < 10.0)  # well below half the sampling rate
    number = AIR.length_m * 2 * math.pi * frequency[inside] / SPEED
    length = AIR.length_m * 2 * math.pi / SPEED / math.pi
    shape = (1 + 3 * number**2) / (1 + number**2) ** 2 if shape_of == "across" else 2 / (1 + number**2)
    expected = AIR.intensity_m_s**2 * length * shape
    ratio = found[inside] / expected
    assert ratio.mean() == pytest.approx(1.0, abs=0.05)
    for band in np.array_split(ratio, 8):  # 50 and more lines a band, 190 averages each
        assert band.mean() == pytest.approx(1.0, abs=0.1)


def test_the_first_gust_is_as_strong_as_any() -> None:
    first = [
        dryden_gusts(DrydenAir(intensity_m_s=1.0, length_m=500.0, seed=seed), airspeed_m_s=SPEED, step_s=0.01, steps=1)[
            0
        ]
        for seed in range(600)
    ]
    np.testing.assert_allclose(np.var(first, axis=0), 1.0, atol=4 * math.sqrt(2 / 600))


def test_a_seed_fixes_every_bit_and_longer_air_begins_alike() -> None:
    one, two = (dryden_gusts(AIR, airspeed_m_s=SPEED, step_s=0.01, steps=100) for _ in range(2))
    assert one.tobytes() == two.tobytes()
    other = DrydenAir(intensity_m_s=1.5, length_m=50.0, seed=12)
    assert (dryden_gusts(other, airspeed_m_s=SPEED, step_s=0.01, steps=100) != one).any()


def test_a_flight_through_gusts_repeats_and_leaves_no_wind_behind(f8ii_direct: Airborne, make_plan: MakePlan) -> None:
    calm = make_plan((0.0, -0.05), alpha=0.05, duration=3.0)
    before = f8ii_direct.fly(calm)
    rough = make_plan((0.0, -0.05), alpha=0.05, duration=3.0, air=DrydenAir(intensity_m_s=2.0, length_m=500.0, seed=4))
    one, two = f8ii_direct.fly(rough), f8ii_direct.fly(rough)
    after = f8ii_direct.fly(calm)
    assert all(one[name].tobytes() == two[name].tobytes() for name in one.columns)
    assert all(before[name].tobytes() == after[name].tobytes() for name in before.columns)
    assert "alpha_dot_rad_s" not in one.columns
    assert "seed=4" in one.provenance["air"]
    # 2 m/s across 295 m/s turn the wind by 0.4 deg
    assert 1e-3 < np.std(one["beta_rad"]) < 2e-2
    assert np.std(one["alpha_rad"] - before["alpha_rad"]) > 1e-3
    assert np.std(np.diff(one["airspeed_m_s"])) > 1e-3


def test_still_turbulence_is_calm(f8ii_direct: Airborne, make_plan: MakePlan) -> None:
    still = DrydenAir(intensity_m_s=0.0, length_m=500.0, seed=4)
    one, other = (
        f8ii_direct.fly(make_plan((0.0, -0.05), alpha=0.05, duration=1.0, **given)) for given in ({}, {"air": still})
    )
    np.testing.assert_allclose(one["alpha_rad"], other["alpha_rad"], atol=1e-12)


def test_impossible_air_is_refused() -> None:
    for changes in ({"intensity_m_s": -1.0}, {"length_m": 0.0}, {"seed": -1}, {"intensity_m_s": math.nan}):
        with pytest.raises(InputError, match="turbulence"):
            DrydenAir(**{"intensity_m_s": 1.0, "length_m": 500.0, "seed": 1, **changes})
