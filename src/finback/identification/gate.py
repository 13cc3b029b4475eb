"""The collinearity gate: which coefficients the data know only together, and what of them they do know.

Condition indices and variance-decomposition proportions of Belsley, Kuh and Welsch (1980), chapter 3: columns scaled to
length 1, not centered. A near dependency among columns has an index above 30 and takes more than half of the variance
of two or more coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, IntArray, frozen_array
from finback.digits import interval
from finback.dynamics.lienard import NORMAL_95
from finback.errors import RefusedError
from finback.identification.disturbance import BEYOND_NOISE
from finback.identification.model_form import ModelForm
from finback.identification.options import IdentificationOptions
from finback.identification.selection.equations import Linearization
from finback.identification.stretch import Stretch
from finback.identification.term import ALPHA_DOT

STRONG: Final = 30.0
"""Condition index of a strong near dependency (Belsley, Kuh and Welsch 1980, section 3.2)."""
HALF: Final = 0.5
"""Share of a coefficient's variance above which a dependency is said to involve it (the same)."""
_EXACT: Final = 1e-9
"""Singular values below this share of the largest are rounding."""
_SHARE: Final = 1e-4
"""Part of a blind direction, of its largest, below which a coefficient has none: quadrature leaves about 1e-6."""
_PASSES: Final = 4
"""Of smoothing and solving: afterwards the states move by less than 1e-3 of their noise."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class KnownCombination:
    """A weighted sum of coefficients that the data know, though not its parts.

    Attributes:
        labels: the coefficients, such as ``q in dq/dt``.
        weights: their weights, shape (n,), in SI; the first is 1.
        value: of the sum, in SI.
        standard_error: of the value.
    """

    labels: tuple[str, ...]
    weights: FloatArray
    value: float
    standard_error: float

    def __post_init__(self) -> None:
        """Freeze the weights."""
        object.__setattr__(self, "weights", frozen_array(self.weights))

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the value."""
        reach = NORMAL_95 * self.standard_error
        return self.value - reach, self.value + reach

    def __str__(self) -> str:
        parts = [f"{weight:+.4g} ({label})" for label, weight in zip(self.labels, self.weights, strict=True)]
        low, high = interval(*self.interval)
        return f"{' '.join(parts).removeprefix('+1 ')} = {low} … {high}"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Collinearity:
    """What the gate found.

    Attributes:
        labels: the coefficients that were judged.
        condition_indices: falling, shape (n,).
        proportions: share of each coefficient's variance that each index takes, shape (n, n): [index, coefficient];
            columns sum to 1.
        unknown: coefficients that the data know only together; empty if the gate is open.
        known: combinations of these that they do know.
        shared: if q and dα/dt are known only together, the coefficient k of k (q + dα/dt): what is known of both if
            they are taken for one; empty otherwise.
        variance: mean square of the residuals; 1 if the form and noise explain the data.
    """

    labels: tuple[str, ...]
    condition_indices: FloatArray
    proportions: FloatArray
    unknown: tuple[str, ...]
    known: tuple[KnownCombination, ...]
    shared: tuple[KnownCombination, ...]
    variance: float = 1.0

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, "condition_indices", frozen_array(self.condition_indices))
        object.__setattr__(self, "proportions", frozen_array(self.proportions))

    def refuse(self) -> None:
        """Raise RefusedError if there are coefficients that the data know only together, with what they do know."""
        if not self.unknown:
            return
        known = "; ".join(str(item) for item in (*self.shared, *self.known)) or "nothing"
        said = f"Known (SI, 95 %): {known}"
        if self.variance > BEYOND_NOISE:
            said = (
                f"The residuals are {math.sqrt(self.variance):.2g} times larger than the sensors' noise, by gusts or "
                "by what the form misses, so no interval is given for what is known"
            )
        raise RefusedError(
            f"the data know these coefficients only together: {', '.join(self.unknown)} "
            f"(condition index {self.condition_indices[0]:.3g}). {said}",
            hint="leave one of them out, give them one coefficient as in 'q+alpha_dot', or fly what moves them apart",
        )


def collinearity(regressors: FloatArray, target: FloatArray, form: ModelForm, columns: IntArray) -> Collinearity:
    """Judge whitened equations.

    Coefficients are known only together if a dependency is exact, or if it is strong, takes more than half of their
    variances, and no coefficient of the group is told from zero (95 %). A strong dependency among coefficients that
    are well determined in spite of it is no obstacle.

    Args:
        regressors: all columns of the form, shape (n, p), of noise of variance 1.
        target: shape (n,).
        form: gives names to the columns.
        columns: which are judged; columns of zeros are left out.
    """
    lengths = np.sqrt((regressors**2).sum(axis=0))
    columns = columns[lengths[columns] > 0]
    scale, labels = lengths[columns], tuple(form.labels()[i] for i in columns)
    left, singular, right = np.linalg.svd(regressors[:, columns] / scale, full_matrices=False)
    explained = left.T @ target
    exact = _blind(singular, explained)
    indices = singular[0] / np.maximum(singular, np.finfo(np.float64).tiny)
    share = (right / np.maximum(singular, _EXACT * singular[0])[:, np.newaxis]) ** 2
    proportions = share / share.sum(axis=0)
    values = right[~exact].T @ (explained[~exact] / singular[~exact])
    residual = float(target @ target - explained @ explained) / max(1, target.size - columns.size)
    widening = max(1.0, residual)
    weak = _weak(right, singular, exact, values, indices, proportions, widening)
    unknown = _members(right, weak, proportions)
    kept = ~weak
    scaled = right[kept].T @ (explained[kept] / singular[kept])
    covariance = widening * (right[kept].T / singular[kept] ** 2) @ right[kept]
    known = _known(scaled / scale, covariance / np.outer(scale, scale), (right[weak] / scale).T, unknown, form, columns)
    order = np.argsort(-indices, kind="stable")
    return Collinearity(
        labels=labels,
        condition_indices=indices[order],
        proportions=proportions[order],
        unknown=tuple(labels[i] for i in np.flatnonzero(unknown)),
        known=known,
        shared=_shared(known),
        variance=residual,
    )


def judge(used: Sequence[Stretch], form: ModelForm, options: IdentificationOptions, noise: FloatArray) -> Collinearity:
    """Judge what a form can tell from the data, however badly: nothing is refused here.

    Args:
        used: the data.
        form: the form.
        options: window and test functions.
        noise: standard deviations of alpha in rad and q in rad/s, shape (2,).
    """
    lines = Linearization(used, form, options, noise)
    lines.coefficients = form.known
    free = form.free
    for last in (*([False] * _PASSES), True):
        equations = lines.equations()
        rest = np.setdiff1d(np.arange(form.size), free)
        target = equations.target - equations.regressors[:, rest] @ form.known[rest]
        if last:
            break
        coefficients = form.known
        coefficients[free] = _seen(equations.regressors[:, free], target)
        left = target - equations.regressors[:, free] @ coefficients[free]
        lines.follow(coefficients, variance=float((left**2).mean()))
    return collinearity(equations.regressors, target, form, free)


def _blind(singular: FloatArray, explained: FloatArray) -> NDArray[np.bool_]:
    """Tell in which directions the error could add and cancel more than everything that all terms explain."""
    blind: NDArray[np.bool_] = singular <= max(_EXACT * float(singular[0]), 1.0 / float(np.linalg.norm(explained)))
    return blind


def _seen(regressors: FloatArray, target: FloatArray) -> FloatArray:
    """Solve in the directions that the data see; of all such solutions, the shortest in scaled coefficients."""
    lengths = np.sqrt((regressors**2).sum(axis=0))
    safe = np.where(lengths > 0, lengths, 1.0)
    left, singular, right = np.linalg.svd(regressors / safe, full_matrices=False)
    explained = left.T @ target
    kept = ~_blind(singular, explained)
    solution: FloatArray = right[kept].T @ (explained[kept] / singular[kept]) / safe
    return solution


def _weak(  # noqa: PLR0913, PLR0917 - the parts of a decomposition
    right: FloatArray,
    singular: FloatArray,
    exact: NDArray[np.bool_],
    values: FloatArray,
    indices: FloatArray,
    proportions: FloatArray,
    widening: float,
) -> NDArray[np.bool_]:
    """Tell which directions leave their coefficients unknown, shape (n,)."""
    weak = exact.copy()
    variances = widening * ((right[~exact] / singular[~exact, np.newaxis]) ** 2).sum(axis=0)
    unseen = np.abs(values) < NORMAL_95 * np.sqrt(variances)
    for k in np.flatnonzero((indices > STRONG) & ~exact):
        group = proportions[k] > HALF
        if group.sum() > 1 and unseen[group].all():
            weak[k] = True
    return weak


def _members(right: FloatArray, weak: NDArray[np.bool_], proportions: FloatArray) -> NDArray[np.bool_]:
    """Tell which coefficients the weak directions leave unknown, shape (n,): those that they take most variance of."""
    members = np.zeros(right.shape[1], dtype=np.bool_)
    for k in np.flatnonzero(weak):
        parts = np.abs(right[k])
        members |= (parts > _SHARE * parts.max()) & (proportions[k] > HALF)
    return members


def _known(
    values: FloatArray,
    covariance: FloatArray,
    blind: FloatArray,
    unknown: NDArray[np.bool_],
    form: ModelForm,
    columns: IntArray,
) -> tuple[KnownCombination, ...]:
    """Return the combinations that no blind direction moves: each other coefficient with multiples of the pivots.

    Pivots are coefficients of dα/dt if there are some in it, because the explicit model is what is left without them.
    """
    if not blind.shape[1]:
        return ()
    pivots: list[int] = []
    rest = blind.copy()
    for _ in range(blind.shape[1]):
        size = np.abs(rest).max(axis=1) * np.sqrt(np.maximum(np.diag(covariance), 0.0) + values**2 + 1e-300)
        rates = np.array([ALPHA_DOT in form.terms[i][1].variables for i in columns])
        able = unknown & (np.abs(rest).max(axis=1) > _SHARE * np.abs(rest).max())
        able[pivots] = False
        if not able.any():
            return ()
        among = able & rates if (able & rates).any() else able
        pivot = int(np.argmax(np.where(among, size, -1.0)))
        pivots.append(pivot)
        row = rest[pivot].copy()
        rest -= np.outer(rest @ row / (row @ row), row)
    shares = np.linalg.solve(blind[pivots].T, blind.T).T  # how much each coefficient moves with each pivot
    found = []
    for i in np.flatnonzero(unknown).tolist():
        if i in pivots:
            continue
        weights = np.zeros(values.size)
        weights[i] = 1.0
        weights[pivots] = -shares[i]
        parts: list[int] = [i, *(p for p in pivots if abs(weights[p]) > 1e-12)]
        found.append(
            KnownCombination(
                labels=tuple(form.labels()[columns[j]] for j in parts),
                weights=weights[parts],
                value=float(weights @ values),
                standard_error=math.sqrt(max(0.0, float(weights @ covariance @ weights))),
            )
        )
    return tuple(found)


def _shared(known: tuple[KnownCombination, ...]) -> tuple[KnownCombination, ...]:
    """Return what is known of one coefficient for q and dα/dt in dq/dt, if only their combination is."""
    both = ModelForm.parse(("1",), ("q", "alpha_dot")).labels()[1:]
    for item in known:
        if item.labels == both:
            total = float(item.weights.sum())
            return (
                KnownCombination(
                    labels=("q+alpha_dot in dq/dt",),
                    weights=frozen_array([1.0]),
                    value=item.value / total,
                    standard_error=item.standard_error / abs(total),
                ),
            )
    return ()
