"""What ``--json`` prints: results as JSON in SI, each with a schema."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from finback import pipeline
from finback.dynamics.analysis import Analysis
from finback.dynamics.located import located
from finback.dynamics.located_planar import located_planar
from finback.dynamics.planar_analysis import PlanarAnalysis
from finback.dynamics.stability_region import StabilityRegion
from finback.identification.identify import Identification
from finback.records import Sweep
from finback.store.codec import to_json, to_tree
from finback.validation.validate import Validation


def show(document: dict[str, Any]) -> None:
    """Print a document to stdout."""
    sys.stdout.write(to_json(document))


def of_sweep(run: Path, sweep: Sweep) -> dict[str, Any]:
    """Return every flight with its outcome; the columns stand in ``sweep.parquet``."""
    return {
        "schema": "finback/sweep-summary/1",
        "run": str(run),
        "flights": [
            {
                "name": record.name,
                "outcome": record.outcome.value,
                "note": record.note,
                "duration_s": record.duration_s,
                "samples": len(record),
            }
            for record in sweep.records
        ],
    }


def of_identification(run: Path, identification: Identification) -> dict[str, Any]:
    """Return every coefficient with its standard error."""
    model, errors = identification.model, iter(identification.standard_errors.tolist())
    return {
        "schema": "finback/model-summary/1",
        "run": str(run),
        "coefficients": [
            {"equation": equation, "term": term, "value": value, "standard_error": next(errors)}
            for equation, polynomial in (("alpha_dot_rad_s", model.alpha_dot), ("q_dot_rad_s2", model.q_dot))
            for term, value in zip(polynomial.labels(), polynomial.coefficients.tolist(), strict=True)
        ],
        "unused": list(identification.unused),
        "warnings": list(identification.warnings),
    }


def of_analysis(source: Mapping[str, str], analysis: Analysis | PlanarAnalysis) -> dict[str, Any]:
    """Return every located object in one layout, stability regions without outline, and notes (docs/analysis.md).

    Args:
        source: ``run`` or ``model`` -> path; ``form`` -> ``lienard``, or ``planar`` and why; ``stored`` -> where the
            analysis is kept, empty if nowhere.
        analysis: what was found.
    """
    found = located_planar(analysis) if isinstance(analysis, PlanarAnalysis) else located(analysis)
    regions = analysis.regions if isinstance(analysis, Analysis) else ()
    return {
        "schema": "finback/analysis-summary/2",
        **source,
        "options": to_tree(analysis.options),
        "located": to_tree(found),
        "regions": [_without_outline(region) for region in regions],
        "notes": list(analysis.notes),
    }


def _without_outline(region: StabilityRegion) -> dict[str, Any]:
    """Return a stability region without the points of its boundary."""
    tree = {key: value for key, value in to_tree(region).items() if key != "boundary"}
    plain = ("alpha_min_rad", "alpha_max_rad", "period_s", "around")
    return {**tree, "cycles": [{key: cycle[key] for key in plain} for cycle in tree["cycles"]]}


def of_validation(run: Path, analysis: Analysis, validation: Validation) -> dict[str, Any]:
    """Return the verdict, every metric with its judgement, and the folds by each road."""
    return {
        "schema": "finback/validation-summary/1",
        "run": str(run),
        "verdict": validation.verdict.value,
        "metrics": [
            {**to_tree(metric), "error": to_tree(metric.error), "judgement": metric.judgement.value}
            for metric in validation.metrics
        ],
        "folds": {
            "predicted": to_tree(analysis.folds),
            "simulated": to_tree(validation.folds),
        },
        "notes": list(validation.notes),
    }


def of_run(run: pipeline.Run) -> dict[str, Any]:
    """Return what ``of_validation`` returns, with the report and the recordings."""
    recordings = sorted(str(path) for path in (run.folder / pipeline.RECORDINGS).glob("*.rrd"))
    return {
        **of_validation(run.folder, run.analysis, run.validation),
        "schema": "finback/run-summary/1",
        "warnings": list(run.identification.warnings),
        "report": str(run.report),
        "recordings": recordings,
    }
