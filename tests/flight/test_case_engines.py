"""Engines of a case: started, left off, and what is said where a throttle moves engines that do not run."""

from __future__ import annotations

from pathlib import Path

import jsbsim
import numpy as np
import pytest

from finback.errors import AircraftError
from finback.flight.case import Case, CaseEngine, FlownCase
from finback.flight.case_column import CaseColumn
from finback.flight.case_drive import Drive, named_drive
from finback.flight.case_flight import fly_case
from finback.flight.case_start import case_start
from finback.records import Hold

AIRCRAFT = Path(jsbsim.get_default_root_dir()) / "aircraft"
BALL = Path(__file__).parent / "data" / "aircraft" / "brick" / "brick.xml"
COLUMNS = (
    CaseColumn(name="thrust_n", jsbsim_property="propulsion/engine/thrust-lbs", jsbsim_unit="lbf"),
    CaseColumn(name="running_1", jsbsim_property="propulsion/engine/set-running", jsbsim_unit="1"),
)


def _held(name: str, value: float) -> Drive:
    return named_drive(name, np.zeros(1), np.array([value]), Hold.FOH)


def _fly(name: str, *drives: Drive, **more: object) -> FlownCase:
    start = case_start([("altitude_ft", 5000.0), ("airspeed_kt", 150.0)])
    asked = {"start": start, "duration_s": 0.5, "step_s": 0.01, "columns": COLUMNS, **more}
    return fly_case(Case(source=AIRCRAFT / name / f"{name}.xml", drives=drives, **asked))  # type: ignore[arg-type]


def test_engines_that_are_asked_for_run_and_the_throttle_rules_them() -> None:
    low, high = (_fly("c310", _held("throttle", value), engines=CaseEngine.RUNNING) for value in (0.3, 1.0))
    assert (low.columns["running_1"] == 1.0).all()
    assert (high.columns["running_1"] == 1.0).all()
    assert high.columns["thrust_n"][-1] > low.columns["thrust_n"][-1] + 300.0
    assert not any("engine" in word for word in (*low.warnings, *high.warnings))


def test_a_turbine_begins_at_its_throttle() -> None:
    low, high = (_fly("A4", _held("throttle", value), engines=CaseEngine.RUNNING) for value in (0.2, 1.0))
    for flown in (low, high):  # steady: nothing is left of JSBSim's start at full thrust
        assert flown.columns["thrust_n"] == pytest.approx(flown.columns["thrust_n"][0], rel=0.01)
    assert high.columns["thrust_n"][0] > 1.5 * low.columns["thrust_n"][0]


@pytest.mark.parametrize("how", ["schedule", "setting", "start"])
def test_a_throttle_without_engines_is_told(how: str) -> None:
    drives = (_held("throttle", 0.6),) if how == "schedule" else ()
    settings = {
        "schedule": (),
        "setting": (("fcs/throttle-cmd-norm", 0.6),),
        "start": (("propulsion/set-running", -1.0),),  # its mixture is lean: they die at once
    }[how]
    flown = _fly("c310", *drives, settings=settings)
    assert (flown.columns["running_1"] == 0.0).all()
    assert [word for word in flown.warnings if "no engine runs: --engines running" in word]
    assert not _fly("c310", _held("throttle", 0.0)).warnings  # nothing was asked of them


def test_a_scheduled_start_is_flown_once_and_not_called_lost() -> None:
    """Written at each step, JSBSim would let the engines turn steadily at full throttle at each of them."""
    drives = (_held("throttle", 0.6), _held("mixture", 1.0), _held("propulsion/set-running", -1.0))
    flown = _fly("c310", *drives, duration_s=2.0)
    assert (flown.columns["running_1"] == 1.0).all()
    assert not any("not flown" in word or "no engine" in word for word in flown.warnings)
    other = _fly("c310", drives[0], engines=CaseEngine.RUNNING, duration_s=2.0)
    assert flown.columns["thrust_n"][-1] == pytest.approx(other.columns["thrust_n"][-1], rel=0.1)


def test_engines_that_cannot_start_and_settings_that_do_not_start_them() -> None:
    with pytest.raises(AircraftError, match="has no engine to start"):
        fly_case(Case(source=BALL, duration_s=0.1, step_s=0.01, engines=CaseEngine.RUNNING))
    warnings = _fly("c310", settings=(("propulsion/engine/set-running", 1.0),)).warnings
    assert any("engines are started by --engines running" in word for word in warnings)
    assert not any("--schedule propulsion" in word for word in warnings)


def test_engines_that_find_no_steady_state_run_all_the_same() -> None:
    """A fine propeller, as any pilot has it at the start, stalls JSBSim's search."""
    fine = [_held(f"fcs/advance-cmd-norm{number}", 1.0) for number in ("", "[1]")]
    flown = _fly("c310", _held("throttle", 0.6), *fine, engines=CaseEngine.RUNNING)
    assert (flown.columns["running_1"] == 1.0).all()
    assert any("finds no steady state" in word for word in flown.warnings)
