"""The benchmarks' tasks give what their references say; how long they take is no test's business."""

from __future__ import annotations

import importlib
import json
import math
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"

# Rounding of what is located, a hundredfold; the references have 34 digits.
TOLERANCES = {
    "equilibria": 1e-12,  # deg
    "cycles": 1e-14,
    "homoclinic": 1e-14,
    "heteroclinic": 1e-12,  # deg
    "bogdanov-takens": 1e-13,
    "diagram": 1e-12,  # its neutral loop, where two curves cross, is known to fewer digits
    "wells": 1e-13,
    "damped-wells": 1e-12,
}
ON_BORDER = 0.005  # share of random states so near the border of the region that two integrators may differ


@pytest.fixture(scope="module")
def tasks() -> ModuleType:
    """The tasks, as the script sees them."""
    sys.path.insert(0, str(SCRIPTS))
    try:
        return importlib.import_module("bench_tasks")
    finally:
        sys.path.pop(0)


def test_every_task_has_a_tolerance(tasks: ModuleType) -> None:
    assert set(tasks.TASKS) == {*TOLERANCES, "map"}


@pytest.mark.parametrize("name", TOLERANCES)
def test_finback_agrees_with_the_reference(tasks: ModuleType, name: str) -> None:
    side = tasks.TASKS[name]().finback
    score = side.score(side.run())
    assert score.error <= TOLERANCES[name]
    assert score.points > 1


def test_the_map_agrees_with_plain_integration(tasks: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tasks, "MAP_CELLS", 200)
    monkeypatch.setattr(tasks, "MAP_SAMPLE", 100)
    side = tasks.map_task().finback
    score = side.score(side.run())
    assert score.points == 200 * 200
    assert score.error <= ON_BORDER


def test_a_wrong_or_missing_point_is_an_error(tasks: ModuleType) -> None:
    found = tasks.loops_along(tasks.CUBIC, tasks.reference.CUBIC_B0)
    shifted = [a0 + 1e-9 for a0 in tasks.reference.CUBIC_LOOP_A0]
    assert tasks.loop_score(shifted, found).error == pytest.approx(1e-9, rel=1e-6)
    assert tasks.loop_score(shifted, ((), *found[1:])).error == math.inf


def test_a_diagram_without_a_curve_or_point_is_an_error(tasks: ModuleType) -> None:
    found = tasks.diagram(tasks.CUBIC, (-1.0, -0.7))
    loop = [curve.lam.item(-1) for curve in found.of_kind(tasks.CurveKind.HOMOCLINIC)]
    assert tasks.edge_score(found, loop).error == 0.0
    assert tasks.edge_score(found, [loop[0] + 1e-6]).error == pytest.approx(1e-6, rel=1e-6)
    assert tasks.edge_score(found, loop, [(-0.5, 0.0)]).error == math.inf


def test_the_script_prints_json_alone() -> None:
    command = [sys.executable, str(SCRIPTS / "bench_dynamics.py"), "equilibria", "--alone", "--repeats", "1", "--json"]
    document = json.loads(subprocess.run(command, capture_output=True, check=True, text=True).stdout)
    assert document["schema"] == "finback/bench/1"
    (task,) = document["tasks"]
    assert task["name"] == "equilibria"
    assert task["sides"][0]["score"]["error"] <= TOLERANCES["equilibria"]
    assert task["cpu_ratio"] is None
