"""``finback check``: find every fault before anything is flown."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from finback.cli.exits import DONE, MENDABLE, say, verb
from finback.cli.parameters import AsJson, StudyFile


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
) -> int:
    """Read a study, load its aircraft in a child process, report every fault, fly nothing."""
    from finback import pipeline
    from finback.cli import documents

    faults = pipeline.check(study, model=model)
    if json:
        documents.show({"study": str(study), "faults": list(faults)})
    else:
        for fault in faults:
            say(f"finback: {fault}")
        if not faults:
            print(f"{study}: no fault")  # noqa: T201 - the result
    return MENDABLE if faults else DONE
