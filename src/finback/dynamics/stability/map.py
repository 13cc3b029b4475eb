"""Which sink each state of a grid reaches: a check of the stability regions that follows no manifold."""

from __future__ import annotations

import math
from itertools import zip_longest
from typing import Final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, IntArray
from finback.dynamics.compiled import compiled
from finback.dynamics.cycle.flow_cycle import flow_cycles
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest, flow_at, natural_scale, rests
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.orbit.half_turn import half_turn
from finback.dynamics.stability.capture import captures
from finback.errors import InputError, RefusedError

ESCAPES: Final = -1
"""The state leaves for good: it is beyond an outermost saddle and moves outward, or it blows up."""
UNDECIDED: Final = -2
"""The state came to no end within the time allowed: it circles, or is on a boundary."""
CIRCLES: Final = -3
"""The state comes to a stable limit cycle."""

_STEP: Final = 0.125  # of the fastest eigenvalue's time; errors of 1e-6 a unit of time, far below a cell
_STIFF: Final = 0.5  # of the inverse of the local rate: the classical method is stable up to 2.7
_LONGEST: Final = 1000.0  # of the fastest eigenvalue's times
_MOST_STEPS: Final = 200_000  # more only where the field is stiff
_FAR: Final = 1e6  # sizes of the system
_RING: Final = 0.05  # of a cycle's width: where an orbit that crosses y = 0 beside it is caught
_TRIES: Final = 6


def stability_map(
    system: LienardSystem, elevator_rad: float, alpha_rad: FloatArray, alpha_dot_rad_s: FloatArray
) -> IntArray:
    """Tell for each state which sink it reaches, by the classical Runge-Kutta method.

    An orbit has arrived when it is inside an ellipse around a sink from which none escapes, or crosses y = 0 beside a
    stable limit cycle where all return nearer to it. It is lost when it is beyond an outermost saddle and moves
    outward, from where none returns. All this is certain but for the error of the integration, which moves a boundary
    by less than any cell.

    Args:
        system: the system.
        elevator_rad: the elevator, held.
        alpha_rad: angles, any shape.
        alpha_dot_rad_s: dα/dt, the same shape.

    Returns:
        the number of the sink, counted by rising angle from 0; ``ESCAPES``, ``CIRCLES`` or ``UNDECIDED`` (negative)
        where there is none; of the given shape.

    Raises:
        RefusedError: no equilibrium is stable.
    """
    alpha, alpha_dot = np.asarray(alpha_rad, dtype=np.float64), np.asarray(alpha_dot_rad_s, dtype=np.float64)
    if alpha.shape != alpha_dot.shape:
        raise InputError(f"angles of shape {alpha.shape} and rates of shape {alpha_dot.shape} are no states")
    scale, _ = natural_scale(system, elevator_rad)
    flow = flow_at(system, elevator_rad, scale)
    points = rests(flow)
    traps = captures(flow, points, forward=True)
    if not traps:
        raise RefusedError("there is no stability region: no equilibrium is stable")
    ellipses = np.array([(t.sink, t.p11 / t.level, 2.0 * t.p12 / t.level, t.p22 / t.level) for t in traps])
    labels = np.empty(alpha.size, dtype=np.int64)
    _label(
        np.array(list(zip_longest(flow.damping, flow.force, fillvalue=0.0)))[::-1].copy(),
        (ellipses, _edges(points), _rings(flow, points)),
        (alpha / scale.length_rad).ravel(),
        (alpha_dot / scale.speed_rad_s).ravel(),
        labels,
    )
    return labels.reshape(alpha.shape)


def _edges(points: tuple[Rest, ...]) -> tuple[float, float]:
    """Return the outermost saddles; infinite on a side where the outermost equilibrium is none."""
    return (
        points[0].x if points[0].kind is Kind.SADDLE else -math.inf,
        points[-1].x if points[-1].kind is Kind.SADDLE else math.inf,
    )


def _rings(flow: Flow, points: tuple[Rest, ...]) -> FloatArray:
    """Return where orbits that cross y = 0 upward end on a stable cycle: intervals of x, shape (n, 2)."""
    try:
        cycles = flow_cycles(flow).cycles
    except RefusedError:
        return np.empty((0, 2))
    found = []
    for cycle in cycles:
        if not cycle.stable:
            continue
        others = [other.x_min for other in cycles if other is not cycle] + [point.x for point in points]
        width = min([_RING * (cycle.x_max - cycle.x_min), *(0.5 * abs(x - cycle.x_min) for x in others)])
        for _ in range(_TRIES):
            ring = (cycle.x_min - width, cycle.x_min + width)
            if all(ring[0] < _returned(flow, x) < ring[1] for x in ring):
                found.append(ring)
                break
            width *= 0.25
    return np.array(found).reshape(-1, 2)


def _returned(flow: Flow, x: float) -> float:
    """Return where an orbit that is at (x, 0) crosses there again; nan if it does not."""
    first = half_turn(flow, x, forward=True)
    second = half_turn(flow, first.x, forward=True) if first.landed else first
    return second.x if second.landed else math.nan


@compiled
def _label(  # noqa: C901 - all ends an orbit can have, in one loop of machine code
    field: FloatArray,
    ends: tuple[FloatArray, tuple[float, float], FloatArray],
    xs: FloatArray,
    ys: FloatArray,
    labels: NDArray[np.int64],
) -> None:  # pragma: no cover - machine code; tested against the manifolds and against another integrator
    ellipses, edges, rings = ends
    for i in range(xs.size):
        x, y = xs[i], ys[i]
        label, time, before = UNDECIDED, 0.0, 0.0
        for _ in range(_MOST_STEPS):
            if (x > edges[1] and y > 0.0) or (x < edges[0] and y < 0.0) or not (abs(x) < _FAR and abs(y) < _FAR * _FAR):
                label = ESCAPES
                break
            for k in range(ellipses.shape[0]):
                u = x - ellipses[k, 0]
                if (ellipses[k, 1] * u + ellipses[k, 2] * y) * u + ellipses[k, 3] * y * y < 1.0:
                    label = k
            if before < 0.0 <= y:
                for k in range(rings.shape[0]):
                    if rings[k, 0] < x < rings[k, 1]:
                        label = CIRCLES
            if label != UNDECIDED or time > _LONGEST:
                break
            h, vx, vy, sx, sy = 0.0, 0.0, 0.0, 0.0, 0.0
            for stage in range(4):
                part = h if stage == 3 else 0.5 * h
                px, py = x + part * vx, y + part * vy
                f, g = 0.0, 0.0
                for k in range(field.shape[0]):
                    f = f * px + field[k, 0]
                    g = g * px + field[k, 1]
                vx, vy = py, f * py + g
                weight = 2.0 if 0 < stage < 3 else 1.0
                sx += weight * vx
                sy += weight * vy
                if stage == 0:  # far out the field is faster than at the equilibria
                    h = min(_STEP, _STIFF / (abs(f) + abs(y) / (1.0 + abs(x)) + math.sqrt(abs(g)) + 1e-300))
            before = y
            time += h
            x += h / 6.0 * sx
            y += h / 6.0 * sy
        labels[i] = label
