"""What of a record is used: up to the first exit, however noisy the samples are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.linalg import expm

from finback.channels import SURFACES
from finback.identification.identify import identify
from finback.identification.method import Method
from finback.identification.model_form import ModelForm
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch, stretches
from finback.records import FlightRecord, Hold, Sweep
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


STEP_S = 0.02
DYNAMICS = np.array([[-0.8, 1.0], [-6.0, -1.2]])
CONTROL = np.array([[-0.1, 0.05], [-8.0, 3.0]])  # of the elevator and of a further surface


@pytest.mark.parametrize("method", [Method.WEAK_FORM, Method.OUTPUT_ERROR])
@pytest.mark.parametrize("surface", sorted(SURFACES - {"elevator_rad"}))
def test_every_surface_is_held_where_the_record_says_so(make_record: Maker, surface: str, method: Method) -> None:
    """Held steps through a linear model have an exact solution; half an interval late, 0.05 of a number is wrong."""
    random = np.random.default_rng(3)
    inputs = 0.05 * random.choice([-1.0, 0.0, 1.0], size=(40, 2)).repeat(20, axis=0)
    both = expm(STEP_S * np.block([[DYNAMICS, CONTROL], [np.zeros((2, 4))]]))
    state = np.zeros((len(inputs), 2))
    for k, held in enumerate(inputs[:-1]):
        state[k + 1] = both[:2, :2] @ state[k] + both[:2, 2:] @ held
    record = make_record("held", state, inputs[:, 0], hold=Hold.ZOH, interval_s=STEP_S)
    sweep = Sweep(study="held", records=(record.with_columns(**{surface: inputs[:, 1]}),))
    terms = ["alpha", "q", "elevator", surface]
    form = ModelForm.parse(terms, terms)
    options = IdentificationOptions(alpha_window_rad=(-1.0, 1.0), half_width_s=0.2, form=(form,), method=method)
    found = identify(sweep, options).model.coefficients
    truth = np.hstack([DYNAMICS, CONTROL]).ravel()
    # What the rules of integration leave at 20 ms.
    assert np.abs(found - truth).max() < 1e-3 * np.abs(truth).max()
