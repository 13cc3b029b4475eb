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
    "condition, its equations are the model's. A run knows its condition, any other model needs --condition."
)
EPILOG: Final = (
    "finback export --to latex\n\n"
    "finback export published.toml --to c --output rates.c\n\n"
    "finback export logs/study/run --to jsbsim --output aircraft/reduced"
)


@final
class Target(StrEnum):
    """What a model is written as."""

    SYMPY = "sympy"
    LATEX = "latex"
    C = "c"
    JSBSIM = "jsbsim"


Model = Annotated[
    Path | None,
    typer.Argument(
        metavar="[MODEL]",
        help="Folder of a run, a model.json, or a TOML file of polynomials. Default: the newest run below ./logs.",
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
Flight = Annotated[
    tuple[float, float, float, float] | None,
    typer.Option(
        "--condition",
        metavar="V RHO G H",
        help="For jsbsim: airspeed in m/s, density in kg/m3, gravity in m/s2, altitude in m.",
        show_default=False,
    ),
]
Frame = Annotated[
    tuple[float, float, float, float, float] | None,
    typer.Option(
        "--airframe",
        metavar="M IYY S C B",
        help="For jsbsim: mass in kg, pitch inertia in kg m2, wing area in m2, chord and span in m.",
        show_default=False,
    ),
]


@verb
def export(
    to: To,
    model: Model = None,
    output: File = None,
    condition: Flight = None,
    airframe: Frame = None,
    *,
    json: AsJson = False,
) -> int:
    """Write a model for another program; ``HELP`` is what the user reads."""
    from finback import pipeline
    from finback.cli import documents
    from finback.errors import InputError
    from finback.files import write_text
    from finback.store import read_model_file

    source = model or pipeline.newest_run(HERE)
    file = read_model_file(source)
    path = output if output is None or to is not Target.JSBSIM else _aircraft_file(output)
    text = _aircraft(file, _condition(source, condition), airframe, path) if to is Target.JSBSIM else _text(file, to)
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


def _text(file: ModelFile, to: Target) -> str:
    from finback.store.export.c_source import c_source
    from finback.store.export.equations import Equations
    from finback.store.export.latex import latex
    from finback.store.export.symbolic import sympy_module

    equations = Equations.of_file(file)
    match to:
        case Target.C:
            return c_source(equations)
        case Target.LATEX:
            return latex(equations)
        case _:
            return sympy_module(equations)


def _aircraft(file: ModelFile, condition: Condition, airframe: Frame, path: Path | None) -> str:
    from finback.store.export.equations import Equations
    from finback.store.export.jsbsim_aircraft import Airframe, jsbsim_aircraft

    frame = Airframe()
    if airframe is not None:
        mass, inertia, area, chord, span = airframe
        frame = Airframe(mass_kg=mass, pitch_inertia_kg_m2=inertia, wing_area_m2=area, chord_m=chord, span_m=span)
    name = path.stem if path is not None else "model"
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


def _condition(source: Path, given: tuple[float, float, float, float] | None) -> Condition:
    """Return the condition at which a model holds: as given, or as its run was flown."""
    from finback.errors import InputError
    from finback.records import Condition
    from finback.store import load_sweep
    from finback.store.envelope import SWEEP

    if given is not None:
        airspeed, density, gravity, altitude = given
        if not (airspeed > 0 and density > 0 and gravity >= 0):
            raise InputError("--condition: airspeed and density are positive, gravity is not negative")
        return Condition(airspeed_m_s=airspeed, density_kg_m3=density, gravity_m_s2=gravity, altitude_m=altitude)
    run = source if source.is_dir() else source.parent
    if source.suffix != ".toml" and (run / SWEEP.file).is_file():
        return load_sweep(run).records[0].condition
    raise InputError(
        f"nothing says at which condition {source} holds",
        hint="add --condition V RHO G H, such as 295 0.265 9.81 13000",
    )
