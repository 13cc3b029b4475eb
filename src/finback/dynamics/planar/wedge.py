"""How orbits of a planar field move with the parameter and with θ: integrals along the orbit itself.

With f = (P, Q), the wedge D = P δy − Q δx of the velocity and a displacement obeys D' = (div f) D + f ∧ δf (Melnikov
1963; Guckenheimer & Holmes 1983, section 4.5). It forgets displacements along the orbit, which change nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.planar.carried import COUNT, TO_LEGENDRE, carried, radau_nodes
from finback.dynamics.planar.orbit import PlanarOrbit
from finback.dynamics.planar.setting import PlanarSetting
from finback.dynamics.planar.system import PlanarScale, PlanarSystem


def pushes(system: PlanarSystem, parameter: float, scale: PlanarScale, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return what the parameter and θ do to the velocity at states, shape (2, ..., 1 + p), in units of ``scale``.

    The last axis: by the parameter (in its own unit) first, then by each of θ.
    """
    values = (x * scale.first, y * scale.second, parameter)
    name = system.variables[2]
    rows = []
    for curve, unit in ((system.first, scale.first), (system.second, scale.second)):
        by_parameter = curve.polynomial.derivative(name)(*values)
        rows.append(
            np.concatenate([by_parameter[..., np.newaxis], curve.gradient(*values)], axis=-1) * scale.time / unit
        )
    return np.array(rows)


@final
@dataclass(frozen=True, slots=True, eq=False)
class CycleShift:
    """How a cycle moves; the last axis is by the parameter, then by each of θ, in the units of the setting.

    Attributes:
        setting: the field.
        orbit: the cycle, once around.
        wedge: D at 20 Radau points of each piece, shape (n, 20, 1 + p).
        period: shape (1 + p,).
        log_multiplier: shape (1 + p,).
    """

    setting: PlanarSetting
    orbit: PlanarOrbit
    wedge: FloatArray
    period: FloatArray
    log_multiplier: FloatArray

    def of_extreme(self, place: tuple[int, float, float], state: int) -> FloatArray:
        """Return how an extreme of a state moves, shape (1 + p,): there its rate is zero, so that D is all of it."""
        piece, time, _ = place
        wedge = self.at(piece, time)
        x, y = (float(np.polynomial.polynomial.polyval(time, row)) for row in self.orbit.series[piece, :2])
        p, q = self.setting.field.flow.velocity(x, y)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(-wedge / q if state == 0 else wedge / p)

    def at(self, piece: int, time: float) -> FloatArray:
        """Return D at a time since a piece began, shape (1 + p,)."""
        share = 2.0 * time / float(self.orbit.spans[piece]) - 1.0
        row: FloatArray = np.polynomial.legendre.legvander(share, COUNT - 1)[0] @ TO_LEGENDRE @ self.wedge[piece]
        return row


def cycle_shift(setting: PlanarSetting, orbit: PlanarOrbit) -> CycleShift:
    """Find how a cycle moves with the parameter and θ.

    D is the periodic solution of D' = (div f) D + f ∧ δf. With a displacement a f + D n, where n = (−Q, P)/|f|², time
    along the orbit runs ahead by a: a' = [f·(J + Jᵀ) n D + f·δf] / |f|², so the period changes by −∫a' dt, and ∫ div dt
    by ∫ (D n·∇div − a' div + δ div) dt.
    """
    system, scale, field = setting.system, setting.scale, setting.field
    weight, x, y, spread = radau_nodes(orbit)
    p, q = field.velocity(x, y)
    pushed = pushes(system, setting.parameter, scale, x, y)
    source = p[..., np.newaxis] * pushed[1] - q[..., np.newaxis] * pushed[0]
    with np.errstate(all="ignore"):  # where neighbors are closed, too, nothing is finite
        wedge = carried(orbit.spans, spread, source, np.zeros(source.shape[2]), float(orbit.growth()[-1]))
        (px, py), (qx, qy), slopes, divergence, pushed_divergence = _slopes(setting, x, y)
        speed = p * p + q * q
        normal = (-q / speed, p / speed)
        shear = p * (2.0 * px * normal[0] + (py + qx) * normal[1]) + q * ((py + qx) * normal[0] + 2.0 * qy * normal[1])
        along = p[..., np.newaxis] * pushed[0] + q[..., np.newaxis] * pushed[1]
        ahead = (shear[..., np.newaxis] * wedge + along) / speed[..., np.newaxis]
        bent = (slopes[0] * normal[0] + slopes[1] * normal[1])[..., np.newaxis] * wedge
        changed = bent - ahead * divergence[..., np.newaxis] + pushed_divergence
        sign = math.copysign(1.0, orbit.duration)
        return CycleShift(
            setting,
            orbit,
            wedge,
            -sign * np.einsum("nj,njk->k", weight, ahead),
            sign * np.einsum("nj,njk->k", weight, changed),
        )


def _slopes(
    setting: PlanarSetting, x: FloatArray, y: FloatArray
) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray], FloatArray, FloatArray, FloatArray]:
    """Return J by rows, ∇ div, div, and how the parameter and θ push div, in the units of the setting."""
    system, scale = setting.system, setting.scale
    one, two, three = system.variables
    values = (x * scale.first, y * scale.second, setting.parameter)
    units = (scale.first, scale.second)
    rows = [
        [
            curve.polynomial.derivative(name)(*values) * scale.time * step / unit
            for name, step in zip((one, two), units, strict=True)
        ]
        for curve, unit in zip((system.first, system.second), units, strict=True)
    ]
    spread = [system.first.derivative(one), system.second.derivative(two)]
    slopes = [
        sum(curve.polynomial.derivative(name)(*values) for curve in spread) * scale.time * unit
        for name, unit in zip((one, two), units, strict=True)
    ]
    divergence = sum(curve(*values) for curve in spread) * scale.time
    by_parameter = sum(curve.polynomial.derivative(three)(*values) for curve in spread)
    by_theta = sum(curve.gradient(*values) for curve in spread)
    pushed = np.concatenate([np.asarray(by_parameter)[..., np.newaxis], by_theta], axis=-1) * scale.time
    return (rows[0][0], rows[0][1]), (rows[1][0], rows[1][1]), np.array(slopes), np.asarray(divergence), pushed
