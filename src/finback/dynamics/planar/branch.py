"""Branches of equilibria of a planar field over a range of the parameter, and what lies on them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.equilibrium import Kind
from finback.dynamics.planar.branch_point import PlanarBranchPoint, branch_events, branch_point
from finback.dynamics.planar.equilibrium import PlanarEquilibrium
from finback.dynamics.planar.event import Event, determinant_of, trace_of, zeros
from finback.dynamics.planar.fold import PlanarCusp, PlanarFold, planar_cusp, planar_fold
from finback.dynamics.planar.hopf import PlanarBogdanovTakens, PlanarHopf, PlanarNeutralSaddle, planar_trace_zero
from finback.dynamics.planar.jet import PlanarJet, Point
from finback.dynamics.planar.path import BranchEnd, Node, along, clipped, corrected, follow, node, norm
from finback.dynamics.planar.system import PlanarSystem

_ON_THE_PATH: Final = 1e-6  # in units of half the box: as far as an equilibrium near a fold is known, and some more
_SAME: Final = 1e-6
_EDGE: Final = 1e-10  # a point as near as this to the edge of the box lies in it
_Located = TypeVar(
    "_Located", PlanarFold, PlanarCusp, PlanarHopf, PlanarNeutralSaddle, PlanarBogdanovTakens, PlanarBranchPoint
)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarBranch:
    """One connected curve of equilibria within the box, in the order in which it runs; arrays of equal length n.

    Attributes:
        parameter: shape (n,).
        state: shape (n, 2).
        divergence: trace of the Jacobian, in 1/s.
        determinant: of the Jacobian, in 1/s².
        stable: both eigenvalues have negative real parts.
        in_domain: state and parameter lie where data supported the system.
        ends: why it begins and why it ends; both ``closed`` where it returns, the first point repeated at the end.
    """

    parameter: FloatArray
    state: FloatArray
    divergence: FloatArray
    determinant: FloatArray
    stable: NDArray[np.bool_]
    in_domain: NDArray[np.bool_]
    ends: tuple[BranchEnd, BranchEnd]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("parameter", "state", "divergence", "determinant"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        for name in ("stable", "in_domain"):
            flags = np.array(getattr(self, name), dtype=np.bool_)
            flags.setflags(write=False)
            object.__setattr__(self, name, flags)

    @property
    def closed(self) -> bool:
        """Whether it returns to where it began."""
        return self.ends[0] is BranchEnd.CLOSED


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarBranches:
    """All branches found, and the points located on them, each once, by rising parameter.

    Attributes:
        branches: by parameter and state of where they begin.
        folds: where a branch turns round in the parameter.
        cusps: where the determinant touches zero without a fold.
        hopf_points: where a cycle is born.
        neutral_saddles: where the trace of a saddle vanishes.
        bogdanov_takens: where trace and determinant vanish together.
        branch_points: where branches cross.
        conservative: whether the trace is zero, within rounding, all along some branch.
    """

    branches: tuple[PlanarBranch, ...]
    folds: tuple[PlanarFold, ...]
    cusps: tuple[PlanarCusp, ...]
    hopf_points: tuple[PlanarHopf, ...]
    neutral_saddles: tuple[PlanarNeutralSaddle, ...]
    bogdanov_takens: tuple[PlanarBogdanovTakens, ...]
    branch_points: tuple[PlanarBranchPoint, ...]
    conservative: bool


def planar_branches(
    system: PlanarSystem,
    parameter_range: tuple[float, float],
    box: FloatArray,
    starts: Sequence[PlanarEquilibrium],
) -> PlanarBranches:
    """Follow the branches through every start within the box, each branch once.

    A branch that meets none of the starts (closed, and between the parameters at which they were sought) is not seen.

    Args:
        system: the field.
        parameter_range: lowest and highest parameter.
        box: lowest and highest of each state, shape (2, 2); branches end at its edges.
        starts: equilibria from which to begin.
    """
    search = _Search(system, parameter_range, box)
    # Degenerate ones last: what they are near is then mostly known, and they are known less well.
    for start in sorted(starts, key=lambda point: point.kind is Kind.DEGENERATE):
        search.start(start)
    return search.result()


class _Search:
    """Paths in units of half the box, and what was located on them."""

    def __init__(self, system: PlanarSystem, parameter_range: tuple[float, float], box: FloatArray) -> None:
        limits = np.array([*box, parameter_range], dtype=np.float64)
        units = 0.5 * (limits[:, 1] - limits[:, 0])
        self._jet = PlanarJet(system, (float(units[0]), float(units[1]), float(units[2])))
        low, high = (limits / units[:, None]).T.tolist()
        self._low: Point = (low[0], low[1], low[2])
        self._high: Point = (high[0], high[1], high[2])
        self._paths: list[tuple[list[Node], tuple[BranchEnd, BranchEnd]]] = []

    def start(self, equilibrium: PlanarEquilibrium) -> None:
        """Follow the branch through an equilibrium in both directions, unless it is known."""
        units = self._jet.units
        first, second = equilibrium.state.tolist()
        at: Point = (first / units[0], second / units[1], equilibrium.parameter / units[2])
        if not self._inside(at) or any(_holds(self._jet, nodes, at) for nodes, _ in self._paths):
            return
        here = node(self._jet, at, (0.0, 0.0, 1.0))
        if here.side == 0:
            return  # a branch point: its branches are met from other starts
        forward, end = follow(self._jet, here, self._low, self._high)
        if end is BranchEnd.CLOSED:
            self._paths.append(([here, *forward], (end, end)))
            return
        turned = Node(here.at, (-here.tangent[0], -here.tangent[1], -here.tangent[2]), 0.0, 0.0, -here.side)
        backward, begin = follow(self._jet, turned, self._low, self._high)
        before = [
            Node(n.at, (-n.tangent[0], -n.tangent[1], -n.tangent[2]), n.trace, n.determinant, -n.side)
            for n in reversed(backward)
        ]
        self._paths.append(([*before, here, *forward], (begin, end)))

    def _inside(self, at: Point) -> bool:
        return all(a - _EDGE <= v <= b + _EDGE for a, v, b in zip(self._low, at, self._high, strict=True))

    def result(self) -> PlanarBranches:
        """Locate what lies on the paths, and return all."""
        folds: list[Event] = []
        crossings: list[Event] = []
        traces: list[Event] = []
        conservative = False
        for nodes, ends in self._paths:
            # A closed path is gone through once more at its beginning, where it has no neighbors.
            run = [*nodes, *nodes[1:3]] if ends[0] is BranchEnd.CLOSED else nodes
            own = branch_events(self._jet, run)
            crossings += own
            folds += [e for e in zeros(self._jet, run, determinant_of(self._jet)) if _apart(e, own)]
            traces += zeros(self._jet, run, trace_of(self._jet))
            conservative |= not any(trace_of(self._jet).sign(n.at) for n in run)
        folds, crossings, traces = (self._kept(events) for events in (folds, crossings, traces))
        zeros_found = [planar_trace_zero(self._jet, event) for event in traces if event.crossing]
        return PlanarBranches(
            branches=tuple(sorted((self._branch(*path) for path in self._paths), key=_beginning)),
            folds=_sorted(planar_fold(self._jet, event) for event in folds if event.crossing),
            cusps=_sorted(planar_cusp(self._jet, event) for event in folds if not event.crossing),
            hopf_points=_sorted(z for z in zeros_found if isinstance(z, PlanarHopf)),
            neutral_saddles=_sorted(z for z in zeros_found if isinstance(z, PlanarNeutralSaddle)),
            bogdanov_takens=_sorted(z for z in zeros_found if isinstance(z, PlanarBogdanovTakens)),
            branch_points=_sorted(branch_point(self._jet, event) for event in crossings),
            conservative=conservative,
        )

    def _kept(self, events: list[Event]) -> list[Event]:
        """Keep what lies in the box, each once."""
        kept: list[Event] = []
        for event in events:
            if self._inside(event.at) and _apart(event, kept):
                kept.append(event)
        return kept

    def _branch(self, nodes: list[Node], ends: tuple[BranchEnd, BranchEnd]) -> PlanarBranch:
        """Cut a path to the box and put it into SI."""
        inner, reasons = list(nodes), list(ends)
        for side in (0, -1):
            if ends[side] in (BranchEnd.CLOSED, BranchEnd.STALLED):
                continue
            outer = inner.pop(side)
            cut = clipped(self._jet, inner[side], outer, self._low, self._high)
            if cut is not None:
                inner.insert(0 if side == 0 else len(inner), cut[0])
                reasons[side] = cut[1]
        places = np.array([n.at for n in inner]) * np.array(self._jet.units)
        trace, determinant = np.array([n.trace for n in inner]), np.array([n.determinant for n in inner])
        domain = self._jet.system.supported
        return PlanarBranch(
            parameter=places[:, 2],
            state=places[:, :2],
            divergence=trace,
            determinant=determinant,
            stable=(trace < 0.0) & (determinant > 0.0),
            in_domain=((domain[:, 0] <= places) & (places <= domain[:, 1])).all(axis=1),
            ends=(reasons[0], reasons[1]),
        )


def _holds(jet: PlanarJet, nodes: list[Node], at: Point) -> bool:
    """Tell whether a path runs through an equilibrium: near some chord, and there by Newton's method across it."""
    places = np.array([n.at for n in nodes])
    chords, offsets = np.diff(places, axis=0), np.array(at) - places[:-1]
    lengths = np.maximum((chords * chords).sum(axis=1), np.finfo(np.float64).tiny)
    shares = (offsets * chords).sum(axis=1) / lengths
    gaps = np.linalg.norm(offsets - shares[:, None] * chords, axis=1)
    near = (shares >= -_EDGE) & (shares <= 1.0 + _EDGE) & (gaps <= 0.25 * np.sqrt(lengths) + _EDGE)
    for k in np.flatnonzero(near).tolist():
        chord = (float(chords[k, 0]), float(chords[k, 1]), float(chords[k, 2]))
        found = corrected(jet, along(nodes[k].at, chord, float(shares[k])), chord)
        if found is not None and norm(along(found, at, -1.0)) <= _ON_THE_PATH:
            return True
    return False


def _apart(event: Event, others: Iterable[Event]) -> bool:
    return all(norm(along(event.at, other.at, -1.0)) > _SAME for other in others)


def _beginning(branch: PlanarBranch) -> tuple[float, ...]:
    return (float(branch.parameter[0]), *branch.state[0].tolist())


def _sorted(points: Iterable[_Located]) -> tuple[_Located, ...]:
    return tuple(sorted(points, key=lambda point: (point.parameter, *point.state.tolist())))
