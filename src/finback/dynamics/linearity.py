"""How far located numbers follow their gradients: the reach of the delta method.

A 95 % interval by gradient holds if the number is linear in the coefficients over the errors that these have. That is
looked at where it matters: at the ends of the interval. The coefficients under which a number is likeliest to lie at
an end are θ ± z C∇/√(∇ᵀC∇), a first step of the profile likelihood (Bates & Watts 1988, Nonlinear Regression
Analysis, section 6.1; Donaldson & Schnabel 1987, Technometrics 29(1)); there the point is located anew.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.lienard import NORMAL_95, LienardSystem

BENT: Final = 0.2
"""Share of the half-width by which a number may miss what its gradient foretells at an end of an interval. Over noise
of any size and flights of any reach, intervals within it cover 95 % (``scripts/study-identification judged``); from
about 1 on they do not, and the number may as well not exist."""
ROUNDING: Final = 1e-9
"""Of a number: what is found again is the same only to rounding, which is no evidence."""

Located = Callable[[LienardSystem], FloatArray]
"""Numbers of one point of a system, shape (m,); nan where the system has no such point."""


def intervals(system: LienardSystem, values: FloatArray, gradients: FloatArray, located: Located) -> FloatArray:
    """Return the 95 % interval of each number of one point; infinite for those that are not determined.

    A number is not determined where it, or the point itself, leaves the linear model at the ends of any of the
    intervals: a fold that the data allow to vanish has no place.

    Args:
        system: with the covariance of θ.
        values: of the numbers, shape (m,).
        gradients: their derivatives by θ, shape (m, p).
        located: finds the numbers in a system whose coefficients were moved.
    """
    stated = np.array([system.interval(float(v), row) for v, row in zip(values, gradients, strict=True)])
    stated[~linear(system, values, gradients, located)] = (-np.inf, np.inf)
    return frozen_array(stated)


def linear(system: LienardSystem, values: FloatArray, gradients: FloatArray, located: Located) -> NDArray[np.bool_]:
    """Tell which numbers follow their gradients as far as the errors of θ reach, shape (m,)."""
    return follows(values, gradients, system.covariance, lambda change: located(system.moved(change)))


def follows(
    values: FloatArray, gradients: FloatArray, covariance: FloatArray, at: Callable[[FloatArray], FloatArray]
) -> NDArray[np.bool_]:
    """Tell which numbers are where their gradients foretell, at the ends of the intervals of all of them, shape (m,).

    Args:
        values: of the numbers, shape (m,).
        gradients: their derivatives by some parameters, shape (m, p); nan where there is none.
        covariance: of the parameters, shape (p, p).
        at: the numbers when the parameters are changed by so much, shape (m,); nan where one does not exist.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        deviations = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", gradients, covariance, gradients), 0.0))
    found: NDArray[np.bool_] = np.isfinite(deviations)
    most = BENT * NORMAL_95 * deviations + ROUNDING * (np.abs(values) + deviations)
    for place in np.flatnonzero(found & (deviations > 0.0)).tolist():
        step = NORMAL_95 / deviations[place] * (covariance @ gradients[place])
        for change in (step, -step):
            with np.errstate(invalid="ignore"):
                missed = np.abs(at(change) - values - gradients @ change)
            found &= missed <= most
    return found
