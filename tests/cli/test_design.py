"""``finback design``: candidates from a study, a model's own flights, bounds, and a sweep that can be flown."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2
from typer.testing import CliRunner

from finback.cli.application import app
from finback.cli.design_request import as_study
from finback.dynamics.equilibrium import equilibria
from finback.dynamics.model import PolynomialModel
from finback.dynamics.reduction import reduce
from finback.errors import InputError
from finback.flight.excitation import ThreeTwoOneOne
from finback.flight.oscillation import MultisineInput
from finback.flight.pulse import matched_unit
from finback.flight.sensors import measure
from finback.flight.sweep import plan_flights
from finback.identification.design.information import form_of
from finback.identification.identify import identify
from finback.identification.method import Method
from finback.pipeline.stages import make_vehicle
from finback.records import Outcome, Sweep
from finback.store import read_model_file
from finback.study import read_study
from finback.study.candidates import candidates

PUBLISHED = Path(__file__).resolve().parents[2] / "aircraft" / "f8ii" / "published.toml"
RUNNER = CliRunner()
WRITTEN = 1e-11  # relative: twelve digits in degrees
AS_PREDICTED = 0.05  # the noise is known to 1/sqrt(2 n) and the model to a part in a thousand; flights are the model's
SEEDS = 4
SWEEP = """
[[sweep]]
kind = "three-two-one-one"
elevator_deg = [0.0, -8.0, -20.0]
amplitude_deg = [1.0, 4.0]
unit_s = 0.7
lead_s = 0.5
duration_s = 6.0

[[sweep]]
kind = "multisine"
elevator_deg = [-5.0, -60.0]
amplitude_deg = 2.0
lowest_hz = 0.2
highest_hz = 1.5
period_s = 5.0
lead_s = 0.5
duration_s = 6.0
"""


def with_candidates(study: Path, sweep: str = SWEEP) -> Path:
    """The small study with another sweep."""
    text = study.read_text(encoding="utf-8")
    head, _, rest = text.partition("[[sweep]]")
    study.write_text(f"{head}{sweep}\n[identification]{rest.partition('[identification]')[2]}", encoding="utf-8")
    return study


def rates(model: PolynomialModel) -> Callable[[float, float, float], tuple[float, float]]:
    return lambda alpha, q, elevator: (
        float(model.alpha_dot(alpha, q, elevator)),
        float(model.q_dot(alpha, q, elevator)),
    )


def test_a_design_is_a_sweep_that_a_study_can_hold(small_study: Path, tmp_path: Path) -> None:
    study, chosen = with_candidates(small_study, SWEEP.replace(", -60.0", "")), tmp_path / "chosen.toml"
    arguments = ["design", str(study), "--model", str(PUBLISHED), "--count", "3", "--output", str(chosen)]
    result = RUNNER.invoke(app, [*arguments, "--json"])
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)
    assert len(document["flights"]) == 3
    assert 0.5 < document["efficiency"] <= 1.0
    assert len(document["coefficients"]) == 12
    assert all(item["of_all_candidates"] < item["standard_error"] for item in document["coefficients"])
    before = read_study(study).maneuvers
    after = read_study(with_candidates(study, chosen.read_text(encoding="utf-8"))).maneuvers
    assert len(after) == 3
    for maneuver in after:
        assert any(
            type(maneuver) is type(other)
            and all(
                getattr(maneuver, part.name) == pytest.approx(getattr(other, part.name), rel=WRITTEN)
                for part in fields(maneuver)
            )
            for other in before
        )


def test_it_says_what_it_chose_and_what_it_left_out(small_study: Path) -> None:
    wild = SWEEP.replace("4.0]", "15.0]").replace(", -60.0", "")
    result = RUNNER.invoke(
        app, ["design", str(with_candidates(small_study, wild)), "--model", str(PUBLISHED), "--count", "2"]
    )
    assert result.exit_code == 0, result.stderr
    assert "Cramér-Rao" in result.stdout
    assert "no candidate, left out: flight 'three-two-one-one" in result.stderr


def test_every_number_of_a_chosen_maneuver_is_shown(small_study: Path) -> None:
    released = """
[[sweep]]
kind = "three-two-one-one"
elevator_deg = -5.0
amplitude_deg = 2.0
unit_s = 0.7
lead_s = 0.5
duration_s = 6.0

[[sweep]]
kind = "release"
elevator_deg = -4.0
alpha_deg = 11.0
q_deg_s = 13.0
duration_s = 5.0
"""
    arguments = ["design", str(with_candidates(small_study, released)), "--model", str(PUBLISHED), "--count", "2"]
    result = RUNNER.invoke(app, arguments)
    assert result.exit_code == 0, result.stderr
    lines = [line.split() for line in result.stdout.splitlines()]
    (heads,) = (line for line in lines if line[:1] == ["flight"])
    for words in ("elevator [deg]", "amplitude [deg]", "unit [s]", "alpha [deg]", "q [deg/s]", "duration [s]"):
        assert words in " ".join(heads)
    rows = {line[0]: {float(cell) for cell in line[1:]} for line in lines if line and line[0].endswith("-01")}
    assert rows["release-01"] == {-4.0, 11.0, 13.0, 5.0}
    assert rows["three-two-one-one-01"] >= {-5.0, 2.0, 0.7, 6.0}


def test_what_cannot_be_chosen_is_an_error(small_study: Path) -> None:
    study = with_candidates(small_study, SWEEP.replace(", -60.0", ""))
    result = RUNNER.invoke(app, ["design", str(study), "--model", str(PUBLISHED), "--count", "9"])
    assert (result.exit_code, "9 flights cannot be chosen from 7" in result.stderr) == (2, True)


def test_a_model_proposes_its_flights_and_they_keep_what_was_predicted(small_study: Path) -> None:
    """From a wanted model to a study that can be flown; flown on the rig and identified, errors are as predicted."""
    whole = small_study.with_name("designed.toml")
    arguments = ["design", str(small_study), "--model", str(PUBLISHED), "--count", "3", "--duration", "8", "--propose"]
    result = RUNNER.invoke(app, [*arguments, "--study", str(whole), "--json"])
    assert result.exit_code == 0, result.stderr
    assert "were proposed" not in result.stderr  # the document says it
    document = json.loads(result.stdout)
    assert document["proposed"] > 50
    predicted = np.array([item["standard_error"] for item in document["coefficients"]])
    before, study = read_study(small_study), read_study(whole)
    assert replace(study, path=before.path, text=before.text, maneuvers=before.maneuvers) == before
    assert len(study.maneuvers) == 3
    model = read_model_file(PUBLISHED).model()
    asked = replace(study.identification, method=Method.OUTPUT_ERROR, form=(form_of(model),))
    plans = plan_flights(study.maneuvers, rates(model), study.flight).plans
    with make_vehicle(study.aircraft, study.condition, study.flight) as rig:
        flown = [rig.fly(plan) for plan in plans]
    assert all(record.outcome is Outcome.COMPLETED for record in flown)
    errors = []
    for seed in range(SEEDS):
        sweep = Sweep(
            study="designed",
            records=tuple(measure(record, study.sensors, seed=seed, index=k) for k, record in enumerate(flown)),
        )
        found = identify(sweep, asked)
        assert np.abs(found.standard_errors / predicted - 1.0).max() < AS_PREDICTED
        errors.append((found.model.coefficients - model.coefficients) / predicted)
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], SEEDS * predicted.size)
    assert low < float(np.square(errors).sum()) < high


def test_candidates_are_matched_to_the_mode_at_each_trim(small_study: Path) -> None:
    study, model = read_study(small_study), read_model_file(PUBLISHED).model()
    found = candidates(model, study.flight, elevator_range_rad=study.analysis.elevator_range_rad, duration_s=12.0)
    assert {one.kind for one in found} == {"three-two-one-one", "multisine", "log-sweep"}
    system = reduce(model)
    for one in found:
        if isinstance(one, ThreeTwoOneOne):
            (point,) = [p for p in equilibria(system, one.elevator_rad) if p.kind.stable]
            frequency = float(np.hypot(point.eigenvalues_real_1_s[0], point.eigenvalues_imag_1_s[0]))
            damping = -float(point.eigenvalues_real_1_s[0]) / frequency
            unit = matched_unit(frequency_rad_s=frequency, damping_ratio=damping)
            assert one.unit_s == pytest.approx(unit, abs=0.5001 * study.flight.sample_interval_s)
        elif isinstance(one, MultisineInput):
            assert one.lowest_1_s < one.highest_1_s / 5.0
    with pytest.raises(InputError, match="proposed"):
        candidates(model, study.flight, elevator_range_rad=(-1.2, -1.0), duration_s=12.0)


def test_a_sweep_is_replaced_in_the_text_and_nothing_else(small_study: Path) -> None:
    study = read_study(small_study)
    text = as_study(small_study, study.maneuvers[:1])
    old = small_study.read_text(encoding="utf-8")
    assert text.count("[[sweep]]") == 1
    assert [line for line in text.splitlines() if line.startswith("#")] == [
        line for line in old.splitlines() if line.startswith("#")
    ]
    assert text.partition("[identification]")[2] == old.partition("[identification]")[2]
    small_study.write_text(f'{old}\n[surprise]\ntext = """\n[[sweep]]\n"""\n', encoding="utf-8")
    with pytest.raises(InputError, match="cannot be replaced"):
        as_study(small_study, study.maneuvers[:1])
