"""The curve of equilibria, followed by angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.lienard import LienardSystem


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
