"""``finback replay``: look at a recorded flight."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from finback.cli.exits import DONE, verb
from finback.cli.parameters import HERE, Below, RunFolder


@verb
def replay(
    flight: Annotated[
        str,
        typer.Argument(
            metavar="FLIGHT", help="A flight's name, or the path of a recording (.rrd).", show_default=False
        ),
    ],
    run: RunFolder = None,
    output: Below = HERE,
) -> int:
    """Open a recorded flight in the Rerun viewer."""
    from finback import pipeline
    from finback.views.replay import open_viewer

    named = Path(flight)
    path = named if named.suffix == ".rrd" else pipeline.recording(run or pipeline.newest_run(output), flight)
    open_viewer(path)
    return DONE
