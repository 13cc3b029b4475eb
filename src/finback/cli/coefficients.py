"""``finback coefficients``: CX, CZ (or CD, CL) and Cm from flights whose airspeed moves."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from finback.cli.exits import DONE, say, verb
from finback.cli.parameters import AsJson, Quiet

HELP: Final = (
    "Fit the coefficients CX, CZ (or CD, CL) and Cm to flights of any origin, the airspeed moving as it did.\n\n"
    "SETUP (TOML) states airframe, terms, method, and how tables are read. A flight is the folder of a run, or a table "
    "(.csv, .parquet) with time, airspeed, alpha, q, the elevator, and what else was measured."
)
EPILOG: Final = (
    "finback coefficients setup.toml climb.csv doublet.csv --reduced model.toml\n\nfinback analyze model.toml\n\n"
    "What may stand in SETUP: docs/coefficients.md."
)


@verb
def coefficients(  # noqa: PLR0913 - each option of the command is an argument; typer reads them here
    setup: Annotated[Path, typer.Argument(metavar="SETUP", help="Airframe, terms, method (TOML).", show_default=False)],
    flights: Annotated[
        list[Path], typer.Argument(metavar="FLIGHT...", help="Runs, or tables of flights.", show_default=False)
    ],
    output: Annotated[Path, typer.Option(metavar="FILE.json", help="Where the result goes.")] = Path(
        "coefficients.json"
    ),
    reduced: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.toml",
            help="Also write dα/dt and dq/dt at the setup's condition, for finback analyze.",
            show_default=False,
        ),
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            metavar="METHOD",
            help="equation-error, frequency, output-error or filter-error, whatever the setup says.",
        ),
    ] = "",
    *,
    json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Fit, write, show; ``HELP`` is what the user reads."""
    from finback.cli import coefficient_tables, documents
    from finback.cli.progress import watching
    from finback.errors import InputError
    from finback.identification.coefficient.options import CoefficientMethod
    from finback.pipeline.coefficients import coefficients as fit

    if method and method not in list(CoefficientMethod):
        raise InputError(f"--method {method} is none", hint=f"there are {', '.join(CoefficientMethod)}")
    with watching(quiet=quiet) as progress:
        found = fit(
            setup,
            flights,
            output=output,
            reduced=() if reduced is None else (reduced,),
            methods=(CoefficientMethod(method),) if method else (),
            progress=progress,
        )
    for warning in found.warnings:
        say(f"finback: warning: {warning}")
    if json:
        documents.show(coefficient_tables.document(found, output))
    else:
        coefficient_tables.show(found, output)
        if reduced is not None:
            print(f"reduced  {reduced}")  # noqa: T201 - the result
    return DONE
