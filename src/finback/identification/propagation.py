"""From uncertain coefficients to the uncertainty of anything computed from a model, by two roads.

Linear: gradient by differences, with the covariance (first-order delta method). Sampling: models drawn from the
covariance. Where the two differ, where the number leaves its gradient within the errors (``dynamics.linearity``), or
where it does not exist in nearly every sample, it is not determined; nor is what belongs to a point without a place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.drawn import covariance_root, drawn_coefficients
from finback.dynamics.lienard import NORMAL_95
from finback.dynamics.linearity import ROUNDING, follows
from finback.dynamics.model import PolynomialModel
from finback.errors import FinbackError, InputError
from finback.identification.followed_numbers import FollowedNumbers

Numbers = Callable[[PolynomialModel], Mapping[str, float]]
"""Anything computed from a model: name (ending in its unit) -> number; what does not exist is left out."""

_STEP: Final = 1e-3
"""Of the differences, in columns of a root of the covariance, directions of one standard deviation."""
_EXISTS: Final = 0.975
"""Share of samples in which a number must exist to be determined: with less, no 95 % interval can be given."""
_PLACE: Final = (" alpha_rad", " elevator_rad")
"""What says where an object lies: "hopf 1 alpha_rad"; other numbers of it begin alike, "hopf 1 lyapunov_1_s"."""
_APART: Final = 0.5
"""Of the linear half-width: by more, no end of both intervals may differ. 512 draws tell an end to 0.04 of it."""


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
        determined: whether it exists in at least 97.5 % of the samples, both ends of both intervals differ by less
            than half of a half-width, and the number is where its gradient foretells (to a fifth of its half-width) for
            the coefficients at the ends of every linear interval; and where the object whose number it is (a fold, a
            Hopf point, an equilibrium) has a place of which all this holds.
        reason: why it is not determined; empty if it is.
    """

    name: str
    value: float
    linear_error: float
    linear_interval: FloatArray
    sampled_interval: FloatArray
    existing: float
    determined: bool
    reason: str = ""


def propagate(
    model: PolynomialModel, numbers: Numbers, *, samples: int = 512, seed: int = 0
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
        raise InputError(f"{samples} samples give no 95 % interval", hint="use 512 or more")
    here = numbers(model)
    # What is computed from another model is a number only; its own interval would cost more than all the rest.
    exact = replace(model, covariance=np.zeros_like(model.covariance))
    found = _found(exact, drawn_coefficients(model, samples, seed=seed), numbers)
    root = covariance_root(model.covariance)
    root = root[:, root.any(axis=0)]
    slopes = _slopes(exact, root, numbers, here)

    def moved(changes: FloatArray) -> FloatArray:
        there = _found(exact, exact.coefficients + changes @ root.T, numbers)
        return np.array([[one.get(name, np.nan) for name in here] for one in there])

    errors = np.sqrt((slopes**2).sum(axis=1))
    # In units of the root's columns, the parameters are independent, each with a deviation of 1.
    straight = follows(np.array(list(here.values())), slopes, np.eye(root.shape[1]), moved)
    results = []
    for (name, value), error, keeps in zip(here.items(), errors.tolist(), straight.tolist(), strict=True):
        there = [row[name] for row in found if name in row]
        results.append(_number(name, value, error, there, share=len(there) / samples, straight=keeps))
    return _judged_together(results)


def _judged_together(found: Sequence[PropagatedNumber]) -> tuple[PropagatedNumber, ...]:
    """Withdraw every number of an object whose place is not determined: nobody knows what it would be a number of."""
    lost = {
        number.name.removesuffix(end): number.reason
        for end in _PLACE
        for number in found
        if number.name.endswith(end) and not number.determined
    }
    return tuple(
        replace(number, determined=False, reason=f"its place: {reason}") if number.determined and reason else number
        for number in found
        for reason in [next((why for name, why in lost.items() if number.name.startswith(f"{name} ")), "")]
    )


def _slopes(model: PolynomialModel, root: FloatArray, numbers: Numbers, here: Mapping[str, float]) -> FloatArray:
    """Return how each number moves along each column of the root, shape (m, k); nan if it is not there."""
    steps = _STEP * root.T
    found = _found(model, model.coefficients + np.concatenate([steps, -steps]), numbers)
    values = np.array([[one.get(name, np.nan) for one in found] for name in here]).reshape(len(here), 2, -1)
    return np.asarray((values[:, 0] - values[:, 1]) / (2.0 * _STEP))


def _found(model: PolynomialModel, coefficients: FloatArray, numbers: Numbers) -> list[dict[str, float]]:
    """Return the numbers of a model with each row of coefficients, shape (n, p)."""
    if isinstance(numbers, FollowedNumbers):
        return numbers.of_all(coefficients)
    return [_at(model, row, numbers) for row in coefficients]


def _at(model: PolynomialModel, coefficients: FloatArray, numbers: Numbers) -> dict[str, float]:
    try:
        found = numbers(model.with_coefficients(coefficients))
    except FinbackError:
        return {}
    return {name: value for name, value in found.items() if math.isfinite(value)}


def _number(
    name: str, value: float, error: float, drawn: list[float], *, share: float, straight: bool
) -> PropagatedNumber:
    linear = value + NORMAL_95 * error * np.array([-1.0, 1.0])
    sampled = np.percentile(drawn, [2.5, 97.5]) if drawn else np.full(2, np.nan)
    most = _APART * NORMAL_95 * error + ROUNDING * (abs(value) + error)
    near = bool((np.abs(sampled - linear) <= most).all())
    if share < _EXISTS:
        reason = f"exists in {share:.0%} of the samples"
    else:
        reason = "" if straight and near else "too nonlinear within its errors"
    return PropagatedNumber(
        name=name,
        value=value,
        linear_error=error,
        linear_interval=frozen_array(linear),
        sampled_interval=frozen_array(sampled),
        existing=share,
        determined=not reason,
        reason=reason,
    )
