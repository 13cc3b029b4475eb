"""From a sweep to a polynomial model with covariance, domain and diagnostics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.model import PolynomialModel
from finback.identification.options import IdentificationOptions


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A stretch of a flight that was used.

    Attributes:
        flight: the record's name.
        start_s: time of its first sample, in s.
        end_s: time of its last sample, in s.
        samples: how many samples it has.
    """

    flight: str
    start_s: float
    end_s: float
    samples: int


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnostics:
    """How well the data supported the fit. Pairs are for (dα/dt, dq/dt).

    Attributes:
        equations: number of weak equations of each kind.
        condition_number: of the whitened regressor with columns scaled to length 1; above about 30 some
            coefficients are determined together only, above 1e7 the fit is refused.
        chi_square: mean square of the whitened residuals; 1 if model and noise explain the data.
        lag1_correlation: correlation of neighboring whitened residuals; 0 if model and noise explain the data.
        used_fraction: share of all samples that was used.
        iterations: of the estimate with its own noise covariance.
    """

    equations: int
    condition_number: float
    chi_square: tuple[float, float]
    lag1_correlation: tuple[float, float]
    used_fraction: float
    iterations: int


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """An identified model and what it rests on.

    Attributes:
        model: the polynomials with covariance; the domain of each variable is the box of the data used, for alpha
            its intersection with the window.
        options: what was asked for.
        alpha_noise_rad: standard deviation of the noise of alpha, estimated from the records, in rad.
        q_noise_rad_s: the same for q, in rad/s.
        segments: what was used of each flight.
        unused: flights of which nothing was used, each with its reason.
        diagnostics: how well the data supported the fit.
        warnings: what a reader of the model must know; empty if nothing.
    """

    model: PolynomialModel
    options: IdentificationOptions
    alpha_noise_rad: float
    q_noise_rad_s: float
    segments: tuple[Segment, ...]
    unused: tuple[str, ...]
    diagnostics: Diagnostics
    warnings: tuple[str, ...]

    @property
    def standard_errors(self) -> FloatArray:
        """One standard error per coefficient, those of dα/dt first, shape (n,), in SI."""
        return frozen_array(np.sqrt(np.diag(self.model.covariance)))
