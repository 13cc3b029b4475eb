"""A campaign's flights in order, as a fleet flies them: however many fly, the same flights in the same order."""

from __future__ import annotations

from collections.abc import Iterator

from finback.flight.campaign.crew import Flown
from finback.flight.campaign.fleet import Fleet
from finback.flight.campaign.message import Chunk
from finback.flight.campaign.plan import Campaign


def chunks_of(campaign: Campaign, partition: int) -> Iterator[Chunk]:
    """Yield the chunks of a partition; they depend on the plan alone."""
    first = partition * campaign.partition_flights
    end = min(first + campaign.partition_flights, campaign.flights)
    for start in range(first, end, campaign.chunk_flights):
        yield Chunk(first=start, count=min(campaign.chunk_flights, end - start))


def fly_campaign(campaign: Campaign, fleet: Fleet, *, partition: int = 0) -> Iterator[tuple[Flown, ...]]:
    """Yield the flights of a partition and those after it, chunk by chunk, in order.

    While a partition is being flown, no more flights are flown than it has, and one chunk: when the caller writes each
    partition before it asks for the next chunk, flights of at most one partition are ever flown and not yet written.

    Args:
        campaign: the plan.
        fleet: who flies.
        partition: the first that is missing.
    """
    chunks = (chunk for number in range(partition, campaign.partitions) for chunk in chunks_of(campaign, number))
    done: dict[int, tuple[Flown, ...]] = {}
    written = turn = given = partition * campaign.partition_flights
    flying = 0
    upcoming = next(chunks, None)
    while turn < campaign.flights:
        while upcoming is not None and flying < fleet.depth and given - written < campaign.partition_flights + 1:
            fleet.give(upcoming)
            given += upcoming.count
            flying += 1
            upcoming = next(chunks, None)
        chunk, flights = fleet.take()
        flying -= 1
        done[chunk.first] = flights
        while turn in done:
            flights = done.pop(turn)
            yield flights
            turn += len(flights)
            written = turn - turn % campaign.partition_flights
