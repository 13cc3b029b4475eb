"""Departures keep their histories, up to a stated number, in the order of the flights."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, strategies as st

from finback.flight.campaign.crew import MEASURES, Flown
from finback.flight.campaign.flying import chunks_of
from finback.flight.campaign.plan import Campaign, History
from finback.records import Schedule
from finback.store.campaign import TABLE, write_partitions
from finback.store.partition import HISTORY, find_partition
from finback.study import read_campaign_study

ROWS = 3


@pytest.fixture
def campaign(campaign_file: Path) -> Campaign:
    read = read_campaign_study(campaign_file).campaign
    return replace(read, partition_flights=10, history=History(channels=("alpha_rad",), every=7, departures=5))


def _flights(campaign: Campaign, departed: set[int], *, first: int = 0) -> Iterator[tuple[Flown, ...]]:
    """Yield what workers send: every departure has its history, whatever was kept before."""

    def flown(index: int) -> Flown:
        wanted = campaign.history.keeps(index) or index in departed
        return Flown(
            sample=campaign.sample(index),
            outcome="departed" if index in departed else "completed",
            note="",
            measures=(math.nan,) * len(MEASURES),
            schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1)),
            history={name: np.arange(ROWS) * 0.01 for name in ("time_s", "alpha_rad")} if wanted else {},
        )

    for number in range(first, campaign.partitions):
        for chunk in chunks_of(campaign, number):
            yield tuple(flown(index) for index in range(chunk.first, chunk.first + chunk.count))


def _kept(run: Path) -> set[int]:
    return set(pq.read_table(run / TABLE / HISTORY, columns=["flight"]).column("flight").to_pylist())


def test_the_first_departures_up_to_the_limit_are_kept_also_over_an_interruption(
    campaign: Campaign, tmp_path: Path
) -> None:
    departed = {3, 7, 11, 12, 28, 45, 46, 61, 88}  # 7 and 28 are of the sample
    sample = set(range(0, campaign.flights, 7))
    whole, halves = tmp_path / "whole", tmp_path / "halves"
    for _ in write_partitions(whole, campaign, _flights(campaign, departed), first=0):
        pass
    assert _kept(whole) == sample | {3, 11, 12, 45, 46}
    written = write_partitions(halves, campaign, _flights(campaign, departed), first=0)
    for chunk in written:
        if chunk[-1].sample.index >= 35:
            written.close()
            break
    assert find_partition(halves / TABLE, campaign, 2)
    assert not find_partition(halves / TABLE, campaign, 3)
    for _ in write_partitions(halves, campaign, _flights(campaign, departed, first=3), first=3):
        pass
    for part in sorted((whole / TABLE).glob("*/*.parquet")):
        assert part.read_bytes() == (halves / part.relative_to(whole)).read_bytes()


@pytest.mark.parametrize("departures", [0, 1, 1000])
def test_no_more_histories_are_kept_than_the_plan_says(campaign: Campaign, tmp_path: Path, departures: int) -> None:
    limited = replace(campaign, history=replace(campaign.history, departures=departures))
    everybody = set(range(limited.flights))
    for _ in write_partitions(tmp_path, limited, _flights(limited, everybody), first=0):
        pass
    assert len(_kept(tmp_path)) == limited.histories


@given(flights=st.integers(1, 300), every=st.integers(0, 400), departures=st.integers(0, 400))
def test_the_histories_of_a_plan_are_never_more_than_its_flights(flights: int, every: int, departures: int) -> None:
    history = History(every=every, departures=departures)
    sample, departed = history.sample(flights), history.departed(flights)
    assert sample == sum(map(history.keeps, range(flights)))
    assert departed == min(departures, flights - sample)
