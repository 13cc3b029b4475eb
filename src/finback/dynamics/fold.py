"""Folds: where two equilibria meet and vanish as the elevator moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from finback.arrays import FloatArray, frozen_array


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """A saddle-node of equilibria: g′(alpha) = 0 with a change of sign.

    Attributes:
        elevator_rad: elevator at the fold.
        alpha_rad: angle at the fold.
        q_rad_s: pitch rate at the fold.
        elevator_interval_rad: 95 % interval by the delta method, shape (2,).
        alpha_interval_rad: the same for the angle.
        q_interval_rad_s: the same for the pitch rate.
        bracket_rad: two angles between which g′ changes its sign beyond rounding, shape (2,).
        residual: g′(alpha) in 1/s², as evaluated.
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
