"""Machine code that follows an orbit of a planar polynomial field where an explicit series crawls: by collocation.

Along a strongly attracting curve a Taylor series must take steps as short as the attraction is fast, however little
happens. A polynomial that solves the equation at Radau points (Hairer & Wanner, Solving Ordinary Differential Equations
II, 2nd ed. 1996, section IV.5) may take steps as long as the orbit itself is smooth.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.special import roots_jacobi

from finback.arrays import FloatArray, IntArray
from finback.dynamics.compiled import compiled
from finback.dynamics.planar.kernel import CROSSED, FAR, GOING

DEGREE: Final = 12
_UNKNOWNS: Final = 2 * DEGREE
_RESOLVED: Final = 1e-12  # of either state: the last Legendre coefficients of a piece
_SMALLER: Final = 1e-8  # of the greater state: as small as the other is taken to be
_NEWTON: Final = 14
_STILL: Final = 1e-8  # of either state: a correction after which one more leaves rounding only
_MOST_TRIES: Final = 60  # of one piece
_GROWING: Final = 4.0  # of ∫ divergence over a piece: beyond, an implicit rule stays on what repels
_FIRST: Final = 1e-2  # units of time
_LONGEST: Final = 1e8  # units of time: its powers are still numbers


def _tables() -> FloatArray:
    """Return three tables below each other, shape (3, n, n), all for [0, 1].

    What takes values at 0 and the Radau points to derivatives there; Legendre coefficients to those by rising power,
    which are integers; values to Legendre coefficients.
    """
    inner = 0.5 * (roots_jacobi(DEGREE - 1, 1.0, 0.0)[0] + 1.0)
    nodes = 2.0 * np.concatenate([[0.0], inner, [1.0]]) - 1.0
    legendre = np.linalg.inv(np.polynomial.legendre.legvander(nodes, DEGREE))
    slopes = np.polynomial.legendre.legder(np.eye(DEGREE + 1))
    rates = 2.0 * np.polynomial.legendre.legval(nodes, slopes).T @ legendre
    order = range(DEGREE + 1)
    powers = [[(-1.0) ** (k + n) * math.comb(n, k) * math.comb(n + k, k) for n in order] for k in order]
    return np.array([rates, powers, legendre])


TABLES: Final = _tables()


@compiled
def trace_stiff(  # noqa: PLR0913, PLR0917, C901, PLR0912, PLR0915 - one loop, which compiles faster than its parts
    factors: IntArray,
    weights: FloatArray,
    tables: FloatArray,
    state: FloatArray,
    heading: float,
    line: FloatArray,
    traps: FloatArray,
    far: float,
    pieces: FloatArray,
    spans: FloatArray,
    used: int,
) -> tuple[int, int]:  # pragma: no cover - machine code
    """Do as ``trace`` does, with pieces of degree 12 that solve the equation at Radau points.

    Args:
        factors: of ``PlanarField``.
        weights: of ``PlanarField``.
        tables: ``TABLES``.
        state: as for ``trace``.
        heading: as for ``trace``.
        line: as for ``trace``.
        traps: as for ``trace``.
        far: as for ``trace``.
        pieces: as for ``trace``.
        spans: as for ``trace``.
        used: where to begin to fill; the span before that, if there is one, is a first guess of the next.

    Returns:
        as ``trace``; where no step is short enough the orbit counts as far.
    """
    products, count = factors.shape[0], DEGREE + 1
    values = np.empty(products + 2)
    slopes = np.empty((products + 2, 2))
    nodes = np.empty((3, count))
    jacobians = np.empty((count, 2, 2))
    rates = np.empty((2, count))
    sizes = np.empty(2)
    legendre = np.empty(count)
    matrix = np.empty((_UNKNOWNS, _UNKNOWNS + 1))
    before = line[3]
    span = spans[used - 1] if used > 0 else _FIRST * heading
    for piece in range(used, spans.shape[0]):
        done = False
        for _ in range(_MOST_TRIES):
            size = max(abs(state[0]), abs(state[1]))
            for i in range(count):
                nodes[0, i], nodes[1, i] = state[0], state[1]
            last, solved, polish, growing = math.inf, False, False, 0.0
            for _ in range(_NEWTON):
                growing = 0.0
                for i in range(count):
                    values[0], values[1] = nodes[0, i], nodes[1, i]
                    slopes[0, 0], slopes[0, 1], slopes[1, 0], slopes[1, 1] = 1.0, 0.0, 0.0, 1.0
                    for m in range(products):
                        one, two = factors[m, 0], factors[m, 1]
                        values[m + 2] = values[one] * values[two]
                        for k in range(2):
                            slopes[m + 2, k] = slopes[one, k] * values[two] + values[one] * slopes[two, k]
                    for row in range(3):
                        total = weights[row, 0]
                        by_x, by_y = 0.0, 0.0
                        for m in range(products + 2):
                            weight = weights[row, m + 1]
                            total += weight * values[m]
                            by_x += weight * slopes[m, 0]
                            by_y += weight * slopes[m, 1]
                        if row < 2:
                            rates[row, i] = total
                            jacobians[i, row, 0], jacobians[i, row, 1] = by_x, by_y
                        else:
                            nodes[2, i] = total
                    growing = max(growing, span * nodes[2, i])
                for i in range(DEGREE):
                    for row in range(2):
                        for j in range(_UNKNOWNS):
                            matrix[2 * i + row, j] = 0.0
                        total = 0.0
                        for j in range(count):
                            total += tables[0, i + 1, j] * (nodes[row, j] - state[row])
                        matrix[2 * i + row, _UNKNOWNS] = span * rates[row, i + 1] - total
                        for j in range(DEGREE):
                            matrix[2 * i + row, 2 * j + row] = tables[0, i + 1, j + 1]
                        for k in range(2):
                            matrix[2 * i + row, 2 * i + k] -= span * jacobians[i + 1, row, k]
                for j in range(_UNKNOWNS):  # elimination with partial pivoting
                    best = j
                    for i in range(j + 1, _UNKNOWNS):
                        if abs(matrix[i, j]) > abs(matrix[best, j]):
                            best = i
                    if best != j:
                        for k in range(j, _UNKNOWNS + 1):
                            matrix[j, k], matrix[best, k] = matrix[best, k], matrix[j, k]
                    for i in range(j + 1, _UNKNOWNS):
                        factor = matrix[i, j] / matrix[j, j]
                        if factor != 0.0:
                            for k in range(j + 1, _UNKNOWNS + 1):
                                matrix[i, k] -= factor * matrix[j, k]
                for j in range(_UNKNOWNS - 1, -1, -1):
                    total = matrix[j, _UNKNOWNS]
                    for k in range(j + 1, _UNKNOWNS):
                        total -= matrix[j, k] * matrix[k, _UNKNOWNS]
                    matrix[j, _UNKNOWNS] = total / matrix[j, j]
                sizes[0], sizes[1] = abs(state[0]), abs(state[1])
                for i in range(DEGREE):
                    for row in range(2):
                        nodes[row, i + 1] += matrix[2 * i + row, _UNKNOWNS]
                        sizes[row] = max(sizes[row], abs(nodes[row, i + 1]))
                sizes[0], sizes[1] = max(sizes[0], _SMALLER * sizes[1]), max(sizes[1], _SMALLER * sizes[0])
                change = 0.0
                for j in range(_UNKNOWNS):
                    change = max(change, abs(matrix[j, _UNKNOWNS]) / sizes[j % 2])
                if not max(sizes[0], sizes[1]) < 1e3 * (far + size):
                    break
                if polish:
                    solved = True
                    break
                polish = change <= _STILL
                if change > 2.0 * last:
                    break
                last = change
            error = math.inf
            if solved:
                error = 0.0
                for row in range(2):
                    for k in range(DEGREE - 1, count):
                        total = 0.0
                        for j in range(count):
                            total += tables[2, k, j] * (nodes[row, j] - state[row])
                        error = max(error, abs(total) / (_RESOLVED * sizes[row]))
            if error <= 1.0 and growing <= _GROWING:
                done = True
                break
            if growing > _GROWING and error <= 1.0:
                span *= 0.5 * _GROWING / growing
            else:
                span *= 0.25 if not solved else max(0.2, 0.9 * error ** (-1.0 / (DEGREE - 1)))
        if not done:
            return FAR, piece
        spans[piece] = span
        for row in range(3):
            origin = state[row] if row < 2 else nodes[2, 0]
            for k in range(count):  # by way of Legendre coefficients: at once, rounding would be a billion times that
                total = 0.0
                for j in range(count):
                    total += tables[2, k, j] * (nodes[row, j] - origin)
                legendre[k] = total
            power = 1.0
            for k in range(pieces.shape[2]):
                total = 0.0
                if k < count:
                    for j in range(k, count):
                        total += tables[1, k, j] * legendre[j]
                pieces[piece, row, k] = total * power
                power /= span
            pieces[piece, row, 0] = origin
        crossed = False
        x, y = state[0], state[1]
        for part in range(5):
            time = spans[piece] * part / 4.0
            x, y = 0.0, 0.0
            for k in range(DEGREE, -1, -1):
                x, y = x * time + pieces[piece, 0, k], y * time + pieces[piece, 1, k]
            side = line[0] * x + line[1] * y + line[2]
            if part == 0 and before != 0.0:
                continue
            crossed = crossed or before * side < 0.0
            if side != 0.0:
                before = side
        state[0], state[1] = x, y
        span *= min(2.0, 0.9 * max(1e-6, error) ** (-1.0 / (DEGREE - 1)))
        span = heading * min(abs(span), _LONGEST)
        if not (abs(x) < far and abs(y) < far):
            return FAR, piece + 1
        for m in range(traps.shape[0]):
            u, v = x - traps[m, 0], y - traps[m, 1]
            if traps[m, 2] * u * u + 2.0 * traps[m, 3] * u * v + traps[m, 4] * v * v < 1.0:
                return m, piece + 1
        if crossed:
            return CROSSED, piece + 1
    return GOING, spans.shape[0]
