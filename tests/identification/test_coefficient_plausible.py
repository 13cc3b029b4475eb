"""Channels that cannot be what they are called are refused before a fit; flights without a maneuver after it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from finback.arrays import FloatArray
from finback.errors import InputError, RefusedError
from finback.identification.coefficient import turbulence
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.equation_error import equation_error
from finback.identification.coefficient.form import Axes, CoefficientForm
from finback.identification.coefficient.identify import identify_coefficients
from finback.identification.coefficient.innovations import Innovations
from finback.identification.coefficient.motion import layout, motion
from finback.identification.coefficient.options import CoefficientMethod, CoefficientOptions
from finback.identification.coefficient.plausible import check_channels
from finback.identification.coefficient.track import tracks
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.units import to_si

G = 9.80665
FRAME = Airframe(mass_kg=13.5, wing_area_m2=0.55, chord_m=0.19, pitch_inertia_kg_m2=1.135, thrust_n=9.2)
AIR = Condition(airspeed_m_s=20.0, density_kg_m3=1.2, gravity_m_s2=G, altitude_m=100.0)
FORM = CoefficientForm.parse(
    Axes.WIND, ["1", "alpha", "alpha^2"], ["1", "alpha", "elevator"], ["1", "alpha", "pitch_rate", "elevator"]
)
TRUTH = np.array([0.04, 0.05, 1.1, 0.23, 5.1, 0.15, 0.013, -1.2, -25.0, -0.9])
NOISE = {"airspeed_m_s": 0.1, "alpha_rad": 5e-3, "theta_rad": 3e-3, "q_rad_s": 5e-3, "ax_m_s2": 0.1, "az_m_s2": 0.1}
STEP_S = 0.02


def _record(amplitude_deg: float, seed: int = 0) -> FlightRecord:
    """Fly a doublet and a 3-2-1-1 in 16 s from about trim by Runge and Kutta's rule, with white noise."""
    time = np.arange(801) * STEP_S
    marks = [1.0, 2.5, 3.5, 4.0, 4.5, 9.0, 10.0, 11.0]
    levels = [1.0, -1.0, 1.0, -1.0, 0.0, 1.0, -1.0, 0.0]
    moved = np.interp(time, np.repeat(marks, 2) + np.tile([0.0, 0.1], 8), np.repeat([0.0, *levels], 2)[1:-1])
    elevator = -0.0793 + to_si(amplitude_deg, "deg") * moved
    terms, one = layout(FORM, FRAME, 20.0), np.ones(1)

    def rates(state: FloatArray, deflected: float) -> FloatArray:
        known = AIR.density_kg_m3 * one, FRAME.thrust_n * one
        return motion(terms, TRUTH, state, deflected * one[:, np.newaxis], *known, G).rates

    state, seen = np.array([[20.0, 0.0703, 0.0703, 0.0]]), np.empty((time.size, 6))
    for k, deflected in enumerate(elevator.tolist()):
        first = rates(state, deflected)
        seen[k] = np.concatenate([state[0], first[0, 4:]])
        after = float(elevator[min(k + 1, time.size - 1)])
        half = 0.5 * (deflected + after)
        second = rates(state + 0.5 * STEP_S * first[:, :4], half)
        third = rates(state + 0.5 * STEP_S * second[:, :4], half)
        fourth = rates(state + STEP_S * third[:, :4], after)
        state = state + STEP_S / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)[:, :4]
    random = np.random.default_rng(seed)
    noisy = {name: seen[:, i] + NOISE[name] * random.standard_normal(time.size) for i, name in enumerate(NOISE)}
    return FlightRecord(
        name="small",
        columns={"time_s": time, "elevator_rad": elevator, **noisy},
        outcome=Outcome.COMPLETED,
        note="",
        condition=AIR,
        schedule=Schedule(time_s=time, elevator_rad=elevator),
        hold=Hold.FOH,
    )


@pytest.fixture(scope="module")
def flown() -> FlightRecord:
    return _record(4.0)


def _check(record: FlightRecord) -> None:
    check_channels([record], tracks(record, FRAME, outputs=tuple(NOISE), inputs=FORM.inputs, shortest_s=1.0))


def test_right_channels_pass(flown: FlightRecord) -> None:
    _check(flown)
    _check(flown.with_columns(az_m_s2=flown["az_m_s2"] + 0.5, ax_m_s2=flown["ax_m_s2"] - 0.5))  # biases of 0.05 g
    _check(flown.with_columns(airspeed_m_s=np.full(len(flown), 20.0)))  # that of the condition


@pytest.mark.parametrize(
    ("channel", "change", "said"),
    [
        ("az_m_s2", lambda felt: -felt, "sign is wrong"),
        ("az_m_s2", lambda felt: felt / G, "it is in g"),
        ("az_m_s2", lambda felt: felt / 0.3048, "ft/s²"),
        ("az_m_s2", lambda felt: felt + G, "gravity was taken off"),
        ("ax_m_s2", lambda felt: -felt, "sign is wrong"),
        ("ax_m_s2", lambda felt: felt / G, "it is in g"),
        ("ax_m_s2", lambda felt: np.full_like(felt, 0.3), "the channel is dead"),
        ("theta_rad", np.zeros_like, "the channel is dead"),
    ],
)
def test_wrong_channels_are_refused_by_name_and_cause(
    flown: FlightRecord, channel: str, change: Callable[[FloatArray], FloatArray], said: str
) -> None:
    with pytest.raises(InputError, match=rf"{channel}.*{said}"):
        _check(flown.with_columns(**{channel: change(flown[channel])}))


@pytest.mark.parametrize("method", list(CoefficientMethod))
def test_every_method_asks_first(flown: FlightRecord, method: CoefficientMethod) -> None:
    options = CoefficientOptions(airframe=FRAME, form=FORM, reference_speed_m_s=20.0, method=method)
    wrong = flown.with_columns(az_m_s2=-flown["az_m_s2"])
    with pytest.raises(InputError, match="sign is wrong"):
        identify_coefficients(Sweep(study="wrong", records=(wrong,)), options)


@pytest.mark.parametrize("method", [CoefficientMethod.EQUATION_ERROR, CoefficientMethod.FREQUENCY])
def test_without_a_maneuver_noise_passes_for_motion(method: CoefficientMethod) -> None:
    options = CoefficientOptions(airframe=FRAME, form=FORM, reference_speed_m_s=20.0, method=method)
    steady = [replace(_record(0.05, seed), name=f"steady {seed}") for seed in range(2)]
    with pytest.raises(RefusedError, match=r"noise of the sensors is as large as the motion.* in Cm"):
        identify_coefficients(Sweep(study="steady", records=tuple(steady)), options)
    moved = identify_coefficients(Sweep(study="moved", records=(_record(4.0),)), options).model
    assert (np.abs(moved.numbers - TRUTH) < 3.9 * moved.standard_errors).all()  # one of ten by chance in 1000


@pytest.mark.parametrize("method", [CoefficientMethod.OUTPUT_ERROR, CoefficientMethod.FILTER_ERROR])
def test_likelihood_is_not_asked_where_nothing_moves(flown: FlightRecord, method: CoefficientMethod) -> None:
    """Flights at three trims, all channels but for their noise as steady as the elevator."""
    options = CoefficientOptions(airframe=FRAME, form=FORM, reference_speed_m_s=20.0, method=method)
    random = np.random.default_rng(2)
    steady = []
    for trim in (-0.1, -0.08, -0.06):
        levels = {"elevator_rad": trim, "airspeed_m_s": 20.0, "alpha_rad": 0.07 - trim, "theta_rad": 0.07 - trim}
        columns = {name: np.full(801, levels.get(name, 0.0)) for name in flown.columns}
        columns |= {name: columns[name] + size * random.standard_normal(801) for name, size in NOISE.items()}
        columns |= {"time_s": flown["time_s"], "az_m_s2": columns["az_m_s2"] - G}
        steady.append(replace(flown, name=f"at {trim}", columns=columns))
    with pytest.raises(RefusedError, match="no flight moves in pitch beyond the noise of q"):
        identify_coefficients(Sweep(study="steady", records=tuple(steady)), options)


def test_a_filter_that_lost_its_variances_is_infinitely_unlikely() -> None:
    one = np.ones((1, 1))
    for variance in (0.0, -1.0, np.nan):
        lost = Innovations(states=one, values=one, variances=variance * one, derivative=one, scores=one)
        assert lost.cost == np.inf


def test_a_half_width_is_stored_as_used(flown: FlightRecord) -> None:
    """Five intervals of 0.02 s."""
    options = CoefficientOptions(
        airframe=FRAME,
        form=FORM,
        reference_speed_m_s=20.0,
        method=CoefficientMethod.EQUATION_ERROR,
        half_width_s=0.06,
        spacing_s=0.06,
    )
    sweep = Sweep(study="narrow", records=(flown,))
    narrow = identify_coefficients(sweep, options)
    wide = identify_coefficients(sweep, replace(options, half_width_s=0.1))
    assert narrow.options == wide.options
    np.testing.assert_array_equal(narrow.model.covariance, wide.model.covariance)
    assert set(narrow.warnings) - set(wide.warnings) == {
        "half_width_s is 0.1, not 0.06: test functions reach over five sample intervals at least"
    }


def test_what_cannot_be_judged_is_said(monkeypatch: pytest.MonkeyPatch, flown: FlightRecord) -> None:
    """Filter error knows no correlated noise, and may refuse: neither widens errors, neither is silent."""
    monkeypatch.setattr(turbulence, "disturbed", lambda *_: 0.0)

    def refuses(*_: object) -> None:
        text = "too little"
        raise RefusedError(text)

    monkeypatch.setattr(turbulence, "filter_error", refuses)
    options = CoefficientOptions(airframe=FRAME, form=FORM, reference_speed_m_s=20.0)
    for correlated, said in ((False, "(too little)"), (True, "independent")):
        asked = replace(options, noise_correlated=correlated)
        found = identify_coefficients(Sweep(study="unjudged", records=(flown,)), asked)
        (line,) = [one for one in found.warnings if "could not be judged" in one]
        assert said in line


def test_errors_of_output_error_hold_the_distance_to_filter_error(flown: FlightRecord) -> None:
    """A number three errors beside has a variance of 1 + 3², and what moved with it a covariance."""
    (track,) = tracks(flown, FRAME, outputs=tuple(NOISE), inputs=FORM.inputs, shortest_s=1.0)
    options = CoefficientOptions(airframe=FRAME, form=FORM, reference_speed_m_s=20.0)
    fit, _ = equation_error([track], options, np.full(6, 1e-9))
    found = replace(fit, covariance=np.eye(FORM.size))
    apart = np.zeros(FORM.size)
    apart[[1, 4]] = 3.0, -2.0
    wide = turbulence.Turbulence(found=found, gain=100.0).widened(found.coefficients + apart)
    np.testing.assert_allclose(np.diag(wide)[[0, 1, 4]], [1.0, 10.0, 5.0], rtol=1e-9)  # rounding
    np.testing.assert_allclose(wide[1, 4], -6.0, rtol=1e-9)
