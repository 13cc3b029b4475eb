"""Which states of a grid return to the sink: a check of the stability region that follows no manifold."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray
from finback.dynamics.capture import capture
from finback.dynamics.equilibrium import Kind
from finback.dynamics.flow import Flow, Rest, flow_at, natural_scale, only_sink, rests
from finback.dynamics.lienard import LienardSystem
from finback.errors import RefusedError

_STEP: Final = 0.02  # of the fastest eigenvalue's time; errors of 1e-8 a unit of time, far below a cell
_MOST_STEPS: Final = 20_000
_FAR: Final = 1e3  # sizes of the system: where no outer saddle says that an orbit is lost


def stability_map(
    system: LienardSystem, elevator_rad: float, alpha_rad: FloatArray, alpha_dot_rad_s: FloatArray
) -> NDArray[np.bool_]:
    """Tell for each state whether it returns to the only sink, by the classical Runge-Kutta method.

    An orbit has returned when it is inside an ellipse from which none escapes, and is lost when it is beyond an
    outermost saddle and moves outward, from where none returns.

    Args:
        system: the system.
        elevator_rad: the elevator, held.
        alpha_rad: angles, any shape.
        alpha_dot_rad_s: dα/dt, the same shape.

    Raises:
        RefusedError: there is not exactly one equilibrium among saddles, or it is no sink; some orbit neither returned
            nor was lost within the time allowed.
    """
    scale, _ = natural_scale(system, elevator_rad)
    flow = flow_at(system, elevator_rad, scale)
    points = rests(flow)
    trap = capture(flow, only_sink(points))
    x, y = np.asarray(alpha_rad) / scale.length_rad, np.asarray(alpha_dot_rad_s) / scale.speed_rad_s
    returned = np.zeros(x.size, dtype=np.bool_)
    open_, x, y = np.arange(x.size), x.ravel(), y.ravel()
    with np.errstate(over="ignore", invalid="ignore"):  # what is lost may blow up within a step
        for _ in range(_MOST_STEPS):
            caught = np.asarray(trap.depth(x, y)) < 1.0
            returned[open_[caught]] = True
            going = ~caught & ~_lost(points, x, y)
            open_, x, y = open_[going], x[going], y[going]
            if not open_.size:
                return returned.reshape(np.shape(alpha_rad))
            x, y = _advance(flow, x, y)
    raise RefusedError(f"{open_.size} states neither return to the sink nor leave within the time allowed")


def _lost(points: tuple[Rest, ...], x: FloatArray, y: FloatArray) -> NDArray[np.bool_]:
    lost = ~((np.abs(x) < _FAR) & np.isfinite(y))
    if points[-1].kind is Kind.SADDLE:
        lost |= (x > points[-1].x) & (y > 0.0)
    if points[0].kind is Kind.SADDLE:
        lost |= (x < points[0].x) & (y < 0.0)
    result: NDArray[np.bool_] = lost
    return result


def _advance(flow: Flow, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    a1 = _field(flow, x, y)
    a2 = _field(flow, x + 0.5 * _STEP * y, y + 0.5 * _STEP * a1)
    a3 = _field(flow, x + 0.5 * _STEP * (y + 0.5 * _STEP * a1), y + 0.5 * _STEP * a2)
    a4 = _field(flow, x + _STEP * (y + 0.5 * _STEP * a2), y + _STEP * a3)
    return x + _STEP * (y + _STEP / 6.0 * (a1 + a2 + a3)), y + _STEP / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)


def _field(flow: Flow, x: FloatArray, y: FloatArray) -> FloatArray:
    f, g = np.zeros_like(x), np.zeros_like(x)
    for coefficient in reversed(flow.damping):
        f = f * x + coefficient
    for coefficient in reversed(flow.force):
        g = g * x + coefficient
    return f * y + g
