"""How a boundary moves with the coefficients of the flow: the Melnikov wedge along it.

With x' = y and y' = F, the wedge D = x' δy − y' δx of the orbit's speed and the curve's displacement obeys
D' = f D + y δF (Melnikov 1963; see ``melnikov``). D over the speed is the displacement across the curve, so ∫ D dt is
what the area beside it gains. On the series of a manifold, where x' = h(u), the wedge is a power series in u itself;
on an orbit it is one in time, like x and y.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.flow import Flow
from finback.dynamics.stability.boundary_curve import NODES, WEIGHTS, CycleCurve, Segment, StableBranch, series_at


def branch_wedges(flow: Flow, branch: StableBranch) -> tuple[FloatArray, ...]:
    """Return for each segment of a stable branch the series of D by each coefficient.

    Returns:
        arrays of shape (terms, n), rising powers of the segment's parameter; the columns are the coefficients of f by
        rising power, then those of g.
    """
    near = _on_graph(flow, branch)
    start = series_at(near, branch.segments[0].span)
    return (near, *_along(flow, branch.segments[1:], start)[0])


def cycle_wedges(flow: Flow, cycle: CycleCurve) -> tuple[FloatArray, ...]:
    """Return the same for a cycle: D is periodic, as the displaced curve is closed."""
    columns = len(flow.damping) + len(flow.force)
    after = _along(flow, cycle.segments, np.zeros(columns))[1]
    return tuple(_along(flow, cycle.segments, after / (1.0 - cycle.multiplier))[0])


def _along(flow: Flow, segments: Sequence[Segment], start: FloatArray) -> tuple[list[FloatArray], FloatArray]:
    found = []
    for segment in segments:
        found.append(_on_orbit(flow, segment, start))
        start = series_at(found[-1], segment.span)
    return found, start


def _on_orbit(flow: Flow, segment: Segment, start: FloatArray) -> FloatArray:
    terms = segment.y.size
    drive = _drive(flow, segment, terms)
    wedge = np.zeros((terms, start.size))
    wedge[0] = start
    backward = segment.f[::-1]
    for k in range(terms - 1):
        wedge[k + 1] = (backward[-(k + 1) :] @ wedge[: k + 1] + drive[k]) / (k + 1)
    return wedge


def _on_graph(flow: Flow, branch: StableBranch) -> FloatArray:
    """Solve h D' = f D + h w, where h w is what drives the wedge, coefficient by coefficient (D vanishes at 0)."""
    segment = branch.segments[0]
    h, terms = segment.y, segment.y.size
    f = np.zeros(terms)
    f[: segment.f.size] = segment.f[:terms]
    drive = _drive(flow, segment, terms)
    wedge = np.zeros((terms, drive.shape[1]))
    slopes = np.zeros_like(wedge)  # k D_k
    for k in range(1, terms):
        right = drive[k] + f[1 : k + 1][::-1] @ wedge[:k]
        right = right - h[2 : k + 1] @ slopes[1:k][::-1]
        wedge[k] = right / (k * h[1] - f[0])
        slopes[k] = k * wedge[k]
    return wedge


def _drive(flow: Flow, segment: Segment, terms: int) -> FloatArray:
    """Return the series of y δF by each coefficient: y² x^k for f, y x^k for g; shape (terms, n)."""
    damped = [np.convolve(segment.y, segment.y)[:terms]]
    forced = [segment.y[:terms]]
    for row, count in ((damped, len(flow.damping)), (forced, len(flow.force))):
        while len(row) < count:
            row.append(np.convolve(row[-1], segment.x)[:terms])
    found = np.zeros((terms, len(damped) + len(forced)))
    for column, series in enumerate((*damped, *forced)):
        found[: series.size, column] = series
    return found


def swept(segments: Sequence[Segment], wedges: Sequence[FloatArray], limits: tuple[float, float]) -> FloatArray:
    """Return ∫ D dt along the part of a curve between the limits, in the curve's direction; shape (n,)."""
    total = np.zeros(wedges[0].shape[1])
    for segment, wedge in zip(segments, wedges, strict=True):
        for start, end in segment.within(limits):
            half = 0.5 * (end - start)
            parameter = start + half * (NODES + 1.0)
            weights = half * WEIGHTS
            if segment.graph:
                weights = weights / series_at(segment.y, parameter)  # dt = du / h; D vanishes with h at the saddle
            total += weights @ series_at(wedge, parameter)
    return total
