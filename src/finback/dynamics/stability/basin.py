"""The stability region of one sink of a flow: which curves bound it, its area, the nearest point of its boundary."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.optimize import brentq

from finback.arrays import FloatArray
from finback.dynamics.cycle.flow_cycle import flow_cycles
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest, derivative, horner, shifted
from finback.dynamics.orbit.half_turn import half_turn
from finback.dynamics.orbit.manifold import manifold
from finback.dynamics.orbit.taylor import pieces
from finback.dynamics.roots import real_roots
from finback.dynamics.stability.boundary_curve import (
    CurveEnd,
    CycleCurve,
    Segment,
    StableBranch,
    cycle_curve,
    enclosing_cycle,
    integrals,
    series_at,
    stable_branch,
    turning,
)
from finback.dynamics.stability.boundary_motion import branch_wedges, cycle_wedges, swept
from finback.dynamics.stability.capture import captures
from finback.errors import RefusedError

_FAR: Final = 1e6  # units of the flow
_SHORT: Final = 0.5  # of the way to the next equilibrium: as far as the series of an unstable branch is used
_SAMPLES: Final = 8  # of a segment, to see where the nearest point may lie
_ON_LINE: Final = 1e-13  # of the distance of the limits: a segment that ends on one by rounding
_MOST_TURNS: Final = 2000
_SETTLED: Final = 1e-9  # relative: windings so near to each other have come to a cycle
_APART: Final = 1e-5  # relative: windings that are clearly two
_WINDING: Final = 1e-6  # of the greatest x: a branch that winds so little nearer has come to a stable cycle


@final
@dataclass(frozen=True, slots=True, eq=False)
class Basin:
    """The stability region of a sink.

    Attributes:
        sink: the sink.
        branches: both stable branches of every saddle with an unstable branch that runs into the sink.
        entering: those saddles' branches that do: for each saddle the sides (-1, 1) on which it is left.
        cycles: unstable limit cycles that bound the region.
        enclosed: whether the region is inside the first of the cycles.
        wedges: how each curve, in the order of ``curves``, moves with the coefficients (see ``boundary_motion``).
    """

    sink: Rest
    branches: tuple[StableBranch, ...]
    entering: tuple[tuple[Rest, tuple[int, ...]], ...]
    cycles: tuple[CycleCurve, ...]
    enclosed: bool
    wedges: tuple[tuple[FloatArray, ...], ...]

    def cycle_of(self, branch: StableBranch) -> int:
        """Return the number of the cycle onto which a branch winds, -1 if it ends elsewhere."""
        if branch.ending is not CurveEnd.CYCLE:
            return -1
        return min(range(len(self.cycles)), key=lambda k: abs(self.cycles[k].x_max - branch.turns[-1]))

    @property
    def curves(self) -> tuple[StableBranch | CycleCurve, ...]:
        """All curves of the boundary."""
        return (*self.branches, *self.cycles)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The point of a boundary that is nearest to the sink, distances in y divided by the frequency.

    Attributes:
        distance: the distance.
        x: the point.
        y: the point.
        by: derivative of the distance by the coefficients of f, then of g.
        frequency: √(−g') at the sink.
    """

    distance: float
    x: float
    y: float
    by: FloatArray
    frequency: float


def basin(flow: Flow, points: tuple[Rest, ...], sink: Rest, reach: float, inner: float) -> Basin:
    """Find what bounds the stability region of a sink.

    A saddle is on the boundary, with both its stable branches, exactly if one of its unstable branches runs into the
    sink (Chiang, Hirsch & Wu, IEEE Trans. Automatic Control 33, 1988). Where there is none, an unstable cycle around
    the sink bounds the region, or the region is the whole plane.

    Args:
        flow: the flow.
        points: all its equilibria.
        sink: one of them.
        reach: |x| up to which the boundary is followed.
        inner: |x| up to which it is wanted where it winds outward without end.

    Raises:
        RefusedError: an orbit cannot be followed to its end; or nothing was found that bounds the region, and the
            damping is not such that it must be the whole plane.
    """
    saddles = [point for point in points if point.kind is Kind.SADDLE]
    entering = []
    for saddle in saddles:
        sides = tuple(side for side in (-1, 1) if destination(flow, saddle, side, points) is sink)
        if sides:
            entering.append((saddle, sides))
    if not entering:
        around = sorted(cycle.x_max for cycle in flow_cycles(flow).cycles if cycle.enclosed == (sink.x,))
        if not around and not _one_sign(flow):  # else no orbit is closed (Bendixson)
            around = list(_unwound(flow, sink, points))
        cycles = [cycle_curve(flow, x_max) for x_max in around[:1]]
        if not cycles and not (len(points) == 1 and _dissipative(flow)):
            raise RefusedError("no saddle and no cycle was found that bounds the stability region")
        moved = tuple(cycle_wedges(flow, cycle) for cycle in cycles)
        return Basin(sink, (), (), tuple(cycles), bool(cycles), moved)
    branches = [stable_branch(flow, saddle, side, points, reach, inner) for saddle, _ in entering for side in (-1, 1)]
    ends = [branch.turns[-1] for branch in branches if branch.ending is CurveEnd.CYCLE]
    # The one around the sink first.
    cycles = sorted(
        _distinct([enclosing_cycle(flow, turn) for turn in ends]),
        key=lambda cycle: not cycle.x_min < sink.x < cycle.x_max,
    )
    enclosed = bool(cycles) and cycles[0].x_min < sink.x < cycles[0].x_max
    wedges = [*(branch_wedges(flow, branch) for branch in branches), *(cycle_wedges(flow, one) for one in cycles)]
    return Basin(sink, tuple(branches), tuple(entering), tuple(cycles), enclosed, tuple(wedges))


def _unwound(flow: Flow, sink: Rest, points: Sequence[Rest]) -> Iterator[float]:
    """Yield the greatest x of the cycle from which the orbits around a sink come, if they come from one.

    Backward in time the windings of one orbit fill all that lies within the innermost cycle; an orbit that leaves for
    good shows that there is none.
    """
    x = next(trap for trap in captures(flow, points, forward=True) if trap.sink == sink.x).right
    for _ in range(_MOST_TURNS):
        start = x
        for _ in range(2):
            found = half_turn(flow, x, forward=False)
            if not found.landed:
                return
            x = found.x
        if abs(x - sink.x) > _FAR or any(min(start, x) < point.x < max(start, x) for point in points):
            return
        if abs(x - start) <= _SETTLED * abs(x - sink.x):
            yield enclosing_cycle(flow, x).x_max
            return
    raise RefusedError("orbits come from around the sink too slowly to see from where")


def _distinct(cycles: list[CycleCurve]) -> list[CycleCurve]:
    found: list[CycleCurve] = []
    for cycle in cycles:
        if all(abs(cycle.x_max - other.x_max) > _WINDING * abs(cycle.x_max - cycle.x_min) for other in found):
            found.append(cycle)
    return found


def _one_sign(flow: Flow) -> bool:
    """Tell whether the damping changes its sign nowhere."""
    return any(flow.damping) and not any(root.crossing for root in real_roots(list(flow.damping)))


def _dissipative(flow: Flow) -> bool:
    """Tell whether all orbits are bounded forward: damping and force both hold back far out (Liénard's conditions)."""
    f, g = (np.trim_zeros(np.array(row), "b") for row in (flow.damping, flow.force))
    return bool(f.size % 2 == 1 and f[-1] < 0.0 and g.size % 2 == 0 and g[-1] < 0.0)


def destination(flow: Flow, saddle: Rest, side: int, points: tuple[Rest, ...]) -> Rest | None:
    """Return the sink into which an unstable branch of a saddle runs; None if it leaves for good or comes to a cycle.

    Raises:
        RefusedError: it does none of these within the steps allowed.
    """
    whole = manifold(flow, saddle, stable=False)
    beyond = [abs(point.x - saddle.x) for point in points if (point.x - saddle.x) * side > 0.0]
    reach = side * min([whole.radius, *(_SHORT * distance for distance in beyond)])
    traps = captures(flow, points, forward=True)
    sinks = [point for point in points if point.kind.stable]
    x, y = saddle.x + reach, horner(whole.series, reach)
    turn = math.nan
    for piece in pieces(flow, (x, y), forward=True):
        before = y
        x, y = piece.at(piece.span)
        for sink, trap in zip(sinks, traps, strict=True):
            if trap.depth(x, y) < 1.0:
                return sink
        # Beyond an outermost saddle, or below it where it can only move on outward, nothing comes back.
        if (points[-1].kind is Kind.SADDLE and x > points[-1].x and y > 0.0) or (
            points[0].kind is Kind.SADDLE and x < points[0].x and y < 0.0
        ):
            return None
        if before > 0.0 >= y:
            last, turn = turn, turning(piece)[1]
            if abs(turn - last) < _WINDING * abs(turn - saddle.x) and _circles(flow, turn, points):
                return None
    if max(abs(x), abs(y)) > _FAR:
        return None  # it blew up
    raise RefusedError("an unstable manifold comes neither to a sink nor away from it within the steps allowed")


def _circles(flow: Flow, turn: float, points: Sequence[Rest]) -> bool:
    """Tell whether an orbit that turns here has come to a cycle, away from equilibria."""
    try:
        cycle = enclosing_cycle(flow, turn)
    except (RefusedError, ArithmeticError):
        return False
    size = cycle.x_max - cycle.x_min
    settled = abs(cycle.x_max - turn) < math.sqrt(_WINDING) * size and cycle.multiplier < 1.0
    return settled and all(abs(point.x - cycle.x_max) > math.sqrt(_WINDING) * size for point in points)


def area(flow: Flow, found: Basin, limits: tuple[float, float]) -> tuple[float, FloatArray]:
    """Return the area of a region between two limits of x, and its derivative by the coefficients.

    By Green's theorem it is ∫ y dx along its boundary, to which the cuts at constant x, and cuts along y = 0, add
    nothing. A saddle that both its unstable branches leave for the sink bounds the region from both sides: its stable
    manifold is a slit. Two branches that wind onto one cycle are cut on y = 0 where they are neighbors.

    Returns:
        the area, infinite if the region is unbounded between the limits; the derivative, shape (n,), the columns as
        the coefficients of f and g; nan where the area is infinite.
    """
    shares = [
        (math.fsum(integrals(curve.segments, limits)), swept(curve.segments, wedges, limits))
        for curve, wedges in zip(found.curves, found.wedges, strict=True)
    ]
    rings = shares[len(found.branches) :]
    total, by = 0.0, np.zeros(len(flow.damping) + len(flow.force))
    once: set[int] = set()  # cycles that bound the region by themselves
    for saddle, sides in found.entering:
        pair = [k for k, branch in enumerate(found.branches) if branch.saddle is saddle]
        rounds = [found.cycle_of(found.branches[k]) for k in pair]
        if len(sides) == 2:
            once |= {number for number in rounds if number >= 0}
            continue
        for k in pair:
            sign = -sides[0] * found.branches[k].side
            total, by = total + sign * shares[k][0], by + sign * shares[k][1]
        if rounds[0] == rounds[1] >= 0:
            outward, other = pair[:: sides[0]][1], pair[:: sides[0]][0]
            # Each winding of the other branch too many has added the cycle's area, with the sign of that branch.
            extra = _too_many(found.branches[outward].turns, found.branches[other].turns)
            ring = rings[rounds[0]]
            total, by = total + extra * ring[0], by + extra * ring[1]
    if not found.branches:
        once |= set(range(len(found.cycles)))
    for number in once:
        sign = 1 if found.enclosed and number == 0 else -1
        total, by = total + sign * rings[number][0], by + sign * rings[number][1]
    # Strips between windings without end cross any range of x without end.
    winds = any(
        branch.ending is CurveEnd.WINDS
        for saddle, sides in found.entering
        for branch in found.branches
        if branch.saddle is saddle and len(sides) == 1
    )
    if found.enclosed or (total > 0.0 and not winds and _bounded(found, limits)):
        return total, by
    return math.inf, np.full(by.shape, math.nan)


def _too_many(outward: Sequence[float], other: Sequence[float]) -> int:
    """Return how many windings more than the outward branch the other has made, cut where the region is between them.

    The region lies on the left of the branch that is followed outward, which moves up where it turns at the greater x:
    at smaller x. There the other's next turn is its neighbor.
    """
    steps = np.abs(np.diff(outward))
    clear = int(np.flatnonzero(steps > _APART * abs(outward[-1]))[-1]) if steps.size else 0
    neighbor = max((x, k) for k, x in enumerate(other) if x < outward[clear])[1]
    return (len(other) - neighbor) - (len(outward) - clear)


def crossings(found: Basin, limits: tuple[float, float]) -> tuple[list[tuple[float, bool]], list[tuple[float, bool]]]:
    """Return where the boundary crosses the lines at both limits.

    Returns:
        for each line the y of the crossings, rising, and whether the region lies above (its lower border is there).
    """
    lines: tuple[list[tuple[float, bool]], list[tuple[float, bool]]] = ([], [])
    for saddle, sides in found.entering:
        for branch in found.branches:
            if branch.saddle is not saddle or len(sides) == 2:
                continue
            for line, y, outward in _cuts(branch, limits):
                # With the region on its left, the boundary runs outward at a lower border on the right.
                along = outward == (branch.side * sides[0] > 0)
                lines[line].append((y, along == (line == 1)))
    return sorted(lines[0]), sorted(lines[1])


def _cuts(branch: StableBranch, limits: tuple[float, float]) -> Iterator[tuple[int, float, bool]]:
    """Yield where a branch crosses the limits: which one, y, and whether outward from the saddle or back in."""
    for segment in branch.segments:
        for start, end in segment.within(limits):
            for parameter, outward in ((start, False), (end, True)):
                x, y = (float(value) for value in segment.at(parameter))
                distances = [abs(x - limit) for limit in limits]
                line = int(distances[1] < distances[0])
                if parameter not in (0.0, segment.span) or distances[line] <= _ON_LINE * (limits[1] - limits[0]):
                    yield line, y, outward


def _bounded(found: Basin, limits: tuple[float, float]) -> bool:
    """Tell whether a region that no cycle encloses is bounded between the limits.

    Along a line of constant x its lower and upper borders alternate; the lowest must be a lower border.
    """
    lines = crossings(found, limits)
    return all([lower for _, lower in line] == [True, False] * (len(line) // 2) for line in lines)


def nearest(flow: Flow, found: Basin) -> Nearest:
    """Return the point of the boundary nearest to the sink, with y divided by the sink's frequency √(−g')."""
    n_f, n_g = len(flow.damping), len(flow.force)
    slopes = shifted(flow.force, found.sink.x)
    frequency = math.sqrt(-slopes[1])
    if not found.curves:
        return Nearest(math.inf, math.nan, math.nan, np.full(n_f + n_g, math.nan), frequency)
    best, owner, segment, parameter = _closest(found, frequency)
    x, y = (float(value) for value in segment.at(parameter))
    series = next(wedges for curve, wedges in zip(found.curves, found.wedges, strict=True) if curve is owner)
    index = next(k for k, other in enumerate(owner.segments) if other is segment)
    wedge = series_at(series[index], parameter)
    # The distance changes by what the boundary moves along its gradient, which stands across the boundary, less what
    # the sink moves, and by the change of the frequency.
    by_x, by_y = (x - found.sink.x) / best, y / (frequency * frequency * best)
    push = flow.acceleration(x, y)
    across = by_y / y if abs(by_y * push) > abs(by_x * y) or push == 0.0 else -by_x / push
    powers = found.sink.x ** np.arange(max(n_f, n_g, 2))
    moved = np.zeros(n_f + n_g)
    moved[n_f:] = -powers[:n_g] / slopes[1]
    stiffer = np.zeros(n_f + n_g)
    stiffer[n_f:] = -np.arange(n_g) * np.concatenate([[0.0], powers[: n_g - 1]])
    if len(slopes) > 2:
        stiffer -= 2.0 * slopes[2] * moved
    by = across * wedge - by_x * moved - y * y / (2.0 * frequency**4 * best) * stiffer
    return Nearest(best, x, y, by, frequency)


def _closest(found: Basin, frequency: float) -> tuple[float, StableBranch | CycleCurve, Segment, float]:
    """Return the least distance of a boundary, on which curve and segment it is, and where."""
    sampled = []
    for curve in found.curves:
        for segment in curve.segments:
            steps = np.linspace(0.0, segment.span, _SAMPLES + 1)
            xs, ys = segment.at(steps)
            distance = np.hypot(xs - found.sink.x, ys / frequency)
            # Between two samples the curve is hardly longer than its chord, so no nearer by more than that.
            least = np.minimum(distance[:-1], distance[1:]) - np.hypot(np.diff(xs), np.diff(ys) / frequency)
            sampled.append((curve, segment, steps.tolist(), float(distance.min()), least))
    best = min(nearest_sample for *_, nearest_sample, _ in sampled)
    results = []
    for curve, segment, steps, _, least in sampled:
        for k in np.flatnonzero(least <= best).tolist():
            parameter = _foot(segment, (steps[k], steps[k + 1]), found.sink.x, frequency)
            x, y = (float(value) for value in segment.at(parameter))
            results.append((math.hypot(x - found.sink.x, y / frequency), curve, segment, parameter))
    return min(results, key=lambda item: item[0])


def _foot(segment: Segment, ends: tuple[float, float], sink: float, frequency: float) -> float:
    """Return where between two parameters a segment is nearest to the sink, if it comes nearer and goes again."""
    x_row, y_row = segment.x.tolist(), segment.y.tolist()
    slope_x, slope_y = derivative(x_row), derivative(y_row)

    def approach(parameter: float) -> float:
        along_x, along_y = horner(slope_x, parameter), horner(slope_y, parameter)
        return (horner(x_row, parameter) - sink) * along_x + horner(y_row, parameter) * along_y / frequency**2

    low, high = sorted(ends)
    if approach(low) < 0.0 < approach(high):
        return float(brentq(approach, low, high, xtol=1e-300, rtol=1e-15))

    def distance(parameter: float) -> float:
        return math.hypot(horner(x_row, parameter) - sink, horner(y_row, parameter) / frequency)

    return min((low, high), key=distance)
