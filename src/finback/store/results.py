"""Save and load what ``identify``, ``analyze`` and ``validate`` give, in the folder of a run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from finback.dynamics.analysis import Analysis
from finback.dynamics.any_form import AnyAnalysis
from finback.dynamics.located import Located, located
from finback.dynamics.located_planar import located_planar
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.errors import InputError
from finback.identification.identify import Identification
from finback.store.envelope import (
    ANALYZE,
    ANALYZE_PLANAR,
    IDENTIFY,
    VALIDATE,
    Stage,
    aircraft_of,
    check_fresh,
    command,
    read_result,
    schema_of,
    write_alone,
    write_result,
)
from finback.validation.metric import verdict
from finback.validation.validate import Validation

LOCATED: Final = "located"
"""Section of ``analysis.json``: every located object in one layout."""


def save_identification(identification: Identification, run: Path) -> None:
    """Write ``model.json``, as made from the sweep that stands in the run."""
    write_result(run, IDENTIFY, identification, aircraft_sha256=aircraft_of(run))


def load_identification(run: Path) -> Identification:
    """Read ``model.json``.

    Raises:
        MissingResultError: it is missing, or the sweep has changed since.
        InputError: it is damaged.
    """
    check_fresh(run, IDENTIFY)
    return read_result(run / IDENTIFY.file, IDENTIFY, Identification)[0]


def save_analysis(analysis: AnyAnalysis, run: Path) -> None:
    """Write ``analysis.json``, as made from the model that stands in the run."""
    stage, sections = _as_stored(analysis)
    write_result(run, stage, analysis, aircraft_sha256=aircraft_of(run), sections=sections)


def save_analysis_alone(analysis: AnyAnalysis, path: Path, *, inputs: Mapping[str, str]) -> None:
    """Write an analysis that belongs to no run, in the format of ``analysis.json``.

    Args:
        analysis: what was found.
        path: the file.
        inputs: file of the model -> SHA-256 of what it held.
    """
    stage, sections = _as_stored(analysis)
    write_alone(path, stage, analysis, inputs=inputs, sections=sections)


def _as_stored(analysis: AnyAnalysis) -> tuple[Stage, dict[str, tuple[Located, ...]]]:
    """Return what the file of an analysis is called, and its further sections."""
    if isinstance(analysis, PlanarAnalysis):
        return ANALYZE_PLANAR, {LOCATED: located_planar(analysis)}
    return ANALYZE, {LOCATED: located(analysis)}


def read_analysis_alone(path: Path) -> AnyAnalysis:
    """Read any file in the format of ``analysis.json``, whatever has become of its model.

    Raises:
        InputError: it cannot be read, is damaged, or is no analysis.
    """
    if schema_of(path) == ANALYZE_PLANAR.schema:
        return read_result(path, ANALYZE_PLANAR, PlanarAnalysis)[0]
    return read_result(path, ANALYZE, Analysis)[0]


def load_analysis(run: Path) -> AnyAnalysis:
    """Read ``analysis.json``: of a Liénard system, or of a planar field where the model is none.

    Raises:
        MissingResultError: it is missing, or the model or sweep has changed since.
        InputError: it is damaged.
    """
    check_fresh(run, ANALYZE)
    return read_analysis_alone(run / ANALYZE.file)


def save_validation(validation: Validation, run: Path) -> None:
    """Write ``validation.json``, as made from the sweep, model and analysis that stand in the run."""
    write_result(run, VALIDATE, validation, aircraft_sha256=aircraft_of(run))


def load_validation(run: Path) -> Validation:
    """Read ``validation.json``.

    Raises:
        MissingResultError: it is missing, or the sweep, model or analysis has changed since.
        InputError: it is damaged, or its verdict is not that of its metrics.
    """
    check_fresh(run, VALIDATE)
    path = run / VALIDATE.file
    validation = read_result(path, VALIDATE, Validation)[0]
    judged = verdict(validation.metrics)
    if validation.verdict != judged:
        raise InputError(
            f"{path} is damaged: its verdict is '{validation.verdict}', but its metrics say '{judged}'",
            hint=f"make it again with: {command(run, VALIDATE)}",
        )
    return validation
