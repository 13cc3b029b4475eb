"""Hold-out flights: maneuvers that the fit never saw, flown by the simulator and predicted by the model."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.drawn import drawn_coefficients
from finback.dynamics.model import PolynomialModel
from finback.dynamics.trajectory import free_run_samples
from finback.errors import InputError
from finback.flight.plan import FlightPlan
from finback.records import FlightRecord, Hold, Schedule, Sweep

MINIMUM_COMPARED_S: Final = 1.0
"""Less than this inside the fitted domain says nothing: about half a short period of a fighter (14 CFR 60 asks for
a whole time history)."""
_SAMPLES: Final = 512
"""Models drawn from the coefficient covariance: another seed then moves U95 by 2.5 % (standard deviation)."""
_CONFIDENCE: Final = 0.95
_SAME_ELEVATOR_RAD: Final = 1e-9  # far above rounding, far below any elevator that somebody means to be another


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
    difference = s - p
    bias = (float(np.mean(difference)) / error) ** 2
    # 2 (1 − ρ) σ_s σ_p = σ²(s − p) − (σ_s − σ_p)², and σ_s − σ_p = mean((s' − p')(s' + p')) / (σ_s + σ_p) of the
    # centered s' and p': so written, only the histories themselves are subtracted, not their nearly equal moments.
    scatter = (float(np.std(difference)) / error) ** 2
    width = float(np.std(s) + np.std(p))
    centered = difference - np.mean(difference)
    product = float(np.mean(centered * ((s - np.mean(s)) + (p - np.mean(p)))))
    variance = min((product / width / error) ** 2, scatter) if width > 0.0 else 0.0
    covariance = scatter - variance
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

    The comparison ends where the simulated flight first leaves the box in which data supported the model. A flight
    that leaves it within ``MINIMUM_COMPARED_S`` is compared whole, but ``in_domain`` is false: an extrapolation.

    Attributes:
        record: the flight, without noise.
        predicted: alpha in rad and q in rad/s at the record's times, shape (n, 2); not finite after a blow-up.
        compared: number of samples, from the first, that are compared.
        in_domain: whether these samples lie where data supported the model.
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
    in_domain: bool
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
        return float(time[self.compared - 1] - time[0])


def predict(model: PolynomialModel, record: FlightRecord, *, seed: int) -> Holdout:
    """Predict a flight from its own initial state and elevator, and compare.

    The uncertainty of each measure is the 0.95 quantile of its |change| over models drawn from the covariance.

    Args:
        model: the identified model.
        record: a flight without noise, with ``alpha_rad``, ``q_rad_s`` and ``elevator_rad``.
        seed: of the drawn models.
    """
    simulated = np.stack([record["alpha_rad"], record["q_rad_s"]], axis=1)
    inside = _samples_in_domain(model, record)
    time = record["time_s"]
    in_domain = inside > 0 and bool(inside == len(record) or time[inside - 1] - time[0] >= MINIMUM_COMPARED_S)
    compared = inside if in_domain else len(record)
    draws = drawn_coefficients(model, _SAMPLES, seed=seed)
    runs = free_run_samples(
        model,
        np.concatenate([model.coefficients[np.newaxis], draws]),
        time_s=time,
        elevator_rad=record["elevator_rad"],
        # The output of an actuator moves smoothly: between samples a straight line is nearest to it.
        hold=(Hold.FOH if record.hold is Hold.ACTUATOR else record.hold).value,
        alpha_rad=float(simulated[0, 0]),
        q_rad_s=float(simulated[0, 1]),
    )
    cut, cuts = simulated[:compared], runs[:, :compared]
    rmses = np.array([[rms(cut[:, i] - run[:, i]) for i in (0, 1)] for run in cuts])
    theils = np.array([[theil(cut[:, i], run[:, i]).coefficient for i in (0, 1)] for run in cuts])
    rmse_u95, theil_u95 = _spread(rmses), _spread(theils)
    peak = _peak(cut - cuts[0])
    return Holdout(
        record=record,
        predicted=runs[0],
        compared=compared,
        in_domain=in_domain,
        alpha_rmse_rad=float(rmses[0, 0]),
        q_rmse_rad_s=float(rmses[0, 1]),
        alpha_rmse_u95_rad=float(rmse_u95[0]),
        q_rmse_u95_rad_s=float(rmse_u95[1]),
        alpha_peak_error_rad=float(peak[0]),
        q_peak_error_rad_s=float(peak[1]),
        alpha_theil=theil(cut[:, 0], cuts[0, :, 0]),
        q_theil=theil(cut[:, 1], cuts[0, :, 1]),
        alpha_theil_u95=float(theil_u95[0]),
        q_theil_u95=float(theil_u95[1]),
    )


def _samples_in_domain(model: PolynomialModel, record: FlightRecord) -> int:
    """Return how many samples, from the first, lie in the domains of both polynomials."""
    values = np.stack([record["alpha_rad"], record["q_rad_s"], record["elevator_rad"]], axis=1)
    inside = np.ones(len(record), dtype=np.bool_)
    for polynomial in (model.alpha_dot, model.q_dot):
        low, high = polynomial.domain[:, 0], polynomial.domain[:, 1]
        inside &= ((low <= values) & (values <= high)).all(axis=1)
    outside = np.flatnonzero(~inside)
    return int(outside[0]) if outside.size else len(record)


def _spread(values: FloatArray) -> FloatArray:
    """Return the 0.95 quantile of |value − first| over the first axis; infinite where that is not finite."""
    finite = np.isfinite(values)
    first = np.where(finite[0], values[0], 0.0)
    change = np.where(finite & finite[:1], np.abs(np.where(finite, values, 0.0) - first), np.inf)[1:]
    return np.asarray(np.quantile(change, _CONFIDENCE, axis=0, method="higher"), dtype=np.float64)


def _peak(difference: FloatArray) -> FloatArray:
    """Return the largest |difference| of each column; infinite where one is not finite."""
    return np.asarray(np.where(np.isfinite(difference), np.abs(difference), np.inf).max(axis=0), dtype=np.float64)


def refuse_seen(plans: Iterable[FlightPlan], sweep: Sweep, *, alpha_slack_rad: float, q_slack_rad_s: float) -> None:
    """Check that no hold-out flight is among the flights of the sweep.

    Two flights are the same if they start at one state and the elevator is asked to do the same for as long as both
    last; a longer or shorter copy is the same flight too.

    Args:
        plans: the hold-out flights.
        sweep: what the model was identified from.
        alpha_slack_rad: how far noise may have moved the recorded initial alpha of the same flight.
        q_slack_rad_s: the same of the pitch rate.

    Raises:
        InputError: one of them is; the message names the pairs.
    """
    pairs = [
        f"'{plan.name}' is '{seen.name}' of the sweep"
        for plan in plans
        for seen in sweep.records
        if len(seen)
        and abs(plan.alpha_rad - float(seen["alpha_rad"][0])) <= alpha_slack_rad
        and abs(plan.q_rad_s - float(seen["q_rad_s"][0])) <= q_slack_rad_s
        and _same_elevator(plan.schedule, seen.schedule, min(plan.duration_s, seen.duration_s))
    ]
    if pairs:
        raise InputError(
            f"hold-out flights that the model was identified from: {'; '.join(pairs)}",
            hint="choose other maneuvers for validation.holdout: a prediction of data it has seen tests nothing",
        )


def _same_elevator(one: Schedule, other: Schedule, until_s: float) -> bool:
    knots = np.concatenate([one.time_s, other.time_s])
    # Two piecewise linear functions are equal if they are at all corners, and between them (jumps).
    corners = np.unique(np.append(knots[knots <= until_s], [0.0, until_s]))
    times = np.concatenate([corners, 0.5 * (corners[1:] + corners[:-1])])
    return bool(np.abs(one.value(times) - other.value(times)).max() <= _SAME_ELEVATOR_RAD)
