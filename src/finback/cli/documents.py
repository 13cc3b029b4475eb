"""What ``--json`` prints: results as JSON in SI, each with a schema."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from finback import pipeline
from finback.dynamics.analysis import Analysis
from finback.dynamics.any_form import AnyAnalysis
from finback.dynamics.cycle.family import CycleFamily
from finback.dynamics.equation import equation
from finback.dynamics.located import located
from finback.dynamics.located_planar import located_planar
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.dynamics.planar.analysis_cycles import ParameterCycles
from finback.dynamics.planar.cycle_family import PlanarCycleFamily
from finback.dynamics.planar.region import PlanarRegion
from finback.dynamics.stability.region import StabilityRegion
from finback.flight.accuracy import SweepAccuracy
from finback.identification.identify import Identification
from finback.records import Sweep
from finback.store.codec import to_json, to_tree
from finback.validation.prediction import prediction
from finback.validation.validate import Validation


def show(document: dict[str, Any]) -> None:
    """Print a document to stdout."""
    sys.stdout.write(to_json(document))


def of_sweep(run: Path, sweep: Sweep, accuracy: Sequence[SweepAccuracy]) -> dict[str, Any]:
    """Return every flight with its outcome; the columns stand in ``sweep.parquet``."""
    return {
        "schema": "finback/sweep-summary/2",
        "run": str(run),
        "discretization": sweep.provenance.get(pipeline.DISCRETIZATION, ""),
        "accuracy": to_tree(tuple(accuracy)),
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
    """Return every coefficient with its standard error, and with the plain Cramér-Rao bound where it is known."""
    model, errors = identification.model, iter(identification.standard_errors.tolist())
    coefficients: list[dict[str, Any]] = [
        {"equation": equation, "term": term, "value": value, "standard_error": next(errors)}
        for equation, polynomial in (("alpha_dot_rad_s", model.alpha_dot), ("q_dot_rad_s2", model.q_dot))
        for term, value in zip(polynomial.labels(), polynomial.coefficients.tolist(), strict=True)
    ]
    for item, bound in zip(coefficients, identification.cramer_rao_errors.tolist(), strict=False):  # none in old files
        item["cramer_rao_error"] = bound
    return {
        "schema": "finback/model-summary/1",
        "run": str(run),
        "method": identification.options.method.value,
        "coefficients": coefficients,
        "unused": list(identification.unused),
        "warnings": list(identification.warnings),
    }


def of_analysis(source: Mapping[str, str], analysis: AnyAnalysis) -> dict[str, Any]:
    """Return all located objects in one layout, families, regimes, regions without outline, notes (docs/analysis.md).

    Args:
        source: ``run`` or ``model`` -> path; ``form`` -> ``lienard``, or ``planar`` and why; ``stored`` -> where the
            analysis is kept, empty if nowhere.
        analysis: what was found.
    """
    return {
        "schema": "finback/analysis-summary/4",
        **source,
        "options": to_tree(analysis.options),
        "equation": {} if isinstance(analysis, PlanarAnalysis) else _equation(analysis),
        "located": to_tree(located_planar(analysis) if isinstance(analysis, PlanarAnalysis) else located(analysis)),
        "cycle_families": [_as_curve(family) for family in analysis.limit_cycles.families],
        "cycle_absence": _absence(analysis),
        "regimes": to_tree(analysis.regimes),
        "regions": [_without_outline(region) for region in analysis.regions],
        "notes": list(analysis.notes),
    }


def _equation(analysis: Analysis) -> dict[str, Any]:
    """Return the reduced equation; lists also where a row of coefficients is empty."""
    found = equation(analysis.system)
    rows = {name: [to_tree(one) for one in getattr(found, name)] for name in ("damping", "force")}
    return {**rows, **{name: to_tree(getattr(found, name)) for name in ("elevator_gain", "elevator_rate_gain")}}


def _absence(analysis: AnyAnalysis) -> dict[str, Any]:
    """Return what is known of the absence of limit cycles; of a planar field nothing is proved."""
    cycles = analysis.limit_cycles
    if isinstance(cycles, ParameterCycles):
        return {"verdict": cycles.verdict.value, "statement": cycles.statement}
    tree: dict[str, Any] = to_tree(cycles.absence)
    return {**tree, "undecided_rad": cycles.absence.undecided_rad.tolist()}  # a list also if it is empty


def _as_curve(family: CycleFamily | PlanarCycleFamily) -> dict[str, Any]:
    """Return a family of cycles as curves; its folds stand among the located objects."""
    if isinstance(family, PlanarCycleFamily):
        tree = {key: value for key, value in to_tree(family).items() if key != "folds"}
        return {**tree, "folds": len(family.folds)}
    names = ("elevator_rad", "alpha_min_rad", "alpha_max_rad", "period_s", "log_multiplier", "stable", "in_domain")
    return {
        "ends": [family.begin.value, family.end.value],
        "end_elevators_rad": [family.begin_elevator_rad, family.end_elevator_rad],
        **{name: [getattr(cycle, name) for cycle in family.cycles] for name in names},
        "folds": len(family.folds),
    }


def _without_outline(region: StabilityRegion | PlanarRegion) -> dict[str, Any]:
    """Return a stability region without the points of its boundary."""
    tree: dict[str, Any] = to_tree(region)
    if isinstance(region, PlanarRegion):
        kept = ("kind", "separates")
        return {**tree, "boundary": [{key: curve[key] for key in kept} for curve in tree["boundary"]]}
    saddles = ("saddle_alpha_rad", "side", "ending")
    plain = ("alpha_min_rad", "alpha_max_rad", "period_s", "around")
    return {
        **tree,
        "boundary": [{key: branch[key] for key in saddles} for branch in tree["boundary"]],
        "cycles": [{key: cycle[key] for key in plain} for cycle in tree["cycles"]],
    }


def of_validation(run: Path, analysis: AnyAnalysis, validation: Validation) -> dict[str, Any]:
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
            "predicted": to_tree(analysis.folds if isinstance(analysis, Analysis) else prediction(analysis).folds),
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
