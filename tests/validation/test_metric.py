"""The judgement of one comparison, and the verdict over many."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, strategies as st

from finback.errors import InputError
from finback.validation.metric import Judgement, Metric, Tolerance, verdict

AGREES, DISAGREES, INCONCLUSIVE = Judgement.AGREES, Judgement.DISAGREES, Judgement.INCONCLUSIVE

sizes = st.floats(min_value=0.0, max_value=1e6)
signed = st.floats(min_value=-1e6, max_value=1e6)
tolerances = st.floats(min_value=1e-6, max_value=1e6)


def metric(*, error: float, uncertainty: float, tolerance: float = 1.0, counted: bool = True) -> Metric:
    return Metric(
        name="fold",
        unit="rad",
        simulated=error,
        predicted=0.0,
        uncertainty=uncertainty,
        tolerance=tolerance,
        source="a requirement",
        counted=counted,
        note="" if counted else "extrapolated",
    )


@pytest.mark.parametrize(
    ("error", "uncertainty", "expected"),
    [
        (0.0, 0.0, AGREES),
        (0.75, 0.25, AGREES),  # |E| + U95 = tolerance, exactly: agrees
        (-0.75, 0.25, AGREES),
        (0.75, 0.5, INCONCLUSIVE),
        (1.25, 0.5, INCONCLUSIVE),
        (1.25, 0.25, INCONCLUSIVE),  # |E| − U95 = tolerance, exactly: not yet a disagreement
        (-1.5, 0.25, DISAGREES),
        (1.5, 0.0, DISAGREES),
        (0.0, math.inf, INCONCLUSIVE),
        (1e300, math.inf, INCONCLUSIVE),
        (math.nan, 0.0, DISAGREES),
        (math.nan, math.inf, DISAGREES),
        (math.inf, 0.0, DISAGREES),
        (-math.inf, math.inf, DISAGREES),
    ],
)
def test_the_truth_table_of_a_judgement(error: float, uncertainty: float, expected: Judgement) -> None:
    assert metric(error=error, uncertainty=uncertainty).judgement is expected


@given(error=signed, uncertainty=sizes, tolerance=tolerances)
def test_only_the_size_of_the_error_matters(error: float, uncertainty: float, tolerance: float) -> None:
    one = metric(error=error, uncertainty=uncertainty, tolerance=tolerance)
    assert one.judgement is replace(one, simulated=-error).judgement


@given(error=signed, uncertainty=sizes, tolerance=tolerances, more=sizes)
def test_more_uncertainty_never_makes_a_clear_judgement(
    error: float, uncertainty: float, tolerance: float, more: float
) -> None:
    before = metric(error=error, uncertainty=uncertainty, tolerance=tolerance)
    after = replace(before, uncertainty=uncertainty + more)
    assert after.judgement in {before.judgement, INCONCLUSIVE}


@given(error=signed, uncertainty=sizes, tolerance=tolerances)
def test_agreeing_means_that_no_error_within_the_uncertainty_exceeds_the_tolerance(
    error: float, uncertainty: float, tolerance: float
) -> None:
    worst, best = abs(error) + uncertainty, max(0.0, abs(error) - uncertainty)
    judgement = metric(error=error, uncertainty=uncertainty, tolerance=tolerance).judgement
    assert (judgement is AGREES) == (worst <= tolerance)
    assert (judgement is DISAGREES) == (best > tolerance)


def test_any_disagreement_wins_then_any_inconclusive() -> None:
    good, unsure, bad = (metric(error=e, uncertainty=u) for e, u in ((0.0, 0.0), (0.9, 0.5), (2.0, 0.0)))
    assert verdict([good, good]) is AGREES
    assert verdict([good, unsure]) is INCONCLUSIVE
    assert verdict([unsure, bad, good]) is DISAGREES


def test_what_is_not_counted_does_not_move_the_verdict() -> None:
    good, extrapolated = metric(error=0.0, uncertainty=0.0), metric(error=2.0, uncertainty=0.0, counted=False)
    assert verdict([good, extrapolated]) is AGREES


@pytest.mark.parametrize("error", [0.0, 2.0, math.nan])
def test_what_is_not_counted_is_called_neither_right_nor_wrong(error: float) -> None:
    assert metric(error=error, uncertainty=0.0, counted=False).judgement is INCONCLUSIVE


def test_nothing_counted_is_inconclusive() -> None:
    assert verdict([]) is INCONCLUSIVE
    assert verdict([metric(error=0.0, uncertainty=0.0, counted=False)]) is INCONCLUSIVE


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_a_tolerance_is_finite_and_positive(value: float) -> None:
    with pytest.raises(InputError, match="tolerance"):
        Tolerance(value=value, source="a requirement")


def test_a_tolerance_without_a_source_is_refused() -> None:
    with pytest.raises(InputError, match="source"):
        Tolerance(value=1.0, source="  ")
    with pytest.raises(InputError, match="source"):
        replace(metric(error=0.0, uncertainty=0.0), source="")


def test_a_metric_in_degrees_is_refused() -> None:
    with pytest.raises(InputError, match="'rad'"):
        replace(metric(error=0.0, uncertainty=0.0), unit="deg")


@pytest.mark.parametrize("uncertainty", [-1e-9, math.nan])
def test_an_uncertainty_is_not_negative(uncertainty: float) -> None:
    with pytest.raises(InputError, match="uncertainty"):
        metric(error=0.0, uncertainty=uncertainty)


def test_leaving_out_needs_a_reason() -> None:
    with pytest.raises(InputError, match="why"):
        replace(metric(error=0.0, uncertainty=0.0), counted=False)
