"""Flights of a run flown again: the same bits, by both kinds of names."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from finback import pipeline
from finback.errors import InputError
from finback.flight.sweep import Planned, plan_flights
from finback.store import load_sweep


@pytest.mark.parametrize("flight", ["release-02", "three-two-one-one-01", "holdout-doublet-01"])
def test_a_flight_of_a_run_comes_back_bit_by_bit(flight: str, finished_run: Path) -> None:
    found = pipeline.refly(finished_run, flight)
    assert found.same
    assert found.record.name == flight
    assert {"time_s", "alpha_rad", "q_rad_s", "elevator_rad"} <= set(found.compared)
    assert not found.versions


def test_other_bits_are_told_by_name(finished_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flown = load_sweep(finished_run)
    record = flown["release-01"]
    other = record.with_columns(alpha_rad=record["alpha_rad"] + 1e-16 + 1e-12)
    spoiled = type(flown)(study=flown.study, records=(other,), provenance=flown.provenance)
    monkeypatch.setattr("finback.pipeline.reflown.load_sweep", lambda _: spoiled)
    found = pipeline.refly(finished_run, "release-01")
    assert not found.same
    assert found.differing == ("alpha_rad",)


@pytest.mark.parametrize("flight", ["three-two-one-one-01", "holdout-doublet-01"])
def test_a_stored_flight_that_is_no_longer_planned_is_told(
    flight: str, finished_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its trim may be found no more by another version of the simulator."""

    def planned(*arguments: Any) -> Planned:
        found = plan_flights(*arguments)
        return replace(found, plans=tuple(plan for plan in found.plans if plan.name not in flight))

    monkeypatch.setattr("finback.pipeline.reflown.plan_flights", planned)
    with pytest.raises(InputError, match=f"'{flight}' is stored in .* plans no such flight now"):
        pipeline.refly(finished_run, flight)


def test_an_unknown_flight_names_the_others(finished_run: Path) -> None:
    with pytest.raises(InputError, match="release-01"):
        pipeline.refly(finished_run, "release-99")
    with pytest.raises(InputError, match="holdout-doublet-01"):
        pipeline.refly(finished_run, "holdout-step-01")
