"""The analysis of a model of longitudinal motion in the form that holds it: Liénard, or a planar field."""

from __future__ import annotations

from typing import Final

import numpy as np

from finback.dynamics.analysis import Analysis, AnalysisOptions, analyze
from finback.dynamics.analysis_range import Range, planar_options_for
from finback.dynamics.model import STATE, PolynomialModel
from finback.dynamics.planar.analysis import PlanarAnalysis, analyze_planar
from finback.dynamics.planar.system import PlanarSystem
from finback.dynamics.reduction import reduce
from finback.errors import RefusedError

AnyAnalysis = Analysis | PlanarAnalysis
"""What an analysis of a model in (alpha, q, elevator) may be."""

_WIDER: Final = 2.0
"""Of the range of q in the data: orbits that return to a stable equilibrium swing farther than what was flown."""


def why_planar(model: PolynomialModel) -> str:
    """Return why a model has no Liénard form, in words; empty if it has one.

    Raises:
        InputError: the model has further inputs that nobody holds.
    """
    try:
        reduce(model)
    except RefusedError as refusal:
        return refusal.message
    return ""


def analyze_any(model: PolynomialModel, options: AnalysisOptions) -> AnyAnalysis:
    """Analyze a model as one equation of second order if that holds every term, as a planar field elsewhere.

    A planar field is analyzed in the same ranges of alpha and elevator, and in a range of q twice as wide as that of
    the data; without data, in one that shows its equilibria.

    Raises:
        InputError: the model has further inputs, or nothing says at which q to look.
        RefusedError: the equilibria are not isolated.
    """
    if not why_planar(model):
        return analyze(reduce(model), options)
    system = PlanarSystem.from_model(model)
    ranges = {"alpha_rad": options.alpha_range_rad, "elevator_rad": options.elevator_range_rad, **q_range(system)}
    return analyze_planar(system, planar_options_for(system, ranges, {"elevator_rad": options.elevator_step_rad}))


def q_range(system: PlanarSystem) -> dict[str, Range]:
    """Return at which q a field in (alpha, q) is analyzed, by the variable's name; nothing if no data say it."""
    low, high = system.domain[1].tolist()
    if not (np.isfinite([low, high]).all() and low < high):
        return {}
    middle, half = 0.5 * (low + high), 0.5 * _WIDER * (high - low)
    return {STATE[1]: (middle - half, middle + half)}
