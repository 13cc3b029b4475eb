"""Campaigns on disk: the same bytes whoever flies, nothing half-written, nothing lost, nothing twice."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Self

import numpy as np
import pyarrow.parquet as pq
import pytest

from finback import campaign as stage, pipeline
from finback.campaign import Processes, begin_campaign, fly, reopen_campaign
from finback.errors import InputError, MissingResultError
from finback.files import sha256
from finback.flight.campaign.crew import Crew
from finback.flight.campaign.flying import chunks_of
from finback.flight.reference import Reference
from finback.pipeline import SILENCE
from finback.records import Outcome
from finback.store import load_accuracy, load_identification, load_sweep
from finback.store.campaign import DISCRETIZATION, MAXIMUM_SAMPLES, alone, read_campaign_header
from finback.views import recording
from finback.views.recording import write_recording

PATIENCE_S = 60.0  # for another process to come so far


class Stopping:
    """Stops the campaign at a flight, as Ctrl-C would."""

    def __init__(self, after: int) -> None:
        self.left = after

    def begin(self, stage: str, steps: int) -> None:
        """Take no notice."""

    def step(self, what: str) -> None:
        """Count."""
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt(what)


class InOneProcess:
    """A fleet without processes, so that a test may interrupt it a hundred times."""

    depth = 3

    def __init__(self, crew: Crew) -> None:
        self.crew = crew
        self.waiting: list[object] = []
        self.flown: Counter[int] = Counter()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    @property
    def provenance(self) -> dict[str, dict[str, str]]:
        """As a worker says it."""
        return self.crew.provenance

    def give(self, chunk: object) -> None:
        """Keep it."""
        self.waiting.append(chunk)

    def take(self) -> object:
        """Fly the last one given: the order is not that of the numbers."""
        chunk = self.waiting.pop()
        indices = range(chunk.first, chunk.first + chunk.count)  # type: ignore[attr-defined] # a chunk
        self.flown.update(indices)
        return chunk, tuple(self.crew.fly(index) for index in indices)


@pytest.fixture(scope="session")
def crew(finished_campaign: Path) -> Iterator[Crew]:
    """Whoever flies the finished campaign's flights in this process."""
    with Crew(reopen_campaign(finished_campaign).study.campaign) as found:
        yield found


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fly nothing again when a campaign is complete: how well its step resolves it is not the point here."""
    monkeypatch.setattr(stage, "_resolution", lambda *_: ())


def bytes_of(run: Path) -> dict[str, str]:
    """Return every file of a campaign's table with its fingerprint."""
    table = run / "sweep.parquet"
    return {str(path.relative_to(table)): sha256(path) for path in sorted(table.rglob("*")) if path.is_file()}


def test_every_flight_is_there_once_with_all_it_was_given(finished_campaign: Path) -> None:
    header = read_campaign_header(finished_campaign)
    summary = pq.read_table(finished_campaign / "sweep.parquet" / "summary")
    assert summary.column("flight").to_pylist() == list(range(90))
    assert header.flights == 90
    assert header.outcomes == dict(sorted(Counter(summary.column("outcome").to_pylist()).items()))
    with_samples = stage.reopen_campaign(finished_campaign).study.campaign
    for name in with_samples.names:
        column = summary.column(f"sample_{name}").to_pylist()
        number = with_samples.names.index(name)
        assert column == [with_samples.sample(index).values[number] for index in range(90)]
    assert summary.schema.field("sample_alpha_rad").metadata == {b"unit": b"rad"}
    assert summary.column("alpha_start_rad").to_pylist() == pytest.approx(
        summary.column("sample_alpha_rad").to_pylist(), abs=1e-12
    )


def test_one_process_and_two_leave_the_same_bytes(finished_campaign: Path, campaign_file: Path, tmp_path: Path) -> None:
    opened = begin_campaign(campaign_file, output=tmp_path)
    fly(opened, Processes(count=1), SILENCE)
    assert bytes_of(opened.run) == bytes_of(finished_campaign)
    mine, theirs = (json.loads((run / "sweep.json").read_text()) for run in (opened.run, finished_campaign))
    for tree in (mine, theirs):
        del tree["provenance"]["created_at"], tree["content"]["provenance"]["study_path"]
    assert mine == theirs


@pytest.mark.usefixtures("quick")
def test_interrupted_anywhere_it_resumes_and_repeats_at_most_a_partition(
    finished_campaign: Path, crew: Crew, campaign_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted, flown = bytes_of(finished_campaign), Counter[int]()
    opened = begin_campaign(campaign_file, output=tmp_path)
    for after in (0, 1, 26, 3, 30):
        fleet = InOneProcess(crew)
        monkeypatch.setattr(stage, "_fleet", lambda *_, fleet=fleet: fleet)
        with pytest.raises(KeyboardInterrupt):
            fly(opened, Processes(), Stopping(after))
        flown += fleet.flown
        there = bytes_of(opened.run)
        assert all(wanted[name] == digest for name, digest in there.items()), "something half-written is there"
        again = reopen_campaign(opened.run)
        lost = [number for number in fleet.flown if number >= again.flown]
        assert len(lost) <= 25
        opened = again
    fleet = InOneProcess(crew)
    monkeypatch.setattr(stage, "_fleet", lambda *_: fleet)
    header = fly(opened, Processes(), SILENCE)
    assert min(fleet.flown) == opened.flown == 50
    assert bytes_of(opened.run) == wanted
    assert header == fly(reopen_campaign(opened.run), Processes(), Stopping(0)), "a finished one is left as it is"


def started(study: Path, output: Path, *options: str) -> subprocess.Popen[str]:
    """Start ``finback sweep`` as a program."""
    return subprocess.Popen(
        [sys.executable, "-m", "finback.cli", "sweep", str(study), "--output", str(output), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for_partitions(output: Path, count: int) -> Path:
    """Return the run as soon as so many partitions are there."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        found = list(output.glob("logs/*/*/sweep.parquet/summary/part-*"))
        if len(found) >= count:
            return found[0].parents[2]
        time.sleep(0.005)
    raise AssertionError("no partition came")


def resume(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fly what is missing, in this process."""
    opened = reopen_campaign(run)
    assert 25 <= opened.flown < 90
    written = bytes_of(run)
    kept = [f"{kind}/part-{part:05d}.parquet" for kind in ("summary", "history") for part in range(opened.written)]
    with Crew(opened.study.campaign) as crew:
        monkeypatch.setattr(stage, "_fleet", lambda *_: InOneProcess(crew))
        fly(opened, Processes(), SILENCE)
    assert all(bytes_of(run)[name] == written[name] for name in kept)
    summary = pq.read_table(run / "sweep.parquet" / "summary")
    assert summary.column("flight").to_pylist() == list(range(90))


@pytest.fixture
def long_campaign(campaign_text: str, tmp_path: Path) -> Path:
    """A study whose flights are long enough to be stopped in."""
    study = tmp_path / "study.toml"
    study.write_text(campaign_text.replace("duration_s = 1.5", "duration_s = 8.0"), encoding="utf-8")
    return study


@pytest.mark.usefixtures("quick")
def test_a_program_that_is_interrupted_or_killed_leaves_what_can_be_resumed(
    long_campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = started(long_campaign, tmp_path, "--workers", "1")
    run = wait_for_partitions(tmp_path, 1)
    program.send_signal(signal.SIGINT)
    _, said = program.communicate(timeout=PATIENCE_S)
    assert program.returncode == 130
    assert f"finback sweep {run}" in said
    assert not list((run / "sweep.parquet").rglob("*.part"))
    with pytest.raises(MissingResultError, match="not finished"):
        load_sweep(run)
    there = len(list((run / "sweep.parquet" / "summary").iterdir()))
    program = started(run, tmp_path, "--workers", "1")
    assert wait_for_partitions(tmp_path, there + 1) == run
    program.kill()
    _, said = program.communicate(timeout=PATIENCE_S)
    assert "of them written before" in said
    resume(run, monkeypatch)
    assert not list((run / "sweep.parquet").rglob("*.part"))


@contextmanager
def small_files(size: int) -> Iterator[None]:
    """Let no file grow beyond a size: a write that falls short, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("size", [100, 5000, 20_000])
def test_a_full_disk_ends_the_campaign_which_can_be_resumed(
    finished_campaign: Path,
    crew: Crew,
    campaign_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    size: int,
) -> None:
    """The first write that falls short is that of a summary, of a history, or of the note of what was begun."""
    monkeypatch.setattr(stage, "_fleet", lambda *_: InOneProcess(crew))
    opened = begin_campaign(campaign_file, output=tmp_path)
    with small_files(size), pytest.raises(OSError, match="File too large"):
        fly(opened, Processes(), SILENCE)
    assert not list(tmp_path.rglob("*.part"))
    assert opened.run.exists() == (size > 100), "what could not even begin leaves no folder"
    opened = reopen_campaign(opened.run) if opened.run.exists() else begin_campaign(campaign_file, output=tmp_path)
    fly(opened, Processes(), SILENCE)
    assert bytes_of(opened.run) == bytes_of(finished_campaign)


def test_a_disk_without_room_is_refused_before_anything_flies(
    campaign_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = begin_campaign(campaign_file, output=tmp_path)
    usage = shutil.disk_usage(tmp_path)._replace(free=opened.size_bytes)  # not enough for what files need beside
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    with pytest.raises(InputError, match="may take"):
        fly(opened, Processes(count=1), SILENCE)
    assert not opened.run.exists()


def test_the_size_said_before_is_not_passed(finished_campaign: Path) -> None:
    opened = reopen_campaign(finished_campaign)
    said = replace(opened, written=0).size_bytes
    assert opened.size_bytes < said
    taken = sum(path.stat().st_size for path in (finished_campaign / "sweep.parquet").rglob("*.parquet"))
    assert taken < said


def test_two_programs_do_not_fly_the_same_campaign(campaign_file: Path, tmp_path: Path) -> None:
    opened = begin_campaign(campaign_file, output=tmp_path)
    with alone(opened.run), pytest.raises(InputError, match="another process"):
        fly(opened, Processes(count=1), SILENCE)


@pytest.mark.usefixtures("quick")
def test_interrupted_at_a_recording_it_is_not_finished_and_leaves_all_of_them_later(
    finished_campaign: Path, own_campaign: Path, crew: Crew, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = own_campaign / pipeline.RECORDINGS
    wanted = sorted(path.name for path in folder.iterdir())
    assert len(wanted) == 3
    (own_campaign / "sweep.json").unlink()
    for path in folder.iterdir():
        path.unlink()
    (folder / ".release-0000001.rrd.1.part").write_bytes(b"of a program that was killed")
    monkeypatch.setattr(stage, "_fleet", lambda *_: InOneProcess(crew))

    def interrupted(path: Path, *arguments: object, **options: object) -> None:
        if path.name == wanted[1]:
            raise KeyboardInterrupt
        write_recording(path, *arguments, **options)  # type: ignore[arg-type] # as given

    monkeypatch.setattr(recording, "write_recording", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fly(reopen_campaign(own_campaign), Processes(), SILENCE)
    assert [path.name for path in folder.iterdir()] == wanted[:1]
    again = reopen_campaign(own_campaign)
    assert not again.finished
    monkeypatch.setattr(recording, "write_recording", write_recording)
    header = fly(again, Processes(), SILENCE)
    assert sorted(path.name for path in folder.iterdir()) == wanted
    assert reopen_campaign(own_campaign).finished
    assert read_campaign_header(own_campaign) == header
    assert bytes_of(own_campaign) == bytes_of(finished_campaign)


@pytest.mark.usefixtures("quick")
def test_who_resumes_after_another_flies_only_what_is_missing(
    finished_campaign: Path, crew: Crew, campaign_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both look at the campaign before either flies."""
    begun = begin_campaign(campaign_file, output=tmp_path)
    first, second = InOneProcess(crew), InOneProcess(crew)
    monkeypatch.setattr(stage, "_fleet", lambda *_: first)
    with pytest.raises(KeyboardInterrupt):
        fly(begun, Processes(), Stopping(30))
    (begun.run / ".sweep.json.1.part").write_text("of a program that was killed")
    one, two = reopen_campaign(begun.run), reopen_campaign(begun.run)
    with pytest.raises(KeyboardInterrupt):
        fly(one, Processes(), Stopping(30))
    assert reopen_campaign(begun.run).flown == 50
    assert not list(begun.run.rglob("*.part"))
    monkeypatch.setattr(stage, "_fleet", lambda *_: second)
    header = fly(two, Processes(), SILENCE)
    assert (one.flown, two.flown, min(second.flown)) == (25, 25, 50)
    assert bytes_of(begun.run) == bytes_of(finished_campaign)
    monkeypatch.setattr(stage, "_fleet", lambda *_: pytest.fail("nothing is left to fly"))
    assert fly(one, Processes(), SILENCE) == header


def test_a_campaign_is_looked_at_without_a_change_to_its_folder(own_campaign: Path) -> None:
    """It may be read-only, or another process may be writing to it."""
    part = own_campaign / "sweep.parquet" / "history" / ".part-00003.parquet.1.part"
    part.write_bytes(b"half")
    for left in ("sweep.json", ""):
        before = {path: path.stat().st_mtime_ns for path in own_campaign.rglob("*")}
        assert reopen_campaign(own_campaign).finished == bool(left)
        assert {path: path.stat().st_mtime_ns for path in own_campaign.rglob("*")} == before
        (own_campaign / "sweep.json").unlink(missing_ok=True)


def test_there_are_no_more_processes_than_can_fly(
    campaign_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As many as a partition has chunks; one where nothing is left to fly."""
    asked: list[int] = []
    monkeypatch.setattr(stage, "LocalFleet", lambda _, *, workers: asked.append(workers))
    campaign = begin_campaign(campaign_file, output=tmp_path).study.campaign
    chunks = [sum(1 for _ in chunks_of(campaign, number)) for number in range(campaign.partitions)]
    for number in (0, 3, 4):
        stage._fleet(campaign, Processes(count=500), number)
    stage._fleet(campaign, Processes(count=2), 0)
    assert asked == [chunks[0], chunks[3], 1, 2]
    assert chunks[0] < 25


def test_a_file_system_without_locks_is_no_other_process(
    campaign_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    opened = begin_campaign(campaign_file, output=tmp_path)
    monkeypatch.setattr(fcntl, "flock", fail)
    with pytest.raises(OSError, match="No locks available"):
        fly(opened, Processes(count=1), SILENCE)


def test_a_program_that_is_stopped_before_the_first_flight_leaves_no_folder(
    campaign_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from finback.cli.sweep import sweep

    def stop(_: object) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr(stage, "describe", stop)
    with pytest.raises(KeyboardInterrupt):
        sweep(campaign_file, tmp_path)
    assert not (tmp_path / "logs" / "small").exists()


@pytest.fixture
def own_campaign(finished_campaign: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "logs" / finished_campaign.parent.name / finished_campaign.name
    shutil.copytree(finished_campaign, folder)
    return folder


def test_a_study_that_was_changed_meanwhile_is_not_gone_on_with(own_campaign: Path) -> None:
    (own_campaign / "sweep.json").unlink()
    study = own_campaign / "study.toml"
    study.write_text(study.read_text().replace("draws = 30", "draws = 31"))
    with pytest.raises(InputError, match="of another campaign"):
        reopen_campaign(own_campaign)


def test_other_versions_do_not_go_on_with_a_campaign(
    own_campaign: Path, crew: Crew, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stage, "_fleet", lambda *_: InOneProcess(crew))
    (own_campaign / "sweep.json").unlink()
    file = own_campaign / "campaign.json"
    file.write_text(file.read_text().replace('"jsbsim": "', '"jsbsim": "0.'))
    with pytest.raises(InputError, match="was begun with jsbsim"):
        fly(reopen_campaign(own_campaign), Processes(count=1), SILENCE)


@pytest.mark.parametrize("part", ["summary", "history"])
def test_a_damaged_partition_is_named(own_campaign: Path, part: str) -> None:
    path = own_campaign / "sweep.parquet" / part / "part-00001.parquet"
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 1
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"part-00001\.parquet is not the table"):
        load_sweep(own_campaign)
    path.write_bytes(content[: len(content) // 2])
    (own_campaign / "sweep.json").unlink()
    with pytest.raises(InputError, match=r"part-00001\.parquet.* damaged"):
        reopen_campaign(own_campaign)


def test_later_stages_see_the_flights_whose_histories_were_kept(finished_campaign: Path, crew: Crew) -> None:
    sweep = load_sweep(finished_campaign)
    assert [record.name for record in sweep.records] == [f"release-{number:07d}" for number in range(0, 90, 2)]
    assert {record.outcome for record in sweep.records} <= set(Outcome)
    flown = crew.fly(4)
    record = sweep["release-0000004"]
    assert record["alpha_rad"].tobytes() == flown.history["alpha_rad"].tobytes()
    assert record.schedule.elevator_rad.tobytes() == flown.schedule.elevator_rad.tobytes()
    assert record.provenance["sample_alpha_rad"] == repr(flown.sample.values[1])
    assert np.array_equal(record["elevator_rad"], record.schedule.value(record["time_s"]))


def test_a_model_is_identified_from_a_campaign(own_campaign: Path) -> None:
    found = pipeline.identify(own_campaign)
    stored = load_identification(own_campaign)
    assert stored.model.q_dot.coefficients.tobytes() == found.model.q_dot.coefficients.tobytes()
    powers = found.model.q_dot.powers.tolist()
    elevator = powers.index([0, 0, 1])
    assert found.model.q_dot.variables == ("alpha_rad", "q_rad_s", "elevator_rad")
    assert found.model.q_dot.coefficients[elevator] < 0  # trailing edge down, nose down


def test_a_campaign_without_histories_says_what_to_do(
    campaign_text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, finished_campaign: Path
) -> None:
    study = tmp_path / "study.toml"
    study.write_text(campaign_text.replace("every = 2", "every = 0").replace("draws = 30", "draws = 1"))
    opened = begin_campaign(study, output=tmp_path)
    with Crew(opened.study.campaign) as crew:
        monkeypatch.setattr(stage, "_fleet", lambda *_: InOneProcess(crew))
        fly(opened, Processes(), SILENCE)
    assert not list((opened.run / "sweep.parquet" / "history").iterdir())
    with pytest.raises(InputError, match=r"kept no time histories[\s\S]*\[campaign.history\]"):
        pipeline.identify(opened.run)
    monkeypatch.setattr("finback.store.campaign.MAXIMUM_SAMPLES", 100)
    assert MAXIMUM_SAMPLES > 100
    with pytest.raises(InputError, match="fit in memory"):
        load_sweep(finished_campaign)


def test_a_finished_campaign_says_how_well_its_step_resolves_it(finished_campaign: Path) -> None:
    header = read_campaign_header(finished_campaign)
    told = header.provenance[DISCRETIZATION]
    assert told.startswith("5 flights again at half the step of ")
    assert told in (finished_campaign / "sweep.json").read_text(encoding="utf-8")
    (found,) = load_accuracy(finished_campaign)
    assert found == header.accuracy[0]
    assert found.sample == "5 of 90: the one that turns fastest, the others spread evenly"
    summary = pq.read_table(finished_campaign / "sweep.parquet" / "summary").to_pandas()
    turning = np.maximum(summary["q_max_rad_s"], -summary["q_min_rad_s"])
    assert summary["name"][turning.idxmax()] in {flight.flight for flight in found.flights}
    for flight in found.flights:
        assert isinstance(flight.reference, Reference)
        assert flight.roads_agree


def test_a_finished_campaign_is_shown_and_left_alone(finished_campaign: Path) -> None:
    before = bytes_of(finished_campaign)
    program = started(finished_campaign, finished_campaign, "--json")
    shown, said = program.communicate(timeout=PATIENCE_S)
    assert (program.returncode, said) == (0, "")
    tree = json.loads(shown)
    assert tree["schema"] == "finback/campaign-summary/1"
    assert sum(tree["outcomes"].values()) == tree["flights"] == 90
    assert bytes_of(finished_campaign) == before


def test_a_study_whose_aircraft_does_not_load_leaves_no_folder(campaign_text: str, tmp_path: Path) -> None:
    aircraft = tmp_path / "broken" / "broken.xml"
    aircraft.parent.mkdir()
    aircraft.write_text("<fdm_config name='broken' version='2.0'/>")
    study = tmp_path / "study.toml"
    lines = campaign_text.splitlines()
    lines = [f'aircraft = "{aircraft}"' if line.startswith("aircraft =") else line for line in lines]
    study.write_text("\n".join(lines))
    opened = begin_campaign(study, output=tmp_path)
    with pytest.raises(InputError, match="no aerodynamics"):
        fly(opened, Processes(count=1), SILENCE)
    assert not (tmp_path / "logs" / "small").exists()
    assert os.listdir(tmp_path / "logs") == []  # noqa: PTH208 - nothing hidden either
