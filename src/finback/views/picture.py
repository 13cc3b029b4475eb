"""What the figures of a report draw of an analysis, in one layout for models of either form."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import Protocol, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.analysis import Analysis
from finback.dynamics.any_form import AnyAnalysis
from finback.dynamics.branch import Branch
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.dynamics.planar.branch import PlanarBranch
from finback.validation.prediction import PredictedFold, prediction

Place = tuple[float, float]
"""Elevator and alpha, in rad."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CycleCurve:
    """A stretch of a family of limit cycles of one stability; arrays of equal length.

    Attributes:
        elevator_rad: at which they exist.
        alpha_min_rad: least alpha of each.
        alpha_max_rad: greatest alpha of each.
        stable: whether they attract.
    """

    elevator_rad: FloatArray
    alpha_min_rad: FloatArray
    alpha_max_rad: FloatArray
    stable: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_rad", "alpha_min_rad", "alpha_max_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """What is drawn over the elevator.

    Attributes:
        branches: curves of equilibria; along that of a Liénard system alpha rises, along others it may turn.
        folds: in the order of the analysis.
        fold_traces_1_s: the trace at each.
        hopf_points: where they are.
        neutral_saddles: likewise.
        bogdanov_takens: likewise.
        cycles: families of limit cycles, stretch by stretch.
        connections: elevator, and the alphas between which each saddle connection runs; a loop runs to its turn.
        elevator_range_rad: what was asked for.
        alpha_range_rad: what was asked for.
    """

    branches: tuple[Branch, ...]
    folds: tuple[PredictedFold, ...]
    fold_traces_1_s: tuple[float, ...]
    hopf_points: tuple[Place, ...]
    neutral_saddles: tuple[Place, ...]
    bogdanov_takens: tuple[Place, ...]
    cycles: tuple[CycleCurve, ...]
    connections: tuple[tuple[float, float, float], ...]
    elevator_range_rad: tuple[float, float]
    alpha_range_rad: tuple[float, float]


def picture_of(analysis: AnyAnalysis) -> Picture:
    """Return what is drawn of an analysis of a model in (alpha, q, elevator)."""
    return _of_planar(analysis) if isinstance(analysis, PlanarAnalysis) else _of_lienard(analysis)


def _of_lienard(analysis: Analysis) -> Picture:
    joined = analysis.connections
    return Picture(
        branches=(analysis.branch,),
        folds=prediction(analysis).folds,
        fold_traces_1_s=tuple(fold.divergence_1_s for fold in analysis.folds),
        hopf_points=_places(analysis.hopf_points),
        neutral_saddles=_places(analysis.neutral_saddles),
        bogdanov_takens=_places(analysis.bogdanov_takens),
        cycles=tuple(
            CycleCurve(
                elevator_rad=frozen_array([cycle.elevator_rad for cycle in found]),
                alpha_min_rad=frozen_array([cycle.alpha_min_rad for cycle in found]),
                alpha_max_rad=frozen_array([cycle.alpha_max_rad for cycle in found]),
                stable=stable,
            )
            for family in analysis.limit_cycles.families
            for stable, stretch in groupby(family.cycles, key=lambda cycle: cycle.stable)
            if (found := list(stretch))
        ),
        connections=(
            *((one.elevator_rad, one.from_alpha_rad, one.to_alpha_rad) for one in joined.heteroclinics),
            *((one.elevator_rad, one.alpha_rad, one.turn_alpha_rad) for one in joined.homoclinics),
        ),
        elevator_range_rad=analysis.options.elevator_range_rad,
        alpha_range_rad=analysis.options.alpha_range_rad,
    )


def _of_planar(analysis: PlanarAnalysis) -> Picture:
    found, joined = analysis.found, analysis.connections
    return Picture(
        branches=tuple(map(_branch, found.branches)),
        folds=prediction(analysis).folds,
        fold_traces_1_s=tuple(fold.other_eigenvalue for fold in found.folds),
        hopf_points=_planar_places(found.hopf_points),
        neutral_saddles=_planar_places(found.neutral_saddles),
        bogdanov_takens=_planar_places(found.bogdanov_takens),
        cycles=tuple(_planar_cycles(analysis)),
        connections=(
            *((one.parameter, float(one.from_state[0]), float(one.to_state[0])) for one in joined.heteroclinics),
            *(
                (one.parameter, float(one.state[0]), _farthest(one.orbit[:, 0], one.state))
                for one in joined.homoclinics
            ),
        ),
        elevator_range_rad=analysis.options.parameter_range,
        alpha_range_rad=analysis.options.first_range,
    )


def _branch(branch: PlanarBranch) -> Branch:
    alpha, q = branch.state.T
    return Branch(
        alpha_rad=alpha,
        elevator_rad=branch.parameter,
        q_rad_s=q,
        divergence_1_s=branch.divergence,
        determinant_1_s2=branch.determinant,
        stable=branch.stable,
        in_domain=branch.in_domain,
    )


def _planar_cycles(analysis: PlanarAnalysis) -> Iterator[CycleCurve]:
    for family in analysis.limit_cycles.families:
        for stable, stretch in groupby(enumerate(family.stable.tolist()), key=itemgetter(1)):
            rows = [row for row, _ in stretch]
            yield CycleCurve(
                elevator_rad=family.parameter[rows],
                alpha_min_rad=family.low[rows, 0],
                alpha_max_rad=family.high[rows, 0],
                stable=stable,
            )


def _farthest(alpha: FloatArray, saddle: FloatArray) -> float:
    return float(alpha[np.abs(alpha - saddle[0]).argmax()])


class _Point(Protocol):
    @property
    def elevator_rad(self) -> float: ...
    @property
    def alpha_rad(self) -> float: ...


class _PlanarPoint(Protocol):
    @property
    def parameter(self) -> float: ...
    @property
    def state(self) -> FloatArray: ...


def _places(points: Sequence[_Point]) -> tuple[Place, ...]:
    return tuple((point.elevator_rad, point.alpha_rad) for point in points)


def _planar_places(points: Sequence[_PlanarPoint]) -> tuple[Place, ...]:
    return tuple((point.parameter, float(point.state[0])) for point in points)
