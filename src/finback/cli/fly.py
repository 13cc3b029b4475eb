"""``finback fly``: one case of an aircraft as it is, or of a script of JSBSim."""
# ruff: noqa: PLR0913, PLR0917 - each option of the command is an argument; typer reads them here

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from finback.cli.exits import DONE, say, verb
from finback.cli.parameters import AsJson
from finback.errors import InputError

HELP = """Fly one case: an aircraft as it is, or a JSBSim script; nothing of it is replaced.

Initial conditions name their unit: --ic airspeed_kt=350 --ic altitude_ft=10000 --ic alpha_deg=4; a name with a slash is
a property of JSBSim in its own unit. A schedule moves a command (elevator, aileron, rudder, throttle …, -1 to 1), a
surface (elevator_deg), a wind (wind_east_ft_s) or a property: --schedule elevator=0:0,1:0,1:-0.2,throttle=0:0.8
(time in s : value; two values at one time are a jump)."""
EPILOG = "Compare what was flown with another trajectory: finback compare FILE REFERENCE.csv --map MAP.toml"


@verb
def fly(
    source: Annotated[
        str,
        typer.Argument(
            metavar="AIRCRAFT", help="Name or path of an aircraft, or path of a script.", show_default=False
        ),
    ],
    ic: Annotated[
        list[str] | None,
        typer.Option("--ic", metavar="NAME=VALUE|FILE.xml", help="Initial condition; repeat it.", show_default=False),
    ] = None,
    setting: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PROPERTY=VALUE", help="Write before the start; repeat it.", show_default=False),
    ] = None,
    schedule: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=T:V,T:V|FILE", help="Move over time; repeat it. FILE: .csv or .toml.", show_default=False
        ),
    ] = None,
    hold: Annotated[
        str, typer.Option(metavar="foh|zoh", help="Between two points: straight lines, or held until the next.")
    ] = "foh",
    wind: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE.csv", help="A wind over altitude: altitude_ft, wind_east_ft_s …", show_default=False
        ),
    ] = None,
    record: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PROPERTY:UNIT=NAME", help="Record more: aero/cl-squared:1=cl2_1; repeat it.", show_default=False
        ),
    ] = None,
    duration: Annotated[
        float, typer.Option(metavar="S", help="In s. Default: to the end of the script.", show_default=False)
    ] = 0.0,
    step_hz: Annotated[
        float, typer.Option(metavar="HZ", help="Steps a second. Default: 400, or the script's.", show_default=False)
    ] = 0.0,
    sample_hz: Annotated[
        float, typer.Option(metavar="HZ", help="Rows a second. Default: every step.", show_default=False)
    ] = 0.0,
    planet: Annotated[
        Path | None,
        typer.Option(metavar="FILE.xml", help="JSBSim's planet file. Default: the Earth.", show_default=False),
    ] = None,
    attitude: Annotated[str, typer.Option(metavar="buss2|ab4", help="How the attitude is integrated.")] = "buss2",
    engines: Annotated[
        str, typer.Option(metavar="as-loaded|running", help="running: started, and steady at their throttles.")
    ] = "as-loaded",
    output: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help=".parquet, .csv or .rrd; repeat it. Default: NAME.parquet here, if new.",
            show_default=False,
        ),
    ] = None,
    *,
    check_step: Annotated[
        bool, typer.Option("--check-step/--no-check-step", help="Fly it again at half the step and tell the error.")
    ] = True,
    json: AsJson = False,
) -> int:
    """Read the request, fly, write."""
    from finback import pipeline
    from finback.cli import case_request, documents

    case = case_request.CaseRequest(
        source=source,
        initial=ic or [],
        settings=setting or [],
        schedules=schedule or [],
        records=record or [],
        duration_s=duration,
        step_hz=step_hz,
        sample_hz=sample_hz,
        planet=planet,
        attitude=attitude,
        hold=hold,
        winds=wind or [],
        engines=engines,
    ).case()
    paths = output or [_unnamed(case.source)]
    flown = pipeline.fly(case, paths, check_step=check_step)
    for warning in flown.warnings:
        say(f"finback: {warning}")
    if json:
        documents.show(
            {
                "schema": "finback/flown-case/1",
                "outcome": flown.outcome.value,
                "note": flown.note,
                "warnings": list(flown.warnings),
                "rows": len(flown.columns["time_s"]),
                "columns": list(flown.columns),
                "step_error": dict(flown.step_error),
                "provenance": dict(flown.provenance),
                "files": [str(path) for path in paths],
            }
        )
    else:
        case_request.show(flown, paths)
    return DONE


def _unnamed(source: Path) -> Path:
    """Return the file that is written where none is named; one that exists is nobody's to overwrite."""
    path = Path(f"{source.stem}.parquet")
    if path.exists():
        raise InputError(f"{path} exists, and --output does not name it", hint=f"--output {path} overwrites it")
    return path
