"""Hold-out flights: maneuvers that the fit never saw, flown by the simulator and predicted by the model."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.model import PolynomialModel
from finback.dynamics.trajectory import free_run
from finback.errors import InputError
from finback.records import FlightRecord

_SAMPLES: Final = 200
"""Models drawn from the coefficient covariance: the 0.95 quantile of 200 has a standard error of 0.015 in level."""
_CONFIDENCE: Final = 0.95


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Theil:
    """Theil's inequality coefficient and the split of the mean square error.

    U = RMS(s − p) / (RMS(s) + RMS(p)), from 0 (perfect) to 1. The shares of the mean square error: bias
    (mean s − mean p)², variance (σ_s − σ_p)², covariance 2 (1 − ρ) σ_s σ_p; they sum to 1. Without any error all
    shares are 0; of an infinite error U is 1, its limit, and the shares are NaN.
    Source: Theil 1961, Economic Forecasts and Policy, ch. II; Jategaonkar 2015, Flight Vehicle System Identification.

    Attributes:
        coefficient: U.
        bias: share of a constant offset.
        variance: share of a wrong amplitude.
        covariance: share of everything else; of an error that is only noise, near 1.
    """

    coefficient: float
    bias: float
    variance: float
    covariance: float


def theil(simulated: ArrayLike, predicted: ArrayLike) -> Theil:
    """Return Theil's coefficient of two histories of equal shape (n,), n >= 1, in one unit."""
    s, p = np.asarray(simulated, dtype=np.float64), np.asarray(predicted, dtype=np.float64)
    if s.shape != p.shape or s.ndim != 1 or not s.size:
        raise InputError(f"two histories of equal length are compared, got shapes {s.shape} and {p.shape}")
    size = float(np.abs(np.concatenate([s, p])).max())
    if not math.isfinite(size):
        return Theil(coefficient=1.0, bias=math.nan, variance=math.nan, covariance=math.nan)
    # U and its split do not depend on the unit: scaled so, no square overflows.
    s, p = (s / size, p / size) if size > 0.0 else (s, p)
    error = rms(s - p)
    if error == 0.0:
        return Theil(coefficient=0.0, bias=0.0, variance=0.0, covariance=0.0)
    bias = (float(np.mean(s) - np.mean(p)) / error) ** 2
    variance = (float(np.std(s) - np.std(p)) / error) ** 2
    # 2 (1 − ρ) σ_s σ_p is what remains, exactly; written so, no cancellation and no 0/0 of a constant history.
    centred_s, centred_p = s - np.mean(s), p - np.mean(p)
    covariance = 2.0 * float(np.std(s) * np.std(p) - np.mean(centred_s * centred_p)) / error**2
    return Theil(coefficient=error / (rms(s) + rms(p)), bias=bias, variance=variance, covariance=covariance)


def rms(values: FloatArray) -> float:
    """Return the root mean square; infinite if a value is not finite or its square overflows."""
    size = float(np.abs(values).max())
    if size == 0.0:
        return 0.0
    return size * math.sqrt(float(np.mean((values / size) ** 2))) if math.isfinite(size) else math.inf


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Holdout:
    """One hold-out flight beside its prediction.

    The comparison ends where the simulated flight first leaves the box in which data supported the model.

    Attributes:
        record: the flight, without noise.
        predicted: alpha in rad and q in rad/s at the record's times, shape (n, 2); not finite after a blow-up.
        compared: number of samples, from the first, that are compared.
        alpha_rmse_rad: root mean square error of alpha over them; infinite after a blow-up.
        q_rmse_rad_s: the same of the pitch rate.
        alpha_rmse_u95_rad: 95 % uncertainty of ``alpha_rmse_rad`` from the covariance of the coefficients.
        q_rmse_u95_rad_s: the same of the pitch rate.
        alpha_peak_error_rad: largest |difference| of alpha.
        q_peak_error_rad_s: largest |difference| of the pitch rate.
        alpha_theil: Theil's coefficient of alpha.
        q_theil: Theil's coefficient of the pitch rate.
        alpha_theil_u95: 95 % uncertainty of the coefficient of alpha.
        q_theil_u95: the same of the pitch rate.
    """

    record: FlightRecord
    predicted: FloatArray
    compared: int
    alpha_rmse_rad: float
    q_rmse_rad_s: float
    alpha_rmse_u95_rad: float
    q_rmse_u95_rad_s: float
    alpha_peak_error_rad: float
    q_peak_error_rad_s: float
    alpha_theil: Theil
    q_theil: Theil
    alpha_theil_u95: float
    q_theil_u95: float

    def __post_init__(self) -> None:
        """Freeze the prediction."""
        object.__setattr__(self, "predicted", frozen_array(self.predicted))

    @property
    def compared_s(self) -> float:
        """Time that is compared, from the first sample, in s."""
        time = self.record["time_s"]
        return float(time[self.compared - 1] - time[0]) if self.compared else 0.0
