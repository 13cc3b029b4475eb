"""What a set of regressors cannot tell apart, in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import RefusedError

_SINGULAR: Final = 1e-10
"""Below this share of the largest singular value nothing but rounding is left."""
APART: Final = "these data cannot tell apart"
"""How the refusal of coefficients that are known only together begins."""
_SHARE: Final = 0.1
"""A coefficient belongs to a direction if its part in it is at least this share of the largest part."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """The least-squares solution of whitened equations.

    Attributes:
        coefficients: shape (p,).
        covariance: shape (p, p), for noise of variance 1.
        residual: what is left of the target, shape (n,).
        variance: mean square of the residual, freedom counted; 1 if model and noise explain the target.
        condition_number: of the regressors with columns scaled to length 1.
    """

    coefficients: FloatArray
    covariance: FloatArray
    residual: FloatArray
    variance: float
    condition_number: float


def solve(
    regressors: FloatArray, target: FloatArray, labels: tuple[str, ...], *, judged: bool, folded: int = 0
) -> Solution:
    """Solve whitened equations by the singular value decomposition of the scaled regressors.

    Args:
        regressors: shape (n, p).
        target: shape (n,), with noise of variance 1.
        labels: a name for each coefficient.
        judged: also refuse what noise, and not only rounding, leaves undetermined.
        folded: how many more equations were folded into these rows by a triangulation.

    Raises:
        RefusedError: some combination of coefficients is not determined: not numerically, or its error could add and
            cancel more than everything that all terms together explain.
    """
    scale = np.sqrt((regressors**2).sum(axis=0))
    if not (np.isfinite(scale).all() and scale.all()):
        names = [label for label, length in zip(labels, scale, strict=True) if not length > 0]
        raise RefusedError(
            f"the data hold nothing about: {', '.join(names) or 'any term (values are not finite)'}",
            hint="fly maneuvers in which alpha, q and the elevator all move",
        )
    left, singular, right = np.linalg.svd(regressors / scale, full_matrices=False)
    if (singular < _SINGULAR * singular[0]).any():
        raise _refusal(right[singular < _SINGULAR * singular[0]], labels, "exactly")
    explained = left.T @ target
    scaled = right.T @ (explained / singular)
    residual = target - regressors @ (scaled / scale)
    variance = float((residual**2).sum()) / max(target.size + folded - scale.size, 1)
    if judged:
        weak = np.sqrt(max(1.0, variance)) / singular > np.linalg.norm(explained)
        if weak.any():
            raise _refusal(right[weak], labels, "within the noise")
    inverse = right.T / singular / scale[:, np.newaxis]
    return Solution(
        coefficients=scaled / scale,
        covariance=inverse @ inverse.T,
        residual=residual,
        variance=variance,
        condition_number=float(singular[0] / singular[-1]),
    )


def _refusal(directions: FloatArray, labels: tuple[str, ...], how: str) -> RefusedError:
    """Name the terms that each undetermined direction mixes."""
    mixtures = []
    for direction in directions:
        parts = np.abs(direction)
        mixtures.append(" with ".join(np.array(labels)[parts >= _SHARE * parts.max()].tolist()))
    return RefusedError(
        f"{APART}, {how}: {'; '.join(mixtures)}",
        hint="add maneuvers that move alpha, q and the elevator independently and further, or lower an order of alpha",
    )
