"""Machine code of an orbit's Taylor series: the recursion, the step, and the events y = 0 and x = section."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.compiled import compiled

ORDER: Final = 24
ON_SECTION: Final = 0
ON_AXIS: Final = 1
AT_REST: Final = 2
ESCAPED: Final = 3
OUT_OF_STEPS: Final = 4

_TOLERANCE: Final = 1e-17  # of the last terms, relative to the state: below rounding, so that it does not accumulate
_ROUNDOFF: Final = 2.0**-52
_FAR: Final = 1e9  # in units of the flow: beyond it an orbit has blown up
_TURN: Final = 2.5  # radians of the local rotation in a step: less than half a turn, so that no crossing is jumped
_STILL: Final = 1e-16  # of the way since y was last 0: an orbit that moves less in a step has come to rest
_ITERATIONS: Final = 200  # more than bisection of a step needs
# Gauss's rule for a piece, whose singularities in time lie some five spans away: an error of 1e-20 with 12 nodes.
_ON_ONE: Final = np.array(np.polynomial.legendre.leggauss(12))
_NODES: Final = 0.5 * (_ON_ONE[0] + 1.0)
_WEIGHTS: Final = 0.5 * _ON_ONE[1]


@compiled
def expand(  # noqa: C901 - one recursion and its step, compiled once
    damping: FloatArray, force: FloatArray, table: FloatArray
) -> float:  # pragma: no cover - machine code
    """Fill ``table`` from its first column: rows x, y, f(x), then x², x³ … (Jorba & Zou 2005, section 2).

    Returns:
        the step after which the last two terms are below the tolerance; 0 where the series is not finite.
    """
    highest = max(damping.size, force.size) - 1
    for k in range(ORDER):
        for power in range(2, highest + 1):
            lower = 0 if power == 2 else power + 1
            total = 0.0
            for m in range(k + 1):
                total += table[lower, m] * table[0, k - m]
            table[power + 2, k] = total
        f = damping[0] if k == 0 else 0.0
        g = force[0] if k == 0 else 0.0
        for power in range(1, highest + 1):
            value = table[0 if power == 1 else power + 2, k]
            if power < damping.size:
                f += damping[power] * value
            if power < force.size:
                g += force[power] * value
        table[2, k] = f
        for m in range(k + 1):
            g += table[2, m] * table[1, k - m]
        table[0, k + 1] = table[1, k] / (k + 1)
        table[1, k + 1] = g / (k + 1)
    # A state at the origin has no size of its own; what a unit of time changes of it, times rounding, bounds it.
    change = _ROUNDOFF * max(abs(table[0, 1]), abs(table[1, 1]))
    small = _TOLERANCE * max(abs(table[0, 0]), abs(table[1, 0]), change)
    span = math.inf
    for k in range(ORDER - 1, ORDER + 1):
        last = max(abs(table[0, k]), abs(table[1, k]))
        if not math.isfinite(last):
            return 0.0
        if last > 0.0:
            span = min(span, (small / last) ** (1.0 / k))
    # y'' = f y' + (f' y + g') y: a swing that is small beside x has a series too good to see that it turns.
    x, y = table[0, 0], table[1, 0]
    f, f_slope, g_slope = 0.0, 0.0, 0.0
    for k in range(damping.size - 1, -1, -1):
        f_slope = f_slope * x + f
        f = f * x + damping[k]
    for k in range(force.size - 1, 0, -1):
        g_slope = g_slope * x + k * force[k]
    rotation = -(g_slope + f_slope * y) - 0.25 * f * f
    return min(span, _TURN / math.sqrt(rotation)) if rotation > 0.0 else span


@compiled
def state_at(table: FloatArray, time: float) -> tuple[float, float]:  # pragma: no cover - machine code
    """Evaluate the rows of x and y."""
    x, y = 0.0, 0.0
    for k in range(ORDER, -1, -1):
        x = x * time + table[0, k]
        y = y * time + table[1, k]
    return x, y


@compiled
def time_of(table: FloatArray, row: int, level: float, span: float, first: int) -> float:  # pragma: no cover
    """Return where a row takes a value between those at 0 and at ``span``: Newton's method within a bracket.

    With ``first`` 1 the level is that of the row divided by time.
    """
    if table[row, first] == level:
        return 0.0
    inside, outside = 0.0, span
    rising = table[row, first] < level
    time = span
    for _ in range(_ITERATIONS):
        value, slope = 0.0, 0.0
        for k in range(ORDER, first - 1, -1):
            slope = slope * time + value
            value = value * time + table[row, k]
        value -= level
        if value == 0.0:
            return time
        if (value > 0.0) == rising:
            outside = time
        else:
            inside = time
        step = -value / slope
        newton = time + step
        if not min(inside, outside) < newton < max(inside, outside):
            if abs(step) <= _ROUNDOFF * abs(span):
                return time
            newton = 0.5 * (inside + outside)
        if newton == time or newton == inside or newton == outside:  # noqa: PLR1714, SIM109 - a tuple compiles slowly
            return newton
        time = newton
    return time


@compiled
def shift(row: FloatArray, x: float, work: FloatArray) -> None:  # pragma: no cover - machine code
    """Fill ``work`` with the coefficients of p(x + u) by rising power of u."""
    for k in range(row.size):
        work[k] = row[k]
    for start in range(row.size - 1):
        for k in range(row.size - 2, start - 1, -1):
            work[k] += x * work[k + 1]


@compiled
def gone(force: FloatArray, work: FloatArray, x: float, heading: float) -> bool:  # pragma: no cover - machine code
    """Tell whether the force pushes outward here and, by its derivatives, everywhere beyond: nothing comes back."""
    shift(force, x, work)
    sign = heading
    for k in range(force.size):
        if work[k] * sign < 0.0:
            return False
        sign = sign if heading > 0.0 else -sign  # to the left it is g(x − u)
    return bool(work[0] != 0.0)


@compiled
def caught(
    damping: FloatArray, force: FloatArray, work: FloatArray, state: tuple[float, float, float], node: float
) -> bool:  # pragma: no cover - machine code
    """Tell whether an orbit (x, y, 1 forward or -1 backward) ends in a node that lies ahead of it.

    Below the line |y| = s |x − node| it stays below if |f| >= s + G/s on the way, where g = G (node − x) > 0 keeps it
    off y = 0; s is half of the least |f|. Least and greatest come from the coefficients at the node.
    """
    x, y, way = state
    distance = abs(node - x)
    shift(damping, node, work)
    least, size = -way * work[0], distance
    for k in range(1, damping.size):
        least -= abs(work[k]) * size
        size *= distance
    shift(force, node, work)
    spread, size = 0.0, distance
    for k in range(2, force.size):
        spread += abs(work[k]) * size
        size *= distance
    steep = least > 0.0 and 4.0 * (spread - work[1]) <= least * least
    return bool(steep and spread < -work[1] and abs(y) <= 0.5 * least * distance)


@compiled
def integrate(
    table: FloatArray, primitive: FloatArray, span: float, state: FloatArray
) -> None:  # pragma: no cover - machine code
    """Add a piece to ∫f dt (state 4) and to ∫ exp(−∫f dt) y² dt (state 5), by Gauss's rule."""
    for k in range(ORDER):
        primitive[k] = table[2, k] / (k + 1)
    total = 0.0
    for node in range(_NODES.size + 1):
        time = span * _NODES[node] if node < _NODES.size else span
        y, damped = table[1, ORDER], 0.0
        for k in range(ORDER - 1, -1, -1):
            y = y * time + table[1, k]
            damped = damped * time + primitive[k]
        damped = state[4] + damped * time
        if node < _NODES.size:
            total += _WEIGHTS[node] * math.exp(-damped) * y * y
        else:
            state[4] = damped
    state[5] += span * total


@compiled
def travel(  # noqa: C901, PLR0912, PLR0915 - one loop, compiled once
    damping: FloatArray,
    force: FloatArray,
    state: FloatArray,
    limits: FloatArray,
    landings: FloatArray,
    record: FloatArray,
) -> int:  # pragma: no cover - machine code
    """Follow an orbit to a section, through crossings of y = 0, to rest, or away.

    Args:
        damping: f by rising power.
        force: g by rising power.
        state: in: x, y, 1 forward or -1 backward in time. Out: x, y, the same, time, ∫f dt, ∫ exp(−∫f dt) y² dt,
            pieces followed.
        limits: section (nan for none), longest step, most pieces, whether the integrals are asked for; then any
            equilibria, by rising x: an orbit that can only end in the next one ahead is at rest.
        landings: the orbit ends at as many crossings of y = 0 as this has places; they are filled.
        record: filled with the series of each piece as far as it has places (rows x, y, f, and the span).

    Returns:
        how it ended.
    """
    x, y, way = state[0], state[1], state[2]
    section, longest = limits[0], limits[1]
    table = np.empty((max(damping.size, force.size, 2) + 2, ORDER + 1))
    work = np.empty(max(ORDER + 1, force.size, damping.size))
    origin, crossed, pieces = x, 0, 0
    ending = OUT_OF_STEPS
    while pieces < limits[2]:
        table[0, 0], table[1, 0] = x, y
        span = way * min(expand(damping, force, table), longest)
        side = y if y != 0.0 else way * table[1, 1]
        if side == 0.0:
            ending = AT_REST
            break
        end_x, end_y = state_at(table, span)
        if span == 0.0 or not (abs(end_x) < _FAR and abs(end_y) < _FAR):
            ending = ESCAPED
            break
        event = OUT_OF_STEPS
        for row in range(1, -1, -1):  # y = 0 first, then whether the section comes before
            level = 0.0 if row == 1 else section
            if (end_y * side if row == 1 else (end_x - section) * (x - section)) <= 0.0:
                event = ON_AXIS if row == 1 else ON_SECTION
                first = 1 if row == 1 and y == 0.0 else 0  # from y = 0 the row of y has one zero at once
                span = time_of(table, row, level, span, first)
                end_x, end_y = state_at(table, span)
        if event == ON_AXIS:
            end_y = 0.0
        elif event == ON_SECTION:
            end_x = section
        if pieces < record.shape[0]:
            record[pieces, 3, 0] = span
            for k in range(3 * (ORDER + 1)):
                record[pieces, k // (ORDER + 1), k % (ORDER + 1)] = table[k // (ORDER + 1), k % (ORDER + 1)]
        pieces += 1
        state[3] += span
        if limits[3] > 0.0:
            integrate(table, work, span, state)
        heading = math.copysign(1.0, way * side)
        moved = (end_x - x) * heading
        # Only rounding moves an orbit backward.
        still = moved < 0.0 or (moved <= _STILL * abs(end_x - origin) and abs(end_y) <= abs(y))
        x, y = end_x, end_y
        if event == ON_SECTION:
            ending = ON_SECTION
            break
        if event == ON_AXIS:
            landings[crossed] = origin = x
            crossed += 1
            if crossed == landings.size:
                ending = ON_AXIS
                break
            continue
        ahead = math.inf * heading
        for k in range(4, limits.size):
            if (limits[k] - x) * heading > 0.0 and (ahead - limits[k]) * heading > 0.0:
                ahead = limits[k]
        straight = math.isfinite(ahead) and not (section - x) * (section - ahead) <= 0.0
        if still or (straight and caught(damping, force, work, (x, y, way), ahead)):
            ending = AT_REST
            break
        if not (section - x) * heading > 0.0 and gone(force, work, x, heading):
            ending = ESCAPED
            break
    state[0], state[1], state[6] = x, y, pieces
    return ending
