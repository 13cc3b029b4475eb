"""Limit points of a branch of equilibria of any field: where the parameter turns."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.continuation.event import Located
from finback.dynamics.continuation.field import FieldError, ScaledField


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LimitPoint:
    """A fold (saddle-node) of equilibria: two of them meet and vanish as the parameter moves.

    Attributes:
        parameter: where, in the user's unit.
        state: the equilibrium, shape (d,).
        opens: +1 if both equilibria exist at larger parameters, -1 at smaller ones.
        direction: how the state moves along the branch there, shape (d,), of length 1 in typical sizes.
        curvature: half the second derivative of the parameter by the distance along ``direction``; nan at a corner.
        eigenvalues_real: of the linearized field, shape (d,), 1 / time; one is zero up to rounding.
        eigenvalues_imag: imaginary parts, shape (d,).
        corner: the field has a corner here (a table's breakpoint): the parameter turns without being flat.
        bracket_parameter: of the points on either side between which the turn lies, shape (2,).
        bracket_state: their states, shape (2, d).
        residual: largest rate left, in typical rates.
        test: the tangent's component along the parameter, zero at a smooth fold.
    """

    parameter: float
    state: FloatArray
    opens: int
    direction: FloatArray
    curvature: float
    eigenvalues_real: FloatArray
    eigenvalues_imag: FloatArray
    corner: bool
    bracket_parameter: FloatArray
    bracket_state: FloatArray
    residual: float
    test: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("state", "direction", "eigenvalues_real", "eigenvalues_imag"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        for name in ("bracket_parameter", "bracket_state"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def limit_point(scaled: ScaledField, located: Located) -> LimitPoint:
    """Return a located fold in the user's units."""
    d = scaled.states
    point = located.at.point
    sides = np.array([located.before.point.u, located.after.point.u]) * scaled.scale
    x = point.u * scaled.scale
    return LimitPoint(
        parameter=float(x[d]),
        state=x[:d],
        opens=-1 if located.before.along > 0.0 else 1,
        direction=point.tangent[:d] * scaled.scale[:d],
        curvature=math.nan if located.corner else _curvature(scaled, located),
        eigenvalues_real=located.at.eigenvalues.real,
        eigenvalues_imag=located.at.eigenvalues.imag,
        corner=located.corner,
        bracket_parameter=sides[:, d],
        bracket_state=sides[:, :d],
        residual=point.residual,
        test=located.test,
    )


def _curvature(scaled: ScaledField, located: Located) -> float:
    """Return half the parameter's second derivative, from p · (f_xx q q + λ'' f_λ) = 0 (Keller 1977)."""
    d = scaled.states
    point = located.at.point
    left = np.linalg.svd(point.jacobian[:, :d])[0][:, -1]
    direction = np.append(point.tangent[:d], 0.0)
    try:
        bent = scaled.second(point.u, direction)
    except FieldError:
        return math.nan
    push = float(left @ point.jacobian[:, d])
    return -0.5 * float(left @ bent) / push * float(scaled.scale[d]) if push else math.nan
