"""All verbs in one application."""

from __future__ import annotations

from typing import Annotated

import typer

from finback import __version__
from finback.cli import analyze, check, coefficients, compare, design, export, fly, prepare, replay, run, stages, sweep

app = typer.Typer(
    name="finback",
    help="Fly a JSBSim aircraft, identify a reduced model, analyze its bifurcations, judge it by the full simulator.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("run")(run.run)
app.command("sweep")(sweep.sweep)
app.command("prepare", help=prepare.HELP, epilog=prepare.EPILOG)(prepare.prepare)
app.command("identify")(stages.identify)
app.command("coefficients", help=coefficients.HELP, epilog=coefficients.EPILOG)(coefficients.coefficients)
app.command("analyze", help=analyze.HELP, epilog=analyze.EPILOG)(analyze.analyze)
app.command("validate")(stages.validate)
app.command("export", help=export.HELP, epilog=export.EPILOG)(export.export)
app.command("design", help=design.HELP, epilog=design.EPILOG)(design.design)
app.command("report")(stages.report)
app.command("replay")(replay.replay)
app.command("fly", help=fly.HELP, epilog=fly.EPILOG)(fly.fly)
app.command("compare", epilog=compare.EPILOG)(compare.compare)
app.command("check")(check.check)


def _version(wanted: bool) -> None:  # noqa: FBT001 - typer calls it so
    if wanted:
        print(f"finback {__version__}")  # noqa: T201 - a result
        raise typer.Exit


@app.callback(
    epilog="Exit: 0 agrees or done, 1 disagrees or inconclusive, 2 mend it, 3 refused, 4 bug, 130 interrupted."
)
def _finback(
    *,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Run before every verb; the options act by themselves."""
