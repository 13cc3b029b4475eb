"""What views are made from: a short exact flight, the results of a real run, and results with hardly anything."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from finback.dynamics.analysis import Analysis
from finback.dynamics.analysis_cycles import CycleAbsence, CycleVerdict, ElevatorCycles
from finback.dynamics.branch import Branch
from finback.dynamics.connection.search import Connections
from finback.identification.identify import Identification
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule, Sweep
from finback.store import load_analysis, load_identification, load_sweep, load_validation
from finback.validation.metric import Judgement
from finback.validation.trajectory import Holdout, Theil
from finback.validation.validate import Validation


@pytest.fixture
def flight() -> FlightRecord:
    """Return two seconds of a damped pitch oscillation at 50 Hz, in numbers that no unit conversion keeps."""
    time = np.arange(100) / 50
    decay = np.exp(-0.6 * time)
    alpha = 0.1 + 0.2 * decay * np.cos(3.0 * time)
    q = np.gradient(alpha, time)
    return FlightRecord(
        name="doublet-01",
        columns={
            "time_s": time,
            "alpha_rad": alpha,
            "q_rad_s": q,
            "theta_rad": alpha + 0.05 * time,
            "airspeed_m_s": np.full(100, 250.0),
            "altitude_m": np.full(100, 9000.0),
            "elevator_rad": np.where(time < 0.5, -0.1, 0.05),
        },
        outcome=Outcome.COMPLETED,
        note="flew its 2 s",
        condition=Condition(airspeed_m_s=250.0, density_kg_m3=0.5, gravity_m_s2=9.80665, altitude_m=9000.0),
        schedule=Schedule(time_s=np.array([0.0, 0.5, 0.5]), elevator_rad=np.array([-0.1, -0.1, 0.05])),
        hold=Hold.ZOH,
        provenance={"aircraft": "test", "note|with": "a | bar\nand a line"},
    )


@dataclass(frozen=True, kw_only=True)
class Results:
    """Everything that a report is made of."""

    sweep: Sweep
    identification: Identification
    analysis: Analysis
    validation: Validation


@pytest.fixture(scope="session")
def results(finished_run: Path) -> Results:
    """Return the results of a real, small run."""
    return Results(
        sweep=load_sweep(finished_run),
        identification=load_identification(finished_run),
        analysis=load_analysis(finished_run),
        validation=load_validation(finished_run),
    )


@pytest.fixture(scope="session")
def bare(results: Results) -> Results:
    """Return results in which hardly anything was found: what the pictures and the page must survive."""
    analysis, validation = results.analysis, results.validation
    nothing = {
        name: np.empty(0) for name in ("alpha_rad", "elevator_rad", "q_rad_s", "divergence_1_s", "determinant_1_s2")
    }
    flags = {name: np.empty(0, dtype=bool) for name in ("stable", "in_domain")}
    fold = validation.folds[0]
    ramp = replace(
        fold.flown[0].ramp,
        rates_rad_s=np.empty(0),
        crossing_elevator_rad=np.empty(0),
        elevator_rad=math.nan,
        uncertainty_rad=math.inf,
        coefficients=np.full(3, np.nan),
        residual_rad=math.nan,
    )
    unknown = replace(
        validation.metrics[0],
        name="unknown <b>&",
        predicted=math.nan,
        uncertainty=math.inf,
        counted=False,
        note="extrapolated",
    )
    return Results(
        sweep=replace(results.sweep, records=results.sweep.records[:1]),
        identification=replace(
            results.identification, segments=(), unused=("a-01: too short",), warnings=("<script> & -3 deg",)
        ),
        analysis=replace(
            analysis,
            branch=Branch(**nothing, **flags),
            equilibria=(),
            folds=(),
            hopf_points=(),
            neutral_saddles=(),
            bogdanov_takens=(),
            connections=Connections(heteroclinics=(), homoclinics=(), stretches=()),
            limit_cycles=ElevatorCycles(
                cycles=(),
                families=(),
                absence=CycleAbsence(
                    verdict=CycleVerdict.UNKNOWN, statement="nothing", parts=(), undecided_rad=np.empty((0, 2))
                ),
                searched_rad=(),
                obstacles=(),
            ),
            regimes=(),
            regions=(),
            notes=(),
        ),
        validation=replace(
            validation,
            verdict=Judgement.INCONCLUSIVE,
            metrics=(unknown,),
            holdouts=(_blown_up(validation.holdouts[0]),),
            folds=(replace(fold, predicted=(), flown=(replace(fold.flown[0], ramp=ramp),)),),
            equilibria=(),
            notes=(),
        ),
    )


def _blown_up(holdout: Holdout) -> Holdout:
    """Return a hold-out flight whose prediction leaves the double range half way, all extrapolated."""
    predicted = holdout.predicted.copy()
    half = len(predicted) // 2
    predicted[half - 5 : half] *= 1e5
    predicted[half:] = np.nan
    infinite = Theil(coefficient=1.0, bias=math.nan, variance=math.nan, covariance=math.nan)
    return replace(
        holdout,
        predicted=predicted,
        compared=half,
        in_domain=False,
        alpha_rmse_rad=math.inf,
        q_rmse_rad_s=math.inf,
        alpha_theil=infinite,
        q_theil=infinite,
    )
