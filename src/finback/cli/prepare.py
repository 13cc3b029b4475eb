"""``finback prepare``: recorded flights, of any origin, made fit for identification."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from finback.cli.exits import DONE, verb
from finback.cli.parameters import HERE, AsJson, Output, Quiet

HELP: Final = (
    "Read recorded flights and make them a run, for finback identify.\n\n"
    "Outliers and repeated samples are left out, the rest is put on a uniform time base, sensors are moved to the "
    "center of gravity, and the instruments are checked against the kinematics. What was changed, and what was seen "
    "and not changed, is said for each flight."
)
EPILOG: Final = (
    "finback prepare climb.csv doublet.csv --map records.toml\n\nfinback identify\n\nfinback analyze\n\n"
    "What may stand in MAP: docs/data.md."
)


@verb
def prepare(
    flights: Annotated[
        list[Path],
        typer.Argument(metavar="FLIGHT...", help="Tables, one flight each: text or .parquet.", show_default=False),
    ],
    columns: Annotated[
        Path,
        typer.Option(
            "--map",
            metavar="MAP",
            help="Which column is which channel, in which unit, and what is done with it (TOML).",
            show_default=False,
        ),
    ],
    output: Output = HERE,
    *,
    correct: Annotated[
        bool,
        typer.Option(
            "--correct", help="Take out faults of instruments that the kinematics determine, whatever the map says."
        ),
    ] = False,
    json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Prepare flights; ``HELP`` is what the user reads."""
    from finback.cli import documents, preparation_tables
    from finback.cli.progress import watching
    from finback.pipeline.prepare import prepare as prepare_flights

    with watching(quiet=quiet) as progress:
        found = prepare_flights(flights, columns, output=output, correct=correct, progress=progress)
    if json:
        documents.show(preparation_tables.document(found))
    else:
        preparation_tables.show(found)
    return DONE
