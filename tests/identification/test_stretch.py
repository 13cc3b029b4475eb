"""What of a record is used: up to the first exit, however noisy the samples are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch, stretches
from finback.records import FlightRecord
from finback.units import to_si

Maker = Callable[..., FlightRecord]
OPTIONS = IdentificationOptions(alpha_window_rad=(-0.5, 0.5), half_width_s=0.2, spacing_s=0.05)


def _used(make: Maker, alpha: np.ndarray, *, windowed: bool = True) -> tuple[Stretch, ...]:
    state = np.column_stack([alpha, np.zeros(alpha.size)])
    return stretches(make("flight", state, np.zeros(alpha.size)), OPTIONS, windowed=windowed)


def test_a_record_inside_the_window_is_used_whole(make_record: Maker) -> None:
    (piece,) = _used(make_record, np.zeros(301))
    assert (piece.start_s, piece.end_s, len(piece)) == (0.0, pytest.approx(3.0), 301)
    assert piece.interval_s == pytest.approx(0.01)


@given(spikes=st.lists(st.integers(10, 290), max_size=4, unique=True))
def test_single_samples_outside_cut_nothing(make_record: Maker, spikes: list[int]) -> None:
    alpha = np.zeros(301)
    alpha[spikes] = 0.6
    assert len(_used(make_record, alpha)[0]) == 301


def test_the_first_exit_ends_the_record_even_if_it_returns(make_record: Maker) -> None:
    time = np.arange(601) * 0.01
    (piece,) = _used(make_record, 0.6 * np.sin(2 * np.pi * time / 8.0))
    # sin = 5/6 first at 1.254 s; the running median of a rising signal is its middle.
    assert piece.end_s == pytest.approx(1.25)
    assert len(_used(make_record, 0.6 * np.sin(2 * np.pi * time / 8.0), windowed=False)[0]) == 601


def test_noise_at_the_edge_moves_the_exit_by_little(make_record: Maker) -> None:
    time = np.arange(601) * 0.01
    slow = 0.4 + to_si(5.0, "deg_s") * time  # leaves after 1.146 s
    noise = to_si(0.3, "deg") * np.random.default_rng(0).standard_normal(time.size)
    (piece,) = _used(make_record, slow + noise)
    # Five samples of nine must be outside: at 0.05 deg a sample that needs about a deviation of the noise.
    assert piece.end_s == pytest.approx(1.146, abs=0.1)


def test_what_is_too_short_is_left_out(make_record: Maker) -> None:
    assert _used(make_record, np.zeros(100)) == ()
    assert len(_used(make_record, np.zeros(101))) == 1
    assert _used(make_record, np.full(301, 0.6)) == ()
    assert _used(make_record, np.zeros(1)) == ()
    alpha = np.zeros(301)
    alpha[[90, 180, 270]] = np.nan
    assert _used(make_record, alpha) == ()


def test_the_clock_may_jitter_a_little(make_record: Maker) -> None:
    record = make_record("flight", np.zeros((301, 2)), np.zeros(301))
    jitter = 1e-4 * np.random.default_rng(1).uniform(-1, 1, 301)
    assert len(stretches(replace(record, columns={**record.columns, "time_s": record["time_s"] + jitter}), OPTIONS,
                         windowed=True)[0]) == 301  # fmt: skip
