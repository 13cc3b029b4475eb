"""All figures of a report, in its order, and their files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from finback.dynamics.any_form import AnyAnalysis
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.files import write_text
from finback.identification.identify import Identification
from finback.records import Sweep
from finback.validation.validate import Validation
from finback.views.bifurcation_figure import bifurcation_diagram
from finback.views.coverage_figure import sweep_coverage
from finback.views.fold_figure import fold_cases, fold_close_up
from finback.views.holdout_figure import holdout_history
from finback.views.planar_stability_figure import planar_bounded, planar_stability_regions
from finback.views.stability_figure import bounded, stability_regions
from finback.views.style import Drawing
from finback.views.trace_figure import trace_over_elevator


def draw_figures(
    *, sweep: Sweep, identification: Identification, analysis: AnyAnalysis, validation: Validation
) -> tuple[Drawing, ...]:
    """Draw everything that a report shows; names are unique. Without a bounded region there is none of regions."""
    return (
        bifurcation_diagram(analysis, validation),
        *(fold_close_up(case, analysis, validation) for case in fold_cases(analysis, validation)),
        *(holdout_history(holdout) for holdout in validation.holdouts),
        trace_over_elevator(analysis),
        *_regions(analysis),
        sweep_coverage(sweep, identification),
    )


def _regions(analysis: AnyAnalysis) -> tuple[Drawing, ...]:
    if isinstance(analysis, PlanarAnalysis):
        return (planar_stability_regions(analysis),) if planar_bounded(analysis) else ()
    return (stability_regions(analysis),) if bounded(analysis) else ()


def save_figures(folder: Path, drawings: Iterable[Drawing]) -> None:
    """Write each figure as ``<name>.svg``; the folder is made if it is missing.

    Raises:
        OSError: the folder or a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for drawing in drawings:
        write_text(folder / f"{drawing.name}.svg", drawing.svg)
