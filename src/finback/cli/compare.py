"""``finback compare``: any flight against a trajectory of another simulator or of an aircraft."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from finback.cli.exits import DONE, UNCONVINCED, verb
from finback.cli.parameters import AsJson

EPILOG = "Exit: 0 within all tolerances (or the map has none), 1 not, 2 mend it, 3 nothing in common."


@verb
def compare(
    run: Annotated[
        Path,
        typer.Argument(metavar="RUN", help="Folder of a run, or a flight's .parquet or .csv.", show_default=False),
    ],
    reference: Annotated[
        Path, typer.Argument(metavar="REFERENCE", help="The other trajectory (CSV).", show_default=False)
    ],
    channel_map: Annotated[
        Path,
        typer.Option(
            "--map",
            metavar="MAP",
            help="Which column is which channel, in which unit, within what tolerance (TOML).",
            show_default=False,
        ),
    ],
    flight: Annotated[str, typer.Option(metavar="NAME", help="A flight of the run. Default: the map's.")] = "",
    figure: Annotated[
        Path | None, typer.Option(metavar="FILE.svg", help="Also draw both, and the difference.", show_default=False)
    ] = None,
    *,
    json: AsJson = False,
) -> int:
    """Compare a flight with another trajectory, channel by channel."""
    from finback import pipeline
    from finback.cli import comparison_tables, documents
    from finback.files import write_text
    from finback.validation.metric import Judgement

    found = pipeline.compare(run, reference, channel_map, flight=flight)
    if figure is not None:
        from finback.views.comparison_figure import comparison_histories

        write_text(figure, comparison_histories(found).svg)
    if json:
        documents.show(comparison_tables.document(found))
    else:
        comparison_tables.show(found)
    return DONE if not found.metrics or found.verdict is Judgement.AGREES else UNCONVINCED
