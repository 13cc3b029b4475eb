"""What a two-parameter diagram is made of: curves, points, and the strips of the plane between them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.family import Family
from finback.errors import InputError


class CurveKind(StrEnum):
    """What happens on a curve of the plane (μ, λ)."""

    FOLD = "fold"
    """a saddle and an antisaddle (a focus or a node) meet and vanish; a line of constant μ"""
    TRANSCRITICAL = "transcritical"
    """a saddle and an antisaddle meet and change places; a line of constant μ"""
    PITCHFORK = "pitchfork"
    """three equilibria become one; a line of constant μ"""
    INFINITY = "infinity"
    """an equilibrium comes from infinity; a line of constant μ"""
    HOPF = "hopf"
    """the trace of an antisaddle is zero"""
    HOMOCLINIC = "homoclinic"
    """an orbit leaves a saddle and comes back to it"""
    HETEROCLINIC = "heteroclinic"
    """an orbit leaves a saddle and enters another one"""
    SADDLE_CYCLE = "saddle-cycle"
    """two connections exist at once along a whole curve, by a symmetry: a two-saddle cycle, or a figure-eight"""
    CYCLE_FOLD = "cycle-fold"
    """two limit cycles meet and vanish"""

    @property
    def is_line(self) -> bool:
        """Whether equilibria meet there, at a μ that does not depend on λ."""
        return self in (CurveKind.FOLD, CurveKind.TRANSCRITICAL, CurveKind.PITCHFORK, CurveKind.INFINITY)


class PointKind(StrEnum):
    """What is special at a point of the plane."""

    BOGDANOV_TAKENS = "bogdanov-takens"
    """two equilibria meet with zero trace; at a pitchfork it is of higher codimension"""
    BAUTIN = "bautin"
    """the first Lyapunov coefficient changes its sign: a fold of cycles ends on a Hopf curve"""
    NEUTRAL_LOOP = "neutral-loop"
    """a homoclinic loop of a saddle with zero trace, or a neutral saddle cycle: a fold of cycles ends there, flat"""
    TWO_SADDLE_CYCLE = "two-saddle-cycle"
    """two saddles are connected both ways: a homoclinic curve ends on two heteroclinic ones"""
    DOUBLE_HOMOCLINIC = "double-homoclinic"
    """a saddle has a loop on each side: the curve of the large loop ends there"""
    CYCLE_CUSP = "cycle-cusp"
    """two folds of cycles meet: three cycles in one"""
    SADDLE_NODE_LOOP = "saddle-node-loop"
    """a curve of loops ends on a line where the saddle meets an antisaddle whose trace is not zero"""
    CROSSING = "crossing"
    """two curves cross that have nothing to do with each other; the corner of four regions"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DiagramCurve:
    """One curve, by rising μ; a line of constant μ by rising λ.

    Equilibria are counted from 0 by rising x, among those of the strip (``Cell``) in which the curve lies.

    Attributes:
        kind: what happens on it.
        name: tells it from all others of the diagram: kind, equilibria, way, strip.
        cell: index of the strip in which it lies; of a line, of the strip on its left (-1: there is none).
        exact: whether its points lie on the curve of the family itself; False: on a first-order estimate of it.
        mu: shape (n,).
        lam: shape (n,).
        x: the place on the axis y = 0, shape (n,): of the equilibrium (line, Hopf), of the last turn of the orbit
            (homoclinic), of the saddle it enters (heteroclinic without a turn), or where the cycle turns on the right.
        residual: shape (n,): the force at x (line, Hopf), the splitting in x or y (loop), ∮(f + λ) dt (fold of
            cycles), the difference of the two λ (saddle cycle); nan where none is known (estimates, points in closed
            form at the end of a curve, folds of cycles nearer to a loop than an orbit can be followed).
        resolved: shape (n,): whether double precision tells the point from all it could be taken for. Where not, λ
            still holds; what else is said about the point does not.
        enclosed: the antisaddle (Hopf), or the equilibria inside the cycles that are born or die on the curve; empty
            where none are.
        change: how the numbers of stable and of unstable cycles around ``enclosed`` change as λ rises through the
            curve, shape (n, 2), integers; zero on lines and where no cycle is involved.
        ends: what is at its first and its last point: the name of a point of the diagram or of a line, ``"range"``
            (the edge of the range of μ or λ), or ``"unresolved"`` (a note of the diagram says why).
        caution: what is known against it; empty if nothing is.
    """

    kind: CurveKind
    name: str
    cell: int
    exact: bool
    mu: FloatArray
    lam: FloatArray
    x: FloatArray
    residual: FloatArray
    resolved: NDArray[np.bool_]
    enclosed: tuple[int, ...]
    change: FloatArray
    ends: tuple[str, str]
    caution: str = ""

    def __post_init__(self) -> None:
        """Freeze and check the arrays."""
        for name in ("mu", "lam", "x", "residual", "change"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        flags = np.array(self.resolved, dtype=np.bool_)
        flags.setflags(write=False)
        object.__setattr__(self, "resolved", flags)
        count = self.mu.size
        shapes = [getattr(self, name).shape for name in ("mu", "lam", "x", "residual", "resolved")]
        if count == 0 or shapes != [(count,)] * 5 or self.change.shape != (count, 2):
            raise InputError(f"the columns of the curve {self.name!r} have shapes {shapes}, {self.change.shape}")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DiagramPoint:
    """A point where curves end, meet or cross.

    Attributes:
        kind: what is special.
        name: tells it from all others of the diagram.
        exact: whether it is a point of the family itself; False: an estimate, or an extrapolation of curves.
        mu: where.
        lam: where.
        x: the place on the axis y = 0, as for the curves.
        bracket: two μ between which it lies, shape (2,): what vanishes there has opposite signs at them; both are its
            μ where that is known in closed form.
        residual: what vanishes there, as evaluated.
        resolved: whether it is known to be one point, to double precision.
        curves: names of the curves that meet there.
    """

    kind: PointKind
    name: str
    exact: bool
    mu: float
    lam: float
    x: float
    bracket: FloatArray
    residual: float
    resolved: bool
    curves: tuple[str, ...]

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "bracket", frozen_array(self.bracket))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """A strip of the plane between two lines: the same number of equilibria throughout, saddles in the same places.

    Attributes:
        mu: its edges, shape (2,).
        saddles: of each equilibrium by rising x, whether it is a saddle.
    """

    mu: FloatArray
    saddles: tuple[bool, ...]

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "mu", frozen_array(self.mu))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DiagramOptions:
    """How a diagram is made.

    Attributes:
        nodes: at how many μ in each strip, at least, everything is searched.
        smoothness: how far a point of a curve may lie from the chord of its neighbors, as a share of the plane.
        most_turns: how often a connection may turn (see ``loops``); limit cycles are bounded by loops of two.
    """

    nodes: int = 13
    smoothness: float = 4e-3
    most_turns: int = 2

    def __post_init__(self) -> None:
        """Refuse what makes no diagram."""
        if self.nodes < 5 or not 1e-5 <= self.smoothness <= 0.1 or self.most_turns < 2:
            raise InputError(
                f"nodes = {self.nodes}, smoothness = {self.smoothness}, most_turns = {self.most_turns} make no diagram",
                hint="5 nodes or more, a smoothness from 1e-5 to 0.1, 2 turns or more",
            )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Diagram:
    """The plane (μ, λ) of a family, with all curves on which its phase portrait changes.

    λ is determined by μ on every curve that is no line, so that curves are complete in μ wherever they go in λ.

    Attributes:
        family: the family.
        mu_range: low and high, shape (2,).
        lam_range: low and high, shape (2,): the window; lines end there, other curves may leave it.
        cells: the strips, by rising μ.
        curves: all curves; the exact ones first.
        points: all special points, by rising μ.
        notes: what was not resolved or not found, and where; empty if there is nothing to be said.
        options: how it was made.
    """

    family: Family
    mu_range: FloatArray
    lam_range: FloatArray
    cells: tuple[Cell, ...]
    curves: tuple[DiagramCurve, ...]
    points: tuple[DiagramPoint, ...]
    notes: tuple[str, ...]
    options: DiagramOptions

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("mu_range", "lam_range"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))

    def of_kind(self, kind: CurveKind) -> tuple[DiagramCurve, ...]:
        """Return the exact curves of a kind."""
        return tuple(curve for curve in self.curves if curve.kind is kind and curve.exact)

    def curve(self, name: str) -> DiagramCurve:
        """Return the curve of a name."""
        for curve in self.curves:
            if curve.name == name:
                return curve
        raise InputError(f"no curve is named {name!r}", hint=", ".join(curve.name for curve in self.curves))

    def points_of_kind(self, kind: PointKind) -> tuple[DiagramPoint, ...]:
        """Return the points of a kind."""
        return tuple(point for point in self.points if point.kind is kind)
