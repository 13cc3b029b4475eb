"""Single flights of a campaign: which of them are recorded for the viewer, and what the folder holds of any of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from finback.errors import InputError
from finback.flight.campaign.plan import Campaign
from finback.records import FlightRecord, Outcome
from finback.store.campaign import TABLE, CampaignHeader, records_of
from finback.store.partition import HISTORY, SUMMARY, partition_name


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """Which flights of a campaign leave a recording.

    Attributes:
        flights: their numbers, in order.
        statement: the same in a sentence, with what is left out.
    """

    flights: tuple[int, ...]
    statement: str


def recorded_flights(run: Path, campaign: Campaign) -> Recorded:
    """Choose the flights of a campaign that leave a recording: departures first, then the others, each spread evenly.

    Args:
        run: the folder, with all partitions.
        campaign: the plan; its history says how many.
    """
    most = campaign.history.recordings
    if not most:
        return Recorded(flights=(), statement="none are asked for; replay flies any flight again")
    departed, others, all_departed = _kept(run, campaign)
    first = _spread(departed, most)
    rest = _spread(others, most - first.size)
    chosen = f"{first.size} of {departed.size} that departed and {rest.size} of {others.size} others"
    parts = [f"of flights with a history {chosen}"]
    if all_departed > departed.size:
        parts.append(
            f"{all_departed - departed.size} more departed and keep no history (departures ="
            f" {campaign.history.departures} in [campaign.history])"
        )
    return Recorded(
        flights=tuple(np.sort(np.concatenate([first, rest])).tolist()),
        statement=f"{'; '.join(parts)}; replay flies any other again",
    )


def _kept(run: Path, campaign: Campaign) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Return the numbers of the flights with a history, departed ones and others, and how many departed at all."""
    gone, others, count = [np.empty(0, np.int64)], [np.empty(0, np.int64)], 0
    ends = (Outcome.DEPARTED.value, Outcome.DIVERGED.value)
    for number in range(campaign.partitions):
        rows = pq.read_table(run / TABLE / SUMMARY / partition_name(number), columns=["flight", "outcome"])
        departed = np.isin(np.array(rows.column("outcome").to_pylist()), ends)
        count += int(departed.sum())
        history = run / TABLE / HISTORY / partition_name(number)
        if not history.is_file():
            continue
        kept = pc.unique(pq.read_table(history, columns=["flight"]).column("flight")).to_numpy()
        flights = rows.column("flight").to_numpy()
        here = np.isin(flights, kept)
        gone.append(flights[here & departed])
        others.append(flights[here & ~departed])
    return np.concatenate(gone), np.concatenate(others), count


def _spread(flights: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    count = min(most, flights.size)
    return flights[(2 * np.arange(count) + 1) * flights.size // (2 * max(count, 1))]


def load_histories(run: Path, header: CampaignHeader, flights: Sequence[int]) -> Iterator[FlightRecord]:
    """Yield flights whose histories were kept, in order; one partition is in memory at a time.

    Args:
        run: the folder.
        header: of the campaign.
        flights: their numbers.

    Raises:
        InputError: a table is damaged.
    """
    first, wanted = 0, set(flights)
    for partition in header.partitions:
        if not wanted.isdisjoint(range(first, first + partition.flights)):
            for record in records_of(run, header, partition):
                if int(record.provenance["index"]) in wanted:
                    yield record
        first += partition.flights


def flight_number(header: CampaignHeader, flight: str) -> int:
    """Return the number of a flight that is named as in the summary, ``release-0000012``, or by its number.

    Raises:
        InputError: there is no such flight.
    """
    digits = flight.rpartition("-")[2]
    number = int(digits) if digits.isascii() and digits.isdecimal() else -1
    if not 0 <= number < header.flights or flight not in {str(number), f"{header.kind}-{number:07d}"}:
        last = header.flights - 1
        raise InputError(
            f"the campaign has no flight '{flight}'",
            hint=f"flights: {header.kind}-{0:07d} … {header.kind}-{last:07d}, or 0 … {last}",
        )
    return number


def summary_row(run: Path, header: CampaignHeader, number: int) -> Mapping[str, Any]:
    """Return what the summary says of a flight, column -> value; None for a number that a refused flight has not.

    Raises:
        InputError: the summary cannot be read, or has no such row.
    """
    first = 0
    for partition in header.partitions:
        if number < first + partition.flights:
            path = run / TABLE / SUMMARY / partition.name
            try:
                rows = pq.read_table(path, filters=[("flight", "==", number)]).to_pylist()
            except (OSError, ValueError) as error:
                raise InputError(f"{path} cannot be read: {error}", hint="fly the campaign again") from error
            if len(rows) == 1:
                return dict(rows[0])
            break
        first += partition.flights
    raise InputError(f"the summary of the campaign in {run} has no row of flight {number}", hint="fly it again")
