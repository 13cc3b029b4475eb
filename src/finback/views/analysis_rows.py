"""What a report says of an analysis in tables, in one layout for models of either form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

from finback.dynamics.any_form import AnyAnalysis
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.views.cycle_rows import FamilyRow, RegimeRow, family_row, regime_row
from finback.views.labels import minus
from finback.views.planar_rows import (
    planar_connection_rows,
    planar_family_row,
    planar_point_rows,
    planar_regime_row,
    planar_region_row,
)
from finback.views.point_rows import PointRow, point_rows
from finback.views.stability_rows import ConnectionRow, RegionRow, connection_row, connections_of, region_row

_LIENARD_MEASURE: Final = (
    "The disturbance is measured from the equilibrium as √(Δα² + (Δα̇/ω)²), with ω the undamped frequency there. The "
    "area counts the plane of α and α̇."
)
_PLANAR_MEASURE: Final = (
    "The model is a planar field in α and q, analyzed within ranges of both. The disturbance is measured from the "
    "equilibrium with each of them in units of half its range; the area counts the plane of α and q within the ranges."
)
_NO_LIENARD_CONNECTION: Final = (
    "No saddle connection was found where it was looked for: on stretches of the elevator that end in a fold."
)
_NO_PLANAR_CONNECTION: Final = "No saddle connection was found within the ranges of elevator, α and q."


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class AnalysisRows:
    """The tables of an analysis, ready to be read.

    Attributes:
        connections: saddle connections by rising elevator.
        no_connection: what is said where there are none.
        points: zeros of the trace (of a planar field also cusps and branch points) by angle.
        cycle_statement: whether there are limit cycles, and how that is known.
        families: families of limit cycles.
        regimes: intervals of the elevator.
        regions: stability regions.
        measure: how disturbances and areas are measured.
    """

    connections: tuple[ConnectionRow, ...]
    no_connection: str
    points: tuple[PointRow, ...]
    cycle_statement: str
    families: tuple[FamilyRow, ...]
    regimes: tuple[RegimeRow, ...]
    regions: tuple[RegionRow, ...]
    measure: str


def analysis_rows(analysis: AnyAnalysis) -> AnalysisRows:
    """Return what was found as text, in degrees."""
    if isinstance(analysis, PlanarAnalysis):
        return AnalysisRows(
            connections=planar_connection_rows(analysis),
            no_connection=_NO_PLANAR_CONNECTION,
            points=planar_point_rows(analysis),
            cycle_statement=minus(analysis.limit_cycles.statement),
            families=tuple(map(planar_family_row, analysis.limit_cycles.families)),
            regimes=tuple(planar_regime_row(regime, analysis) for regime in analysis.regimes),
            regions=tuple(map(planar_region_row, analysis.regions)),
            measure=_PLANAR_MEASURE,
        )
    return AnalysisRows(
        connections=tuple(map(connection_row, connections_of(analysis))),
        no_connection=_NO_LIENARD_CONNECTION,
        points=point_rows(analysis),
        cycle_statement=minus(analysis.limit_cycles.absence.statement),
        families=tuple(map(family_row, analysis.limit_cycles.families)),
        regimes=tuple(map(regime_row, analysis.regimes)),
        regions=tuple(map(region_row, analysis.regions)),
        measure=_LIENARD_MEASURE,
    )
