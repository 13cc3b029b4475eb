"""Stable and unstable manifolds of a saddle, near it by their power series, farther by the orbit that starts there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest, horner, shifted
from finback.dynamics.taylor import Ending, Path, follow
from finback.errors import RefusedError

ORDER: Final = 36
_SMALL: Final = 1e-17  # of the last terms of the series, relative to the slope
_RESIDUAL: Final = 1e-14  # of the invariance equation, relative to its terms
_NODE: Final = 1e-6  # of a graph's height: near a fold the equilibria are known to no more digits
_SHRINK: Final = 0.8
_TRIES: Final = 40


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
    """Expand a manifold: h h' = f h + g with h(0) = 0 and h'(0) an eigenvalue, coefficient by coefficient.

    The coefficient of power k is divided by k λ minus the other eigenvalue, which have opposite signs: it never
    vanishes. The radius follows from the decay of the coefficients, and is reduced until the equation holds to
    rounding at both ends.

    Raises:
        RefusedError: no radius was found.
    """
    high, low = saddle.eigenvalues_real
    value, other = (low, high) if stable else (high, low)
    # Constant and slope of the shifted polynomials are what the eigenvalues were made of; near a fold, where the slope
    # cancels, another rounding of it would not fit them.
    f = [value + other, *shifted(flow.damping, saddle.x)[1:]]
    g = [0.0, -value * other, *shifted(flow.force, saddle.x)[2:]]
    series = [0.0, value]
    for k in range(2, ORDER + 1):
        cross = sum(series[i] * series[k + 1 - i] for i in range(2, k))
        damped = sum(f[m] * series[k - m] for m in range(1, min(k, len(f))))
        forced = g[k] if k < len(g) else 0.0
        series.append((damped + forced - 0.5 * (k + 1) * cross) / (k * value - other))
    return Manifold(
        saddle=saddle.x,
        eigenvalue=value,
        other_eigenvalue=other,
        series=tuple(series),
        radius=_radius(series, f, g),
    )


def _radius(series: list[float], f: list[float], g: list[float]) -> float:
    spans = [(_SMALL * abs(series[1] / series[k])) ** (1.0 / (k - 1)) for k in range(ORDER - 3, ORDER + 1) if series[k]]
    radius: float = min([*spans, 1.0])  # a straight manifold ends somewhere: at the size of the system
    slopes = [k * c for k, c in enumerate(series)][1:]
    for _ in range(_TRIES):
        worst = 0.0
        for u in (-radius, radius):
            h, slope = horner(series, u), horner(slopes, u)
            terms = (h * slope, horner(f, u) * h, horner(g, u))
            size = sum(map(abs, terms))
            worst = max(worst, abs(terms[0] - terms[1] - terms[2]) / size if size else 1.0)
        if worst <= _RESIDUAL:
            return radius
        radius *= _SHRINK
    raise RefusedError("the series of a manifold does not converge in double precision")
