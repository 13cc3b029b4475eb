"""How far located numbers follow their gradients: the reach of the delta method.

A 95 % interval by gradient holds if the number is linear in the coefficients over the errors that these have. That is
looked at where it matters: at the ends of the interval. The coefficients under which a number is likeliest to lie at
an end are θ ± z C∇/√(∇ᵀC∇), a first step of the profile likelihood (Bates & Watts 1988, Nonlinear Regression
Analysis, section 6.1; Donaldson & Schnabel 1987, Technometrics 29(1)); there the point is located anew.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

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

Changed = Callable[[FloatArray], FloatArray]
"""Changes of θ, shape (k, p) -> the numbers with each of them, shape (k, m); nan where one does not exist."""


class Uncertain(Protocol):
    """A system whose coefficients depend on θ."""

    @property
    def covariance(self) -> FloatArray:
        """Of θ, shape (p, p)."""
        ...

    def interval(self, value: float, gradient: FloatArray) -> FloatArray:
        """Return the 95 % interval of a value with this derivative by θ, shape (2,)."""
        ...


def moving(system: LienardSystem, located: Located) -> Changed:
    """Return the numbers of a point of a system whose θ is changed, found anew for each change."""
    return lambda changes: np.array([located(system.moved(change)) for change in changes])


def intervals(system: Uncertain, values: FloatArray, gradients: FloatArray, at: Changed) -> FloatArray:
    """Return the 95 % interval of each number of one point; infinite for those that are not determined.

    A number is not determined where it, or the point itself, leaves the linear model at the ends of any of the
    intervals: a fold that the data allow to vanish has no place.

    Args:
        system: with the covariance of θ.
        values: of the numbers, shape (m,).
        gradients: their derivatives by θ, shape (m, p).
        at: finds the numbers when θ is changed.
    """
    stated = np.array([system.interval(float(v), row) for v, row in zip(values, gradients, strict=True)])
    stated[~follows(values, gradients, system.covariance, at)] = (-np.inf, np.inf)
    return frozen_array(stated)


def follows(values: FloatArray, gradients: FloatArray, covariance: FloatArray, at: Changed) -> NDArray[np.bool_]:
    """Tell which numbers are where their gradients foretell, at the ends of the intervals of all of them, shape (m,).

    Args:
        values: of the numbers, shape (m,).
        gradients: their derivatives by some parameters, shape (m, p); nan where there is none.
        covariance: of the parameters, shape (p, p).
        at: finds the numbers when the parameters are changed.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        deviations = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", gradients, covariance, gradients), 0.0))
    found: NDArray[np.bool_] = np.isfinite(deviations)
    moved = np.flatnonzero(found & (deviations > 0.0))
    if not moved.size:
        return found
    ends = NORMAL_95 / deviations[moved, np.newaxis] * (gradients[moved] @ covariance)
    changes = np.concatenate([ends, -ends])
    most = BENT * NORMAL_95 * deviations + ROUNDING * (np.abs(values) + deviations)
    with np.errstate(invalid="ignore"):
        missed = np.abs(at(changes) - values - changes @ gradients.T)
        found &= (missed <= most).all(axis=0)
    return found
