"""Folds of the simulator itself, flown: by holding the elevator, and by slow ramps.

Nothing here knows a model. Where a fold lies and on which side its stable branch, is read from the simulator's own
equilibria; then it is flown, because a fold that only an equation solver saw has not been seen by an aircraft.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, frozen_array


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class HoldFold:
    """A fold found by hold bisection.

    The elevator approaches a value exponentially from the stable side and is held there; whether the aircraft jumps
    decides the next value. Close beyond the fold the jump takes longer than any hold, so the result errs outward.

    Attributes:
        table_elevator_rad: the elevator of the fold of the simulator's own equilibrium curve.
        table_alpha_rad: its alpha, which defines the jump.
        outward: +1 if the branch ends when the elevator rises past the fold, -1 when it falls.
        elevator_rad: the middle of the bracket.
        bracket_rad: lowest and highest elevator between which the fold was found.
        uncertainty_rad: 95 % uncertainty: the width of the bracket, since the search errs outward.
        flights: number of flights that the search took.
    """

    table_elevator_rad: float
    table_alpha_rad: float
    outward: int
    elevator_rad: float
    bracket_rad: tuple[float, float]
    uncertainty_rad: float
    flights: int


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RampFold:
    """A fold extrapolated from slow elevator ramps to rate zero, with a + b·rate^(2/3) + c·rate.

    The 2/3 is the delay of a slow passage through a saddle-node (Jung, Gray, Roy & Mandel 1990, PRL 65, 1873), the
    linear term the inertia of the aircraft and the time from the fold to the margin.

    Attributes:
        table_elevator_rad: the elevator of the fold of the simulator's own equilibrium curve.
        table_alpha_rad: its alpha.
        outward: +1 if the elevator rises on the ramps, -1 if it falls.
        alpha_crossing_rad: the alpha whose crossing counts as the jump: the fold's with the margin.
        rates_rad_s: rates of the ramps that jumped, > 0, shape (n,), increasing.
        crossing_elevator_rad: the elevator at the crossing, shape (n,).
        elevator_rad: extrapolated to rate zero: a.
        uncertainty_rad: 95 % uncertainty of it; infinite if too few ramps jumped.
        coefficients: a, b, c in SI, shape (3,).
        residual_rad: root mean square of the fit, with n − 3 degrees of freedom.
    """

    table_elevator_rad: float
    table_alpha_rad: float
    outward: int
    alpha_crossing_rad: float
    rates_rad_s: FloatArray
    crossing_elevator_rad: FloatArray
    elevator_rad: float
    uncertainty_rad: float
    coefficients: FloatArray
    residual_rad: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("rates_rad_s", "crossing_elevator_rad", "coefficients"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))

    def elevator_at(self, rate_rad_s: ArrayLike) -> FloatArray:
        """Return the fitted elevator at the crossing for ``rate_rad_s`` >= 0 (any shape), in rad."""
        return ramp_terms(np.asarray(rate_rad_s, dtype=np.float64)) @ self.coefficients


def ramp_terms(rate_rad_s: FloatArray) -> FloatArray:
    """Return 1, rate^(2/3), rate: shape (..., 3)."""
    return np.stack([np.ones_like(rate_rad_s), np.cbrt(rate_rad_s) ** 2, rate_rad_s], axis=-1)
