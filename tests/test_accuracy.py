"""A sweep's error of its own, as a run keeps and shows it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from finback import pipeline
from finback.cli import documents, tables
from finback.flight.accuracy import FlightAccuracy, SweepAccuracy
from finback.flight.reference import NoReference, Reference
from finback.records import Outcome
from finback.store import load_accuracy, load_sweep
from finback.store.codec import from_tree, to_tree


def _flight(**changes: object) -> FlightAccuracy:
    given: dict[str, object] = {
        "flight": "a-01",
        "alpha_error_rad": 2e-6,
        "q_error_rad_s": 1e-5,
        "order": 2,
        "growth": 3.0,
        "sensitive": False,
        "outcome": Outcome.COMPLETED,
        "outcome_at_half_step": Outcome.COMPLETED,
        "reference": Reference(alpha_error_rad=3e-6, q_error_rad_s=1e-5, uncertainty_rad=1e-9, corners={}),
    }
    return FlightAccuracy(**{**given, **changes})  # type: ignore[arg-type]


def _sweep(*flights: FlightAccuracy) -> SweepAccuracy:
    return SweepAccuracy(fidelity="rig", step_s=0.0025, sample="all of the study", flights=flights)


def test_a_run_keeps_both_errors_of_every_kind_of_flight(finished_run: Path) -> None:
    (found,) = load_accuracy(finished_run)
    flown = load_sweep(finished_run)
    kinds = {record.provenance["kind"] for record in flown.records}
    sampled = {flown[flight.flight].provenance["kind"] for flight in found.flights}
    assert sampled == kinds
    for flight in found.flights:
        assert isinstance(flight.reference, Reference)
        assert flight.roads_agree
        assert flight.resolved
    assert not found.faults
    assert flown.provenance[pipeline.DISCRETIZATION] == found.sentence()


def test_both_errors_are_shown_on_the_terminal_in_json_and_in_the_report(
    finished_run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    accuracy, flown = load_accuracy(finished_run), load_sweep(finished_run)
    tables.show_sweep(finished_run, flown, accuracy)
    printed = capsys.readouterr().out
    documents.show(documents.of_sweep(finished_run, flown, accuracy))
    tree = json.loads(capsys.readouterr().out)
    page = (finished_run / pipeline.REPORT).read_text(encoding="utf-8")
    for flight, item in zip(accuracy[0].flights, tree["accuracy"][0]["flights"], strict=True):
        assert isinstance(flight.reference, Reference)
        assert item["reference"]["alpha_error_rad"] == flight.reference.alpha_error_rad
        for error in (flight.alpha_error_rad, flight.reference.alpha_error_rad):
            assert f"{error:.1e}" in printed
            assert f"{error:.1e}" in page
    assert accuracy[0].sample in printed


def test_a_step_that_is_too_long_is_told_and_so_are_roads_that_do_not_agree() -> None:
    rough = Reference(alpha_error_rad=4e-4, q_error_rad_s=1e-3, uncertainty_rad=1e-8, corners={"aero/alpha-deg": 90})
    assert not _sweep(_flight()).faults
    (too_long,) = _sweep(_flight(alpha_error_rad=2e-5)).faults
    assert "'a-01' is not resolved by the step: its error of alpha is 2e-05 rad, more than 1e-05" in too_long
    assert not _sweep(_flight(alpha_error_rad=3e-4, reference=rough)).faults
    assert "more than 5e-04" in _sweep(_flight(alpha_error_rad=6e-4, reference=rough)).faults[0]
    assert "do not say the same" in _sweep(_flight(alpha_error_rad=3e-5, reference=rough)).faults[0]
    unknown = NoReference(reason="actuators")
    assert not _sweep(_flight(alpha_error_rad=3e-4, reference=unknown)).faults
    assert any("actuators" in remark for remark in _sweep(_flight(reference=unknown)).remarks)


def test_of_a_sensitive_flight_only_the_outcome_counts() -> None:
    assert not _sweep(_flight(sensitive=True, alpha_error_rad=1.0)).faults
    other = _sweep(_flight(sensitive=True, outcome_at_half_step=Outcome.DEPARTED))
    assert other.faults == ("rig: 'a-01' is completed, at half the step departed",)


@pytest.mark.parametrize(
    "reference",
    [
        NoReference(reason="a reason"),
        Reference(alpha_error_rad=1e-9, q_error_rad_s=float("inf"), uncertainty_rad=0.0, corners={"aero/a": 3}),
    ],
)
def test_what_is_known_of_a_step_comes_back_from_disk(reference: Reference | NoReference) -> None:
    found = _sweep(_flight(reference=reference), _flight(alpha_error_rad=float("inf")))
    assert from_tree(to_tree(found), SweepAccuracy) == found
