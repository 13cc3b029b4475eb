"""``finback design``: which maneuvers of a study to fly, and how well a model will then be known."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from finback.cli.exits import DONE, verb
from finback.cli.parameters import AsJson, StudyFile

if TYPE_CHECKING:
    from finback.cli.design_request import Design

HELP: Final = (
    "Choose which maneuvers of a study's sweep to fly, and predict how well a model will then be known.\n\n"
    "Every maneuver of its sweep is a candidate; lists of trims and amplitudes make one for each combination. With "
    "--propose, they are 3-2-1-1s, multisines and frequency sweeps matched to the model's mode at trims over the "
    "elevators of the study's analysis. The model flies them itself; the noise is that of the study's sensors. The "
    "choice is D-optimal: the smallest volume of "
    "uncertainty about all coefficients."
)
EPILOG: Final = (
    "finback design study.toml --model published.toml --count 5\n\n"
    "finback design study.toml --model logs/study/run --count 3 --output sweep.toml\n\n"
    "finback design study.toml --model published.toml --count 4 --propose --study designed.toml"
)

Wanted = Annotated[
    Path,
    typer.Option(
        "--model", metavar="MODEL", help="The model that is wanted, as well as it is known.", show_default=False
    ),
]
Count = Annotated[int, typer.Option("--count", metavar="N", min=1, help="How many flights.")]
Repeated = Annotated[int, typer.Option("--repeated", metavar="N", min=1, help="How often one maneuver may be flown.")]
Sweep = Annotated[
    Path | None,
    typer.Option(
        "--output", metavar="FILE", help="Write the chosen maneuvers as tables of a study's sweep.", show_default=False
    ),
]
Propose = Annotated[
    bool,
    typer.Option("--propose", help="Take maneuvers that suit the model as candidates, instead of the study's sweep."),
]
Duration = Annotated[
    float, typer.Option("--duration", metavar="S", min=1.0, help="How long each proposed flight lasts, in s.")
]
Whole = Annotated[
    Path | None,
    typer.Option(
        "--study", metavar="FILE", help="Write the study with the chosen maneuvers as its sweep.", show_default=False
    ),
]


@verb
def design(  # noqa: PLR0913, PLR0917 - one option each
    study: StudyFile,
    model: Wanted,
    count: Count = 5,
    repeated: Repeated = 1,
    output: Sweep = None,
    whole: Whole = None,
    duration: Duration = 15.0,
    *,
    propose: Propose = False,
    json: AsJson = False,
) -> int:
    """Choose flights; ``HELP`` is what the user reads."""
    from finback.cli import design_request
    from finback.errors import InputError
    from finback.files import write_text

    for name, path in (("--output", output), ("--study", whole)):
        if path is not None and path.is_dir():
            raise InputError(f"{path} is a folder", hint=f"{name} names the file to write")
    found = design_request.design(
        study, model, count=count, repeated=repeated, proposed_s=duration if propose else None
    )
    chosen = [found.maneuvers[name] for name in found.choice.names]
    if output is not None:
        write_text(output, design_request.as_toml(chosen))
    if whole is not None:
        write_text(whole, design_request.as_study(study, chosen))
    _show(found, json=json)
    return DONE


def _show(found: Design, *, json: bool) -> None:
    from finback.cli import design_request, documents, terminal
    from finback.cli.exits import say
    from finback.cli.numbers import head, plain
    from finback.units import quantity_of, unit_of

    errors, best = found.choice.standard_errors, found.all_errors
    labels = [
        (rate, label, value)
        for rate, part in (("alpha_dot_rad_s", found.model.alpha_dot), ("q_dot_rad_s2", found.model.q_dot))
        for label, value in zip(part.labels(), part.coefficients.tolist(), strict=True)
    ]
    if json:
        documents.show(
            {
                "schema": "finback/design/1",
                "flights": list(found.choice.names),
                "efficiency": found.choice.efficiency,
                "coefficients": [
                    {
                        "equation": rate,
                        "term": label,
                        "value": value,
                        "standard_error": error,
                        "of_all_candidates": least,
                    }
                    for (rate, label, value), error, least in zip(labels, errors.tolist(), best.tolist(), strict=True)
                ],
                "proposed": found.proposed,
                "left_out": list(found.left_out),
            }
        )
        return
    console = terminal.open_console()
    numbers = [design_request.numbers(found.maneuvers[name]) for name in found.choice.names]
    heads = list(dict.fromkeys(key for row in numbers for key in row))
    flights = terminal.new_table("flight", *(head(quantity_of(key), unit_of(key)) for key in heads))
    for name, row in zip(found.choice.names, numbers, strict=True):
        flights.add_row(name, *(plain(row[key]) if key in row else "" for key in heads))
    terminal.print_table(console, flights)
    table = terminal.new_table("equation", "term", "standard error / value", "if all were flown")
    for (rate, label, value), error, least in zip(labels, errors.tolist(), best.tolist(), strict=True):
        share = abs(value) or float("nan")
        table.add_row(rate.partition("_rad")[0], label, f"{error / share:.2%}", f"{least / share:.2%}")
    terminal.print_table(console, table)
    terminal.print_line(
        console,
        f"efficiency {found.choice.efficiency:.1%} of the best conceivable mixture of the candidates, or more; "
        "errors are Cramér-Rao bounds",
    )
    if found.proposed:
        say(f"finback: {found.proposed} maneuvers were proposed, {len(found.left_out)} of which the model cannot fly")
    else:
        for note in found.left_out:
            say(f"finback: warning: no candidate, left out: {note}")
