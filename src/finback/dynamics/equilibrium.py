"""Equilibria of a Liénard system at a held elevator: where they are, of what kind, how well known."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.roots import RealRoot, real_roots, sign_across


class Kind(StrEnum):
    """What an equilibrium is, by the eigenvalues of its linearization."""

    STABLE_FOCUS = "stable-focus"
    STABLE_NODE = "stable-node"
    UNSTABLE_FOCUS = "unstable-focus"
    UNSTABLE_NODE = "unstable-node"
    SADDLE = "saddle"
    DEGENERATE = "degenerate"
    """an eigenvalue on the imaginary axis, as far as double precision can tell"""

    @property
    def stable(self) -> bool:
        """Whether both eigenvalues have negative real parts."""
        return self in (Kind.STABLE_FOCUS, Kind.STABLE_NODE)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Equilibrium:
    """One equilibrium.

    Attributes:
        elevator_rad: the elevator, held.
        alpha_rad: the angle.
        q_rad_s: the pitch rate (dα/dt = 0, which is not q = 0).
        eigenvalues_real_1_s: real parts, shape (2,), the larger first.
        eigenvalues_imag_1_s: imaginary parts, shape (2,), the positive first.
        kind: by the eigenvalues.
        alpha_interval_rad: 95 % interval by the delta method, shape (2,); infinite at a degenerate equilibrium,
            where the angle moves as a square root.
        bracket_rad: the nearest angles on either side at which the sign of g + c₁ δ is beyond rounding, shape (2,);
            the signs differ, but where it only touches zero.
        residual: g(alpha) + c₁ δ in rad/s², as evaluated.
        in_domain: whether the angle lies where data supported the model.
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    eigenvalues_real_1_s: FloatArray
    eigenvalues_imag_1_s: FloatArray
    kind: Kind
    alpha_interval_rad: FloatArray
    bracket_rad: FloatArray
    residual: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("eigenvalues_real_1_s", "eigenvalues_imag_1_s", "alpha_interval_rad", "bracket_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def equilibria(system: LienardSystem, elevator_rad: float) -> tuple[Equilibrium, ...]:
    """Return all equilibria at a held elevator, ordered by angle.

    Raises:
        RefusedError: force and elevator vanish together: every angle is an equilibrium.
    """
    effect = system.elevator_gain * elevator_rad
    coefficients = system.force.ascending.copy()
    magnitudes = np.abs(coefficients)
    coefficients[0] += effect
    magnitudes[0] += abs(effect)
    roots = real_roots(coefficients.tolist(), magnitudes=magnitudes.tolist())
    return tuple(_equilibrium(system, elevator_rad, root) for root in roots)


def _equilibrium(system: LienardSystem, elevator_rad: float, root: RealRoot) -> Equilibrium:
    alpha = root.value
    slope = system.force.derivative("alpha_rad")
    trace, determinant = float(system.damping(alpha)), -float(slope(alpha))
    real, imaginary = eigenvalues(trace, determinant)
    trace_sign = sign_across(system.damping.ascending.tolist(), root.bracket)
    determinant_sign = -sign_across(slope.ascending.tolist(), root.bracket) if root.resolved else 0
    gradient = system.force.gradient(alpha) + system.elevator_gain_sensitivity * elevator_rad
    shift = system.root_shift(gradient, -determinant if determinant_sign else 0.0)
    return Equilibrium(
        elevator_rad=elevator_rad,
        alpha_rad=alpha,
        q_rad_s=float(system.pitch_rate(alpha, elevator_rad)),
        eigenvalues_real_1_s=frozen_array(real),
        eigenvalues_imag_1_s=frozen_array(imaginary),
        kind=kind_of(trace if trace_sign else 0.0, determinant if determinant_sign else 0.0),
        alpha_interval_rad=system.interval(alpha, shift),
        bracket_rad=frozen_array(root.bracket),
        residual=float(system.force(alpha)) + system.elevator_gain * elevator_rad,
        in_domain=bool(system.supports(alpha)),
    )


def eigenvalues(trace: float, determinant: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the real and the imaginary parts of both eigenvalues, the larger (or the positive) first.

    The smaller of two real ones comes from the product of both, not from a difference that cancels.
    """
    discriminant = 0.25 * trace * trace - determinant
    if discriminant < 0.0:
        frequency = math.sqrt(-discriminant)
        return (0.5 * trace, 0.5 * trace), (frequency, -frequency)
    far = 0.5 * trace + math.copysign(math.sqrt(discriminant), trace)
    near = determinant / far if far else 0.0
    return (max(far, near), min(far, near)), (0.0, 0.0)


def kind_of(trace: float, determinant: float) -> Kind:
    """Classify a planar equilibrium by the trace and determinant of its Jacobian; give 0 for a sign not known."""
    if determinant < 0.0:
        return Kind.SADDLE
    if determinant == 0.0 or trace == 0.0:
        return Kind.DEGENERATE
    focus = 0.25 * trace * trace < determinant
    if trace < 0.0:
        return Kind.STABLE_FOCUS if focus else Kind.STABLE_NODE
    return Kind.UNSTABLE_FOCUS if focus else Kind.UNSTABLE_NODE
