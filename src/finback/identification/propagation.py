"""From uncertain coefficients to the uncertainty of anything computed from a model, by two roads.

Linear: gradient by differences, with the covariance (first-order delta method). Sampling: models drawn from the
covariance. Where the two differ, or where the number does not exist in every sample, it is not determined.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.equilibrium import equilibria
from finback.dynamics.fold import folds
from finback.dynamics.hopf import hopf_points
from finback.dynamics.lienard import NORMAL_95
from finback.dynamics.model import PolynomialModel
from finback.dynamics.reduction import reduce
from finback.errors import FinbackError, InputError
from finback.units import from_si

Numbers = Callable[[PolynomialModel], Mapping[str, float]]
"""Anything computed from a model: name (ending in its unit) -> number; what does not exist is left out."""

_Points = dict[str, list[dict[str, float]]]
"""Kind of point -> its numbers, alpha_rad among them."""

_STEP: Final = 1e-3
"""Of the differences, in standard deviations of the principal directions of the covariance."""
_EXISTS: Final = 0.975
"""Share of samples in which a number must exist to be determined: with less, no 95 % interval can be given."""
_APART: Final = 2.0
"""Ratio of the widths of both intervals beyond which the model is too nonlinear within its errors."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PropagatedNumber:
    """One number with its uncertainty by both roads.

    Attributes:
        name: as ``Numbers`` gives it, with unit.
        value: of the model itself.
        linear_error: standard error by the gradient.
        linear_interval: 95 %, shape (2,).
        sampled_interval: central 95 % of the samples in which the number exists, shape (2,); nan if there is none.
        existing: share of the samples in which it exists.
        determined: whether it exists in at least 97.5 % of the samples, and both intervals are of one size (ratio of
            widths within 2).
    """

    name: str
    value: float
    linear_error: float
    linear_interval: FloatArray
    sampled_interval: FloatArray
    existing: float
    determined: bool


def propagate(
    model: PolynomialModel, numbers: Numbers, *, samples: int = 400, seed: int = 0
) -> tuple[PropagatedNumber, ...]:
    """Carry the covariance of a model's coefficients to numbers computed from it.

    Args:
        model: with its covariance.
        numbers: what is computed; a ``FinbackError`` counts as "does not exist".
        samples: models drawn, 40 or more.
        seed: of the draws.

    Raises:
        InputError: too few samples, or the numbers do not exist for the model itself.
    """
    if samples < 40:
        raise InputError(f"{samples} samples give no 95 % interval", hint="use 400 or more")
    here = numbers(model)
    values, vectors = np.linalg.eigh(model.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    drawn = model.coefficients + np.random.default_rng(seed).standard_normal((samples, len(root))) @ root.T
    found = [_at(model, row, numbers) for row in drawn]
    slopes = []
    for direction in root.T:
        if direction.any():
            ahead = _at(model, model.coefficients + _STEP * direction, numbers)
            behind = _at(model, model.coefficients - _STEP * direction, numbers)
            slopes.append({name: (ahead.get(name, np.nan) - behind.get(name, np.nan)) / (2 * _STEP) for name in here})
    return tuple(
        _number(name, value, [slope[name] for slope in slopes], [row[name] for row in found if name in row], samples)
        for name, value in here.items()
    )


def fold_and_hopf_numbers(like: PolynomialModel) -> Numbers:
    """Return a function that gives elevator and alpha of every fold and Hopf point, in rad.

    Names count by rising alpha as in ``like``; the points of another model are those nearest in alpha. A point nearer
    to another one of ``like`` is not taken twice, so a fold that has vanished is left out.
    """
    return _matched(like, _folds_and_hopfs)


def analysis_numbers(like: PolynomialModel) -> Numbers:
    """Return a function that gives what the analysis of a model prints: folds, Hopf points, equilibria.

    Of each Hopf point also the frequency in rad/s and the first Lyapunov coefficient in 1/s; of each equilibrium, at
    both ends and in the middle of the elevator's range in the data, the real and imaginary part of the first
    eigenvalue, in 1/s. Points are counted and matched as by ``fold_and_hopf_numbers``.
    """
    column = like.alpha_dot.variables.index("elevator_rad")
    low, high = np.asarray(like.alpha_dot.domain)[column].tolist()
    elevators = (low, 0.5 * (low + high), high) if math.isfinite(low) and math.isfinite(high) else ()

    def points(model: PolynomialModel) -> _Points:
        system = reduce(model)
        found = _folds_and_hopfs(model)
        for elevator in elevators:
            found[f"at elevator {from_si(elevator, 'deg'):.2f} deg, equilibrium"] = [
                {
                    "alpha_rad": point.alpha_rad,
                    "eigenvalue real_1_s": float(point.eigenvalues_real_1_s[0]),
                    "eigenvalue imag_1_s": float(point.eigenvalues_imag_1_s[0]),
                }
                for point in equilibria(system, elevator)
            ]
        return found

    return _matched(like, points)


def _matched(like: PolynomialModel, points: Callable[[PolynomialModel], _Points]) -> Numbers:
    """Name the numbers of every point, by the nearest one of ``like``."""
    known = {kind: sorted(point["alpha_rad"] for point in found) for kind, found in points(like).items()}

    def numbers(model: PolynomialModel) -> dict[str, float]:
        nearest: dict[tuple[str, int], dict[str, float]] = {}
        for kind, found in points(model).items():
            for point in found:
                distances = [abs(point["alpha_rad"] - other) for other in known[kind]]
                if distances:
                    place = int(np.argmin(distances))
                    taken = nearest.get((kind, place))
                    if taken is None or distances[place] < abs(taken["alpha_rad"] - known[kind][place]):
                        nearest[kind, place] = point
        return {
            f"{kind} {place + 1} {name}": value
            for (kind, place), point in sorted(nearest.items())
            for name, value in point.items()
        }

    return numbers


def _folds_and_hopfs(model: PolynomialModel) -> _Points:
    system = reduce(model)
    return {
        "fold": [{"alpha_rad": point.alpha_rad, "elevator_rad": point.elevator_rad} for point in folds(system)],
        "hopf": [
            {
                "alpha_rad": point.alpha_rad,
                "elevator_rad": point.elevator_rad,
                "frequency_rad_s": point.frequency_rad_s,
                "lyapunov_1_s": point.lyapunov_1_s,
            }
            for point in hopf_points(system)
        ],
    }


def _at(model: PolynomialModel, coefficients: FloatArray, numbers: Numbers) -> dict[str, float]:
    try:
        found = numbers(model.with_coefficients(coefficients))
    except FinbackError:
        return {}
    return {name: value for name, value in found.items() if math.isfinite(value)}


def _number(name: str, value: float, slopes: list[float], drawn: list[float], samples: int) -> PropagatedNumber:
    error = float(np.sqrt(np.sum(np.square(slopes)))) if slopes else 0.0
    interval = np.percentile(drawn, [2.5, 97.5]) if drawn else np.full(2, np.nan)
    widths = (2 * NORMAL_95 * error, float(interval[1] - interval[0]))
    near = max(widths) <= _APART * min(widths) if all(map(math.isfinite, widths)) else False
    existing = len(drawn) / samples
    return PropagatedNumber(
        name=name,
        value=value,
        linear_error=error,
        linear_interval=frozen_array([value - NORMAL_95 * error, value + NORMAL_95 * error]),
        sampled_interval=frozen_array(interval),
        existing=existing,
        determined=near and existing >= _EXISTS,
    )
