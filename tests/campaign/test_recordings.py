"""Campaign flights in the viewer: a stated sample and departures are recorded, any other is flown again."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from finback import pipeline
from finback.cli import replay as verb
from finback.cli.application import app
from finback.errors import InputError, MissingResultError
from finback.flight.campaign.crew import MEASURES, Flown
from finback.flight.campaign.flying import chunks_of
from finback.flight.campaign.plan import Campaign, History
from finback.records import Schedule
from finback.store import load_sweep
from finback.store.campaign import RECORDED, read_campaign_header, write_partitions
from finback.store.campaign_flight import flight_number, recorded_flights
from finback.study import read_campaign_study
from finback.views import replay as viewer
from finback.views.recording import read_state

RUNNER = CliRunner()


def _names(run: Path) -> list[str]:
    return sorted(path.stem for path in (run / pipeline.RECORDINGS).glob("*.rrd"))


def test_departures_and_a_sample_are_recorded_with_the_bits_of_the_archive(finished_campaign: Path) -> None:
    flown = load_sweep(finished_campaign)
    names = _names(finished_campaign)
    departed = [record.name for record in flown.records if record.outcome.value != "completed"]
    assert len(names) == 3
    assert len(set(names) & set(departed)) == min(3, len(departed)) > 0
    for name in names:
        shown = read_state(finished_campaign / pipeline.RECORDINGS / f"{name}.rrd")
        stored = flown[name].columns
        assert shown.keys() == stored.keys()
        assert all(shown[key].tobytes() == stored[key].tobytes() for key in stored)


def test_a_campaign_says_which_flights_are_recorded_and_what_is_left_out(finished_campaign: Path) -> None:
    header = read_campaign_header(finished_campaign)
    departed = header.outcomes.get("departed", 0)
    said = header.provenance[RECORDED]
    assert f"{min(departed, 3)} of {departed} that departed and " in said


@pytest.fixture
def campaign(campaign_file: Path) -> Campaign:
    read = read_campaign_study(campaign_file).campaign
    return replace(read, partition_flights=20, history=History(channels=("alpha_rad",), every=3, departures=4))


def _written(run: Path, campaign: Campaign, departed: set[int]) -> None:
    def flown(index: int) -> Flown:
        gone = index in departed
        history = {name: np.arange(2) * 0.01 for name in ("time_s", "alpha_rad")}
        return Flown(
            sample=campaign.sample(index),
            outcome="departed" if gone else "completed",
            note="",
            measures=(0.0,) * len(MEASURES),
            schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1)),
            history=history if gone or campaign.history.keeps(index) else {},
        )

    def chunks() -> Iterator[tuple[Flown, ...]]:
        for number in range(campaign.partitions):
            for chunk in chunks_of(campaign, number):
                yield tuple(flown(index) for index in range(chunk.first, chunk.first + chunk.count))

    for _ in write_partitions(run, campaign, chunks(), first=0):
        pass


@pytest.mark.parametrize("most", [0, 1, 5, 12, 1000])
def test_departures_come_first_then_the_sample_spread_evenly_and_never_more_than_asked(
    campaign: Campaign, tmp_path: Path, most: int
) -> None:
    asked = replace(campaign, history=replace(campaign.history, recordings=most))
    departed = {1, 3, 4, 30, 40, 41, 70, 80}  # 3 and 30 are of the sample, 70 and 80 are too many
    _written(tmp_path, asked, departed)
    found = recorded_flights(tmp_path, asked)
    with_history = {1, 3, 4, 30, 40, 41}
    others = set(range(0, asked.flights, 3)) - departed
    chosen = set(found.flights)
    assert len(found.flights) == len(chosen) == min(most, len(with_history) + len(others))
    assert chosen <= with_history | others
    assert len(chosen & with_history) == min(most, len(with_history))
    if most == 12:
        rest = np.sort(list(chosen & others))
        assert rest.size == 6
        assert np.diff(rest).max() <= 2 * asked.flights / 6
        assert "of flights with a history 6 of 6 that departed and 6 of 28 others; 2 more" in found.statement
        assert "2 more departed and keep no history (departures = 4 in [campaign.history])" in found.statement


def test_flights_go_by_name_or_number(finished_campaign: Path) -> None:
    header = read_campaign_header(finished_campaign)
    assert flight_number(header, "release-0000012") == flight_number(header, "12") == 12
    for wrong in ("90", "-1", "step-0000012", "release-12", "release", "release-0000090", "", "1e1", "²"):
        with pytest.raises(InputError, match="no flight"):
            flight_number(header, wrong)


@pytest.fixture
def own_campaign(finished_campaign: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished_campaign, tmp_path / finished_campaign.name))


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The recordings that the viewer is asked to open."""
    asked: list[Path] = []
    monkeypatch.setattr(viewer, "open_viewer", asked.append)
    return asked


def test_any_flight_can_be_replayed_recorded_or_not_in_either_order(own_campaign: Path, opened: list[Path]) -> None:
    recorded = _names(own_campaign)[0]
    number = next(number for number in range(1, 90, 2) if f"release-{number:07d}" not in _names(own_campaign))
    for arguments in ([recorded, own_campaign], [own_campaign, recorded], [own_campaign, number]):
        done = RUNNER.invoke(app, ["replay", *map(str, arguments)])
        assert done.exit_code == 0, done.output
    assert [path.stem for path in opened] == [recorded, recorded, f"release-{number:07d}"]
    shown = read_state(opened[-1])
    summary = pq.read_table(own_campaign / "sweep.parquet" / "summary").to_pandas().set_index("flight").loc[number]
    assert summary["duration_s"] == shown["time_s"][-1]
    assert {"alpha_rad", "q_rad_s", "theta_rad", "airspeed_m_s", "alpha_dot_rad_s"} <= shown.keys()
    assert RUNNER.invoke(app, ["replay", "--json", recorded, str(own_campaign)]).exit_code == 2


def test_a_flight_flown_again_is_the_same_to_the_last_bit(finished_campaign: Path) -> None:
    done = RUNNER.invoke(app, ["replay", "--refly", "--json", "4", str(finished_campaign)])
    assert done.exit_code == 0, done.output
    tree = json.loads(done.stdout)
    assert tree["same"]
    assert tree["outcome"] == tree["stored_outcome"]
    assert {"sample_alpha_rad", "q_max_rad_s", "time_s", "alpha_rad", "q_rad_s", "elevator_rad"} <= set(
        tree["compared"]
    )
    bare = pipeline.refly(finished_campaign, "5")
    assert bare.same
    assert "time_s" not in bare.compared  # it left no history


def test_a_flight_that_is_another_one_now_is_told(
    finished_campaign: Path, monkeypatch: pytest.MonkeyPatch, own_campaign: Path
) -> None:
    stored = pq.read_table(finished_campaign / "sweep.parquet" / "summary").to_pylist()[7]

    def spoiled(*_: object) -> dict[str, object]:
        return {**stored, "q_max_rad_s": float(np.nextafter(stored["q_max_rad_s"], 9.0)), "outcome": "diverged"}

    monkeypatch.setattr("finback.pipeline.reflown.summary_row", spoiled)
    done = RUNNER.invoke(app, ["replay", "--refly", "7", str(finished_campaign)])
    assert done.exit_code == 1
    assert "not the same: q_max_rad_s" in done.stdout
    with pytest.raises(InputError, match=r"is not what it was then: diverged[\s\S]*q_max_rad_s"):
        pipeline.recording_of(own_campaign, "7")


def test_a_changed_study_flies_nothing_again(own_campaign: Path) -> None:
    study = own_campaign / "study.toml"
    study.write_text(study.read_text(encoding="utf-8").replace("seed = 7", "seed = 8"), encoding="utf-8")
    with pytest.raises(MissingResultError):
        pipeline.refly(own_campaign, "4")


def test_the_verb_says_that_a_flight_was_flown_again(
    own_campaign: Path, opened: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    monkeypatch.setattr(verb, "say", said.append)
    assert RUNNER.invoke(app, ["replay", "13", str(own_campaign)]).exit_code == 0
    assert said == [f"finback: release-0000013 had no recording, it was flown again into {opened[0]}"]
