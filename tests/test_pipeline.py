"""The chain, with real parts: one small run of the shipped aircraft, then what stops it and what spoils it."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from finback import pipeline
from finback.dynamics.analysis import analyze
from finback.errors import AircraftError, InputError, MissingResultError, StudyError
from finback.identification.identify import identify
from finback.records import FlightRecord
from finback.store import (
    load_analysis,
    load_identification,
    load_sweep,
    load_validation,
    save_analysis,
    save_identification,
    save_sweep,
)
from finback.store.codec import to_tree
from finback.store.run import new_run
from finback.study import read_study
from finback.units import from_si
from finback.validation.metric import Judgement
from finback.views.recording import read_state

AIRCRAFT = Path(__file__).resolve().parents[1] / "aircraft" / "f8ii"
DISAGREES = Judgement.DISAGREES


class Stop:
    """A progress that interrupts at the n-th step of a stage."""

    def __init__(self, stage: str, step: int) -> None:
        self.stage, self.left, self.now = stage, step, ""

    def begin(self, stage: str, steps: int) -> None:
        """Note the stage."""
        assert steps >= 0
        self.now = stage
        self._count()

    def step(self, what: str) -> None:
        """Count."""
        assert what
        self._count()

    def _count(self) -> None:
        self.left -= self.now == self.stage
        if self.left < 0:
            raise KeyboardInterrupt


def files_of(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


# a run that nothing stops


def test_the_model_of_a_small_study_agrees_with_the_simulator(finished_run: Path) -> None:
    validation = load_validation(finished_run)
    assert validation.verdict == Judgement.AGREES, [metric for metric in validation.metrics if metric.counted]


def test_a_run_leaves_every_file_of_the_design_and_nothing_else(finished_run: Path) -> None:
    flights = [record.name for record in load_sweep(finished_run).records]
    holdouts = [holdout.record.name for holdout in load_validation(finished_run).holdouts]
    assert len(flights) == 6
    assert len(holdouts) == 1
    expected = {"study.toml", "sweep.parquet", "sweep.json", "model.json", "analysis.json", "validation.json"}
    expected |= {"report.html", *(f"recordings/{name}.rrd" for name in (*flights, *holdouts))}
    found = files_of(finished_run)
    assert {name for name in found if not name.startswith("figures/")} == expected
    assert all(name.endswith(".svg") for name in found - expected)
    assert found - expected


def test_a_recording_holds_the_flight_bit_for_bit(finished_run: Path) -> None:
    for record in load_sweep(finished_run).records:
        state = read_state(pipeline.recording(finished_run, record.name))
        assert state.keys() == record.columns.keys()
        assert all(state[name].tobytes() == values.tobytes() for name, values in record.columns.items()), record.name


def test_the_files_are_the_results(finished_run: Path) -> None:
    flown = load_sweep(finished_run)
    study = read_study(finished_run / "study.toml")
    again = identify(flown, study.identification)
    model = load_identification(finished_run)
    assert to_tree(again) == to_tree(model)
    assert to_tree(analyze(load_analysis(finished_run).system, study.analysis)) == to_tree(load_analysis(finished_run))


def test_the_sweep_says_what_was_flown(finished_run: Path) -> None:
    flown = load_sweep(finished_run)
    study = read_study(finished_run / "study.toml")
    assert flown.study == "small"
    assert flown.provenance["aircraft_sha256"] == study.aircraft.sha256
    tree = json.loads((finished_run / "sweep.json").read_bytes())
    assert tree["provenance"]["aircraft_sha256"] == study.aircraft.sha256


def test_the_results_are_repeatable(small_study: Path, finished_run: Path, tmp_path: Path) -> None:
    _, flown = pipeline.sweep(small_study, output=tmp_path)
    before = load_sweep(finished_run)
    for ours, theirs in zip(flown.records, before.records, strict=True):
        for name, values in theirs.columns.items():
            assert values.tobytes() == ours[name].tobytes(), (theirs.name, name)


# folders


def test_a_second_run_never_overwrites_the_first(small_study: Path, tmp_path: Path) -> None:
    study = read_study(small_study)
    runs = [new_run(study.name, study.text, tmp_path) for _ in range(12)]
    assert len({run.resolve() for run in runs}) == 12
    for run in runs:
        (run / "sweep.json").touch()
    assert pipeline.newest_run(tmp_path) == runs[-1]


def test_without_a_run_there_is_no_newest_one(tmp_path: Path) -> None:
    with pytest.raises(MissingResultError, match="finback run STUDY"):
        pipeline.newest_run(tmp_path)


def test_an_unknown_flight_names_those_that_are_there(finished_run: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no recording of a flight 'loop'(.|\n)*release-01"):
        pipeline.recording(finished_run, "loop")
    with pytest.raises(InputError, match="make a run with"):
        pipeline.recording(tmp_path, "loop")


def test_an_output_that_is_a_file_is_an_os_error_and_leaves_it_alone(small_study: Path, tmp_path: Path) -> None:
    output = tmp_path / "file"
    output.write_text("mine", encoding="utf-8")
    with pytest.raises(OSError, match="file"):
        pipeline.sweep(small_study, output=output)
    assert output.read_text(encoding="utf-8") == "mine"


# what stops a run


@pytest.mark.parametrize("step", [0, 1, 4])
def test_an_interrupted_sweep_leaves_no_run(small_study: Path, tmp_path: Path, step: int) -> None:
    output = tmp_path / "output"
    with pytest.raises(KeyboardInterrupt):
        pipeline.run(small_study, output=output, progress=Stop("sweep", step))
    assert files_of(output) == set()
    assert not (output / "logs" / "small").exists()


@pytest.mark.parametrize(("stage", "step"), [("identify", 0), ("analyze", 0), ("validate", 0), ("validate", 3)])
def test_an_interrupted_stage_leaves_the_stages_before_it(own_run: Path, stage: str, step: int) -> None:
    left = {"identify": "model.json", "analyze": "analysis.json", "validate": "validation.json"}[stage]
    before = files_of(own_run)
    with pytest.raises(KeyboardInterrupt):
        getattr(pipeline, stage)(own_run, progress=Stop(stage, step))
    assert files_of(own_run) == before
    assert (own_run / left).is_file()


def test_a_broken_study_makes_no_folder(small_study: Path, tmp_path: Path) -> None:
    small_study.write_text(small_study.read_text(encoding="utf-8").replace("seed = 7", ""), encoding="utf-8")
    with pytest.raises(StudyError):
        pipeline.run(small_study, output=tmp_path / "output")
    assert not (tmp_path / "output").exists()


def test_a_sweep_that_fails_in_the_simulator_leaves_no_run(small_study_text: str, tmp_path: Path) -> None:
    folder = tmp_path / "broken"
    folder.mkdir()
    (folder / "broken.xml").write_text("<fdm_config/>", encoding="utf-8")
    study = tmp_path / "study.toml"
    study.write_text(re.sub('aircraft = ".*"', f'aircraft = "{folder}"', small_study_text), encoding="utf-8")
    with pytest.raises(AircraftError):
        pipeline.run(study, output=tmp_path / "output")
    assert files_of(tmp_path / "output") == set()
    assert any("broken.xml" in fault for fault in pipeline.check(study).faults)


def test_an_aircraft_that_has_changed_makes_the_sweep_stale(own_run: Path) -> None:
    flown = load_sweep(own_run)
    save_sweep(replace(flown, provenance={**flown.provenance, "aircraft_sha256": "0" * 64}), own_run)
    with pytest.raises(MissingResultError, match=r"aircraft .* has changed(.|\n)*finback sweep"):
        pipeline.identify(own_run)


def test_a_report_of_a_stale_validation_is_refused(own_run: Path) -> None:
    save_analysis(load_analysis(own_run), own_run)
    (own_run / "analysis.json").write_text(
        (own_run / "analysis.json").read_text(encoding="utf-8") + "\n", encoding="utf-8"
    )
    with pytest.raises(MissingResultError, match="finback validate"):
        pipeline.report(own_run)


def test_check_finds_every_fault_of_study_aircraft_and_model(small_study: Path, own_run: Path, tmp_path: Path) -> None:
    assert pipeline.check(small_study, model=own_run).faults == ()
    assert pipeline.check(small_study, model=own_run / "model.json").faults == ()
    small_study.write_text(small_study.read_text(encoding="utf-8").replace("seed = 7", ""), encoding="utf-8")
    faults = pipeline.check(small_study, model=tmp_path / "model.json").faults
    assert len(faults) == 2
    assert "seed: missing" in faults[0]
    assert "model.json cannot be read" in faults[1]


# what spoils a model: each mistake, made through the public functions, must end in "disagrees"


def spoiled(run: Path, spoil: Callable[[FlightRecord], FlightRecord]) -> Judgement:
    flown = load_sweep(run)
    save_sweep(replace(flown, records=tuple(spoil(record) for record in flown.records)), run)
    pipeline.identify(run)
    pipeline.analyze(run)
    return pipeline.validate(run).verdict


def test_an_elevator_of_the_wrong_sign_disagrees(own_run: Path) -> None:
    assert spoiled(own_run, lambda record: record.with_columns(elevator_rad=-record["elevator_rad"])) == DISAGREES


def test_degrees_taken_for_radians_disagree(own_run: Path) -> None:
    def in_degrees(record: FlightRecord) -> FlightRecord:
        names = ("alpha_rad", "q_rad_s", "elevator_rad")
        return record.with_columns(**{name: from_si(record[name], "deg") for name in names})

    assert spoiled(own_run, in_degrees) == DISAGREES


def test_damping_and_force_exchanged_disagree(own_run: Path) -> None:
    analysis = load_analysis(own_run)
    system = replace(analysis.system, damping=analysis.system.force, force=analysis.system.damping)
    save_analysis(analyze(system, analysis.options), own_run)
    assert pipeline.validate(own_run).verdict == DISAGREES


# another published model: verdict and folds follow it


PUBLISHED = AIRCRAFT / "published.toml"
HEAVY_HAND = {"elevator": 1.2, "alpha": 0.85, "alpha3": 1.1}  # of dq/dt: an elevator of more effect, less stability
LIGHT_HAND = {"elevator": 0.8, "alpha3": 0.85}
NO_TRIM = """
[[sweep]]
kind = "hold"
elevator_deg = -28.0
duration_s = 2.0

[[validation.holdout]]
kind = "step"
elevator_deg = -28.0
amplitude_deg = 2.0
lead_s = 0.5
duration_s = 4.0

[validation.fold]"""


def perturbed(factors: dict[str, float], small_study_text: str, folder: Path) -> tuple[Path, list[float]]:
    """Build the aircraft of a changed model; return a study of it and the elevators of its folds by the polynomial."""
    published = tomllib.loads(PUBLISHED.read_text(encoding="utf-8"))
    z, m = published["alpha_dot_deg_s"], published["q_dot_deg_s2"]
    lines = PUBLISHED.read_text(encoding="utf-8").partition("[q_dot_deg_s2]")
    moment = lines[2]
    for name, factor in factors.items():
        moment, count = re.subn(rf"(?m)^{name} = (\S+)", f"{name} = {factor * m[name]!r}", moment)
        assert count == 1
        m[name] *= factor
    aircraft = folder / "f8ii"
    shutil.copytree(AIRCRAFT, aircraft)
    (aircraft / "published.toml").write_text("".join((*lines[:2], moment)), encoding="utf-8")
    script = AIRCRAFT.parents[1] / "scripts" / "build_f8ii.py"
    subprocess.run([sys.executable, script, "--source", aircraft], check=True, capture_output=True)
    k = m["q_plus_alpha_dot"] / z["q"]  # q from dα/dt = 0, put into dq/dt = 0
    gain = m["elevator"] - k * z["elevator"]
    holding = Polynomial([(k * z[name] - m[name]) / gain for name in ("constant", "alpha", "alpha2", "alpha3")])
    study = folder / "study.toml"
    text = small_study_text.replace(str(AIRCRAFT), str(aircraft)).replace("[validation.fold]", NO_TRIM.lstrip())
    study.write_text(text, encoding="utf-8")
    return study, [float(holding(alpha)) for alpha in np.sort(holding.deriv().roots())]


@pytest.mark.parametrize(
    ("factors", "flown", "without_trim"),
    [pytest.param(HEAVY_HAND, [1, 1], 2, marks=pytest.mark.slow), (LIGHT_HAND, [1, 0], 0)],
    ids=["heavy", "light"],
)
def test_verdict_and_folds_follow_another_model(
    factors: dict[str, float], flown: list[int], without_trim: int, small_study_text: str, tmp_path: Path
) -> None:
    """One with its lower fold at -22 deg, above the trim of two maneuvers; one with it at -50 deg, beyond the limits.

    The upper fold of the second, at 19.25 deg, is too near to the limit for the fast ramps.
    """
    study, truth = perturbed(factors, small_study_text, tmp_path)
    done = pipeline.run(study, output=tmp_path)
    assert done.validation.verdict == Judgement.AGREES, [m for m in done.validation.metrics if m.counted]
    predicted = [from_si(fold.elevator_rad, "deg") for fold in done.analysis.folds]
    simulated = [from_si(fold.simulated.elevator_rad, "deg") for fold in done.validation.folds]
    assert simulated == pytest.approx(truth, abs=0.001)  # chords of tables with breakpoints every 0.1 deg
    assert predicted == pytest.approx(truth, abs=0.1)  # the small study's tolerance
    assert [len(fold.flown) for fold in done.validation.folds] == flown
    for fold, elevator in zip(done.validation.folds, truth, strict=True):
        for witness in fold.flown:
            assert from_si(witness.hold.elevator_rad, "deg") == pytest.approx(elevator, abs=0.02)
    notes = [note for note in done.validation.notes if "no stable equilibrium" in note]
    assert len(notes) + ("hold-01" in done.sweep.provenance.get(pipeline.NOT_FLOWN, "")) == without_trim
    assert sum("cannot be flown: it lies outside" in note for note in done.validation.notes) == flown.count(0)


def test_a_model_given_by_the_user_is_analyzed(own_run: Path) -> None:
    identification = load_identification(own_run)
    wrong = identification.model.with_coefficients(identification.model.coefficients * np.array([1.1] + [1.0] * 11))
    save_identification(replace(identification, model=wrong), own_run)
    with pytest.raises(MissingResultError, match="finback analyze"):
        load_analysis(own_run)
    assert len(pipeline.analyze(own_run).folds) == 2
