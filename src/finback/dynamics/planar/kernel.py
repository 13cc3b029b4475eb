"""Machine code that follows an orbit of any planar polynomial field by its Taylor series.

The recursion and the choice of the step are those of Jorba & Zou, "A software package for the numerical integration of
ODEs by means of high-order Taylor methods", Experimental Mathematics 14 (2005), sections 2 and 3.
"""

from __future__ import annotations

import math
from typing import Final

from finback.arrays import FloatArray, IntArray
from finback.dynamics.compiled import compiled

ORDER: Final = 24
PARTS: Final = 4
"""Parts of a piece in which signs are compared: two crossings in one part are not seen."""

CROSSED: Final = -1
FAR: Final = -2
GOING: Final = -3
STIFF: Final = -4

_TOLERANCE: Final = 1e-17  # of the last terms, relative to the state: below rounding, so that it does not accumulate
_ROUNDOFF: Final = 2.0**-52
_STIFFNESS: Final = 30.0  # by how much faster the divergence is than the velocity turns, where a series crawls ...
_CRAWLING: Final = 100  # ... over so many pieces
_LONGEST: Final = 1.0  # where the unit of time is that of the fastest eigenvalue: a sixth of a turn


@compiled
def trace(  # noqa: PLR0913, PLR0917, C901, PLR0912 - one loop, which compiles faster than its parts
    factors: IntArray,
    weights: FloatArray,
    table: FloatArray,
    state: FloatArray,
    heading: float,
    line: FloatArray,
    traps: FloatArray,
    far: float,
    pieces: FloatArray,
    spans: FloatArray,
    used: int,
) -> tuple[int, int]:  # pragma: no cover - machine code
    """Follow an orbit piece by piece until it crosses a line, is trapped, is far, crawls, or the room is used.

    Args:
        factors: of ``PlanarField``.
        weights: of ``PlanarField``.
        table: room to work in, shape (len(factors) + 2, ORDER + 1).
        state: where it begins, shape (2,); changed to where it ends.
        heading: 1.0 forward, -1.0 backward in time.
        line: (a, b, c, side): the line a x + b y + c = 0, and the sign of that where the orbit begins, if it begins
            on the line (else 0); shape (4,). All zero: no line.
        traps: rows (x, y, a, b, c): inside a u² + 2 b u v + c v² < 1 it ends, with (u, v) counted from (x, y).
        far: |x| or |y| beyond which it ends.
        pieces: filled with the series of x, y and the divergence, shape (n, 3, ORDER + 1).
        spans: filled with the duration of each piece, shape (n,).
        used: where to begin to fill.

    Returns:
        how it ended (a number >= 0 is the index of the trap), and up to where the pieces are filled.
    """
    products = factors.shape[0]
    before = line[3]
    crawled = 0
    for piece in range(used, spans.shape[0]):
        table[0, 0], table[1, 0] = state[0], state[1]
        for k in range(ORDER):
            for m in range(products):
                one, two = factors[m, 0], factors[m, 1]
                total = 0.0
                for i in range(k + 1):
                    total += table[one, i] * table[two, k - i]
                table[m + 2, k] = total
            for row in range(3):
                total = weights[row, 0] if k == 0 else 0.0
                for m in range(products + 2):
                    total += weights[row, m + 1] * table[m, k]
                if row < 2:
                    table[row, k + 1] = total / (k + 1)
                else:
                    pieces[piece, 2, k] = total
        pieces[piece, 2, ORDER] = 0.0
        # A state at the origin has no size of its own; what a unit of time changes of it, times rounding, bounds it.
        change = _ROUNDOFF * max(abs(table[0, 1]), abs(table[1, 1]))
        small = _TOLERANCE * max(abs(table[0, 0]), abs(table[1, 0]), change)
        span = _LONGEST
        for k in range(ORDER - 1, ORDER + 1):
            last = max(abs(table[0, k]), abs(table[1, k]))
            if not last < math.inf:
                return FAR, piece
            if last > 0.0:
                span = min(span, (small / last) ** (1.0 / k))
        spans[piece] = span * heading
        for row in range(2):
            for k in range(ORDER + 1):
                pieces[piece, row, k] = table[row, k]
        crossed = False
        for part in range(5):
            time = spans[piece] * part / 4.0
            x, y = 0.0, 0.0
            for k in range(ORDER, -1, -1):
                x, y = x * time + table[0, k], y * time + table[1, k]
            side = line[0] * x + line[1] * y + line[2]
            if part == 0 and before != 0.0:
                continue
            crossed = crossed or before * side < 0.0
            if side != 0.0:
                before = side
        state[0], state[1] = x, y
        if not (abs(x) < far and abs(y) < far):
            return FAR, piece + 1
        for m in range(traps.shape[0]):
            u, v = x - traps[m, 0], y - traps[m, 1]
            if traps[m, 2] * u * u + 2.0 * traps[m, 3] * u * v + traps[m, 4] * v * v < 1.0:
                return m, piece + 1
        if crossed:
            return CROSSED, piece + 1
        moving = max(abs(table[0, 1]), abs(table[1, 1])) * heading * pieces[piece, 2, 0]
        turning = 2.0 * max(abs(table[0, 2]), abs(table[1, 2]))
        crawled = crawled + 1 if -moving > _STIFFNESS * turning else 0
        if crawled == _CRAWLING:
            return STIFF, piece + 1
    return GOING, spans.shape[0]
