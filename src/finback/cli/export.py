"""``finback export``: a model for another program."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, final

import typer

from finback.cli.exits import DONE, verb
from finback.cli.parameters import HERE, AsJson

if TYPE_CHECKING:
    from finback.records import Condition
    from finback.store import ModelFile

HELP: Final = (
    "Write a model as SymPy expressions, LaTeX, a C function, or an aircraft for JSBSim.\n\n"
    "All in SI and radians. The aircraft has the polynomials as aerodynamic functions; with the speed held at its "
    "condition, its equations are the model's. A run knows its condition, any other model needs --condition.\n\n"
    "Of a coefficients.json the coefficients are written, and the motion by them; its aircraft flies at any airspeed. "
    "With --condition it is first reduced there to dα/dt and dq/dt, which --to toml writes for finback analyze."
)
EPILOG: Final = (
    "finback export --to latex\n\n"
    "finback export published.toml --to c --output rates.c\n\n"
    "finback export logs/study/run --to jsbsim --output aircraft/reduced\n\n"
    "finback export coefficients.json --to jsbsim --output aircraft/found\n\n"
    "finback export coefficients.json --condition 120 0.9 9.8 3000 --to toml --output at-120.toml"
)


@final
class Target(StrEnum):
    """What a model is written as."""

    SYMPY = "sympy"
    LATEX = "latex"
    C = "c"
    JSBSIM = "jsbsim"
    TOML = "toml"


Model = Annotated[
    Path | None,
    typer.Argument(
        metavar="[MODEL]",
        help="Folder of a run, a model.json, a coefficients.json, or a TOML file of polynomials. Default: the newest "
        "run below ./logs.",
        show_default=False,
    ),
]
To = Annotated[Target, typer.Option("--to", help="What to write.", show_default=False)]
File = Annotated[
    Path | None,
    typer.Option(
        "--output",
        metavar="PATH",
        help="The file; for jsbsim the aircraft's folder, or its XML file. Default: the text on stdout.",
        show_default=False,
    ),
]
Numbers = tuple[float, float, float, float] | None
Sizes = tuple[float, float, float, float, float] | None
Flight = Annotated[
    Numbers,
    typer.Option(
        "--condition",
        metavar="V RHO G H",
        help="For jsbsim, and where coefficients are reduced: airspeed in m/s, density in kg/m3, gravity in m/s2, "
        "altitude in m.",
        show_default=False,
    ),
]
Frame = Annotated[
    Sizes,
    typer.Option(
        "--airframe",
        metavar="M IYY S C B",
        help="For jsbsim: mass in kg, pitch inertia in kg m2, wing area in m2, chord and span in m.",
        show_default=False,
    ),
]
Thrust = Annotated[
    float | None,
    typer.Option(
        "--thrust",
        metavar="N",
        help="For coefficients: thrust in N of the aircraft, or of the reduction, in place of the flights' mean.",
        show_default=False,
    ),
]


@verb
def export(  # noqa: PLR0913 - each option of the command is an argument; typer reads them here
    to: To,
    model: Model = None,
    output: File = None,
    condition: Flight = None,
    airframe: Frame = None,
    thrust: Thrust = None,
    *,
    json: AsJson = False,
) -> int:
    """Write a model for another program; ``HELP`` is what the user reads."""
    from finback import pipeline
    from finback.cli import documents
    from finback.errors import InputError
    from finback.files import write_text

    source = model or pipeline.newest_run(HERE)
    path = output if output is None or to is not Target.JSBSIM else _aircraft_file(output)
    text = _written(source, to, condition, airframe, thrust, name=path.stem if path is not None else "model")
    if path is None:
        if json:
            raise InputError("--json says what was written where", hint="name a file with --output")
        print(text, end="")  # noqa: T201 - the result
        return DONE
    if path.is_dir():
        raise InputError(f"{path} is a folder", hint="--output names the file to write")
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)
    if json:
        documents.show({"schema": "finback/export/1", "model": str(source), "to": to.value, "output": str(path)})
    else:
        print(path)  # noqa: T201 - the result
    return DONE


def _written(source: Path, to: Target, condition: Numbers, airframe: Sizes, thrust: float | None, *, name: str) -> str:
    """Return what is exported, as text."""
    from finback.cli.export_coefficients import coefficients_as
    from finback.errors import InputError
    from finback.store import read_model_file
    from finback.store.coefficients import coefficients_file

    if found := coefficients_file(source):
        if airframe is not None:
            raise InputError("--airframe: the airframe stands in the coefficients", hint="leave it out")
        at = () if condition is None else (_stated(condition),)
        return coefficients_as(
            found[0], to.value, conditions=at, thrusts=() if thrust is None else (thrust,), name=name
        )
    if thrust is not None:
        raise InputError(f"--thrust: {source} holds no coefficients, and no thrust", hint="leave it out")
    if to is Target.TOML:
        raise InputError(
            f"{source} holds no coefficients to be reduced to TOML", hint="finback analyze reads it as it is"
        )
    file = read_model_file(source)
    return _aircraft(file, _condition(source, condition), airframe, name) if to is Target.JSBSIM else _text(file, to)


def _text(file: ModelFile, to: Target) -> str:
    from finback.cli.export_coefficients import equations_as
    from finback.store.export.equations import Equations

    return equations_as(Equations.of_file(file), to.value)


def _aircraft(file: ModelFile, condition: Condition, airframe: Sizes, name: str) -> str:
    from finback.store.export.equations import Equations
    from finback.store.export.jsbsim_aircraft import Airframe, jsbsim_aircraft

    frame = Airframe()
    if airframe is not None:
        mass, inertia, area, chord, span = airframe
        frame = Airframe(mass_kg=mass, pitch_inertia_kg_m2=inertia, wing_area_m2=area, chord_m=chord, span_m=span)
    source = Equations.of_file(file).source
    return jsbsim_aircraft(file.model(), name=name, condition=condition, airframe=frame, source=source)


def _aircraft_file(output: Path) -> Path:
    """Return the XML file of an aircraft: JSBSim looks for it in a folder of the same name."""
    from finback.errors import InputError

    if output.suffix != ".xml":
        return output / f"{output.resolve().name}.xml"
    if output.resolve().parent.name != output.stem:
        raise InputError(
            f"JSBSim would not find {output}: the folder of an aircraft has its name",
            hint=f"write --output {output.parent / output.stem}",
        )
    return output


def _condition(source: Path, given: Numbers) -> Condition:
    """Return the condition at which a model holds: as given, or as its run was flown."""
    from finback.errors import InputError
    from finback.store import load_sweep
    from finback.store.envelope import SWEEP

    if given is not None:
        return _stated(given)
    run = source if source.is_dir() else source.parent
    if source.suffix != ".toml" and (run / SWEEP.file).is_file():
        return load_sweep(run).records[0].condition
    raise InputError(
        f"nothing says at which condition {source} holds",
        hint="add --condition V RHO G H, such as 295 0.265 9.81 13000",
    )


def _stated(given: tuple[float, float, float, float]) -> Condition:
    """Return the condition that was given."""
    from finback.errors import InputError
    from finback.records import Condition

    airspeed, density, gravity, altitude = given
    if not (airspeed > 0 and density > 0 and gravity >= 0):
        raise InputError("--condition: airspeed and density are positive, gravity is not negative")
    return Condition(airspeed_m_s=airspeed, density_kg_m3=density, gravity_m_s2=gravity, altitude_m=altitude)
