"""The curve of equilibria, followed by angle, and where the trace vanishes on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.roots import RealRoot, real_roots, sign_across


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    """All equilibria between two angles, by rising angle; arrays of equal length n.

    The elevator enters linearly, so the elevator that holds an angle is exact: δ = −g(alpha)/c₁. Empty where the
    elevator has no effect.

    Attributes:
        alpha_rad: the angle, rising.
        elevator_rad: the elevator that holds it.
        q_rad_s: pitch rate.
        divergence_1_s: trace of the Jacobian, f(alpha): the paper's a0 as a function of the elevator (Eq. 38).
        determinant_1_s2: determinant of the Jacobian, −g'(alpha).
        stable: both eigenvalues have negative real parts.
        in_domain: the angle lies where data supported the model.
    """

    alpha_rad: FloatArray
    elevator_rad: FloatArray
    q_rad_s: FloatArray
    divergence_1_s: FloatArray
    determinant_1_s2: FloatArray
    stable: NDArray[np.bool_]
    in_domain: NDArray[np.bool_]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("alpha_rad", "elevator_rad", "q_rad_s", "divergence_1_s", "determinant_1_s2"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        for name in ("stable", "in_domain"):
            flags = np.array(getattr(self, name), dtype=np.bool_)
            flags.setflags(write=False)
            object.__setattr__(self, name, flags)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TraceZero:
    """An equilibrium where the trace changes its sign: a Hopf point if the determinant is positive there.

    With a negative determinant it is a saddle whose eigenvalues are opposite: no bifurcation of equilibria.

    Attributes:
        elevator_rad: elevator there.
        alpha_rad: angle.
        q_rad_s: pitch rate.
        determinant_1_s2: determinant of the Jacobian; the square of the frequency at a Hopf point; 0 where rounding
            hides its sign (a fold lies here too: a Bogdanov-Takens point).
        elevator_interval_rad: 95 % interval by the delta method, shape (2,).
        alpha_interval_rad: the same for the angle.
        bracket_rad: two angles between which f changes its sign beyond rounding, shape (2,).
        residual: f(alpha) in 1/s, as evaluated.
        in_domain: whether the angle lies where data supported the model.
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    determinant_1_s2: float
    elevator_interval_rad: FloatArray
    alpha_interval_rad: FloatArray
    bracket_rad: FloatArray
    residual: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_interval_rad", "alpha_interval_rad", "bracket_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))

    @property
    def hopf(self) -> bool:
        """Whether a pair of eigenvalues crosses the imaginary axis here."""
        return self.determinant_1_s2 > 0.0


def branch(system: LienardSystem, alpha_rad: FloatArray) -> Branch:
    """Return the equilibria at these rising angles, shape (n,); none where the elevator has no effect."""
    alpha = np.asarray(alpha_rad, dtype=np.float64)[: None if system.elevator_gain else 0]
    elevator = system.holding_elevator(alpha) if alpha.size else alpha
    trace = system.damping(alpha)
    determinant = -system.force.derivative("alpha_rad")(alpha)
    return Branch(
        alpha_rad=alpha,
        elevator_rad=elevator,
        q_rad_s=system.pitch_rate(alpha, elevator),
        divergence_1_s=trace,
        determinant_1_s2=determinant,
        stable=(trace < 0.0) & (determinant > 0.0),
        in_domain=system.supports(alpha),
    )


def trace_zeros(system: LienardSystem) -> tuple[TraceZero, ...]:
    """Return all equilibria where the trace changes its sign, ordered by angle.

    None where the elevator has no effect, and none where the damping is zero everywhere (a conservative system).
    """
    if system.elevator_gain == 0.0 or not system.damping.ascending.any():
        return ()
    return tuple(_trace_zero(system, root) for root in real_roots(system.damping.ascending.tolist()) if root.crossing)


def _trace_zero(system: LienardSystem, root: RealRoot) -> TraceZero:
    alpha = root.value
    elevator = float(system.holding_elevator(alpha))
    slope = float(system.damping.derivative("alpha_rad")(alpha)) if root.resolved else 0.0
    force_slopes = system.force.derivative("alpha_rad")
    force_slope = float(force_slopes(alpha))
    alpha_gradient = system.root_shift(system.damping.gradient(alpha), slope)
    elevator_gradient = system.holding_elevator_gradient(alpha) - force_slope / system.elevator_gain * alpha_gradient
    return TraceZero(
        elevator_rad=elevator,
        alpha_rad=alpha,
        q_rad_s=float(system.pitch_rate(alpha, elevator)),
        determinant_1_s2=-force_slope if sign_across(force_slopes.ascending.tolist(), root.bracket) else 0.0,
        elevator_interval_rad=system.interval(elevator, elevator_gradient),
        alpha_interval_rad=system.interval(alpha, alpha_gradient),
        bracket_rad=frozen_array(root.bracket),
        residual=float(system.damping(alpha)),
        in_domain=bool(system.supports(alpha)),
    )
