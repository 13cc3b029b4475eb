"""What a campaign may take on the disk at most, told before it begins."""

from __future__ import annotations

from typing import Final

from finback.flight.campaign.crew import MEASURES, NOTE_BYTES
from finback.flight.campaign.plan import Campaign
from finback.store.row_groups import largest_file_bytes

_WORD: Final = 16  # bytes of a word such as a fidelity or an outcome
_TEXTS: Final = 6  # columns of the summary that hold text
_LISTS: Final = 2
_BLOCK: Final = 4096  # a file fills whole ones
_JSON: Final = 65_536  # of campaign.json and sweep.json, for each fidelity
_JSON_PARTITION: Final = 512

# Of a recording for the viewer: measured 200 kB, 230 bytes a row and 16 for each of its channels.
_RECORDING: Final = 400_000
_RECORDING_ROW: Final = 400
_RECORDING_CELL: Final = 32


def largest_campaign_bytes(campaign: Campaign, *, written: int = 0) -> int:
    """Return what the partitions to come, recordings and the files beside them may take at most.

    No flight ends early, every note is as long as it may be, and no number can be compressed.

    Args:
        campaign: the plan.
        written: partitions that are there.
    """
    first = written * campaign.partition_flights
    flights = max(0, campaign.flights - first)
    partitions = campaign.partitions - written
    sample = campaign.history.sample(campaign.flights) - campaign.history.sample(min(first, campaign.flights))
    histories = min(flights, sample + campaign.history.departures)
    numbers = 1 + len(campaign.names) + len(MEASURES) + _LISTS * campaign.most_corners
    name = len(campaign.kind) + _WORD
    texts = (name, name, _WORD, _WORD, _WORD, NOTE_BYTES)
    columns = 1 + len(campaign.names) + len(MEASURES) + _LISTS + _TEXTS
    summaries = largest_file_bytes(rows=flights, numbers=numbers, texts=texts, columns=columns)
    width = 2 + len(campaign.history.channels)
    rows = histories * campaign.most_rows
    samples = largest_file_bytes(rows=rows, numbers=width, texts=(), columns=width)
    # What a file takes beside its rows it takes in every partition.
    empty = sum(
        largest_file_bytes(rows=0, numbers=0, texts=text, columns=count) + _BLOCK
        for text, count in ((texts, columns), ((), width))
    )
    recordings = min(campaign.history.recordings, campaign.histories) * largest_recording_bytes(campaign)
    beside = _JSON * len(campaign.fidelities) + _JSON_PARTITION * campaign.partitions
    return int(summaries + samples + partitions * empty + recordings + beside)


def largest_recording_bytes(campaign: Campaign) -> int:
    """Return what the recording of a flight may take at most."""
    row = _RECORDING_ROW + _RECORDING_CELL * len(campaign.history.channels)
    return _RECORDING + campaign.most_rows * row + campaign.most_corners * 2 * _RECORDING_CELL
