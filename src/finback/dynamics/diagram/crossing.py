"""What the curves of a diagram say of a walk through a strip of its plane: how many cycles are born and die on it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np

from finback.dynamics.diagram.curve import CurveKind, Diagram, DiagramCurve, PointKind

_SAFE: Final = 4.0  # times what interpolation may be off by: nearer to a curve nothing is said
_GRAIN: Final = 1e-7  # of the height of the plane: the same where interpolation is exact
_ENDS: Final = 2e-3  # of the width of the plane: nearer to the end of a curve nothing is said

Tally = dict[tuple[int, ...], tuple[int, int]]
"""Equilibria inside -> numbers of stable and of unstable cycles."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Met:
    """A curve where a vertical line meets it.

    Attributes:
        curve: the curve.
        lam: where.
        doubt: how far interpolation may be off.
        change: of the numbers of stable and unstable cycles, as λ rises through it.
        known: whether that change is known there.
    """

    curve: DiagramCurve
    lam: float
    doubt: float
    change: tuple[int, int]
    known: bool


def met_at(diagram: Diagram, cell: int, mu: float) -> list[Met]:
    """Return the exact curves of a strip, where they are at a μ, by rising λ."""
    height = float(diagram.lam_range[1] - diagram.lam_range[0])
    found = []
    for curve in diagram.curves:
        if curve.exact and not curve.kind.is_line and curve.cell == cell and curve.mu[0] <= mu <= curve.mu[-1]:
            lam, doubt = _interpolated(curve, mu)
            change = _change_at(diagram, curve, mu)
            found.append(
                Met(
                    curve=curve,
                    lam=lam,
                    doubt=_SAFE * doubt + _GRAIN * height,
                    change=change or (0, 0),
                    known=change is not None,
                )
            )
    return sorted(found, key=lambda met: met.lam)


def _change_at(diagram: Diagram, curve: DiagramCurve, mu: float) -> tuple[int, int] | None:
    """Return the change on a curve, None if it is another one at the next points and no point between says why."""
    right = min(max(1, int(np.searchsorted(curve.mu, mu))), curve.mu.size - 1)
    ends = [tuple(curve.change[index].astype(int).tolist()) for index in (right - 1, right)]
    if ends[0] == ends[1]:
        return ends[0][0], ends[0][1]
    turns = {
        point.mu
        for point in diagram.points
        if curve.name in point.curves and point.kind in (PointKind.BAUTIN, PointKind.NEUTRAL_LOOP)
    }
    for own, other in ((0, 1), (1, 0)):
        if float(curve.mu[right - 1 + other]) in turns:
            return ends[own][0], ends[own][1]
    return None


def _interpolated(curve: DiagramCurve, mu: float) -> tuple[float, float]:
    """Return λ by a cubic through four neighbors, and how much a straight line between two differs."""
    right = int(np.searchsorted(curve.mu, mu))
    if right < curve.mu.size and curve.mu[right] == mu:
        return float(curve.lam[right]), 0.0
    first = max(0, min(right - 2, curve.mu.size - 4))
    near = slice(first, first + 4)
    mus, lams = curve.mu[near], curve.lam[near]
    cubic = sum(
        lam * math.prod((mu - other) / (place - other) for other in mus if other != place)
        for place, lam in zip(mus, lams, strict=True)
    )
    line = float(np.interp(mu, curve.mu, curve.lam))
    return float(cubic), abs(float(cubic) - line)


def vertical_places(diagram: Diagram, met: Sequence[Met]) -> list[float]:
    """Return values of λ below, above and between the curves, where the gap is wide enough to be in one."""
    height = float(diagram.lam_range[1] - diagram.lam_range[0])
    if not met:
        return [float(diagram.lam_range.mean())]
    margin = 0.05 * height
    places = [met[0].lam - margin]
    for below, above in pairwise(met):
        if above.lam - below.lam > 2.0 * (below.doubt + above.doubt):
            places.append(0.5 * (below.lam + above.lam))
    return [*places, met[-1].lam + margin]


def said_between(met: Sequence[Met], low: float, high: float) -> Tally | None:
    """Return the change of all numbers on a vertical line, from a lower to a higher λ; None where it is not known."""
    total: Tally = {}
    for one in met:
        if low < one.lam < high:
            if not one.known:
                return None
            _add(total, one.curve, one.change, 1)
    return total


def said_along(diagram: Diagram, cell: int, start: tuple[float, float], end: tuple[float, float]) -> Tally | None:
    """Return the change of all numbers along a straight segment inside a strip; None if it passes too near an end.

    Args:
        diagram: the diagram.
        cell: the strip.
        start: μ and λ.
        end: μ and λ, at another μ.
    """
    if start[0] > end[0]:
        back = said_along(diagram, cell, end, start)
        return None if back is None else {key: (-a, -b) for key, (a, b) in back.items()}
    width = float(diagram.mu_range[1] - diagram.mu_range[0])
    height = float(diagram.lam_range[1] - diagram.lam_range[0])
    total: Tally = {}
    for curve in diagram.curves:
        if not curve.exact or curve.kind.is_line or curve.cell != cell:
            continue
        for place, lam in ((curve.mu[0], curve.lam[0]), (curve.mu[-1], curve.lam[-1])):
            if _distance(start, end, (float(place), float(lam)), (width, height)) < _ENDS:
                return None
        crossed = _crossed(diagram, curve, start, end)
        if crossed is None:
            return None
        for way, change in crossed:
            _add(total, curve, change, way)
    return total


def _crossed(
    diagram: Diagram, curve: DiagramCurve, start: tuple[float, float], end: tuple[float, float]
) -> list[tuple[int, tuple[int, int]]] | None:
    """Return in which way a segment crosses a curve, each time, and what changes there; None where it grazes it."""
    height = float(diagram.lam_range[1] - diagram.lam_range[0])
    low, high = max(start[0], float(curve.mu[0])), min(end[0], float(curve.mu[-1]))
    if low >= high:
        return []
    inside = curve.mu[(curve.mu > low) & (curve.mu < high)].tolist()
    marks = [low, *inside, high]
    fine = sorted({*marks, *(0.5 * (a + b) for a, b in pairwise(marks))})
    slope = (end[1] - start[1]) / (end[0] - start[0])
    above = []
    for mu in fine:
        lam, doubt = _interpolated(curve, mu)
        gap = start[1] + slope * (mu - start[0]) - lam
        if abs(gap) <= _SAFE * doubt + _GRAIN * height:
            if mu in (low, high):
                return None
            continue
        above.append((mu, gap > 0.0))
    found = []
    for (before, was), (after, is_above) in pairwise(above):
        if was != is_above:
            change = _change_at(diagram, curve, 0.5 * (before + after))
            if change is None:
                return None
            found.append((1 if is_above else -1, change))
    return found


def _distance(
    start: tuple[float, float], end: tuple[float, float], point: tuple[float, float], size: tuple[float, float]
) -> float:
    """Return the distance of a point from a segment, the plane scaled to a unit square."""
    run, rise = (end[0] - start[0]) / size[0], (end[1] - start[1]) / size[1]
    x, y = (point[0] - start[0]) / size[0], (point[1] - start[1]) / size[1]
    share = max(0.0, min(1.0, (x * run + y * rise) / (run * run + rise * rise)))
    return math.hypot(x - share * run, y - share * rise)


def _add(total: Tally, curve: DiagramCurve, change: tuple[int, int], way: int) -> None:
    if curve.enclosed and any(change):
        stable, unstable = total.get(curve.enclosed, (0, 0))
        total[curve.enclosed] = (stable + way * change[0], unstable + way * change[1])


def unsaid(diagram: Diagram, cell: int, *places: float) -> set[tuple[int, ...]]:
    """Return the groups of equilibria on whose cycles a diagram is silent at some μ: beyond an end not resolved."""
    silent = set()
    for curve in diagram.curves:
        if curve.exact and curve.cell == cell:
            if curve.ends[0] == "unresolved" and min(places) < curve.mu[0]:
                silent.add(curve.enclosed)
            if curve.ends[1] == "unresolved" and max(places) > curve.mu[-1]:
                silent.add(curve.enclosed)
    return silent


def hopf_of(met: Sequence[Met]) -> Iterator[tuple[int, Met]]:
    """Yield the Hopf curves among curves, with their antisaddle."""
    for one in met:
        if one.curve.kind is CurveKind.HOPF:
            yield one.curve.enclosed[0], one
