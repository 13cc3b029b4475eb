"""Stability, period, damping and pitch rate: what tells a wrong system whose folds and angles are all right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from finback.dynamics.analysis import Analysis, AnalysisOptions, analyze
from finback.dynamics.lienard import Curve, LienardSystem
from finback.dynamics.model import PolynomialModel
from finback.dynamics.reduction import reduce
from finback.flight.equilibrium import equilibria
from finback.flight.plan import FlightOptions
from finback.flight.rig import Rig
from finback.units import to_si
from finback.validation.comparison import equilibrium_metric, paired_equilibria
from finback.validation.linearization import linear_metrics
from finback.validation.metric import Judgement, Metric, Tolerance, verdict

ELEVATORS_RAD = tuple(to_si(value, "deg") for value in (-20.0, -10.0, 0.0, 10.0))
PITCH_RATE = Tolerance(value=to_si(2.0, "deg_s"), source="a test")
ANGLE = Tolerance(value=to_si(0.5, "deg"), source="a test")
OPTIONS = AnalysisOptions(
    elevator_range_rad=(to_si(-40.0, "deg"), to_si(20.0, "deg")),
    elevator_step_rad=to_si(5.0, "deg"),
    alpha_range_rad=(to_si(-34.0, "deg"), to_si(46.0, "deg")),
)


def scaled(curve: Curve, factor: float) -> Curve:
    polynomial = replace(curve.polynomial, coefficients=curve.polynomial.coefficients * factor)
    return Curve(polynomial=polynomial, sensitivity=curve.sensitivity * factor)


def faster(system: LienardSystem, factor: float) -> LienardSystem:
    return replace(
        system,
        force=scaled(system.force, factor),
        elevator_gain=system.elevator_gain * factor,
        elevator_gain_sensitivity=system.elevator_gain_sensitivity * factor,
    )


SPOILED: dict[str, Callable[[LienardSystem], LienardSystem]] = {
    "damping of the wrong sign": lambda system: replace(system, damping=scaled(system.damping, -1.0)),
    "no damping": lambda system: replace(system, damping=scaled(system.damping, 0.0)),
    "a fifth more damping": lambda system: replace(system, damping=scaled(system.damping, 1.2)),
    "ten times too fast": lambda system: faster(system, 100.0),
    "saddles and sinks exchanged": lambda system: faster(system, -1.0),
    "pitch rate in the wrong unit": lambda system: replace(system, pitch_rate=scaled(system.pitch_rate, 0.0175)),
}


def compared(rig: Rig, flight: FlightOptions, analysis: Analysis) -> tuple[tuple[Metric, ...], Metric]:
    simulated = [
        point
        for elevator in ELEVATORS_RAD
        for point in equilibria(rig.derivatives, elevator_rad=elevator, alpha_limits_rad=flight.alpha_limits_rad)
    ]
    pairs = paired_equilibria(simulated, analysis, ELEVATORS_RAD)
    assert len(pairs) > 8
    linear = linear_metrics(pairs, rig.derivatives, PITCH_RATE)
    return linear, equilibrium_metric(simulated, analysis, ELEVATORS_RAD, ANGLE)


def test_the_true_model_agrees_in_all_four(rig: Rig, flight: FlightOptions, fitted_model: PolynomialModel) -> None:
    linear, _ = compared(rig, flight, analyze(reduce(fitted_model), OPTIONS))
    assert [metric.name.removeprefix("equilibria: ") for metric in linear] == [
        "stability predicted wrongly",
        "pitch rate",
        "undamped period",
        "damping ratio",
    ]
    assert verdict(linear) is Judgement.AGREES
    chords = 1e-3  # the tables' chords bend the slopes by far less than this share
    assert all(abs(metric.error) < chords * abs(metric.simulated) for metric in linear[2:])


@pytest.mark.parametrize("fault", SPOILED)
def test_a_system_with_the_right_angles_and_the_wrong_motion_disagrees(
    rig: Rig, flight: FlightOptions, fitted_model: PolynomialModel, fault: str
) -> None:
    analysis = analyze(SPOILED[fault](reduce(fitted_model)), OPTIONS)
    linear, angles = compared(rig, flight, analysis)
    assert angles.judgement is Judgement.AGREES  # this is why the other four are needed
    assert verdict(linear) is Judgement.DISAGREES
