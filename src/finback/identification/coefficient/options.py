"""What the user of an identification of coefficients chooses."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import InputError
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.form import CoefficientForm
from finback.identification.coefficient.track import OUTPUTS
from finback.units import quantity_of


@final
class CoefficientMethod(StrEnum):
    """How coefficients are estimated."""

    EQUATION_ERROR = "equation-error"
    """least squares on the equations of motion in weak form: forces from accelerometers where there are some"""
    FREQUENCY = "frequency"
    """the same on finite Fourier transforms of the equations, within a band"""
    OUTPUT_ERROR = "output-error"
    """maximum likelihood of everything that is measured"""
    FILTER_ERROR = "filter-error"
    """the same with a Kalman filter: the air disturbs the motion, as turbulence does"""

    @property
    def of_likelihood(self) -> bool:
        """Whether it is an estimator of maximum likelihood, which can also tell biases."""
        return self in {CoefficientMethod.OUTPUT_ERROR, CoefficientMethod.FILTER_ERROR}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Biases:
    """What is estimated for each stretch beside its start: the standard deviation expected of each beforehand.

    0 says that there is none: it is not estimated. ``inf`` says that nothing is known of it.

    Attributes:
        airspeed_m_s: of what the airspeed reads too much, in m/s.
        alpha_rad: of alpha, in rad.
        theta_rad: of the pitch angle, in rad.
        q_rad_s: of the pitch rate, in rad/s.
        q_dot_rad_s2: of the pitch acceleration, in rad/s².
        ax_m_s2: of the forward specific force, in m/s².
        az_m_s2: of the downward specific force, in m/s².
        elevator_rad: of the elevator, in rad.
        elevator_delay_s: of how much later than recorded the elevator acts, in s.
    """

    airspeed_m_s: float = 0.0
    alpha_rad: float = 0.0
    theta_rad: float = 0.0
    q_rad_s: float = 0.0
    q_dot_rad_s2: float = 0.0
    ax_m_s2: float = 0.0
    az_m_s2: float = 0.0
    elevator_rad: float = 0.0
    elevator_delay_s: float = 0.0

    def __post_init__(self) -> None:
        """Check every value."""
        for name in self.__slots__:
            value = getattr(self, name)
            if not value >= 0.0 or math.isnan(value):
                raise InputError(f"the bias {name} is {value}, expected a standard deviation >= 0")

    def of(self, outputs: tuple[str, ...]) -> ExpectedBiases:
        """Return those of some outputs, then that of the elevator and its delay.

        Raises:
            InputError: a bias is asked for of what is not measured.
        """
        lost = [name for name in OUTPUTS if getattr(self, name) > 0.0 and name not in outputs]
        if lost:
            raise InputError(f"a bias of {', '.join(lost)} cannot be estimated: it is not measured")
        names = (*outputs, "elevator_rad", "elevator_delay_s")
        return ExpectedBiases(
            names=(*(f"{quantity_of(name)} bias" for name in names[:-1]), "elevator delay"),
            deviations=np.array([getattr(self, name) for name in names]),
        )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedBiases:
    """Biases of certain outputs, that of the elevator, and its delay.

    Attributes:
        names: what they are called.
        deviations: expected beforehand, in SI, shape (outputs + 2,).
    """

    names: tuple[str, ...]
    deviations: FloatArray


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlightAirframe:
    """The airframe as one flight had it.

    Attributes:
        flight: the record's name.
        airframe: its mass and inertia, and where its center of gravity was: the reference point stands beside it.
    """

    flight: str
    airframe: Airframe


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CoefficientOptions:
    """What is fitted to what, and how.

    Attributes:
        airframe: mass, geometry, thrust.
        form: the terms of the three coefficients.
        reference_speed_m_s: V₀ of ``speed_ratio_1`` and ``reference_pitch_rate_1``, > 0.
        method: the estimator.
        outputs: which of ``OUTPUTS`` are compared; empty: all that every record holds.
        biases: what is estimated for each stretch, by output error and filter error.
        noise_correlated: whether noise of different outputs may be correlated.
        band_1_s: lowest and highest frequency of the frequency domain, in Hz, > 0.
        half_width_s: half width of the test functions of the weak form in s, > 0.
        spacing_s: time between them in s, > 0 and at most half_width_s.
        minimum_duration_s: shorter stretches of a record are not used, in s, >= 0.
        flights: airframes of flights that flew with another mass, inertia or center of gravity.
    """

    airframe: Airframe
    form: CoefficientForm
    reference_speed_m_s: float
    method: CoefficientMethod = CoefficientMethod.OUTPUT_ERROR
    outputs: tuple[str, ...] = ()
    biases: Biases = field(default_factory=Biases)
    noise_correlated: bool = False
    band_1_s: tuple[float, float] = (0.05, 2.0)
    half_width_s: float = 0.2
    spacing_s: float = 0.05
    minimum_duration_s: float = 1.0
    flights: tuple[FlightAirframe, ...] = ()

    def __post_init__(self) -> None:
        """Check every value."""
        if not 0.0 < self.reference_speed_m_s < math.inf:
            raise InputError(f"reference_speed_m_s is {self.reference_speed_m_s}, expected a speed > 0")
        unknown = [name for name in self.outputs if name not in OUTPUTS]
        if unknown:
            raise InputError(f"{', '.join(unknown)} cannot be compared", hint=f"outputs are {', '.join(OUTPUTS)}")
        if not 0.0 < self.band_1_s[0] < self.band_1_s[1] < math.inf:
            raise InputError(f"band_hz is {self.band_1_s}, expected two frequencies > 0, the lower one first")
        if not 0.0 < self.half_width_s < math.inf or not 0.0 < self.spacing_s <= self.half_width_s:
            raise InputError("half_width_s is > 0, spacing_s is > 0 and at most half_width_s")
        if not 0.0 <= self.minimum_duration_s < math.inf:
            raise InputError(f"minimum_duration_s is {self.minimum_duration_s}, expected a time >= 0")
        names = [one.flight for one in self.flights]
        if len(set(names)) < len(names):
            raise InputError("a flight has two airframes")
        sizes = {(one.airframe.wing_area_m2, one.airframe.chord_m) for one in self.flights}
        if not sizes <= {(self.airframe.wing_area_m2, self.airframe.chord_m)}:
            raise InputError("coefficients are over one wing area and one chord: these are the same for all flights")

    def airframe_of(self, flight: str) -> Airframe:
        """Return the airframe as a flight had it."""
        return next((one.airframe for one in self.flights if one.flight == flight), self.airframe)
