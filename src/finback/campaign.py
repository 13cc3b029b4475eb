"""Campaigns as a stage of a run: begun, flown by a fleet, written partition by partition, resumed where they ended."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Final, Protocol, final

from finback.errors import InputError
from finback.flight.accuracy import SweepAccuracy
from finback.flight.campaign.fleet import Fleet, LocalFleet
from finback.flight.campaign.flying import chunks_of, fly_campaign
from finback.flight.campaign.plan import Campaign
from finback.store.campaign import (
    Begun,
    CampaignHeader,
    alone,
    begin,
    describe_flown,
    fastest_flights,
    finish,
    is_campaign,
    read_begun,
    read_campaign_header,
    tidy,
    write_partitions,
    written_partitions,
)
from finback.store.campaign_flight import Recorded, load_histories, recorded_flights
from finback.store.campaign_size import largest_campaign_bytes
from finback.store.envelope import STUDY_FILE, SWEEP
from finback.store.run import RECORDINGS, discard, new_run
from finback.study import CampaignStudy, read_campaign_study

_MARGIN: Final = 1.05  # of the room on the disk: what files need beside their content


class Watcher(Protocol):
    """Whoever wants to know how far a campaign is."""

    def begin(self, stage: str, steps: int) -> None:
        """Flights begin; ``steps`` calls of ``step`` are expected."""

    def step(self, what: str) -> None:
        """A flight is there: its name."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Processes:
    """Fly by processes on this machine.

    Attributes:
        count: how many; 0 for as many as there are cores.
    """

    count: int = 0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Cluster:
    """Fly on an existing Dask cluster.

    Attributes:
        address: of its scheduler, such as ``tcp://10.0.0.1:8786``.
    """

    address: str


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class OpenCampaign:
    """A campaign that can be flown, from the beginning or from where it ended.

    Attributes:
        run: its folder.
        study: what is flown.
        study_path: the file that it was begun from.
        written: partitions that are complete.
        finished: whether nothing is left to do.
    """

    run: Path
    study: CampaignStudy
    study_path: str
    written: int
    finished: bool

    @property
    def flown(self) -> int:
        """Flights that are written."""
        campaign = self.study.campaign
        return min(self.written * campaign.partition_flights, campaign.flights)

    @property
    def size_bytes(self) -> int:
        """What the flights to come may take on the disk, at most."""
        return largest_campaign_bytes(self.study.campaign, written=self.written)

    @property
    def recordings(self) -> int:
        """Flights that will leave a recording for the viewer, at most."""
        campaign = self.study.campaign
        return min(campaign.history.recordings, campaign.histories)


def begin_campaign(study_file: Path, *, output: Path) -> OpenCampaign:
    """Begin a campaign in a new run below ``output``.

    Raises:
        StudyError: the study file has faults.
        OSError: ``output`` cannot be written to.
    """
    study = read_campaign_study(study_file)
    run = new_run(study.name, study.text, output)
    return OpenCampaign(run=run, study=study, study_path=str(study_file.resolve()), written=0, finished=False)


def reopen_campaign(run: Path) -> OpenCampaign:
    """Return a campaign that was interrupted, or finished; its folder is only read.

    Raises:
        MissingResultError: the folder holds no campaign.
        StudyError: its study file has faults, or the aircraft is gone.
        InputError: a partition is damaged.
    """
    begun = read_begun(run)
    study = read_campaign_study(run / STUDY_FILE, aircraft=begun.aircraft_path)
    written = written_partitions(run, study.campaign)
    return OpenCampaign(run=run, study=study, study_path=begun.study_path, written=written, finished=_is_finished(run))


def _is_finished(run: Path) -> bool:
    return (run / SWEEP.file).is_file()


def check_room(opened: OpenCampaign) -> int:
    """Return how much room the disk has, in bytes.

    Raises:
        InputError: not enough for the flights to come.
    """
    free = shutil.disk_usage(opened.run).free
    if opened.size_bytes * _MARGIN > free:
        raise InputError(
            f"the campaign may take {_shown(opened.size_bytes)}, but {opened.run} has room for {_shown(free)}",
            hint="keep fewer histories or channels in [campaign.history], or choose another --output",
        )
    return free


def describe(opened: OpenCampaign) -> str:
    """Say in a sentence what will be flown and what it may take."""
    campaign = opened.study.campaign
    kept = campaign.history
    sample, departed = kept.sample(campaign.flights), kept.departed(campaign.flights)
    parts = [*([f"{sample}"] if sample else []), *([f"the first {departed} that depart"] if departed else [])]
    width = f"{len(kept.channels)} channels at {1 / campaign.options.sample_interval_s:g} Hz"
    history = f"histories of {' and of '.join(parts)} ({width})" if parts else "no histories"
    recorded = f", recordings of {opened.recordings}" if opened.recordings else ""
    done = f", {opened.flown} of them written before" if opened.flown else ""
    return (
        f"{campaign.flights} flights{done}, {history}{recorded}; at most {_shown(opened.size_bytes)} in"
        f" {campaign.partitions} partitions below {opened.run}"
    )


def fly(opened: OpenCampaign, crew: Processes | Cluster, watcher: Watcher) -> CampaignHeader:
    """Fly what is missing of a campaign, and write it.

    What is missing is counted when no other process can fly it any more. An interruption, or an error, leaves every
    partition that was complete; a campaign of which nothing was written because it could not even begin leaves no
    folder.

    Raises:
        InputError: the disk has no room, another process flies it, or it was begun by other versions.
        AircraftError: the aircraft does not load without a warning.
        RefusedError: workers die again and again at the same flights.
        OSError: the disk is full, or the folder not writable.
    """
    run, campaign = opened.run, opened.study.campaign
    if opened.finished:
        return read_campaign_header(run)
    try:
        check_room(opened)
        with alone(run):
            tidy(run)
            again = replace(opened, written=written_partitions(run, campaign), finished=_is_finished(run))
            return read_campaign_header(run) if again.finished else _fly(again, crew, watcher)
    except BaseException:
        discard_unbegun(opened)
        raise


def discard_unbegun(opened: OpenCampaign) -> None:
    """Remove the folder of a campaign of which nothing was begun."""
    if not is_campaign(opened.run):
        discard(opened.run)


def _fly(opened: OpenCampaign, crew: Processes | Cluster, watcher: Watcher) -> CampaignHeader:
    run, campaign = opened.run, opened.study.campaign
    with _fleet(campaign, crew, opened.written) as fleet:
        begin(
            run,
            Begun(
                study_path=opened.study_path,
                aircraft_path=str(campaign.aircraft.path.resolve()),
                plan_sha256=campaign.sha256,
                vehicles=fleet.provenance,
            ),
        )
        watcher.begin("sweep", campaign.flights - opened.flown)
        flights = fly_campaign(campaign, fleet, partition=opened.written)
        with closing(write_partitions(run, campaign, flights, first=opened.written)) as written:
            for flown in chain.from_iterable(written):
                watcher.step(flown.sample.name)
    watcher.begin("half the step", 0)
    accuracy = _resolution(campaign, fastest_flights(run, campaign))
    recorded = recorded_flights(run, campaign)
    header = describe_flown(run, campaign, accuracy=accuracy, recordings=recorded.statement)
    if recorded.flights:
        watcher.begin("recordings", 0)
        _write_recordings(run, header, recorded)
    finish(run, header)  # last: who finds it finished does nothing more
    return header


def _write_recordings(run: Path, header: CampaignHeader, recorded: Recorded) -> None:
    from finback.views.recording import RecordingContext, write_recording  # noqa: PLC0415 - half a second, not for all

    (run / RECORDINGS).mkdir(exist_ok=True)
    for record in load_histories(run, header, recorded.flights):
        context = RecordingContext(study=header.study, run=run.name)
        write_recording(run / RECORDINGS / f"{record.name}.rrd", record, context=context)


def _resolution(campaign: Campaign, fastest: Mapping[str, int]) -> tuple[SweepAccuracy, ...]:
    from finback.flight.campaign.resolution import resolution  # noqa: PLC0415 - JSBSim, which only workers need before

    return resolution(campaign, fastest)


def resume_command(run: Path) -> str:
    """Return the command that goes on with a campaign; empty if there is nothing to go on with."""
    return f"finback sweep {run}" if is_campaign(run) else ""


def _fleet(campaign: Campaign, crew: Processes | Cluster, partition: int) -> AbstractContextManager[Fleet]:
    """Return who flies the campaign from a partition on; no more processes than can ever fly at a time."""
    if isinstance(crew, Cluster):
        from finback.flight.campaign.cluster import DaskFleet  # noqa: PLC0415 - an extra, and a second

        return DaskFleet(campaign, address=crew.address)
    wanted = crew.count or len(os.sched_getaffinity(0))
    chunks = sum(1 for _ in chunks_of(campaign, partition))  # the last partition may have fewer
    return LocalFleet(campaign, workers=min(wanted, max(1, chunks)))


def _shown(size_bytes: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if size_bytes < 1000:
            return f"{size_bytes:.3g} {unit}"
        size_bytes /= 1000
    return f"{size_bytes:.3g} TB"
