"""Arguments and options that several verbs share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

StudyFile = Annotated[Path, typer.Argument(metavar="STUDY", help="Study file (TOML).", show_default=False)]
RunFolder = Annotated[
    Path | None,
    typer.Argument(
        metavar="[RUN]", help="Folder of a run. Default: the newest one below DIR/logs.", show_default=False
    ),
]
Output = Annotated[
    Path, typer.Option("--output", metavar="DIR", help="Results go to DIR/logs/<study>/<run>/.", show_default="here")
]
Below = Annotated[
    Path,
    typer.Option(
        "--output", metavar="DIR", help="Without RUN: take the newest run below DIR/logs.", show_default="here"
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Only JSON on stdout, in SI.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress.")]

HERE = Path()
