"""The whole validation, on the real rig: a good model agrees. Spoiled ones, end to end, in tests/test_pipeline.py."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from finback.dynamics.analysis import Analysis, AnalysisOptions, analyze
from finback.dynamics.reduction import reduce
from finback.errors import InputError
from finback.flight.excitation import Doublet, Release, ThreeTwoOneOne
from finback.flight.plan import FlightOptions
from finback.flight.rig import Rig
from finback.flight.sensors import Sensors
from finback.flight.sweep import fly_sweep, plan_flights
from finback.identification.identify import Identification, identify
from finback.identification.options import IdentificationOptions
from finback.records import Sweep
from finback.units import to_si
from finback.validation.metric import Judgement, Tolerance, verdict
from finback.validation.options import FoldOptions, Tolerances, ValidationOptions
from finback.validation.validate import Validation, validate


def _deg(value: float) -> float:
    return to_si(value, "deg")


def pulses(elevator: float) -> ThreeTwoOneOne:
    return ThreeTwoOneOne(elevator_rad=_deg(elevator), amplitude_rad=_deg(3.0), unit_s=0.5, lead_s=0.5, duration_s=6.0)


def release(elevator: float, alpha: float, q: float = 0.0) -> Release:
    return Release(elevator_rad=_deg(elevator), alpha_rad=_deg(alpha), q_rad_s=to_si(q, "deg_s"), duration_s=4.0)


SWEEP = (
    *(pulses(elevator) for elevator in (-32.0, -20.0, 0.0, 10.0)),
    release(-36.0, 38.0, -40.0),
    release(0.0, 40.0),
    release(-20.0, 36.0),
    release(0.0, -24.0),
    release(10.0, -19.0),
    release(-25.0, -30.0, 40.0),
)
DOUBLET = Doublet(elevator_rad=_deg(-22.0), amplitude_rad=_deg(7.0), unit_s=0.8, lead_s=0.5, duration_s=4.0)
IDENTIFICATION = IdentificationOptions(alpha_window_rad=(_deg(-32.5), _deg(45.5)))
ANALYSIS = AnalysisOptions(
    elevator_range_rad=(_deg(-40.0), _deg(20.0)),
    elevator_step_rad=_deg(5.0),
    alpha_range_rad=(_deg(-34.0), _deg(46.0)),
)


def _tolerance(value: float, unit: str) -> Tolerance:
    return Tolerance(value=to_si(value, unit), source="a requirement of this test")


@pytest.fixture(scope="module")
def options(short: FoldOptions) -> ValidationOptions:
    return ValidationOptions(
        holdout=(DOUBLET, release(3.0, -20.0)),
        equilibrium_elevators_rad=(_deg(-30.0), _deg(0.0), _deg(10.0)),
        fold=short,
        tolerances=Tolerances(
            alpha_rmse=_tolerance(1.5, "deg"),
            q_rmse=_tolerance(2.0, "deg_s"),
            theil=_tolerance(0.25, "1"),
            fold_elevator=_tolerance(0.05, "deg"),  # ten records identify the folds to about 0.01 deg
            ramp_fold_elevator=_tolerance(0.1, "deg"),  # short ramps from 1 deg before the fold: 0.02 deg
            equilibrium_alpha=_tolerance(0.2, "deg"),
        ),
        seed=1,
    )


@pytest.fixture(scope="module")
def sweep(rig: Rig, flight: FlightOptions) -> Sweep:
    sensors = Sensors(alpha_noise_rad=_deg(0.1), q_noise_rad_s=to_si(0.1, "deg_s"))
    flights = plan_flights(SWEEP, rig.derivatives, flight).plans
    return Sweep(study="test", records=tuple(fly_sweep(rig, flights, sensors=sensors, seed=1)))


@pytest.fixture(scope="module")
def identification(sweep: Sweep) -> Identification:
    return identify(sweep, IDENTIFICATION)


@pytest.fixture(scope="module")
def analysis(identification: Identification) -> Analysis:
    return analyze(reduce(identification.model), ANALYSIS)


@pytest.fixture(scope="module")
def said() -> list[str]:
    return []


@pytest.fixture(scope="module")
def validation(  # noqa: PLR0913, PLR0917 - what a validation needs, and a place for what it says
    sweep: Sweep,
    identification: Identification,
    analysis: Analysis,
    rig: Rig,
    options: ValidationOptions,
    flight: FlightOptions,
    said: list[str],
) -> Validation:
    return validate(sweep, identification, analysis, rig, options, flight, said.append)


def test_a_model_identified_from_good_data_agrees(validation: Validation, said: list[str]) -> None:
    assert validation.verdict is Judgement.AGREES
    assert validation.verdict is verdict(validation.metrics)
    assert all(metric.counted for metric in validation.metrics)
    assert len({metric.name for metric in validation.metrics}) == len(validation.metrics)
    assert len(validation.metrics) == 2 * 4 + 1 + 2 * 3 + 1 + 4
    assert not validation.notes
    assert [len(fold.flown) for fold in validation.folds] == [1, 1]
    assert [fold.predicted for fold in validation.folds] == [(0,), (1,)]
    assert len(validation.equilibria) == 9
    assert [holdout.record.name for holdout in validation.holdouts] == ["holdout-doublet-01", "holdout-release-01"]
    limits = (_deg(-40.0), _deg(20.0))
    assert limits[0] <= validation.curve.elevator_rad.min()
    assert validation.curve.elevator_rad.max() <= limits[1]
    assert len(said) == 2 + 1 + 2 * 2


def test_holdout_flights_carry_no_noise(validation: Validation) -> None:
    """Beside the prediction, what is left is far below the 0.1 deg of the sensors."""
    for holdout in validation.holdouts:
        assert 0.0 < holdout.alpha_rmse_rad < _deg(0.05)
        assert holdout.predicted.shape == (len(holdout.record), 2)


def test_a_window_without_the_folds_leaves_them_out(
    sweep: Sweep, rig: Rig, options: ValidationOptions, flight: FlightOptions
) -> None:
    window = IdentificationOptions(alpha_window_rad=(_deg(-12.0), _deg(22.0)))
    identification = identify(sweep, window)
    analysis = analyze(reduce(identification.model), ANALYSIS)
    found = validate(sweep, identification, analysis, rig, options, flight, _silent)
    folds = [metric for metric in found.metrics if metric.name.startswith("fold at")]
    assert len(folds) == 6
    assert not any(metric.counted for metric in folds)
    assert not any(metric.judgement is Judgement.AGREES for metric in folds)
    assert sum("left out of the verdict" in note for note in found.notes) == 2


def test_a_maneuver_of_the_sweep_is_refused_as_holdout(
    sweep: Sweep,
    identification: Identification,
    analysis: Analysis,
    rig: Rig,
    options: ValidationOptions,
    flight: FlightOptions,
) -> None:
    for leak, name in (
        (pulses(-20.0), "three-two-one-one-02"),
        (replace(pulses(0.0), duration_s=9.0), "three-two-one-one-03"),
        (release(0.0, 40.0), "release-02"),
    ):
        leaky = replace(options, holdout=(DOUBLET, leak))
        with pytest.raises(InputError, match=rf"is '{name}' of the sweep"):
            validate(sweep, identification, analysis, rig, leaky, flight, _silent)


def test_without_folds_that_can_be_flown_the_rest_decides(
    sweep: Sweep, identification: Identification, analysis: Analysis, rig: Rig, options: ValidationOptions
) -> None:
    """Only the middle of the elevator range is open; both folds lie beyond it, and that is said."""
    narrow = FlightOptions(
        alpha_limits_rad=(_deg(-33.0), _deg(46.0)),
        elevator_limits_rad=(_deg(-30.0), _deg(14.0)),
        elevator_rate_rad_s=to_si(60.0, "deg_s"),
    )
    found = validate(sweep, identification, analysis, rig, options, narrow, _silent)
    assert [fold.flown for fold in found.folds] == [(), ()]
    assert sum("cannot be flown" in note for note in found.notes) == 2
    count = next(metric for metric in found.metrics if metric.name == "number of folds")
    assert (count.simulated, count.predicted) == (2.0, 2.0)
    on_curve = [metric for metric in found.metrics if metric.name.endswith("equilibrium curve")]
    assert [metric.judgement for metric in on_curve] == [Judgement.AGREES] * 2
    assert found.verdict is Judgement.AGREES
    assert np.isfinite([metric.error for metric in found.metrics]).all()
    assert not any(math.isinf(metric.uncertainty) for metric in found.metrics)


def _silent(sentence: str) -> None:
    assert sentence
