"""What differs from flight to flight and is of no interest: biases and a delay, each with what is known of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import InputError

NAMES: Final = ("alpha bias", "q bias", "elevator bias", "elevator delay")
UNITS: Final = ("rad", "rad_s", "rad", "s")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Nuisances:
    """Which of them are estimated for each flight: the standard deviation that is expected of them beforehand.

    0 says that there is none: it is not estimated. ``inf`` says that nothing is known: then a bias that no data can
    tell from the model's coefficients (all flights alike) is refused.

    Attributes:
        alpha_bias_rad: of what alpha reads too much, in rad.
        q_bias_rad_s: of what q reads too much, in rad/s.
        elevator_bias_rad: of what the elevator reads too much, in rad.
        elevator_delay_s: of how much later than recorded the elevator acts, compared with alpha and q, in s.
    """

    alpha_bias_rad: float = 0.0
    q_bias_rad_s: float = 0.0
    elevator_bias_rad: float = 0.0
    elevator_delay_s: float = 0.0

    def __post_init__(self) -> None:
        """Check every value."""
        for name, value in zip(self.__slots__, self.deviations.tolist(), strict=True):
            if not value >= 0.0 or math.isnan(value):
                raise InputError(f"{name} is {value}, expected a standard deviation >= 0")

    @property
    def names(self) -> tuple[str, ...]:
        """What each is called."""
        return NAMES

    @property
    def deviations(self) -> FloatArray:
        """All four, shape (4,)."""
        return np.array([self.alpha_bias_rad, self.q_bias_rad_s, self.elevator_bias_rad, self.elevator_delay_s])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlightNuisances:
    """What was found of one stretch's biases and delay, each with its standard error; 0 where it was not estimated.

    Attributes:
        flight: the record's name.
        start_s: time of the stretch's first sample, in s.
        alpha_bias_rad: what alpha reads too much, in rad.
        alpha_bias_error_rad: its standard error.
        q_bias_rad_s: what q reads too much, in rad/s.
        q_bias_error_rad_s: its standard error.
        elevator_bias_rad: what the elevator reads too much, in rad.
        elevator_bias_error_rad: its standard error.
        elevator_delay_s: how much later than recorded the elevator acts, in s.
        elevator_delay_error_s: its standard error.
    """

    flight: str
    start_s: float
    alpha_bias_rad: float
    alpha_bias_error_rad: float
    q_bias_rad_s: float
    q_bias_error_rad_s: float
    elevator_bias_rad: float
    elevator_bias_error_rad: float
    elevator_delay_s: float
    elevator_delay_error_s: float


def flight_nuisances(flight: str, start_s: float, values: FloatArray, errors: FloatArray) -> FlightNuisances:
    """Name the four values of one stretch and their errors, each of shape (4,)."""
    return FlightNuisances(
        flight=flight,
        start_s=start_s,
        alpha_bias_rad=float(values[0]),
        alpha_bias_error_rad=float(errors[0]),
        q_bias_rad_s=float(values[1]),
        q_bias_error_rad_s=float(errors[1]),
        elevator_bias_rad=float(values[2]),
        elevator_bias_error_rad=float(errors[2]),
        elevator_delay_s=float(values[3]),
        elevator_delay_error_s=float(errors[3]),
    )
