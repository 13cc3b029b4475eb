"""What a validation flies and which tolerances it applies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

from finback.errors import InputError
from finback.flight.excitation import Maneuver
from finback.validation.metric import Tolerance

MINIMUM_RATES: Final = 4
"""Rates that an extrapolation with three coefficients needs at least, so that a residual is left."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FoldOptions:
    """How the simulator's folds are flown.

    Attributes:
        ramp_rates_rad_s: rates of the slow elevator ramps, > 0, at least four different ones.
        margin_rad: how far alpha must pass the fold's alpha for a jump, > 0.
        start_offset_rad: elevator distance from the fold at which a search starts, at equilibrium, > 0.
        hold_s: how long the elevator is held after its approach in a hold bisection, > 0.
        approach_s: time constant of the exponential approach to the held elevator, > 0; long against the aircraft's
            short period, else the aircraft swings over the fold before the elevator has come to rest.
        resolution_rad: width of the elevator bracket at which a hold bisection ends, > 0.
    """

    ramp_rates_rad_s: tuple[float, ...]
    margin_rad: float
    start_offset_rad: float
    hold_s: float
    approach_s: float
    resolution_rad: float

    def __post_init__(self) -> None:
        """Check that all is positive and the rates suffice."""
        object.__setattr__(self, "ramp_rates_rad_s", tuple(self.ramp_rates_rad_s))
        if len(set(self.ramp_rates_rad_s)) < MINIMUM_RATES:
            raise InputError(
                f"ramp_rates: {len(set(self.ramp_rates_rad_s))} different rates, expected at least {MINIMUM_RATES}",
                hint="the extrapolation to zero rate has three coefficients and needs a residual",
            )
        positive = {
            "margin": self.margin_rad,
            "start_offset": self.start_offset_rad,
            "hold": self.hold_s,
            "approach": self.approach_s,
            "resolution": self.resolution_rad,
            **{f"ramp_rates[{i}]": rate for i, rate in enumerate(self.ramp_rates_rad_s)},
        }
        for name, value in positive.items():
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{name} must be finite and > 0, got {value}")
        if self.resolution_rad >= self.start_offset_rad:
            raise InputError("resolution must be smaller than start_offset")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """How large each kind of error may be.

    Attributes:
        alpha_rmse: root mean square error of alpha over a hold-out flight, rad.
        q_rmse: the same of the pitch rate, rad/s.
        theil: Theil's inequality coefficient of either.
        fold_elevator: elevator of a fold found by hold bisection, rad.
        ramp_fold_elevator: elevator of a fold extrapolated from ramps, rad.
        equilibrium_alpha: alpha of an equilibrium, rad.
    """

    alpha_rmse: Tolerance
    q_rmse: Tolerance
    theil: Tolerance
    fold_elevator: Tolerance
    ramp_fold_elevator: Tolerance
    equilibrium_alpha: Tolerance


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationOptions:
    """What a validation does.

    Attributes:
        holdout: maneuvers to predict; none of them may be among the flights of the sweep.
        equilibrium_elevators_rad: elevators at which all equilibria are compared.
        fold: how the simulator's folds are flown.
        tolerances: what is allowed.
        seed: of the coefficient samples from which the uncertainty of a prediction is taken.
    """

    holdout: tuple[Maneuver, ...]
    equilibrium_elevators_rad: tuple[float, ...]
    fold: FoldOptions
    tolerances: Tolerances
    seed: int
