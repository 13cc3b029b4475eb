"""Elimination of one variable from two polynomials in two variables, without rounding.

Doubles are integers times a power of two, so the resultant (the determinant of Sylvester's matrix) is an integer
polynomial, computed exactly: a coefficient that is zero comes out as zero, and what is left of a cancellation is
right to its last digit. Rounding enters once, when the coefficients become doubles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from finback.arrays import FloatArray

Row = list[int]
"""Integer coefficients of a polynomial in one variable by rising power; the zero polynomial is empty."""


def denominator(table: FloatArray) -> int:
    """Return the smallest power of two that makes every number of a table an integer."""
    return max((float(c).as_integer_ratio()[1] for c in table.flat), default=1)


def integers(table: FloatArray, common: int | None = None) -> list[Row]:
    """Return the columns of a table c[i, j], all times its ``denominator`` (or a multiple); none if all are 0.

    Column j holds the coefficients of yʲ as a polynomial in x, and the last column is not the zero polynomial.
    """
    common = denominator(table) if common is None else common
    ratios = [[float(c).as_integer_ratio() for c in column] for column in table.T]
    columns = [_trimmed([n * (common // d) for n, d in column]) for column in ratios]
    while columns and not columns[-1]:
        columns.pop()
    return columns


def eliminant(first: Sequence[Row], second: Sequence[Row]) -> Row:
    """Return a polynomial in x that vanishes wherever both polynomials in (x, y) vanish.

    It is empty where they have a common factor, or where one of them is zero.

    Args:
        first: column j holds the coefficients of yʲ, as from ``integers``.
        second: the same.
    """
    if not first or not second:
        return []
    short, long = (first, second) if len(first) <= len(second) else (second, first)
    if len(short) == 1:  # without y: its own zeros, each once
        return list(short[0])
    if len(short) == 2:
        return _substituted(short, long)
    degree = (len(long) - 1) * max(map(len, short)) + (len(short) - 1) * max(map(len, long))
    values = [_resultant(_at(short, x), _at(long, x)) for x in range(degree + 1)]
    return _interpolated(values)


def doubles(row: Row) -> list[float]:
    """Return integer coefficients as doubles, each rounded once, all divided by one power of two."""
    shift = 1 << max((abs(c).bit_length() for c in row), default=0)
    return [c / shift for c in row]


def _trimmed(row: Row) -> Row:
    while row and row[-1] == 0:
        row.pop()
    return row


def _product(left: Row, right: Row) -> Row:
    if not left or not right:
        return []
    result = [0] * (len(left) + len(right) - 1)
    for i, a in enumerate(left):
        for j, b in enumerate(right):
            result[i + j] += a * b
    return result


def _sum(left: Row, right: Row) -> Row:
    short, long = sorted((left, right), key=len)
    return _trimmed([c + (short[i] if i < len(short) else 0) for i, c in enumerate(long)])


def _substituted(linear: Sequence[Row], other: Sequence[Row]) -> Row:
    """Insert y = −a/b of a + b y into the other polynomial, times bⁿ, by Horner's scheme."""
    minus, slope = [-c for c in linear[0]], linear[1]
    total: Row = []
    power: Row = [1]
    for column in reversed(other):
        total = _sum(_product(total, minus), _product(column, power))
        power = _product(power, slope)
    return total


def _at(columns: Sequence[Row], x: int) -> Row:
    """Return the coefficients by rising power of y at this x."""
    values = []
    for column in columns:
        total = 0
        for c in reversed(column):
            total = total * x + c
        values.append(total)
    return values


def _resultant(first: Row, second: Row) -> int:
    """Return the determinant of Sylvester's matrix by elimination without fractions (Bareiss 1968)."""
    m, n = len(first) - 1, len(second) - 1
    size = m + n
    matrix = [[0] * k + first[::-1] + [0] * (n - 1 - k) for k in range(n)]
    matrix += [[0] * k + second[::-1] + [0] * (m - 1 - k) for k in range(m)]
    sign, previous = 1, 1
    for step in range(size - 1):
        pivot = next((i for i in range(step, size) if matrix[i][step]), -1)
        if pivot < 0:
            return 0
        if pivot != step:
            matrix[step], matrix[pivot] = matrix[pivot], matrix[step]
            sign = -sign
        lead = matrix[step]
        for i in range(step + 1, size):
            row, factor = matrix[i], matrix[i][step]
            matrix[i] = [0] * (step + 1) + [
                (lead[step] * row[j] - factor * lead[j]) // previous for j in range(step + 1, size)
            ]
        previous = lead[step]
    return sign * matrix[-1][-1]


def _interpolated(values: Row) -> Row:
    """Return the polynomial with these values at 0, 1, …, n (Newton's forward differences)."""
    factor = math.factorial(len(values) - 1)
    differences, falling, total = list(values), [1], list[int]()
    for k in range(len(values)):
        weight = differences[0] * (factor // math.factorial(k))
        total = _sum(total, [c * weight for c in falling])
        falling = _product(falling, [-k, 1])
        differences = [b - a for a, b in pairwise(differences)]
    return [c // factor for c in total]  # integers: the resultant of integer polynomials is one
