"""The coefficient form of a model (CX, CZ or CL, and Cm), and its reduction to dα/dt and dq/dt at a stated condition.

Coefficients are polynomials over ``alpha_rad``, ``pitch_rate_1`` (q c / 2V, a pure number), ``elevator_rad`` and
further inputs. At constant airspeed V and density, in level flight (Klein & Morelli 2006, eq. 3.33 and 3.36),

    dα/dt = q - (q̄ S CL + T sin(α + ε)) / (m V) + g / V,    dq/dt = (q̄ S c Cm + T arm) / Iy,

with CL = CX sin α - CZ cos α. Drag moves V only, which is held, so CD does not enter. Sine and cosine are expanded
about α = 0 to a stated order: the reduction says how much of dα/dt that leaves out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.linalg import block_diag

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.model import VARIABLES, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError
from finback.identification.coefficient.airframe import Airframe
from finback.identification.coefficient.form import PITCH_RATE
from finback.identification.term import ALPHA, ELEVATOR
from finback.records import Condition

COEFFICIENT_VARIABLES: Final = (ALPHA, PITCH_RATE, ELEVATOR)
"""The first variables of every coefficient; further inputs follow."""

_Exponents = tuple[int, ...]
_CONSTANT: Final[_Exponents] = (0, 0, 0)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LiftCoefficients:
    """CL and Cm.

    Attributes:
        lift: CL, over ``COEFFICIENT_VARIABLES`` and further inputs.
        pitching: Cm, over the same variables.
        covariance: of all their coefficients, those of ``lift`` first.
    """

    lift: Polynomial
    pitching: Polynomial
    covariance: FloatArray


def reduced(
    coefficients: LiftCoefficients, airframe: Airframe, condition: Condition, *, thrust_order: int = 7
) -> PolynomialModel:
    """Return dα/dt and dq/dt at a condition, with the covariance carried exactly.

    Args:
        coefficients: CL and Cm.
        airframe: mass, geometry, thrust.
        condition: airspeed, density and gravity that are held.
        thrust_order: to which sin(α + ε) of the thrust is expanded about α = 0.

    Raises:
        InputError: the coefficients are over other variables.
    """
    force, moment, rate = scales(airframe, condition)
    _check(coefficients)
    known = known_rate(airframe, condition, thrust_order)
    turning: dict[_Exponents, float] = {}
    if airframe.thrust_arm_m:
        turning[_CONSTANT] = airframe.thrust_n * airframe.thrust_arm_m / airframe.pitch_inertia_kg_m2
    alpha_dot, first = _dimensional(coefficients.lift, -force, rate, known, "rad_s")
    q_dot, second = _dimensional(coefficients.pitching, moment, rate, turning, "rad_s2")
    carry = block_diag(first, second)
    return PolynomialModel(
        alpha_dot=alpha_dot, q_dot=q_dot, covariance=frozen_array(carry @ coefficients.covariance @ carry.T)
    )


def known_rate(airframe: Airframe, condition: Condition, thrust_order: int) -> dict[tuple[int, ...], float]:
    """Return what of dα/dt is no lift: exponents of (alpha, q, elevator) -> factor, in rad/s."""
    speed = condition.airspeed_m_s
    known: dict[_Exponents, float] = {(0, 1, 0): 1.0, _CONSTANT: condition.gravity_m_s2 / speed}
    if airframe.thrust_n:
        pull = airframe.thrust_n / (airframe.mass_kg * speed)
        cosine, sine = math.cos(airframe.thrust_angle_rad), math.sin(airframe.thrust_angle_rad)
        for series, share in ((sine_series(thrust_order), cosine), (cosine_series(thrust_order), sine)):
            for power, factor in series.items():
                key = (power, 0, 0)
                known[key] = known.get(key, 0.0) - pull * share * factor
    return known


def scales(airframe: Airframe, condition: Condition) -> tuple[float, float, float]:
    """Return q̄ S / (m V) in 1/s, q̄ S c / Iy in 1/s², and c / 2V in s."""
    speed = condition.airspeed_m_s
    load = 0.5 * condition.density_kg_m3 * speed**2 * airframe.wing_area_m2
    return (
        load / (airframe.mass_kg * speed),
        load * airframe.chord_m / airframe.pitch_inertia_kg_m2,
        airframe.chord_m / (2.0 * speed),
    )


def _check(coefficients: LiftCoefficients) -> None:
    for name, polynomial in (("lift", coefficients.lift), ("pitching", coefficients.pitching)):
        if polynomial.variables[:3] != COEFFICIENT_VARIABLES or polynomial.value_unit != "1":
            raise InputError(
                f"{name} is over {polynomial.variables} in {polynomial.value_unit}, expected {COEFFICIENT_VARIABLES} "
                "and further inputs, in 1",
                hint="name q c / 2V 'pitch_rate_1'",
            )


def _dimensional(
    polynomial: Polynomial, scale: float, rate: float, known: Mapping[_Exponents, float], unit: str
) -> tuple[Polynomial, FloatArray]:
    """Return scale · polynomial plus known terms, over q in place of q c / 2V, and how its coefficients came about."""
    rest = len(polynomial.variables) - 3
    powers = [tuple(row) for row in polynomial.powers.tolist()]
    added = [key for key in ((*exponents, *(0,) * rest) for exponents in known) if key not in powers]
    factors = scale * rate ** polynomial.powers[:, 1].astype(np.float64)
    values = np.concatenate([factors * polynomial.coefficients, np.zeros(len(added))])
    every = [*powers, *added]
    for exponents, value in known.items():
        values[every.index((*exponents, *(0,) * rest))] += value
    domain = polynomial.domain.copy()
    domain[1] /= rate
    result = Polynomial(
        variables=(*VARIABLES, *polynomial.variables[3:]),
        powers=np.array(every, dtype=np.int64),
        coefficients=frozen_array(values),
        value_unit=unit,
        domain=frozen_array(domain),
    )
    return result, np.vstack([np.diag(factors), np.zeros((len(added), factors.size))])


def sine_series(order: int) -> dict[int, float]:
    """Return the Taylor series of the sine: power -> factor."""
    return {k: (-1.0) ** (k // 2) / math.factorial(k) for k in range(1, order + 1, 2)}


def cosine_series(order: int) -> dict[int, float]:
    """Return the Taylor series of the cosine: power -> factor."""
    return {k: (-1.0) ** (k // 2) / math.factorial(k) for k in range(0, order + 1, 2)}
