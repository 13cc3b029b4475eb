"""``finback identify|validate|report``: one stage each; ``sweep`` and ``analyze`` take more than a run."""

from __future__ import annotations

from typing import Annotated

import typer

from finback.cli.exits import DONE, UNCONVINCED, verb
from finback.cli.parameters import HERE, AsJson, Below, Quiet, RunFolder

Select = Annotated[
    bool,
    typer.Option(
        "--select",
        help="Find the terms, from all monomials of alpha, q and the elevator up to degree 3, whatever the study says.",
    ),
]

Estimator = Annotated[
    str,
    typer.Option(
        "--method",
        metavar="METHOD",
        help="weak-form, output-error, frequency or filter-error, whatever the study says.",
    ),
]


@verb
def identify(
    run: RunFolder = None,
    output: Below = HERE,
    *,
    method: Estimator = "",
    select: Select = False,
    json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Identify a polynomial model from the run's sweep."""
    from finback import pipeline
    from finback.cli import documents, identification_tables, selection_tables, tables
    from finback.cli.progress import watching
    from finback.study.identification import estimator, selection_options
    from finback.study.tables import SelectTable

    folder = run or pipeline.newest_run(output)
    selection = (selection_options(SelectTable()),) if select else ()
    methods = (estimator(method),) if method else ()
    with watching(quiet=quiet) as progress:
        identification = pipeline.identify(folder, methods=methods, selection=selection, progress=progress)
    tables.warn(identification)
    numbers = identification_tables.numbers_of(identification)
    if json:
        document = documents.of_identification(folder, identification)
        found = identification_tables.of_identified(identification, numbers)
        documents.show({**document, **selection_tables.of_selection(identification), **found})
    else:
        selection_tables.show_selection(identification)
        identification_tables.show_nuisances(identification)
        identification_tables.show_constants(identification)
        identification_tables.show_numbers(numbers)
        tables.show_identification(folder, identification)
    return DONE


@verb
def validate(run: RunFolder = None, output: Below = HERE, *, json: AsJson = False, quiet: Quiet = False) -> int:
    """Fly the full simulator against the run's model; exit 0 if it agrees."""
    from finback import pipeline
    from finback.cli import documents, tables
    from finback.cli.progress import watching
    from finback.store import load_analysis
    from finback.validation.metric import Judgement

    folder = run or pipeline.newest_run(output)
    with watching(quiet=quiet) as progress:
        validation = pipeline.validate(folder, progress=progress)
    if json:
        documents.show(documents.of_validation(folder, load_analysis(folder), validation))
    else:
        tables.show_validation(folder, load_analysis(folder), validation)
    return DONE if validation.verdict == Judgement.AGREES else UNCONVINCED


@verb
def report(run: RunFolder = None, output: Below = HERE, *, json: AsJson = False, quiet: Quiet = False) -> int:
    """Write report.html and the figures of the run."""
    from finback import pipeline
    from finback.cli import documents
    from finback.cli.progress import watching

    folder = run or pipeline.newest_run(output)
    with watching(quiet=quiet) as progress:
        path = pipeline.report(folder, progress=progress)
    if json:
        documents.show({"run": str(folder), "report": str(path)})
    else:
        print(path)  # noqa: T201 - the result
    return DONE
