"""Machine code that tells where many states of a planar polynomial field go."""

from __future__ import annotations

from typing import Final

from finback.arrays import FloatArray, IntArray
from finback.dynamics.compiled import compiled

LOST: Final = -1
UNDECIDED: Final = -2
LANES: Final = 64
"""States advanced together, so that the machine's vectors are filled."""

_STEP: Final = 0.25  # over the local rate: what the method leaves of error is 1e-5 a unit of time


@compiled
def settle(  # noqa: PLR0913, PLR0917, C901, PLR0912 - one loop, which compiles faster than its parts
    factors: IntArray,
    weights: FloatArray,
    starts: FloatArray,
    traps: FloatArray,
    far: float,
    most: int,
    room: FloatArray,
    values: FloatArray,
    lanes: IntArray,
    fates: IntArray,
) -> None:  # pragma: no cover - machine code
    """Tell into which trap each state goes, by the classical Runge-Kutta method with a step for the local rate.

    The local rate is at least 1, and at least the sum of all terms in absolute value over the size of the state.

    Args:
        factors: of ``PlanarField``.
        weights: of ``PlanarField``.
        starts: states, shape (n, 2).
        traps: rows of ``planar_capture``.
        far: beyond this |x| or |y| a state is lost.
        most: steps allowed to each.
        room: to work in, shape (7, LANES).
        values: to work in, shape (len(factors) + 2, LANES).
        lanes: to work in: which state is in each lane, and the steps it took; begins as -1; shape (2, LANES).
        fates: filled with indices of traps, ``LOST`` or ``UNDECIDED``, shape (n,).
    """
    total, products = starts.shape[0], factors.shape[0]
    given, done = 0, 0
    while done < total:
        for i in range(LANES):
            if lanes[0, i] >= 0:
                x, y = values[0, i], values[1, i]
                fate = UNDECIDED - 1
                if not (abs(x) < far and abs(y) < far):
                    fate = LOST
                elif lanes[1, i] >= most:
                    fate = UNDECIDED
                for m in range(traps.shape[0]):
                    u, v = x - traps[m, 0], y - traps[m, 1]
                    if traps[m, 2] * u * u + 2.0 * traps[m, 3] * u * v + traps[m, 4] * v * v < 1.0:
                        fate = m
                if fate >= UNDECIDED:
                    fates[lanes[0, i]] = fate
                    lanes[0, i] = -1
                    done += 1
            if lanes[0, i] < 0:
                values[0, i], values[1, i] = 0.0, 0.0
                if given < total:
                    values[0, i], values[1, i] = starts[given, 0], starts[given, 1]
                    lanes[0, i], lanes[1, i] = given, 0
                    given += 1
            room[0, i], room[1, i] = values[0, i], values[1, i]
            lanes[1, i] += 1
        # Rows of ``room``: x, y where the step begins, rates of both, weighted sums of rates, step.
        for stage in range(4):
            for m in range(products):
                one, two = factors[m, 0], factors[m, 1]
                for i in range(LANES):
                    values[m + 2, i] = values[one, i] * values[two, i]
            for row in range(2):
                for i in range(LANES):
                    room[row + 2, i] = weights[row, 0]
                for m in range(products + 2):
                    weight = weights[row, m + 1]
                    for i in range(LANES):
                        room[row + 2, i] += weight * values[m, i]
            if stage == 0:
                for i in range(LANES):
                    size = 0.0
                    for m in range(products + 2):
                        size += (abs(weights[0, m + 1]) + abs(weights[1, m + 1])) * abs(values[m, i])
                    room[6, i] = _STEP / max(1.0, size / (0.1 + abs(room[0, i]) + abs(room[1, i])))
                    room[4, i], room[5, i] = 0.0, 0.0
            weight = 1.0 if stage == 0 or stage == 3 else 2.0  # noqa: PLR1714 - a tuple compiles slowly
            share = 0.5 if stage < 2 else 1.0
            for row in range(2):
                for i in range(LANES):
                    summed = room[row + 4, i] + weight * room[row + 2, i]
                    room[row + 4, i] = summed
                    push = summed / 6.0 if stage == 3 else share * room[row + 2, i]
                    values[row, i] = room[row, i] + room[6, i] * push
