"""What gusts leave of the intervals of a method that knows none: filter error fits the same data, and the two differ.

The weak form and Fourier transforms take gusts for noise that has nothing to do with alpha; but alpha as it is measured
holds the gust, so that regressors and residuals move together, and estimates are biased. Output error lays the motion
that gusts made to its coefficients. None of their residuals shows by how much. Filter error knows gusts that are white;
the distance of the two estimates, with filter error's own errors, is what is known of the bias.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import RefusedError
from finback.identification.coloring import Coloring
from finback.identification.estimate import Estimate
from finback.identification.estimators import estimated
from finback.identification.method import Method
from finback.identification.noise import Noise
from finback.identification.options import IdentificationOptions
from finback.identification.stretch import Stretch
from finback.identification.suspicions.finding import Suspect, Suspicion


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RoughAir:
    """A covariance that holds what gusts did, and what a reader must know of it.

    Attributes:
        covariance: of the coefficients, in SI, shape (p, p); as it was in calm air.
        statements: what was done; empty in calm air.
    """

    covariance: FloatArray
    statements: tuple[str, ...] = ()


def in_rough_air(  # noqa: PLR0913 - a fit, and all that it rests on
    fit: Estimate,
    color: Coloring,
    doubts: Sequence[Suspicion],
    *,
    used: Sequence[Stretch],
    options: IdentificationOptions,
    noise: Noise,
    larger: bool,
) -> RoughAir:
    """Widen a covariance by how far filter error is from the estimate, if the air was not calm.

    Filter error is asked where gusts were found, and where nobody can tell gusts but the residuals are no white noise
    of the sensors.

    Args:
        fit: the estimate.
        color: what its residuals say, and its covariance so far.
        doubts: the checks of the residuals.
        used: the data.
        options: of the fit.
        noise: of the records.
        larger: whether the residuals are larger than the sensors' noise explains.
    """
    calm = RoughAir(covariance=color.covariance)
    air = [one for one in doubts if one.suspect is Suspect.TURBULENCE]
    raised, unknown = any(one.raised for one in air), any(not one.judged for one in air)
    if options.method is Method.FILTER_ERROR or not (raised or (unknown and (color.colored or larger))):
        return calm
    method = options.method.value
    where = "in gusts" if raised else "where gusts can be neither seen nor excluded"
    try:
        beside = estimated(used, replace(options, method=Method.FILTER_ERROR), noise)
    except RefusedError as refusal:
        why = f"filter error cannot say by how much: {refusal.message}"
        said = f"{where} the intervals of {method} are too narrow, and {why}"
        return replace(calm, statements=(said,))
    apart = fit.coefficients - beside.coefficients
    errors = np.sqrt(np.diag(beside.covariance))
    free = errors > 0.0
    # Never less than what the method itself says of its errors.
    lift = np.ones(errors.size)
    lift[free] = np.maximum(1.0, np.sqrt(np.diag(color.covariance))[free] / errors[free])
    most = float((np.abs(apart[free]) / errors[free]).max(initial=0.0))
    said = (
        f"{where} estimates of {method} are biased: they are up to {most:.3g} standard errors beside those of filter "
        "error; standard errors are widened to hold these: use method filter-error"
    )
    return RoughAir(covariance=beside.covariance * np.outer(lift, lift) + np.outer(apart, apart), statements=(said,))
