"""``finback replay``: look at a recorded flight, or fly it again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from finback.cli.exits import DONE, UNCONVINCED, say, verb
from finback.cli.parameters import HERE, AsJson, Below, RunFolder

if TYPE_CHECKING:
    from finback.pipeline import Reflown

Refly = Annotated[bool, typer.Option("--refly", help="Fly it again and compare, bit by bit; open no viewer.")]


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
    *,
    refly: Refly = False,
    json: AsJson = False,
) -> int:
    """Open a flight in the Rerun viewer; any flight of a campaign, which is flown again where it has no recording."""
    from finback import pipeline
    from finback.errors import InputError

    if run is not None and Path(flight).is_dir() and not run.is_dir():
        flight, run = str(run), Path(flight)
    named = Path(flight)
    if refly:
        if named.suffix == ".rrd":
            raise InputError(f"{named} is a recording; what is flown again is a flight of a run", hint="give its name")
        return _again(pipeline.refly(run or pipeline.newest_run(output), flight), json=json)
    if json:
        raise InputError("--json is for --refly: the viewer is a window", hint="add --refly")
    from finback.views.replay import open_viewer

    path = named if named.suffix == ".rrd" else _recording(run or pipeline.newest_run(output), flight)
    open_viewer(path)
    return DONE


def _recording(run: Path, flight: str) -> Path:
    from finback import pipeline

    found, made = pipeline.recording_of(run, flight)
    if made:
        say(f"finback: {found.stem} had no recording, it was flown again into {found}")
    return found


def _again(found: Reflown, *, json: bool) -> int:
    from finback.cli.refly_result import show_document, show_lines

    (show_document if json else show_lines)(found)
    return DONE if found.same else UNCONVINCED
