"""Save and load what ``identify``, ``analyze`` and ``validate`` give, in the folder of a run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from finback.dynamics.analysis import Analysis
from finback.dynamics.located import located
from finback.dynamics.located_planar import located_planar
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.errors import InputError
from finback.identification.identify import Identification
from finback.store.envelope import (
    ANALYZE,
    ANALYZE_PLANAR,
    IDENTIFY,
    VALIDATE,
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


def save_analysis(analysis: Analysis, run: Path) -> None:
    """Write ``analysis.json``, as made from the model that stands in the run."""
    write_result(run, ANALYZE, analysis, aircraft_sha256=aircraft_of(run), sections={LOCATED: located(analysis)})


def save_analysis_alone(analysis: Analysis | PlanarAnalysis, path: Path, *, inputs: Mapping[str, str]) -> None:
    """Write an analysis that belongs to no run, in the format of ``analysis.json``.

    Args:
        analysis: what was found.
        path: the file.
        inputs: file of the model -> SHA-256 of what it held.
    """
    if isinstance(analysis, PlanarAnalysis):
        write_alone(path, ANALYZE_PLANAR, analysis, inputs=inputs, sections={LOCATED: located_planar(analysis)})
    else:
        write_alone(path, ANALYZE, analysis, inputs=inputs, sections={LOCATED: located(analysis)})


def read_analysis_alone(path: Path) -> Analysis | PlanarAnalysis:
    """Read any file in the format of ``analysis.json``, whatever has become of its model.

    Raises:
        InputError: it cannot be read, is damaged, or is no analysis.
    """
    if schema_of(path) == ANALYZE_PLANAR.schema:
        return read_result(path, ANALYZE_PLANAR, PlanarAnalysis)[0]
    return read_result(path, ANALYZE, Analysis)[0]


def load_analysis(run: Path) -> Analysis:
    """Read ``analysis.json``.

    Raises:
        MissingResultError: it is missing, or the model or sweep has changed since.
        InputError: it is damaged.
    """
    check_fresh(run, ANALYZE)
    return read_result(run / ANALYZE.file, ANALYZE, Analysis)[0]


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
