"""``finback run``: everything in order."""

from __future__ import annotations

from finback.cli.exits import DONE, UNCONVINCED, verb
from finback.cli.parameters import HERE, AsJson, Output, Quiet, StudyFile


@verb
def run(study: StudyFile, output: Output = HERE, *, json: AsJson = False, quiet: Quiet = False) -> int:
    """Sweep, identify, analyze, validate and report; exit 0 if the model agrees with the simulator."""
    from finback import pipeline
    from finback.cli import documents, tables
    from finback.cli.progress import watching
    from finback.validation.metric import Judgement

    with watching(quiet=quiet) as progress:
        done = pipeline.run(study, output=output, progress=progress)
    tables.warn_of_sweep(done.sweep)
    tables.warn(done.identification)
    if json:
        documents.show(documents.of_run(done))
    else:
        tables.show_run(done)
    return DONE if done.validation.verdict == Judgement.AGREES else UNCONVINCED
