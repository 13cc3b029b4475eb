"""What a campaign says it may take is never passed, whatever its flights are."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import count
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings, strategies as st

from finback.flight.aircraft import Aircraft
from finback.flight.campaign.assignment import maneuver_of, schedule_of
from finback.flight.campaign.crew import MEASURES, NOTE_BYTES, Flown
from finback.flight.campaign.fidelity import MANEUVERS, RECORDED
from finback.flight.campaign.flying import chunks_of
from finback.flight.campaign.plan import Campaign, History, Varied
from finback.flight.campaign.spread import Choice, Fixed, Normal, Spread, Uniform
from finback.flight.plan import FlightOptions
from finback.flight.sensors import Sensors
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule
from finback.store.campaign_size import largest_campaign_bytes, largest_recording_bytes
from finback.store.partition import writing
from finback.store.row_groups import GROUP_CELLS, RowGroups, largest_file_bytes
from finback.views.recording import RecordingContext, write_recording

MOST = tuple(name for name in RECORDED["free"] if name != "time_s")
"""Every channel that a history may hold."""
FOLDERS = count()
SHORT = {"elevator_rad": Uniform(low=-0.3, high=0.1), "alpha_rad": Fixed(value=0.0), "q_rad_s": Fixed(value=0.0)}


def plan(kind: str = "release", varied: dict[str, Spread] | None = None, **changes: object) -> Campaign:
    """Return a campaign of releases of a second, with changes; nothing of it is ever flown."""
    spreads = {**SHORT, "duration_s": Fixed(value=1.0)} if varied is None else varied
    whole = Campaign(
        study="small",
        aircraft=Aircraft(name="any", path=Path("any.xml"), sha256="0" * 64),
        condition=Condition(airspeed_m_s=200.0, density_kg_m3=1.0, gravity_m_s2=9.8, altitude_m=1000.0),
        options=FlightOptions(
            alpha_limits_rad=(-0.6, 0.8), elevator_limits_rad=(-0.7, 0.35), elevator_rate_rad_s=1.0, step_s=1 / 200
        ),
        sensors=Sensors(alpha_noise_rad=1e-3, q_noise_rad_s=1e-3),
        seed=3,
        kind=kind,
        varied=tuple(Varied(name=name, spread=spread) for name, spread in spreads.items()),
        partition_flights=10,
    )
    return replace(whole, **changes)  # type: ignore[arg-type] # the fields' own types


class Worst:
    """Flights as large as the plan allows, of numbers that no compression makes smaller."""

    def __init__(self, campaign: Campaign, seed: int) -> None:
        self.campaign = campaign
        self._random = np.random.default_rng(seed)

    def noise(self, size: int) -> np.ndarray:
        """Return float64 with random bits; none is NaN, whose bits a table may change."""
        bits = self._random.integers(0, 2**63, size, dtype=np.uint64)
        return np.nan_to_num(bits.view(np.float64), posinf=1.0)

    def fly(self, index: int) -> Flown:
        """Return a flight."""
        campaign = self.campaign
        sample = campaign.sample(index)
        sample = replace(sample, values=tuple(self.noise(len(sample.values)).tolist()))
        names = ("time_s", *campaign.history.channels)
        corners = np.arange(campaign.most_corners) + 0.9 * self._random.random(campaign.most_corners)
        return Flown(
            sample=sample,
            outcome="departed",
            note="".join(chr(33 + number) for number in self._random.integers(0, 90, NOTE_BYTES)),
            measures=tuple(self.noise(len(MEASURES)).tolist()),
            schedule=Schedule(time_s=corners, elevator_rad=self.noise(corners.size)),
            history={name: self.noise(campaign.most_rows) for name in names},
        )


def written(campaign: Campaign, folder: Path, seed: int, first: int = 0) -> int:
    """Write the partitions of a campaign from the first one; return how much room its files fill, in blocks."""
    worst, left = Worst(campaign, seed), campaign.history.departures
    for number in range(first, campaign.partitions):
        with writing(folder, campaign, number, departures=left) as writer:
            for chunk in chunks_of(campaign, number):
                writer.add([worst.fly(index) for index in range(chunk.first, chunk.first + chunk.count)])
        left -= writer.departures
    return sum(-(-path.stat().st_size // 4096) * 4096 for path in folder.rglob("*.parquet") if path.is_file())


CAMPAIGNS = st.builds(
    lambda duration_s, draws, partition, history: plan(
        varied={**SHORT, "duration_s": Uniform(low=0.01, high=duration_s)},
        draws=draws,
        partition_flights=partition,
        history=history,
        fidelities=("free",),
    ),
    st.sampled_from([0.01, 0.2, 3.0]),
    st.integers(1, 40),
    st.integers(1, 50),
    st.builds(
        lambda channels, every, departures: History(channels=MOST[:channels], every=every, departures=departures),
        st.integers(1, len(MOST)),
        st.integers(0, 5),
        st.integers(0, 30),
    ),
)


@settings(max_examples=25, deadline=None)
@given(campaign=CAMPAIGNS, seed=st.integers(0, 99))
def test_no_campaign_takes_more_than_it_says(
    tmp_path_factory: pytest.TempPathFactory, campaign: Campaign, seed: int
) -> None:
    folder = tmp_path_factory.mktemp(f"worst-{next(FOLDERS)}")
    assert written(campaign, folder, seed) <= largest_campaign_bytes(campaign)


OSCILLATIONS: dict[str, dict[str, Spread]] = {
    "log-sweep": {
        "elevator_rad": Uniform(low=-0.3, high=0.1),
        "amplitude_rad": Fixed(value=0.01),
        "from_1_s": Fixed(value=0.1),
        "to_1_s": Uniform(low=0.5, high=2.0),
        "sweep_s": Fixed(value=20.0),
        "lead_s": Fixed(value=1.0),
        "duration_s": Fixed(value=21.0),
    },
    "multisine": {
        "elevator_rad": Uniform(low=-0.3, high=0.1),
        "amplitude_rad": Fixed(value=0.01),
        "lowest_1_s": Fixed(value=0.1),
        "highest_1_s": Fixed(value=2.0),
        "period_s": Fixed(value=10.0),
        "lead_s": Choice(values=(0.0, 1.0)),
        "duration_s": Fixed(value=21.0),
    },
}


@pytest.mark.parametrize("kind", OSCILLATIONS)
@pytest.mark.parametrize("every", [0, 1])
def test_schedules_with_a_corner_at_every_sample_are_part_of_what_is_said(
    kind: str, every: int, tmp_path: Path
) -> None:
    campaign = plan(kind, OSCILLATIONS[kind], draws=25, history=History(every=every))
    taken = written(campaign, tmp_path, 1)
    assert taken <= largest_campaign_bytes(campaign)
    assert taken >= 1.5 * 25 * 2100 * 8  # two numbers at every corner, of which the times compress a little


def test_what_is_left_is_said_when_a_campaign_goes_on(tmp_path: Path) -> None:
    campaign = plan(draws=95, history=History(every=2, departures=7))
    left = largest_campaign_bytes(campaign, written=6)
    assert written(campaign, tmp_path, 1, first=6) <= left < largest_campaign_bytes(campaign)


def test_what_is_said_is_no_idle_number(tmp_path: Path) -> None:
    """Of a campaign of some size it is what noise takes, and a little."""
    campaign = plan(
        varied={**SHORT, "duration_s": Fixed(value=10.0)}, draws=40, partition_flights=100, history=History()
    )
    assert largest_campaign_bytes(campaign) < 1.4 * written(campaign, tmp_path, 1)  # a tenth are numbers of flights


MOVEMENTS: dict[str, dict[str, Spread]] = {
    "step": {"amplitude_rad": Choice(values=(-0.1, 0.1)), "lead_s": Choice(values=(0.0, 0.5))},
    "doublet": {
        "amplitude_rad": Choice(values=(-0.1, 0.1)),
        "unit_s": Uniform(low=0.25, high=1.0),
        "lead_s": Choice(values=(0.0, 0.5)),
    },
    "three-two-one-one": {
        "amplitude_rad": Choice(values=(-0.1, 0.1)),
        "unit_s": Uniform(low=0.25, high=1.0),
        "lead_s": Choice(values=(0.0, 0.5)),
    },
    "ramp": {
        "to_elevator_rad": Choice(values=(-0.1, 0.1)),
        "rate_rad_s": Uniform(low=0.01, high=1.0),
        "lead_s": Choice(values=(0.0, 0.5)),
    },
    "hold": {},
    "release": {"alpha_rad": Fixed(value=0.0), "q_rad_s": Fixed(value=0.0)},
    "linear-sweep": OSCILLATIONS["log-sweep"],
    **OSCILLATIONS,
}


@pytest.mark.parametrize("kind", MANEUVERS)
def test_no_schedule_has_more_corners_than_the_plan_says(kind: str) -> None:
    known = {**MOVEMENTS[kind], "elevator_rad": Uniform(low=-0.3, high=0.1)}
    known = {"duration_s": Fixed(value=40.0), **known}
    campaign = plan(kind, {part.name: known[part.name] for part in fields(MANEUVERS[kind])}, draws=10)
    corners = [
        schedule_of(campaign, maneuver_of(campaign, campaign.sample(index))).time_s.size
        for index in range(campaign.flights)
    ]
    assert max(corners) <= campaign.most_corners


@pytest.mark.parametrize(
    ("spread", "longest"),
    [
        (Normal(mean=4.0, standard_deviation=1.0, low=1.0), 4.0 + 8.2095),
        (Normal(mean=4.0, standard_deviation=1.0, high=5.0), 5.0),
        (Normal(mean=4.0, standard_deviation=0.1), 4.0 + 0.82095),
        (Choice(values=(2.0, 9.0, 1.0)), 9.0),
    ],
)
def test_the_longest_flight_is_the_longest_that_can_be_drawn(spread: Spread, longest: float) -> None:
    campaign = plan(varied={**SHORT, "duration_s": spread}, draws=300)
    assert campaign.longest_s == pytest.approx(longest, abs=1e-3)
    assert max(campaign.sample(index).values[-1] for index in range(300)) <= campaign.longest_s


def test_rows_are_written_as_they_come(tmp_path: Path) -> None:
    """However many there are, no more than a group of them waits in memory."""
    path = tmp_path / "rows.parquet"
    file, random = RowGroups(path, shown=path), np.random.default_rng(0)
    for _ in range(10):
        file.add(pa.table({"one": random.random(GROUP_CELLS // 4), "none": pa.nulls(GROUP_CELLS // 4, pa.float64())}))
    assert path.stat().st_size > 4 * GROUP_CELLS // 2 * 8 // 2  # four groups are there before the end
    assert file.finish({"fact": "yes"})
    found = pq.read_metadata(path)
    assert [found.row_group(group).num_rows for group in range(found.num_row_groups)] == [GROUP_CELLS // 2] * 5
    assert found.metadata[b"fact"] == b"yes"
    limit = largest_file_bytes(rows=10 * GROUP_CELLS // 4, numbers=2, texts=(), columns=2)
    assert path.stat().st_size <= limit


def test_without_rows_there_is_no_file(tmp_path: Path) -> None:
    file = RowGroups(tmp_path / "none.parquet", shown=tmp_path / "none.parquet")
    file.add(pa.table({"one": pa.array([], pa.float64())}))
    assert not file.finish({})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("channels", [("alpha_rad", "q_rad_s"), MOST])
@pytest.mark.parametrize("kind", ["release", "log-sweep"])
@pytest.mark.parametrize("duration_s", [0.01, 21.0])
def test_recordings_are_part_of_what_is_said(
    channels: tuple[str, ...], kind: str, duration_s: float, tmp_path: Path
) -> None:
    """A flight of noise in every channel that is drawn, the longest that the plan allows."""
    spreads = {**SHORT, "duration_s": Fixed(value=duration_s)} if kind == "release" else OSCILLATIONS[kind]
    campaign = plan(
        kind, spreads, fidelities=("free",), history=History(channels=channels, departures=9, recordings=7), draws=3
    )
    flown, random = Worst(campaign, 1).fly(0), np.random.default_rng(1)
    record = FlightRecord(
        name=flown.sample.name,
        columns={
            "time_s": np.arange(campaign.most_rows) * campaign.options.sample_interval_s,
            **{name: random.uniform(-1.0, 1.0, campaign.most_rows) for name in channels},
        },
        outcome=Outcome.DEPARTED,
        note=flown.note,
        condition=campaign.condition,
        schedule=Schedule(time_s=flown.schedule.time_s, elevator_rad=random.uniform(-1.0, 1.0, campaign.most_corners)),
        hold=Hold.FOH,
        provenance={"held": "any = 0.123456789, " * 40, "replaced": "something, " * 40},
    )
    path = tmp_path / "flight.rrd"
    write_recording(path, record, context=RecordingContext(study=campaign.study, run="20260101T000000Z"))
    assert path.stat().st_size <= largest_recording_bytes(campaign)
    without = replace(campaign, history=replace(campaign.history, recordings=0))
    assert largest_campaign_bytes(campaign) - largest_campaign_bytes(without) == 3 * largest_recording_bytes(campaign)
