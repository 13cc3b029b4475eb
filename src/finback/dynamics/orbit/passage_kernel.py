"""Machine code of half a turn that may be stiff: Taylor series, and along an attracting slow manifold its graph.

Where the damping f is large, an orbit that it attracts runs along y = h(x), h h' = f h + g (the slow manifold; Fenichel
1979). Its asymptotic series h = −g/f + h h'/f, iterated, is as exact as double precision where f changes slowly, and
then takes the place of a hundred thousand explicit steps.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.compiled import compiled
from finback.dynamics.orbit.taylor_kernel import ORDER, caught, expand, shift, state_at, time_of

LANDED: Final = 0
INSIDE: Final = 1
OUTSIDE: Final = 2
LOST: Final = 3

_DEPTH: Final = 10  # iterations of the slow manifold's series
_SLOW: Final = 0.05  # h'/f: where it is larger the series is not tried
_CONVERGED: Final = 1e-15
_STIFF: Final = 100.0  # f² over the rate of turning, squared: below it nothing is gained
_ON_GRAPH: Final = 1e-14  # of the unit of length: how far the orbit would still move towards the graph
_NEAR: Final = 0.1  # of g: an orbit farther from the graph of −g/f is not on it
_SHARE: Final = 0.2  # of the length over which f and h change
_FEWEST: Final = 0.01  # of the same: a shorter step along the graph is not worth it
_LONGEST: Final = 100.0  # local units of time
_STALLED: Final = 30  # pieces in a row that move x by nothing: the orbit rests
_TINY: Final = 1e-280  # added to what a logarithm is taken of
_ON_ONE: Final = np.array(np.polynomial.legendre.leggauss(8))
_NODES: Final = 0.5 * (_ON_ONE[0] + 1.0)
_WEIGHTS: Final = 0.5 * _ON_ONE[1]


@compiled
def slow_height(  # noqa: C901 - one recursion, compiled once
    damping: FloatArray, force: FloatArray, x: float, work: FloatArray
) -> float:  # pragma: no cover - machine code
    """Return h(x) of the slow manifold, nan where its series does not come to rounding."""
    f, g, r, h, q = work[0], work[1], work[2], work[3], work[4]
    for k in range(f.size):
        f[k], g[k] = 0.0, 0.0
    shift(damping, x, f)
    shift(force, x, g)
    if f[0] == 0.0 or not abs(f[0] * g[1] - g[0] * f[1]) <= _SLOW * abs(f[0] * f[0] * f[0]):
        return math.nan
    r[0] = 1.0 / f[0]
    for k in range(1, _DEPTH + 1):
        total = 0.0
        for j in range(1, k + 1):
            total += f[j] * r[k - j]
        r[k] = -total * r[0]
    for k in range(_DEPTH + 1):
        total = 0.0
        for j in range(k + 1):
            total -= g[j] * r[k - j]
        h[k] = total
    for used in range(1, _DEPTH + 1):
        for k in range(_DEPTH - used + 1):
            total = -g[k]
            for j in range(k + 1):
                total += h[j] * (k - j + 1) * h[k - j + 1]
            q[k] = total
        before = h[0]
        for k in range(_DEPTH - used + 1):
            total = 0.0
            for j in range(k + 1):
                total += q[j] * r[k - j]
            h[k] = total
        if abs(h[0] - before) <= _CONVERGED * abs(h[0]):
            return float(h[0])
    return math.nan


@compiled
def along_graph(
    damping: FloatArray, force: FloatArray, x: float, heading: float, state: FloatArray, work: FloatArray
) -> bool:  # pragma: no cover - machine code
    """Go a step along the slow manifold from x; add to time (state 3) and ∫f dt (state 4); tell whether it was one."""
    here = slow_height(damping, force, x, work)
    if not abs(state[1] - here) <= _ON_GRAPH * abs(work[0, 0]) or here * heading * state[2] <= 0.0:
        return False
    f, f_slope, g, g_slope = work[0, 0], work[0, 1], work[1, 0], work[1, 1]
    length = math.inf
    if f_slope != 0.0:
        length = abs(f / f_slope)
    bend = abs(g_slope * f - g * f_slope)
    if bend > 0.0:
        length = min(length, abs(g * f) / bend)
    length = min(length, 1.0)
    step = _SHARE * length
    while step > _FEWEST * length:
        there = slow_height(damping, force, x + heading * step, work)
        if there * here > 0.0:
            time, damped = 0.0, 0.0
            for node in range(_NODES.size):
                place = x + heading * step * _NODES[node]
                h = slow_height(damping, force, place, work)
                time += _WEIGHTS[node] / h
                damped += _WEIGHTS[node] * work[0, 0] / h
            if math.isfinite(damped):
                state[0], state[1] = x + heading * step, there
                state[3] += heading * step * time
                state[4] += heading * step * damped
                return True
        step *= 0.5
    return False


@compiled
def passage(  # noqa: C901, PLR0911, PLR0912, PLR0915 - one loop, compiled once
    damping: FloatArray, force: FloatArray, state: FloatArray, limits: FloatArray, rests: FloatArray
) -> int:  # pragma: no cover - machine code
    """Follow an orbit to where it turns, if that is between two places.

    Args:
        damping: f by rising power.
        force: g by rising power; lengths near 1 in units of the coordinate.
        state: in: x, y, 1 forward or -1 backward in time. Out: x, y, the same, time, ∫f dt, the largest growth of a
            deviation across the flow over any stretch (a logarithm), pieces followed, and the largest growth that
            follows a decay at least as large (a canard: no change of the start makes up for rounding there).
        limits: the nearer place, the farther, how far out nothing comes back, most pieces.
        rests: all equilibria.

    Returns:
        ``LANDED`` between the two; ``INSIDE`` if it turns or rests before the nearer, ``OUTSIDE`` if it passes the
        farther; ``LOST`` if it comes nowhere within the pieces allowed.
    """
    x, y, way = state[0], state[1], state[2]
    nearer, farther = limits[0], limits[1]
    highest = max(damping.size, force.size, 2)
    table = np.empty((highest + 2, ORDER + 1))
    work = np.zeros((6, max(ORDER + 1, highest)))
    slow_work = np.zeros((5, max(_DEPTH + 2, highest)))
    scaled_damping, scaled_force = damping.copy(), force.copy()
    first, least, pieces, stalled = 0.0, 0.0, 0, 0
    state[3], state[4], state[5], state[7] = 0.0, 0.0, 0.0, 0.0
    while pieces < limits[3]:
        pieces += 1
        f, f_slope, g, g_slope = 0.0, 0.0, 0.0, 0.0
        for k in range(damping.size - 1, -1, -1):
            f_slope = f_slope * x + f
            f = f * x + damping[k]
        for k in range(force.size - 1, -1, -1):
            g_slope = g_slope * x + g
            g = g * x + force[k]
        # A deviation across the flow, as a share of the energy of the motion: D of Melnikov's wedge over y² + |g|.
        spread = state[4] - math.log(y * y + abs(g) * (1.0 + abs(x)) + _TINY)
        if pieces == 1:
            first, least = spread, spread
        state[5] = max(state[5], spread - least)
        state[7] = max(state[7], min(spread - least, first - least))
        least = min(least, spread)
        side = y if y != 0.0 else way * g
        if side == 0.0:
            state[6] = pieces
            state[0], state[1] = x, y
            return INSIDE
        heading = math.copysign(1.0, way * side)
        turning = abs(g_slope + f_slope * y)
        before = x
        event, followed = False, False
        if way * f < 0.0 and f * f > _STIFF * turning and abs(f * y + g) < max(_NEAR * abs(g), _ON_GRAPH * f * f):
            state[0], state[1] = x, y
            followed = along_graph(damping, force, x, heading, state, slow_work)
        if followed:
            end_x, end_y = state[0], state[1]
        else:
            # Time in units of the local rate, so that no coefficient of the series overflows.
            _, exponent = math.frexp(max(abs(f), math.sqrt(turning), 1e-3))
            rate = math.ldexp(1.0, exponent)
            for k in range(damping.size):
                scaled_damping[k] = damping[k] / rate
            for k in range(force.size):
                scaled_force[k] = force[k] / rate / rate
            table[0, 0], table[1, 0] = x, y / rate
            span = way * min(expand(scaled_damping, scaled_force, table), _LONGEST)
            end_x, end_y = state_at(table, span)
            if span == 0.0 or not (math.isfinite(end_x) and math.isfinite(end_y)):
                state[0], state[1], state[6] = x, y, pieces
                return OUTSIDE if abs(x) > 1.0 and math.isinf(farther) else LOST
            if end_y * side <= 0.0:
                event = True
                span = time_of(table, 1, 0.0, span, 1 if y == 0.0 else 0)
                end_x, end_y = state_at(table, span)
                end_y = 0.0
            total = 0.0
            for k in range(ORDER - 1, -1, -1):
                total = total * span + table[2, k] / (k + 1)
            state[3] += span / rate
            state[4] += total * span
            end_y *= rate
        moved = (end_x - before) * heading
        stalled = 0 if followed or moved > 0.0 else stalled + 1
        rested = stalled > _STALLED
        x, y = end_x, end_y
        state[0], state[1], state[6] = x, y, pieces
        if (x - farther) * heading >= 0.0:
            return OUTSIDE
        if event:
            return LANDED if (x - nearer) * heading > 0.0 else INSIDE
        if x * heading > limits[2]:
            return OUTSIDE
        if rested:
            return INSIDE if (x - nearer) * heading <= 0.0 else OUTSIDE
        ahead = math.inf * heading
        for k in range(rests.size):
            if (rests[k] - x) * heading > 0.0 and (ahead - rests[k]) * heading > 0.0:
                ahead = rests[k]
        if math.isfinite(ahead) and caught(damping, force, work[0], (x, y, way), ahead):
            return INSIDE
    state[6] = pieces
    return LOST
