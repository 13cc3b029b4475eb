"""Stable and unstable manifolds of a saddle, near it by their power series, farther by the orbit that starts there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest, horner
from finback.dynamics.orbit.manifold_kernel import ORDER, expand_graph
from finback.dynamics.orbit.taylor import Ending, Path, follow
from finback.errors import RefusedError

_NODE: Final = 1e-6  # of a graph's height: near a fold the equilibria are known to no more digits


@final
@dataclass(frozen=True, slots=True)
class Manifold:
    """A stable or unstable manifold as a graph y = h(x − x_saddle), valid for |x − x_saddle| <= radius.

    Attributes:
        saddle: the abscissa of the saddle.
        eigenvalue: h'(0): positive for the unstable manifold.
        other_eigenvalue: the saddle's other one.
        series: h by rising power, from power 0 (which is 0).
        radius: where the series is as exact as double precision.
    """

    saddle: float
    eigenvalue: float
    other_eigenvalue: float
    series: tuple[float, ...]
    radius: float

    @property
    def stable(self) -> bool:
        """Whether it is the stable manifold."""
        return self.eigenvalue < 0.0


@final
@dataclass(frozen=True, slots=True)
class Branch:
    """One of the two branches of a manifold, from the saddle to where it ends.

    Attributes:
        manifold: whose branch.
        reach: x − x_saddle up to which the series serves; its sign tells the side.
        path: the orbit from there on, backward in time for a stable manifold; empty if the series serves all the way.
    """

    manifold: Manifold
    reach: float
    path: Path


def branch_to(flow: Flow, points: Sequence[Rest], whole: Manifold, section: float) -> Branch:
    """Follow the branch on the side of a line x = ``section`` to that line, or to where it turns or rests before.

    Args:
        flow: the flow.
        points: all its equilibria.
        whole: the manifold.
        section: the abscissa of the line.
    """
    distance = section - whole.saddle
    reach = math.copysign(min(abs(distance), whole.radius), distance)
    for point in points:
        u = point.x - whole.saddle
        if point.kind is not Kind.SADDLE and 0.0 < u / reach <= 1.0 and _ends_at(whole, u):
            return Branch(whole, u, Path((), Ending.REST, point.x, 0.0))
    y = horner(whole.series, reach)
    if abs(distance) <= whole.radius:  # a graph that has turned is none, so the branch has not
        return Branch(whole, reach, Path((), Ending.SECTION, section, y))
    forward = not whole.stable
    path = follow(flow, (whole.saddle + reach, y), forward=forward, section=section)
    return Branch(whole, reach, path)


def _ends_at(whole: Manifold, u: float) -> bool:
    """Tell whether a branch ends in the node at ``u``: the graph goes through it and belongs to the node from there."""
    highest = max(abs(horner(whole.series, share * u)) for share in (0.25, 0.5, 0.75))
    return abs(horner(whole.series, u)) < _NODE * highest


def manifold(flow: Flow, saddle: Rest, *, stable: bool) -> Manifold:
    """Expand a manifold: h h' = f h + g with h(0) = 0 and h'(0) an eigenvalue (see ``manifold_kernel``).

    Raises:
        RefusedError: no radius was found.
    """
    high, low = saddle.eigenvalues_real
    value, other = (low, high) if stable else (high, low)
    series, radius = graph(np.array(flow.damping), np.array(flow.force), saddle, stable=stable)
    return Manifold(saddle=saddle.x, eigenvalue=value, other_eigenvalue=other, series=tuple(series), radius=radius)


def graph(damping: FloatArray, force: FloatArray, saddle: Rest, *, stable: bool) -> tuple[list[float], float]:
    """Return the series of a manifold and its radius alone, from f and g by rising power.

    Raises:
        RefusedError: no radius was found.
    """
    high, low = saddle.eigenvalues_real
    series = np.empty(ORDER + 1)
    radius = expand_graph(damping, force, saddle.x, (low, high) if stable else (high, low), series)
    if not radius:
        raise RefusedError("the series of a manifold does not converge in double precision")
    return series.tolist(), radius
