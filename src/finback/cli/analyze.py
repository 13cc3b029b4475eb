"""``finback analyze``: the model of a run, or any planar polynomial model from a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from finback.cli.exits import DONE, verb
from finback.cli.parameters import HERE, AsJson, Quiet

if TYPE_CHECKING:
    from finback.dynamics.any_form import AnyAnalysis
    from finback.identification.propagation import PropagatedNumber

HELP: Final = (
    "Find equilibria, folds, Hopf points, connections and stability regions of a model.\n\n"
    "A run is analyzed as its study asks and keeps the result; with a range or step of your own, nothing is kept but "
    "what --output names.\n\n"
    "A model from a file is analyzed in the ranges given here, else in those that the file states, else where its data "
    "lie, else so that every fold is seen. In alpha, q and elevator it becomes one equation of second order (Liénard) "
    "if that holds every term; any other model is analyzed as a planar field."
)
EPILOG: Final = (
    "finback analyze: the newest run\n\n"
    "finback analyze published.toml --elevator-range -40 20\n\n"
    "finback analyze van-der-pol.toml --parameter-range -1 3 --state-range x_1=-5:5 --json\n\n"
    "finback analyze model.toml --hold canard_deg=2 --output analysis.json\n\n"
    "finback analyze logs/study/run --sampled\n\n"
    "What may stand in a file: docs/model.md. What comes out: docs/analysis.md."
)

Model = Annotated[
    Path | None,
    typer.Argument(
        metavar="[MODEL]",
        help="Folder of a run, a model.json, or a TOML file: the paper's form (published.toml), or polynomials written "
        "by hand. Default: the newest run below OUTPUT/logs.",
        show_default=False,
    ),
]
ElevatorRange = Annotated[
    tuple[float, float] | None,
    typer.Option("--elevator-range", metavar="LOW HIGH", help="Elevators to look at, in deg.", show_default=False),
]
ElevatorStep = Annotated[
    float | None,
    typer.Option("--elevator-step", metavar="STEP", help="Distance of listed equilibria, in deg.", show_default=False),
]
AlphaRange = Annotated[
    tuple[float, float] | None,
    typer.Option("--alpha-range", metavar="LOW HIGH", help="Angles to look at, in deg.", show_default=False),
]
ParameterRange = Annotated[
    tuple[float, float] | None,
    typer.Option(
        "--parameter-range",
        metavar="LOW HIGH",
        help="The same for any parameter, in the unit in which the file names it.",
        show_default=False,
    ),
]
ParameterStep = Annotated[
    float | None,
    typer.Option("--parameter-step", metavar="STEP", help="Distance of listed equilibria.", show_default=False),
]
StateRange = Annotated[
    list[str] | None,
    typer.Option(
        "--state-range",
        metavar="NAME=LOW:HIGH",
        help="The same for any state of a planar field, such as q_deg_s=-60:60 or x_1=-3:3; may be given again.",
        show_default=False,
    ),
]
Hold = Annotated[
    list[str] | None,
    typer.Option(
        "--hold",
        metavar="NAME=VALUE",
        help="Hold a further input of the model there, such as canard_deg=2; may be given again.",
        show_default=False,
    ),
]
Sampled = Annotated[
    bool,
    typer.Option(
        "--sampled",
        help="Also give the numbers of folds, Hopf points, neutral saddles and equilibria with 95 % intervals by two "
        "roads: by gradient, and by 512 models drawn from the errors of the coefficients.",
    ),
]
Target = Annotated[
    Path,
    typer.Option(
        "--output",
        metavar="PATH",
        help="With MODEL: also write the analysis to this file. Without: look for the newest run below PATH/logs.",
        show_default="here",
    ),
]


@verb
def analyze(  # noqa: PLR0913, PLR0917 - typer makes options of arguments
    model: Model = None,
    elevator_range: ElevatorRange = None,
    elevator_step: ElevatorStep = None,
    alpha_range: AlphaRange = None,
    parameter_range: ParameterRange = None,
    parameter_step: ParameterStep = None,
    state_range: StateRange = None,
    hold: Hold = None,
    output: Target = HERE,
    *,
    sampled: Sampled = False,
    json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Analyze a run or a model from a file; ``HELP`` is what the user reads."""
    from finback.cli.analysis_request import Request
    from finback.cli.progress import watching
    from finback.errors import InputError
    from finback.store import save_analysis_alone

    request = Request.of(
        ranges={"elevator_deg": elevator_range, "alpha_deg": alpha_range},
        steps={"elevator_deg": elevator_step},
        parameter=(parameter_range, parameter_step),
        states=state_range or [],
        holds=hold or [],
    )
    keep = model is not None and output != HERE
    if keep and output.is_dir():
        raise InputError(f"{output} is a folder", hint="with a MODEL, --output names the file to write")
    if keep and not output.parent.is_dir():  # said before anything is computed
        raise InputError(f"{output} cannot be written: there is no folder {output.parent}", hint="make it first")
    with watching(quiet=quiet) as progress:
        found, source, inputs = request.answer(model, output, progress)
    if keep:
        save_analysis_alone(found, output, inputs=inputs)
        source["stored"] = str(output)
    numbers = request.numbers(found, Path(source.get("run") or source["model"])) if sampled else ()
    _show(found, source, numbers, json=json)
    return DONE


def _show(found: AnyAnalysis, source: dict[str, str], numbers: tuple[PropagatedNumber, ...], *, json: bool) -> None:
    from finback.cli import analysis_tables, documents, identification_tables
    from finback.store.codec import to_tree

    if json:
        derived = {"derived": [to_tree(number) for number in numbers]} if numbers else {}
        documents.show({**documents.of_analysis(source, found), **derived})
    else:
        analysis_tables.show_analysis(source, found)
        identification_tables.show_numbers(numbers)
