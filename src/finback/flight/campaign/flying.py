"""A campaign's flights in order, as a fleet flies them: however many fly, the same flights in the same order."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from finback.flight.campaign.crew import Flown
from finback.flight.campaign.fleet import Fleet
from finback.flight.campaign.message import Chunk
from finback.flight.campaign.plan import Campaign

_SHARE: Final = 4  # of what is left of a partition that a chunk takes at most one


def chunks_of(campaign: Campaign, partition: int) -> Iterator[Chunk]:
    """Yield the chunks of a partition, a function of the plan: smaller ones at its end, where all wait for the last."""
    first = partition * campaign.partition_flights
    end = min(first + campaign.partition_flights, campaign.flights)
    while first < end:
        count = max(1, min(campaign.chunk_flights, (end - first) // _SHARE))
        yield Chunk(first=first, count=count)
        first += count


def fly_campaign(campaign: Campaign, fleet: Fleet, *, partition: int = 0) -> Iterator[tuple[Flown, ...]]:
    """Yield the flights of a partition and those after it, chunk by chunk, in order.

    No flight of the next partition begins before the caller, who writes each partition before it asks for the next
    chunk, has got the last flight of this one: flights of at most one partition are ever flown and not yet written.

    Args:
        campaign: the plan.
        fleet: who flies.
        partition: the first that is missing.
    """
    done: dict[int, tuple[Flown, ...]] = {}
    for number in range(partition, campaign.partitions):
        chunks = tuple(chunks_of(campaign, number))
        given = taken = 0
        for chunk in chunks:
            while chunk.first not in done:
                while given < len(chunks) and given - taken < fleet.depth:
                    fleet.give(chunks[given])
                    given += 1
                flown, flights = fleet.take()
                taken += 1
                done[flown.first] = flights
            yield done.pop(chunk.first)
