"""What the options of ``finback analyze`` ask, of a run or of a model from a file."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final

import numpy as np

from finback import pipeline
from finback.dynamics.any_form import AnyAnalysis
from finback.dynamics.planar.analysis import PlanarAnalysis, PlanarAnalysisOptions
from finback.errors import InputError
from finback.identification.followed_numbers import analysis_numbers
from finback.identification.propagation import PropagatedNumber, propagate
from finback.store import ModelFile, read_model_file
from finback.store.envelope import ANALYZE, IDENTIFY, STUDY_FILE, SWEEP
from finback.study.faults import nearest
from finback.units import quantity_of, si_name, to_si, unit_of

Range = tuple[float, float]
Answer = tuple[AnyAnalysis, dict[str, str], Mapping[str, str]]
"""What was found; from what (see ``documents.of_analysis``); file of the model -> SHA-256 of what it held."""

LIENARD: Final = "lienard"
_NAMED: Final = 3  # files of a folder that a hint names
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

        Args:
            ranges: name with unit -> range, each the option ``--<quantity>-range``.
            steps: name with unit -> step, each the option ``--<quantity>-step``.
            parameter: ``--parameter-range`` and ``--parameter-step``.
            states: every ``--state-range``.
            holds: every ``--hold``.

        Raises:
            InputError: an option is not written as its help says, or two say the same.
        """
        given = {}
        for name, value in ranges.items():
            if value is not None:
                given[name] = _checked(value, f"--{quantity_of(name)}-range {_numbers(value)}")
        for text in states:
            name, low, high = _split(text, "--state-range", "NAME=LOW:HIGH", "=", ":")
            ends = (_number(low, text), _number(high, text))
            _once(name, given, "--state-range")
            given[name] = _checked(ends, f"--state-range {text}")
        held: dict[str, float] = {}
        for text in holds:
            name, number = _split(text, "--hold", "NAME=VALUE", "=")
            _once(name, held, "--hold")
            held[name] = _finite(_number(number, text), f"--hold {text}")
        kept = {name: value for name, value in steps.items() if value is not None}
        return cls(
            ranges=given,
            steps={name: _step(value, f"--{quantity_of(name)}-step") for name, value in kept.items()},
            parameter_range=tuple(
                _checked(value, f"--parameter-range {_numbers(value)}") for value in parameter[:1] if value is not None
            ),
            parameter_step=tuple(_step(value, "--parameter-step") for value in parameter[1:] if value is not None),
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
        if model is not None:
            _check_run(model)
        return self._of_run(model or pipeline.newest_run(output), progress)

    def numbers(self, found: AnyAnalysis, path: Path) -> tuple[PropagatedNumber, ...]:
        """Return the numbers of what was found with their uncertainty by two roads.

        Args:
            found: the analysis; its ranges say where.
            path: the run or the file of its model.

        Raises:
            InputError: it is no model of alpha and q over the elevator.
        """
        file = read_model_file(path).holding(self.held)
        model = file.model().held(**file.held)
        asked = found.options
        if isinstance(asked, PlanarAnalysisOptions):
            ranges = [asked.first_range, asked.second_range, asked.parameter_range]
        else:
            ranges = [asked.alpha_range_rad, (-np.inf, np.inf), asked.elevator_range_rad]
        return propagate(model, analysis_numbers(model, np.array(ranges)))

    def _of_file(self, file: ModelFile, progress: pipeline.Progress) -> Answer:
        file = file.holding(self.held)
        ranges, steps = self._asked_of(file)
        found = pipeline.analyze_file(file, ranges=ranges, steps=steps, progress=progress)
        return found, {"model": str(file.path), "form": _form(found, file), "stored": ""}, {file.path.name: file.sha256}

    def _of_run(self, run: Path, progress: pipeline.Progress) -> Answer:
        if self.held:
            raise InputError(f"{run}: the model of a run has no further inputs", hint="leave --hold out")
        if self.empty:
            found = pipeline.analyze(run, progress=progress)
            stored = str(run / ANALYZE.file)
        else:
            ranges, steps = self._asked_of(replace(read_model_file(run), written=_IN_PITCH))
            found = pipeline.analyze_otherwise(run, ranges=ranges, steps=steps, progress=progress)
            stored = ""
        file = read_model_file(run)
        return found, {"run": str(run), "form": _form(found, file), "stored": stored}, {IDENTIFY.file: file.sha256}

    def _asked_of(self, file: ModelFile) -> tuple[dict[str, Range], dict[str, float]]:
        """Return ranges and steps in SI by names in SI; a Liénard system has no range of its second state."""
        ranges, steps = self._in_si(file.written)
        if si_name(file.written[1]) in ranges and not file.why_planar():
            raise InputError(
                f"{file.path}: the Liénard form of the model is analyzed at every {file.written[1]}",
                hint="leave its range out",
            )
        return ranges, steps

    def _in_si(self, written: Sequence[str]) -> tuple[dict[str, Range], dict[str, float]]:
        """Return ranges and steps in SI by names in SI.

        Args:
            written: variables of the model as they are written, states first.

        Raises:
            InputError: a name that is none of them, or a range that is given twice.
        """
        known, parameter = written[:3], written[2]
        ranges: dict[str, Range] = {}
        for name, (low, high) in self.ranges.items():
            key = _known(name, known)
            if key in ranges:
                raise InputError(f"'{name}': its range is given twice", hint="leave one of both out")
            ranges[key] = to_si(low, unit_of(name)), to_si(high, unit_of(name))
        steps = {_known(name, known[2:]): to_si(step, unit_of(name)) for name, step in self.steps.items()}
        key, unit = si_name(parameter), unit_of(parameter)
        if (self.parameter_range and key in ranges) or (self.parameter_step and key in steps):
            raise InputError(
                f"range or step of '{parameter}' is given twice", hint="leave --parameter-range or --parameter-step out"
            )
        for low, high in self.parameter_range:
            ranges[key] = to_si(low, unit), to_si(high, unit)
        for step in self.parameter_step:
            steps[key] = to_si(step, unit)
        return ranges, steps


def _form(found: AnyAnalysis, file: ModelFile) -> str:
    return f"planar: {file.why_planar()}" if isinstance(found, PlanarAnalysis) else LIENARD


def _check_run(folder: Path) -> None:
    """Refuse a folder that is no run, and say what in it can be analyzed.

    Raises:
        InputError: it holds nothing of a run.
    """
    if any((folder / name).is_file() for name in (STUDY_FILE, SWEEP.file)):
        return
    if (folder / IDENTIFY.file).is_file():
        hint = f"to analyze its model alone: finback analyze {shlex.quote(str(folder / IDENTIFY.file))}"
    elif models := sorted(folder.glob("*.toml")):
        hint = f"name a file in it: {', '.join(path.name for path in models[:_NAMED])}"
    elif runs := [*folder.glob(f"*/{STUDY_FILE}"), *folder.glob(f"*/*/{STUDY_FILE}")]:
        hint = f"the newest run in it is {max(runs, key=lambda path: path.stat().st_mtime).parent}"
    else:
        hint = "name a run (made by: finback run STUDY), a model.json, or a TOML file (docs/model.md)"
    raise InputError(f"{folder} is no run: it holds neither a study nor a sweep", hint=hint)


def _known(name: str, known: Sequence[str]) -> str:
    """Return a name in SI if the model has it.

    Raises:
        InputError: it has not; the message has the nearest name.
    """
    try:
        key = si_name(name)
    except InputError:  # no unit, perhaps only forgotten
        same = [other for other in known if quantity_of(other) == name]
        raise InputError(f"the model has no '{name}'{nearest(name, same or list(known))}") from None
    if key not in {si_name(other) for other in known}:
        raise InputError(f"the model has no '{name}'{nearest(name, list(known))}")
    return key


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


def _numbers(ends: Range) -> str:
    return " ".join(f"{end:g}" for end in ends)


def _checked(ends: Range, option: str) -> Range:
    low, high = ends
    if not (math.isfinite(low) and math.isfinite(high)):
        raise InputError(f"{option}: a range is two finite numbers", hint="such as -40 20")
    if not low < high:
        raise InputError(f"{option}: the lower end comes first and is smaller")
    return ends


def _finite(value: float, option: str) -> float:
    if not math.isfinite(value):
        raise InputError(f"{option}: a value is a finite number")
    return value


def _step(value: float, option: str) -> float:
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{option} {value:g}: a step is a finite number > 0")
    return value


def _once(name: str, given: Mapping[str, object], option: str) -> None:
    if name in given:
        raise InputError(f"{option}: '{name}' is given twice", hint="leave one of both out")
