"""Options and plans that cannot be flown are refused when they are made."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from finback.errors import InputError
from finback.flight.plan import FlightOptions, FlightPlan, whole_steps
from finback.records import Hold, Schedule

OPTIONS = FlightOptions(alpha_limits_rad=(-0.5, 0.8), elevator_limits_rad=(-0.7, 0.35), elevator_rate_rad_s=1.0)
PLAN = FlightPlan(
    name="hold-01",
    kind="hold",
    alpha_rad=0.1,
    q_rad_s=0.0,
    schedule=Schedule(time_s=[0.0], elevator_rad=[0.0]),
    hold=Hold.FOH,
    duration_s=1.0,
    sample_interval_s=0.01,
    alpha_limits_rad=(-0.5, 0.8),
)


def test_decimal_times_are_counted_in_steps_in_spite_of_rounding() -> None:
    assert whole_steps(0.07, 0.0025, what="it") == 28
    assert whole_steps(1 / 100, 1 / 400, what="it") == 4
    with pytest.raises(InputError, match=r"it of 0\.011 s"):
        whole_steps(0.011, 0.0025, what="it")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"fidelity": "wind-tunnel"}, "known: rig"),
        ({"step_s": 0.0}, "step"),
        ({"sample_interval_s": 0.003}, "whole number"),
        ({"sample_interval_s": 0.0}, "positive"),
        ({"alpha_limits_rad": (0.5, -0.5)}, "increase"),
        ({"alpha_limits_rad": (-4.0, 0.5)}, "inside"),
        ({"elevator_limits_rad": (0.5, math.nan)}, "increase"),
        ({"elevator_rate_rad_s": -1.0}, "rate"),
    ],
)
def test_impossible_options_are_refused(changes: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(OPTIONS, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"alpha_rad": math.nan}, "finite"),
        ({"q_rad_s": math.inf}, "finite"),
        ({"alpha_rad": 0.9}, "outside its limits"),
        ({"duration_s": 0.001}, "shorter"),
    ],
)
def test_impossible_plans_are_refused(changes: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(PLAN, **changes)  # type: ignore[arg-type]
