"""Analyses apart from a run: of any model file, and of a run in another form or range."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from finback.dynamics.analysis import analyze as analyze_system
from finback.dynamics.analysis_range import Range, options_for, planar_options_for
from finback.dynamics.any_form import AnyAnalysis, q_range, why_planar
from finback.dynamics.planar.analysis import analyze_planar
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.reduction import reduce
from finback.pipeline.folder import analysis_of
from finback.pipeline.progress import SILENCE, Progress
from finback.store import ModelFile, load_identification, load_sweep


def analyze_otherwise(
    run: Path, *, ranges: Mapping[str, Range], steps: Mapping[str, float], progress: Progress = SILENCE
) -> AnyAnalysis:
    """Analyze the run's model in other ranges than its study asks; nothing is stored.

    Args:
        run: the folder.
        ranges: ``elevator_rad``, ``alpha_rad`` and (of a planar field) ``q_rad_s`` -> (low, high), as far as they are
            not the study's.
        steps: ``elevator_rad`` -> step of the list of equilibria, likewise.
        progress: who wants to know.

    Raises:
        MissingResultError: the model is missing or stale.
        InputError: a range is empty.
        RefusedError: the equilibria are not isolated.
    """
    asked = analysis_of(run, load_sweep(run))
    known = {"elevator_rad": asked.elevator_range_rad, "alpha_rad": asked.alpha_range_rad}
    model = load_identification(run).model
    every_step = {"elevator_rad": asked.elevator_step_rad, **steps}
    progress.begin("analyze", 0)
    if why_planar(model):
        field = PlanarSystem.from_model(model)
        return analyze_planar(field, planar_options_for(field, {**known, **q_range(field), **ranges}, every_step))
    system = reduce(model)
    return analyze_system(system, options_for(system, {**known, **ranges}, every_step))


def analyze_file(
    file: ModelFile, *, ranges: Mapping[str, Range], steps: Mapping[str, float], progress: Progress = SILENCE
) -> AnyAnalysis:
    """Analyze a model that belongs to no run: where it is asked, else where its file says, else where its data lie.

    Args:
        file: the model.
        ranges: variable, by its name in SI -> (low, high), as far as given.
        steps: parameter, by its name in SI -> step of the list of equilibria, if given.
        progress: who wants to know.

    Returns:
        The analysis of the Liénard system where one holds every term, of the planar field elsewhere.

    Raises:
        InputError: nothing says where to look, or a range is empty.
        RefusedError: the equilibria are not isolated.
    """
    system, asked = file.system(), {**file.ranges, **ranges}
    progress.begin("analyze", 0)
    if isinstance(system, PlanarSystem):
        return analyze_planar(system, planar_options_for(system, asked, steps))
    return analyze_system(system, options_for(system, asked, steps))
