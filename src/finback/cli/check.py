"""``finback check``: find every fault before anything is flown."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from finback.cli.exits import DONE, MENDABLE, say, verb
from finback.cli.parameters import AsJson, Quiet, StudyFile


@verb
def check(
    study: StudyFile,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model", metavar="MODEL", help="Also read this model: a run, a model.json, or TOML.", show_default=False
        ),
    ] = None,
    *,
    json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Read a study, load its aircraft in a child process, look for every trim, report every fault, fly nothing."""
    from finback import pipeline
    from finback.cli import documents
    from finback.cli.progress import watching

    with watching(quiet=quiet) as progress:
        found = pipeline.check(study, model=model, progress=progress)
    if json:
        documents.show(
            {
                "schema": "finback/check/1",
                "study": str(study),
                "faults": list(found.faults),
                "warnings": list(found.warnings),
            }
        )
        return MENDABLE if found.faults else DONE
    for warning in found.warnings:
        say(f"finback: warning: {warning}")
    for fault in found.faults:
        say(f"finback: {fault}")
    if not found.faults:
        what = "no fault" + (f", {len(found.warnings)} of its maneuvers would not be flown" if found.warnings else "")
        print(f"{study}: {what}")  # noqa: T201 - the result
    return MENDABLE if found.faults else DONE
