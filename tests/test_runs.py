"""What stands in the folder of a run, and what is gone: which run is the newest, which aircraft was flown."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from finback import pipeline
from finback.errors import InputError, MissingResultError
from finback.store import load_sweep, load_validation, save_sweep
from finback.store.run import new_run
from finback.study import read_study


def test_a_sweep_in_progress_or_killed_is_not_the_newest_run(own_run: Path, small_study: Path, tmp_path: Path) -> None:
    study = read_study(small_study)
    begun = new_run(study.name, study.text, tmp_path)
    assert begun.name > own_run.name
    assert pipeline.newest_run(tmp_path) == own_run
    (own_run / "sweep.json").unlink()
    with pytest.raises(MissingResultError, match="there is no run"):
        pipeline.newest_run(tmp_path)


def test_an_aircraft_that_is_gone_is_named_once_with_the_way_out(own_run: Path, tmp_path: Path) -> None:
    flown = load_sweep(own_run)
    gone = str(tmp_path / "gone.xml")
    save_sweep(replace(flown, provenance={**flown.provenance, "aircraft_path": gone}), own_run)
    with pytest.raises(MissingResultError) as caught:
        pipeline.identify(own_run)
    assert caught.value.message == f"the aircraft that was flown is gone: {gone}"
    assert caught.value.hint.endswith(f"finback sweep {flown.provenance['study_path']}")


def test_the_hint_of_a_lost_table_flies_again(finished_run: Path, own_run: Path) -> None:
    (own_run / "sweep.parquet").unlink()
    with pytest.raises(InputError) as caught:
        load_sweep(own_run)
    study = Path(caught.value.hint.rpartition(" ")[2])
    assert study != own_run / "study.toml"
    assert read_study(study).text == (finished_run / "study.toml").read_text(encoding="utf-8")


def test_a_verdict_that_its_metrics_contradict_is_damaged(own_run: Path) -> None:
    path = own_run / "validation.json"
    tree = json.loads(path.read_bytes())
    assert tree["content"]["verdict"] == "agrees"
    for said in ("disagrees", "inconclusive"):
        tree["content"]["verdict"] = said
        path.write_text(json.dumps(tree), encoding="utf-8")
        with pytest.raises(InputError, match=r"validation\.json is damaged(.|\n)*finback validate"):
            load_validation(own_run)


def test_a_run_may_be_moved(own_run: Path, tmp_path: Path) -> None:
    moved = tmp_path / "elsewhere"
    shutil.move(own_run, moved)
    assert pipeline.identify(moved).segments


def test_a_stage_done_again_with_the_same_result_leaves_later_ones_fresh(own_run: Path) -> None:
    before = (own_run / "analysis.json").read_bytes()
    pipeline.analyze(own_run)
    assert (own_run / "analysis.json").read_bytes() == before
    pipeline.report(own_run)
