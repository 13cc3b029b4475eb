"""Elevator ramps extrapolated to rate zero."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.special import stdtrit

from finback.arrays import FloatArray, frozen_array
from finback.validation.options import MINIMUM_RATES

_SHARE_OF_WAY: Final = 0.2


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Extrapolation:
    """The fit of ramp crossings over their rates.

    Attributes:
        coefficients: of 1, rate^(2/3), rate, in SI, shape (3,); NaN if there are fewer than four ramps.
        uncertainty_rad: 95 % uncertainty of the value at rate zero; infinite if there are fewer than four ramps.
        residual_rad: root mean square of the fit, with n − 3 degrees of freedom.
    """

    coefficients: FloatArray
    uncertainty_rad: float
    residual_rad: float

    def __post_init__(self) -> None:
        """Freeze the coefficients."""
        object.__setattr__(self, "coefficients", frozen_array(self.coefficients))


def extrapolate(rates_rad_s: FloatArray, elevator_rad: FloatArray) -> Extrapolation:
    """Extrapolate crossing elevators (n,) to rate zero by least squares in 1, rate^(2/3), rate.

    The uncertainty is a plain sum, because the parts have one cause, the terms left out of the expansion: Student's
    interval from the residual, the largest change when one rate is left out, and twice the change when the next term,
    rate·ln(rate), is added. It is at least 0.2 of the way from the slowest ramp to rate zero: over both
    folds of 240 cubic models, each coefficient of a published one changed at random by up to 20 %, and ramps from
    0.01 to 0.2 deg/s, the error was up to 0.18 of that way, also where the three parts happened to be small.
    """
    n = rates_rad_s.size
    if n < MINIMUM_RATES:
        return Extrapolation(coefficients=np.full(3, math.nan), uncertainty_rad=math.inf, residual_rad=math.nan)
    unit = rates_rad_s / rates_rad_s.max()  # so that all terms are of order one
    terms = ramp_terms(unit)
    fitted = _solve(terms, elevator_rad)
    residual = math.sqrt(float(np.sum((elevator_rad - terms @ fitted) ** 2)) / (n - 3))
    standard_error = residual * math.sqrt(float(np.linalg.inv(terms.T @ terms)[0, 0]))
    student = float(stdtrit(n - 3, 0.975)) * standard_error
    others = [np.arange(n) != i for i in range(n)]
    left_out = max(abs(_solve(terms[rest], elevator_rad[rest])[0] - fitted[0]) for rest in others)
    longer = np.column_stack([terms, unit * np.log(unit)])
    next_term = abs(_solve(longer, elevator_rad)[0] - fitted[0])
    way = abs(float(elevator_rad[np.argmin(rates_rad_s)] - fitted[0]))
    scale = ramp_terms(rates_rad_s.max())
    return Extrapolation(
        coefficients=fitted / scale,
        uncertainty_rad=max(float(student + left_out + 2.0 * next_term), _SHARE_OF_WAY * way),
        residual_rad=residual,
    )


def _solve(terms: FloatArray, values: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.lstsq(terms, values, rcond=None)[0], dtype=np.float64)


def ramp_terms(rate_rad_s: FloatArray) -> FloatArray:
    """Return 1, rate^(2/3), rate: shape (..., 3)."""
    return np.stack([np.ones_like(rate_rad_s), np.cbrt(rate_rad_s) ** 2, rate_rad_s], axis=-1)
