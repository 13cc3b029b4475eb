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


def _flown_by_actuators(make: Maker, *, noise_deg: float) -> FlightRecord:
    """Fly an unstable aircraft with two surfaces, alpha and q fed back; sampled every 0.05 s.

    Commands are held for 0.7 s, off the samples, and go through actuators of second order: all of it is linear.
    """
    fine, ratio, corner = 0.01, 5, 18.0
    commands = 0.05 * np.random.default_rng(4).choice([-1.0, 0.0, 1.0], size=(2, 30)).repeat(70, axis=1).T
    whole = np.zeros((8, 8))
    whole[:2, :2], whole[:2, [2, 4]] = UNSTABLE, CONTROL
    for place, own in ((2, 6), (4, 7)):
        whole[place, place + 1] = 1.0
        whole[place + 1, [place, place + 1, own]] = -(corner**2), -1.4 * corner, corner**2
    whole[3, :2] += corner**2 * np.array([1.0, 0.3])
    step, state = expm(fine * whole), np.zeros((len(commands), 8))
    for k in range(len(commands) - 1):
        state[k + 1] = step @ np.append(state[k, :6], commands[k])
    state = state[::ratio]
    noise = to_si(noise_deg, "deg") * np.random.default_rng(5).standard_normal((len(state), 2))
    record = make("flown", state[:, :2] + noise, state[:, 2], hold=Hold.ACTUATOR, interval_s=ratio * fine)
    return record.with_columns(canard_rad=state[:, 4])


UNSTABLE = np.array([[-1.28, 0.94], [6.1, -2.5]])
TWO_SURFACES = ["alpha", "q", "elevator", "canard"]
COARSE = IdentificationOptions(
    alpha_window_rad=(-3.0, 3.0), half_width_s=0.4, form=(ModelForm.parse(TWO_SURFACES, TWO_SURFACES),)
)


@pytest.mark.parametrize("method", [Method.WEAK_FORM, Method.OUTPUT_ERROR])
def test_an_actuator_goes_round_between_its_samples(make_record: Maker, method: Method) -> None:
    """Chords miss what an actuator moves by 1 % at 20 Hz, always on the same side."""
    record = _flown_by_actuators(make_record, noise_deg=0.0)

    def missed(hold: Hold) -> float:
        sweep = Sweep(study="", records=(replace(record, hold=hold),))
        found = identify(sweep, replace(COARSE, method=method)).model.coefficients.reshape(2, 4)
        return float(np.abs(found[1, 2:] - CONTROL[1]).max() / np.abs(CONTROL).max())

    chords = missed(Hold.FOH)
    assert chords > 0.005
    assert missed(Hold.ACTUATOR) < 0.1 * chords


@pytest.mark.parametrize(("hold", "noise_deg", "warned"), [(Hold.FOH, 0.1, 1), (Hold.FOH, 1.0, 0),
                                                           (Hold.ACTUATOR, 0.1, 0)])  # fmt: skip
def test_chords_of_a_curve_are_told_where_they_matter(
    make_record: Maker, hold: Hold, noise_deg: float, warned: int
) -> None:
    record = replace(_flown_by_actuators(make_record, noise_deg=noise_deg), hold=hold)
    warnings = identify(Sweep(study="", records=(record,)), COARSE).warnings
    assert sum("goes in curves" in warning for warning in warnings) == warned


def test_straight_lines_are_not_taken_for_curves(make_record: Maker) -> None:
    """A coarse sine that goes straight between samples: by its samples alone it could be a curve; the motion tells."""
    interval, noise = 0.05, to_si(0.02, "deg")
    time = interval * np.arange(400)
    elevator = 0.05 * (np.sin(2.0 * np.pi * time) + np.sin(2.0 * np.pi * 0.37 * time))
    whole = np.zeros((4, 4))
    whole[:2, :2], whole[:2, 2], whole[2, 3] = DYNAMICS, CONTROL[:, 0], 1.0
    step, state = expm(interval * whole), np.zeros((time.size, 2))
    for k, slope in enumerate((np.diff(elevator) / interval).tolist()):
        state[k + 1] = (step @ np.array([*state[k], elevator[k], slope]))[:2]
    state += noise * np.random.default_rng(6).standard_normal(state.shape)
    terms = TWO_SURFACES[:3]
    options = replace(COARSE, form=(ModelForm.parse(terms, terms),))
    for hold, warned in ((Hold.FOH, 0), (Hold.ACTUATOR, 0)):
        record = make_record("straight", state, elevator, hold=hold, interval_s=interval)
        found = identify(Sweep(study="", records=(record,)), options)
        assert sum("goes in curves" in warning for warning in found.warnings) == warned
        chords = np.abs(found.model.coefficients[-1] / CONTROL[1, 0] - 1.0)
        assert (chords < 0.005) == (hold is Hold.FOH)
