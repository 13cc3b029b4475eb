"""What a finished campaign looks like on standard output."""

from __future__ import annotations

import sys
from pathlib import Path

from finback.cli.accuracy_table import print_accuracy
from finback.cli.terminal import new_table, open_console, print_line, print_table
from finback.store.campaign import DISCRETIZATION, RECORDED, CampaignHeader
from finback.store.codec import to_json, to_tree


def show_document(run: Path, header: CampaignHeader) -> None:
    """Print the campaign as JSON: how its flights ended; their numbers stand in ``sweep.parquet``."""
    tree = to_tree(header)
    kept = ("study", "kind", "flights", "outcomes", "sample_interval_s", "vehicles")
    rows = sum(partition.history_rows for partition in header.partitions)
    document = {
        "schema": "finback/campaign-summary/1",
        "run": str(run),
        **{key: tree[key] for key in kept},
        "partitions": len(header.partitions),
        "history_samples": rows,
        DISCRETIZATION: header.provenance.get(DISCRETIZATION, ""),
        "accuracy": tree["accuracy"],
        RECORDED: header.provenance.get(RECORDED, ""),
    }
    sys.stdout.write(to_json(document))


def show_table(run: Path, header: CampaignHeader) -> None:
    """Print how the flights ended, and where they are."""
    console = open_console()
    table = new_table("outcome", "flights", "share")
    for outcome, count in header.outcomes.items():
        table.add_row(outcome, str(count), f"{count / header.flights:.1%}")
    print_table(console, table)
    print_accuracy(console, header.accuracy)
    if header.provenance.get(RECORDED):
        print_line(console, f"recorded {header.provenance[RECORDED]}")
    print_line(console, str(run))
