"""``finback sweep``: fly a study's maneuvers, or its campaign, or go on with a campaign that was interrupted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from finback.cli.exits import DONE, say, verb
from finback.cli.parameters import HERE, AsJson, Output, Quiet

if TYPE_CHECKING:
    from finback.campaign import OpenCampaign

Source = Annotated[
    Path,
    typer.Argument(
        metavar="STUDY", help="Study file (TOML), or the folder of an interrupted campaign.", show_default=False
    ),
]
Workers = Annotated[
    int, typer.Option("--workers", metavar="N", min=0, max=1024, help="Processes of a campaign; 0: one a core.")
]
Dask = Annotated[
    str, typer.Option("--dask", metavar="ADDRESS", help="Fly a campaign on this Dask cluster.", show_default=False)
]


@verb
def sweep(
    study: Source,
    output: Output = HERE,
    *,
    workers: Workers = 0,
    dask: Dask = "",
    json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Fly the study's maneuvers, or its campaign, into a new run; go on with a campaign that was interrupted."""
    from finback.study import is_campaign_study

    if study.is_dir() or is_campaign_study(study):
        return _campaign(study, output, workers=workers, dask=dask, json=json, quiet=quiet)
    from finback import pipeline
    from finback.cli import documents, tables
    from finback.cli.progress import watching
    from finback.errors import InputError

    if workers or dask:
        raise InputError(
            f"{study} has no section [campaign]: its flights are few, and flown by one process",
            hint="leave out --workers and --dask",
        )
    with watching(quiet=quiet) as progress:
        folder, flown = pipeline.sweep(study, output=output, progress=progress)
    tables.warn_of_sweep(flown)
    accuracy = pipeline.load_accuracy(folder)
    if json:
        documents.show(documents.of_sweep(folder, flown, accuracy))
    else:
        tables.show_sweep(folder, flown, accuracy)
    return DONE


def _campaign(source: Path, output: Path, *, workers: int, dask: str, json: bool, quiet: bool) -> int:
    from finback import campaign
    from finback.cli import campaign_result
    from finback.cli.progress import watching_flights
    from finback.errors import InputError

    if workers and dask:
        raise InputError("--workers are processes on this machine, a Dask cluster has its own", hint="give one of them")
    crew = campaign.Cluster(address=dask) if dask else campaign.Processes(count=workers)
    opened = campaign.reopen_campaign(source) if source.is_dir() else campaign.begin_campaign(source, output=output)
    try:
        if not opened.finished:
            say(f"finback: {campaign.describe(opened)}")
        with watching_flights(quiet=quiet, written=opened.flown) as progress:
            header = campaign.fly(opened, crew, progress)
    except BaseException:
        campaign.discard_unbegun(opened)
        _say_how_to_go_on(opened, dask)
        raise
    if json:
        campaign_result.show_document(opened.run, header)
    else:
        campaign_result.show_table(opened.run, header)
    return DONE


def _say_how_to_go_on(opened: OpenCampaign, dask: str) -> None:
    from finback import campaign

    if command := campaign.resume_command(opened.run):
        where = f" --dask {dask}" if dask else ""
        say(f"finback: what was announced as written stays; go on with: {command}{where}")
