"""The step to which a channel is rounded, and what a fit makes of it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from finback.arrays import FloatArray
from finback.identification.coefficient.doubts import rounded_outputs
from finback.identification.coefficient.track import STATES, Track
from finback.identification.identify import identify
from finback.identification.options import IdentificationOptions
from finback.identification.rounding import rounding
from finback.records import FlightRecord, Hold, Sweep
from finback.units import to_si

TIME = 0.02 * np.arange(751)


@pytest.mark.parametrize("step", [1.0, 0.03, 0.0174533])
def test_the_step_is_found(step: float) -> None:
    motion = 5.0 * step * np.sin(TIME) + 0.02 * step * np.random.default_rng(0).standard_normal(TIME.size)
    found = rounding([np.round(motion / step) * step, np.round(motion[::-1] / step) * step], 0.02)
    assert found.step == pytest.approx(step)
    # The value stays for several samples: each tells less than one of white noise would.
    assert found.deviation > 1.5 * step / math.sqrt(12.0)


def test_an_error_at_rest_is_bounded() -> None:
    rest = np.zeros(5000)
    found = rounding([np.concatenate([rest, np.round(5.0 * np.sin(TIME))])], 0.02)
    assert found.deviation <= math.sqrt(50.0 / 12.0)


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.5])
def test_what_is_not_rounded_has_no_step(noise: float) -> None:
    motion = np.sin(TIME) + noise * np.random.default_rng(1).standard_normal(TIME.size)
    still_first = np.concatenate([np.zeros(100), motion])
    for signal in (motion, still_first, TIME, np.zeros(100), np.zeros(0)):
        assert rounding([signal], 0.02).step == 0.0


def test_noise_that_is_larger_than_the_step_stands_for_it() -> None:
    motion = np.sin(TIME) + 0.1 * np.random.default_rng(2).standard_normal(TIME.size)
    assert rounding([np.round(motion / 0.1) * 0.1], 0.02).deviation < 0.1


def test_coefficients_of_rounded_records_cover_the_truth(
    clean: Sweep, options: IdentificationOptions, exact: FloatArray, noisy: Callable[..., Sweep]
) -> None:
    step = to_si(1.0, "deg")

    def levels(record: FlightRecord) -> FlightRecord:
        return record.with_columns(**{name: np.round(record[name] / step) * step for name in ("alpha_rad", "q_rad_s")})

    records = noisy(clean, alpha_deg=0.02, q_deg_s=0.02, seed=0).records
    found = identify(Sweep(study="rounded", records=tuple(map(levels, records))), options)
    numbers = np.concatenate([found.model.alpha_dot.coefficients, found.model.q_dot.coefficients])
    off = np.abs(numbers - exact) / found.standard_errors
    assert (off < 1.96).sum() >= 11
    for name in ("alpha", "q"):
        assert any(f"{name} is rounded to steps of 1 deg" in warning for warning in found.warnings)


def test_outputs_of_a_coefficient_fit_are_named_with_their_step() -> None:
    speed, alpha = 100.0 + 5.0 * np.sin(TIME), 0.1 + 0.05 * np.sin(2.0 * TIME)
    step = to_si(1.0, "deg")
    states = np.column_stack([speed, np.round(alpha / step) * step, 0.0 * TIME, np.cos(TIME)])
    track = Track(
        flight="one",
        start_s=0.0,
        interval_s=0.02,
        outputs=STATES,
        measured=states,
        states=states,
        input_names=("elevator_rad",),
        inputs=np.zeros((TIME.size, 1)),
        hold=Hold.ZOH,
        density_kg_m3=np.ones(TIME.size),
        thrust_n=np.zeros(TIME.size),
        gravity_m_s2=9.80665,
    )
    (said,) = rounded_outputs([track])
    assert "alpha_rad is rounded to steps of 1 deg" in said
