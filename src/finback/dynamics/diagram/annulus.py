"""The folds of cycles in one annulus."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from finback.arrays import frozen_array
from finback.dynamics.cycle.fold import CycleFold, extrema
from finback.dynamics.flow import Flow, horner
from finback.dynamics.orbit.annulus import Annulus
from finback.dynamics.orbit.closure import Chart, Closed

_GAP: Final = 1e-8  # of the rate: nearer to a loop only λ has a meaning (as in ``cycle_folds``)
_GRAIN: Final = 1e-14  # of the rate: nearer to the Hopf point a fold is not told from it


def folds_of(flow: Flow, annulus: Annulus, bounding: Callable[[float], list[float]]) -> tuple[CycleFold, ...]:
    """Return the folds of the cycles of an annulus, outward.

    Args:
        flow: the flow.
        annulus: its closed orbits.
        bounding: gives λ of the loops that bound it, exactly where they are near a λ.

    Raises:
        RefusedError: an orbit between two others could not be followed.
    """
    enclosed = tuple(point.x for point in annulus.enclosed)
    hopf = -horner(flow.damping, enclosed[0]) if len(enclosed) == 1 else math.nan
    return tuple(
        fold_of(
            annulus.stretches[one.stretch].chart,
            (one.node, one.low, one.high),
            enclosed,
            bounding(one.node.lam),
            hopf,
        )
        for one in extrema(flow, annulus)
    )


def fold_of(
    chart: Chart,
    nodes: tuple[Closed, Closed, Closed],
    enclosed: tuple[float, ...],
    loops: list[float],
    hopf: float,
) -> CycleFold:
    """Make a fold of the closed orbit where ∮(f + λ) dt is zero.

    Args:
        chart: of the orbits.
        nodes: the orbit, one farther in, and one farther out.
        enclosed: the equilibria inside.
        loops: λ of the loops that bound the annulus.
        hopf: λ of the Hopf point that bounds it, or nan.
    """
    node, low, high = nodes
    gap = min((abs(node.lam - lam) for lam in loops), default=math.nan)
    told = not abs(node.lam - hopf) <= _GRAIN * max(chart.rate, abs(hopf))
    return CycleFold(
        lam=node.lam,
        x_min=node.x_min,
        x_max=node.x_max,
        period=node.period,
        enclosed=enclosed,
        # λ* rises outward where the growth is negative, so from negative to positive is a maximum.
        vanishing=-1 if low.growth < 0.0 else 1,
        gap=gap,
        residual=node.growth,
        bracket=frozen_array((low.x_max, high.x_max)),
        resolved=told and not gap <= _GAP * chart.rate,
    )
