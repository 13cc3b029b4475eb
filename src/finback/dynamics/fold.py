"""Folds: where two equilibria meet and vanish as the elevator moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.lienard import LienardSystem
from finback.dynamics.linearity import intervals, moving
from finback.dynamics.roots import RealRoot, real_roots


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """A saddle-node of equilibria: g'(alpha) = 0 with a change of sign.

    Attributes:
        elevator_rad: elevator at the fold.
        alpha_rad: angle at the fold.
        q_rad_s: pitch rate at the fold.
        elevator_interval_rad: 95 % interval by the delta method, shape (2,); infinite where the fold is not linear in
            the coefficients as far as their errors reach (``linearity``): its elevator is then not determined.
        alpha_interval_rad: the same for the angle.
        q_interval_rad_s: the same for the pitch rate.
        bracket_rad: two angles between which g' changes its sign beyond rounding, shape (2,).
        residual: g'(alpha) in 1/s², as evaluated.
        divergence_1_s: f(alpha), the other eigenvalue; the fold is of a sink where it is negative.
        in_domain: whether the angle lies where data supported the model; if not, the fold is extrapolated.
    """

    elevator_rad: float
    alpha_rad: float
    q_rad_s: float
    elevator_interval_rad: FloatArray
    alpha_interval_rad: FloatArray
    q_interval_rad_s: FloatArray
    bracket_rad: FloatArray
    residual: float
    divergence_1_s: float
    in_domain: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("elevator_interval_rad", "alpha_interval_rad", "q_interval_rad_s", "bracket_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


@np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what is not finite has an infinite interval
def folds(system: LienardSystem) -> tuple[Fold, ...]:
    """Return all folds, ordered by angle; none where the force does not depend on the elevator.

    An angle where g' touches zero without changing its sign is no fold: no equilibrium is lost there.
    """
    slope = system.force.derivative("alpha_rad")
    if system.elevator_gain == 0.0 or not slope.ascending.any():
        return ()
    return tuple(_fold(system, root) for root in real_roots(slope.ascending.tolist()) if root.crossing)


def _fold(system: LienardSystem, root: RealRoot) -> Fold:
    alpha = root.value
    slope = system.force.derivative("alpha_rad")
    curvature = float(slope.derivative("alpha_rad")(alpha)) if root.resolved else 0.0
    elevator = float(system.holding_elevator(alpha))
    alpha_gradient = system.root_shift(slope.gradient(alpha), curvature)
    # g' = 0: to first order the shift of the angle does not move the elevator of the fold.
    elevator_gradient = system.holding_elevator_gradient(alpha)
    along = (system.pitch_rate.derivative(name) for name in ("alpha_rad", "elevator_rad"))
    by_alpha, by_elevator = (float(curve(alpha, elevator)) for curve in along)
    q = float(system.pitch_rate(alpha, elevator))
    q_gradient = (
        system.pitch_rate.gradient(alpha, elevator) + by_alpha * alpha_gradient + by_elevator * elevator_gradient
    )
    places = (elevator, alpha, q)
    stated = intervals(
        system,
        np.array(places),
        np.stack([elevator_gradient, alpha_gradient, q_gradient]),
        moving(system, lambda moved: _again(moved, alpha, curvature)),
    )
    return Fold(
        elevator_rad=elevator,
        alpha_rad=alpha,
        q_rad_s=q,
        elevator_interval_rad=stated[0],
        alpha_interval_rad=stated[1],
        q_interval_rad_s=stated[2],
        bracket_rad=frozen_array(root.bracket),
        residual=float(slope(alpha)),
        divergence_1_s=float(system.damping(alpha)),
        in_domain=bool(system.supports(alpha)),
    )


def _again(system: LienardSystem, near_rad: float, curvature: float) -> FloatArray:
    """Return elevator, alpha and q of the fold nearest to an angle that bends the same way; nan if there is none."""
    slope = system.force.derivative("alpha_rad")
    bend = slope.derivative("alpha_rad")
    if system.elevator_gain == 0.0 or not slope.ascending.any():
        return np.full(3, np.nan)
    found = [root.value for root in real_roots(slope.ascending.tolist()) if root.crossing and root.resolved]
    alike = [alpha for alpha in found if float(bend(alpha)) * curvature > 0.0]
    if not alike:
        return np.full(3, np.nan)
    alpha = min(alike, key=lambda angle: abs(angle - near_rad))
    elevator = float(system.holding_elevator(alpha))
    return np.array([elevator, alpha, float(system.pitch_rate(alpha, elevator))])
