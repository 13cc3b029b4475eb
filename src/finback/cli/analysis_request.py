"""What the options of ``finback analyze`` ask, of a run or of a model from a file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from finback import pipeline
from finback.dynamics.analysis import Analysis
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.errors import InputError
from finback.store import ModelFile, read_model_file
from finback.store.envelope import ANALYZE, IDENTIFY
from finback.study.faults import nearest
from finback.units import quantity_of, si_unit, to_si, unit_of

Range = tuple[float, float]
Answer = tuple[Analysis | PlanarAnalysis, dict[str, str], Mapping[str, str]]
"""What was found; from what (see ``documents.of_analysis``); file of the model -> SHA-256 of what it held."""

LIENARD: Final = "lienard"
_IN_PITCH: Final = ("alpha_deg", "q_deg_s", "elevator_deg")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """Ranges, steps and held values by names with any unit.

    Attributes:
        ranges: variable -> (low, high).
        steps: parameter -> step.
        parameter_range: (low, high) of the parameter in the file's unit, or nothing.
        parameter_step: its step, or nothing.
        held: input -> value.
    """

    ranges: Mapping[str, Range]
    steps: Mapping[str, float]
    parameter_range: tuple[Range, ...]
    parameter_step: tuple[float, ...]
    held: Mapping[str, float]

    @classmethod
    def of(
        cls,
        *,
        ranges: Mapping[str, Range | None],
        steps: Mapping[str, float | None],
        parameter: tuple[Range | None, float | None],
        states: Sequence[str],
        holds: Sequence[str],
    ) -> Request:
        """Make a request of what typer read.

        Raises:
            InputError: an option is not written as its help says.
        """
        given = {name: value for name, value in ranges.items() if value is not None}
        for text in states:
            name, low, high = _split(text, "--state-range", "NAME=LOW:HIGH", "=", ":")
            given[name] = (_number(low, text), _number(high, text))
        held = {}
        for text in holds:
            name, value = _split(text, "--hold", "NAME=VALUE", "=")
            held[name] = _number(value, text)
        return cls(
            ranges=given,
            steps={name: value for name, value in steps.items() if value is not None},
            parameter_range=tuple(value for value in parameter[:1] if value is not None),
            parameter_step=tuple(value for value in parameter[1:] if value is not None),
            held=held,
        )

    @property
    def empty(self) -> bool:
        """Whether nothing was asked but the analysis itself."""
        return not (self.ranges or self.steps or self.parameter_range or self.parameter_step or self.held)

    def answer(self, model: Path | None, output: Path, progress: pipeline.Progress) -> Answer:
        """Analyze.

        Args:
            model: a run, a file, or nothing: the newest run below ``output``.
            output: where to look for it.
            progress: who wants to know.
        """
        if model is not None and not model.is_dir():
            return self._of_file(read_model_file(model), progress)
        return self._of_run(model or pipeline.newest_run(output), progress)

    def _of_file(self, file: ModelFile, progress: pipeline.Progress) -> Answer:
        file = file.holding(self.held)
        ranges, steps = self._in_si(file.written)
        found = pipeline.analyze_file(file, ranges=ranges, steps=steps, progress=progress)
        form = f"planar: {file.why_planar()}" if isinstance(found, PlanarAnalysis) else LIENARD
        return found, {"model": str(file.path), "form": form, "stored": ""}, {file.path.name: file.sha256}

    def _of_run(self, run: Path, progress: pipeline.Progress) -> Answer:
        if self.held:
            raise InputError(f"{run}: the model of a run has no further inputs", hint="leave --hold out")
        if self.empty:
            found = pipeline.analyze(run, progress=progress)
            stored = str(run / ANALYZE.file)
        else:
            ranges, steps = self._in_si(_IN_PITCH)
            found = pipeline.analyze_otherwise(run, ranges=ranges, steps=steps, progress=progress)
            stored = ""
        inputs = {IDENTIFY.file: read_model_file(run).sha256}
        return found, {"run": str(run), "form": LIENARD, "stored": stored}, inputs

    def _in_si(self, written: Sequence[str]) -> tuple[dict[str, Range], dict[str, float]]:
        """Return ranges and steps in SI by names in SI.

        Args:
            written: variables of the model as they are written, states first.

        Raises:
            InputError: a name that is none of them.
        """
        parameter = written[2]
        ranges, steps = dict(self.ranges), dict(self.steps)
        for given in self.parameter_range:
            ranges[parameter] = given
        for step in self.parameter_step:
            steps[parameter] = step
        known = {_si_name(name): name for name in written[:3]}
        if not all(
            math.isfinite(number) for number in (*steps.values(), *(end for ends in ranges.values() for end in ends))
        ):
            raise InputError("ranges and steps are finite numbers", hint="give numbers such as -40 20")
        for name in (*ranges, *steps):
            if _si_name(name) not in known or (name in steps and _si_name(name) != _si_name(parameter)):
                raise InputError(f"the model has no '{name}'{nearest(name, list(known.values()))}")
        return (
            {
                _si_name(name): (to_si(low, unit_of(name)), to_si(high, unit_of(name)))
                for name, (low, high) in ranges.items()
            },
            {_si_name(name): to_si(step, unit_of(name)) for name, step in steps.items()},
        )


def _si_name(name: str) -> str:
    return f"{quantity_of(name)}_{si_unit(unit_of(name))}"


def _split(text: str, option: str, form: str, *marks: str) -> list[str]:
    parts = [text]
    for mark in marks:
        parts[-1:] = parts[-1].split(mark, 1)
    if len(parts) != len(marks) + 1:
        raise InputError(
            f"{option} {text}: expected {form}", hint="such as --state-range x_1=-3:3, --hold canard_deg=2"
        )
    return [part.strip() for part in parts]


def _number(text: str, whole: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"'{text}' in '{whole}' is no number") from None
