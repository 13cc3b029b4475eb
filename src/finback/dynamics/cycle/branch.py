"""Families of limit cycles over the rotation parameter λ: from a focus or a loop outward, every end named."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.cycle.fold import CycleFold, annulus_folds
from finback.dynamics.family import Family
from finback.dynamics.flow import Flow, horner
from finback.dynamics.orbit.annulus import Annulus, groups
from finback.dynamics.orbit.closure import Closed


class FamilyEnd(StrEnum):
    """Where a family of cycles ends."""

    HOPF = "hopf"
    """it shrinks into an equilibrium"""
    LOOP = "loop"
    """its period grows without bound: it runs into a saddle"""
    RANGE = "range"
    """it goes on beyond the range of the parameter"""
    CLOSED = "closed"
    """it comes back to where it was begun"""
    LARGE = "large"
    """it grows to many times the size of the system"""
    EQUILIBRIA_MEET = "equilibria-meet"
    """two equilibria meet on it"""
    LOST = "lost"
    """it could not be followed farther"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CycleBranch:
    """All cycles around one group of equilibria at a held μ, outward; arrays of equal length n.

    Each position belongs to one λ only, so that a branch is followed by position and passes its folds without more ado.

    Attributes:
        mu: the parameter held.
        enclosed: the equilibria inside, by rising x.
        lam: the λ at which each cycle exists.
        x_min: where it turns on the left.
        x_max: where it turns on the right.
        period: the time of a turn.
        log_multiplier: logarithm of the Floquet multiplier.
        begin: the inner end: ``HOPF`` or ``LOOP``.
        end: the outer end: ``LOOP``, ``LARGE`` or ``LOST``.
        begin_lam: λ of the inner end: exact for a Hopf point; of a loop, that of the cycle nearest to it, which differs
            by nothing that double precision shows.
        end_lam: the same of the outer end; nan if it is no loop.
        folds: folds of cycles on it, outward.
    """

    mu: float
    enclosed: tuple[float, ...]
    lam: FloatArray
    x_min: FloatArray
    x_max: FloatArray
    period: FloatArray
    log_multiplier: FloatArray
    begin: FamilyEnd
    end: FamilyEnd
    begin_lam: float
    end_lam: float
    folds: tuple[CycleFold, ...]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("lam", "x_min", "x_max", "period", "log_multiplier"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def cycle_branches(family: Family, mu: float) -> tuple[CycleBranch, ...]:
    """Follow all cycles of a family at a held μ, around every group of equilibria.

    Raises:
        RefusedError: equilibria meet at this μ within rounding.
    """
    flow = family.at(mu, 0.0)
    return tuple(_branch(flow, mu, annulus) for group in groups(flow) if (annulus := group.annulus()) is not None)


def _branch(flow: Flow, mu: float, annulus: Annulus) -> CycleBranch:
    nodes = _distinct(annulus)
    focus = math.isnan(annulus.inner_saddle)
    if annulus.obstacle:
        end = FamilyEnd.LOST
    else:
        end = FamilyEnd.LARGE if math.isnan(annulus.outer_saddle) else FamilyEnd.LOOP
    return CycleBranch(
        mu=mu,
        enclosed=tuple(point.x for point in annulus.enclosed),
        lam=np.array([node.lam for node in nodes]),
        x_min=np.array([node.x_min for node in nodes]),
        x_max=np.array([node.x_max for node in nodes]),
        period=np.array([node.period for node in nodes]),
        log_multiplier=np.array([node.growth for node in nodes]),
        begin=FamilyEnd.HOPF if focus else FamilyEnd.LOOP,
        end=end,
        begin_lam=-horner(flow.damping, annulus.enclosed[0].x) if focus else annulus.inner.lam,
        end_lam=annulus.outer.lam if end is FamilyEnd.LOOP else math.nan,
        folds=annulus_folds(flow, annulus),
    )


def _distinct(annulus: Annulus) -> list[Closed]:
    """Return the orbits of all stretches, outward; the first of a stretch is the last of the one before."""
    first, *rest = annulus.stretches
    nodes = [*first.nodes, *(node for stretch in rest for node in stretch.nodes[1:])]
    return [nodes[0], *(after for before, after in pairwise(nodes) if after.period != before.period)]
