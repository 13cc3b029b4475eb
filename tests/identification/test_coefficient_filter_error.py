"""Filter error in coefficient form: its filter against one written otherwise, and flights in disturbed and calm air."""

from __future__ import annotations

import importlib.util
import re
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from finback.arrays import FloatArray
from finback.identification.coefficient.directions import Score, directions, score_of
from finback.identification.coefficient.identify import CoefficientIdentification, identify_coefficients
from finback.identification.coefficient.innovations import RATE_OF, Noises, innovations
from finback.identification.coefficient.motion import layout, motion
from finback.identification.coefficient.options import Biases, CoefficientMethod, CoefficientOptions
from finback.identification.coefficient.shooting import shoot
from finback.identification.coefficient.track import OUTPUTS, STATES, Track, tracks
from finback.records import FlightRecord, Hold, Sweep

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
SENSORS = np.array([0.04, 1.5e-4, 2e-4, 4e-4, 4e-3, 0.01, 0.03])
# Rounding of matrices of condition 1e6, over 600 samples.
SAME = 1e-6
# Central differences over 60 s of flight.
EXACT = 1e-3
# What gains move by with a number, which the derivative leaves out: measured 0.034.
GAINS = 0.06
# 33 numbers of three flights in rough air; chance passes this once in 300.
LARGEST = 3.9
FLIGHTS = 3


def _load(name: str) -> ModuleType:
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, SCRIPTS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def gusty() -> ModuleType:
    """The script that flies a transport through disturbed air by equations of its own."""
    _load("study_coefficients")
    return _load("gusty_flights")


@pytest.fixture(scope="module")
def rough(gusty: ModuleType) -> list[FlightRecord]:
    """Flights of 60 s at 10 Hz in rough air."""
    flown = gusty.transport_flights(gusty.Air(kicks=tuple(gusty.KICKS)), FLIGHTS, first=3)
    return [records[0] for records in flown]


@pytest.fixture(scope="module")
def calm(gusty: ModuleType) -> FlightRecord:
    """The same in calm air."""
    (flown,) = gusty.transport_flights(gusty.Air(), 1, first=3)[0]
    assert isinstance(flown, FlightRecord)
    return flown


def _options(gusty: ModuleType, method: CoefficientMethod) -> CoefficientOptions:
    return CoefficientOptions(
        airframe=gusty.TRANSPORT, form=gusty.TRANSPORT_FORM, reference_speed_m_s=104.67, method=method
    )


def _identified(gusty: ModuleType, record: FlightRecord, method: CoefficientMethod) -> CoefficientIdentification:
    return identify_coefficients(Sweep(study="one", records=(record,)), _options(gusty, method))


def _track(gusty: ModuleType, record: FlightRecord, outputs: tuple[str, ...] = OUTPUTS) -> Track:
    (track,) = tracks(record, gusty.TRANSPORT, outputs=outputs, inputs=("elevator_rad",), shortest_s=1.0)
    return track


def test_the_filter_is_that_of_kalman(gusty: ModuleType, rough: list[FlightRecord]) -> None:
    track, numbers = _track(gusty, rough[0]), gusty.TRANSPORT_TRUTH
    terms = layout(gusty.TRANSPORT_FORM, gusty.TRANSPORT, 104.67)
    noises = Noises(process=gusty.KICKS**2, sensors=SENSORS**2, start=SENSORS[:4] ** 2)
    found = innovations(track, terms, numbers, np.zeros(9), noises, substeps=4)
    # All outputs of a sample at once, by matrices.
    state, covariance, total = track.states[0], np.diag(SENSORS[:4] ** 2), 0.0
    process = 0.5 * track.interval_s * np.diag([*gusty.KICKS[:2] ** 2, 0.0, gusty.KICKS[2] ** 2])
    for i in range(len(track) - 1):
        states, derivatives = shoot(
            terms, numbers, state, track, samples=(i, i + 1), bias_rad=0.0, delay_s=0.0, substeps=4
        )
        transition = derivatives[1, :, :4]
        covariance = transition @ (covariance + process) @ transition.T + process
        j = i + 1
        at = motion(
            terms, numbers, states[1:], track.inputs[j : j + 1], track.density_kg_m3[j : j + 1],
            track.thrust_n[j : j + 1], track.gravity_m_s2,
        )  # fmt: skip
        places = list(RATE_OF.values())
        slopes = np.vstack([np.eye(4), at.jacobian[0, places]])
        missed = track.measured[j] - np.concatenate([states[1], at.rates[0, places]])
        whole = slopes @ covariance @ slopes.T + np.diag(SENSORS**2)
        gain = covariance @ slopes.T @ np.linalg.inv(whole)
        total += float(missed @ np.linalg.solve(whole, missed) + np.linalg.slogdet(whole)[1])
        state, covariance = states[1] + gain @ missed, covariance - gain @ slopes @ covariance
    assert found.cost == pytest.approx(total, rel=SAME)
    np.testing.assert_allclose(found.states[-1], state, rtol=SAME, atol=1e-9)


@pytest.mark.parametrize(
    ("hold", "outputs", "close"),
    [
        (Hold.FOH, OUTPUTS[4:], EXACT),
        (Hold.ZOH, OUTPUTS[4:], EXACT),
        (Hold.FOH, OUTPUTS, GAINS),
    ],
)
def test_the_derivatives_of_innovations_are_derivatives(
    gusty: ModuleType, rough: list[FlightRecord], hold: Hold, outputs: tuple[str, ...], close: float
) -> None:
    """Where states are known from the start and not measured, the filter has no gains: then they are exact."""
    track = _track(gusty, replace(rough[0], hold=hold), outputs)
    terms = layout(gusty.TRANSPORT_FORM, gusty.TRANSPORT, 104.67)
    sensors = 1e3 * SENSORS[-len(outputs) :]
    noises = Noises(process=np.zeros(3), sensors=sensors**2, start=np.zeros(4))
    values = np.concatenate([gusty.TRANSPORT_TRUTH, 1e-4 * sensors, [1e-3, 0.013]])

    def predicted(point: FloatArray) -> FloatArray:
        found = innovations(track, terms, point[:11], point[11:], noises, substeps=2)
        return found.values / np.sqrt(found.variances)

    found = innovations(track, terms, values[:11], values[11:], noises, substeps=2, derived=True).derivative
    for column, row in enumerate(np.eye(values.size)):
        step = 1e-5 * max(1.0, abs(values[column]))
        slope = -(predicted(values + step * row) - predicted(values - step * row)) / (2 * step)
        off = float(np.linalg.norm(found[:, :, column] - slope) / np.linalg.norm(slope))
        assert off < close, column


def test_the_scores_are_derivatives(gusty: ModuleType, rough: list[FlightRecord]) -> None:
    track = _track(gusty, rough[0])
    terms = layout(gusty.TRANSPORT_FORM, gusty.TRANSPORT, 104.67)
    logs = np.log(np.concatenate([gusty.KICKS**2, SENSORS**2]))

    def cost(point: FloatArray) -> float:
        noises = Noises(process=np.exp(point[:3]), sensors=np.exp(point[3:]), start=SENSORS[:4] ** 2)
        return innovations(track, terms, gusty.TRANSPORT_TRUTH, np.zeros(9), noises, substeps=2).cost

    noises = Noises(process=np.exp(logs[:3]), sensors=np.exp(logs[3:]), start=SENSORS[:4] ** 2)
    here = innovations(track, terms, gusty.TRANSPORT_TRUTH, np.zeros(9), noises, substeps=2, scored=True)
    spread, moved = here.scores
    white = here.whitened[:, :, np.newaxis]
    found = (spread * (1.0 - white**2) + 2.0 * white * moved).sum(axis=(0, 1))
    slopes = [(cost(logs + row) - cost(logs - row)) / 2e-4 for row in 1e-4 * np.eye(logs.size)]
    # The Jacobians move with the states by a little: 0.04 of scores whose chance is some 30.
    np.testing.assert_allclose(found, slopes, atol=0.2)


def test_in_rough_air_errors_are_those_it_states(gusty: ModuleType, rough: list[FlightRecord]) -> None:
    offs = []
    for record in rough:
        found = _identified(gusty, record, CoefficientMethod.FILTER_ERROR)
        assert found.converged
        assert found.coloring == 1.0
        offs.append((found.model.numbers - gusty.TRANSPORT_TRUTH) / found.model.standard_errors)
        # 600 samples tell a density to 15 %.
        np.testing.assert_allclose(np.sqrt(found.process), gusty.KICKS, rtol=0.25)
        assert any("airspeed 0.3" in warning and "the motion is disturbed" in warning for warning in found.warnings)
    assert np.abs(offs).max() < LARGEST
    assert 0.6 < float(np.sqrt(np.mean(np.square(offs)))) < 1.4


def test_output_error_in_rough_air_is_widened_and_says_so(gusty: ModuleType, rough: list[FlightRecord]) -> None:
    found = _identified(gusty, rough[0], CoefficientMethod.OUTPUT_ERROR)
    off = np.abs(found.model.numbers - gusty.TRANSPORT_TRUTH) / found.model.standard_errors
    assert off.max() < LARGEST
    assert any(
        warning.startswith("the motion is disturbed") and "filter-error" in warning for warning in found.warnings
    )
    assert not found.process.any()


def test_in_calm_air_it_is_output_error(gusty: ModuleType, calm: FlightRecord) -> None:
    found = _identified(gusty, calm, CoefficientMethod.FILTER_ERROR)
    other = _identified(gusty, calm, CoefficientMethod.OUTPUT_ERROR)
    assert not any("disturbed" in warning for warning in found.warnings)
    assert not any("disturbed" in warning or "elevator" in warning for warning in other.warnings)
    assert (np.sqrt(found.process) < 0.01 * gusty.KICKS).all()
    apart = np.abs(found.model.numbers - other.model.numbers) / other.model.standard_errors
    # The filter leaves the forces of the first sample out.
    assert apart.max() < 0.3
    np.testing.assert_allclose(found.model.standard_errors, other.model.standard_errors, rtol=0.2)


@pytest.mark.parametrize("method", [CoefficientMethod.OUTPUT_ERROR, CoefficientMethod.FILTER_ERROR])
def test_an_elevator_that_is_late_is_told_though_no_delay_was_asked_for(
    gusty: ModuleType, calm: FlightRecord, method: CoefficientMethod
) -> None:
    early = np.interp(calm["time_s"] + 0.03, calm["time_s"], calm["elevator_rad"])
    (said,) = (
        warning
        for warning in _identified(gusty, calm.with_columns(elevator_rad=early), method).warnings
        if "the elevator acts" in warning
    )
    size = re.search(r"acts (\d+) ± (\d+) ms later than recorded .* elevator_delay_s = (\S+)", said)
    assert size is not None
    assert abs(float(size[1]) - 30.0) < max(4.0 * float(size[2]), 3.0)
    assert float(size[3]) > 0.03


def test_the_chance_of_kicks_is_chance() -> None:
    """Against a sum of weighted squares, drawn: what chance exceeds once in 100 has that probability."""
    random = np.random.default_rng(1)
    columns = np.cumsum(random.standard_normal((80, 12)), axis=0)
    influence = random.standard_normal((80, 3))
    basis = np.linalg.qr(np.ones((80, 1))).Q
    influence -= basis @ (basis.T @ influence)
    covariance = np.linalg.inv(influence.T @ influence)

    def score(residual: FloatArray) -> Score:
        residual -= basis @ (basis.T @ residual)
        residual -= influence @ (covariance @ (influence.T @ residual))
        return score_of([directions(columns, np.ones((80, 1)), influence, residual)], covariance)

    chances = np.array([score(random.standard_normal(80)).of_noise for _ in range(4000)])
    # 4000 draws tell a probability of 0.01 to 0.0016, one of 0.5 to 0.008; three moments do so to a tenth.
    assert np.mean(chances < 0.01) == pytest.approx(0.01, abs=0.005)
    assert np.mean(chances < 0.5) == pytest.approx(0.5, abs=0.05)


def test_biases_are_told_in_rough_air(gusty: ModuleType, rough: list[FlightRecord]) -> None:
    record = rough[1]
    late = np.interp(record["time_s"] + 0.05, record["time_s"], record["elevator_rad"])
    biased = record.with_columns(az_m_s2=record["az_m_s2"] + 0.2, elevator_rad=late)
    options = replace(_options(gusty, CoefficientMethod.FILTER_ERROR), biases=Biases(az_m_s2=0.5, elevator_delay_s=0.1))
    found = identify_coefficients(Sweep(study="biased", records=(biased,)), options)
    (one,) = found.stretches
    values, errors = (dict(zip(one.names, array.tolist(), strict=True)) for array in (one.values, one.errors))
    for name, truth in (("az bias", 0.2), ("elevator delay", 0.05)):
        assert abs(values[name] - truth) < 3.5 * errors[name], name
    assert values["elevator delay"] > 5.0 * errors["elevator delay"]


def test_states_alone_will_do_and_the_pitch_angle_need_not_be_measured(
    gusty: ModuleType, rough: list[FlightRecord]
) -> None:
    outputs = tuple(name for name in STATES if name != "theta_rad")
    kept = ("time_s", "elevator_rad", "thrust_n", *outputs)
    record = replace(rough[2], columns={name: rough[2].columns[name] for name in kept})
    found = _identified(gusty, record, CoefficientMethod.FILTER_ERROR)
    off = np.abs(found.model.numbers - gusty.TRANSPORT_TRUTH) / found.model.standard_errors
    assert found.residual_names == outputs
    assert off.max() < LARGEST
